//! What a scene consists of: meshes, objects (instances of meshes), materials, textures, lights.

use std::sync::{Arc, OnceLock};

use glam::{DVec3, Mat3, Vec2, Vec3, Vec4};
use serde::{Deserialize, Serialize};

use crate::{Camera, Light, Own, Pieces};

/// Linear Rec. 709 colour; the unit depends on what it measures.
pub type Rgb = Vec3;

/// Everything a renderer needs to know of a world, in scene space (see the crate's documentation).
///
/// A value of this type is *sound*: all indices are in range, all numbers are finite, no triangle
/// is degenerate. [`crate::read`] makes sound scenes of any file; [`Scene::check`] proves it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Scene {
    /// For people only.
    pub name: String,
    /// Where scene space has its origin, in file space.
    pub centre: DVec3,
    /// Where the picture is taken from.
    pub camera: Camera,
    /// Triangles in object space. Shared by any number of objects, and by all copies of the scene: a snapshot or an edit
    /// copies none.
    pub meshes: Vec<Arc<Mesh>>,
    /// What stands in the world: first what the file keeps apart ([`Scene::wholes`]), then the pieces that were lifted
    /// out of these, in order of [`Lifted::of`] and [`Lifted::piece`].
    pub objects: Vec<Object>,
    /// Indexed by [`Mesh::materials`]: first those of the file ([`Scene::shared_materials`]), then those that objects have of
    /// their own ([`Object::own`]), in order of the objects and of what they are instead of.
    pub materials: Vec<Material>,
    /// Indexed by [`Colour::texture`] and its kin; shared by all copies of the scene.
    pub textures: Vec<Arc<Texture>>,
    /// Lights without surface, and suns. Emissive surfaces are lights too, found through their material.
    pub lights: Vec<Light>,
    /// Their names in the file, for people only; empty or absent where the file gives none. Workers are not told them.
    pub light_names: Vec<String>,
    /// The file gives some of them in candela and lux, not in watts, so that 1 is no measure of what a picture shows as
    /// white. For people only, too.
    pub lights_are_photometric: bool,
    /// Glossy surfaces give back what light their facets pass on to each other. Without, that light is lost, as glTF has it:
    /// of white metal of roughness 1 three fifths.
    pub multiple_scattering: bool,
    /// What shines from beyond all objects.
    pub environment: Environment,
    /// The moment at which everything that moves stands where it is, in the scene's own unit; 0 where nothing moves.
    pub time: f64,
}

/// Triangles with their attributes, in object space.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Mesh {
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Unit shading normals: empty, or one a vertex. A zero vector means: flat, use the triangle's own.
    pub normals: Vec<Vec3>,
    /// Texture coordinates: empty, or one a vertex. `v = 0` is the **bottom** row of the image.
    pub uvs: Vec<Vec2>,
    /// Further sets of texture coordinates, likewise: set `k` of [`LookUp::set`] is `more_uvs[k − 1]`.
    pub more_uvs: Vec<Vec<Vec2>>,
    /// Where textures' u axis leads along the surface (unit length), and in `w` on which side of it their v axis does: 1
    /// or −1, so that v leads along `w · normal × tangent`. Empty, or one a vertex; zero where a triangle's own has to do.
    /// What [`NormalMap`]s are turned by.
    pub tangents: Vec<Vec4>,
    /// Linear colours of vertices, red to alpha, 65535 being 1: base colours are multiplied by them, and by their alpha
    /// what there is of a surface that is not all there. Empty, or one a vertex.
    pub colours: Vec<[u16; 4]>,
    /// Vertex indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Index into [`Scene::materials`], one a triangle.
    pub materials: Vec<u32>,
    /// See [`Mesh::pieces`].
    #[serde(skip)]
    pub found: Found<Pieces>,
}

/// What follows from the rest of a value, found when it is first asked for; so it says nothing more about the value, and
/// any two are equal.
#[derive(Clone, Debug)]
pub struct Found<T>(OnceLock<Arc<T>>);

/// A mesh at a place.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Object {
    /// As in the file (OBJ `o NAME`, glTF node name); unique names are not promised.
    pub name: String,
    /// Index into [`Scene::meshes`].
    pub mesh: u32,
    /// Scene space from object space, now. Of what moves, this follows from `motion` and [`Scene::time`].
    pub scene_from_object: Transform,
    /// How it moves over time, if it does.
    pub motion: Option<Motion>,
    /// Hidden objects take no part in light transport.
    pub visible: bool,
    /// It is a piece of another object; `None` for what the file keeps apart.
    pub lifted: Option<Lifted>,
    /// What it is made of instead of its mesh's materials, ascending by [`Own::instead_of`]. A piece has those of its whole as
    /// well, unless it has another of its own.
    pub own: Vec<Own>,
}

/// What makes an object of a piece of another: it has the other's mesh, but only that piece's triangles, which the other
/// is without. `scene_from_object` and `visible` follow from this and from the whole.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lifted {
    /// Index of the whole in [`Scene::objects`].
    pub of: u32,
    /// Which of [`Mesh::pieces`].
    pub piece: u32,
    /// How it was moved, in the whole's own space; the identity: not at all.
    pub whole_from_piece: Transform,
    /// Whether it takes part, if the whole does.
    pub visible: bool,
}

/// An affine map: `x ↦ linear · x + translation`. Plain `f32` arithmetic, the same on every machine.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Transform {
    /// Rotation and scale; must be invertible.
    pub linear: Mat3,
    /// Where the origin goes.
    pub translation: Vec3,
}

/// Rigid motion by keyframes about one fixed axis: `x' = R(axis, angle) (x − pivot) + pivot + translate`,
/// translate and angle linear between keys, constant before the first and after the last; and what was done to it since.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    /// Centre of rotation, scene space.
    pub pivot: Vec3,
    /// Rotation axis, unit length.
    pub axis: Vec3,
    /// Sorted by time; at least one, or one of `poses`.
    pub keys: Vec<Key>,
    /// Whole places instead of keys, sorted by time. Their numbers are linear between them; of their meshes, the last one
    /// before a moment is shown.
    pub poses: Vec<Posed>,
    /// How somebody has put it elsewhere than the keys do.
    pub offset: Offset,
}

/// An edit of something that moves, which goes on moving as before: `x' = keyed(own(x)) + shift`. So a shift takes its
/// whole way along, and what is turned or sized keeps its way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Offset {
    /// In the object's own space, before the motion; must be invertible.
    pub own: Transform,
    /// In scene space, after the motion.
    pub shift: Vec3,
}

/// One pose of a [`Motion`] that no axis describes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Posed {
    /// In the scene's own unit of time.
    pub time: f64,
    /// Scene space from object space.
    pub place: Transform,
    /// The mesh that the object has by then, of as many triangles as its others, if it changes shape. The others of its
    /// poses have one as well.
    pub mesh: Option<u32>,
}

/// One pose of a [`Motion`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Key {
    /// In the scene's own unit of time.
    pub time: f64,
    /// Displacement from the modelled position.
    pub translate: Vec3,
    /// Rotation about [`Motion::axis`], degrees, right-handed.
    pub angle_deg: f64,
}

/// What a triangle is made of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// As in the file.
    pub name: String,
    /// How it scatters light.
    pub surface: Surface,
    /// Radiance emitted by the front (counter-clockwise) side; black for most.
    pub emission: Colour,
    /// Emit from the back side as well.
    pub emits_both_sides: bool,
    /// How much of the surface is there; `None`: all of it.
    pub coverage: Option<Coverage>,
    /// Relief that is finer than the triangles.
    pub relief: Option<NormalMap>,
}

/// How a surface scatters light. All but the dielectric scatter on both sides alike.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Surface {
    /// Lambert: `f = albedo / π`.
    Diffuse {
        /// Fraction reflected, 0..1 a channel.
        albedo: Colour,
    },
    /// Perfect mirror without Fresnel term.
    Mirror {
        /// Fraction reflected, 0..1 a channel.
        reflectance: Rgb,
    },
    /// Glass, clear or frosted.
    Dielectric(Dielectric),
    /// Plastic, metal, lacquer, and all that is glossy.
    Glossy(Gloss),
    /// Glass in part, by chance or as cloth is there in part; the rest is `Glossy`, as rough as the glass.
    Glazed {
        /// How much of the non-metal is glass, 0..1.
        amount: Scalar,
        /// The glass.
        glass: Dielectric,
        /// As of [`Gloss`].
        base: Colour,
        /// As of [`Gloss`]; metal is never glass.
        metalness: Scalar,
        /// As of [`Gloss`].
        f0: f32,
        /// As of [`Gloss`].
        #[serde(default)]
        specular: Specular,
    },
    /// A sheet that scatters light on both sides, as paper and cloth do: Lambert on either.
    Translucent {
        /// Fraction that stays on its side, 0..1 a channel.
        albedo: Colour,
        /// Fraction that leaves on the other, 0..1 a channel.
        transmittance: Colour,
    },
}

/// Diffuse base under a GGX lobe (glTF 2.0 metallic-roughness), energy conserving, and what lies over both.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Gloss {
    /// Base colour, 0..1: the albedo of the non-metal, the F₀ of the metal.
    pub base: Colour,
    /// Perceptual roughness 0..1, GGX α = roughness². glTF: green channel of its texture.
    pub roughness: Scalar,
    /// 0 dielectric … 1 metal. glTF: blue channel of its texture.
    pub metalness: Scalar,
    /// F₀ of the non-metal, 0..1: 0.04 for IOR 1.5.
    pub f0: f32,
    /// Factors on what the lobe of the non-metal reflects.
    #[serde(default)]
    pub specular: Specular,
    /// Sheen over it, below any lacquer.
    #[serde(default)]
    pub sheen: Option<Sheen>,
    /// Clear lacquer over it.
    pub coat: Option<Coat>,
}

/// How much the lobe of a non-metal reflects, beside what its index of refraction has it reflect (KHR_materials_specular).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Specular {
    /// Factor at all angles, 0..1. glTF: alpha channel of its texture.
    pub amount: Scalar,
    /// Factor along the normal, ≥ 0: on F₀, which is 1 at most. At grazing angles all is white.
    pub colour: Colour,
}

/// Fibres that stand on a surface, as velvet's, or dust: a lobe of its own, bright at grazing angles, under which the rest gets
/// what it lets through (KHR_materials_sheen).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sheen {
    /// How strong it is, 0..1 a channel.
    pub colour: Colour,
    /// Perceptual roughness 0..1: how little the fibres are of one direction. glTF: alpha channel of its texture.
    pub roughness: Scalar,
}

/// Clear lacquer of index 1.5 over a glossy surface: a lobe of its own, under which the rest gets what it lets through
/// (KHR_materials_clearcoat).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Coat {
    /// How much of the surface has it, 0..1. glTF: red channel of its texture.
    pub amount: Scalar,
    /// Perceptual roughness 0..1, GGX α = roughness². glTF: green channel of its texture.
    pub roughness: Scalar,
}

/// Glass with exact Fresnel reflection; the front side is outside.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Dielectric {
    /// Index of refraction of the inside; outside is 1.
    pub ior: f32,
    /// Tint of light that is transmitted, at **each** crossing, 0..1. Reflection is untinted.
    pub transmittance: Colour,
    /// Perceptual roughness 0..1, GGX α = roughness² (Walter et al. 2007); 0 is clear.
    pub roughness: Scalar,
    /// Absorption coefficient σ of the inside, per scene unit of length, ≥ 0: `exp(−σ d)` is left after a way of d (Beer
    /// & Lambert). Sheets have no inside.
    pub absorption: Rgb,
    /// A sheet with two faces in one: light passes unbent (window panes modelled as one face).
    pub thin: bool,
    /// Where solids of glass lie in each other, the one of the highest number is there, and of equals the first in
    /// [`Scene::materials`]: a glass is there where water was modelled to reach into its wall, and light goes from glass to
    /// water (Schmidt & Budge 2002). 0: it knows nothing of others, and every boundary of it is one to air.
    #[serde(default)]
    pub priority: u8,
}

/// A colour, or a colour times a texture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Colour {
    /// Factor.
    pub value: Rgb,
    /// Index into [`Scene::textures`].
    pub texture: Option<u32>,
}

/// A number, or a number times one channel of a texture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Scalar {
    /// Factor.
    pub value: f32,
    /// Index into [`Scene::textures`] and the channel 0..=3 (red … alpha) in it, read **linearly**.
    pub texture: Option<(u32, u8)>,
}

/// How much of a surface is there: the part of its area that meets light and scatters it, or shines, as a fabric of
/// threads too fine to be seen. Light passes the rest unbent and untinted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Coverage {
    /// 0 nothing … 1 all.
    pub amount: Scalar,
    /// All of the surface is there where the amount is at least this, nothing elsewhere.
    pub cutoff: Option<f32>,
}

/// Shading normals by a texture: its red, green and blue, read linearly, times 2, less 1, are the normal along the surface's
/// tangents (see [`Mesh::tangents`]) and its interpolated normal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct NormalMap {
    /// Index into [`Scene::textures`].
    pub texture: u32,
    /// Factor on the parts along the tangents; 0 makes it flat.
    pub scale: f32,
}

/// An image on a surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Texture {
    /// As in the file.
    pub name: String,
    /// Pixels; at least 1.
    pub width: u32,
    /// Pixels; at least 1.
    pub height: u32,
    /// Row 0 is the **top** row.
    pub pixels: Pixels,
    /// How a place on a surface is looked up in it.
    pub look_up: LookUp,
}

/// How a texture is looked up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct LookUp {
    /// What lies beyond the left and right edges.
    pub across: Wrap,
    /// What lies beyond the lower and upper edges.
    pub up: Wrap,
    /// The nearest texel, instead of a mean of the four around.
    pub nearest: bool,
    /// By which of a mesh's texture coordinates: [`Mesh::uvs`] is 0, below [`SETS_MAX`].
    pub set: u8,
}

/// So many sets of texture coordinates a mesh may have.
pub const SETS_MAX: usize = 4;

/// Texel storage; 4 channels (RGBA) a texel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Pixels {
    /// 8 bits a channel; colour is sRGB-encoded, alpha linear.
    Srgb8(Vec<[u8; 4]>),
    /// 8 bits a channel, all linear (roughness, metalness, masks).
    Linear8(Vec<[u8; 4]>),
    /// Linear radiance (HDR environments); finite, not negative.
    Float(Vec<[f32; 3]>),
}

/// What a texture does outside [0, 1].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Wrap {
    /// Tiles.
    #[default]
    Repeat,
    /// The edge goes on for ever.
    Clamp,
    /// Tiles, every second one mirrored.
    Mirror,
}

impl LookUp {
    /// Tiles both ways.
    pub const REPEAT: Self = Self { across: Wrap::Repeat, up: Wrap::Repeat, nearest: false, set: 0 };
    /// The edges go on both ways.
    pub const CLAMP: Self = Self { across: Wrap::Clamp, up: Wrap::Clamp, nearest: false, set: 0 };
}

/// What shines from beyond all objects.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Environment {
    /// Nothing.
    #[default]
    Black,
    /// The same radiance from everywhere.
    Constant(Rgb),
    /// Latitude-longitude image: `u = ½ + atan2(x, −z) / 2π − turn`, row 0 of the image is up (+y).
    Image {
        /// Index into [`Scene::textures`], with [`Pixels::Float`].
        texture: u32,
        /// Factor.
        scale: Rgb,
        /// Where the image's middle column is: so many whole turns from −z towards +x, −1 … 1.
        #[serde(default)]
        turn: f32,
    },
}

impl Colour {
    /// A colour without texture.
    pub const fn plain(value: Rgb) -> Self {
        Self { value, texture: None }
    }

    /// Black and untextured: contributes nothing anywhere.
    pub fn is_black(&self) -> bool {
        self.value == Vec3::ZERO
    }
}

impl Scalar {
    /// A number without texture.
    pub const fn plain(value: f32) -> Self {
        Self { value, texture: None }
    }
}

impl Gloss {
    /// That of index 1.5, with nothing over it.
    pub const fn new(base: Colour, roughness: Scalar, metalness: Scalar) -> Self {
        Self { base, roughness, metalness, f0: 0.04, specular: Specular::WHOLE, sheen: None, coat: None }
    }
}

impl Sheen {
    /// It looks up a texture.
    pub fn is_textured(&self) -> bool {
        self.colour.texture.is_some() || self.roughness.texture.is_some()
    }
}

impl Specular {
    /// What the index of refraction says.
    pub const WHOLE: Self = Self { amount: Scalar::plain(1.0), colour: Colour::plain(Vec3::ONE) };

    /// It looks up a texture.
    pub fn is_textured(&self) -> bool {
        self.amount.texture.is_some() || self.colour.texture.is_some()
    }
}

impl Default for Specular {
    fn default() -> Self {
        Self::WHOLE
    }
}

impl Dielectric {
    /// Clear and untinted glass of an index of refraction.
    pub const fn clear(ior: f32, thin: bool) -> Self {
        let transmittance = Colour::plain(Vec3::ONE);
        Self { ior, transmittance, roughness: Scalar::plain(0.0), absorption: Vec3::ZERO, thin, priority: 0 }
    }

    /// Light on its way inside is absorbed.
    pub fn absorbs(&self) -> bool {
        !self.thin && self.absorption != Vec3::ZERO
    }

    /// It minds what other glass it lies in.
    pub fn is_nested(&self) -> bool {
        !self.thin && self.priority > 0
    }

    /// It may be clear somewhere.
    pub fn may_be_clear(&self) -> bool {
        self.roughness.texture.is_some() || self.roughness.value <= CLEAR_ROUGHNESS
    }
}

/// Glass of so little perceptual roughness is clear: its α is next to nothing.
pub const CLEAR_ROUGHNESS: f32 = 0.03;

impl Surface {
    /// What of it is glass, if any is.
    pub fn glass(&self) -> Option<&Dielectric> {
        match self {
            Self::Dielectric(glass) | Self::Glazed { glass, .. } => Some(glass),
            Self::Diffuse { .. } | Self::Mirror { .. } | Self::Glossy(_) | Self::Translucent { .. } => None,
        }
    }
}

impl Coverage {
    /// The same everywhere, 0..1.
    pub const fn plain(amount: f32) -> Self {
        Self { amount: Scalar::plain(amount), cutoff: None }
    }

    /// Holes where a channel of a texture is below `cutoff`.
    pub const fn mask(texture: u32, channel: u8, cutoff: f32) -> Self {
        Self { amount: Scalar { value: 1.0, texture: Some((texture, channel)) }, cutoff: Some(cutoff) }
    }

    /// 0..1 where the texture, and the vertex colours' alpha, if there are such, have this product.
    pub fn of(&self, texel: f32) -> f32 {
        let amount = self.amount.value * texel;
        match self.cutoff {
            None => amount.clamp(0.0, 1.0),
            Some(cutoff) => f32::from(u8::from(amount >= cutoff)),
        }
    }
}

impl Material {
    /// A diffuse, non-emissive, opaque material.
    pub fn diffuse(name: impl Into<String>, albedo: Rgb) -> Self {
        Self {
            name: name.into(),
            surface: Surface::Diffuse { albedo: Colour::plain(albedo) },
            emission: Colour::plain(Vec3::ZERO),
            emits_both_sides: false,
            coverage: None,
            relief: None,
        }
    }
}

impl<T> Default for Found<T> {
    fn default() -> Self {
        Self(OnceLock::new())
    }
}

impl<T> PartialEq for Found<T> {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Mesh {
    /// A set of texture coordinates ([`LookUp::set`]); empty if there is none.
    pub fn uv_set(&self, set: u8) -> &[Vec2] {
        match set {
            0 => &self.uvs,
            _ => self.more_uvs.get(usize::from(set) - 1).map_or(&[], Vec::as_slice),
        }
    }

    /// A set's coordinates at the corners of a triangle; 0 0 where there are none.
    pub fn corner_uvs(&self, triangle: usize, set: u8) -> [Vec2; 3] {
        let uvs = self.uv_set(set);
        self.triangles[triangle].map(|vertex| uvs.get(vertex as usize).copied().unwrap_or_default())
    }

    /// Colours and alpha at the corners of a triangle, 0..1; white where there are none.
    pub fn corner_colours(&self, triangle: usize) -> [Vec4; 3] {
        let unit = |colour: [u16; 4]| Vec4::from(colour.map(|part| f32::from(part) / 65535.0));
        self.triangles[triangle].map(|vertex| self.colours.get(vertex as usize).map_or(Vec4::ONE, |c| unit(*c)))
    }

    /// What it falls into; found when first asked for, some hundredths of a second for a hundred thousand triangles.
    pub fn pieces(&self) -> &Pieces {
        self.found.0.get_or_init(|| Arc::new(Pieces::of(self)))
    }
}

impl Object {
    /// A mesh that stands where it was modelled.
    pub fn fixed(name: impl Into<String>, mesh: u32) -> Self {
        let (scene_from_object, motion, visible, lifted) = (Transform::IDENTITY, None, true, None);
        Self { name: name.into(), mesh, scene_from_object, motion, visible, lifted, own: Vec::new() }
    }
}

impl Transform {
    /// Leaves everything where it is.
    pub const IDENTITY: Self = Self { linear: Mat3::IDENTITY, translation: Vec3::ZERO };

    /// Where a point goes.
    #[inline]
    pub fn point(&self, p: Vec3) -> Vec3 {
        self.linear * p + self.translation
    }

    /// Where a displacement goes; its length may change.
    #[inline]
    pub fn vector(&self, v: Vec3) -> Vec3 {
        self.linear * v
    }

    /// What first does the other, then this.
    pub fn after(&self, first: &Self) -> Self {
        Self { linear: self.linear * first.linear, translation: self.point(first.translation) }
    }

    /// The inverse map.
    pub fn inverse(&self) -> Self {
        let linear = self.linear.inverse();
        Self { linear, translation: -(linear * self.translation) }
    }

    /// Exactly the identity: nothing has to be computed.
    pub fn is_identity(&self) -> bool {
        *self == Self::IDENTITY
    }
}

impl Default for Transform {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Texture {
    /// Some texel's alpha is below 1.
    pub fn has_holes(&self) -> bool {
        match &self.pixels {
            Pixels::Srgb8(texels) | Pixels::Linear8(texels) => texels.iter().any(|texel| texel[3] < u8::MAX),
            Pixels::Float(_) => false,
        }
    }
}

impl Motion {
    /// The pose at a time.
    pub fn at(&self, time: f64) -> Transform {
        let Offset { own, shift } = self.offset;
        let posed = if own.is_identity() { self.keyed(time) } else { self.keyed(time).after(&own) };
        Transform { translation: posed.translation + shift, ..posed }
    }

    /// The offset that puts the object to a place at a time. If it is only shifted there, its whole way is; if it is
    /// turned or sized as well, it is so about itself wherever its way leads. A function of this state and the place
    /// alone: of a drag, only the last place counts.
    pub fn offset_to(&self, time: f64, place: &Transform) -> Offset {
        let (keyed, Offset { own, shift }) = (self.keyed(time), self.offset);
        let unshifted = keyed.after(&own);
        if unshifted.linear.abs_diff_eq(place.linear, SAME_LINEAR * largest(&unshifted.linear)) {
            return Offset { own, shift: place.translation - unshifted.translation };
        }
        let way = Transform { translation: keyed.translation + shift, ..keyed };
        Offset { own: way.inverse().after(place), shift }
    }

    /// All times of keys and poses.
    pub fn times(&self) -> impl Iterator<Item = f64> {
        self.keys.iter().map(|key| key.time).chain(self.poses.iter().map(|pose| pose.time))
    }

    /// The mesh that an object has at a time, if it changes shape.
    pub fn mesh_at(&self, time: f64) -> Option<u32> {
        let next = self.poses.partition_point(|pose| pose.time <= time);
        self.poses.get(next.saturating_sub(1))?.mesh
    }

    /// The pose by poses alone, of which there is one.
    fn posed(&self, time: f64) -> Transform {
        let last = self.poses.len() - 1;
        let next = self.poses.partition_point(|pose| pose.time <= time).min(last);
        let (from, to) = (&self.poses[next.saturating_sub(1)], &self.poses[next]);
        let span = to.time - from.time;
        let s = if span > 0.0 { ((time - from.time) / span).clamp(0.0, 1.0) as f32 } else { 1.0 };
        let (a, b) = (from.place, to.place);
        if s == 1.0 {
            return b;
        }
        let linear = a.linear * (1.0 - s) + b.linear * s;
        Transform { linear, translation: a.translation * (1.0 - s) + b.translation * s }
    }

    /// The pose by the keys alone.
    fn keyed(&self, time: f64) -> Transform {
        if self.keys.is_empty() {
            return self.posed(time);
        }
        let last = self.keys.len() - 1;
        let next = self.keys.iter().position(|key| time < key.time).unwrap_or(last);
        let (from, to) = (self.keys[next.saturating_sub(1)], self.keys[next]);
        let span = to.time - from.time;
        let s = if span > 0.0 { ((time - from.time) / span).clamp(0.0, 1.0) } else { 1.0 };
        let translate = from.translate.as_dvec3().lerp(to.translate.as_dvec3(), s);
        let radians = (from.angle_deg + (to.angle_deg - from.angle_deg) * s).to_radians();
        let rotation = rotation(self.axis.as_dvec3(), radians);
        let pivot = self.pivot.as_dvec3();
        Transform { linear: rotation.as_mat3(), translation: (pivot + translate - rotation * pivot).as_vec3() }
    }
}

/// Linear maps that differ by so little, beside their largest number, differ by rounding.
const SAME_LINEAR: f32 = 1e-5;

fn largest(linear: &Mat3) -> f32 {
    linear.to_cols_array().into_iter().fold(0.0, |most, value| value.abs().max(most))
}

/// Rodrigues' formula; `axis` of unit length, sine and cosine from one maths library everywhere.
fn rotation(axis: DVec3, radians: f64) -> glam::DMat3 {
    let (sin, cos) = (libm::sin(radians), libm::cos(radians));
    let cross = glam::DMat3::from_cols(
        glam::dvec3(0.0, axis.z, -axis.y),
        glam::dvec3(-axis.z, 0.0, axis.x),
        glam::dvec3(axis.y, -axis.x, 0.0),
    );
    glam::DMat3::IDENTITY + cross * sin + cross * cross * (1.0 - cos)
}

impl Scene {
    /// Puts every moving object where it is at `time`, and so all pieces lifted out of any object.
    pub fn pose(&mut self, time: f64) {
        self.time = 0.0;
        for object in &mut self.objects {
            if let Some(motion) = &object.motion {
                (object.scene_from_object, self.time) = (motion.at(time), time);
                object.mesh = motion.mesh_at(time).unwrap_or(object.mesh);
            }
        }
        self.carry_lifted();
    }

    /// Total number of triangles of visible objects, instances counted each.
    pub fn triangle_count(&self) -> usize {
        (0..).zip(&self.objects).filter(|(_, o)| o.visible).map(|(number, _)| self.triangles(number).count()).sum()
    }
}
