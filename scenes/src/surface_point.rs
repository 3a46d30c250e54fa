//! Points of surfaces by name: object, triangle and place within it, never coordinates. Whoever has the scene finds
//! the same point again, to the bit, also after its object has moved or its piece was lifted out of it.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::{Object, Scene};

/// A point of a surface, and the side of it that is meant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SurfacePoint {
    /// Index into [`Scene::objects`] of an object that the file keeps apart. A point of a lifted piece names its whole,
    /// so that lifting and putting back change no name.
    pub object: u32,
    /// Index into [`crate::Mesh::triangles`].
    pub triangle: u32,
    /// Barycentric coordinates `[u, v]`: the point is `(1 − u − v) p0 + u p1 + v p2`. Both at least 0, their sum at most
    /// 1 up to rounding.
    pub uv: [f32; 2],
    /// The clockwise side is meant.
    pub back: bool,
    /// The shading normal points to the other side of the triangle than the one that is meant: an eye that sees a
    /// smooth surface at a grazing angle turns its normal towards itself. No for points that no eye has chosen.
    pub turned: bool,
}

/// A point that a scene does not have, at least not now.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Absent {
    /// No such object, or a lifted piece where its whole should be named.
    #[error("there is no object {object} that the file keeps apart, only {count}")]
    Object {
        /// What was named.
        object: u32,
        /// [`Scene::wholes`].
        count: usize,
    },
    /// No such triangle.
    #[error("object {object} has no triangle {triangle}, only {count}")]
    Triangle {
        /// Of which object.
        object: u32,
        /// What was named.
        triangle: u32,
        /// Triangles of its mesh.
        count: usize,
    },
    /// It takes no part in light transport.
    #[error("object {object} is hidden where its triangle {triangle} is")]
    Hidden {
        /// Of which object, or of a piece of which.
        object: u32,
        /// What was named.
        triangle: u32,
    },
    /// Not within the triangle.
    #[error("barycentric coordinates {u}, {v} lie outside of the triangle")]
    Outside {
        /// Of the second corner.
        u: f32,
        /// Of the third corner.
        v: f32,
    },
}

/// How far rounding may carry the sum of barycentric coordinates of a hit beyond 1: some units in the last place.
const SUM_MAX: f32 = 1.0 + 8.0 * f32::EPSILON;

impl SurfacePoint {
    /// It lies within its triangle.
    pub fn is_inside(&self) -> bool {
        let [u, v] = self.uv;
        // Also false of numbers that are none.
        u >= 0.0 && v >= 0.0 && u + v <= SUM_MAX
    }
}

impl Scene {
    /// Whether there is such a point, hidden or not; edits change nothing about that.
    ///
    /// # Errors
    /// [`Absent`] says what there is none of. What is cut out of a surface ([`crate::Coverage`]) is there all the same: a
    /// point there can be lit, and nobody sees it.
    pub fn check_point(&self, point: &SurfacePoint) -> Result<(), Absent> {
        let SurfacePoint { object, triangle, uv: [u, v], .. } = *point;
        let wholes = self.wholes();
        let whole = self.objects[..wholes].get(object as usize).ok_or(Absent::Object { object, count: wholes })?;
        let count = self.meshes[whole.mesh as usize].triangles.len();
        if triangle as usize >= count {
            return Err(Absent::Triangle { object, triangle, count });
        }
        if point.is_inside() { Ok(()) } else { Err(Absent::Outside { u, v }) }
    }

    /// The object that now has a point's triangle: the one named, or the piece of it that was lifted out with it.
    ///
    /// # Errors
    /// [`Absent`]: there is no such point, or it is hidden.
    pub fn find_point(&self, point: &SurfacePoint) -> Result<usize, Absent> {
        self.check_point(point)?;
        let SurfacePoint { object, triangle, .. } = *point;
        let now = self.holder(object, triangle);
        if self.objects[now].visible { Ok(now) } else { Err(Absent::Hidden { object, triangle }) }
    }

    /// The object that now has a triangle of one that the file keeps apart: that one, or the piece of it that was lifted out
    /// with it; both must exist.
    pub fn holder(&self, object: u32, triangle: u32) -> usize {
        if self.wholes() == self.objects.len() || self.lifted_of(object).next().is_none() {
            return object as usize;
        }
        let pieces = self.meshes[self.objects[object as usize].mesh as usize].pieces();
        self.find_lifted(object, pieces.of_triangle(triangle as usize)).unwrap_or(object as usize)
    }

    /// Where a point is now, scene space.
    ///
    /// # Errors
    /// See [`Scene::find_point`].
    pub fn place(&self, point: &SurfacePoint) -> Result<Vec3, Absent> {
        let Object { mesh, scene_from_object, .. } = &self.objects[self.find_point(point)?];
        let mesh = &self.meshes[*mesh as usize];
        let corners = mesh.triangles[point.triangle as usize].map(|vertex| mesh.positions[vertex as usize]);
        let [a, b, c] = match scene_from_object.is_identity() {
            true => corners,
            false => corners.map(|corner| scene_from_object.point(corner)),
        };
        let [u, v] = point.uv;
        Ok(a * (1.0 - u - v) + b * u + c * v)
    }

    /// The object that the file keeps apart which an object is a piece of, or itself: what [`SurfacePoint::object`]
    /// calls it.
    pub fn whole_of(&self, object: u32) -> u32 {
        self.objects[object as usize].lifted.as_ref().map_or(object, |lifted| lifted.of)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Change, Material, Mesh, Transform};

    /// Two triangles far apart, which are two pieces, twice.
    fn scene() -> Scene {
        let corner = |x: f32| [Vec3::X * x, Vec3::X * (x + 0.1), Vec3::X * x + Vec3::Y * 0.1];
        let positions = [corner(0.0), corner(10.0)].concat();
        let (triangles, materials) = (vec![[0, 1, 2], [3, 4, 5]], vec![0, 0]);
        Scene {
            meshes: vec![Mesh { positions, triangles, materials, ..Mesh::default() }.into()],
            objects: vec![Object::fixed("one", 0), Object::fixed("two", 0)],
            materials: vec![Material::diffuse("grey", Vec3::splat(0.5))],
            ..Scene::default()
        }
    }

    fn point(object: u32, triangle: u32, uv: [f32; 2]) -> SurfacePoint {
        SurfacePoint { object, triangle, uv, ..SurfacePoint::default() }
    }

    #[test]
    fn points_outside_of_the_scene_are_absent() {
        let mut scene = scene();
        assert_eq!(scene.find_point(&point(1, 1, [0.25, 0.75])), Ok(1));
        assert_eq!(scene.find_point(&point(2, 0, [0.0; 2])), Err(Absent::Object { object: 2, count: 2 }));
        assert_eq!(
            scene.find_point(&point(0, 2, [0.0; 2])),
            Err(Absent::Triangle { object: 0, triangle: 2, count: 2 })
        );
        for [u, v] in [[-0.1, 0.5], [0.6, 0.6], [f32::INFINITY, 0.0]] {
            assert_eq!(scene.find_point(&point(0, 0, [u, v])), Err(Absent::Outside { u, v }));
        }
        assert!(matches!(scene.find_point(&point(0, 0, [f32::NAN, 0.0])), Err(Absent::Outside { .. })));
        Change::Visible { object: 0, visible: false }.apply(&mut scene).unwrap();
        assert_eq!(scene.find_point(&point(0, 1, [0.0; 2])), Err(Absent::Hidden { object: 0, triangle: 1 }));
    }

    #[test]
    fn a_point_travels_with_its_piece_and_keeps_its_name() {
        let mut scene = scene();
        let (stays, goes) = (point(1, 0, [0.5, 0.25]), point(1, 1, [0.5, 0.25]));
        let before = scene.place(&goes).unwrap();
        let by = Vec3::new(0.0, 2.0, 1.0);
        let whole_from_piece = Transform { translation: by, ..Transform::IDENTITY };
        Change::PieceTransform { object: 1, piece: 1, whole_from_piece }.apply(&mut scene).unwrap();
        let now = scene.find_point(&goes).unwrap();
        assert!(now >= scene.wholes() && scene.whole_of(now as u32) == 1);
        assert!((scene.place(&goes).unwrap() - before - by).length() < 1e-5);
        assert_eq!(scene.find_point(&stays), Ok(1));
        assert!(scene.find_point(&point(now as u32, 1, [0.5, 0.25])).is_err(), "a piece is named by its whole");
        Change::PieceVisible { object: 1, piece: 1, visible: false }.apply(&mut scene).unwrap();
        assert_eq!(scene.find_point(&goes), Err(Absent::Hidden { object: 1, triangle: 1 }));
        assert_eq!(scene.find_point(&stays), Ok(1));
    }
}
