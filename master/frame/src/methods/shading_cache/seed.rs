//! A still picture as light at vertices: when something moves again, what was seen is what the cache begins with.
//!
//! Patches are divided until each is even, or small; then a vertex is the mean of the pixels around it, near ones more. Pixels
//! beside which something else is seen are left out: they are mixtures.

use std::f32::consts::PI;

use glam::Vec3;
use scenes::Scene;

use super::cache::Cache;
use super::mesh::{LEVELS_MAX, Leaf, NONE};
use crate::Picture;
use crate::front_end::View;
use crate::parts::{Appearance, Finish};

/// A patch of more pixels is divided if their light differs by more than this share of its mean …
const UNEVEN: f32 = 0.04;
/// … and if it has so many pixels; so many are divided anyway.
const PIXELS_LEAST: u32 = 12;
const PIXELS_MOST: u32 = 400;
/// Of what reflects less, light tells nothing of the irradiance.
const DARK: f32 = 0.02;

impl Cache {
    /// Takes over a still picture of what was looked at last.
    pub(super) fn seed(&mut self, view: &View, shown: &Picture, frames: u32) {
        if [shown.width, shown.height] != [view.camera.width, view.camera.height] {
            return;
        }
        self.look(view);
        self.locate(&view.scene);
        let lights = self.lights_seen(&view.scene, shown);
        for _ in 0..LEVELS_MAX {
            if !self.divide_uneven(&lights) {
                break;
            }
            self.locate(&view.scene);
        }
        self.settle(view, &lights, frames);
    }

    /// Of each pixel, what its leaf keeps; `None` where that cannot be told.
    fn lights_seen(&self, scene: &Scene, shown: &Picture) -> Vec<Option<Vec3>> {
        let (width, seen) = (shown.width as usize, &self.leaves);
        let root = |pixel: usize| match seen[pixel].patch {
            NONE => NONE,
            patch => self.mesh.patches[patch as usize].root,
        };
        let depths = self.raster.inverse_depths();
        let is_within = |pixel: usize, [dx, dy]: [isize; 2]| {
            let (x, y) = ((pixel % width).checked_add_signed(dx), (pixel / width).checked_add_signed(dy));
            let (Some(x), Some(y)) = (x.filter(|x| *x < width), y.filter(|y| *y < shown.height as usize)) else {
                return true;
            };
            let there = y * width + x;
            root(there) == root(pixel)
                || root(there) != NONE
                    && (depths[there] / depths[pixel] - 1.0).abs() < 0.01
                    && self.mesh.roots[root(there) as usize].object == self.mesh.roots[root(pixel) as usize].object
        };
        let light = |pixel: usize| {
            let hit = self.raster.hit(pixel)?;
            if ![[1, 0], [-1, 0], [0, 1], [0, -1]].into_iter().all(|beside| is_within(pixel, beside)) {
                return None;
            }
            let Appearance { emission, colour, finish } = Appearance::of(scene, &hit);
            let reflected = (shown.pixels[pixel] - emission).max(Vec3::ZERO);
            match finish {
                Finish::Matt if colour.min_element() < DARK => None,
                Finish::Matt => Some(reflected * PI / colour),
                _ => Some(self.options.kept(reflected, colour)),
            }
        };
        (0..seen.len()).map(light).collect()
    }

    /// Divides leaves whose pixels differ; false if there is none.
    fn divide_uneven(&mut self, lights: &[Option<Vec3>]) -> bool {
        /// Pixels, those whose light is known, sum and sum of squares of that.
        type Sums = (u32, f32, f32, f32);
        let mut sums: Vec<Sums> = vec![Default::default(); self.mesh.patches.len()];
        for (leaf, light) in self.leaves.iter().zip(lights).filter(|(leaf, _)| leaf.patch != NONE) {
            let (pixels, count, sum, squares) = &mut sums[leaf.patch as usize];
            *pixels += 1;
            if let Some(light) = light.map(|light| light.element_sum()) {
                (*count, *sum, *squares) = (*count + 1.0, *sum + light, *squares + light * light);
            }
        }
        let mut is_divided = false;
        for (patch, (pixels, count, sum, squares)) in (0..).zip(sums) {
            let mean = sum / count.max(1.0);
            let variance = (squares / count.max(1.0) - mean * mean).max(0.0);
            let is_uneven = variance > UNEVEN * UNEVEN * mean * mean;
            if pixels > PIXELS_MOST || pixels >= PIXELS_LEAST && is_uneven {
                is_divided |= self.mesh.split(patch, self.tick);
            }
        }
        is_divided
    }

    /// Vertices get the light of the pixels around them.
    fn settle(&mut self, view: &View, lights: &[Option<Vec3>], frames: u32) {
        let mut sums = vec![(Vec3::ZERO, 0.0_f32); self.mesh.vertices.len()];
        for ((Leaf { weights: [u, v], .. }, slot), light) in self.leaves.iter().zip(&self.sight.slots).zip(lights) {
            let (Some(light), Some(seen)) = (light, self.sight.leaves.get(*slot as usize)) else { continue };
            for (vertex, weight) in seen.vertices.into_iter().zip([1.0 - u - v, *u, *v]) {
                let (sum, all) = &mut sums[vertex as usize];
                let weight = (weight * weight).max(1e-6);
                (*sum, *all) = (*sum + *light * weight, *all + weight);
            }
        }
        // Each frame lights a pixel by one light set, and those beside it by others.
        let sets = u32::from((self.quality)(&self.settings).sets());
        let most = if self.options.noise { sets } else { 1 };
        for (number, (sum, all)) in (0..).zip(sums).filter(|(_, (_, all))| *all > 0.0) {
            self.learn(view, number, sum / all, frames * (libm::ceilf(all) as u32).clamp(1, most));
        }
    }
}
