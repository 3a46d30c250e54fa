//! Normals of smoothing groups: where a file says which faces are one smooth surface, and gives no normals.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

/// Normals that gather, by smoothing group and vertex.
#[derive(Default)]
pub(super) struct Smoothing {
    sums: HashMap<(u32, u32), Sum>,
}

struct Sum {
    normal: DVec3,
    /// Its place in the list of normals, once it is there.
    index: Option<u32>,
}

impl Smoothing {
    /// A face of a group: its vertices, and where they are. Each counts by the face's angle there (Thürmer & Wüthrich
    /// 1998), so that it does not matter how a surface is cut into faces.
    pub fn add(&mut self, group: u32, vertices: impl Iterator<Item = u32>, points: &[DVec3]) {
        let n = points.len();
        let mut newell = DVec3::ZERO;
        for i in 1..n - 1 {
            newell += (points[i] - points[0]).cross(points[i + 1] - points[0]);
        }
        let normal = newell.normalize_or_zero();
        for (i, vertex) in vertices.enumerate() {
            let last = (points[(i + n - 1) % n] - points[i]).normalize_or_zero();
            let next = (points[(i + 1) % n] - points[i]).normalize_or_zero();
            let angle = libm::acos(last.dot(next).clamp(-1.0, 1.0));
            let sum = self.sums.entry((group, vertex)).or_insert(Sum { normal: DVec3::ZERO, index: None });
            if angle.is_finite() {
                sum.normal += normal * angle;
            }
        }
    }

    /// Index of a vertex's normal in the list, where it is put when it is first asked for; `None` if it has none.
    pub fn normal(&mut self, group: u32, vertex: u32, normals: &mut Vec<Vec3>) -> Option<u32> {
        let sum = self.sums.get_mut(&(group, vertex)).filter(|sum| sum.normal != DVec3::ZERO)?;
        Some(*sum.index.get_or_insert_with(|| {
            normals.push(sum.normal.normalize_or_zero().as_vec3());
            (normals.len() - 1) as u32
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_corner_of_a_cube_leans_alike_on_its_sides_however_they_are_cut() {
        let (x, y, z, o) = (DVec3::X, DVec3::Y, DVec3::Z, DVec3::ZERO);
        let mut smoothing = Smoothing::default();
        smoothing.add(1, [0, 1, 2, 3].into_iter(), &[o, x, x + y, y]);
        // The second side in two pieces, which count as one.
        smoothing.add(1, [0, 2, 4].into_iter(), &[o, y, y + z]);
        smoothing.add(1, [0, 4, 5].into_iter(), &[o, y + z, z]);
        smoothing.add(1, [0, 5, 6, 1].into_iter(), &[o, z, z + x, x]);
        smoothing.add(2, [0, 1, 2].into_iter(), &[o, x, y]);
        let mut normals = Vec::new();
        assert_eq!(smoothing.normal(1, 0, &mut normals), Some(0));
        assert!((normals[0] - Vec3::ONE.normalize()).length() < 1e-6, "{}", normals[0]);
        assert_eq!(smoothing.normal(1, 0, &mut normals), Some(0), "once");
        assert_eq!((smoothing.normal(2, 0, &mut normals), normals[1]), (Some(1), Vec3::Z), "a group of its own");
        assert_eq!(smoothing.normal(3, 0, &mut normals), None);
    }
}
