//! What of the differences between vertices is noise: each vertex knows how far its light sets are apart, and so how far its
//! mean may be off.
//!
//! * **More samples** where what is seen of a patch is noise rather than light (`worth`, `improve`).
//! * **Smoothing**: a vertex is shown as the mean of itself and of those it shares an edge with, each by how well it is known,
//!   as long as they differ by no more than noise; so that single vertices are no blotches. What is well known is shown as it
//!   is: with more samples, this goes away by itself.
//!
//! Light sets of one picture are chosen together to be apart, so that their mean is nearer to the truth than that of as many
//! independent ones: the estimate is of the safe kind.

use glam::Vec3;

use super::cache::Cache;
use super::mesh::Vertex;
use super::sight::{Sight, VertexSeen};

/// How far light sets are apart as a rule: the mean square of their differences from the mean, over its square, of the sum of
/// channels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Usual(f32);

/// By so many light sets is a vertex taken to be like all others, besides those that it knows.
const OTHERS: f32 = 4.0;
/// Share of a new value in what is usual.
const FADE: f32 = 1.0 / 256.0;
/// Before anything is known: half of the mean.
const FIRST: Usual = Usual(0.25);
/// What no vertex counts above.
const MOST: f32 = 4.0;
/// Beyond so many deviations of a difference, squared, it is light.
const LIGHT: f32 = 4.0;
/// Neighbours are lit otherwise by so much of the mean, whatever is known of them.
const APART: f32 = 0.02;
/// Neighbours that are lit by as many light sets are lit by the same: they share most of their error, and of its square so
/// much is left.
const SHARED: f32 = 0.25;

impl Default for Usual {
    fn default() -> Self {
        FIRST
    }
}

impl Usual {
    /// Another vertex is known by more than one set.
    pub fn add(&mut self, mean: Vec3, spread: f32, count: u8) {
        let square = mean.element_sum().powi(2);
        if count > 1 && square > 0.0 {
            let share = spread / ((f32::from(count) - 1.0) * square);
            self.0 += (share.min(MOST) - self.0) * FADE;
        }
    }

    /// What so many light sets are apart as a rule: sum of squares.
    pub fn spread(self, mean: Vec3, count: u8) -> f32 {
        self.0 * mean.element_sum().powi(2) * (f32::from(count) - 1.0).max(0.0)
    }

    /// Square of what a vertex's mean may be off by, of the sum of its channels; infinite if there is none.
    pub fn variance(self, vertex: &Vertex) -> f32 {
        let count = f32::from(vertex.samples);
        if vertex.samples == 0 {
            return f32::INFINITY;
        }
        let square = vertex.mean.element_sum().powi(2);
        (vertex.spread + OTHERS * self.0 * square) / ((count - 1.0 + OTHERS) * count)
    }

    /// What a vertex's mean may be off by, as a share of it.
    pub fn share(self, vertex: &Vertex) -> f32 {
        let mean = vertex.mean.element_sum();
        // What is too large to be squared may be off by as much as anything.
        if vertex.samples == 0 || mean <= 0.0 { 0.0 } else { (self.variance(vertex).sqrt() / mean).min(MOST) }
    }
}

impl Cache {
    /// Shows each vertex in sight as it and its neighbours have it.
    pub(super) fn smooth(&mut self) {
        if !self.options.noise {
            return;
        }
        let Self { mesh, sight, usual, .. } = self;
        let Sight { leaves, vertices, corners, .. } = sight;
        for seen in &mut vertices[..*corners] {
            seen.variance = usual.variance(&mesh.vertices[seen.vertex as usize]);
        }
        for [a, b, c] in leaves.iter().map(|leaf| leaf.corners) {
            for [a, b] in [[a, b], [b, c], [c, a]].into_iter().filter(|[a, b]| a != b) {
                let [seen_a, seen_b] = [a, b].map(|slot| vertices[slot as usize]);
                let [at_a, at_b] = [seen_a, seen_b].map(|seen| &mesh.vertices[seen.vertex as usize]);
                // What was lit before an edit tells nothing of what was lit after it.
                if at_a.samples > 0 && at_b.samples > 0 && at_a.revision != at_b.revision {
                    continue;
                }
                let [known_a, known_b] = [seen_a.variance, seen_b.variance];
                let differ = (at_a.mean - at_b.mean).abs().element_sum();
                let apart = (APART * at_a.mean.element_sum().max(at_b.mean.element_sum())).powi(2);
                let shared = if at_a.samples == at_b.samples { SHARED } else { 1.0 };
                let likely = (known_a + known_b) * shared;
                let doubt = if likely.is_finite() { 1.0 - differ * differ / (LIGHT * likely + apart) } else { 1.0 };
                if doubt <= 0.0 {
                    continue;
                }
                for (to, from, variance) in [(a, at_b, known_b), (b, at_a, known_a)] {
                    let weight = doubt * doubt / (variance + apart).max(f32::MIN_POSITIVE);
                    if weight.is_finite() {
                        let to = &mut vertices[to as usize];
                        (to.sum, to.weight) = (to.sum + from.mean * weight, to.weight + weight);
                    }
                }
            }
        }
        for VertexSeen { vertex, variance, sum, weight, .. } in &vertices[..*corners] {
            let vertex = &mut mesh.vertices[*vertex as usize];
            let own = if vertex.samples > 0 { 1.0 / variance } else { 0.0 };
            let all = own + weight;
            if own.is_infinite() {
                vertex.light = vertex.mean;
            } else if all > 0.0 && all.is_finite() {
                (vertex.light, vertex.has_light) = ((vertex.mean * own + *sum) / all, true);
            }
        }
    }
}
