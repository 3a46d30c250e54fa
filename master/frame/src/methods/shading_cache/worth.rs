//! What patches are worth looking at again: how wrong they may be, on a scale of display codes, and how old they are.

use std::collections::BTreeMap;

use glam::Vec3;

use super::mesh::{NEVER, Patch, PatchMesh, Root, Vertex};
use super::settings::{Changes, Error, Options};
use crate::parts::Finish;

/// What all priorities of a tick have in common.
pub(super) struct Worth<'a> {
    pub options: &'a Options,
    pub mesh: &'a PatchMesh,
    /// By material: how it scatters, and the colour that what is kept of it is multiplied by, but for textures.
    pub materials: &'a [(Finish, Vec3)],
    pub tick: u32,
    /// When the camera moved last.
    pub moved: u32,
    /// The state of the world.
    pub revision: u32,
    /// When light was last found to have changed, by object.
    pub changing: &'a BTreeMap<u32, u32>,
    /// Radiance that people are adapted to: luminance, W·m⁻²·sr⁻¹.
    pub adaptation: f32,
}

/// How a patch stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Standing {
    /// Codes by which it may be wrong.
    pub error: f32,
    /// What it is worth because light may have changed: cycles, or doubt.
    pub age: f32,
    /// Some of its vertices are to be asked about for the first time …
    pub has_unknown: bool,
    /// It is small, and there is a guess.
    pub is_guessed: bool,
    /// … or were, and nobody has answered, or ever will.
    pub is_waiting: bool,
    /// Some were lit before something changed.
    pub is_stale: bool,
}

/// The greatest priority of what has a value, codes.
const CODES: f32 = 255.0;
/// What a patch of so few pixels is worth of which there is a guess.
const GUESSED: f32 = 16.0;
const TINY: u32 = 4;
/// A display's contrast is the square of it (Tumblin et al. 1999).
const CONTRAST: f32 = 10.0;
/// What all that is in sight is worth after an edit.
const DOUBT: f32 = 64.0;
/// Codes that a middle is off count a quarter in the quarters (linear interpolation: the error goes with the square of size).
const QUARTER: f32 = 0.25;
/// A glossy patch ages so many times as fast as a matt one that changes, if it is as sharp as can be; at least once.
const GLOSS_AGES: f32 = 4.0;

impl Worth<'_> {
    /// How a patch stands.
    pub fn standing(&self, patch: &Patch, number: u32) -> Standing {
        let Root { object, material, .. } = self.mesh.roots[patch.root as usize];
        let (finish, tint) = self.materials[material as usize];
        let corners = patch.vertices.map(|vertex| &self.mesh.vertices[vertex as usize]);
        let has_unknown = corners.iter().any(|vertex| self.is_unknown(vertex));
        let is_lost = |vertex: &Vertex| vertex.samples == 0 && !self.is_unknown(vertex);
        let is_waiting = corners.iter().any(|vertex| vertex.is_asked || is_lost(vertex));
        let is_stale = corners.iter().any(|vertex| self.is_stale(vertex, finish));
        let oldest = corners.iter().map(|vertex| vertex.tick).min().unwrap_or(0);
        let cycles = self.tick.saturating_sub(oldest) as f32;
        let by_view = match finish {
            Finish::Shiny(roughness) if oldest < self.moved => cycles * (1.0 + GLOSS_AGES * (1.0 - roughness)),
            _ => 0.0,
        };
        let is_outdated = corners.iter().any(|vertex| vertex.revision != self.revision);
        let by_change = match self.options.changes {
            Changes::Doubted if is_outdated => DOUBT + cycles,
            Changes::Found if is_outdated && self.changing.contains_key(&object) => cycles,
            _ => 0.0,
        };
        let code = |vertex: u32| self.code(self.mesh.vertices[vertex as usize].light * tint);
        let contrast = || {
            let codes = patch.vertices.map(code);
            codes.into_iter().fold(f32::NEG_INFINITY, f32::max) - codes.into_iter().fold(f32::INFINITY, f32::min)
        };
        let error = match (self.options.error, self.mesh.middles_above(number)) {
            // A pixel cannot be divided.
            _ if patch.pixels <= 1 => 0.0,
            (Error::Contrast, _) | (_, None) => contrast(),
            (Error::Curvature, Some(middles)) => {
                let off = middles.map(|[middle, a, b]| (code(middle) - 0.5 * (code(a) + code(b))).abs());
                QUARTER * off.into_iter().fold(0.0, f32::max)
            }
        };
        let is_guessed = patch.pixels <= TINY && corners.iter().all(|vertex| vertex.has_light);
        Standing { error, age: by_view.max(by_change), has_unknown, is_guessed, is_waiting, is_stale }
    }

    /// One number of it.
    pub fn priority(&self, standing: &Standing) -> f32 {
        match *standing {
            Standing { is_waiting: true, .. } => 0.0,
            // What is next to nothing can wait, if something is known of what is around it.
            Standing { has_unknown: true, is_guessed: true, .. } => GUESSED,
            Standing { has_unknown: true, .. } => CODES,
            Standing { error, age, .. } => error + age,
        }
    }

    /// Nobody was ever asked about it in this state of the world, and nothing is known of it.
    pub fn is_unknown(&self, vertex: &Vertex) -> bool {
        vertex.samples == 0 && !vertex.is_asked && vertex.revision != self.revision
    }

    /// It was lit in another state of the world, or for an eye elsewhere.
    pub fn is_stale(&self, vertex: &Vertex, finish: Finish) -> bool {
        let is_outdated = vertex.revision != self.revision && vertex.revision != NEVER;
        vertex.samples > 0 && (is_outdated || matches!(finish, Finish::Shiny(_)) && vertex.tick < self.moved)
    }

    /// Display code of a radiance, 0..=255: by the sigmoid of Tumblin et al. in channels that weigh 5/16, 9/16 and 2/16,
    /// linear as in the paper, or as displays encode it.
    fn code(&self, radiance: Vec3) -> f32 {
        let by_channel = radiance.to_array().map(|channel| {
            let x = channel.max(0.0) / self.adaptation;
            let shown = x / (x + CONTRAST);
            if self.options.error == Error::Contrast { shown } else { shown.sqrt() }
        });
        CODES * Vec3::from_array(by_channel).dot(WEIGHTS)
    }
}

const WEIGHTS: Vec3 = Vec3::new(5.0 / 16.0, 9.0 / 16.0, 2.0 / 16.0);
