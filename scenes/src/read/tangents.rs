//! Tangents for normal maps, as MikkTSpace finds them (Mikkelsen 2008): of each triangle where u grows, along the surface
//! at each of its corners, weighed by the angle there. What a file gives goes before.

use glam::{DVec2, DVec3, Vec3, Vec4};

use super::mesh::Vertex;

/// Tangents that gather, one a vertex.
#[derive(Default)]
pub(super) struct Tangents {
    sums: Vec<Sum>,
}

#[derive(Clone, Copy, Default)]
struct Sum {
    along: DVec3,
    side: f32,
    given: Vec4,
}

/// On which side of where u grows v does, seen from the front: 1 or -1; 0 where the file says it, or nobody can.
pub(super) fn side(corners: &[Vertex; 3], set: usize) -> i8 {
    if corners.iter().all(|corner| corner.tangent != Vec4::ZERO) {
        return 0;
    }
    match area(corners, set) {
        area if area > 0.0 => 1,
        area if area < 0.0 => -1,
        _ => 0,
    }
}

/// Twice the area in the texture.
fn area(corners: &[Vertex; 3], set: usize) -> f64 {
    let [a, b, c] = corners.map(|corner| corner.uvs[set].as_dvec2());
    let area = (b - a).perp_dot(c - a);
    if area.is_finite() { area } else { 0.0 }
}

impl Tangents {
    /// A triangle with a normal map; `side` is [`side`]'s.
    pub fn add(&mut self, triangle: [u32; 3], corners: &[Vertex; 3], set: usize, side: i8) {
        let positions = corners.map(|corner| corner.position.as_dvec3());
        let [a, b, c] = corners.map(|corner| corner.uvs[set].as_dvec2());
        let [ab, ac] = [positions[1] - positions[0], positions[2] - positions[0]];
        let [DVec2 { y: v_ab, .. }, DVec2 { y: v_ac, .. }] = [b - a, c - a];
        let grows = (ab * v_ac - ac * v_ab) * f64::from(side);
        for corner in 0..3 {
            let vertex = triangle[corner] as usize;
            if self.sums.len() <= vertex {
                self.sums.resize(vertex + 1, Sum::default());
            }
            let sum = &mut self.sums[vertex];
            if side == 0 {
                sum.given = corners[corner].tangent;
                continue;
            }
            let normal = corners[corner].normal.as_dvec3().normalize_or_zero();
            let along = (grows - normal * normal.dot(grows)).normalize_or_zero();
            let [here, next, last] = [0, 1, 2].map(|step| positions[(corner + step) % 3]);
            let (to_next, to_last) = ((next - here).normalize_or_zero(), (last - here).normalize_or_zero());
            sum.along += along * libm::acos(to_next.dot(to_last).clamp(-1.0, 1.0));
            sum.side = f32::from(side);
        }
    }

    /// One a vertex; empty if nothing has a normal map. Zero for vertices without normal or direction.
    pub fn finish(mut self, normals: &[Vec3]) -> Vec<Vec4> {
        if self.sums.is_empty() {
            return Vec::new();
        }
        self.sums.resize(normals.len(), Sum::default());
        let found = |(sum, normal): (&Sum, &Vec3)| {
            let (along, side) = match sum.given == Vec4::ZERO {
                true => (sum.along, sum.side),
                false => (sum.given.truncate().as_dvec3(), if sum.given.w < 0.0 { -1.0 } else { 1.0 }),
            };
            let along = along.normalize_or_zero();
            let usable = along.is_finite() && along != DVec3::ZERO && *normal != Vec3::ZERO && side != 0.0;
            if usable { along.as_vec3().extend(side) } else { Vec4::ZERO }
        };
        self.sums.iter().zip(normals).map(found).collect()
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;

    /// A triangle in z = 0 whose u grows along x, and v along y or against it.
    fn corners(mirrored: bool) -> [Vertex; 3] {
        [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)].map(|(x, y)| {
            let mut vertex = Vertex { position: Vec3::new(x, y, 0.0), normal: Vec3::Z, ..Vertex::default() };
            vertex.uvs[0] = Vec2::new(x, if mirrored { -y } else { y });
            vertex
        })
    }

    #[test]
    fn tangents_lead_where_u_grows_on_either_side() {
        for (mirrored, expected) in [(false, 1.0), (true, -1.0)] {
            let corners = corners(mirrored);
            let side = side(&corners, 0);
            let mut tangents = Tangents::default();
            tangents.add([0, 1, 2], &corners, 0, side);
            assert_eq!(tangents.finish(&[Vec3::Z; 3]), [Vec4::new(1.0, 0.0, 0.0, expected); 3]);
        }
    }

    #[test]
    fn what_the_file_gives_goes_before_and_flat_corners_have_none() {
        let given = Vec4::new(0.0, 1.0, 0.0, -1.0);
        let corners = corners(false).map(|corner| Vertex { tangent: given, ..corner });
        let mut tangents = Tangents::default();
        tangents.add([0, 1, 2], &corners, 0, side(&corners, 0));
        assert_eq!(tangents.finish(&[Vec3::Z, Vec3::ZERO, Vec3::Z]), [given, Vec4::ZERO, given]);
    }
}
