//! The cache as a memory: answers go in, pictures and questions come out.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;
use protocol::answer::{Body, Seen};
use protocol::question::{Asked, Ticket};
use rayon::prelude::*;
use scenes::{Camera, Change, Scene, SurfacePoint};

use super::asking::{Asking, Batch, Wanted};
use super::cache::{Cache, materials, mix};
use super::cells::Cells;
use super::lit::LitLeaves;
use super::mesh::{Leaf, NONE};
use super::select::Why;
use super::settings::{CHOSEN, Changes, Options, PATCHES, PRIORITY};
use crate::Picture;
use crate::front_end::{Effort, Held, Plane, Settings, View};
use crate::methods::at_once::{Memory, for_any_eye};
use crate::parts::raster::Hit;
use crate::parts::reproject::{Fresh, Shown, Steady};
use crate::parts::{Appearance, Finish, sky};

/// With the same random numbers: what rounding may do.
const REPEATED: f32 = 2.0 / 256.0;
/// Work of a point, in units of a light's.
const POINT_WORK: f64 = 10.0;
/// Steps of a tick.
const VISIBILITY: &str = "visibility";
const LOCATE: &str = "patches in sight";

impl Cache {
    /// What an answer says of each vertex that a question is about; `None`: nothing that can be used.
    fn lights(&self, view: &View, wanted: &[Wanted], body: Option<&Body>) -> Option<Vec<Vec3>> {
        match body? {
            Body::Irradiance(irradiance) if irradiance.len() == wanted.len() && !wanted[0].is_seen => {
                Some(irradiance.clone())
            }
            Body::Seen(Seen { pixels, hits }) if hits.len() == wanted.len() && wanted[0].is_seen => {
                let value = |plane: &[Vec3], index: usize| plane.get(index).copied().unwrap_or_default();
                let light = |(index, wanted): (usize, &Wanted)| {
                    let reflected = value(&pixels.reflectance, index) * value(&pixels.irradiance, index) * FRAC_1_PI;
                    let radiance = value(&pixels.emitted, index) + reflected;
                    let Some(Appearance { emission, colour, .. }) = appearance(&view.scene, &wanted.at) else {
                        return radiance;
                    };
                    self.options.kept((radiance - emission).max(Vec3::ZERO), colour)
                };
                Some(wanted.iter().enumerate().map(light).collect())
            }
            _ => None,
        }
    }

    /// Radiance of a pixel, by the light that is known there.
    fn radiance(&self, scene: &Scene, hit: &Hit, light: Option<Vec3>) -> Vec3 {
        let Appearance { emission, colour, finish } = Appearance::of(scene, hit);
        let reflected = match finish {
            Finish::Matt => light.unwrap_or(self.mean[0]) * colour * FRAC_1_PI,
            _ => self.options.reflected(light.unwrap_or(self.mean[1]), colour),
        };
        emission + reflected
    }
}

impl Memory for Cache {
    type Batch = Batch;

    const UPDATE: &'static str = "taking in answers";

    fn turn(&mut self, settings: &Settings) {
        let (before, options) = (self.options, Options::of(settings));
        let is_kept_otherwise = before.untinted != options.untinted || before.sets != options.sets;
        if is_kept_otherwise || (self.quality)(settings) != (self.quality)(&self.settings) {
            self.clear();
        }
        (self.options, self.settings) = (options, settings.clone());
    }

    fn is_empty(&self) -> bool {
        self.mesh.vertices.iter().all(|vertex| vertex.samples == 0)
    }

    fn reset(&mut self) {
        self.clear();
        self.last = None;
    }

    fn move_to(&mut self, view: &View, changes: &[Change], is_edited: bool) {
        if !is_edited {
            return;
        }
        let materials = materials(&view.scene);
        let kind = |of: &[(Finish, Vec3)]| of.iter().map(|(finish, _)| *finish == Finish::Matt).collect::<Vec<_>>();
        if view.world.world != self.world || kind(&materials) != kind(&self.materials) {
            self.clear();
        }
        if view.world.world != self.world {
            self.cells = Cells::of(&view.scene);
        }
        self.materials = materials;
        if changes.iter().any(|change| matches!(change, Change::OwnMaterial { .. })) {
            self.mesh.made_anew(&view.scene);
        }
        (self.world, self.revision) = (view.world.world, view.world.revision);
        if self.options.changes == Changes::Doubted {
            // Light goes everywhere; what an object that is moved shades or lights is found.
            if changes.iter().any(Change::is_of_light) {
                let objects = self.mesh.roots.iter().map(|root| (root.object, self.tick));
                self.changing.extend(objects);
            }
        }
    }

    fn begin_with(&mut self, view: &View, still: &mut dyn FnMut(Plane) -> Picture, frames: u32) {
        self.seed(view, &still(Plane::Final), frames);
    }

    fn absorb(&mut self, view: &View, batch: &Batch, answers: &[Option<Body>]) {
        // Sum of light, of squares of its channels' sum, light sets.
        let mut sums = vec![(Vec3::ZERO, 0.0_f32, 0_u8); batch.wanted.len()];
        for ((_, range), body) in batch.questions.iter().zip(answers) {
            let Some(lights) = self.lights(view, &batch.wanted[range.clone()], body.as_ref()) else { continue };
            for (sum, light) in sums[range.clone()].iter_mut().zip(lights) {
                *sum = (sum.0 + light, sum.1 + light.element_sum().powi(2), sum.2 + 1);
            }
        }
        for (wanted, (sum, squares, count)) in batch.wanted.iter().zip(sums) {
            let Some(vertex) = self.mesh.vertices.get_mut(wanted.vertex as usize) else { continue };
            if vertex.serial != wanted.serial {
                continue;
            }
            (vertex.is_asked, vertex.tick) = (false, batch.tick);
            let is_outdated = vertex.samples > 0 && vertex.revision != batch.revision;
            vertex.revision = batch.revision;
            if count == 0 {
                continue;
            }
            let mean = sum / f32::from(count);
            let spread = (squares - sum.element_sum().powi(2) / f32::from(count)).max(0.0);
            self.usual.add(mean, spread, count);
            if wanted.before > 0 && wanted.before == vertex.samples {
                let [before, new] = [wanted.before, count].map(f32::from);
                let apart = (mean - vertex.mean).element_sum();
                vertex.spread += spread + apart * apart * before * new / (before + new);
                vertex.mean = (vertex.mean * before + sum) / (before + new);
                vertex.light = vertex.mean;
                vertex.samples += count;
                continue;
            }
            // The same random numbers: what differs has changed. What a still picture has told since is better.
            let is_known = !is_outdated && !wanted.is_seen && vertex.samples > count;
            if is_known || is_outdated && is_alike(vertex.first, mean) {
                continue;
            }
            if is_outdated && vertex.first.is_finite() {
                self.changing.insert(wanted.at.object, self.tick);
            }
            (vertex.light, vertex.has_light, vertex.first, vertex.samples) = (mean, true, mean, count);
            (vertex.mean, vertex.spread) = (mean, spread);
            self.note(view, &wanted.at, mean);
        }
    }

    fn forget(&mut self, batch: &Batch) {
        for wanted in &batch.wanted {
            if let Some(vertex) = self.mesh.vertices.get_mut(wanted.vertex as usize)
                && vertex.serial == wanted.serial
            {
                vertex.is_asked = false;
            }
        }
    }

    fn tick(&mut self, view: &View, samples: usize, done: &mut dyn FnMut(Option<&'static str>)) -> Option<Batch> {
        done(None);
        self.look(view);
        done(Some(VISIBILITY));
        let vertices = samples / usize::from(self.options.sets);
        let vertices = if samples > 0 { vertices.max(1) } else { 0 };
        self.clean_up(vertices);
        self.evict();
        self.locate(&view.scene);
        self.find_hidden(&view.scene);
        self.weigh();
        done(Some(LOCATE));
        let wanted = if vertices > 0 { self.choose(view, vertices, done) } else { Vec::new() };
        if wanted.is_empty() {
            return None;
        }
        let asking = Asking {
            world: view.world,
            eye: view.camera.origin,
            seed: view.seed,
            quality: for_any_eye(&(self.quality)(&self.settings)),
            sets: self.options.sets,
            tick: self.tick,
        };
        Some(asking.batch(&view.scene, wanted))
    }

    fn questions(batch: &Batch, ticket: &dyn Fn(usize) -> Ticket) -> Vec<Asked> {
        batch.asked(ticket)
    }

    fn picture(&mut self, view: &View) -> (&Shown, f32) {
        let camera = self.camera;
        let lens = camera.lens();
        let (width, forward) = (self.raster.width(), lens.axes()[2]);
        let lit = LitLeaves::of(&self.mesh, &self.sight.leaves, self.options.fitted);
        let pixel = |pixel: usize| {
            let direction = lens.direction((pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5);
            match self.raster.hit(pixel) {
                Some(hit) => {
                    let light = lit.at(self.sight.slots[pixel], self.leaves[pixel].weights);
                    (self.radiance(&view.scene, &hit, light), hit.depth / direction.dot(forward), light.is_some())
                }
                None => (sky(&view.scene, direction), 0.0, true),
            }
        };
        let pixels: Vec<(Vec3, f32, bool)> =
            (0..self.leaves.len()).into_par_iter().with_min_len(1024).map(pixel).collect();
        let known = pixels.iter().filter(|(.., is_known)| *is_known).count() as f32 / pixels.len().max(1) as f32;
        let (colours, distance) = pixels.into_iter().map(|(colour, distance, _)| (colour, distance)).unzip();
        let picture = Picture { width: camera.width, height: camera.height, pixels: colours };
        let known_all = vec![true; picture.pixels.len()];
        let shown = Fresh { camera, picture, distance, known: known_all }.after(None, Steady::Off);
        (self.last.insert(shown), known)
    }

    fn shown(&self) -> Option<&Shown> {
        self.last.as_ref()
    }

    fn plane(&self, plane: Plane) -> Option<Picture> {
        let (width, height) = (self.raster.width() as u32, self.raster.height() as u32);
        let picture = |pixels: Vec<Vec3>| Picture { width, height, pixels };
        match plane {
            Plane::Own(PATCHES) => {
                let colour = |leaf: &Leaf| match leaf.patch {
                    NONE => Vec3::ZERO,
                    patch => {
                        let bits = mix(u64::from(patch));
                        Vec3::from_array([0, 8, 16].map(|shift| 0.1 + (bits >> shift & 255) as f32 / 300.0))
                    }
                };
                Some(picture(self.leaves.iter().map(colour).collect()))
            }
            Plane::Own(PRIORITY) => {
                let worth = |slot: &u32| self.priorities.get(*slot as usize).copied().unwrap_or_default();
                Some(picture(self.sight.slots.iter().map(|slot| Vec3::splat(worth(slot))).collect()))
            }
            Plane::Own(CHOSEN) => {
                let mut pixels = vec![Vec3::ZERO; self.leaves.len()];
                for (pixel, why) in &self.chosen {
                    pixels[*pixel as usize] = match why {
                        Why::Priority => Vec3::X,
                        Why::Chance => Vec3::Y,
                        Why::Flood => Vec3::new(1.0, 1.0, 0.0),
                    };
                }
                Some(picture(pixels))
            }
            _ => None,
        }
    }

    fn samples(&self, camera: &Camera, Effort(share): Effort) -> usize {
        let pixels = f64::from(camera.width) * f64::from(camera.height);
        let wanted = self.options.budget.map_or((pixels * f64::from(share)).round(), f64::from);
        wanted.clamp(1.0, pixels.max(1.0) * f64::from(self.options.sets)) as usize
    }

    fn work(&self, samples: usize) -> f64 {
        let quality = (self.quality)(&self.settings);
        samples as f64 * (POINT_WORK + f64::from(quality.light_samples) + f64::from(quality.vpls))
    }

    fn held(&self) -> Held {
        Held { of: "patch", count: self.mesh.patch_count(), bytes: self.mesh.bytes() }
    }
}

fn appearance(scene: &Scene, at: &SurfacePoint) -> Option<Appearance> {
    let object = scene.find_point(at).ok()? as u32;
    let SurfacePoint { triangle, uv, back, .. } = *at;
    Some(Appearance::of(scene, &Hit { object, triangle, uv, back, depth: 0.0 }))
}

/// The same light, up to rounding.
fn is_alike(a: Vec3, b: Vec3) -> bool {
    (a - b).abs().max_element() <= REPEATED * a.max_element().max(b.max_element())
}
