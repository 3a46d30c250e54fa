//! The display and update loop as a state machine: answers go in, a camera goes in, a picture and the next questions come out.
//!
//! One *tick* is one shown picture, and one cycle of updates. What is known after it is a function of what went in, in order.

use std::collections::BTreeMap;
use std::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;
use protocol::answer::{Body, Seen};
use protocol::question::{Asked, Quality, Ticket};
use rayon::prelude::*;
use scenes::{Camera, Change, Scene, SurfacePoint};

use super::asking::{Asking, Batch, Wanted};
use super::mesh::{Leaf, NONE, PatchMesh, Root};
use super::select::{Enough, PriorityMap, Why};
use super::settings::{CHOSEN, Changes, Options, PATCHES, PRIORITY};
use super::worth::{Standing, Worth};
use crate::Picture;
use crate::front_end::{Effort, Plane, Settings, View};
use crate::methods::at_once::Memory;
use crate::parts::raster::{self, Hit, Raster};
use crate::parts::reproject::{Fresh, Shown, Steady};
use crate::parts::{Appearance, Finish, sky};

/// See the module's documentation.
pub struct Cache {
    options: Options,
    quality: fn(&Settings) -> Quality,
    settings: Settings,
    mesh: PatchMesh,
    raster: Raster,
    /// Of each pixel.
    leaves: Vec<Leaf>,
    priorities: Vec<f32>,
    /// Patches that the last tick saw.
    seen: Vec<u32>,
    tick: u32,
    camera: Camera,
    /// When the camera moved last.
    moved: u32,
    world: [u8; 32],
    revision: u32,
    /// When light was last found to have changed, by object.
    changing: BTreeMap<u32, u32>,
    materials: Vec<(Finish, Vec3)>,
    /// What people are adapted to: luminance of radiance.
    adaptation: f32,
    /// What is shown where nothing is known: irradiance, and radiance of what is not matt.
    mean: [Vec3; 2],
    /// Pixels that the last tick chose.
    chosen: Vec<(u32, Why)>,
    last: Option<Shown>,
}

/// Patches at most. More are not needed for a picture: those that have not been seen for long go, and if that is not enough,
/// all do.
const PATCHES_MAX: usize = 1 << 20;
/// Ticks that unseen patches are kept for.
const UNSEEN_MAX: u32 = 256;
/// With the same random numbers: what rounding may do.
const REPEATED: f32 = 2.0 / 256.0;
/// Colours below this are not divided by.
const DARK: f32 = 0.1;
/// Work of a point, in units of a light's.
const POINT_WORK: f64 = 10.0;
/// Ticks after which an object is not taken to change any more.
const CHANGES_FOR: u32 = 30;

/// Steps of a tick.
const VISIBILITY: &str = "visibility";
const LOCATE: &str = "patches in sight";
const CHOOSE: &str = "sampling choice";
const DIVIDE: &str = "patch subdivision";

impl Cache {
    /// Nothing known.
    pub fn new(quality: fn(&Settings) -> Quality, settings: &Settings) -> Self {
        Self {
            options: Options::of(settings),
            quality,
            settings: settings.clone(),
            mesh: PatchMesh::default(),
            raster: Raster::new(),
            leaves: Vec::new(),
            priorities: Vec::new(),
            seen: Vec::new(),
            tick: 0,
            camera: Camera::default(),
            moved: 0,
            world: [0; 32],
            revision: 0,
            changing: BTreeMap::new(),
            materials: Vec::new(),
            adaptation: 1.0,
            mean: [Vec3::ZERO; 2],
            chosen: Vec::new(),
            last: None,
        }
    }

    /// Nothing is known any more.
    fn clear(&mut self) {
        self.mesh = PatchMesh::default();
        self.seen.clear();
        self.leaves.fill(Leaf::NONE);
        self.changing.clear();
    }

    /// The mesh, for those who look at it.
    #[cfg(test)]
    pub fn mesh(&self) -> &PatchMesh {
        &self.mesh
    }

    fn worth(&self) -> Worth<'_> {
        let Self { options, mesh, materials, tick, moved, revision, changing, adaptation, .. } = self;
        let (tick, moved, revision, adaptation) = (*tick, *moved, *revision, *adaptation);
        Worth { options, mesh, materials, tick, moved, revision, changing, adaptation }
    }

    /// Finds the leaf that each pixel sees, and makes roots of what is seen for the first time.
    fn locate(&mut self, scene: &Scene) {
        let Self { mesh, raster, leaves, tick, .. } = self;
        let mut roots = vec![NONE; raster.facet_count()];
        for facet in raster.facets_seen().iter().filter(|facet| **facet != raster::NONE) {
            let root = &mut roots[*facet as usize];
            if *root == NONE {
                let (object, triangle, back) = raster.face(*facet);
                *root = mesh.make_root(scene, [scene.whole_of(object), triangle], back, *tick);
            }
        }
        let (mesh, raster) = (&*mesh, &*raster);
        leaves.clear();
        leaves.par_extend((0..raster.facets_seen().len()).into_par_iter().with_min_len(1024).map(|pixel| {
            match raster.facets_seen()[pixel] {
                raster::NONE => Leaf::NONE,
                facet => raster.hit(pixel).map_or(Leaf::NONE, |hit| mesh.find(roots[facet as usize], hit.uv)),
            }
        }));
    }

    /// Counts the pixels of each patch that is seen, and finds what patches are worth and what light there is on the whole.
    fn weigh(&mut self) {
        self.seen.clear();
        for leaf in self.leaves.iter().filter(|leaf| leaf.patch != NONE) {
            let patch = &mut self.mesh.patches[leaf.patch as usize];
            if patch.seen != self.tick || patch.pixels == 0 {
                (patch.seen, patch.pixels) = (self.tick, 0);
                self.seen.push(leaf.patch);
            }
            patch.pixels += 1;
        }
        let worth = self.worth();
        let priorities: Vec<f32> = self
            .seen
            .par_iter()
            .map(|number| worth.priority(&worth.standing(&self.mesh.patches[*number as usize], *number)))
            .collect();
        let (mut light, mut pixels, mut logs) = ([Vec3::ZERO; 2], [0.0_f32; 2], 0.0_f64);
        for (number, priority) in self.seen.iter().zip(priorities) {
            let patch = &mut self.mesh.patches[*number as usize];
            patch.priority = priority;
            let count = patch.pixels as f32;
            let (finish, tint) = self.materials[self.mesh.roots[patch.root as usize].material as usize];
            let Some(mean) = self.mesh.light(Leaf { patch: *number, weights: [1.0 / 3.0; 2] }) else { continue };
            let kind = usize::from(finish != Finish::Matt);
            light[kind] += mean * count;
            pixels[kind] += count;
            let luminance = (mean * tint).dot(LUMINANCE).max(1e-30);
            logs += libm::log(f64::from(luminance)) * f64::from(count);
        }
        let all = f64::from(pixels[0] + pixels[1]);
        if all > 0.0 {
            self.adaptation = libm::exp(logs / all) as f32;
        }
        let of = |kind: usize| (pixels[kind] > 0.0).then(|| light[kind] / pixels[kind]);
        self.mean = match (of(0), of(1)) {
            (Some(matt), Some(other)) => [matt, other],
            (Some(matt), None) => [matt, matt * (0.5 * FRAC_1_PI)],
            (None, Some(other)) => [other * (2.0 * PI), other],
            (None, None) => self.mean,
        };
        let (mesh, leaves) = (&self.mesh, &self.leaves);
        self.priorities.clear();
        self.priorities.par_extend(leaves.par_iter().with_min_len(1024).map(|leaf| match leaf.patch {
            NONE => 0.0,
            patch => mesh.patches[patch as usize].priority,
        }));
    }

    /// Where light changes on more than can be renewed in time, patches are joined.
    fn clean_up(&mut self, vertices: usize) {
        self.changing.retain(|_, since| self.tick.saturating_sub(*since) < CHANGES_FOR);
        if self.changing.is_empty() || self.options.clean_up == 0 {
            return;
        }
        let worth = self.worth();
        let is_changing = |number: &u32| {
            let patch = &self.mesh.patches[*number as usize];
            let Root { object, .. } = self.mesh.roots[patch.root as usize];
            self.changing.contains_key(&object) && worth.standing(patch, *number).is_stale
        };
        let stale: Vec<u32> = self.seen.iter().copied().filter(is_changing).collect();
        // About half a vertex for a patch.
        let ratio = 0.5 * stale.len() as f64 / (vertices.max(1) * self.options.clean_up as usize) as f64;
        if ratio <= 1.0 {
            return;
        }
        // A level is a factor of four.
        let levels = libm::ceil(0.5 * libm::log2(ratio)) as u32;
        let mut roots: Vec<u32> = stale.iter().map(|patch| self.mesh.patches[*patch as usize].root).collect();
        roots.sort_unstable();
        roots.dedup();
        for root in roots {
            self.mesh.lower(self.mesh.roots[root as usize].patch, levels);
        }
        self.seen.clear();
    }

    /// Frees patches that nobody has seen for long.
    fn evict(&mut self) {
        if self.mesh.patch_count() <= PATCHES_MAX {
            return;
        }
        let since = self.tick.saturating_sub(UNSEEN_MAX);
        for root in 0..self.mesh.roots.len() {
            self.mesh.trim(self.mesh.roots[root].patch, since);
        }
        if self.mesh.patch_count() > PATCHES_MAX / 4 * 3 {
            self.clear();
        }
    }

    /// Chooses patches, and what to do about them, until so many vertices are to be lit.
    fn choose(&mut self, view: &View, vertices: usize, done: &mut dyn FnMut(Option<&'static str>)) -> Vec<Wanted> {
        let patches: Vec<u32> = self.leaves.iter().map(|leaf| leaf.patch).collect();
        let mut hits: BTreeMap<u32, u32> = BTreeMap::new();
        let mut order = Vec::new();
        let mut cost = 0;
        self.chosen.clear();
        let mut chosen = Vec::new();
        let map = PriorityMap {
            width: self.raster.width(),
            patches: &patches,
            priorities: &self.priorities,
            scale: self.options.scale,
            chance: self.options.chance,
        };
        let seed = mix(view.seed ^ u64::from(self.tick) << 32);
        map.select(
            |index| (mix(seed ^ u64::from(index)) >> 32) as u32,
            |pixel, why| {
                chosen.push((pixel as u32, why));
                let hits = hits.entry(patches[pixel]).or_default();
                *hits += 1;
                if *hits == 1 {
                    order.push(patches[pixel]);
                    cost += self.cost(patches[pixel]);
                }
                match cost {
                    cost if cost >= vertices => Enough::All,
                    cost if 2 * cost >= vertices => Enough::Half,
                    _ => Enough::Little,
                }
            },
        );
        self.chosen = chosen;
        done(Some(CHOOSE));
        let mut wanted = Vec::new();
        for patch in order {
            // More hits: faster.
            let levels = 1 + hits[&patch].ilog2() / 2;
            if wanted.len() >= vertices {
                break;
            }
            self.improve(view, patch, levels, vertices, &mut wanted);
        }
        done(Some(DIVIDE));
        wanted
    }

    /// Vertices that will be lit for a patch, about.
    fn cost(&self, patch: u32) -> usize {
        let worth = self.worth();
        let patch = &self.mesh.patches[patch as usize];
        let (finish, _) = self.materials[self.mesh.roots[patch.root as usize].material as usize];
        let vertices = patch.vertices.map(|vertex| &self.mesh.vertices[vertex as usize]);
        let lacking = vertices.iter().filter(|vertex| worth.is_unknown(vertex) || worth.is_stale(vertex, finish));
        match lacking.count() {
            0 => 2,
            count => count,
        }
    }

    /// Lights what a patch lacks, or divides it.
    fn improve(&mut self, view: &View, patch: u32, levels: u32, most: usize, wanted: &mut Vec<Wanted>) {
        let worth = self.worth();
        let here = self.mesh.patches[patch as usize];
        let standing = worth.standing(&here, patch);
        if standing.is_waiting {
            return;
        }
        let (finish, _) = self.materials[self.mesh.roots[here.root as usize].material as usize];
        let Standing { has_unknown, is_stale, age, error, .. } = standing;
        let is_outdated = here.vertices.iter().any(|vertex| {
            let vertex = &self.mesh.vertices[*vertex as usize];
            vertex.samples > 0 && vertex.revision != self.revision
        });
        if has_unknown || is_outdated || is_stale && age >= error {
            let lacks = |vertex: &u32| {
                let vertex = &self.mesh.vertices[*vertex as usize];
                worth.is_unknown(vertex) || worth.is_stale(vertex, finish)
            };
            let lacking: Vec<u32> = here.vertices.iter().copied().filter(lacks).collect();
            lacking.into_iter().for_each(|vertex| self.want(view, vertex, finish, 0, wanted));
            return;
        }
        let is_divided = !self.is_small(view, patch) && self.mesh.split(patch, self.tick);
        if !is_divided {
            for vertex in here.vertices {
                let samples = self.mesh.vertices[vertex as usize].samples;
                if samples > 0 && samples + self.options.sets <= self.options.history {
                    self.want(view, vertex, finish, samples, wanted);
                }
            }
            return;
        }
        let children = self.mesh.patches[patch as usize].children;
        let new = self.mesh.patches[children as usize + 3].vertices;
        for vertex in new {
            let is_new = self.worth().is_unknown(&self.mesh.vertices[vertex as usize]);
            if is_new {
                self.want(view, vertex, finish, 0, wanted);
            }
        }
        if levels > 1 {
            (children..children + 4).for_each(|child| self.deepen(view, child, levels - 1, most, wanted));
        }
    }

    /// Divides what was just divided, whether its vertices are known or not, as long as no more than `most` are wanted.
    fn deepen(&mut self, view: &View, patch: u32, levels: u32, most: usize, wanted: &mut Vec<Wanted>) {
        if levels == 0 || wanted.len() >= most || self.is_small(view, patch) || !self.mesh.split(patch, self.tick) {
            return;
        }
        let here = self.mesh.patches[patch as usize];
        let (finish, _) = self.materials[self.mesh.roots[here.root as usize].material as usize];
        let first = here.children;
        for vertex in self.mesh.patches[first as usize + 3].vertices {
            if self.worth().is_unknown(&self.mesh.vertices[vertex as usize]) {
                self.want(view, vertex, finish, 0, wanted);
            }
        }
        (first..first + 4).for_each(|child| self.deepen(view, child, levels - 1, most, wanted));
    }

    fn want(&mut self, view: &View, number: u32, finish: Finish, before: u8, wanted: &mut Vec<Wanted>) {
        let vertex = &mut self.mesh.vertices[number as usize];
        // What is hidden, or of a piece that was hidden, would be refused with all the others.
        if vertex.is_asked || view.scene.find_point(&vertex.at).is_err() {
            return;
        }
        vertex.is_asked = true;
        let (serial, at, is_seen) = (vertex.serial, vertex.at, finish != Finish::Matt);
        wanted.push(Wanted { vertex: number, serial, at, is_seen, before });
    }

    /// It is no larger than a pixel.
    fn is_small(&self, view: &View, patch: u32) -> bool {
        let lens = view.camera.lens();
        let corners = self.mesh.patches[patch as usize].vertices.map(|vertex| {
            let at = view.scene.place(&self.mesh.vertices[vertex as usize].at).ok()?;
            lens.project(at).map(|(x, y, _)| [x, y])
        });
        let [Some(a), Some(b), Some(c)] = corners else { return false };
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        area.abs() <= 2.0
    }

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
                    let reflected = (radiance - emission).max(Vec3::ZERO);
                    if self.options.untinted { reflected / colour.max(Vec3::splat(DARK)) } else { reflected }
                };
                Some(wanted.iter().enumerate().map(light).collect())
            }
            _ => None,
        }
    }

    fn light(&self, leaf: Leaf) -> Option<Vec3> {
        if leaf.patch == NONE { None } else { self.mesh.light(leaf) }
    }

    /// Radiance of a pixel.
    fn radiance(&self, scene: &Scene, hit: &Hit, leaf: Leaf) -> Vec3 {
        let Appearance { emission, colour, finish } = Appearance::of(scene, hit);
        let light = self.light(leaf);
        let reflected = match finish {
            Finish::Matt => light.unwrap_or(self.mean[0]) * colour * FRAC_1_PI,
            _ if self.options.untinted => light.unwrap_or(self.mean[1]) * colour.max(Vec3::splat(DARK)),
            _ => light.unwrap_or(self.mean[1]),
        };
        emission + reflected
    }
}

impl Memory for Cache {
    type Batch = Batch;

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

    fn edited(&mut self, view: &View, changes: &[Change]) {
        let materials = materials(&view.scene);
        let kind = |of: &[(Finish, Vec3)]| of.iter().map(|(finish, _)| *finish == Finish::Matt).collect::<Vec<_>>();
        if view.world.world != self.world || kind(&materials) != kind(&self.materials) {
            self.clear();
        }
        self.materials = materials;
        (self.world, self.revision) = (view.world.world, view.world.revision);
        if self.options.changes == Changes::Doubted {
            // Light goes everywhere; what an object that is moved shades or lights is found.
            let is_light = |change: &Change| matches!(change, Change::Light { .. } | Change::Material { .. });
            if changes.iter().any(is_light) {
                let objects = self.mesh.roots.iter().map(|root| (root.object, self.tick));
                self.changing.extend(objects);
            }
        }
    }

    fn absorb(&mut self, view: &View, batch: &Batch, answers: &[Option<Body>]) {
        let mut sums = vec![(Vec3::ZERO, 0_u8); batch.wanted.len()];
        for ((_, range), body) in batch.questions.iter().zip(answers) {
            let Some(lights) = self.lights(view, &batch.wanted[range.clone()], body.as_ref()) else { continue };
            for (sum, light) in sums[range.clone()].iter_mut().zip(lights) {
                *sum = (sum.0 + light, sum.1 + 1);
            }
        }
        for (wanted, (sum, count)) in batch.wanted.iter().zip(sums) {
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
            if wanted.before > 0 && wanted.before == vertex.samples {
                let all = f32::from(wanted.before) + f32::from(count);
                vertex.light = (vertex.light * f32::from(wanted.before) + sum) / all;
                vertex.samples += count;
                continue;
            }
            // The same random numbers: what differs has changed.
            if is_outdated && is_alike(vertex.first, mean) {
                continue;
            }
            if is_outdated {
                self.changing.insert(wanted.at.object, self.tick);
            }
            (vertex.light, vertex.first, vertex.samples) = (mean, mean, count);
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
        self.tick += 1;
        if self.camera != view.camera {
            (self.camera, self.moved) = (view.camera, self.tick);
        }
        if self.materials.is_empty() || self.world != view.world.world {
            self.edited(view, &[]);
        }
        self.raster.draw(&view.scene, &view.camera);
        done(Some(VISIBILITY));
        let vertices = samples / usize::from(self.options.sets);
        let vertices = if samples > 0 { vertices.max(1) } else { 0 };
        self.clean_up(vertices);
        self.evict();
        self.locate(&view.scene);
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
            quality: Asking::quality(&(self.quality)(&self.settings)),
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
        let pixel = |pixel: usize| {
            let direction = lens.direction((pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5);
            match self.raster.hit(pixel) {
                Some(hit) => {
                    let leaf = self.leaves[pixel];
                    let is_known = self.light(leaf).is_some();
                    (self.radiance(&view.scene, &hit, leaf), hit.depth / direction.dot(forward), is_known)
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
            Plane::Own(PRIORITY) => Some(picture(self.priorities.iter().map(|worth| Vec3::splat(*worth)).collect())),
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
}

/// How materials scatter, and what the light on them is multiplied by, but for textures.
fn materials(scene: &Scene) -> Vec<(Finish, Vec3)> {
    let material = |material: &scenes::Material| match (Finish::of(&material.surface), &material.surface) {
        (finish, scenes::Surface::Diffuse { albedo }) => (finish, albedo.value * FRAC_1_PI),
        (finish, _) => (finish, Vec3::ONE),
    };
    scene.materials.iter().map(material).collect()
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

/// Rec. 709.
const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

/// SplitMix64.
pub(super) fn mix(seed: u64) -> u64 {
    let mut z = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ z >> 31
}
