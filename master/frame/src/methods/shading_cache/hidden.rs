//! Vertices that the eye cannot see, of patches that it sees in part: they lie within other things or behind them, and are lit
//! otherwise than what is in sight. They are shown as the vertices beside them that can be seen, and patches are worth nothing
//! for what they differ by. What is lit is up to the vertices in sight.

use glam::Vec3;
use rayon::prelude::*;
use scenes::Scene;

use super::cache::Cache;
use super::sight::Sight;

/// A vertex is hidden if it lies behind all that is seen around it, by more than this share of the distance: rounding.
const BEHIND: f32 = 1e-3;
/// Vertices beside hidden ones are looked for so many edges away.
const EDGES: usize = 2;

impl Cache {
    /// Finds which corners of the leaves in sight are hidden.
    pub(super) fn find_hidden(&mut self, scene: &Scene) {
        if !self.options.tested {
            return;
        }
        let Self { mesh, sight, raster, camera, .. } = self;
        let lens = camera.lens();
        let (mesh, depths, [width, height]) = (&*mesh, raster.inverse_depths(), [raster.width(), raster.height()]);
        // `None`: it is not on the picture, and nobody can tell.
        let is_hidden = |vertex: u32| {
            let place = scene.place(&mesh.at(vertex)).ok()?;
            let (x, y, _) = lens.project(place)?;
            let is_on = x >= 0.0 && y >= 0.0 && x < width as f32 && y < height as f32;
            let (x, y) = is_on.then_some((x as usize, y as usize))?;
            let rows = y.saturating_sub(1)..(y + 2).min(height);
            let around = rows.flat_map(|row| &depths[row * width..][x.saturating_sub(1)..(x + 2).min(width)]);
            // Over 1: the farthest is the least.
            let farthest = around.fold(f32::INFINITY, |least, depth| least.min(*depth));
            Some(1.0 / (place - lens.origin()).dot(lens.axes()[2]) < farthest * (1.0 - BEHIND))
        };
        let corners = sight.vertices[..sight.corners].par_iter_mut().with_min_len(256);
        corners.for_each(|seen| seen.is_hidden = is_hidden(seen.vertex).unwrap_or(false));
    }

    /// Shows hidden corners as what is beside them.
    pub(super) fn cover_hidden(&mut self) {
        if !self.options.tested {
            return;
        }
        let Self { mesh, sight, options, .. } = self;
        let Sight { leaves, vertices, corners, .. } = sight;
        if !options.noise {
            // Nobody else has said how they are shown.
            for seen in &vertices[..*corners] {
                let vertex = &mut mesh.vertices[seen.vertex as usize];
                vertex.light = if vertex.samples > 0 { vertex.mean } else { vertex.light };
            }
        }
        let mut is_open: Vec<bool> = vertices[..*corners].iter().map(|seen| seen.is_hidden).collect();
        for _ in 0..EDGES {
            vertices[..*corners].iter_mut().for_each(|seen| (seen.sum, seen.weight) = (Vec3::ZERO, 0.0));
            for [a, b, c] in leaves.iter().map(|leaf| leaf.corners) {
                for [to, from] in [[a, b], [b, a], [b, c], [c, b], [c, a], [a, c]] {
                    let beside = &mesh.vertices[vertices[from as usize].vertex as usize];
                    if is_open[to as usize] && !is_open[from as usize] && beside.has_light {
                        let to = &mut vertices[to as usize];
                        (to.sum, to.weight) = (to.sum + beside.light, to.weight + 1.0);
                    }
                }
            }
            for (seen, is_open) in vertices.iter().zip(&mut is_open).filter(|(seen, _)| seen.weight > 0.0) {
                let vertex = &mut mesh.vertices[seen.vertex as usize];
                (vertex.light, vertex.has_light, *is_open) = (seen.sum / seen.weight, true, false);
            }
        }
        // Those that nothing in sight is beside are what they are.
        let lost = vertices.iter_mut().zip(is_open).filter(|(_, is_open)| *is_open);
        lost.for_each(|(seen, _)| seen.is_hidden = false);
    }
}
