//! Questions from the wire are hostile until they have been here.

use scenes::Camera;

use super::{
    PHOTONS_MAX, PICTURE_SIDE_MAX, REFERENCE_PIXELS_MAX, REFERENCE_SAMPLES_MAX, TILE_PIXELS_MAX, WireError, demand,
};
use crate::question::{Ask, Bound, Lights, Lit, Quality, Question, Rect, Samples, Tile};

/// Looks at a question from the wire: what it asks can be computed, in bounded memory.
///
/// # Errors
/// [`WireError::Broken`] says what is out of range.
pub fn check_question(question: &Question) -> Result<(), WireError> {
    match &question.ask {
        Ask::Tile(tile) => check_tile(tile),
        Ask::Reference(samples) => check_samples(samples),
        Ask::Lights(lights) => check_lights(lights),
    }
}

fn check_tile(tile: &Tile) -> Result<(), WireError> {
    check_view(&tile.camera, tile.rect)?;
    check_lit(&tile.lit)?;
    demand(tile.grid().len() <= TILE_PIXELS_MAX, "a tile of more than 4 million pixels")
}

fn check_lights(lights: &Lights) -> Result<(), WireError> {
    let Camera { width, height, .. } = lights.camera;
    check_view(&lights.camera, Rect { x: 0, y: 0, width, height })?;
    check_lit(&lights.lit)
}

fn check_lit(lit: &Lit) -> Result<(), WireError> {
    check_quality(&lit.quality)?;
    demand(lit.set < lit.quality.sets(), "a light set beyond the interleaving")
}

fn check_samples(samples: &Samples) -> Result<(), WireError> {
    check_view(&samples.camera, samples.rect)?;
    let pixels = samples.rect.len();
    demand(pixels <= REFERENCE_PIXELS_MAX, "a rectangle of more than a million reference pixels")?;
    demand(samples.count > 0, "no sample at all")?;
    demand(samples.first.checked_add(samples.count).is_some(), "samples beyond number 2³²")?;
    let all = pixels as u64 * u64::from(samples.count);
    demand(all <= REFERENCE_SAMPLES_MAX, "more than 268 million samples")
}

fn check_view(camera: &Camera, rect: Rect) -> Result<(), WireError> {
    camera.check().map_err(WireError::Broken)?;
    let (width, height) = (camera.width, camera.height);
    demand(width.max(height) <= PICTURE_SIDE_MAX, "a picture of more than 65536 pixels a side")?;
    demand(rect.width > 0 && rect.height > 0, "an empty rectangle")?;
    let within = rect.x.saturating_add(rect.width) <= width && rect.y.saturating_add(rect.height) <= height;
    demand(within, "a rectangle beyond the picture")
}

/// Looks at knobs from outside: light sets of them can be made, in bounded memory.
///
/// # Errors
/// [`WireError::Broken`] says what is out of range.
pub fn check_quality(quality: &Quality) -> Result<(), WireError> {
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
