//! What happened: pictures of every method, run by run, as they grew.

use frame::Picture;
use frame::parts::Undenoised;
use protocol::answer::Cost;

use runtime::stopwatch::Elapsed;

/// A way in which a method's picture can be shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    /// As a person would see it: filtered, if the method filters.
    Shown,
    /// The plain mean of the samples.
    Raw,
}

/// How the squared error of a method ought to fall: time to this power.
pub type Slope = f64;

/// What a method is.
#[derive(Clone, Debug)]
pub struct Description {
    /// For plots and tables.
    pub name: String,
    /// Everything that repeats it: flags, or a command.
    pub settings: String,
    /// The views there are, in the order of [`Look::pictures`].
    pub views: Vec<View>,
    /// What theory says about its error.
    pub expected: Slope,
    /// A path tracer, ours or somebody else's, to be compared with.
    pub is_rival: bool,
}

/// All that a method did with a scene.
#[derive(Debug)]
pub struct Record {
    /// What it is.
    pub method: Description,
    /// Seconds until it could begin, once; not part of any run.
    pub preparation: f64,
    /// What it drew; runs that were interrupted included, as far as they came.
    pub runs: Vec<Run>,
    /// Why there is nothing, or less than there should be.
    pub trouble: Option<String>,
}

/// One run with a seed of its own.
#[derive(Debug, Default)]
pub struct Run {
    /// After 2ⁿ samples, by n; nothing where several frames came at once, and none had just so many.
    pub powers: Vec<Option<Look>>,
    /// At the first frame after each mark.
    pub marks: Vec<Option<Look>>,
}

/// A look at a picture that grows.
#[derive(Clone, Debug)]
pub struct Look {
    /// Frames, or samples a pixel.
    pub samples: u64,
    /// What it took.
    pub elapsed: Elapsed,
    /// Counters, where the method has them.
    pub cost: Cost,
    /// Bytes of answers, packed.
    pub bytes: u64,
    /// One for each of [`Description::views`].
    pub pictures: Vec<Picture>,
    /// What is to be denoised before there are pictures.
    pub undenoised: Option<Undenoised>,
}

impl Record {
    /// Nothing happened yet.
    pub fn new(method: Description) -> Self {
        Self { method, preparation: 0.0, runs: Vec::new(), trouble: None }
    }
}

impl Run {
    /// Nothing seen yet.
    pub fn new(marks: usize) -> Self {
        Self { powers: Vec::new(), marks: vec![None; marks] }
    }

    /// Keeps a look where it belongs.
    pub fn keep(&mut self, passed: &frame::metrics::Passed, look: Look) {
        passed.marks.iter().for_each(|mark| self.marks[*mark] = Some(look.clone()));
        if passed.power {
            let number = look.samples.trailing_zeros() as usize;
            self.powers.resize(self.powers.len().max(number + 1), None);
            self.powers[number] = Some(look);
        }
    }
}
