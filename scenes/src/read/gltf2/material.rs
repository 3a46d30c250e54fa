//! What a glTF material means as a [`Surface`].
//!
//! | file says | becomes |
//! |---|---|
//! | metallic-roughness | the same, F₀ from `ior` and `specular` |
//! | … metal, roughness ≤ 0.03, untextured | perfect mirror |
//! | `transmission` ≥ ½ | glass of `ior`, tinted by the base colour at each crossing; thin without `volume` |
//! | `volume` attenuation | half of it (by optical depth, of `thicknessFactor`) at each crossing |
//! | `unlit` | emits its base colour and reflects nothing |
//! | `alphaMode` BLEND | as much of the surface is there as its alpha (factor times texture) says |
//! | `alphaMode` MASK | all of it is there where alpha reaches `alphaCutoff`, elsewhere nothing |
//! | `doubleSided` | emits on both sides; all surfaces scatter on both |

use glam::{Mat2, Vec2, Vec3};
use gltf_json::extensions::material as ext;
use gltf_json::material::{self as json, AlphaMode};
use gltf_json::texture::{Info, WrappingMode};
use gltf_json::validation::Checked;
use gltf_json::{Image, Index, Texture};
use std::collections::BTreeMap;

use super::super::error::Notes;
use super::super::surface::MIRROR_ROUGHNESS;
use super::super::textures::{Meaning, Textures};
use super::super::{ReadError, limits};
use super::file::File;
use crate::{Colour, Coverage, Material, Scalar, Surface, Wrap};

/// A material and how its textures lie on a mesh.
#[derive(Clone, Debug)]
pub(super) struct Look {
    pub material: Material,
    pub layout: Layout,
}

/// Which texture coordinates are used and how: `uv ↦ linear · uv + offset`, still glTF's (v = 0 is
/// the top row).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Layout {
    pub textured: bool,
    pub set: u32,
    pub linear: Mat2,
    pub offset: Vec2,
}

const NO_TEXTURE: Layout = Layout { textured: false, set: 0, linear: Mat2::IDENTITY, offset: Vec2::ZERO };

/// Turns glTF materials into the scene's, loading textures as it goes.
pub(super) struct Looks<'a> {
    pub file: &'a File,
    pub textures: &'a mut Textures,
    pub notes: &'a mut Notes,
    known: BTreeMap<(usize, Meaning, bool), Option<u32>>,
}

impl<'a> Looks<'a> {
    pub fn new(file: &'a File, textures: &'a mut Textures, notes: &'a mut Notes) -> Self {
        Self { file, textures, notes, known: BTreeMap::new() }
    }

    /// The look of `materials[index]`, or of a primitive without material. `user` is the primitive that asks first.
    pub fn look(&mut self, index: Option<Index<json::Material>>, user: &str) -> Look {
        let file = self.file;
        let default = json::Material::default();
        let found = index.map(|index| file.get(&file.root.materials, index, || format!("{user}.material")));
        let found = found.and_then(|found| {
            found.map_err(|error| file.leave_out(error, "the default material is used", self.notes)).ok()
        });
        let place = match (index, found) {
            (Some(index), Some(_)) => format!("materials[{}]", index.value()),
            _ => "default material".into(),
        };
        Reader { looks: self, material: found.unwrap_or(&default), place, layout: None }.read()
    }

    /// The texture `index`, decoded once for each meaning; `None` (and a note) if there is none.
    fn texture(&mut self, index: Index<Texture>, meaning: Meaning, field: &str) -> Option<u32> {
        let file = self.file;
        let texture = match file.get(&file.root.textures, index, || field.into()) {
            Ok(texture) => texture,
            Err(error) => {
                file.leave_out(error, PLAIN, self.notes);
                return None;
            }
        };
        // What has no source was named when the file was read.
        let image = texture.source.value();
        if image == u32::MAX as usize {
            return None;
        }
        let wrap = self.wrap(texture, index.value());
        let key = (image, meaning, wrap == Wrap::Clamp);
        if let Some(&known) = self.known.get(&key) {
            return known;
        }
        let place = format!("textures[{}].source", index.value());
        let added = self.image(texture.source, meaning, wrap, &place);
        let added = added.map_err(|error| file.leave_out(error, PLAIN, self.notes)).ok();
        self.known.insert(key, added);
        added
    }

    /// The image `index` as a texture.
    fn image(&mut self, index: Index<Image>, meaning: Meaning, wrap: Wrap, place: &str) -> Result<u32, ReadError> {
        let file = self.file;
        let image = file.get(&file.root.images, index, || place.into())?;
        let field = format!("images[{}]", index.value());
        let name = image.name.clone().or_else(|| image.uri.clone().filter(|uri| !uri.starts_with("data:")));
        let name = name.unwrap_or_else(|| field.clone());
        let (path, bytes) = match (&image.uri, image.buffer_view) {
            (Some(uri), _) if !uri.starts_with("data:") => {
                let path = file.resource_path(&field, uri)?;
                (path.clone(), limits::read_bytes(&path)?)
            }
            (Some(uri), _) => (file.path.clone(), file.resource(&field, uri)?),
            (None, Some(view)) => (file.path.clone(), file.view(view, &field)?.to_vec()),
            (None, None) => return Err(file.refuse(&field, "has neither uri nor bufferView")),
        };
        let named = if path == file.path { String::new() } else { format!("{name}: ") };
        let added = self.textures.add(&path, &name, &bytes, meaning, wrap);
        added.map_err(|why| file.refuse(&field, format!("{named}{why}")))
    }

    fn wrap(&mut self, texture: &Texture, number: usize) -> Wrap {
        let Some(sampler) = texture.sampler else { return Wrap::Repeat };
        let field = format!("textures[{number}].sampler");
        let sampler = match self.file.get(&self.file.root.samplers, sampler, || field.clone()) {
            Ok(sampler) => sampler,
            Err(error) => {
                self.file.leave_out(error, "the texture is repeated", self.notes);
                return Wrap::Repeat;
            }
        };
        match [sampler.wrap_s, sampler.wrap_t] {
            [Checked::Valid(WrappingMode::ClampToEdge), Checked::Valid(WrappingMode::ClampToEdge)] => Wrap::Clamp,
            [Checked::Valid(WrappingMode::Repeat), Checked::Valid(WrappingMode::Repeat)] => Wrap::Repeat,
            _ => {
                let message = "textures are repeated or clamped both ways; this one is repeated";
                self.notes.at(&self.file.path, field, message);
                Wrap::Repeat
            }
        }
    }
}

/// What becomes of a texture that cannot be had.
const PLAIN: &str = "the plain colour is used";

/// One material under way.
struct Reader<'l, 'a> {
    looks: &'l mut Looks<'a>,
    material: &'l json::Material,
    place: String,
    layout: Option<Layout>,
}

impl Reader<'_, '_> {
    fn read(mut self) -> Look {
        let unlit = self.extensions().is_some_and(|all| all.unlit.is_some());
        let base = self.base();
        let (surface, emission) = if unlit {
            (Surface::Diffuse { albedo: Colour::plain(Vec3::ZERO) }, base)
        } else {
            let surface = self.surface(base);
            (surface, self.emission())
        };
        let coverage = self.coverage(base);
        if self.material.normal_texture.is_some() {
            self.note("normal map not drawn");
        }
        let name = self.material.name.clone().unwrap_or_else(|| self.place.clone());
        let material = Material { name, surface, emission, emits_both_sides: self.material.double_sided, coverage };
        Look { material, layout: self.layout.unwrap_or(NO_TEXTURE) }
    }

    fn extensions(&self) -> Option<&ext::Material> {
        self.material.extensions.as_ref()
    }

    fn base(&mut self) -> Colour {
        let pbr = &self.material.pbr_metallic_roughness;
        let [r, g, b, _] = pbr.base_color_factor.0;
        let value = self.within_one("baseColorFactor", Vec3::new(r, g, b));
        let texture = self.texture(pbr.base_color_texture.as_ref(), Meaning::Colour, "baseColorTexture");
        Colour { value, texture }
    }

    fn surface(&mut self, base: Colour) -> Surface {
        let ior = self.extensions().and_then(|all| all.ior.as_ref()).map_or(1.5, |ior| ior.ior.0);
        let ior = if ior.is_finite() && ior >= 1.0 { ior } else { 1.5 };
        let transmission = self.extensions().and_then(|all| all.transmission.as_ref());
        let transmits = transmission.is_some_and(|t| t.transmission_factor.0 >= 0.5);
        let partly = transmission.is_some_and(|t| t.transmission_factor.0 > 0.0 && t.transmission_factor.0 < 1.0);
        if partly {
            let becomes = if transmits { "clear" } else { "opaque" };
            self.note(&format!("is partly transmissive: drawn {becomes}"));
        }
        if transmits {
            return self.glass(base, ior);
        }
        let pbr = &self.material.pbr_metallic_roughness;
        let map = self.texture(pbr.metallic_roughness_texture.as_ref(), Meaning::Data, "metallicRoughnessTexture");
        let scalar = |factor: f32, channel: u8| Scalar {
            value: if factor.is_finite() { factor.clamp(0.0, 1.0) } else { 1.0 },
            texture: map.map(|texture| (texture, channel)),
        };
        let (roughness, metalness) = (scalar(pbr.roughness_factor.0, 1), scalar(pbr.metallic_factor.0, 2));
        let plain = base.texture.is_none() && map.is_none();
        if plain && metalness.value >= 0.99 && roughness.value <= MIRROR_ROUGHNESS {
            return Surface::Mirror { reflectance: base.value };
        }
        let reflected = (ior - 1.0) / (ior + 1.0);
        let f0 = (reflected * reflected * self.specular()).clamp(0.0, 1.0);
        if f0 == 0.0 && metalness.value == 0.0 {
            return Surface::Diffuse { albedo: base };
        }
        Surface::Glossy { base, roughness, metalness, f0 }
    }

    fn glass(&mut self, base: Colour, ior: f32) -> Surface {
        if base.texture.is_some() {
            self.note("transmission is tinted by the base colour's factor, not by its texture");
        }
        if self.material.pbr_metallic_roughness.roughness_factor.0 > 0.1 {
            self.note("rough transmission is drawn smooth");
        }
        let volume = self.extensions().and_then(|all| all.volume.as_ref());
        let absorbed = volume.map_or(Vec3::ONE, |volume| {
            let depth = volume.thickness_factor.0 / volume.attenuation_distance.0 / 2.0;
            let depth = if depth.is_finite() && depth > 0.0 { depth } else { 0.0 };
            Vec3::from(volume.attenuation_color.0.map(|colour| libm::powf(colour.clamp(0.0, 1.0), depth)))
        });
        Surface::Dielectric { ior, transmittance: base.value * absorbed, thin: volume.is_none() }
    }

    /// Factor on F₀.
    fn specular(&self) -> f32 {
        let factor = self.extensions().and_then(|all| all.specular.as_ref()).map_or(1.0, |specular| {
            let [r, g, b] = specular.specular_color_factor.0;
            specular.specular_factor.0 * (r + g + b) / 3.0
        });
        if factor.is_finite() { factor.max(0.0) } else { 1.0 }
    }

    fn emission(&mut self) -> Colour {
        let strength = self.extensions().and_then(|all| all.emissive_strength.as_ref());
        let strength = strength.map_or(1.0, |strength| strength.emissive_strength.0);
        let value = Vec3::from(self.material.emissive_factor.0) * strength;
        if !value.is_finite() || value.min_element() < 0.0 {
            self.note("emission is negative or no number: dark");
            return Colour::plain(Vec3::ZERO);
        }
        if value == Vec3::ZERO {
            return Colour::plain(value);
        }
        let info = self.material.emissive_texture.as_ref();
        let texture = self.texture(info, Meaning::Colour, "emissiveTexture");
        // The factor of a texture that is lost says nothing of where it would be dark.
        let lost = info.is_some() && texture.is_none();
        Colour { value: if lost { Vec3::ZERO } else { value }, texture }
    }

    /// `None` where all of the surface is there, so that nobody looks.
    fn coverage(&mut self, base: Colour) -> Option<Coverage> {
        let cutoff = match self.material.alpha_mode {
            Checked::Valid(AlphaMode::Opaque) | Checked::Invalid => return None,
            Checked::Valid(AlphaMode::Mask) => Some(self.material.alpha_cutoff.unwrap_or_default().0),
            Checked::Valid(AlphaMode::Blend) => None,
        };
        let factor = self.material.pbr_metallic_roughness.base_color_factor.0[3];
        let value = if factor.is_finite() { factor.clamp(0.0, 1.0) } else { 1.0 };
        let texture = base.texture.filter(|texture| self.looks.textures.list[*texture as usize].has_holes());
        let coverage = Coverage {
            amount: Scalar { value, texture: texture.map(|texture| (texture, 3)) },
            cutoff: cutoff.map(|cutoff| if cutoff.is_finite() { cutoff } else { 0.5 }),
        };
        let is_whole = texture.is_none() && coverage.of(1.0) >= 1.0;
        (!is_whole).then_some(coverage)
    }

    /// A texture, whose place on the surface has to be that of the material's first one.
    fn texture(&mut self, info: Option<&Info>, meaning: Meaning, what: &str) -> Option<u32> {
        let info = info?;
        let field = format!("{}.{what}", self.place);
        let texture = self.looks.texture(info.index, meaning, &field);
        let layout = layout(info);
        if texture.is_some() && *self.layout.get_or_insert(layout) != layout {
            self.note(&format!("{what} lies otherwise than the base colour's texture: the latter's place is used"));
        }
        texture
    }

    fn within_one(&mut self, what: &str, value: Vec3) -> Vec3 {
        let clamped = if value.is_finite() { value.clamp(Vec3::ZERO, Vec3::ONE) } else { Vec3::splat(0.5) };
        if clamped != value {
            self.note(&format!("{what} is outside 0..1: clamped, for energy's sake"));
        }
        clamped
    }

    fn note(&mut self, message: &str) {
        self.looks.notes.at(&self.looks.file.path, &self.place, message);
    }
}

/// Texture set and KHR_texture_transform.
fn layout(info: &Info) -> Layout {
    let plain = Layout { textured: true, set: info.tex_coord, ..NO_TEXTURE };
    let Some(transform) = info.extensions.as_ref().and_then(|all| all.texture_transform.as_ref()) else {
        return plain;
    };
    let (sin, cos) = (libm::sinf(transform.rotation.0), libm::cosf(transform.rotation.0));
    let [u, v] = transform.scale.0;
    // Columns of rotation · scale, as the extension's text gives them.
    let linear = Mat2::from_cols(Vec2::new(cos, -sin) * u, Vec2::new(sin, cos) * v);
    let offset = Vec2::from(transform.offset.0);
    if !(linear.is_finite() && offset.is_finite()) {
        return plain;
    }
    Layout { set: transform.tex_coord.unwrap_or(info.tex_coord), linear, offset, ..plain }
}
