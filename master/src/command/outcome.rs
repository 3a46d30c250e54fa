//! What came of a picture, in terms of exit codes.

use anyhow::anyhow;

use runtime::failure::{Failure, Success};
use runtime::files::Unsaved;
use runtime::stats::{Ending, RenderStats};

/// As [`finish`], for pictures that could be saved or not: one that is lost weighs more than how it came about.
pub(crate) fn conclude(stats: &RenderStats, drawn: bool, unsaved: &Unsaved) -> Result<Success, Failure> {
    let finished = finish(stats, drawn);
    match (unsaved.verdict(), finished) {
        (Ok(()), finished) => finished,
        (Err(lost), Ok(_)) => Err(lost.into()),
        (Err(lost), Err(other)) => Err(Failure::Failed(anyhow!("{lost}; besides, {other}"))),
    }
}

/// How it ended, in terms of exit codes.
pub(crate) fn finish(stats: &RenderStats, drawn: bool) -> Result<Success, Failure> {
    let fate =
        if drawn { "what was drawn by then is what there is" } else { "no frame was complete, so nothing was saved" };
    if let Some(first) = stats.gaps.first() {
        let count = stats.gaps.len();
        return Err(Failure::Incomplete(format!(
            "the picture has {count} gaps, the first {}: {}; {fate}",
            first.what, first.reason
        )));
    }
    if stats.ending == Ending::Interrupted && !drawn {
        tracing::warn!("{fate}");
    }
    match stats.ending {
        Ending::Enough => Ok(Success::Done),
        Ending::Interrupted => Ok(Success::Interrupted),
        Ending::NoWorkers => Err(Failure::NoWorkers(format!("no worker for longer than --wait; {fate}"))),
        Ending::Deserted => {
            Err(Failure::NoWorkers(format!("the time was over, and no worker was left to complete a frame; {fate}")))
        }
    }
}
