//! What is done about patches that are chosen: their vertices are lit, or they are divided; and where too much changes at once,
//! they are joined.

use super::asking::Wanted;
use super::cache::{Cache, mix};
use super::mesh::Root;
use super::select::{Enough, PriorityMap};
use super::worth::Standing;
use crate::front_end::View;
use crate::parts::Finish;

/// Ticks after which an object is not taken to change any more.
const CHANGES_FOR: u32 = 30;

/// Steps of a tick.
const CHOOSE: &str = "sampling choice";
const DIVIDE: &str = "patch subdivision";

impl Cache {
    /// Where light changes on more than can be renewed in time, patches are joined.
    pub(super) fn clean_up(&mut self, vertices: usize) {
        self.changing.retain(|_, since| self.tick.saturating_sub(*since) < CHANGES_FOR);
        if self.changing.is_empty() || self.options.clean_up == 0 {
            return;
        }
        let worth = self.worth();
        let is_changing = |number: &u32| {
            let patch = &self.mesh.patches[*number as usize];
            let Root { object, .. } = self.mesh.roots[patch.root as usize];
            self.changing.contains_key(&object) && worth.standing(*number).is_stale
        };
        let stale: Vec<u32> = self.sight.leaves.iter().map(|leaf| leaf.patch).filter(is_changing).collect();
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
        self.sight.clear();
    }

    /// Chooses patches, and what to do about them, until so many vertices are to be lit.
    pub(super) fn choose(
        &mut self,
        view: &View,
        vertices: usize,
        done: &mut dyn FnMut(Option<&'static str>),
    ) -> Vec<Wanted> {
        let slots = &self.sight.slots;
        let mut hits = vec![0_u32; self.sight.leaves.len()];
        let mut order = Vec::new();
        let mut cost = 0;
        self.chosen.clear();
        let mut chosen = Vec::new();
        let map = PriorityMap {
            width: self.raster.width(),
            patches: slots,
            priorities: &self.priorities,
            scale: self.options.scale,
            chance: self.options.chance,
        };
        let seed = mix(view.seed ^ u64::from(self.tick) << 32);
        map.select(
            |index| (mix(seed ^ u64::from(index)) >> 32) as u32,
            |pixel, why| {
                chosen.push((pixel as u32, why));
                let slot = slots[pixel] as usize;
                hits[slot] += 1;
                if hits[slot] == 1 {
                    order.push(slot);
                    cost += self.cost(self.sight.leaves[slot].patch);
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
        for slot in order {
            // More hits: faster.
            let levels = 1 + hits[slot].ilog2() / 2;
            let patch = self.sight.leaves[slot].patch;
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
        let (vertices, has_spot) = self.lit_by(patch);
        let root = self.mesh.patches[patch as usize].root;
        let (finish, _) = self.materials[self.mesh.roots[root as usize].material as usize];
        let vertices = vertices.map(|vertex| &self.mesh.vertices[vertex as usize]);
        let lacking = vertices.iter().filter(|vertex| worth.is_unknown(vertex) || worth.is_stale(vertex, finish));
        match lacking.count() {
            _ if has_spot => 1,
            0 => 2,
            count => count,
        }
    }

    /// The vertices that light a patch, and whether they are one.
    fn lit_by(&self, patch: u32) -> ([u32; 3], bool) {
        match self.sight.leaf(&self.mesh, patch) {
            Some(seen) => (seen.vertices, seen.has_spot()),
            None => (self.mesh.patches[patch as usize].vertices, false),
        }
    }

    /// Lights what a patch lacks, or divides it.
    fn improve(&mut self, view: &View, patch: u32, levels: u32, most: usize, wanted: &mut Vec<Wanted>) {
        let worth = self.worth();
        let here = self.mesh.patches[patch as usize];
        let standing = worth.standing(patch);
        if standing.is_waiting {
            return;
        }
        let (finish, _) = self.materials[self.mesh.roots[here.root as usize].material as usize];
        let Standing { has_unknown, is_stale, age, error, noise, .. } = standing;
        let (vertices, has_spot) = self.lit_by(patch);
        let is_outdated = vertices.iter().any(|vertex| {
            let vertex = &self.mesh.vertices[*vertex as usize];
            vertex.samples > 0 && vertex.revision != self.revision
        });
        if has_unknown || is_outdated || is_stale && age >= error {
            let lacks = |vertex: &u32| {
                let vertex = &self.mesh.vertices[*vertex as usize];
                worth.is_unknown(vertex) || worth.is_stale(vertex, finish)
            };
            let lacking: Vec<u32> = vertices.iter().copied().filter(lacks).collect();
            lacking.into_iter().for_each(|vertex| self.want(view, vertex, finish, 0, wanted));
            return;
        }
        // What cannot be told from noise is not divided.
        if noise > error && self.refine(view, patch, wanted) {
            return;
        }
        let is_divided = !has_spot && !self.is_small(view, patch) && self.mesh.split(patch, self.tick);
        if !is_divided {
            self.refine(view, patch, wanted);
            return;
        }
        let children = self.mesh.children(patch);
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

    /// Lights a patch's vertices by more light sets; false if they have been by all.
    fn refine(&mut self, view: &View, patch: u32, wanted: &mut Vec<Wanted>) -> bool {
        let here = self.mesh.patches[patch as usize];
        let (finish, _) = self.materials[self.mesh.roots[here.root as usize].material as usize];
        let before = wanted.len();
        for number in self.lit_by(patch).0 {
            let vertex = &self.mesh.vertices[number as usize];
            let samples = vertex.samples;
            if self.worth().has_room(vertex) {
                self.want(view, number, finish, samples, wanted);
            }
        }
        wanted.len() > before
    }

    /// Divides what was just divided, whether its vertices are known or not, as long as no more than `most` are wanted.
    fn deepen(&mut self, view: &View, patch: u32, levels: u32, most: usize, wanted: &mut Vec<Wanted>) {
        if levels == 0 || wanted.len() >= most || self.is_small(view, patch) || !self.mesh.split(patch, self.tick) {
            return;
        }
        let here = self.mesh.patches[patch as usize];
        let (finish, _) = self.materials[self.mesh.roots[here.root as usize].material as usize];
        let first = self.mesh.children(patch);
        for vertex in self.mesh.patches[first as usize + 3].vertices {
            if self.worth().is_unknown(&self.mesh.vertices[vertex as usize]) {
                self.want(view, vertex, finish, 0, wanted);
            }
        }
        (first..first + 4).for_each(|child| self.deepen(view, child, levels - 1, most, wanted));
    }

    fn want(&mut self, view: &View, number: u32, finish: Finish, before: u8, wanted: &mut Vec<Wanted>) {
        let at = self.mesh.at(number);
        let vertex = &mut self.mesh.vertices[number as usize];
        // What is hidden, or of a piece that was hidden, would be refused with all the others.
        if vertex.is_asked || view.scene.find_point(&at).is_err() {
            return;
        }
        vertex.is_asked = true;
        let (serial, is_seen) = (vertex.serial, finish != Finish::Matt);
        wanted.push(Wanted { vertex: number, serial, at, is_seen, before });
    }

    /// It is no larger than a pixel.
    fn is_small(&self, view: &View, patch: u32) -> bool {
        let lens = view.camera.lens();
        let corners = self.mesh.patches[patch as usize].vertices.map(|vertex| {
            let at = view.scene.place(&self.mesh.at(vertex)).ok()?;
            lens.project(at).map(|(x, y, _)| [x, y])
        });
        let [Some(a), Some(b), Some(c)] = corners else { return false };
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        area.abs() <= 2.0
    }
}
