//! Questions from the wire are hostile until they have been here.

use scenes::Camera;

use super::{PICTURE_SIDE_MAX, REFERENCE_PIXELS_MAX, REFERENCE_SAMPLES_MAX, TILE_PIXELS_MAX, WireError, demand};
use crate::question::{
    Ask, FRAMES_MAX, Frames, GROUPS_MAX, Lights, Lit, PAIRS_MAX, POINTS_MAX, Part, Points, Question, Rays, Rect,
    Samples, Tile,
};

/// Looks at a question from the wire: what it asks can be computed, in bounded memory.
///
/// # Errors
/// [`WireError::Broken`] says what is out of range.
pub fn check_question(question: &Question) -> Result<(), WireError> {
    match &question.ask {
        Ask::Tile(tile) => check_tile(tile),
        Ask::Frames(frames) => check_frames(frames),
        Ask::Reference(samples) => check_samples(samples),
        Ask::Lights(lights) => check_lights(lights),
        Ask::Rays(rays) => check_rays(rays),
        Ask::Points(points) => check_points(points),
    }
}

fn check_tile(tile: &Tile) -> Result<(), WireError> {
    check_view(&tile.camera, tile.rect)?;
    check_lit(&tile.lit)?;
    demand(tile.grid().len() <= TILE_PIXELS_MAX, "a tile of more than 4 million pixels")
}

fn check_frames(frames: &Frames) -> Result<(), WireError> {
    check_tile(&frames.tile)?;
    demand((1..=FRAMES_MAX).contains(&frames.count), "a number of frames outside 1 … 16")?;
    demand(frames.tile.lit.frame.checked_add(u32::from(frames.count)).is_some(), "frames beyond number 2³²")
}

fn check_lights(lights: &Lights) -> Result<(), WireError> {
    let Camera { width, height, .. } = lights.camera;
    check_view(&lights.camera, Rect { x: 0, y: 0, width, height })?;
    check_lit(&lights.lit)
}

fn check_lit(lit: &Lit) -> Result<(), WireError> {
    lit.quality.check().map_err(|broken| WireError::Broken(broken.into()))?;
    demand(lit.set < lit.quality.sets(), "a light set beyond the interleaving")
}

fn check_rays(rays: &Rays) -> Result<(), WireError> {
    let Camera { width, height, .. } = rays.camera;
    check_view(&rays.camera, Rect { x: 0, y: 0, width, height })?;
    check_chosen(&rays.lit, rays.view.as_ref())?;
    check_count(rays.through.len())?;
    rays.through.iter().try_for_each(|ray| match &ray.aim {
        Some(aim) => demand(aim.is_inside(), "an aim outside of its triangle"),
        None => demand(ray.address.pixel[0] < width && ray.address.pixel[1] < height, "a ray beyond the picture"),
    })
}

fn check_points(points: &Points) -> Result<(), WireError> {
    check_chosen(&points.lit, points.view.as_ref())?;
    check_count(points.at.len())?;
    demand(points.at.iter().all(|point| point.at.is_inside()), "a point outside of its triangle")?;
    match &points.part {
        Part::All | Part::Direct | Part::Indirect => Ok(()),
        Part::DirectOf(groups) => {
            demand((1..=GROUPS_MAX).contains(&groups.len()), "a number of light groups outside 1 … 32")?;
            demand(groups.is_sorted_by(|a, b| a < b), "light groups that are not ascending")
        }
        Part::EachLight { count, .. } => {
            let pairs = points.at.len() as u64 * u64::from(*count);
            demand((1..=PAIRS_MAX as u64).contains(&pairs), "a number of pairs of points and lights outside 1 … 524288")
        }
        Part::Towards(eye) => demand(eye.is_finite(), "an eye that is nowhere"),
    }
}

fn check_count(count: usize) -> Result<(), WireError> {
    demand((1..=POINTS_MAX).contains(&count), "a number of rays or points outside 1 … 4096")
}

/// A light set can be made: whoever chooses light by what it brings to a view must say to which.
fn check_chosen(lit: &Lit, view: Option<&Camera>) -> Result<(), WireError> {
    check_lit(lit)?;
    demand(!lit.quality.importance || view.is_some(), "light chosen for a view that is not named")?;
    view.map_or(Ok(()), |view| check_view(view, Rect { x: 0, y: 0, width: view.width, height: view.height }))
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
