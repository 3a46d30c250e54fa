//! From boxes to a tree: obvhs builds a binary one, [`Tree::collapse`] widens it.

use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::PlocBuilder;

use super::bounds::Aabb;
use super::tree::Tree;

/// Builds a tree over boxes: PLOC and parallel reinsertion at obvhs' medium preset, then collapsed.
pub(super) fn tree(boxes: &[Aabb], leaf_size: usize) -> Tree {
    Tree::collapse(&binary(boxes), boxes, leaf_size)
}

fn binary(boxes: &[Aabb]) -> Bvh2 {
    if boxes.is_empty() {
        return Bvh2::default();
    }
    let preset = BvhBuildParams::medium_build();
    let perturbed: Vec<_> = boxes.iter().enumerate().map(|(number, bounds)| perturb(bounds, number)).collect();
    let mut binary = PlocBuilder::with_capacity(boxes.len()).build(
        preset.ploc_search_distance,
        &perturbed,
        (0..boxes.len() as u32).collect(),
        preset.sort_precision,
        preset.search_depth_threshold,
    );
    ReinsertionOptimizer::default().run(&mut binary, 3.0 * preset.reinsertion_batch_ratio, None);
    binary
}

/// The box a little larger, by an amount that depends on its number.
///
/// PLOC merges mutual nearest neighbours. Among coincident or evenly spaced boxes every distance is
/// the same, only one pair is mutual, and building takes quadratic time. Different sizes break the
/// ties. Only the tree's shape sees this; its bounds are computed from the true boxes.
fn perturb(bounds: &Aabb, number: usize) -> obvhs::aabb::Aabb {
    let hash = (number as u32 ^ 0x9E37_79B9).wrapping_mul(0x85EB_CA6B);
    let hash = (hash ^ (hash >> 15)).wrapping_mul(0xC2B2_AE35);
    let unit = (hash >> 8) as f32 / (1 << 24) as f32;
    let grown = bounds.grown(bounds.diagonal().max_element() * 0.01 * unit);
    obvhs::aabb::Aabb::new(grown.min.into(), grown.max.into())
}
