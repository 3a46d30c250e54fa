//! What an MTL material means: from Phong's constants, and the PBR extension, to a [`Surface`].
//!
//! | file says | becomes |
//! |---|---|
//! | `illum 3`, `5` | mirror of reflectance `Ks`; with `Pr` > 0 a metal of `Ks` and roughness `Pr` |
//! | `illum 4`, `6`, `7`, `9` | glass: `Ni`, tinted by `Tf` at each crossing; none if it has `map_Kd` or `map_d` (exporters' habit) |
//! | … but see [`dialect`] | Blender's metals and transparency, Maya's and Cinema 4D's opaque materials |
//! | `Pr` or `Pm` | glTF's metallic-roughness: base `Kd`, roughness `Pr`, metalness `Pm` |
//! | `illum` 0, 1 | diffuse `Kd` |
//! | `Ks` and `Ns` > 0 | diffuse `Kd` under a glossy lobe: α² = 2 / (`Ns` + 2), F₀ = 0.08 · `Ks`; each times its map |
//! | … with black `Kd` and bright `Ks` | rough metal of F₀ = `Ks` |
//! | else | diffuse `Kd` |
//! | `Ps`, `Pc` | grey sheen, and a coat of roughness `Pcr` over that, on what is neither mirror nor glass |
//! | `norm`, `map_Bump` | relief, by its `-bm` ([`super::relief`]) |
//! | `d` (or 1 − `Tr`) times `map_d` | so much of the surface is there; all of it where it is glass |
//!
//! A texture multiplies its colour; a colour of 0 0 0 under a texture means 1 (exporters' habit).

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::{Vec2, Vec3};

use super::dialect::{self, Habit, Look};
use super::error::{Notes, Tally};
use super::mtl::Mtl;
use super::texture_name::TextureName;
use super::textures::{Meaning, Textures};
use crate::{
    Coat, Colour, Coverage, Dielectric, Gloss, LookUp, Material, NormalMap, Rgb, SETS_MAX, Scalar, Sheen, Specular,
    Surface,
};

/// Albedo of a surface about which nothing is said.
const UNSAID: Rgb = Vec3::splat(0.5);
/// Index of refraction of a glass about which nothing is said.
const IOR_UNSAID: f32 = 1.5;
/// Roughness of sheen, which MTL has no word for: Blender's, unless somebody changes it.
const SHEEN_UNSAID: f32 = 0.5;
/// Metals smoother than this are mirrors: α = roughness² < 10⁻³.
pub(super) const MIRROR_ROUGHNESS: f32 = 0.03;

/// How a texture lies: `uv · scale + offset`, applied to the mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Layout {
    pub scale: Vec2,
    pub offset: Vec2,
}

/// Turns MTL materials into the scene's, loading textures as it goes.
pub(super) struct Surfaces<'a> {
    /// The OBJ's: textures are looked for there if they are not beside the MTL.
    folder: &'a Path,
    textures: &'a mut Textures,
    pub notes: &'a mut Notes,
    /// Which materials had to be read by what is known of exporters; the file is that of the first.
    habits: BTreeMap<Habit, (PathBuf, Tally)>,
    /// Of the material under way, one a set of texture coordinates.
    layouts: Vec<Layout>,
    /// Maps of highlights that the material under way is drawn with, if it has them.
    highlights: Vec<&'static str>,
}

impl<'a> Surfaces<'a> {
    pub fn new(folder: &'a Path, textures: &'a mut Textures, notes: &'a mut Notes) -> Self {
        Self { folder, textures, notes, habits: BTreeMap::new(), layouts: Vec::new(), highlights: Vec::new() }
    }

    /// The material that `mtl` means, and how its textures lie, by set.
    pub fn material(&mut self, mtl: &Mtl) -> (Material, Vec<Layout>) {
        self.layouts.clear();
        self.highlights.clear();
        let reading = dialect::read(mtl);
        if let Some(habit) = reading.habit {
            self.habits.entry(habit).or_insert_with(|| (mtl.file.clone(), Tally::default())).1.add(mtl.line);
        }
        let surface = match reading.look {
            Look::Plain => self.plain(mtl, reading.is_blenders),
            Look::Mirror => self.mirror(mtl),
            Look::Glass => self.glass(mtl),
            Look::Metal { roughness, metalness } => self.metal(mtl, roughness, metalness),
        };
        let surface = self.layered(mtl, surface);
        let emission = self.emission(mtl);
        // Glass is there; light passes it all the same.
        let is_glass = matches!(surface, Surface::Dielectric(_));
        let coverage = self.coverage(mtl, if is_glass { 1.0 } else { reading.opacity });
        let relief = self.relief(mtl);
        self.mention_what_is_not_drawn(mtl);
        let material =
            Material { name: mtl.name.clone(), surface, emission, emits_both_sides: false, coverage, relief };
        (material, std::mem::take(&mut self.layouts))
    }

    /// Says which exporters' habits were heeded.
    pub fn report(self) {
        for (habit, (file, tally)) in &self.habits {
            tally.report(self.notes, file, habit.words());
        }
    }

    fn plain(&mut self, mtl: &Mtl, is_blenders: bool) -> Surface {
        if mtl.pr.is_some() || mtl.pm.is_some() {
            return self.metallic_roughness(mtl);
        }
        let ns = mtl.ns.unwrap_or(0.0);
        let base = self.base(mtl);
        if matches!(mtl.illum, Some(0 | 1)) || (ns <= 0.0 && !is_blenders) {
            return Surface::Diffuse { albedo: base };
        }
        let ks = self.highlight(mtl, Vec3::ZERO);
        if ks.is_black() {
            return Surface::Diffuse { albedo: base };
        }
        let roughness = self.roughness(mtl, ns, is_blenders);
        let is_dark = base.texture.is_none() && base.value.max_element() < 0.04;
        if is_dark && ks.value.max_element() > 0.3 && !is_blenders {
            return Surface::Glossy(Gloss::new(ks, roughness, Scalar::plain(1.0)));
        }
        Surface::Glossy(highlighted(Gloss::new(base, roughness, Scalar::plain(0.0)), ks))
    }

    /// The same under sheen and a coat, if the material has them.
    fn layered(&mut self, mtl: &Mtl, surface: Surface) -> Surface {
        let given = |value: Option<f32>, map: &str| {
            let unsaid = if mtl.maps.contains_key(map) { 1.0 } else { 0.0 };
            value.unwrap_or(unsaid).clamp(0.0, 1.0)
        };
        let (soft, clear) = (given(mtl.ps, "map_ps"), given(mtl.pc, "map_pc"));
        if soft == 0.0 && clear == 0.0 {
            return surface;
        }
        let gloss = match surface {
            Surface::Diffuse { albedo } => {
                let specular = Specular { amount: Scalar::plain(0.0), ..Specular::WHOLE };
                Gloss { specular, ..Gloss::new(albedo, Scalar::plain(1.0), Scalar::plain(0.0)) }
            }
            Surface::Glossy(gloss) => gloss,
            other => {
                let layers = [(soft, "sheen (Ps)"), (clear, "a coat (Pc)")];
                for (_, layer) in layers.into_iter().filter(|(amount, _)| *amount > 0.0) {
                    self.note(mtl, format!("{layer} over mirrors and glass is not drawn"));
                }
                return other;
            }
        };
        let sheen = (soft > 0.0).then(|| {
            let texture = mtl.maps.get("map_ps").and_then(|map| self.texture(mtl, map, Meaning::Data));
            Sheen { colour: Colour { value: Vec3::splat(soft), texture }, roughness: Scalar::plain(SHEEN_UNSAID) }
        });
        let coat = (clear > 0.0).then(|| Coat {
            amount: Scalar { value: clear, texture: self.mask(mtl, mtl.maps.get("map_pc")) },
            roughness: Scalar { value: given(mtl.pcr, "map_pcr"), texture: self.mask(mtl, mtl.maps.get("map_pcr")) },
        });
        Surface::Glossy(Gloss { sheen, coat, ..gloss })
    }

    fn mirror(&mut self, mtl: &Mtl) -> Surface {
        let reflectance = self.reflectance(mtl, "Ks", mtl.ks.unwrap_or(Vec3::ONE));
        let Some(roughness) = mtl.pr.filter(|roughness| *roughness > 0.0) else {
            return Surface::Mirror { reflectance };
        };
        let (roughness, metalness) = (Scalar::plain(roughness.min(1.0)), Scalar::plain(1.0));
        Surface::Glossy(Gloss::new(Colour::plain(reflectance), roughness, metalness))
    }

    fn metal(&mut self, mtl: &Mtl, roughness: f32, metalness: f32) -> Surface {
        let base = self.base(mtl);
        let (rough_map, metal_map) = (mtl.maps.get("map_pr"), mtl.maps.get("map_pm"));
        let roughness = Scalar { value: roughness, texture: self.mask(mtl, rough_map) };
        let metalness = Scalar { value: metalness, texture: self.mask(mtl, metal_map) };
        let plain = base.texture.is_none() && roughness.texture.is_none() && metalness.texture.is_none();
        if plain && metalness.value >= 0.99 && roughness.value <= MIRROR_ROUGHNESS {
            return Surface::Mirror { reflectance: base.value };
        }
        let ks = self.highlight(mtl, Vec3::splat(0.5));
        Surface::Glossy(highlighted(Gloss::new(base, roughness, metalness), ks))
    }

    fn glass(&mut self, mtl: &Mtl) -> Surface {
        let ior = mtl.ni.filter(|ior| *ior > 0.0).unwrap_or_else(|| {
            self.note(mtl, format!("glass without a positive Ni: {IOR_UNSAID} is used"));
            IOR_UNSAID
        });
        let transmittance = self.reflectance(mtl, "Tf", mtl.tf.unwrap_or(Vec3::ONE));
        Surface::Dielectric(Dielectric { transmittance: Colour::plain(transmittance), ..Dielectric::clear(ior, false) })
    }

    fn metallic_roughness(&mut self, mtl: &Mtl) -> Surface {
        let number = |value: Option<f32>, map: bool| value.unwrap_or(if map { 1.0 } else { 0.5 }).clamp(0.0, 1.0);
        let (rough_map, metal_map) = (mtl.maps.get("map_pr"), mtl.maps.get("map_pm"));
        let rough_value = number(mtl.pr, rough_map.is_some());
        let metal_value = mtl.pm.unwrap_or(if metal_map.is_some() { 1.0 } else { 0.0 }).clamp(0.0, 1.0);
        let roughness = Scalar { value: rough_value, texture: self.mask(mtl, rough_map) };
        let metalness = Scalar { value: metal_value, texture: self.mask(mtl, metal_map) };
        Surface::Glossy(Gloss::new(self.base(mtl), roughness, metalness))
    }

    /// `Kd` times `map_Kd`.
    fn base(&mut self, mtl: &Mtl) -> Colour {
        let texture = match mtl.maps.get("map_kd") {
            Some(map) => self.texture(mtl, map, Meaning::Colour),
            None => None,
        };
        let value = match (mtl.kd, mtl.maps.contains_key("map_kd")) {
            (Some(Vec3::ZERO) | None, true) if texture.is_some() => Vec3::ONE,
            (Some(Vec3::ZERO) | None, true) => UNSAID,
            (Some(kd), _) => kd,
            (None, false) => UNSAID,
        };
        Colour { value: self.reflectance(mtl, "Kd", value), texture }
    }

    /// `Ks` times `map_Ks`; `unsaid` if there is neither.
    fn highlight(&mut self, mtl: &Mtl, unsaid: Rgb) -> Colour {
        let texture = match mtl.maps.get("map_ks") {
            Some(map) => self.texture(mtl, map, Meaning::Colour),
            None => None,
        };
        self.highlights.push("map_ks");
        let value = match mtl.ks {
            Some(Vec3::ZERO) | None if texture.is_some() => Vec3::ONE,
            ks => ks.unwrap_or(unsaid),
        };
        Colour { value: self.reflectance(mtl, "Ks", value), texture }
    }

    /// Of `Ns` times `map_Ns`, which is an exponent, or a roughness if Blender wrote it.
    fn roughness(&mut self, mtl: &Mtl, ns: f32, is_blenders: bool) -> Scalar {
        let map = self.mask(mtl, mtl.maps.get("map_ns"));
        self.highlights.push("map_ns");
        let plain =
            Scalar::plain(if is_blenders { dialect::blenders_roughness(ns) } else { roughness_of_exponent(ns) });
        let Some((texture, channel)) = map else { return plain };
        if is_blenders {
            return Scalar { value: 1.0, texture: map };
        }
        let made = self.textures.mapped(texture, channel, |share| roughness_of_exponent(ns * share));
        made.map_or(plain, |texture| Scalar { value: 1.0, texture: Some((texture, 0)) })
    }

    fn emission(&mut self, mtl: &Mtl) -> Colour {
        let map = mtl.maps.get("map_ke");
        let value = mtl.ke.unwrap_or(if map.is_some() { Vec3::ONE } else { Vec3::ZERO });
        if value.min_element() < 0.0 {
            self.note(mtl, "Ke is negative: 0 is used");
        }
        let value = value.max(Vec3::ZERO);
        match map {
            Some(map) if value != Vec3::ZERO => {
                let texture = self.texture(mtl, map, Meaning::Colour);
                let lost = texture.is_none() && mtl.ke.is_none();
                Colour { value: if lost { Vec3::ZERO } else { value }, texture }
            }
            _ => Colour::plain(value),
        }
    }

    /// `None` where all of the surface is there, so that nobody looks.
    fn coverage(&mut self, mtl: &Mtl, opacity: f32) -> Option<Coverage> {
        let texture = mtl.maps.get("map_d").and_then(|map| self.mask(mtl, Some(map)));
        let amount = Scalar { value: opacity, texture };
        (texture.is_some() || opacity < 1.0).then_some(Coverage { amount, cutoff: None })
    }

    /// `norm`, or else a bump map.
    fn relief(&mut self, mtl: &Mtl) -> Option<NormalMap> {
        let given = |name: &str| mtl.maps.get(name);
        let normals = ["norm", "map_kn", "map_norm"].into_iter().find_map(given).map(|map| (map, Meaning::Data));
        let heights = || ["map_bump", "bump"].into_iter().find_map(given).map(|map| (map, Meaning::Relief));
        let (map, meaning) = normals.or_else(heights)?;
        let texture = self.texture(mtl, map, meaning)?;
        Some(NormalMap { texture, scale: map.bump })
    }

    /// A texture of numbers and the channel to read: the one the file names, alpha if the image
    /// has holes, else red.
    fn mask(&mut self, mtl: &Mtl, map: Option<&TextureName>) -> Option<(u32, u8)> {
        let map = map?;
        let texture = self.texture(mtl, map, Meaning::Data)?;
        let has_holes = self.textures.list[texture as usize].has_holes();
        Some((texture, map.channel.unwrap_or(if has_holes { 3 } else { 0 })))
    }

    fn texture(&mut self, mtl: &Mtl, map: &TextureName, meaning: Meaning) -> Option<u32> {
        if !map.unheeded.is_empty() {
            let message = format!("{} of `{}` not heeded: drawn as the file has it", map.unheeded.join(", "), map.file);
            self.notes.line(&mtl.file, map.line, message);
        }
        let set = self.set(mtl, map);
        let look_up = LookUp { set, ..if map.clamp { LookUp::CLAMP } else { LookUp::REPEAT } };
        let beside_mtl = mtl.file.parent().unwrap_or(Path::new(""));
        let folders = if beside_mtl == self.folder { &[self.folder][..] } else { &[beside_mtl, self.folder] };
        let said = |message: String| self.notes.line(&mtl.file, map.line, message);
        self.textures.file(folders, map.names(), meaning, look_up, said)
    }

    /// The set of texture coordinates that lies as a map's options say.
    fn set(&mut self, mtl: &Mtl, map: &TextureName) -> u8 {
        let layout = Layout { scale: map.scale, offset: map.offset };
        if let Some(known) = self.layouts.iter().position(|known| *known == layout) {
            return known as u8;
        }
        if self.layouts.len() == SETS_MAX {
            self.note(mtl, format!("more than {SETS_MAX} different -s and -o: the first one's are used"));
            return 0;
        }
        self.layouts.push(layout);
        (self.layouts.len() - 1) as u8
    }

    /// Within 0..1, or nobody's energy is conserved.
    fn reflectance(&mut self, mtl: &Mtl, what: &str, value: Rgb) -> Rgb {
        let clamped = value.clamp(Vec3::ZERO, Vec3::ONE);
        if clamped != value {
            self.note(mtl, format!("{what} is outside 0..1: clamped, for energy's sake"));
        }
        clamped
    }

    fn mention_what_is_not_drawn(&mut self, mtl: &Mtl) {
        let drawn = [
            "map_kd", "map_ke", "map_d", "map_pr", "map_pm", "map_pc", "map_pcr", "map_ps", "map_ka", "map_bump",
            "bump", "norm", "map_kn", "map_norm",
        ];
        let is_drawn = |map: &&str| drawn.contains(map) || self.highlights.contains(map);
        let ignored: Vec<&str> = mtl.maps.keys().map(String::as_str).filter(|map| !is_drawn(map)).collect();
        if mtl.aniso.is_some_and(|anisotropy| anisotropy != 0.0) {
            self.note(mtl, "anisotropy (aniso) is not drawn");
        }
        if !ignored.is_empty() {
            self.note(mtl, format!("{} not drawn", ignored.join(", ")));
        }
    }

    fn note(&mut self, mtl: &Mtl, message: impl AsRef<str>) {
        self.notes.line(&mtl.file, mtl.line, format!("material `{}`: {}", mtl.name, message.as_ref()));
    }
}

/// With so much reflected along the normal, 0..1 of 0.08: ½ is that of IOR 1.5, as Blender means it.
fn highlighted(gloss: Gloss, ks: Colour) -> Gloss {
    let mean = (ks.value.x + ks.value.y + ks.value.z) / 3.0;
    let is_grey = ks.value.min_element() == ks.value.max_element();
    let colour = Colour { value: if is_grey { Vec3::ONE } else { ks.value / mean }, ..ks };
    Gloss { f0: 0.08 * mean, specular: Specular { colour, ..Specular::WHOLE }, ..gloss }
}

/// Perceptual roughness whose GGX lobe is about as wide as Phong's: α² = 2 / (n + 2) (Walter et
/// al. 2007), roughness² = α.
fn roughness_of_exponent(exponent: f32) -> f32 {
    (2.0 / (exponent + 2.0)).sqrt().sqrt().clamp(0.0, 1.0)
}
