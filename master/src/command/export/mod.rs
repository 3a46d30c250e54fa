//! `igi-master export`: a scene in another renderer's format, so that anybody can check ours against it.

mod mitsuba;
mod ply;

use crate::cli::ExportArgs;
use runtime::failure::{Failure, Success};

pub use mitsuba::{Exported, mitsuba};

/// Writes the scene, and says what cannot be said in the other format.
///
/// # Errors
/// [`Failure`] if the scene cannot be read, or a file cannot be written.
pub fn export(args: &ExportArgs) -> Result<Success, Failure> {
    let mut scene = scenes::read::load_at(&args.scene, args.time)?.scene;
    if let Some(size) = args.size {
        (scene.camera.width, scene.camera.height) = (size.width, size.height);
    }
    let exported = mitsuba(&scene, &args.mitsuba)?;
    exported.notes.iter().for_each(|note| eprintln!("{note}"));
    eprintln!("saved {}", exported.file.display());
    Ok(Success::Done)
}
