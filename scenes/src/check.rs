//! Proof that a scene is sound: what [`crate::Scene`] promises, looked at number by number.
//!
//! Readers make sound scenes of any file. Scenes from elsewhere (a peer's bytes, a program's own
//! building) are checked before anything is computed with them.

use std::sync::Arc;

use glam::{Vec2, Vec3, Vec4};

use crate::light::{DISC_DEG_MAX, DISC_DEG_MIN};
use crate::{
    Camera, Colour, Dielectric, Environment, Gloss, Lifted, Light, Material, Mesh, Motion, Object, Pixels, Rgb,
    SETS_MAX, Scalar, Scene, Surface, Texture, Transform,
};

/// What is wrong with a scene, and where.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the scene is not sound: {place}: {what}")]
pub struct Unsound {
    /// Such as `meshes[3].triangles[17]`.
    pub place: String,
    /// What is wrong there.
    pub what: String,
}

/// Two corners in one place, or no area: the height is below 2⁻⁴⁰ of the longest side, where
/// `f32` corners can no longer mean it. Needles of a million to one are triangles.
///
/// Scaling all corners by the same power of two changes nothing.
pub(crate) fn is_degenerate(a: Vec3, b: Vec3, c: Vec3) -> bool {
    let [a, b, c] = [a, b, c].map(|p| p.as_dvec3());
    let (ab, ac, bc) = (b - a, c - a, c - b);
    let longest = ab.length_squared().max(ac.length_squared()).max(bc.length_squared());
    let double_area = ab.cross(ac).length();
    double_area <= longest * (0.5_f64).powi(40)
}

pub(crate) type Check = Result<(), Unsound>;

fn demand(ok: bool, place: impl FnOnce() -> String, what: &str) -> Check {
    if ok { Ok(()) } else { Err(Unsound { place: place(), what: what.into() }) }
}

impl Scene {
    /// Proves that the scene is sound.
    ///
    /// # Errors
    /// [`Unsound`] names the first thing that is not.
    pub fn check(&self) -> Check {
        demand(self.centre.is_finite(), || "centre".into(), "is not finite")?;
        self.camera.check().map_err(|what| Unsound { place: "camera".into(), what })?;
        let shared = self.shared_materials();
        for (i, mesh) in self.meshes.iter().enumerate() {
            mesh.check(&format!("meshes[{i}]"), shared)?;
        }
        for (i, object) in self.objects.iter().enumerate() {
            object.check(&format!("objects[{i}]"), self.meshes.len(), self.time)?;
        }
        self.check_own()?;
        self.check_lifted()?;
        for (i, material) in self.materials.iter().enumerate() {
            material.check(&format!("materials[{i}]"), self.textures.len())?;
        }
        for (i, texture) in self.textures.iter().enumerate() {
            texture.check(&format!("textures[{i}]"))?;
        }
        for (i, light) in self.lights.iter().enumerate() {
            light.check(&format!("lights[{i}]"), &self.textures)?;
        }
        self.environment.check(&self.textures)
    }

    /// Materials that objects have of their own are instead of different ones of the file, and numbered in order.
    fn check_own(&self) -> Check {
        let shared = self.shared_materials();
        demand(shared <= self.materials.len(), || "materials".into(), "lacks one that an object has of its own")?;
        let mut next = shared as u32;
        for (i, object) in self.objects.iter().enumerate() {
            let place = || format!("objects[{i}].own");
            demand(object.own.is_sorted_by(|a, b| a.instead_of < b.instead_of), place, "is not in order")?;
            for own in &object.own {
                demand((own.instead_of as usize) < shared, place, "is instead of no material of the file")?;
                demand(own.material == next, place, "is not numbered in order")?;
                next += 1;
            }
        }
        demand(next as usize == self.materials.len(), || "materials".into(), "has one that is of nothing")
    }

    /// Lifted pieces are in their order, exist, and are not at rest. (Objects and meshes are sound.)
    fn check_lifted(&self) -> Check {
        let wholes = self.objects.iter().position(|object| object.lifted.is_some()).unwrap_or(self.objects.len());
        let mut last = None;
        for (i, object) in self.objects.iter().enumerate().skip(wholes) {
            let place = || format!("objects[{i}].lifted");
            let Some(Lifted { of, piece, whole_from_piece, visible }) = &object.lifted else {
                return demand(false, place, "is followed by an object that the file keeps apart");
            };
            demand(last < Some((*of, *piece)), place, "is not in order")?;
            last = Some((*of, *piece));
            let whole = self.objects[..wholes].get(*of as usize).filter(|whole| whole.mesh == object.mesh);
            let count = whole.map_or(0, |whole| self.meshes[whole.mesh as usize].pieces().count());
            demand((*piece as usize) < count, place, "is no piece of any object")?;
            demand(object.motion.is_none(), place, "moves by itself")?;
            let is_at_rest = *visible && whole_from_piece.is_identity() && object.own.is_empty();
            demand(!is_at_rest, place, "is as it was modelled")?;
        }
        Ok(())
    }
}

impl Camera {
    /// A picture can be taken: numbers are finite, the view has a direction and an up, and the
    /// picture has pixels. The message says which field is wrong.
    ///
    /// # Errors
    /// The reason in words.
    pub fn check(&self) -> Result<(), String> {
        let demand = |ok: bool, what: &str| if ok { Ok(()) } else { Err(what.to_owned()) };
        let finite = self.origin.is_finite() && self.target.is_finite() && self.up.is_finite();
        demand(finite, "origin, target and up must be finite numbers")?;
        let (forward, up) = ((self.target - self.origin).as_dvec3(), self.up.as_dvec3());
        demand(forward.length_squared() > 0.0, "target must not be where origin is")?;
        let sideways = forward.normalize().cross(up.normalize_or_zero());
        demand(sideways.length_squared() > 1e-8, "up must not be zero or parallel to the view")?;
        demand(self.fov_y_deg > 0.0 && self.fov_y_deg < 180.0, "fov_y_deg must lie between 0 and 180")?;
        demand(self.width > 0 && self.height > 0, "width and height must be at least 1")
    }
}

impl Mesh {
    fn check(&self, place: &str, materials: usize) -> Check {
        let at = |field: &str, i: usize| format!("{place}.{field}[{i}]");
        let vertices = self.positions.len();
        demand(vertices <= u32::MAX as usize, || place.into(), "has more vertices than can be numbered")?;
        let a_vertex_or_none = |n: usize| n == 0 || n == vertices;
        demand(a_vertex_or_none(self.normals.len()), || place.into(), "needs no normals, or one a vertex")?;
        demand(a_vertex_or_none(self.uvs.len()), || place.into(), "needs no texture coordinates, or one a vertex")?;
        demand(self.materials.len() == self.triangles.len(), || place.into(), "needs one material a triangle")?;
        demand(self.more_uvs.len() < SETS_MAX, || place.into(), "has too many sets of texture coordinates")?;
        let whole = self.more_uvs.iter().all(|uvs| uvs.len() == vertices);
        demand(whole, || place.into(), "needs one of each set of texture coordinates a vertex")?;
        demand(a_vertex_or_none(self.tangents.len()), || place.into(), "needs no tangents, or one a vertex")?;
        demand(a_vertex_or_none(self.colours.len()), || place.into(), "needs no colours, or one a vertex")?;
        all(&self.positions, |p| p.is_finite(), |i| at("positions", i), "is not finite")?;
        all(&self.normals, |n| is_normal(*n), |i| at("normals", i), "is neither of unit length nor zero")?;
        all(&self.uvs, |uv: &Vec2| uv.is_finite(), |i| at("uvs", i), "is not finite")?;
        for uvs in &self.more_uvs {
            all(uvs, |uv: &Vec2| uv.is_finite(), |i| at("more_uvs", i), "is not finite")?;
        }
        all(&self.tangents, is_tangent, |i| at("tangents", i), "is neither of unit length with a side, nor zero")?;
        let in_range = |t: &[u32; 3]| t.iter().all(|&v| (v as usize) < vertices);
        all(&self.triangles, in_range, |i| at("triangles", i), "names a vertex that does not exist")?;
        let corner = |v: u32| self.positions[v as usize];
        let has_area = |t: &[u32; 3]| !is_degenerate(corner(t[0]), corner(t[1]), corner(t[2]));
        all(&self.triangles, has_area, |i| at("triangles", i), "has no area")?;
        all(&self.materials, |&m| (m as usize) < materials, |i| at("materials", i), "does not exist")
    }
}

impl Object {
    fn check(&self, place: &str, meshes: usize, time: f64) -> Check {
        demand((self.mesh as usize) < meshes, || place.into(), "its mesh does not exist")?;
        match &self.lifted {
            // Where a piece is in the scene follows from where its whole is.
            Some(lifted) => lifted.whole_from_piece.check(&format!("{place}.lifted.whole_from_piece"))?,
            None => self.scene_from_object.check(&format!("{place}.scene_from_object"))?,
        }
        let Some(motion) = &self.motion else { return Ok(()) };
        let known = motion.poses.iter().all(|pose| pose.mesh.is_none_or(|mesh| (mesh as usize) < meshes));
        demand(known, || format!("{place}.motion.poses"), "names a mesh that does not exist")?;
        motion.check(place, time)
    }
}

impl Transform {
    pub(crate) fn check(&self, place: &str) -> Check {
        demand(self.linear.is_finite() && self.translation.is_finite(), || place.into(), "is not finite")?;
        demand(self.is_invertible(), || place.into(), "cannot be inverted")
    }

    /// The map squeezes nothing flat: its determinant, beside the lengths of its columns, is above
    /// what `f32` can mean.
    pub fn is_invertible(&self) -> bool {
        let linear = self.linear.as_dmat3();
        let lengths = linear.x_axis.length() * linear.y_axis.length() * linear.z_axis.length();
        let inverse = self.linear.inverse();
        linear.determinant().abs() > lengths * 1e-7 && inverse.is_finite()
    }
}

impl Motion {
    fn check(&self, place: &str, time: f64) -> Check {
        let at = |field: &str| format!("{place}.motion.{field}");
        demand(!(self.keys.is_empty() && self.poses.is_empty()), || at("keys"), "is empty")?;
        demand(self.pivot.is_finite(), || at("pivot"), "is not finite")?;
        demand((self.axis.length() - 1.0).abs() < 1e-3, || at("axis"), "is not of unit length")?;
        let finite = self.keys.iter().all(|k| k.time.is_finite() && k.translate.is_finite() && k.angle_deg.is_finite());
        demand(finite, || at("keys"), "holds a number that is not finite")?;
        demand(self.keys.is_sorted_by(|a, b| a.time <= b.time), || at("keys"), "is not sorted by time")?;
        demand(self.poses.is_sorted_by(|a, b| a.time <= b.time), || at("poses"), "is not sorted by time")?;
        for pose in &self.poses {
            demand(pose.time.is_finite(), || at("poses"), "holds a number that is not finite")?;
            pose.place.check(&at("poses"))?;
        }
        self.offset.own.check(&at("offset.own"))?;
        self.at(time).check(&format!("{place}.motion"))
    }
}

impl Material {
    pub(crate) fn check(&self, place: &str, textures: usize) -> Check {
        let at = |field: &str| format!("{place}.{field}");
        match &self.surface {
            Surface::Diffuse { albedo } => albedo.check(&at("albedo"), textures, 1.0)?,
            Surface::Mirror { reflectance } => demand(within(*reflectance, 1.0), || at("reflectance"), BEYOND_ONE)?,
            Surface::Dielectric(glass) => glass.check(place, textures)?,
            Surface::Glazed { amount, glass, base, metalness, f0, specular } => {
                amount.check(&at("amount"), textures)?;
                glass.check(&at("glass"), textures)?;
                base.check(&at("base"), textures, 1.0)?;
                metalness.check(&at("metalness"), textures)?;
                demand((0.0..=1.0).contains(f0), || at("f0"), BEYOND_ONE)?;
                specular.amount.check(&at("specular.amount"), textures)?;
                specular.colour.check(&at("specular.colour"), textures, f32::MAX)?;
            }
            Surface::Translucent { albedo, transmittance } => {
                albedo.check(&at("albedo"), textures, 1.0)?;
                transmittance.check(&at("transmittance"), textures, 1.0)?;
            }
            Surface::Glossy(Gloss { base, roughness, metalness, f0, specular, sheen, coat }) => {
                base.check(&at("base"), textures, 1.0)?;
                roughness.check(&at("roughness"), textures)?;
                metalness.check(&at("metalness"), textures)?;
                demand((0.0..=1.0).contains(f0), || at("f0"), BEYOND_ONE)?;
                specular.amount.check(&at("specular.amount"), textures)?;
                specular.colour.check(&at("specular.colour"), textures, f32::MAX)?;
                if let Some(sheen) = sheen {
                    sheen.colour.check(&at("sheen.colour"), textures, 1.0)?;
                    sheen.roughness.check(&at("sheen.roughness"), textures)?;
                }
                if let Some(coat) = coat {
                    coat.amount.check(&at("coat.amount"), textures)?;
                    coat.roughness.check(&at("coat.roughness"), textures)?;
                }
            }
        }
        self.emission.check(&at("emission"), textures, f32::MAX)?;
        if let Some(relief) = &self.relief {
            demand((relief.texture as usize) < textures, || at("relief"), NO_TEXTURE)?;
            demand(relief.scale.is_finite(), || at("relief.scale"), "is not finite")?;
        }
        let Some(coverage) = &self.coverage else { return Ok(()) };
        coverage.amount.check(&at("coverage"), textures)?;
        demand(coverage.cutoff.is_none_or(f32::is_finite), || at("coverage.cutoff"), "is not finite")
    }
}

impl Dielectric {
    fn check(&self, place: &str, textures: usize) -> Check {
        let at = |field: &str| format!("{place}.{field}");
        demand(self.ior.is_finite() && self.ior > 0.0, || at("ior"), "is not a positive number")?;
        self.transmittance.check(&at("transmittance"), textures, 1.0)?;
        self.roughness.check(&at("roughness"), textures)?;
        demand(within(self.absorption, f32::MAX), || at("absorption"), "is negative or not finite")
    }
}

impl Colour {
    fn check(&self, place: &str, textures: usize, most: f32) -> Check {
        let what = if most == 1.0 { BEYOND_ONE } else { "is negative or not finite" };
        demand(within(self.value, most), || place.into(), what)?;
        demand(self.texture.is_none_or(|t| (t as usize) < textures), || place.into(), NO_TEXTURE)
    }
}

impl Scalar {
    fn check(&self, place: &str, textures: usize) -> Check {
        demand((0.0..=1.0).contains(&self.value), || place.into(), BEYOND_ONE)?;
        let exists = self.texture.is_none_or(|(t, channel)| (t as usize) < textures && channel < 4);
        demand(exists, || place.into(), NO_TEXTURE)
    }
}

impl Texture {
    fn check(&self, place: &str) -> Check {
        demand(self.width > 0 && self.height > 0, || place.into(), "has no texels")?;
        demand(usize::from(self.look_up.set) < SETS_MAX, || place.into(), "names a set of coordinates that cannot be")?;
        let texels = self.width as usize * self.height as usize;
        let stored = match &self.pixels {
            Pixels::Srgb8(texels) | Pixels::Linear8(texels) => texels.len(),
            Pixels::Float(texels) => texels.len(),
        };
        demand(stored == texels, || place.into(), "width times height is not the number of texels")?;
        match &self.pixels {
            Pixels::Float(texels) => {
                let radiance = |t: &[f32; 3]| t.iter().all(|c| c.is_finite() && *c >= 0.0);
                all(texels, radiance, |i| format!("{place}.pixels[{i}]"), "is negative or not finite")
            }
            _ => Ok(()),
        }
    }
}

impl Light {
    pub(crate) fn check(&self, place: &str, textures: &[Arc<Texture>]) -> Check {
        let at = |field: &str| format!("{place}.{field}");
        let unit = |v: Vec3| (v.length() - 1.0).abs() < 1e-3;
        let (position, direction, power) = match *self {
            Self::Point { position, intensity } => (position, None, intensity),
            Self::Spot { position, direction, intensity, .. } => (position, Some(direction), intensity),
            Self::Luminaire { position, direction, intensity, .. } => (position, Some(direction), intensity),
            Self::Directional { direction, irradiance, .. } => (Vec3::ZERO, Some(direction), irradiance),
        };
        demand(position.is_finite(), || at("position"), "is not finite")?;
        demand(direction.is_none_or(unit), || at("direction"), "is not of unit length")?;
        demand(within(power, f32::MAX), || place.into(), "its power is negative or not finite")?;
        match *self {
            Self::Spot { cos_inner, cos_outer, .. } => {
                let ok = -1.0 <= cos_outer && cos_outer < cos_inner && cos_inner <= 1.0;
                demand(ok, || place.into(), "needs -1 ≤ cos_outer < cos_inner ≤ 1")
            }
            Self::Directional { diameter_deg, .. } => {
                let ok = diameter_deg == 0.0 || (DISC_DEG_MIN..=DISC_DEG_MAX).contains(&diameter_deg);
                demand(ok, || at("diameter_deg"), "is neither 0 nor within 0.01..180")
            }
            Self::Luminaire { side, solid, .. } => {
                demand(unit(side), || at("side"), "is not of unit length")?;
                let is_web = |web: &Arc<Texture>| matches!(web.pixels, Pixels::Float(_)) && web.height >= 2;
                demand(
                    textures.get(solid as usize).is_some_and(is_web),
                    || at("solid"),
                    "needs an existing photometric web",
                )
            }
            Self::Point { .. } => Ok(()),
        }
    }
}

impl Environment {
    pub(crate) fn check(&self, textures: &[Arc<Texture>]) -> Check {
        let place = || "environment".to_owned();
        let (radiance, texture) = match *self {
            Self::Black => return Ok(()),
            Self::Constant(radiance) => (radiance, None),
            Self::Image { texture, scale, turn } => {
                demand(turn.abs() <= 1.0, place, "is turned by more than a whole turn")?;
                (scale, Some(texture))
            }
        };
        demand(within(radiance, f32::MAX), place, "is negative or not finite")?;
        let is_float = |t: u32| textures.get(t as usize).is_some_and(|t| matches!(t.pixels, Pixels::Float(_)));
        demand(texture.is_none_or(is_float), place, "needs an existing texture of radiance")
    }
}

/// Every item is as it should be; else the first that is not is named.
fn all<T>(items: &[T], good: impl Fn(&T) -> bool, place: impl Fn(usize) -> String, what: &str) -> Check {
    items.iter().position(|item| !good(item)).map_or(Ok(()), |i| Err(Unsound { place: place(i), what: what.into() }))
}

fn is_normal(n: Vec3) -> bool {
    n == Vec3::ZERO || (n.length() - 1.0).abs() < 1e-3
}

fn is_tangent(t: &Vec4) -> bool {
    *t == Vec4::ZERO || ((t.truncate().length() - 1.0).abs() < 1e-3 && t.w.abs() == 1.0)
}

fn within(colour: Rgb, most: f32) -> bool {
    colour.to_array().iter().all(|c| (0.0..=most).contains(c))
}

const BEYOND_ONE: &str = "is not within 0..1";
const NO_TEXTURE: &str = "names a texture or channel that does not exist";
