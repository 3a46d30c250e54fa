//! Questions from the wire are hostile until they have been here.

use super::{PHOTONS_MAX, PICTURE_SIDE_MAX, TILE_PIXELS_MAX, WireError, demand};
use crate::question::{Ask, Bound, Quality, Question};

/// Looks at a question from the wire: what it asks can be computed, in bounded memory.
///
/// # Errors
/// [`WireError::Broken`] says what is out of range.
pub fn check_question(question: &Question) -> Result<(), WireError> {
    let Ask::Tile(tile) = &question.ask;
    tile.camera.check().map_err(WireError::Broken)?;
    let (width, height) = (tile.camera.width, tile.camera.height);
    demand(width.max(height) <= PICTURE_SIDE_MAX, "a picture of more than 65536 pixels a side")?;
    let rect = tile.rect;
    demand(rect.width > 0 && rect.height > 0, "an empty rectangle")?;
    let within = rect.x.saturating_add(rect.width) <= width && rect.y.saturating_add(rect.height) <= height;
    demand(within, "a rectangle beyond the picture")?;
    check_quality(&tile.quality)?;
    demand(tile.set < tile.quality.sets(), "a light set beyond the interleaving")?;
    demand(tile.grid().len() <= TILE_PIXELS_MAX, "a tile of more than 4 million pixels")
}

fn check_quality(quality: &Quality) -> Result<(), WireError> {
    let counts = |n: u8| (1..=16).contains(&n);
    demand(quality.interleave.into_iter().all(counts), "an interleaving outside 1 … 16")?;
    demand(counts(quality.randomisations), "a number of randomisations outside 1 … 16")?;
    demand(quality.photons <= PHOTONS_MAX, "more than 16 million photons a set")?;
    demand(quality.photon_radius > 0.0 && quality.photon_radius.is_finite(), "a photon radius that is not positive")?;
    demand(quality.max_length != Some(0), "light paths of length 0")?;
    match quality.bound {
        Bound::None => Ok(()),
        Bound::Clip { distance } | Bound::Geometry { distance } | Bound::Smooth { distance } => {
            demand(distance >= 0.0 && distance.is_finite(), "a bound that is negative or not finite")
        }
    }
}
