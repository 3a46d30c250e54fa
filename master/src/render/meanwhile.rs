//! What happens to a picture while it is drawn: it is kept for a crash, saved for programs that look at files, and shown.

use std::time::{Duration, Instant};

use anyhow::Context;
use frame::{FrontEnd, Igi, Layer};

use super::{duration, encode};
use crate::checkpoint::Keeper;
use crate::cli::RenderArgs;
use crate::conduct::{Tally, Watched};
use crate::files::{Output, name_of, write_whole};
use crate::show::tev::Tev;

/// Looks at the picture whenever a frame is complete.
pub(crate) struct Meanwhile<'a> {
    args: &'a RenderArgs,
    outputs: &'a [Output],
    keeper: Option<Keeper>,
    autosave: Option<Due>,
    tev: Option<Tev>,
}

impl<'a> Meanwhile<'a> {
    /// As the command line says; what is saved now and then goes to `outputs`.
    ///
    /// # Errors
    /// The system has no more threads.
    pub(crate) fn new(args: &'a RenderArgs, outputs: &'a [Output], keeper: Option<Keeper>) -> anyhow::Result<Self> {
        let tev = args.tev.clone().map(|address| Tev::start(address, &name_of(&args.scene)));
        let tev = tev.transpose().context("cannot start a thread")?;
        let autosave = args.autosave.map(|seconds| Due { every: duration(seconds), last: Instant::now() });
        Ok(Self { args, outputs, keeper, autosave, tev })
    }

    /// A frame is complete. What goes wrong here is said, and stops nothing.
    pub(crate) fn look(&mut self, front: &mut Igi, tally: &Tally) -> Watched {
        let kept = self.keeper.as_mut().map_or(Ok(()), |keeper| keeper.keep_if_due(front, tally.elapsed));
        if let Err(error) = kept {
            tracing::warn!("what is drawn so far was not kept: {error:#}");
        }
        if self.autosave.as_mut().is_some_and(Due::is_due) {
            let args = self.args;
            let save = |output: &Output| write_whole(&output.path, &encode(output, args, args.time, front, tally)?);
            if let Err(error) = self.outputs.iter().try_for_each(save) {
                tracing::warn!("what is drawn so far was not saved: {error:#}");
            }
        }
        if let Some(tev) = self.tev.as_mut().filter(|tev| tev.is_due()) {
            tev.show(front.show(Layer::Final));
        }
        Watched::GoOn
    }

    /// The picture is done.
    ///
    /// # Errors
    /// It cannot be kept.
    pub(crate) fn end(&mut self, front: &mut Igi, tally: &Tally) -> anyhow::Result<()> {
        if let (Some(tev), true) = (&mut self.tev, front.frames() > 0) {
            tev.show(front.show(Layer::Final));
        }
        self.keeper.as_mut().map_or(Ok(()), |keeper| keeper.keep(front, tally.elapsed))
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
