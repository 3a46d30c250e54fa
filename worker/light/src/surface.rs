//! What a ray meets: the place, its normals, and how it scatters light.

use glam::{Mat3, Vec2, Vec3, Vec4};
use scenes::model::CLEAR_ROUGHNESS;
use scenes::{
    Coat, Colour, Dielectric, Gloss, Place, Rgb, Scalar, Scene, Sheen, Specular, Surface, SurfacePoint, texture,
};

use crate::bvh::{Hit, Ray};
use crate::facets::Facets;
use crate::frosted::Frosted;
use crate::glossy::{Fresnel, Glossy};
use crate::{relief, sample};

/// A surface element as seen from the ray that met it.
#[derive(Clone, Copy, Debug)]
pub struct Surfel {
    /// On the triangle, up to [`Self::epsilon`].
    pub position: Vec3,
    /// A bound on the error of `position`, relative to the size of the numbers it was made of, so that
    /// scaling the scene by a power of two changes no bit.
    pub epsilon: f32,
    /// Unit normal of the triangle, on the viewer's side.
    pub geometric: Vec3,
    /// Unit interpolated normal, with its relief, on the viewer's side.
    pub shading: Vec3,
    /// The same without relief: how the surface lies as a whole.
    pub smooth: Vec3,
    /// The viewer is on the counter-clockwise side.
    pub front: bool,
    /// Texture coordinates of the first set.
    pub uv: Vec2,
    /// Colour of the vertices; white without.
    pub tint: Rgb,
    /// Index into [`Scene::meshes`].
    pub mesh: u32,
    /// Index into the mesh's triangles.
    pub triangle: u32,
    /// Barycentric coordinates, of the second and the third corner.
    pub weights: [f32; 2],
    /// Index into [`Scene::materials`].
    pub material: u32,
    /// What glass it lies in.
    pub around: Around,
    /// In [0, 1): what a surface that is glass in part is here, for the ray that met it; glass where it is below its part.
    pub chance: f32,
}

/// What other glass a surface of solid glass lies in ([`Dielectric::priority`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Around {
    /// Index of refraction of what is on its outside.
    pub ior: f32,
    /// σ of that.
    pub absorption: Rgb,
    /// That is on its inside as well: there is no boundary.
    pub outranks: bool,
}

impl Default for Around {
    /// Air.
    fn default() -> Self {
        Self { ior: 1.0, absorption: Vec3::ZERO, outranks: false }
    }
}

/// What of a hit is worth computing.
#[derive(Clone, Copy, Debug)]
pub struct Detail {
    /// Texture coordinates: some material is textured.
    pub uvs: bool,
    /// Normal maps: some material has one.
    pub relief: bool,
    /// Vertex colours: some mesh has them.
    pub colours: bool,
    /// Transforms of objects: some object stands elsewhere than it was modelled.
    pub places: bool,
    /// [`Surfel::chance`]: some material is glass in part.
    pub chances: bool,
}

/// How a surfel scatters, textures looked up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scatter {
    /// Lambert.
    Diffuse {
        /// ρ, 0..1.
        albedo: Rgb,
    },
    /// Perfect mirror.
    Mirror {
        /// 0..1.
        reflectance: Rgb,
    },
    /// Clear glass.
    Glass {
        /// Index of the inside, over that of the outside.
        ior: f32,
        /// Tint at each crossing.
        transmittance: Rgb,
        /// Sheet of two faces.
        thin: bool,
    },
    /// Frosted glass.
    Frosted(Frosted),
    /// Diffuse base under a GGX lobe.
    Glossy(Glossy),
    /// Lambert on both sides. Estimators look at one of them ([`Self::side`]).
    Translucent {
        /// ρ, of what stays on its side.
        albedo: Rgb,
        /// Of what leaves on the other.
        transmittance: Rgb,
    },
}

/// A ray's way on from a specular surface.
#[derive(Clone, Copy, Debug)]
pub struct Bounce {
    /// Offset to the side it leaves on.
    pub origin: Vec3,
    /// Unit.
    pub direction: Vec3,
    /// Radiance (eye paths) or flux (light paths) is multiplied by this.
    pub weight: Rgb,
    /// It stays on its side.
    pub reflected: bool,
}

/// What travels along a path: decides whether refraction squeezes it (radiance scales with n²).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Carries {
    /// Paths from the eye.
    Radiance,
    /// Paths from lights.
    Flux,
}

/// 2⁻¹⁹: 32 units in the last place of the largest coordinate involved; covers the rounding of
/// interpolation, transformation and intersection (γ₇ and then some; pbrt's error bounds, section 6.8).
const RELATIVE_EPSILON: f32 = 1.0 / 524_288.0;

impl Surfel {
    /// The surfel at a hit; texture coordinates are 0 where nobody looks at them.
    pub fn at(scene: &Scene, ray: &Ray, hit: &Hit, detail: Detail) -> Self {
        let mut surfel =
            Self::front_of(scene, hit.object, hit.triangle, [hit.u, hit.v], detail, || -ray.direction.normalize());
        surfel.front = surfel.geometric.dot(ray.direction) <= 0.0;
        if !surfel.front {
            surfel.geometric = -surfel.geometric;
        }
        let interpolated = surfel.smooth;
        if surfel.smooth.dot(ray.direction) > 0.0 {
            surfel.smooth = -surfel.smooth;
        }
        if surfel.shading == interpolated {
            surfel.shading = surfel.smooth;
        } else {
            surfel.face(Some(-ray.direction.normalize()));
        }
        if detail.chances {
            surfel.chance = chance(ray, hit);
        }
        surfel
    }

    /// Puts the normal of a relief on the viewer's side.
    fn face(&mut self, to: Option<Vec3>) {
        let normal = if self.front { self.shading } else { -self.shading };
        self.shading = relief::seen(normal, self.geometric, to);
    }

    /// The surfel at a point which `object`, the one named or a piece of it, has now: at the first hit of a ray, when that
    /// is told as a point ([`Self::named`]), the same to the bit (but for facets of a normal map that face away from the ray).
    pub fn on(scene: &Scene, object: u32, point: &SurfacePoint, detail: Detail) -> Self {
        let mut surfel = Self::front_of(scene, object, point.triangle, point.uv, detail, || Vec3::Z);
        if point.back {
            (surfel.front, surfel.geometric) = (false, -surfel.geometric);
        }
        let interpolated = surfel.smooth;
        if (surfel.smooth.dot(surfel.geometric) < 0.0) != point.turned {
            surfel.smooth = -surfel.smooth;
        }
        if surfel.shading == interpolated {
            surfel.shading = surfel.smooth;
        } else {
            surfel.face(None);
        }
        surfel
    }

    /// What the surfel at a hit is called.
    pub fn named(&self, scene: &Scene, hit: &Hit) -> SurfacePoint {
        SurfacePoint {
            object: scene.whole_of(hit.object),
            triangle: hit.triangle,
            uv: [hit.u, hit.v],
            back: !self.front,
            turned: self.smooth.dot(self.geometric) < 0.0,
        }
    }

    /// The surfel at a place of a triangle, both normals as they are modelled; `any` is the normal of a triangle that has
    /// none.
    #[inline(always)]
    fn front_of(
        scene: &Scene,
        object: u32,
        triangle: u32,
        [u, v]: [f32; 2],
        detail: Detail,
        any: impl FnOnce() -> Vec3,
    ) -> Self {
        let material = scene.material_of(object as usize, triangle as usize);
        let object = &scene.objects[object as usize];
        let mesh = &scene.meshes[object.mesh as usize];
        let [i, j, k] = mesh.triangles[triangle as usize];
        let corners = [i as usize, j as usize, k as usize];
        let weights = [1.0 - u - v, u, v];
        let fixed = !detail.places || object.scene_from_object.is_identity();
        let [mut a, mut b, mut c] =
            [mesh.positions[corners[0]], mesh.positions[corners[1]], mesh.positions[corners[2]]];
        if !fixed {
            [a, b, c] = [a, b, c].map(|p| object.scene_from_object.point(p));
        }
        let (ab, ac) = (b - a, c - a);
        let mut geometric = ab.cross(ac).normalize_or_zero();
        if geometric == Vec3::ZERO {
            // The cross product of a needle can underflow; in units of its own size it cannot.
            let size = ab.abs().max_element().max(ac.abs().max_element());
            geometric = (ab / size).cross(ac / size).try_normalize().unwrap_or_else(any);
        }
        let mirrored = !fixed && object.scene_from_object.linear.determinant() < 0.0;
        if mirrored {
            geometric = -geometric;
        }
        let mut shading = geometric;
        if !mesh.normals.is_empty() {
            let mut n = Vec3::ZERO;
            for (corner, weight) in corners.iter().zip(weights) {
                n += mesh.normals[*corner] * weight;
            }
            if !fixed {
                n = normal_matrix(&object.scene_from_object.linear) * n;
            }
            let n = n.normalize_or_zero();
            // A vertex without normal makes the whole triangle flat.
            let complete = corners.iter().all(|i| mesh.normals[*i] != Vec3::ZERO);
            if complete && n != Vec3::ZERO {
                shading = n;
            }
        }
        let uv = if !detail.uvs || mesh.uvs.is_empty() {
            Vec2::ZERO
        } else {
            mesh.uvs[corners[0]] * weights[0] + mesh.uvs[corners[1]] * weights[1] + mesh.uvs[corners[2]] * weights[2]
        };
        let smooth = shading;
        let place = Place { mesh, triangle: triangle as usize, weights };
        if detail.relief
            && let Some(map) = &scene.materials[material as usize].relief
        {
            let linear = &object.scene_from_object.linear;
            shading = relief::normal(scene, map, &place, smooth, linear, [ab, ac], mirrored).unwrap_or(smooth);
        }
        let tint = if detail.colours { place.vertex_colour() } else { None };
        let reach = a.abs().max(b.abs()).max(c.abs()).max_element();
        Self {
            position: a * weights[0] + b * weights[1] + c * weights[2],
            epsilon: reach * RELATIVE_EPSILON,
            geometric,
            shading,
            smooth,
            front: true,
            uv,
            tint: tint.map_or(Vec3::ONE, Vec4::truncate),
            mesh: object.mesh,
            triangle,
            weights: [u, v],
            material,
            around: Around::default(),
            chance: OPAQUE,
        }
    }

    /// The same as seen from its other side.
    pub fn turned(&self) -> Self {
        let [geometric, shading, smooth] = [-self.geometric, -self.shading, -self.smooth];
        Self { geometric, shading, smooth, front: !self.front, ..*self }
    }

    /// Where on its mesh it is.
    fn place<'s>(&self, scene: &'s Scene) -> Place<'s> {
        let [u, v] = self.weights;
        let mesh = &scene.meshes[self.mesh as usize];
        Place { mesh, triangle: self.triangle as usize, weights: [1.0 - u - v, u, v] }
    }

    /// Texture coordinates of a set.
    fn uv_of(&self, scene: &Scene, set: u8) -> Vec2 {
        if set == 0 { self.uv } else { self.place(scene).uv(set) }
    }

    fn colour(&self, scene: &Scene, colour: &Colour) -> Rgb {
        colour.texture.map_or(colour.value, |index| {
            let texture = &scene.textures[index as usize];
            colour.value * texture::colour(texture, self.uv_of(scene, texture.look_up.set))
        })
    }

    fn scalar(&self, scene: &Scene, scalar: &Scalar) -> f32 {
        scalar.texture.map_or(scalar.value, |(index, channel)| {
            let texture = &scene.textures[index as usize];
            scalar.value * texture::channel(texture, self.uv_of(scene, texture.look_up.set), channel)
        })
    }

    /// What the facets of a non-metal reflect here.
    fn fresnel(&self, scene: &Scene, f0: f32, specular: &Specular) -> Fresnel {
        let amount = self.scalar(scene, &specular.amount).clamp(0.0, 1.0);
        Fresnel::of_index(f0).times(amount, self.colour(scene, &specular.colour))
    }

    /// A point just off the surface, on the side where `direction` points: rays in that direction
    /// start here and do not meet the surface itself.
    pub fn off(&self, direction: Vec3) -> Vec3 {
        let side = if self.geometric.dot(direction) < 0.0 { -self.epsilon } else { self.epsilon };
        self.position + self.geometric * side
    }

    /// A point just off the surface on the viewer's side.
    pub fn above(&self) -> Vec3 {
        self.position + self.geometric * self.epsilon
    }

    /// Emitted radiance towards the viewer.
    pub fn emission(&self, scene: &Scene) -> Rgb {
        let material = &scene.materials[self.material as usize];
        if material.emission.is_black() || !(self.front || material.emits_both_sides) {
            return Vec3::ZERO;
        }
        self.colour(scene, &material.emission)
    }

    /// How much of the surface is there, 0..1.
    pub fn coverage(&self, scene: &Scene) -> f32 {
        let coverage = &scene.materials[self.material as usize].coverage;
        coverage.map_or(1.0, |coverage| self.place(scene).present(scene, &coverage))
    }

    /// How the surface scatters here.
    pub fn scatter(&self, scene: &Scene) -> Scatter {
        match &scene.materials[self.material as usize].surface {
            Surface::Diffuse { albedo } => Scatter::Diffuse { albedo: self.colour(scene, albedo) * self.tint },
            Surface::Mirror { reflectance } => Scatter::Mirror { reflectance: *reflectance * self.tint },
            Surface::Dielectric(glass) => self.glass(scene, glass),
            Surface::Glazed { amount, glass, base, metalness, f0, specular } => {
                let (share, metal) = self.glazed(scene, amount, metalness);
                if self.chance < share {
                    return self.glass(scene, glass);
                }
                let roughness = self.scalar(scene, &glass.roughness);
                let metal = metal / (1.0 - share).max(f32::MIN_POSITIVE);
                let fresnel = self.fresnel(scene, *f0, specular);
                let glossy = Glossy::new(self.colour(scene, base) * self.tint, roughness, metal, fresnel);
                Scatter::Glossy(if scene.multiple_scattering { glossy.multiply_scattering() } else { glossy })
            }
            Surface::Glossy(Gloss { base, roughness, metalness, f0, specular, sheen, coat }) => {
                let [roughness, metalness] = [roughness, metalness].map(|scalar| self.scalar(scene, scalar));
                let fresnel = self.fresnel(scene, *f0, specular);
                let glossy = Glossy::new(self.colour(scene, base) * self.tint, roughness, metalness, fresnel);
                let glossy = if scene.multiple_scattering { glossy.multiply_scattering() } else { glossy };
                let glossy = match sheen {
                    None => glossy,
                    Some(Sheen { colour, roughness }) => {
                        glossy.with_sheen(self.colour(scene, colour), self.scalar(scene, roughness))
                    }
                };
                Scatter::Glossy(match coat {
                    None => glossy,
                    Some(Coat { amount, roughness }) => {
                        glossy.coated(self.scalar(scene, amount), self.scalar(scene, roughness))
                    }
                })
            }
            Surface::Translucent { albedo, transmittance } => Scatter::Translucent {
                albedo: self.colour(scene, albedo) * self.tint,
                transmittance: self.colour(scene, transmittance) * self.tint,
            },
        }
    }

    /// How a line that goes straight on finds the surface, whatever chance has made of it: what is clear glass in part
    /// lets it pass, by that part.
    pub fn straight(&self, scene: &Scene) -> (Scatter, f32) {
        if let Surface::Glazed { amount, glass, metalness, .. } = &scene.materials[self.material as usize].surface {
            let (share, _) = self.glazed(scene, amount, metalness);
            let glass = self.glass(scene, glass);
            if share > 0.0 && matches!(glass, Scatter::Glass { .. }) {
                return (glass, share);
            }
        }
        (self.scatter(scene), 1.0)
    }

    /// What absorbs light on a way that leaves the surface, or comes to it from there, in some direction: σ, if that is
    /// inside of solid glass.
    pub fn medium(&self, scene: &Scene, towards: Vec3) -> Option<Rgb> {
        let glass = scene.materials[self.material as usize].surface.glass()?;
        let is_inside = (self.geometric.dot(towards) < 0.0) == self.front;
        if self.around.outranks || !is_inside {
            return (self.around.absorption != Vec3::ZERO).then_some(self.around.absorption);
        }
        glass.absorbs().then_some(glass.absorption)
    }

    /// How much of it is glass, and how much metal.
    fn glazed(&self, scene: &Scene, amount: &Scalar, metalness: &Scalar) -> (f32, f32) {
        let metal = self.scalar(scene, metalness).clamp(0.0, 1.0);
        (self.scalar(scene, amount).clamp(0.0, 1.0) * (1.0 - metal), metal)
    }

    fn glass(&self, scene: &Scene, glass: &Dielectric) -> Scatter {
        let Dielectric { ior, transmittance, roughness, thin, .. } = glass;
        let (ior, thin) = (*ior / self.around.ior, *thin);
        if self.around.outranks {
            return Scatter::Glass { ior: 1.0, transmittance: Vec3::ONE, thin: false };
        }
        let transmittance = self.colour(scene, transmittance) * self.tint;
        let roughness = self.scalar(scene, roughness);
        // Facets between two sides that are alike bend no light.
        let is_clear = roughness <= CLEAR_ROUGHNESS || !thin && (ior - 1.0).abs() < 1e-3;
        match is_clear {
            true => Scatter::Glass { ior, transmittance, thin },
            false => Scatter::Frosted(Frosted { ior, transmittance, facets: Facets::new(roughness), thin }),
        }
    }
}

impl Scatter {
    /// ρ of the part that scatters into all directions alike.
    pub fn albedo(&self) -> Rgb {
        match self {
            Self::Diffuse { albedo } => *albedo,
            Self::Mirror { .. } | Self::Glass { .. } | Self::Frosted(_) => Vec3::ZERO,
            Self::Glossy(glossy) => glossy.diffuse_albedo(),
            Self::Translucent { albedo, transmittance } => *albedo + *transmittance,
        }
    }

    /// One side of a translucent sheet, chosen by `u` in proportion to what it sends to the viewer; any other surface is
    /// what it is.
    pub fn side(self, at: Surfel, u: f32) -> (Surfel, Self) {
        let Self::Translucent { albedo, transmittance } = self else { return (at, self) };
        let (stays, leaves) = (albedo.max_element(), transmittance.max_element());
        let p = if leaves > 0.0 { leaves / (stays + leaves) } else { 0.0 };
        match u < p {
            true => (at.turned(), Self::Diffuse { albedo: transmittance / p }),
            false => (at, Self::Diffuse { albedo: albedo / (1.0 - p).max(f32::MIN_POSITIVE) }),
        }
    }

    /// All specular ways on, with their weights: none for diffuse surfaces, the second one only for glass. `u` chooses a
    /// facet of frosted glass.
    pub fn branches(&self, at: &Surfel, incoming: Vec3, carries: Carries, u: [f32; 2]) -> [Option<Bounce>; 2] {
        match *self {
            Self::Diffuse { .. } | Self::Glossy(_) | Self::Translucent { .. } => [None, None],
            Self::Frosted(frosted) => frosted.branches(at, incoming, carries, u),
            Self::Mirror { reflectance } => [Some(reflected(at, incoming, reflectance)), None],
            Self::Glass { ior, transmittance, thin } => glass(at, incoming, ior, transmittance, thin, carries),
        }
    }

    /// One of the [`Self::branches`], chosen by `choice` in proportion to what it carries.
    pub fn branch(&self, at: &Surfel, incoming: Vec3, carries: Carries, choice: f32, u: [f32; 2]) -> Option<Bounce> {
        if let Self::Frosted(frosted) = self {
            return frosted.sample(at, incoming, carries, choice, u);
        }
        match self.branches(at, incoming, carries, u) {
            [Some(first), Some(second)] => {
                // Fresnel reflectance is untinted, so it is the probability itself.
                let p = first.weight.max_element();
                let (chosen, p) = if choice < p { (first, p) } else { (second, 1.0 - p) };
                (p > 0.0).then(|| Bounce { weight: chosen.weight / p, ..chosen })
            }
            [only, _] => only,
        }
    }
}

/// A place that no ray has met is the opaque part of a surface, if it has one.
const OPAQUE: f32 = 1.0 - f32::EPSILON / 2.0;

/// By which a surface that is glass in part is that, or opaque. It belongs to the ray, as coverage does
/// ([`sample::chance`]).
fn chance(ray: &Ray, hit: &Hit) -> f32 {
    sample::chance(0x6a09_e667, [hit.object, hit.triangle], [ray.origin, ray.direction], [hit.u, hit.v])
}

/// Fresnel reflectance of a smooth dielectric for unpolarised light, and the cosine of the refracted
/// angle. `cos` is the cosine of incidence (≥ 0), `eta` the index behind over the index before.
/// Total internal reflection gives (1, 0).
pub fn fresnel(cos: f32, eta: f32) -> (f32, f32) {
    let sin2_t = (1.0 - cos * cos).max(0.0) / (eta * eta);
    if sin2_t >= 1.0 {
        return (1.0, 0.0);
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    let parallel = (eta * cos - cos_t) / (eta * cos + cos_t);
    let perpendicular = (cos - eta * cos_t) / (cos + eta * cos_t);
    ((parallel * parallel + perpendicular * perpendicular) * 0.5, cos_t)
}

fn reflected(at: &Surfel, incoming: Vec3, weight: Rgb) -> Bounce {
    let direction = (incoming - at.shading * (2.0 * at.shading.dot(incoming))).normalize();
    Bounce { origin: at.off(direction), direction, weight, reflected: true }
}

fn glass(at: &Surfel, incoming: Vec3, ior: f32, tint: Rgb, thin: bool, carries: Carries) -> [Option<Bounce>; 2] {
    let cos = (-at.shading.dot(incoming)).clamp(0.0, 1.0);
    let passing = |direction: Vec3, weight| Bounce { origin: at.off(direction), direction, weight, reflected: false };
    if thin {
        // All orders of reflection between the two faces: R = 2R₀/(1+R₀).
        let (single, _) = fresnel(cos, ior);
        let r = 2.0 * single / (1.0 + single);
        return [Some(reflected(at, incoming, Vec3::splat(r))), Some(passing(incoming, tint * (1.0 - r)))];
    }
    let eta = if at.front { ior } else { 1.0 / ior };
    let (r, cos_t) = fresnel(cos, eta);
    let mirror = (r > 0.0).then(|| reflected(at, incoming, Vec3::splat(r)));
    let through = (r < 1.0).then(|| {
        let direction = (incoming / eta + at.shading * (cos / eta - cos_t)).normalize();
        // Radiance is squeezed by (n_before/n_behind)² on its way to the eye, flux is not.
        let squeeze = if carries == Carries::Radiance { 1.0 / (eta * eta) } else { 1.0 };
        passing(direction, tint * ((1.0 - r) * squeeze))
    });
    match mirror {
        Some(_) => [mirror, through],
        None => [through, None],
    }
}

/// Transforms normals: the inverse transpose up to a positive factor; exact for reflections too.
fn normal_matrix(linear: &Mat3) -> Mat3 {
    let (x, y, z) = (linear.x_axis, linear.y_axis, linear.z_axis);
    let cofactors = Mat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
    if linear.determinant() < 0.0 { -cofactors } else { cofactors }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fresnel_matches_closed_forms() {
        let (r, _) = fresnel(1.0, 1.5);
        assert!((r - 0.04).abs() < 1e-7, "normal incidence: ((n−1)/(n+1))²");
        assert_eq!(fresnel(0.5, 1.0), (0.0, 0.5), "no boundary, no reflection");
        // Brewster's angle: no parallel reflection, r_s² / 2 remains.
        let cos = 1.0 / (1.0_f32 + 1.5 * 1.5).sqrt();
        let (r, _) = fresnel(cos, 1.5);
        let s = (1.0 - 1.5_f32 * 1.5) / (1.0 + 1.5 * 1.5);
        assert!((r - s * s / 2.0).abs() < 1e-6);
    }

    #[test]
    fn total_internal_reflection_begins_at_the_critical_angle() {
        let critical = (1.0_f32 / 1.5).asin();
        let beyond = (critical + 1e-3).cos();
        let before = (critical - 1e-3).cos();
        assert_eq!(fresnel(beyond, 1.0 / 1.5), (1.0, 0.0));
        assert!(fresnel(before, 1.0 / 1.5).0 < 1.0);
        assert_eq!(fresnel(0.0, 1.5).0, 1.0, "grazing light is all reflected");
    }

    fn facing() -> Surfel {
        Surfel {
            position: Vec3::ZERO,
            epsilon: 1e-6,
            geometric: Vec3::Z,
            shading: Vec3::Z,
            smooth: Vec3::Z,
            front: true,
            uv: Vec2::ZERO,
            tint: Vec3::ONE,
            mesh: 0,
            triangle: 0,
            weights: [0.0; 2],
            material: 0,
            around: Around::default(),
            chance: OPAQUE,
        }
    }

    #[test]
    fn thin_glass_reflects_and_passes_all_orders() {
        let pane = Scatter::Glass { ior: 1.5, transmittance: Vec3::ONE, thin: true };
        let [Some(mirror), Some(through)] = pane.branches(&facing(), -Vec3::Z, Carries::Radiance, [0.0; 2]) else {
            panic!()
        };
        assert!((mirror.weight.x - 0.076_923).abs() < 1e-5);
        assert!((through.weight.x - 0.923_077).abs() < 1e-5);
        assert_eq!(through.direction, -Vec3::Z);
    }

    #[test]
    fn glass_conserves_flux_and_obeys_snell() {
        let glass = Scatter::Glass { ior: 1.5, transmittance: Vec3::ONE, thin: false };
        let incoming = Vec3::new(0.6, 0.0, -0.8);
        let [Some(mirror), Some(through)] = glass.branches(&facing(), incoming, Carries::Flux, [0.0; 2]) else {
            panic!()
        };
        assert!((mirror.weight.x + through.weight.x - 1.0).abs() < 1e-6);
        assert!((through.direction.x - 0.6 / 1.5).abs() < 1e-6);
        assert!(through.origin.z < 0.0 && mirror.origin.z > 0.0);
    }

    #[test]
    fn index_one_is_no_boundary_at_all() {
        let air = Scatter::Glass { ior: 1.0, transmittance: Vec3::ONE, thin: false };
        let incoming = Vec3::new(0.6, 0.0, -0.8);
        let [Some(only), None] = air.branches(&facing(), incoming, Carries::Radiance, [0.0; 2]) else { panic!() };
        assert!((only.direction - incoming).length() < 1e-6);
        assert_eq!(only.weight, Vec3::ONE);
    }
}
