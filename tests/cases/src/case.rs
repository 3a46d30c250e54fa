//! What a case is, and what comes of running one.

use scenes::Scene;

/// A scene, and what its camera sees. All channels are alike.
#[derive(Clone, Debug)]
pub struct Exact {
    /// For messages.
    pub name: String,
    /// What to render.
    pub scene: Scene,
    /// Mean radiance over the picture.
    pub radiance: f64,
    /// Relative error that is not a renderer's fault: tessellation, single precision.
    pub tolerance: f64,
}

/// Something that is known about light, pictures or the machinery, and how to find out.
#[derive(Clone, Copy)]
pub struct Case {
    /// Row of the table of stiff and extreme cases; from 44 on our own.
    pub row: u8,
    /// Unique among all cases; what is typed after `selftest`.
    pub name: &'static str,
    /// What goes wrong where it fails.
    pub teaches: &'static str,
    /// Whether it is quick.
    pub pace: Pace,
    /// Whom it concerns.
    pub methods: &'static [Method],
    /// Finds out.
    pub run: fn(&Trial) -> Vec<Finding>,
}

/// How long a case takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// Part of every test run.
    Quick,
    /// Only when asked for.
    Long,
}

/// An estimator, or none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Method {
    /// Everything on: no bias.
    Igi,
    /// Bounded virtual lights without compensation: corners are too dark, by a known amount.
    Bounded,
    /// The settings of the 2002 paper: clipped distances, light paths of four vertices, one kind of caustic.
    Paper,
    /// Path tracing, which shares only geometry and materials with the others: no bias.
    Reference,
    /// No light: codecs, schedules, sums.
    Machinery,
}

/// How exactly it is to be known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// Four standard errors are at most eight per cent: for what can hardly be measured better.
    Rough,
    /// Four standard errors are at most two per cent: a bias of four cannot pass. For every commit.
    Brief,
    /// Four standard errors are at most one per cent: a bias of two cannot pass. For whoever asks, in minutes.
    Usual,
    /// Four standard errors are at most half a per cent: a bias of one cannot pass.
    Thorough,
    /// Four standard errors are at most a quarter of a per cent, or what the table tolerates.
    Long,
}

/// The circumstances of a run.
pub struct Trial<'a> {
    /// Which estimator.
    pub method: Method,
    /// How exactly.
    pub effort: Effort,
    /// Number of threads; changes no result.
    pub threads: usize,
    /// Microseconds; only for notes that are printed.
    pub clock: &'a (dyn Fn() -> u64 + Sync),
    /// Nobody wants to know any more: what is measured ends soon, as no number.
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

/// One number beside what it should be.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Of what.
    pub what: String,
    /// What it should be.
    pub expected: f64,
    /// What it is.
    pub got: f64,
    /// Standard error of `got`; 0 where nothing is random.
    pub error: f64,
    /// Deviation, absolute, that is nobody's fault.
    pub tolerance: f64,
    /// Four standard errors, absolute, must be below this for the number to mean something.
    pub resolution: f64,
    /// Anything worth a word, such as a time.
    pub note: String,
}

/// What to think of a finding.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// As it should be.
    Right,
    /// Not as it should be.
    Wrong,
    /// The noise is too large to tell.
    Unclear,
    /// Wrong in a way that is written down in [`crate::known`]; the words say why.
    Known(&'static str),
    /// Written down as wrong, and right: the note in [`crate::known`] is out of date.
    Mended,
}

/// Standard errors that chance is allowed to take.
pub const SIGMAS: f64 = 4.0;

impl Method {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Igi, Self::Bounded, Self::Paper, Self::Reference, Self::Machinery];
    /// The estimators by virtual lights.
    pub const VIRTUAL: &[Self] = &[Self::Igi, Self::Bounded, Self::Paper];
    /// The estimators.
    pub const LIGHT: &[Self] = &[Self::Igi, Self::Bounded, Self::Paper, Self::Reference];
    /// Those that converge to the truth.
    pub const UNBIASED: &[Self] = &[Self::Igi, Self::Reference];

    /// It converges to the truth.
    pub fn is_unbiased(self) -> bool {
        Self::UNBIASED.contains(&self)
    }

    /// As it is typed.
    pub fn name(self) -> &'static str {
        match self {
            Self::Igi => "igi",
            Self::Bounded => "igi-bounded",
            Self::Paper => "igi-paper",
            Self::Reference => "reference",
            Self::Machinery => "machinery",
        }
    }
}

impl Effort {
    /// What four standard errors have to be below, relative to what is expected.
    pub fn resolution(self) -> f64 {
        match self {
            Self::Rough => 0.08,
            Self::Brief => 0.02,
            Self::Usual => 0.01,
            Self::Thorough => 5e-3,
            Self::Long => 2.5e-3,
        }
    }
}

impl Finding {
    /// A number that nothing random touches. `tolerance` is relative to what is expected.
    pub fn exact(what: impl Into<String>, expected: f64, got: f64, tolerance: f64) -> Self {
        let tolerance = tolerance * expected.abs();
        Self { what: what.into(), expected, got, error: 0.0, tolerance, resolution: 0.0, note: String::new() }
    }

    /// How many things are not as they should be; none is right.
    pub fn none(what: impl Into<String>, count: usize) -> Self {
        Self::exact(what, 0.0, count as f64, 0.0)
    }

    /// Something that has to hold.
    pub fn holds(what: impl Into<String>, holds: bool) -> Self {
        Self::exact(what, 1.0, f64::from(u8::from(holds)), 0.0)
    }

    /// Adds a word.
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// Standard errors between what is and what should be; none where nothing is random.
    pub fn z(&self) -> Option<f64> {
        (self.error > 0.0).then(|| (self.got - self.expected) / self.error)
    }

    /// How far from what is expected it can be at most, at [`SIGMAS`] standard errors: a bias larger than this has
    /// not gone unnoticed. Relative; absolute where nothing is expected.
    pub fn within(&self) -> f64 {
        self.relative((self.got - self.expected).abs() + SIGMAS * self.error)
    }

    /// The part of [`Self::within`] that is nobody's fault.
    pub fn slack(&self) -> f64 {
        self.relative(self.tolerance)
    }

    fn relative(&self, deviation: f64) -> f64 {
        if self.expected == 0.0 { deviation } else { deviation / self.expected.abs() }
    }

    /// Judges by the numbers alone.
    pub fn verdict(&self) -> Verdict {
        let off = (self.got - self.expected).abs();
        if !off.is_finite() || !self.error.is_finite() || off > self.tolerance + SIGMAS * self.error {
            return Verdict::Wrong;
        }
        if SIGMAS * self.error > self.resolution { Verdict::Unclear } else { Verdict::Right }
    }
}

impl Verdict {
    /// Nobody has to do anything.
    pub fn is_fine(&self) -> bool {
        matches!(self, Self::Right | Self::Known(_))
    }
}

impl Case {
    /// The verdict on one of its findings, known failures considered.
    pub fn judge(&self, method: Method, finding: &Finding) -> Verdict {
        let verdict = finding.verdict();
        match (crate::known::reason(self.name, method, &finding.what), verdict) {
            (Some(reason), Verdict::Wrong) => Verdict::Known(reason),
            (Some(_), Verdict::Right) => Verdict::Mended,
            (_, verdict) => verdict,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn finding(got: f64, error: f64) -> Finding {
        Finding { error, resolution: 5e-3, ..Finding::exact("x", 1.0, got, 1e-3) }
    }

    #[test]
    fn a_bias_of_one_per_cent_cannot_pass() {
        // The noisiest estimate that is let through at all, off by three of its standard errors.
        let error = 5e-3 / SIGMAS;
        assert_eq!(finding(0.99 + 2.9 * error, error).verdict(), Verdict::Wrong);
        assert_eq!(finding(1.0 + 3.9 * error, error).verdict(), Verdict::Right);
    }

    #[test]
    fn what_passes_is_known_to_twice_the_resolution() {
        for effort in [Effort::Rough, Effort::Brief, Effort::Usual, Effort::Thorough, Effort::Long] {
            let (resolution, error) = (effort.resolution(), effort.resolution() / SIGMAS);
            // The noisiest that passes, as far off as passes.
            let worst = Finding { error, resolution, ..Finding::exact("x", 1.0, 1.0 + 0.999 * resolution, 0.0) };
            assert_eq!(worst.verdict(), Verdict::Right);
            assert!(worst.within() <= 2.0 * resolution, "{effort:?}: {}", worst.within());
        }
        assert_eq!(Finding::exact("x", -2.0, -3.0, 0.1).within(), 0.5);
        assert_eq!(Finding::exact("x", 0.0, 3.0, 0.1).within(), 3.0, "absolute where nothing is expected");
    }

    #[test]
    fn noise_is_no_excuse_and_neither_is_nan() {
        assert_eq!(finding(1.0, 0.01).verdict(), Verdict::Unclear);
        assert_eq!(finding(f64::NAN, 0.001).verdict(), Verdict::Wrong);
        assert_eq!(finding(f64::INFINITY, 0.001).verdict(), Verdict::Wrong);
        assert_eq!(Finding::none("x", 1).verdict(), Verdict::Wrong);
        assert_eq!(Finding::holds("x", false).verdict(), Verdict::Wrong);
    }
}
