//! What patches are worth looking at again: how wrong they may be, on a scale of display codes, and how old they are.

use std::collections::BTreeMap;

use glam::Vec3;

use super::mesh::{NEVER, PatchMesh, Root, Vertex};
use super::noise::Usual;
use super::settings::{Changes, Error, Options};
use super::sight::{LeafSeen, Sight, VertexSeen};
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
    /// How far light sets are apart.
    pub usual: Usual,
    /// What is in sight; its vertices have codes.
    pub sight: &'a Sight,
    pub codes: &'a [VertexSeen],
}

/// How a patch stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Standing {
    /// Codes by which it may be wrong, beyond noise.
    pub error: f32,
    /// Codes that its vertices may be off by, as far as more light sets are of use.
    pub noise: f32,
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
/// A triangle of so many pixels that was never divided may be wrong by so much.
const TESTED_PIXELS: u32 = 6;
const UNTESTED: f32 = 48.0;
/// Deviations of a difference that are taken for noise.
const NOISE: f32 = 2.0;
/// Of noise, so much is left to be seen when it is smoothed.
const SEEN: f32 = 0.5;
/// What all that is in sight is worth after an edit.
const DOUBT: f32 = 64.0;
/// Codes that a middle is off count a quarter in the quarters (linear interpolation: the error goes with the square of size).
const QUARTER: f32 = 0.25;
/// A glossy patch ages so many times as fast as a matt one that changes, if it is as sharp as can be; at least once.
const GLOSS_AGES: f32 = 4.0;

impl Worth<'_> {
    /// How a patch stands.
    pub fn standing(&self, number: u32) -> Standing {
        let patch = &self.mesh.patches[number as usize];
        let seen = self.sight.leaf(self.mesh, number);
        let (pixels, vertices) = seen.map_or((0, patch.vertices), |seen| (seen.pixels, seen.vertices));
        let has_spot = seen.is_some_and(LeafSeen::has_spot);
        let Root { object, material, .. } = self.mesh.roots[patch.root as usize];
        let (finish, tint) = self.materials[material as usize];
        let corners = vertices.map(|vertex| &self.mesh.vertices[vertex as usize]);
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
        let shown = |vertex: u32| {
            let at = &self.mesh.vertices[vertex as usize];
            let known = self.codes.get(at.slot as usize).filter(|seen| seen.vertex == vertex);
            known.map_or_else(|| self.codes(at, tint), |seen| seen.codes)
        };
        let own = || vertices.map(shown);
        let contrast = || {
            let [a, b, c] = own();
            let apart = |a: [f32; 2], b: [f32; 2]| beyond(a[0] - b[0], a[1] * a[1] + b[1] * b[1]);
            apart(a, b).max(apart(b, c)).max(apart(c, a))
        };
        let is_untested = self.options.tested && patch.level == 0 && !has_spot && pixels >= TESTED_PIXELS;
        let error = match (self.options.error, self.mesh.middles_above(number)) {
            // A pixel cannot be divided.
            _ if pixels <= 1 => 0.0,
            (Error::Curvature, Some(middles)) => {
                let off = middles.map(|[middle, a, b]| {
                    let [middle, a, b] = [middle, a, b].map(shown);
                    let variance = middle[1] * middle[1] + 0.25 * (a[1] * a[1] + b[1] * b[1]);
                    beyond(middle[0] - 0.5 * (a[0] + b[0]), variance)
                });
                QUARTER * off.into_iter().fold(0.0, f32::max)
            }
            (Error::Contrast, _) | (_, None) if is_untested => contrast().max(UNTESTED),
            (Error::Contrast, _) | (_, None) => contrast(),
        };
        let noise = match self.options.noise {
            true => {
                let room = corners.map(|vertex| self.has_room(vertex));
                own().into_iter().zip(room).filter(|(_, room)| *room).map(|([_, noise], _)| noise).fold(0.0, f32::max)
            }
            false => 0.0,
        };
        let is_guessed = pixels <= TINY && corners.iter().all(|vertex| vertex.has_light);
        Standing { error, noise, age: by_view.max(by_change), has_unknown, is_guessed, is_waiting, is_stale }
    }

    /// One number of it.
    pub fn priority(&self, standing: &Standing) -> f32 {
        match *standing {
            Standing { is_waiting: true, .. } => 0.0,
            // What is next to nothing can wait, if something is known of what is around it.
            Standing { has_unknown: true, is_guessed: true, .. } => GUESSED,
            Standing { has_unknown: true, .. } => CODES,
            Standing { error, noise, age, .. } => error + SEEN * noise + age,
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

    /// More light sets are of use to it.
    pub fn has_room(&self, vertex: &Vertex) -> bool {
        vertex.samples > 0
            && u32::from(vertex.samples) + u32::from(self.options.sets) <= u32::from(self.options.history)
    }

    /// Codes of what a vertex has by itself, and by how many noise may have changed them.
    pub fn codes(&self, vertex: &Vertex, tint: Vec3) -> [f32; 2] {
        if vertex.samples == 0 || !self.options.noise {
            return [self.code(vertex.light * tint), 0.0];
        }
        let code = self.code(vertex.mean * tint);
        let share = 1.0 + self.usual.share(vertex);
        [code, self.code(vertex.mean * tint * share) - code]
    }

    /// Display code of a radiance, 0..=255: by the sigmoid of Tumblin et al. in channels that weigh 5/16, 9/16 and 2/16,
    /// linear as in the paper, or as displays encode it.
    pub fn code(&self, radiance: Vec3) -> f32 {
        let by_channel = radiance.to_array().map(|channel| {
            let x = channel.max(0.0) / self.adaptation;
            let shown = x / (x + CONTRAST);
            if self.options.error == Error::Contrast { shown } else { shown.sqrt() }
        });
        CODES * Vec3::from_array(by_channel).dot(WEIGHTS)
    }
}

/// How far codes are apart beyond noise of this variance.
fn beyond(apart: f32, variance: f32) -> f32 {
    (apart.abs() - NOISE * variance.sqrt()).max(0.0)
}

const WEIGHTS: Vec3 = Vec3::new(5.0 / 16.0, 9.0 / 16.0, 2.0 / 16.0);
