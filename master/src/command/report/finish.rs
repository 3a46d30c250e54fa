//! Pictures that are denoised before they are judged, with the time that this takes on the clock.
//!
//! Whoever denoises has less time to sample. So a run looks at its picture earlier than it is due, by what denoising is known
//! to take; when the run is over, each look's picture is denoised, and what that took is added to the look's time. Nobody
//! samples meanwhile, and no look pays for the one before.

use std::cell::RefCell;
use std::path::Path;

use anyhow::anyhow;
use frame::Picture;
use frame::parts::Undenoised;

use super::record::{Look, Run};
use super::settings::Measurement;
use runtime::denoise::{Denoiser, Place, Trouble};
use runtime::stopwatch::{Elapsed, StopWatch};

/// Methods and renderers whose names end so are denoised.
pub const DENOISED: &str = "+oidn";

/// A denoiser.
pub struct Finish(RefCell<Denoiser>);

impl Finish {
    /// Opens it.
    ///
    /// # Errors
    /// It is not installed.
    pub fn open(oidn: Option<&Path>) -> anyhow::Result<Self> {
        let denoiser = Denoiser::open(oidn, Place::Processor).map_err(|reason| anyhow!(reason))?;
        Ok(Self(RefCell::new(denoiser)))
    }

    /// Its name and version, to be added to how a picture is made.
    pub fn said(&self) -> String {
        format!("; denoised by {}", self.0.borrow().name())
    }

    /// The measurement of a run whose pictures of this size are denoised in the end.
    ///
    /// # Errors
    /// The denoiser's.
    pub fn shortened(&self, measurement: &Measurement, [width, height]: [u32; 2]) -> anyhow::Result<Measurement> {
        let black = || Picture::black(width, height);
        let nothing = Undenoised::foreign(black(), black(), black());
        // The first of a size takes longer.
        self.denoise(&nothing)?;
        let clock = measurement.clock;
        let cost = clock.seconds(self.denoise(&nothing)?.1);
        let marks = measurement.marks.iter().map(|mark| (mark - cost).max(0.0)).collect();
        Ok(Measurement { seconds: (measurement.seconds - cost).max(0.0), marks, ..*measurement })
    }

    /// Denoises what was looked at in a run.
    ///
    /// # Errors
    /// The denoiser's.
    pub fn finish(&self, run: &mut Run) -> anyhow::Result<()> {
        run.powers.iter_mut().chain(&mut run.marks).flatten().try_for_each(|look| self.finish_look(look))
    }

    fn finish_look(&self, look: &mut Look) -> anyhow::Result<()> {
        let Some(undenoised) = look.undenoised.take() else { return Ok(()) };
        let (picture, cost) = self.denoise(&undenoised)?;
        look.pictures = vec![picture];
        look.elapsed = Elapsed { wall: look.elapsed.wall + cost.wall, cpu: look.elapsed.cpu + cost.cpu };
        Ok(())
    }

    fn denoise(&self, undenoised: &Undenoised) -> anyhow::Result<(Picture, Elapsed)> {
        let watch = StopWatch::start();
        let denoised = self.0.borrow_mut().denoise(undenoised);
        let cost = watch.elapsed();
        match denoised {
            Ok(picture) => Ok((picture, cost)),
            Err(Trouble::Stopped) => Err(anyhow!("denoising was stopped")),
            Err(Trouble::Failed(reason)) => Err(anyhow!("denoising failed: {reason}")),
        }
    }
}
