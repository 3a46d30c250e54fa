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
        if vertex.samples == 0 || mean <= 0.0 { 0.0 } else { self.variance(vertex).sqrt() / mean }
    }
}

/// A vertex while it is smoothed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Around {
    /// Of its own; negative: nobody has looked.
    variance: f32,
    sum: Vec3,
    weight: f32,
}

impl Cache {
    /// Shows each vertex in sight as it and its neighbours have it.
    pub(super) fn smooth(&mut self) {
        if !self.options.noise {
            return;
        }
        let Self { mesh, around, usual, seen, .. } = self;
        around.clear();
        around.resize(mesh.vertices.len(), Around { variance: -1.0, ..Around::default() });
        let mut in_sight = Vec::new();
        for patch in seen.iter() {
            let corners = mesh.patches[*patch as usize].vertices;
            for number in corners {
                let here = &mut around[number as usize];
                if here.variance < 0.0 {
                    let vertex = &mesh.vertices[number as usize];
                    in_sight.push(number);
                    here.variance = usual.variance(vertex);
                }
            }
            let [a, b, c] = corners;
            for [a, b] in [[a, b], [b, c], [c, a]] {
                let [at_a, at_b] = [a, b].map(|vertex| &mesh.vertices[vertex as usize]);
                // What was lit before an edit tells nothing of what was lit after it.
                if at_a.samples > 0 && at_b.samples > 0 && at_a.revision != at_b.revision {
                    continue;
                }
                let [known_a, known_b] = [a, b].map(|vertex| around[vertex as usize].variance);
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
                        let to = &mut around[to as usize];
                        (to.sum, to.weight) = (to.sum + from.mean * weight, to.weight + weight);
                    }
                }
            }
        }
        for number in in_sight {
            let Around { variance, sum, weight } = around[number as usize];
            let vertex = &mut mesh.vertices[number as usize];
            let own = if vertex.samples > 0 { 1.0 / variance } else { 0.0 };
            let all = own + weight;
            if own.is_infinite() {
                vertex.light = vertex.mean;
            } else if all > 0.0 && all.is_finite() {
                (vertex.light, vertex.has_light) = ((vertex.mean * own + sum) / all, true);
            }
        }
    }
}
