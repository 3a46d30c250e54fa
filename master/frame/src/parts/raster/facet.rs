//! Facets: triangles as the picture has them, or what clipping has left of them.

use std::ops::Range;

use glam::{DVec3, Vec3};
use scenes::{Mesh, Object, Place, Scene};

use super::project::{OnPicture, Projection, SUBPIXEL_BITS, SUBPIXELS};

/// A convex part of a triangle on the picture that touches the middle of a pixel.
#[derive(Clone, Debug)]
pub(super) struct Facet {
    /// Snapped; the edges from each to the next have the inside on their right, rows being counted downwards.
    pub corners: [[i32; 2]; 3],
    /// First and last row of pixels whose middles it may touch.
    pub rows: [i32; 2],
    /// The same for columns.
    pub columns: [i32; 2],
    /// `a x + b y + c` for x and y in pixels: one over the depth; the second and the third barycentric coordinate over the
    /// depth.
    pub inverse_depth: [f64; 3],
    by_depth: [[f64; 3]; 2],
    /// One over the depths of its corners: what lies at its edges, up to rounding, is no nearer and no farther.
    pub inverse_depths: [f32; 2],
    pub object: u32,
    pub triangle: u32,
    pub back: bool,
    /// It is not there everywhere.
    pub has_holes: bool,
}

/// Some triangles of an object.
#[derive(Clone, Debug)]
pub(super) enum Portion {
    Range(Range<usize>),
    List(Vec<usize>),
}

/// What facets are made with.
#[derive(Clone, Copy)]
pub(super) struct Setup<'a> {
    pub scene: &'a Scene,
    pub projection: &'a Projection,
    /// Of the picture, pixels.
    pub size: [i32; 2],
}

/// Of a surface that is there in part, so much at least is seen.
const SEEN: f32 = 0.5;
/// Things nearer than this share of the largest coordinate of their triangle, along the view, are clipped: 2⁻⁴⁰, next to
/// nothing.
const NEAR: f64 = 1.0 / (1_u64 << 40) as f64;

/// A triangle is seen edge-on if the eye is no farther from its plane than this share of its largest coordinate, which is what
/// single precision tells apart: 2⁻²³.
const EDGE_ON: f64 = 1.0 / (1 << 23) as f64;

/// An object while its facets are made.
struct Of<'a> {
    setup: Setup<'a>,
    number: u32,
    object: &'a Object,
    mesh: &'a Mesh,
    is_placed: bool,
    is_mirrored: bool,
    vertices: Option<&'a [OnPicture]>,
}

impl Setup<'_> {
    /// The facets of some triangles, in their order. `vertices` are those of the object's mesh on the picture; `None` if it
    /// is not worth while to have them.
    pub fn facets(self, number: u32, vertices: Option<&[OnPicture]>, triangles: Portion) -> Vec<Facet> {
        let object = &self.scene.objects[number as usize];
        let of = Of {
            setup: self,
            number,
            object,
            mesh: &self.scene.meshes[object.mesh as usize],
            is_placed: object.scene_from_object.is_identity(),
            is_mirrored: object.scene_from_object.linear.determinant() < 0.0,
            vertices,
        };
        let mut facets = Vec::new();
        match triangles {
            Portion::Range(range) => range.for_each(|triangle| of.add(triangle, &mut facets)),
            Portion::List(list) => list.into_iter().for_each(|triangle| of.add(triangle, &mut facets)),
        }
        facets
    }
}

impl Of<'_> {
    /// In view space.
    fn view(&self, vertex: u32) -> Vec3 {
        let at = self.mesh.positions[vertex as usize];
        let at = if self.is_placed { at } else { self.object.scene_from_object.point(at) };
        self.setup.projection.view(at)
    }

    fn add(&self, triangle: usize, facets: &mut Vec<Facet>) {
        let corners = self.mesh.triangles[triangle];
        let on_picture = corners.map(|vertex| match self.vertices {
            Some(vertices) => vertices[vertex as usize],
            None => self.setup.projection.on_picture(self.view(vertex)),
        });
        if on_picture.iter().all(|corner| corner.is_known()) {
            let corners_seen = on_picture.map(|corner| corner.0);
            let Some(shape) = Shape::of(corners_seen, self.setup.size) else { return };
            if let Some(surface) = self.surface(triangle, corners) {
                facets.push(surface.facet(shape));
            }
        } else if !on_picture.iter().all(|corner| corner.is_behind()) {
            self.add_clipped(triangle, corners, facets);
        }
    }

    #[cold]
    fn add_clipped(&self, triangle: usize, corners: [u32; 3], facets: &mut Vec<Facet>) {
        let view = corners.map(|vertex| self.view(vertex).as_dvec3());
        let projection = self.setup.projection;
        let polygon = clip(view, projection.clipped_slope(), projection.near());
        if polygon.len() < 3 {
            return;
        }
        let Some(mut surface) = self.surface(triangle, corners) else { return };
        let depths = polygon.iter().map(|corner| (1.0 / corner.z) as f32);
        let (low, high) = depths.fold((f32::INFINITY, 0.0_f32), |(low, high), depth| (low.min(depth), high.max(depth)));
        surface.inverse_depths = [low, high];
        let seen: Vec<[i32; 2]> = polygon.iter().map(|at| self.setup.projection.clipped(*at)).collect();
        for pair in seen[1..].windows(2) {
            facets.extend(Shape::of([seen[0], pair[0], pair[1]], self.setup.size).map(|shape| surface.facet(shape)));
        }
    }

    /// What is the same for all parts of a triangle; `None`: it is seen edge-on, or nowhere there.
    fn surface(&self, triangle: usize, corners: [u32; 3]) -> Option<Surface> {
        let scene = self.setup.scene;
        let coverage = scene.materials[scene.material_of(self.number as usize, triangle) as usize].coverage;
        let has_holes = match coverage {
            None => false,
            Some(coverage) if coverage.amount.texture.is_none() && self.mesh.colours.is_empty() => {
                if coverage.of(1.0) < SEEN {
                    return None;
                }
                false
            }
            Some(_) => true,
        };
        let [p, q, r] = corners.map(|vertex| self.view(vertex).as_dvec3());
        // A direction d whose forward part is 1 meets the plane at the depth z where d z = Σ wᵢ pᵢ with Σ wᵢ = 1: by Cramer's
        // rule wᵢ / z is linear in d (Olano and Greer 1997).
        let over = [q.cross(r), r.cross(p), p.cross(q)];
        let volume = p.dot(over[0]);
        let reach = [p, q, r].iter().fold(0.0, |reach: f64, corner| reach.max(corner.abs().max_element()));
        if volume.abs() <= EDGE_ON * reach * (q - p).cross(r - p).length() {
            return None;
        }
        let [a, b, c] = over.map(|normal| normal / volume);
        let sum = a + b + c;
        let depths = [p, q, r].map(|corner| (1.0 / corner.z) as f32);
        let depths = depths.iter().fold([f32::INFINITY, 0.0], |[low, high], depth| [depth.min(low), depth.max(high)]);
        Some(Surface {
            inverse_depth: self.setup.projection.by_pixel(sum),
            by_depth: [b, c].map(|plane| self.setup.projection.by_pixel(plane)),
            inverse_depths: depths,
            object: self.number,
            triangle: triangle as u32,
            back: (volume > 0.0) != self.is_mirrored,
            has_holes,
        })
    }
}

/// A triangle but for its shape on the picture.
struct Surface {
    inverse_depth: [f64; 3],
    by_depth: [[f64; 3]; 2],
    inverse_depths: [f32; 2],
    object: u32,
    triangle: u32,
    back: bool,
    has_holes: bool,
}

impl Surface {
    fn facet(&self, Shape { corners, rows, columns }: Shape) -> Facet {
        let Self { inverse_depth, by_depth, inverse_depths, object, triangle, back, has_holes } = *self;
        Facet { corners, rows, columns, inverse_depth, by_depth, inverse_depths, object, triangle, back, has_holes }
    }
}

/// A triangle on the picture.
struct Shape {
    corners: [[i32; 2]; 3],
    rows: [i32; 2],
    columns: [i32; 2],
}

impl Shape {
    /// `None` if it touches the middle of no pixel of a picture of this size.
    #[inline]
    fn of(mut corners: [[i32; 2]; 3], size: [i32; 2]) -> Option<Self> {
        // Middles lie half a pixel from whole ones.
        let range = |axis: usize| {
            let along = corners.map(|corner| corner[axis]);
            let [low, high] = [along.into_iter().min()?, along.into_iter().max()?];
            let first = (low + SUBPIXELS / 2 - 1) >> SUBPIXEL_BITS;
            let last = (high - SUBPIXELS / 2) >> SUBPIXEL_BITS;
            let range = [first.max(0), last.min(size[axis] - 1)];
            (range[0] <= range[1]).then_some(range)
        };
        let (columns, rows) = (range(0)?, range(1)?);
        let [a, b, c] = corners.map(|corner| corner.map(i64::from));
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if area < 0 {
            corners.swap(1, 2);
        }
        (area != 0).then_some(Self { corners, rows, columns })
    }
}

impl Facet {
    /// Barycentric coordinates at a place of the picture, kept within the triangle.
    #[inline]
    pub fn uv(&self, x: f64, y: f64) -> [f32; 2] {
        let at = |[a, b, c]: [f64; 3]| a * x + b * y + c;
        let depth = 1.0 / at(self.inverse_depth);
        let [u, v] = self.by_depth.map(|plane| (at(plane) * depth) as f32);
        #[expect(clippy::manual_clamp, reason = "what is no number becomes 0, which `clamp` would leave")]
        let [u, v] = [u, v].map(|along| along.max(0.0).min(1.0));
        let beyond = (u + v).max(1.0);
        [u / beyond, v / beyond]
    }

    /// It is there at a place of the picture.
    #[cold]
    pub fn is_there(&self, scene: &Scene, x: f64, y: f64) -> bool {
        let mesh = &scene.meshes[scene.objects[self.object as usize].mesh as usize];
        let material = &scene.materials[scene.material_of(self.object as usize, self.triangle as usize) as usize];
        let [u, v] = self.uv(x, y);
        let place = Place { mesh, triangle: self.triangle as usize, weights: [1.0 - u - v, u, v] };
        material.coverage.is_none_or(|coverage| place.present(scene, &coverage) >= SEEN)
    }
}

/// The part of a triangle in view space that is in front of the eye and no farther aside than this slope (Sutherland and
/// Hodgman 1974).
fn clip(corners: [DVec3; 3], slope: f64, near: f64) -> Vec<DVec3> {
    let reach = corners.iter().fold(0.0, |reach: f64, corner| reach.max(corner.abs().max_element()));
    let near = near.max(reach * NEAR);
    let inside: [&dyn Fn(DVec3) -> f64; 5] =
        [&|at| at.z - near, &|at| at.z * slope - at.x, &|at| at.z * slope + at.x, &|at| at.z * slope - at.y, &|at| {
            at.z * slope + at.y
        }];
    let mut polygon = corners.to_vec();
    for inside in inside {
        let mut clipped = Vec::with_capacity(polygon.len() + 1);
        for (number, to) in polygon.iter().enumerate() {
            let from = polygon[(number + polygon.len() - 1) % polygon.len()];
            let [from_inside, to_inside] = [inside(from), inside(*to)];
            if (from_inside > 0.0) != (to_inside > 0.0) {
                // From the inside outwards, so that both triangles of an edge are cut at the same place.
                let ([a, b], [da, db]) = match from_inside > 0.0 {
                    true => ([from, *to], [from_inside, to_inside]),
                    false => ([*to, from], [to_inside, from_inside]),
                };
                clipped.push(a + (b - a) * (da / (da - db)));
            }
            if to_inside > 0.0 {
                clipped.push(*to);
            }
        }
        polygon = clipped;
    }
    polygon
}
