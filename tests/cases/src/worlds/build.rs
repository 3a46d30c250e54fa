//! Puts scenes together from a few shapes.

use glam::{Vec2, Vec3};
use scenes::{Camera, Colour, Environment, Light, Material, Mesh, Object, Scene, Surface, Texture};

/// A scene under way: one flat-shaded mesh and its materials.
#[derive(Clone, Debug, Default)]
pub struct Build {
    scene: Scene,
    mesh: Mesh,
}

/// Index of a material of the scene under way.
pub type Paint = u32;

impl Build {
    /// An empty world, black and dark.
    pub fn new(name: &str) -> Self {
        Self { scene: Scene { name: name.into(), ..Scene::default() }, mesh: Mesh::default() }
    }

    /// A diffuse material that emits `radiance` from its front.
    pub fn paint(&mut self, albedo: f32, radiance: f32) -> Paint {
        let mut material = Material::diffuse(format!("albedo {albedo} radiance {radiance}"), Vec3::splat(albedo));
        material.emission = Colour::plain(Vec3::splat(radiance));
        self.material(material)
    }

    /// A material that does not emit.
    pub fn surface(&mut self, surface: Surface) -> Paint {
        self.material(Material { surface, ..Material::diffuse("surface", Vec3::ZERO) })
    }

    /// Any material.
    pub fn material(&mut self, material: Material) -> Paint {
        self.scene.materials.push(material);
        (self.scene.materials.len() - 1) as Paint
    }

    /// A triangle, front where it is counter-clockwise.
    pub fn triangle(&mut self, corners: [Vec3; 3], paint: Paint) {
        let first = self.mesh.positions.len() as u32;
        self.mesh.positions.extend(corners);
        self.mesh.triangles.push([first, first + 1, first + 2]);
        self.mesh.materials.push(paint);
    }

    /// A flat convex polygon, front where it is counter-clockwise.
    pub fn polygon(&mut self, corners: &[Vec3], paint: Paint) {
        for i in 2..corners.len() {
            self.triangle([corners[0], corners[i - 1], corners[i]], paint);
        }
    }

    /// A parallelogram about a point; its front is where `half_u × half_v` points.
    pub fn quad(&mut self, middle: Vec3, half_u: Vec3, half_v: Vec3, paint: Paint) {
        let corner = |u: f32, v: f32| middle + half_u * u + half_v * v;
        self.polygon(&[corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)], paint);
    }

    /// A cube seen from inside, centred at the origin: fronts face inwards.
    /// Paints in the order −x, +x, −y, +y, −z, +z.
    pub fn room(&mut self, half: f32, paints: [Paint; 6]) {
        self.cuboid(Vec3::splat(half), paints);
    }

    /// A box seen from inside, like [`Self::room`], by half its edges.
    pub fn cuboid(&mut self, half: Vec3, paints: [Paint; 6]) {
        for (face, paint) in paints.into_iter().enumerate() {
            let axis = face / 2;
            let inwards = if face.is_multiple_of(2) { 1.0 } else { -1.0 };
            let unit = |k: usize| Vec3::from_array(std::array::from_fn(|i| f32::from(u8::from(i == k % 3))));
            let (u, v) = (unit(axis + 1), unit(axis + 2) * inwards);
            self.quad(unit(axis) * half * -inwards, u * half, v * half, paint);
        }
    }

    /// A box seen from outside, by its middle and half its edges.
    pub fn block(&mut self, middle: Vec3, half: Vec3, paint: Paint) {
        for axis in 0..3 {
            let unit = |k: usize| Vec3::from_array(std::array::from_fn(|i| f32::from(u8::from(i == k % 3))));
            for side in [-1.0, 1.0] {
                let (u, v) = (unit(axis + 1), unit(axis + 2) * side);
                self.quad(middle + unit(axis) * half * side, u * half, v * half, paint);
            }
        }
    }

    /// A horizontal square of that half edge at height y with a centred square hole; seen from both sides,
    /// its front is down.
    pub fn holed_ceiling(&mut self, y: f32, half: f32, hole: f32, paint: Paint) {
        let (middle, band) = ((half + hole) / 2.0, (half - hole) / 2.0);
        for side in [-1.0, 1.0] {
            self.quad(Vec3::new(side * middle, y, 0.0), Vec3::X * band, Vec3::Z * half, paint);
            self.quad(Vec3::new(0.0, y, side * middle), Vec3::X * hole, Vec3::Z * band, paint);
        }
    }

    /// A sphere of 8 n² triangles (an octahedron, its faces cut n times), scaled so that its **area**
    /// is the true sphere's: mean fluxes are then exact.
    pub fn sphere(&mut self, middle: Vec3, radius: f32, n: u32, fronts: Fronts, paint: Paint) {
        self.sphere_but(middle, radius, n, fronts, paint, |_| false);
    }

    /// The same without those triangles whose middles lie in some directions: their corners.
    pub fn sphere_but(
        &mut self,
        middle: Vec3,
        radius: f32,
        n: u32,
        fronts: Fronts,
        paint: Paint,
        is_left_out: impl Fn(Vec3) -> bool,
    ) -> Vec<[Vec3; 3]> {
        let triangles = octasphere(n);
        let double_area = |t: &[Vec3; 3]| f64::from((t[1] - t[0]).cross(t[2] - t[0]).length());
        let area: f64 = triangles.iter().map(double_area).sum::<f64>() / 2.0;
        let scale = radius * (4.0 * std::f64::consts::PI / area).sqrt() as f32;
        let mut left_out = Vec::new();
        for triangle in triangles {
            let [a, b, c] = triangle.map(|p| middle + p * scale);
            let corners = if fronts == Fronts::Outwards { [a, b, c] } else { [a, c, b] };
            if is_left_out((triangle[0] + triangle[1] + triangle[2]).normalize()) {
                left_out.push(corners);
            } else {
                self.triangle(corners, paint);
            }
        }
        left_out
    }

    /// An image, and where it lies on all that has been built so far.
    pub fn texture(&mut self, texture: Texture, uv: impl Fn(Vec3) -> Vec2) {
        self.mesh.uvs = self.mesh.positions.iter().map(|p| uv(*p)).collect();
        self.scene.textures.push(texture.into());
    }

    /// A light without surface.
    pub fn light(&mut self, light: Light) {
        self.scene.lights.push(light);
    }

    /// The same radiance from everywhere.
    pub fn environment(&mut self, radiance: f32) {
        self.scene.environment = Environment::Constant(Vec3::splat(radiance));
    }

    /// Closes the build, seen by a square picture.
    ///
    /// # Panics
    /// If the scene is not sound, which is a mistake in a test.
    pub fn seen(mut self, origin: Vec3, target: Vec3, fov_y_deg: f32, side: u32) -> Scene {
        let view = (target - origin).normalize();
        let up = if view.y.abs() > 0.9 { Vec3::Z } else { Vec3::Y };
        self.scene.camera = Camera { origin, target, up, fov_y_deg, width: side, height: side, ..Camera::default() };
        self.scene.objects.push(Object::fixed("all", 0));
        self.scene.meshes.push(self.mesh.into());
        self.scene.check().unwrap_or_else(|unsound| panic!("{}: {unsound}", self.scene.name));
        self.scene
    }
}

/// Where the front sides of a closed surface are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fronts {
    /// Outside: a ball.
    Outwards,
    /// Inside: a room.
    Inwards,
}

/// Corners on the unit sphere, counter-clockwise seen from outside.
fn octasphere(n: u32) -> Vec<[Vec3; 3]> {
    let mut triangles = Vec::with_capacity(8 * (n * n) as usize);
    for octant in 0..8_u32 {
        let sign = |bit: u32| if octant >> bit & 1 == 0 { 1.0 } else { -1.0 };
        let signs = Vec3::new(sign(0), sign(1), sign(2));
        let corner = |i: u32, j: u32| (Vec3::new((n - i - j) as f32, i as f32, j as f32) * signs).normalize();
        let mut push = |a, b, c| triangles.push(if signs.element_product() > 0.0 { [a, b, c] } else { [a, c, b] });
        for i in 0..n {
            for j in 0..n - i {
                push(corner(i, j), corner(i + 1, j), corner(i, j + 1));
                if i + j + 2 <= n {
                    push(corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1));
                }
            }
        }
    }
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spheres_are_closed_have_their_area_and_face_where_they_should() {
        for (fronts, sign) in [(Fronts::Outwards, 1.0), (Fronts::Inwards, -1.0)] {
            let mut build = Build::new("sphere");
            let paint = build.paint(0.5, 0.0);
            build.sphere(Vec3::new(1.0, 2.0, 3.0), 2.0, 16, fronts, paint);
            let scene = build.seen(Vec3::ZERO, Vec3::ONE, 40.0, 4);
            let mesh = &scene.meshes[0];
            assert_eq!(mesh.triangles.len(), 8 * 16 * 16);
            let (mut area, mut flux, mut closed) = (0.0, 0.0, glam::DVec3::ZERO);
            for triangle in &mesh.triangles {
                let [a, b, c] = triangle.map(|i| (mesh.positions[i as usize] - Vec3::new(1.0, 2.0, 3.0)).as_dvec3());
                let normal = (b - a).cross(c - a) / 2.0;
                area += normal.length();
                flux += normal.dot(a + b + c).signum() * normal.length();
                closed += normal;
            }
            let expected = 16.0 * std::f64::consts::PI;
            assert!((area / expected - 1.0).abs() < 1e-6, "{area}");
            assert!((flux * sign / expected - 1.0).abs() < 1e-6, "{flux}");
            assert!(closed.length() < 1e-4, "{closed}");
        }
    }

    #[test]
    fn rooms_face_inwards() {
        let mut build = Build::new("room");
        let paint = build.paint(0.5, 0.0);
        build.room(2.0, [paint; 6]);
        let scene = build.seen(Vec3::ZERO, Vec3::X, 40.0, 4);
        let mesh = &scene.meshes[0];
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
            assert!((b - a).cross(c - a).dot(a) < 0.0);
        }
        assert_eq!(mesh.triangles.len(), 12);
    }
}
