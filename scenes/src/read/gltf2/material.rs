//! What a glTF material means as a [`Surface`].
//!
//! | file says | becomes |
//! |---|---|
//! | metallic-roughness | the same, F₀ from `ior` |
//! | `specular` | factors on what the lobe of the non-metal reflects, at all angles and along the normal |
//! | … metal, roughness ≤ 0.03, untextured | perfect mirror |
//! | `transmission` | so much of the non-metal is glass of `ior`, as rough as the surface, tinted by the base colour at each crossing |
//! | `volume` of a thickness > 0 | the glass is solid, and absorbs by `attenuationColor` a way of `attenuationDistance`; else it is thin |
//! | `diffuse_transmission` | a sheet that scatters on both sides, without gloss |
//! | `clearcoat` | a coat over what is no glass, with the surface's own relief |
//! | `sheen` | sheen over what is no glass, under any coat |
//! | `pbrSpecularGlossiness` | a non-metal whose F₀ is the specular colour, roughness 1 − glossiness |
//! | `unlit` | emits its base colour and reflects nothing |
//! | `alphaMode` BLEND | as much of the surface is there as its alpha (factor times texture) says |
//! | `alphaMode` MASK | all of it is there where alpha reaches `alphaCutoff`, elsewhere nothing |
//! | `normalTexture` | relief |
//! | `doubleSided` | emits on both sides; all surfaces scatter on both |

use glam::{Mat2, Vec2, Vec3};
use gltf_json::accessor::Type;
use gltf_json::extensions::material as ext;
use gltf_json::extensions::texture::TextureTransform;
use gltf_json::material::{self as json, AlphaMode};
use gltf_json::mesh::Semantic;
use gltf_json::texture::{Info, MagFilter, WrappingMode};
use gltf_json::validation::Checked;
use gltf_json::{Image, Index, Texture};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::collections::{BTreeMap, BTreeSet};

use super::super::error::Notes;
use super::super::surface::MIRROR_ROUGHNESS;
use super::super::textures::{Meaning, Textures};
use super::super::{ReadError, limits};
use super::file::File;
use crate::{
    Coat, Colour, Coverage, Dielectric, Gloss, LookUp, Material, NormalMap, SETS_MAX, Scalar, Sheen, Specular, Surface,
    Wrap,
};

/// A material and how its textures lie on a mesh.
#[derive(Clone, Debug)]
pub(super) struct Look {
    pub material: Material,
    /// By set of texture coordinates.
    pub layouts: Vec<Layout>,
    /// The set that its normal map lies by.
    pub relief: Option<usize>,
}

/// Which texture coordinates are used and how: `uv ↦ linear · uv + offset`, still glTF's (v = 0 is
/// the top row).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Layout {
    pub set: u32,
    pub linear: Mat2,
    pub offset: Vec2,
}

impl Layout {
    fn plain(set: u32) -> Self {
        Self { set, linear: Mat2::IDENTITY, offset: Vec2::ZERO }
    }
}

/// Turns glTF materials into the scene's, loading textures as it goes.
pub(super) struct Looks<'a> {
    pub file: &'a File,
    pub textures: &'a mut Textures,
    pub notes: &'a mut Notes,
    known: BTreeMap<(usize, Meaning, LookUp), Option<u32>>,
    /// Textures of roughness made of others' glossiness, by these and the factor's bits.
    roughened: BTreeMap<(u32, u32), Option<u32>>,
    /// Materials that meshes with vertex colours of their own alpha have.
    faded: BTreeSet<Option<usize>>,
    /// Materials that meshes with vertex colours have.
    coloured: BTreeSet<Option<usize>>,
}

impl<'a> Looks<'a> {
    pub fn new(file: &'a File, textures: &'a mut Textures, notes: &'a mut Notes) -> Self {
        let [coloured, faded] = vertex_colours(file);
        Self { file, textures, notes, known: BTreeMap::new(), roughened: BTreeMap::new(), faded, coloured }
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
        let number = index.map(|index| index.value());
        let (coloured, faded) = (self.coloured.contains(&number), self.faded.contains(&number));
        let material = found.unwrap_or(&default);
        Reader { looks: self, material, place, layouts: Vec::new(), coloured, faded }.read()
    }

    /// The texture `index`, decoded once for each meaning; `None` (and a note) if there is none.
    fn texture(&mut self, index: Index<Texture>, meaning: Meaning, set: u8, field: &str) -> Option<u32> {
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
        let look_up = LookUp { set, ..self.look_up(texture, index.value()) };
        let key = (image, meaning, look_up);
        if let Some(&known) = self.known.get(&key) {
            return known;
        }
        let place = format!("textures[{}].source", index.value());
        let added = self.image(texture.source, meaning, look_up, &place);
        let added = added.map_err(|error| file.leave_out(error, PLAIN, self.notes)).ok();
        self.known.insert(key, added);
        added
    }

    /// A texture of 1 − factor · glossiness, which is another's alpha.
    fn roughened(&mut self, texture: u32, factor: f32) -> Option<u32> {
        let textures = &mut *self.textures;
        let made = || textures.mapped(texture, 3, |glossiness| 1.0 - factor * glossiness);
        *self.roughened.entry((texture, factor.to_bits())).or_insert_with(made)
    }

    /// The image `index` as a texture.
    fn image(&mut self, index: Index<Image>, meaning: Meaning, look_up: LookUp, place: &str) -> Result<u32, ReadError> {
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
        let added = self.textures.add(&path, &name, &bytes, meaning, look_up);
        added.map_err(|why| file.refuse(&field, format!("{named}{why}")))
    }

    fn look_up(&mut self, texture: &Texture, number: usize) -> LookUp {
        let Some(sampler) = texture.sampler else { return LookUp::REPEAT };
        let field = format!("textures[{number}].sampler");
        let sampler = match self.file.get(&self.file.root.samplers, sampler, || field) {
            Ok(sampler) => sampler,
            Err(error) => {
                self.file.leave_out(error, "the texture is repeated", self.notes);
                return LookUp::REPEAT;
            }
        };
        let wrap = |mode| match mode {
            Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
            Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
            Checked::Valid(WrappingMode::Repeat) | Checked::Invalid => Wrap::Repeat,
        };
        // From near, which is how every ray looks.
        let nearest = sampler.mag_filter == Some(Checked::Valid(MagFilter::Nearest));
        LookUp { across: wrap(sampler.wrap_s), up: wrap(sampler.wrap_t), nearest, set: 0 }
    }
}

/// Materials of primitives with vertex colours; and of those whose colours have an alpha.
fn vertex_colours(file: &File) -> [BTreeSet<Option<usize>>; 2] {
    let [mut coloured, mut faded] = [BTreeSet::new(), BTreeSet::new()];
    for primitive in file.root.meshes.iter().flat_map(|mesh| &mesh.primitives) {
        let Some(colours) = primitive.attributes.get(&Checked::Valid(Semantic::Colors(0))) else { continue };
        let material = primitive.material.map(|index| index.value());
        coloured.insert(material);
        let accessor = file.root.accessors.get(colours.value());
        if accessor.is_some_and(|accessor| accessor.type_ == Checked::Valid(Type::Vec4)) {
            faded.insert(material);
        }
    }
    [coloured, faded]
}

/// Of a channel in which nothing is left: so much is, or it could not be told how much less a longer way leaves.
const LEAST_ATTENUATION: f32 = 1e-6;

/// KHR_materials_diffuse_transmission.
#[derive(Deserialize)]
struct DiffuseTransmission {
    #[serde(default, rename = "diffuseTransmissionFactor")]
    factor: f32,
    #[serde(rename = "diffuseTransmissionTexture")]
    texture: Option<Info>,
    #[serde(default = "white", rename = "diffuseTransmissionColorFactor")]
    colour: [f32; 3],
    #[serde(rename = "diffuseTransmissionColorTexture")]
    colour_texture: Option<Info>,
}

/// KHR_materials_clearcoat.
#[derive(Deserialize)]
struct ClearCoat {
    #[serde(default, rename = "clearcoatFactor")]
    factor: f32,
    #[serde(rename = "clearcoatTexture")]
    texture: Option<Info>,
    #[serde(default, rename = "clearcoatRoughnessFactor")]
    roughness: f32,
    #[serde(rename = "clearcoatRoughnessTexture")]
    roughness_texture: Option<Info>,
    #[serde(rename = "clearcoatNormalTexture")]
    normal: Option<serde_json::Value>,
}

/// KHR_materials_sheen.
#[derive(Deserialize)]
struct SheenFields {
    #[serde(default, rename = "sheenColorFactor")]
    colour: [f32; 3],
    #[serde(rename = "sheenColorTexture")]
    colour_texture: Option<Info>,
    #[serde(default, rename = "sheenRoughnessFactor")]
    roughness: f32,
    #[serde(rename = "sheenRoughnessTexture")]
    roughness_texture: Option<Info>,
}

fn white() -> [f32; 3] {
    [1.0; 3]
}

/// What becomes of a texture that cannot be had.
const PLAIN: &str = "the plain colour is used";

/// One material under way.
struct Reader<'l, 'a> {
    looks: &'l mut Looks<'a>,
    material: &'l json::Material,
    place: String,
    /// By set of texture coordinates.
    layouts: Vec<Layout>,
    /// Meshes with it have vertex colours, and such with an alpha.
    coloured: bool,
    faded: bool,
}

impl Reader<'_, '_> {
    fn read(mut self) -> Look {
        let unlit = self.extensions().is_some_and(|all| all.unlit.is_some());
        if unlit && self.coloured {
            self.note("is unlit with vertex colours: drawn lit");
        }
        let gloss = self.extensions().and_then(|all| all.pbr_specular_glossiness.clone()).filter(|_| !unlit);
        let glossy = gloss.as_ref().map(|gloss| self.spec_gloss(gloss));
        let (base, alpha) = match &glossy {
            Some(glossy) => (glossy.base, gloss.as_ref().map_or(1.0, |gloss| gloss.diffuse_factor.0[3])),
            None => (self.base(), self.material.pbr_metallic_roughness.base_color_factor.0[3]),
        };
        let (surface, emission) = if let Some(glossy) = glossy {
            (Surface::Glossy(glossy), self.emission())
        } else if unlit && !self.coloured {
            (Surface::Diffuse { albedo: Colour::plain(Vec3::ZERO) }, base)
        } else if unlit {
            (Surface::Diffuse { albedo: base }, Colour::plain(Vec3::ZERO))
        } else {
            let surface = self.surface(base);
            (surface, self.emission())
        };
        let coverage = self.coverage(base, alpha);
        let relief = self.relief().filter(|_| !unlit);
        let name = self.material.name.clone().unwrap_or_else(|| self.place.clone());
        let emits_both_sides = self.material.double_sided;
        let set = |relief: &NormalMap| usize::from(self.looks.textures.list[relief.texture as usize].look_up.set);
        let set = relief.as_ref().map(set);
        let material = Material { name, surface, emission, emits_both_sides, coverage, relief };
        Look { material, layouts: self.layouts, relief: set }
    }

    /// KHR_materials_pbrSpecularGlossiness: what its facets reflect along the normal is said outright.
    fn spec_gloss(&mut self, gloss: &ext::PbrSpecularGlossiness) -> Gloss {
        let number = |value: f32| if value.is_finite() { value.clamp(0.0, 1.0) } else { 1.0 };
        let [r, g, b, _] = gloss.diffuse_factor.0.map(number);
        let (diffuse, specular) = (Vec3::new(r, g, b), Vec3::from(gloss.specular_factor.0.map(number)));
        let glossiness = number(gloss.glossiness_factor.0);
        let texture = self.texture(gloss.diffuse_texture.as_ref(), Meaning::Colour, "diffuseTexture");
        let base = Colour { value: diffuse, texture };
        let texture =
            self.texture(gloss.specular_glossiness_texture.as_ref(), Meaning::Colour, "specularGlossinessTexture");
        let rough = texture.and_then(|texture| self.looks.roughened(texture, glossiness));
        let roughness = match rough {
            Some(rough) => Scalar { value: 1.0, texture: Some((rough, 0)) },
            None => Scalar::plain(1.0 - glossiness),
        };
        let specular = Specular { colour: Colour { value: specular, texture }, ..Specular::WHOLE };
        Gloss { f0: 1.0, specular, ..Gloss::new(base, roughness, Scalar::plain(0.0)) }
    }

    fn relief(&mut self) -> Option<NormalMap> {
        let normal = self.material.normal_texture.as_ref()?;
        let transform = normal.extensions.as_ref().and_then(|all| all.others.get("KHR_texture_transform"));
        let transform = transform.and_then(|value| serde_json::from_value(value.clone()).ok());
        let layout = layout(normal.tex_coord, transform.as_ref());
        let texture = self.texture_at(normal.index, layout, Meaning::Data, "normalTexture")?;
        let scale = if normal.scale.is_finite() { normal.scale } else { 1.0 };
        Some(NormalMap { texture, scale })
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
        let said = self.extensions().and_then(|all| all.ior.as_ref()).map_or(1.5, |ior| ior.ior.0);
        let ior = if said.is_finite() && said >= 1.0 { said } else { 1.5 };
        let pbr = &self.material.pbr_metallic_roughness;
        let map = self.texture(pbr.metallic_roughness_texture.as_ref(), Meaning::Data, "metallicRoughnessTexture");
        let scalar = |factor: f32, channel: u8| Scalar {
            value: if factor.is_finite() { factor.clamp(0.0, 1.0) } else { 1.0 },
            texture: map.map(|texture| (texture, channel)),
        };
        let (roughness, metalness) = (scalar(pbr.roughness_factor.0, 1), scalar(pbr.metallic_factor.0, 2));
        let amount = self.transmission();
        if amount.value == 0.0
            && let Some(sheet) = self.sheet(base, metalness.value)
        {
            return sheet;
        }
        let glass = (amount.value > 0.0).then(|| self.glass(base, roughness, ior));
        let specular = self.specular();
        if let Some(glass) = glass
            && amount == Scalar::plain(1.0)
            && metalness.value == 0.0
        {
            if specular != Specular::WHOLE {
                self.note("KHR_materials_specular is not drawn on glass, which reflects what its index says");
            }
            return Surface::Dielectric(glass);
        }
        let (coat, sheen) = (self.coat(glass.is_some()), self.sheen(glass.is_some()));
        let plain = base.texture.is_none() && map.is_none() && coat.is_none() && sheen.is_none();
        if plain && metalness.value >= 0.99 && roughness.value <= MIRROR_ROUGHNESS {
            return Surface::Mirror { reflectance: base.value };
        }
        let reflected = (ior - 1.0) / (ior + 1.0);
        // 0 is no index: what is reflected along the normal is the specular colour's alone.
        let f0 = if said == 0.0 { 1.0 } else { reflected * reflected };
        if let Some(glass) = glass {
            return Surface::Glazed { amount, glass, base, metalness, f0, specular };
        }
        if (f0 == 0.0 || specular.amount.value == 0.0) && metalness.value == 0.0 && coat.is_none() && sheen.is_none() {
            return Surface::Diffuse { albedo: base };
        }
        Surface::Glossy(Gloss { f0, specular, sheen, coat, ..Gloss::new(base, roughness, metalness) })
    }

    /// How much of the non-metal is glass.
    fn transmission(&mut self) -> Scalar {
        let Some(transmission) = self.extensions().and_then(|all| all.transmission.as_ref()) else {
            return Scalar::plain(0.0);
        };
        let factor = transmission.transmission_factor.0;
        let value = if factor.is_finite() { factor.clamp(0.0, 1.0) } else { 0.0 };
        let info = transmission.transmission_texture.clone().filter(|_| value > 0.0);
        let texture = self.texture(info.as_ref(), Meaning::Data, "transmissionTexture");
        Scalar { value, texture: texture.map(|texture| (texture, 0)) }
    }

    fn glass(&mut self, base: Colour, roughness: Scalar, ior: f32) -> Dielectric {
        let volume = self.extensions().and_then(|all| all.volume.as_ref());
        let solid = volume.filter(|volume| volume.thickness_factor.0 > 0.0);
        let absorption = solid.map_or(Vec3::ZERO, |volume| {
            let distance = volume.attenuation_distance.0;
            let coefficient = |colour: f32| -libm::logf(colour.clamp(LEAST_ATTENUATION, 1.0)) / distance;
            let absorption = Vec3::from(volume.attenuation_color.0.map(coefficient));
            if distance > 0.0 && absorption.is_finite() { absorption } else { Vec3::ZERO }
        });
        Dielectric { transmittance: base, roughness, absorption, ..Dielectric::clear(ior, solid.is_none()) }
    }

    /// KHR_materials_clearcoat, of what is no glass.
    fn coat(&mut self, is_glass: bool) -> Option<Coat> {
        let coat: ClearCoat = self.extension("KHR_materials_clearcoat")?;
        let number = |value: f32| if value.is_finite() { value.clamp(0.0, 1.0) } else { 0.0 };
        let (amount, roughness) = (number(coat.factor), number(coat.roughness));
        if amount == 0.0 {
            return None;
        }
        if is_glass {
            self.note("KHR_materials_clearcoat over glass is not drawn");
            return None;
        }
        if coat.normal.is_some() {
            self.note("clearcoatNormalTexture is not drawn: the coat has the surface's own relief");
        }
        let texture = self.texture(coat.texture.as_ref(), Meaning::Data, "clearcoatTexture");
        let rough = self.texture(coat.roughness_texture.as_ref(), Meaning::Data, "clearcoatRoughnessTexture");
        Some(Coat {
            amount: Scalar { value: amount, texture: texture.map(|texture| (texture, 0)) },
            roughness: Scalar { value: roughness, texture: rough.map(|texture| (texture, 1)) },
        })
    }

    /// KHR_materials_sheen, of what is no glass.
    fn sheen(&mut self, is_glass: bool) -> Option<Sheen> {
        let sheen: SheenFields = self.extension("KHR_materials_sheen")?;
        let value = self.within_one("sheenColorFactor", Vec3::from(sheen.colour));
        if value == Vec3::ZERO {
            return None;
        }
        if is_glass {
            self.note("KHR_materials_sheen over glass is not drawn");
            return None;
        }
        let texture = self.texture(sheen.colour_texture.as_ref(), Meaning::Colour, "sheenColorTexture");
        let rough = self.texture(sheen.roughness_texture.as_ref(), Meaning::Data, "sheenRoughnessTexture");
        let roughness = if sheen.roughness.is_finite() { sheen.roughness.clamp(0.0, 1.0) } else { 0.0 };
        Some(Sheen {
            colour: Colour { value, texture },
            roughness: Scalar { value: roughness, texture: rough.map(|texture| (texture, 3)) },
        })
    }

    /// KHR_materials_diffuse_transmission, of what is no metal.
    fn sheet(&mut self, base: Colour, metalness: f32) -> Option<Surface> {
        let sheet: DiffuseTransmission = self.extension("KHR_materials_diffuse_transmission")?;
        let amount = if sheet.factor.is_finite() { sheet.factor.clamp(0.0, 1.0) } else { 0.0 };
        if amount == 0.0 {
            return None;
        }
        if sheet.texture.is_some() {
            self.note("diffuseTransmissionTexture is not drawn: the factor counts everywhere");
        }
        let colour = self.within_one("diffuseTransmissionColorFactor", Vec3::from(sheet.colour));
        let texture = self.texture(sheet.colour_texture.as_ref(), Meaning::Colour, "diffuseTransmissionColorTexture");
        let whole = 1.0 - metalness;
        Some(Surface::Translucent {
            albedo: Colour { value: base.value * ((1.0 - amount) * whole), ..base },
            transmittance: Colour { value: colour * (amount * whole), texture },
        })
    }

    /// An extension of the material that the typed JSON does not know.
    fn extension<T: DeserializeOwned>(&mut self, name: &str) -> Option<T> {
        let value = self.extensions()?.others.get(name)?.clone();
        let read = serde_json::from_value(value);
        if let Err(error) = &read {
            self.note(&format!("{name}: {error}; it is left out"));
        }
        read.ok()
    }

    /// KHR_materials_specular.
    fn specular(&mut self) -> Specular {
        let Some(specular) = self.extensions().and_then(|all| all.specular.clone()) else { return Specular::WHOLE };
        let factor = specular.specular_factor.0;
        let value = if factor.is_finite() { factor.clamp(0.0, 1.0) } else { 1.0 };
        let texture = self.texture(specular.specular_texture.as_ref(), Meaning::Data, "specularTexture");
        let amount = Scalar { value, texture: texture.map(|texture| (texture, 3)) };
        let mut value = Vec3::from(specular.specular_color_factor.0);
        if !value.is_finite() || value.min_element() < 0.0 {
            self.note("specularColorFactor is negative or no number: white is used");
            value = Vec3::ONE;
        }
        let texture = self.texture(specular.specular_color_texture.as_ref(), Meaning::Colour, "specularColorTexture");
        Specular { amount, colour: Colour { value, texture } }
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
    fn coverage(&mut self, base: Colour, factor: f32) -> Option<Coverage> {
        let cutoff = match self.material.alpha_mode {
            Checked::Valid(AlphaMode::Opaque) | Checked::Invalid => return None,
            Checked::Valid(AlphaMode::Mask) => Some(self.material.alpha_cutoff.unwrap_or_default().0),
            Checked::Valid(AlphaMode::Blend) => None,
        };
        let value = if factor.is_finite() { factor.clamp(0.0, 1.0) } else { 1.0 };
        let texture = base.texture.filter(|texture| self.looks.textures.list[*texture as usize].has_holes());
        let coverage = Coverage {
            amount: Scalar { value, texture: texture.map(|texture| (texture, 3)) },
            cutoff: cutoff.map(|cutoff| if cutoff.is_finite() { cutoff } else { 0.5 }),
        };
        let is_whole = texture.is_none() && coverage.of(1.0) >= 1.0 && !self.faded;
        (!is_whole).then_some(coverage)
    }

    /// A texture, in the set of texture coordinates that lies as it should.
    fn texture(&mut self, info: Option<&Info>, meaning: Meaning, what: &str) -> Option<u32> {
        let info = info?;
        let transform = info.extensions.as_ref().and_then(|all| all.texture_transform.as_ref());
        self.texture_at(info.index, layout(info.tex_coord, transform), meaning, what)
    }

    fn texture_at(&mut self, index: Index<Texture>, layout: Layout, meaning: Meaning, what: &str) -> Option<u32> {
        let field = format!("{}.{what}", self.place);
        let known = self.layouts.iter().position(|known| *known == layout);
        if known.is_none() && self.layouts.len() == SETS_MAX {
            self.note(&format!("{what} is the {SETS_MAX}th that lies otherwise than others: it lies as the first"));
            return self.looks.texture(index, meaning, 0, &field);
        }
        let set = known.unwrap_or(self.layouts.len());
        let texture = self.looks.texture(index, meaning, set as u8, &field);
        if texture.is_some() && known.is_none() {
            self.layouts.push(layout);
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
fn layout(set: u32, transform: Option<&TextureTransform>) -> Layout {
    let plain = Layout::plain(set);
    let Some(transform) = transform else { return plain };
    let (sin, cos) = (libm::sinf(transform.rotation.0), libm::cosf(transform.rotation.0));
    let [u, v] = transform.scale.0;
    // Columns of rotation · scale, as the extension's text gives them.
    let linear = Mat2::from_cols(Vec2::new(cos, -sin) * u, Vec2::new(sin, cos) * v);
    let offset = Vec2::from(transform.offset.0);
    if !(linear.is_finite() && offset.is_finite()) {
        return plain;
    }
    Layout { set: transform.tex_coord.unwrap_or(set), linear, offset }
}
