//! What happens to a picture while it is drawn: it is kept for a crash, saved for programs that look at files, and shown.

use std::time::{Duration, Instant};

use anyhow::Context;
use frame::{FrontEnd, Plane};

use super::saving::Saver;
use super::settings::Settings;
use runtime::checkpoint::CheckpointFolder;
use runtime::files::{Fallback, Output, Unsaved, name_of};
use runtime::render_loop::Watched;
use runtime::show::tev::Tev;
use runtime::stats::RenderStats;

/// Looks at the picture whenever a frame is complete.
pub(crate) struct Meanwhile<'a> {
    saver: &'a Saver,
    /// Moment that is drawn.
    time: f64,
    outputs: &'a [Output],
    checkpoint: Option<CheckpointFolder>,
    unkept: Trouble,
    /// How often the picture has begun again.
    begun_again: u32,
    autosave: Option<Due>,
    unsaved: Trouble,
    tev: Option<Tev>,
}

impl<'a> Meanwhile<'a> {
    /// As the command line says, of a scene at a time; what is saved now and then goes to these outputs.
    ///
    /// # Errors
    /// The system has no more threads.
    pub(crate) fn new(
        settings: &Settings,
        time: f64,
        (saver, outputs): (&'a Saver, &'a [Output]),
        checkpoint: Option<CheckpointFolder>,
    ) -> anyhow::Result<Self> {
        let tev = settings.tev.clone().map(|address| Tev::start(address, &name_of(&settings.scene)));
        let tev = tev.transpose().context("cannot start a thread")?;
        let autosave = settings.autosave.map(|every| Due { every, last: Instant::now() });
        let (unkept, unsaved) = (Trouble::default(), Trouble::default());
        Ok(Self { saver, time, outputs, checkpoint, unkept, begun_again: 0, autosave, unsaved, tev })
    }

    /// A frame is complete, or the picture begins again. What goes wrong here is said, and stops nothing.
    pub(crate) fn look(&mut self, front: &mut dyn FrontEnd, stats: &RenderStats) -> Watched {
        // What was kept before is wrong.
        let begins_again = stats.begun_again != self.begun_again;
        self.begun_again = stats.begun_again;
        if begins_again || self.checkpoint.as_ref().is_some_and(CheckpointFolder::is_due) {
            self.keep(front, stats);
        }
        if front.frames() == 0 {
            return Watched::GoOn;
        }
        if self.autosave.as_mut().is_some_and(Due::is_due) {
            let mut unsaved = Unsaved::new(Fallback::Nothing);
            let finished = self.saver.finished(front);
            if let Some(flaw) = &finished.flaw {
                unsaved.regret(flaw);
            }
            for output in self.outputs {
                // It is remembered.
                let _ = unsaved.write(&output.path, self.saver.encode(output, &finished, self.time, front, stats));
            }
            self.unsaved.report("what is drawn so far was not saved", unsaved.verdict());
        }
        if let Some(tev) = self.tev.as_mut().filter(|tev| tev.is_due()) {
            tev.show(front.show(Plane::Final));
        }
        Watched::GoOn
    }

    /// The picture is done.
    pub(crate) fn end(&mut self, front: &mut dyn FrontEnd, stats: &RenderStats) {
        if let (Some(tev), true) = (&mut self.tev, front.frames() > 0) {
            tev.show(front.show(Plane::Final));
        }
        self.keep(front, stats);
    }

    /// Keeps the picture in its folder, if it has one.
    fn keep(&mut self, front: &dyn FrontEnd, stats: &RenderStats) {
        if let Some(checkpoint) = &mut self.checkpoint {
            self.unkept.report("what is drawn so far was not kept", checkpoint.keep(front, stats.elapsed));
        }
    }
}

/// Something that fails again and again is told once for each reason.
#[derive(Debug, Default)]
struct Trouble(Option<String>);

impl Trouble {
    fn report(&mut self, what: &str, outcome: anyhow::Result<()>) {
        let reason = outcome.err().map(|error| format!("{error:#}"));
        if let Some(reason) = reason.as_ref().filter(|reason| self.0.as_ref() != Some(reason)) {
            tracing::warn!("{what}, and drawing goes on: {reason}");
        }
        self.0 = reason;
    }
}

/// Says now and then that it is time.
struct Due {
    every: Duration,
    last: Instant,
}

impl Due {
    /// It is time; not again until the next.
    fn is_due(&mut self) -> bool {
        let due = self.last.elapsed() >= self.every;
        if due {
            self.last = Instant::now();
        }
        due
    }
}
