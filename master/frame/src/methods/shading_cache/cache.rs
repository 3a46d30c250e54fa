//! The display and update loop as a state machine: answers go in, a camera goes in, a picture and the next questions come out.
//!
//! One *tick* is one shown picture, and one cycle of updates. What is known after it is a function of what went in, in order.

use std::collections::BTreeMap;
use std::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;
use protocol::question::Quality;
use rayon::prelude::*;
use scenes::{Camera, Scene, SurfacePoint};

use super::cells::Cells;
use super::lit::Lit;
use super::mesh::{Leaf, NONE, PatchMesh};
use super::noise::Usual;
use super::select::Why;
use super::settings::Options;
use super::sight::Sight;
use super::worth::Worth;
use crate::front_end::{Settings, View};
use crate::methods::at_once::Memory;
use crate::parts::Finish;
use crate::parts::raster::{self, Raster};
use crate::parts::reproject::Shown;

/// See the module's documentation.
pub struct Cache {
    pub(super) options: Options,
    pub(super) quality: fn(&Settings) -> Quality,
    pub(super) settings: Settings,
    pub(super) mesh: PatchMesh,
    pub(super) cells: Cells,
    pub(super) raster: Raster,
    /// Of each pixel.
    pub(super) leaves: Vec<Leaf>,
    /// What the last tick saw, and what its leaves are worth.
    pub(super) sight: Sight,
    pub(super) priorities: Vec<f32>,
    pub(super) tick: u32,
    pub(super) camera: Camera,
    /// When the camera moved last.
    pub(super) moved: u32,
    pub(super) world: [u8; 32],
    pub(super) revision: u32,
    /// When light was last found to have changed, by object.
    pub(super) changing: BTreeMap<u32, u32>,
    pub(super) materials: Vec<(Finish, Vec3)>,
    /// What people are adapted to: luminance of radiance.
    pub(super) adaptation: f32,
    /// What is shown where nothing is known: irradiance, and radiance of what is not matt.
    pub(super) mean: [Vec3; 2],
    /// How far light sets are apart.
    pub(super) usual: Usual,
    /// Pixels that the last tick chose.
    pub(super) chosen: Vec<(u32, Why)>,
    pub(super) last: Option<Shown>,
}

/// Patches at most. More are not needed for a picture: those that have not been seen for long go, and if that is not enough,
/// all do.
const PATCHES_MAX: usize = 1 << 20;
/// Ticks that unseen patches are kept for.
const UNSEEN_MAX: u32 = 256;

impl Cache {
    /// Nothing known.
    pub fn new(quality: fn(&Settings) -> Quality, settings: &Settings) -> Self {
        Self {
            options: Options::of(settings),
            quality,
            settings: settings.clone(),
            mesh: PatchMesh::default(),
            cells: Cells::default(),
            raster: Raster::new(),
            leaves: Vec::new(),
            sight: Sight::default(),
            priorities: Vec::new(),
            tick: 0,
            camera: Camera::default(),
            moved: 0,
            world: [0; 32],
            revision: 0,
            changing: BTreeMap::new(),
            materials: Vec::new(),
            adaptation: 1.0,
            mean: [Vec3::ZERO; 2],
            usual: Usual::default(),
            chosen: Vec::new(),
            last: None,
        }
    }

    /// The next picture is of this.
    pub(super) fn look(&mut self, view: &View) {
        self.tick += 1;
        if self.camera != view.camera {
            (self.camera, self.moved) = (view.camera, self.tick);
        }
        if self.materials.is_empty() || self.world != view.world.world {
            self.move_to(view, &[], true);
        }
        self.raster.draw(&view.scene, &view.camera);
    }

    /// The light of a vertex is known, by so many samples.
    pub(super) fn learn(&mut self, view: &View, number: u32, light: Vec3, samples: u32) {
        let (tick, revision) = (self.tick, self.revision);
        let samples = samples.clamp(1, 255) as u8;
        let vertex = &mut self.mesh.vertices[number as usize];
        (vertex.light, vertex.has_light, vertex.first) = (light, true, Vec3::NAN);
        (vertex.mean, vertex.spread) = (light, self.usual.spread(light, samples));
        (vertex.samples, vertex.tick, vertex.revision) = (samples, tick, revision);
        let at = self.mesh.at(number);
        self.note(view, &at, light);
    }

    /// What is around a vertex is likely to be lit as it is.
    pub(super) fn note(&mut self, view: &View, at: &SurfacePoint, light: Vec3) {
        if let Some(cell) = self.cells.cell(&view.scene, at) {
            self.cells.add(cell, light);
        }
    }

    /// Nothing is known any more.
    pub(super) fn clear(&mut self) {
        self.mesh = PatchMesh::default();
        self.cells.clear();
        self.sight.clear();
        self.priorities.clear();
        self.leaves.fill(Leaf::NONE);
        self.changing.clear();
    }

    /// The mesh, for those who look at it.
    #[cfg(test)]
    pub fn mesh(&self) -> &PatchMesh {
        &self.mesh
    }

    pub(super) fn worth(&self) -> Worth<'_> {
        let Self { options, mesh, materials, tick, moved, revision, changing, adaptation, usual, sight, .. } = self;
        let (tick, moved, revision, adaptation, usual) = (*tick, *moved, *revision, *adaptation, *usual);
        let codes = &[];
        Worth { options, mesh, materials, tick, moved, revision, changing, adaptation, usual, sight, codes }
    }

    /// Finds the leaf that each pixel sees, and makes roots of what is seen for the first time.
    pub(super) fn locate(&mut self, scene: &Scene) {
        let Self { options, mesh, cells, raster, leaves, sight, tick, .. } = self;
        let mut roots = vec![NONE; raster.facet_count()];
        let mut last = raster::NONE;
        for facet in raster.facets_seen() {
            // What is beside is mostly the same.
            if *facet == last || *facet == raster::NONE {
                continue;
            }
            last = *facet;
            let root = &mut roots[*facet as usize];
            if *root == NONE {
                let (object, triangle, back) = raster.face(*facet);
                *root = mesh.make_root(scene, [scene.whole_of(object), triangle], back, *tick);
            }
        }
        let (seen, raster) = (&*mesh, &*raster);
        leaves.clear();
        leaves.par_extend((0..raster.facets_seen().len()).into_par_iter().with_min_len(1024).map(|pixel| {
            match raster.facets_seen()[pixel] {
                raster::NONE => Leaf::NONE,
                facet => raster.hit(pixel).map_or(Leaf::NONE, |hit| seen.find(roots[facet as usize], hit.uv)),
            }
        }));
        sight.find(mesh, leaves, *tick, options);
        // What nothing is known of is likely to be lit as what is around it.
        for number in sight.vertices[..sight.corners].iter().map(|seen| seen.vertex) {
            if !mesh.vertices[number as usize].has_light
                && let Some(light) = cells.cell(scene, &mesh.at(number)).and_then(|cell| cells.guess(cell))
            {
                let vertex = &mut mesh.vertices[number as usize];
                (vertex.light, vertex.has_light) = (light, true);
            }
        }
    }

    /// Finds what the leaves in sight are worth, and what light there is on the whole.
    pub(super) fn weigh(&mut self) {
        self.smooth();
        self.cover_hidden();
        let mut vertices = std::mem::take(&mut self.sight.vertices);
        let worth = self.worth();
        vertices.par_iter_mut().with_min_len(1024).for_each(|seen| {
            let vertex = &self.mesh.vertices[seen.vertex as usize];
            let (_, tint) = self.materials[self.mesh.material_of(vertex) as usize];
            seen.codes = match seen.is_hidden {
                true => [worth.code(vertex.light * tint), 0.0],
                false => worth.codes(vertex, tint),
            };
        });
        let worth = Worth { codes: &vertices, ..worth };
        let leaves = self.sight.leaves.par_iter().with_min_len(256);
        let priorities = leaves.map(|leaf| worth.priority(&worth.standing(leaf.patch))).collect();
        (self.sight.vertices, self.priorities) = (vertices, priorities);
        let (mut light, mut pixels, mut logs) = ([Vec3::ZERO; 2], [0.0_f32; 2], 0.0_f64);
        for leaf in &self.sight.leaves {
            let count = leaf.pixels as f32;
            let root = self.mesh.patches[leaf.patch as usize].root;
            let (finish, tint) = self.materials[self.mesh.roots[root as usize].material as usize];
            let Some(mean) = Lit::of(&self.mesh, leaf).at([1.0 / 3.0; 2]) else { continue };
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
    }

    /// Frees patches that nobody has seen for long.
    pub(super) fn evict(&mut self) {
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
}

/// How materials scatter, and what the light on them is multiplied by, but for textures.
pub(super) fn materials(scene: &Scene) -> Vec<(Finish, Vec3)> {
    let material = |material: &scenes::Material| match (Finish::of(&material.surface), &material.surface) {
        (finish, scenes::Surface::Diffuse { albedo }) => (finish, albedo.value * FRAC_1_PI),
        (finish, _) => (finish, Vec3::ONE),
    };
    scene.materials.iter().map(material).collect()
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
