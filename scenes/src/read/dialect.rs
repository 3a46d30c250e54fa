//! What exporters mean by `illum`, `d` and `Tf`.
//!
//! The format's text (Alias|Wavefront 1995) knows no metalness, no roughness and no coverage, so exporters write them
//! into what there is. Who wrote a file is told from its first lines, or else from values that only one exporter writes
//! together, since comments get lost. Sources: Blender's `obj_export_mtl.cc` and, before 3.1, `export_obj.py`; files
//! that Maya's and Cinema 4D's exporters wrote.
//!
//! | who | writes | means |
//! |---|---|---|
//! | Blender | `illum 3`, `Ks` = specular level (grey), `Ka` = metalness | metal of colour `Kd` |
//! | Blender | `illum 9`, and `6` for metals, with `d` < 1 | so much of it is there (alpha), no glass |
//! | Blender | `Ns` = 1000 (1 − roughness)² | |
//! | Maya | `illum 4`, `Ni 1`, `Tf` = 1 − transparency | opaque where `Tf` is 1 |
//! | Cinema 4D | `illum 7` and no word of transparency | opaque |

use glam::Vec3;

use super::mtl::Mtl;

/// How a material is to be read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Reading {
    pub look: Look,
    /// Share of the surface that is there, 0..=1.
    pub opacity: f32,
    /// Blender wrote it: `Ns` is a roughness.
    pub is_blenders: bool,
    /// What had to be known to read it so; `None` if the material says it by itself.
    pub habit: Option<Habit>,
}

/// What a material's surface is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Look {
    /// Diffuse, glossy if `Ks` and `Ns` say so, or as the PBR extension says.
    Plain,
    /// A mirror of `Ks`.
    Mirror,
    /// Glass of `Ni` and `Tf`.
    Glass,
    /// A metal of `Kd`.
    Metal {
        /// Perceptual, 0..=1.
        roughness: f32,
        /// 0..=1.
        metalness: f32,
    },
}

/// A habit of exporters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Habit {
    BlenderMetal,
    BlenderAlpha,
    NoGlass,
}

impl Habit {
    /// Behind the number of materials.
    pub fn words(self) -> &'static str {
        match self {
            Self::BlenderMetal => {
                "materials are metal as Blender writes it (illum 3 with a colour in Kd): of colour Kd, roughness from Ns or Pr"
            }
            Self::BlenderAlpha => {
                "materials are transparent as Blender writes it (illum 9 with d = alpha): by d, no glass"
            }
            Self::NoGlass => {
                "materials of glass (illum 4, 6, 7, 9) name no glass (Ni 1, Tf 1 or neither; Maya, Cinema 4D): drawn opaque"
            }
        }
    }
}

/// Reflectance from which a grey `Ks` over a darker `Kd` is a mirror's, not Blender's specular level.
const MIRROR_KS: f32 = 0.7;

/// How `mtl` is to be read.
pub(super) fn read(mtl: &Mtl) -> Reading {
    let opacity = opacity(mtl).unwrap_or(1.0);
    let plain = Reading { look: Look::Plain, opacity, is_blenders: mtl.by_blender, habit: None };
    let textured = mtl.maps.contains_key("map_kd") || mtl.maps.contains_key("map_d");
    match mtl.illum {
        Some(3 | 6) if is_blenders_metal(mtl) && (mtl.illum == Some(3) || opacity < 1.0) => {
            Reading { look: blenders_metal(mtl), habit: Some(Habit::BlenderMetal), ..plain }
        }
        // glTF's way of saying it goes before Phong's.
        Some(3 | 5) if mtl.pm.is_some() && !is_black(mtl.kd) => plain,
        Some(3 | 5) => Reading { look: Look::Mirror, ..plain },
        Some(9) if opacity < 1.0 && is_blenders(mtl) => {
            Reading { is_blenders: true, habit: Some(Habit::BlenderAlpha), ..plain }
        }
        Some(4 | 6 | 7 | 9) if textured => plain,
        Some(4 | 6 | 7 | 9) => match share_of_no_glass(mtl) {
            Some(opacity) => Reading { opacity, habit: Some(Habit::NoGlass), ..plain },
            None => Reading { look: Look::Glass, opacity: 1.0, ..plain },
        },
        _ => plain,
    }
}

/// Of `d`, or of `Tr` = 1 − `d`; `None` if neither is said.
pub(super) fn opacity(mtl: &Mtl) -> Option<f32> {
    let opacity = match (mtl.d, mtl.tr) {
        (Some(d), _) => d,
        // Old exporters write Tr 1 for "opaque"; nobody models what cannot be seen at all.
        (None, Some(tr)) if tr >= 1.0 => 1.0,
        (None, Some(tr)) => 1.0 - tr,
        (None, None) => return None,
    };
    Some(opacity.clamp(0.0, 1.0))
}

/// Perceptual roughness of Blender's `Ns`.
pub(super) fn blenders_roughness(ns: f32) -> f32 {
    1.0 - (ns / 1000.0).clamp(0.0, 1.0).sqrt()
}

/// Blender wrote it: the file says so, or everything is there that Blender writes and nothing that it does not.
fn is_blenders(mtl: &Mtl) -> bool {
    let all = mtl.ka.is_some_and(is_grey)
        && mtl.ks.is_some_and(is_grey)
        && mtl.kd.is_some()
        && mtl.ni.is_some()
        && mtl.d.is_some()
        && mtl.ns.is_some_and(|ns| (0.0..=1000.0).contains(&ns));
    mtl.tf.is_none() && mtl.tr.is_none() && (mtl.by_blender || all)
}

fn is_blenders_metal(mtl: &Mtl) -> bool {
    let (kd, ks) = (mtl.kd.unwrap_or(Vec3::ZERO).max_element(), mtl.ks.unwrap_or(Vec3::ZERO).max_element());
    let is_mirror = ks >= MIRROR_KS && if mtl.by_blender { kd == 0.0 } else { ks > kd };
    is_blenders(mtl) && !is_mirror && (mtl.by_blender || !is_black(mtl.kd) || mtl.maps.contains_key("map_kd"))
}

fn blenders_metal(mtl: &Mtl) -> Look {
    let roughness = mtl.pr.unwrap_or_else(|| blenders_roughness(mtl.ns.unwrap_or(250.0)));
    // Blender's Ka is the metalness of a metal; other writers leave it black.
    let ambient = mtl.ka.map(|ka| ka.x).filter(|ka| *ka > 0.0);
    let metalness = mtl.pm.or(ambient).unwrap_or(1.0);
    Look::Metal { roughness: roughness.clamp(0.0, 1.0), metalness: metalness.clamp(0.0, 1.0) }
}

/// How opaque a material is that claims to be glass and is none; `None` if it is.
fn share_of_no_glass(mtl: &Mtl) -> Option<f32> {
    let white = |tf: Vec3| tf.min_element() >= 1.0;
    let opacity = opacity(mtl).filter(|opacity| *opacity < 1.0);
    match (mtl.ni, mtl.tf, opacity) {
        // Light would pass unbent and unreflected: nobody means a thing that cannot be seen.
        (Some(1.0), None, opacity) => Some(opacity.unwrap_or(1.0)),
        (Some(1.0), Some(tf), opacity) if white(tf) => Some(opacity.unwrap_or(1.0)),
        // Maya's Tf is what is not transparent.
        (Some(1.0), Some(tf), None) if is_grey(tf) && !is_black(mtl.kd) => Some(tf.x.clamp(0.0, 1.0)),
        (None, None, None) if !is_black(mtl.kd) => Some(1.0),
        _ => None,
    }
}

fn is_grey(colour: Vec3) -> bool {
    colour.max_element() - colour.min_element() <= 1e-4
}

fn is_black(colour: Option<Vec3>) -> bool {
    colour.is_none_or(|colour| colour.max_element() <= 0.0)
}
