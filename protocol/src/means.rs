//! The mean of what the eye meets in several frames, and how it is made of the answers about each.

use std::f64::consts::FRAC_1_PI;

use glam::DVec3;
use scenes::Rgb;

use crate::answer::{Answer, Body, Cost, Pixels};
use crate::pack::drop_unsound;
use crate::question::{Frames, Tile};

/// Mean radiance of several frames, one entry a pixel of their [`crate::question::Grid`], in its order. What the scene cannot
/// have at all is empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Means {
    /// Of [`Pixels::emitted`]: what must not be filtered.
    pub emitted: Vec<Rgb>,
    /// Of [`Pixels::reflectance`] · [`Pixels::irradiance`] / π.
    pub reflected: Vec<Rgb>,
}

impl Means {
    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.emitted.len().max(self.reflected.len())
    }

    /// No pixel at all.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Room for `len` pixels, all black.
    pub fn black(len: usize) -> Self {
        Self { emitted: vec![Rgb::ZERO; len], reflected: vec![Rgb::ZERO; len] }
    }
}

/// Answers a question about several frames by the answers about each, in order. Sums are in `f64`. A pixel that is unsound in
/// a frame counts as black in it, and in [`Cost::dropped`].
///
/// # Errors
/// That of the first frame that has no answer.
pub fn over_frames<E>(frames: &Frames, mut answer: impl FnMut(Tile) -> Result<Answer, E>) -> Result<Answer, E> {
    let len = frames.tile.grid().len();
    let mut sums = [vec![DVec3::ZERO; len], vec![DVec3::ZERO; len]];
    let mut cost = Cost::default();
    for tile in frames.tiles() {
        let mut one = answer(tile)?;
        cost += one.cost;
        cost.dropped += drop_unsound(&mut one.body);
        if let Body::Pixels(pixels) = &one.body {
            add(&mut sums, pixels);
        }
    }
    let count = f64::from(frames.count.max(1));
    let [emitted, reflected] = sums.map(|sums| sums.into_iter().map(|sum| (sum / count).as_vec3()).collect());
    Ok(Answer { body: Body::Means(Means { emitted, reflected }), cost })
}

fn add([emitted, reflected]: &mut [Vec<DVec3>; 2], pixels: &Pixels) {
    for (sum, value) in emitted.iter_mut().zip(&pixels.emitted) {
        *sum += value.as_dvec3();
    }
    let products = pixels.reflectance.iter().zip(&pixels.irradiance);
    for (sum, (reflectance, irradiance)) in reflected.iter_mut().zip(products) {
        *sum += reflectance.as_dvec3() * irradiance.as_dvec3() * FRAC_1_PI;
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use scenes::Camera;

    use super::*;
    use crate::question::{Lit, Motion, Quality, Rect};

    fn frames(count: u16) -> Frames {
        let lit = Lit { set: 7, frame: 9, seed: 0, quality: Quality::default() };
        let rect = Rect { x: 0, y: 0, width: 9, height: 3 };
        Frames { tile: Tile { camera: Camera::default(), rect, lit }, count }
    }

    /// A frame as bright as its number.
    fn bright(tile: &Tile) -> Answer {
        let mut pixels = Pixels::black(tile.grid().len());
        pixels.emitted.fill(Vec3::splat(tile.lit.frame as f32));
        pixels.reflectance.fill(Vec3::splat(0.5));
        pixels.irradiance.fill(Vec3::splat(tile.lit.frame as f32 * 2.0 * std::f32::consts::PI));
        let cost = Cost { eye_rays: 3, ..Cost::default() };
        Answer { body: Body::Pixels(pixels), cost }
    }

    #[test]
    fn it_is_the_mean_of_all_frames_and_costs_their_sum() {
        let mut seen = Vec::new();
        let answer = over_frames(&frames(9), |tile| {
            seen.push((tile.lit.frame, tile.lit.set));
            Ok::<_, ()>(bright(&tile))
        });
        let Ok(Answer { body: Body::Means(means), cost }) = answer else { panic!("{answer:?}") };
        assert_eq!(seen, [(9, 7), (10, 8), (11, 0), (12, 1), (13, 2), (14, 3), (15, 4), (16, 5), (17, 6)]);
        assert_eq!((means.len(), cost.eye_rays), (3, 27));
        assert!(means.emitted.iter().all(|mean| *mean == Vec3::splat(13.0)));
        assert!(means.reflected.iter().all(|mean| (*mean - Vec3::splat(13.0)).abs().max_element() < 1e-5));
    }

    #[test]
    fn all_frames_are_about_the_same_pixels_whatever_moves() {
        for motion in [Motion::Still, Motion::Moving, Motion::Fresh] {
            let mut frames = frames(9);
            frames.tile.lit.quality.motion = motion;
            assert!(frames.tiles().all(|tile| tile.grid() == frames.tile.grid()), "{motion:?}");
        }
    }

    #[test]
    fn an_unsound_pixel_is_black_in_its_frame_only() {
        let spoilt = |tile: Tile| {
            let mut answer = bright(&tile);
            if let (Body::Pixels(pixels), 10) = (&mut answer.body, tile.lit.frame) {
                pixels.emitted[1].y = f32::NAN;
            }
            Ok::<_, ()>(answer)
        };
        let Ok(Answer { body: Body::Means(means), cost }) = over_frames(&frames(2), spoilt) else {
            panic!("no answer")
        };
        assert_eq!(means.emitted, [9.5, 4.5, 9.5].map(Vec3::splat));
        assert_eq!(cost.dropped, 1);
    }

    #[test]
    fn who_gives_up_has_no_answer() {
        let mut left = 3;
        let answer = over_frames(&frames(9), |tile| {
            left -= 1;
            if left > 0 { Ok(bright(&tile)) } else { Err("enough") }
        });
        assert_eq!((answer, left), (Err("enough"), 0));
    }
}
