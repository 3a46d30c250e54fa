//! Mitsuba 3: an XML file, meshes as PLY, textures as EXR.
//!
//! Everything is in scene space, where it is at the moment. What Mitsuba has no equal for is written as the
//! next best thing, and noted.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use anyhow::Context;
use frame::Picture;
use frame::tone::linear_from_srgb;
use glam::Vec3;
use scenes::model::CLEAR_ROUGHNESS;
use scenes::{
    Camera, Coat, Colour, Coverage, Dielectric, Environment, Gloss, Light, LookUp, Material, Pixels, Rgb, Scene,
    Specular, Surface, Texture, Wrap,
};

use super::ply::{Part, encode};
use runtime::files::{encode_exr, write_whole};

/// What was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Exported {
    /// The file to load.
    pub file: PathBuf,
    /// What differs from the scene.
    pub notes: Vec<String>,
}

/// Writes `scene.xml` and all it needs into a folder, which is made if it is not there.
///
/// # Errors
/// If a file cannot be written.
pub fn mitsuba(scene: &Scene, folder: &Path) -> anyhow::Result<Exported> {
    std::fs::create_dir_all(folder).with_context(|| format!("{}: cannot be made", folder.display()))?;
    let mut export =
        Export { scene, folder, xml: String::new(), textures: BTreeMap::new(), masks: 0, notes: Vec::new() };
    let absorbs = scene.materials.iter().any(|material| material.surface.glass().is_some_and(Dielectric::absorbs));
    // Only the one for volumes knows of light that is absorbed.
    let integrator = if absorbs { "volpath" } else { "path" };
    let _ = writeln!(
        export.xml,
        "<scene version=\"3.0.0\">\n  <integrator type=\"{integrator}\"><integer name=\"max_depth\" value=\"-1\"/></integrator>"
    );
    export.camera(&scene.camera);
    for (number, material) in scene.materials.iter().enumerate() {
        export.material(number, material)?;
    }
    export.shapes()?;
    scene.lights.iter().filter(|light| !light.is_absent()).for_each(|light| export.light(light));
    export.environment()?;
    export.xml += "</scene>\n";
    let file = folder.join("scene.xml");
    write_whole(&file, export.xml.as_bytes())?;
    Ok(Exported { file, notes: export.notes })
}

/// Extents of the scene that a sun is away: its shadows are off by as small a part.
const AFAR: f32 = 1000.0;
/// A plate can hardly be wider.
const WIDEST_DISC_DEG: f32 = 120.0;

struct Export<'a> {
    scene: &'a Scene,
    folder: &'a Path,
    xml: String,
    /// Files by texture and factor (as bits).
    textures: BTreeMap<(u32, [u32; 3]), String>,
    /// How many files of coverage have been written.
    masks: usize,
    notes: Vec<String>,
}

impl Export<'_> {
    fn camera(&mut self, camera: &Camera) {
        let Camera { origin, target, up, fov_y_deg, width, height, two_point, cut } = camera;
        let lens = camera.lens();
        let near = if *cut { lens.near() } else { 1e-4 };
        // Of the picture's height, downwards.
        let (target, shift) = match two_point.then(|| camera.level()) {
            Some((forward, slope)) => (*origin + forward, -slope / (lens.pixel() * *height as f32)),
            None => (*target, 0.0),
        };
        let _ = write!(
            self.xml,
            "  <sensor type=\"perspective\">\n    <float name=\"fov\" value=\"{fov_y_deg}\"/><string name=\"fov_axis\" \
             value=\"y\"/>\n    <float name=\"principal_point_offset_y\" value=\"{shift}\"/>\n    <float name=\"near_clip\" value=\"{near}\"/><float name=\"far_clip\" value=\"1e7\"/>\n    \
             <transform name=\"to_world\"><lookat origin=\"{}\" target=\"{}\" up=\"{}\"/></transform>\n    \
             <sampler type=\"independent\"/>\n    <film type=\"hdrfilm\"><integer name=\"width\" value=\"{width}\"/>\
             <integer name=\"height\" value=\"{height}\"/><rfilter type=\"box\"/><string name=\"pixel_format\" \
             value=\"rgb\"/><string name=\"component_format\" value=\"float32\"/></film>\n  </sensor>\n",
            triple(*origin),
            triple(target),
            triple(*up)
        );
    }

    fn material(&mut self, number: usize, material: &Material) -> anyhow::Result<()> {
        let name = &material.name;
        let (twosided, bsdf) = self.bsdf(material)?;
        if material.relief.is_some() {
            self.notes.push(format!("{name}: its normal map is left out"));
        }
        if material.emits_both_sides && !material.emission.is_black() {
            self.notes.push(format!("{name}: shines from its front only"));
        }
        let bsdf = if twosided { format!("<bsdf type=\"twosided\">{bsdf}</bsdf>") } else { bsdf };
        let bsdf = match &material.coverage {
            None => bsdf,
            Some(coverage) => {
                format!("<bsdf type=\"mask\">{bsdf}{}</bsdf>", self.opacity(name, coverage)?)
            }
        };
        let _ = writeln!(self.xml, "  {}", bsdf.replacen("<bsdf ", &format!("<bsdf id=\"m{number}\" "), 1));
        Ok(())
    }

    /// How a surface scatters, and whether Mitsuba has to be told that it does so on both sides.
    fn bsdf(&mut self, material: &Material) -> anyhow::Result<(bool, String)> {
        let name = &material.name;
        Ok(match &material.surface {
            Surface::Diffuse { albedo } => {
                (true, format!("<bsdf type=\"diffuse\">{}</bsdf>", self.colour("reflectance", albedo)?))
            }
            Surface::Mirror { reflectance } => (
                true,
                format!(
                    "<bsdf type=\"conductor\"><string name=\"material\" value=\"none\"/>{}</bsdf>",
                    rgb("specular_reflectance", *reflectance)
                ),
            ),
            Surface::Dielectric(glass) => (false, self.glass(name, glass)?),
            Surface::Glazed { amount, glass, base, metalness, f0, specular } => {
                let (f0, specular) = (*f0, *specular);
                let opaque = Material {
                    surface: Surface::Glossy(Gloss { f0, specular, ..Gloss::new(*base, glass.roughness, *metalness) }),
                    ..Material::diffuse(name.clone(), Vec3::ZERO)
                };
                if amount.texture.is_some() || metalness.texture.is_some() {
                    self.notes.push(format!("{name}: the texture of how much is glass is left out"));
                }
                let share = amount.value * (1.0 - metalness.value);
                let (_, opaque) = self.bsdf(&opaque)?;
                let glass = self.glass(name, glass)?;
                let weight = format!("<float name=\"weight\" value=\"{share}\"/>");
                (
                    false,
                    format!("<bsdf type=\"blendbsdf\">{weight}<bsdf type=\"twosided\">{opaque}</bsdf>{glass}</bsdf>"),
                )
            }
            Surface::Translucent { albedo, .. } => {
                self.notes.push(format!("{name}: scatters light on both sides: written as opaque"));
                (true, format!("<bsdf type=\"diffuse\">{}</bsdf>", self.colour("reflectance", albedo)?))
            }
            Surface::Glossy(Gloss { base, roughness, metalness, f0, specular, sheen, coat }) => {
                self.notes.push(format!("{name}: written as `principled`, whose gloss is not quite ours"));
                if self.scene.multiple_scattering {
                    self.notes.push(format!("{name}: what its facets pass on to each other is lost"));
                }
                if roughness.texture.is_some() || metalness.texture.is_some() {
                    self.notes.push(format!("{name}: the textures of its roughness and metalness are left out"));
                }
                let colour = self.colour("base_color", base)?;
                if *specular != Specular::WHOLE {
                    self.notes.push(format!("{name}: its highlights are grey, and white at grazing angles"));
                }
                let (roughness, metalness) = (roughness.value, metalness.value);
                let number = |name: &str, value: f32| format!("<float name=\"{name}\" value=\"{value}\"/>");
                let mut numbers = number("roughness", roughness) + &number("metallic", metalness);
                // F₀ is 0.08 of this, which is ½ unless it is said.
                let level = f0 * specular.amount.value * (specular.colour.value.element_sum() / 3.0) / 0.08;
                if level != 0.5 {
                    numbers += &number("specular", level.min(1.0));
                }
                if let Some(sheen) = sheen {
                    self.notes.push(format!("{name}: its sheen is that of `principled`, grey and of one roughness"));
                    numbers += &number("sheen", sheen.colour.value.max_element());
                }
                let coat = coat.map_or(String::new(), |coat| self.coat(name, &coat));
                (true, format!("<bsdf type=\"principled\">{colour}{numbers}{coat}</bsdf>"))
            }
        })
    }

    /// Parameters of `principled`, whose coat has a quarter of the light, and facets of α = 0.1 … 0.001.
    fn coat(&mut self, name: &str, coat: &Coat) -> String {
        self.notes
            .push(format!("{name}: its coat is that of `principled`, which is a quarter as bright, and never rough"));
        if coat.amount.texture.is_some() || coat.roughness.texture.is_some() {
            self.notes.push(format!("{name}: the textures of its coat are left out"));
        }
        let gloss = ((0.1 - coat.roughness.value.powi(2)) / 0.099).clamp(0.0, 1.0);
        let amount = coat.amount.value;
        format!("<float name=\"clearcoat\" value=\"{amount}\"/><float name=\"clearcoat_gloss\" value=\"{gloss}\"/>")
    }

    fn glass(&mut self, name: &str, glass: &Dielectric) -> anyhow::Result<String> {
        let Dielectric { ior, transmittance, roughness, thin, .. } = glass;
        if glass.is_nested() {
            self.notes.push(format!("{name}: Mitsuba knows no priority among glasses: written as if in air"));
        }
        if roughness.texture.is_some() {
            self.notes.push(format!("{name}: the texture of its roughness is left out"));
        }
        let mut numbers = format!("<float name=\"int_ior\" value=\"{ior}\"/><float name=\"ext_ior\" value=\"1\"/>");
        let kind = match (thin, roughness.value > CLEAR_ROUGHNESS) {
            (true, frosted) => {
                if frosted {
                    self.notes.push(format!("{name}: a frosted sheet: written as clear"));
                }
                "thindielectric"
            }
            (false, false) => "dielectric",
            (false, true) => {
                let alpha = roughness.value * roughness.value;
                numbers += "<string name=\"distribution\" value=\"ggx\"/>";
                numbers += &format!("<float name=\"alpha\" value=\"{alpha}\"/>");
                "roughdielectric"
            }
        };
        let tint = self.colour("specular_transmittance", transmittance)?;
        Ok(format!("<bsdf type=\"{kind}\">{numbers}{tint}</bsdf>"))
    }

    /// What absorbs light behind a surface; its colour within 0..1, and a factor.
    fn medium(&self, material: u32) -> String {
        let glass = self.scene.materials[material as usize].surface.glass().filter(|glass| glass.absorbs());
        glass.map_or(String::new(), |glass| {
            let scale = glass.absorption.max_element();
            format!(
                "<medium type=\"homogeneous\" name=\"interior\">{}<float name=\"scale\" value=\"{scale}\"/><float \
                 name=\"albedo\" value=\"0\"/></medium>",
                rgb("sigma_t", glass.absorption / scale)
            )
        })
    }

    /// How much of a surface is there, as a parameter.
    fn opacity(&mut self, name: &str, coverage: &Coverage) -> anyhow::Result<String> {
        let Some((index, channel)) = coverage.amount.texture else {
            return Ok(format!("<float name=\"opacity\" value=\"{}\"/>", coverage.of(1.0)));
        };
        if coverage.cutoff.is_some() {
            self.notes.push(format!("{name}: its holes are cut texel by texel"));
        }
        let texture = &self.scene.textures[index as usize];
        let file = format!("coverage{:04}.exr", self.masks);
        self.masks += 1;
        write_whole(&self.folder.join(&file), &encode_exr(&mask(texture, channel, coverage), &[], &[])?)?;
        let filter = if coverage.cutoff.is_some() { "nearest" } else { "bilinear" };
        Ok(bitmap("opacity", &file, filter, texture.look_up))
    }

    /// One shape for each object, material and kind of shading.
    fn shapes(&mut self) -> anyhow::Result<()> {
        let mut count = 0;
        for (number, object) in self.scene.objects.iter().enumerate().filter(|(_, object)| object.visible) {
            let mesh = &self.scene.meshes[object.mesh as usize];
            if !mesh.colours.is_empty() {
                self.notes.push(format!("{}: the colours of its vertices are left out", object.name));
            }
            let has_normal = |vertex: u32| mesh.normals.get(vertex as usize).is_some_and(|n| *n != Vec3::ZERO);
            let mut parts: BTreeMap<(u32, bool), Vec<usize>> = BTreeMap::new();
            for triangle in self.scene.triangles(number) {
                let (material, corners) = (self.scene.material_of(number, triangle), mesh.triangles[triangle]);
                let shines = !self.scene.materials[material as usize].emission.is_black();
                let smooth = !shines && corners.iter().all(|corner| has_normal(*corner));
                parts.entry((material, smooth)).or_default().push(triangle);
            }
            for ((material, smooth), triangles) in parts {
                let part = Part { mesh, triangles, smooth, textured: !mesh.uvs.is_empty() };
                let file = format!("mesh{count:05}.ply");
                write_whole(&self.folder.join(&file), &encode(&part, &object.scene_from_object))?;
                count += 1;
                let emission = self.emission(material);
                let flat = if smooth { "" } else { "<boolean name=\"face_normals\" value=\"true\"/>" };
                let emitter = if emission.is_black() {
                    String::new()
                } else {
                    format!("<emitter type=\"area\">{}</emitter>", self.colour("radiance", &emission)?)
                };
                let _ = writeln!(
                    self.xml,
                    "  <shape type=\"ply\"><string name=\"filename\" value=\"{file}\"/>{flat}<ref id=\"m{material}\"/>\
                     {emitter}{}</shape>",
                    self.medium(material)
                );
            }
        }
        Ok(())
    }

    /// Mitsuba's surfaces shine whatever their mask is.
    fn emission(&mut self, material: u32) -> Colour {
        let Material { name, emission, coverage, .. } = &self.scene.materials[material as usize];
        let Some(coverage) = coverage.filter(|_| !emission.is_black()) else { return *emission };
        if coverage.amount.texture.is_some() {
            self.notes.push(format!("{name}: shines where it has holes"));
            return *emission;
        }
        Colour { value: emission.value * coverage.of(1.0), ..*emission }
    }

    fn light(&mut self, light: &Light) {
        let text = match light {
            Light::Point { position, intensity } => {
                format!(
                    "<emitter type=\"point\">{}{}</emitter>",
                    point("position", *position),
                    rgb("intensity", *intensity)
                )
            }
            Light::Spot { position, direction, intensity, cos_inner, cos_outer } => {
                self.notes.push("spot lights: Mitsuba's edge falls off otherwise".to_string());
                let up = if direction.y.abs() < 0.9 { Vec3::Y } else { Vec3::X };
                format!(
                    "<emitter type=\"spot\"><transform name=\"to_world\"><lookat origin=\"{}\" target=\"{}\" up=\"{}\"/>\
                     </transform>{}<float name=\"beam_width\" value=\"{}\"/><float name=\"cutoff_angle\" value=\"{}\"/>\
                     </emitter>",
                    triple(*position),
                    triple(*position + *direction),
                    triple(up),
                    rgb("intensity", *intensity),
                    cos_inner.acos().to_degrees(),
                    cos_outer.acos().to_degrees()
                )
            }
            Light::Luminaire { position, intensity, solid, .. } => {
                self.notes.push(
                    "luminaires: Mitsuba has no photometric webs; written as points of their mean intensity"
                        .to_string(),
                );
                let mean = mean_of_web(&self.scene.textures[*solid as usize]);
                format!(
                    "<emitter type=\"point\">{}{}</emitter>",
                    point("position", *position),
                    rgb("intensity", *intensity * mean)
                )
            }
            Light::Directional { direction, irradiance, diameter_deg } if *diameter_deg > 0.0 => {
                self.disc(*direction, *irradiance, *diameter_deg)
            }
            Light::Directional { direction, irradiance, .. } => format!(
                "<emitter type=\"directional\"><vector name=\"direction\" value=\"{}\"/>{}</emitter>",
                triple(*direction),
                rgb("irradiance", *irradiance)
            ),
        };
        let _ = writeln!(self.xml, "  {text}");
    }

    /// A sun with a disc: Mitsuba has none, so a plate that glows, far away.
    fn disc(&mut self, direction: Vec3, irradiance: Rgb, diameter_deg: f32) -> String {
        let widest = diameter_deg.min(WIDEST_DISC_DEG);
        if widest < diameter_deg {
            self.notes.push(format!("a sun {diameter_deg}° wide: written {widest}° wide"));
        }
        let half = widest.to_radians() / 2.0;
        let middle = self.scene.camera.target;
        let away = AFAR * self.extent();
        let origin = middle - direction * away;
        let up = if direction.y.abs() < 0.9 { Vec3::Y } else { Vec3::X };
        let radiance = irradiance / (std::f32::consts::PI * half.sin() * half.sin());
        format!(
            "<shape type=\"disk\"><transform name=\"to_world\"><scale value=\"{}\"/><lookat origin=\"{}\" target=\"{}\" \
             up=\"{}\"/></transform><emitter type=\"area\">{}</emitter></shape>",
            away * half.tan(),
            triple(origin),
            triple(middle),
            triple(up),
            rgb("radiance", radiance)
        )
    }

    /// The farthest that anything is from what the camera looks at.
    fn extent(&self) -> f32 {
        let middle = self.scene.camera.target;
        let visible = self.scene.objects.iter().filter(|object| object.visible);
        let places = visible.flat_map(|object| {
            let mesh = &self.scene.meshes[object.mesh as usize];
            mesh.positions.iter().map(|place| object.scene_from_object.point(*place))
        });
        places.chain([self.scene.camera.origin]).map(|place| place.distance(middle)).fold(0.0, f32::max)
    }

    fn environment(&mut self) -> anyhow::Result<()> {
        let text = match self.scene.environment {
            Environment::Black => return Ok(()),
            Environment::Constant(radiance) => {
                format!("<emitter type=\"constant\">{}</emitter>", rgb("radiance", radiance))
            }
            Environment::Image { texture, scale, turn } => {
                // Their seam is where our middle is.
                let file = self.texture(texture, scale)?;
                format!(
                    "<emitter type=\"envmap\"><string name=\"filename\" value=\"{file}\"/><transform name=\"to_world\">\
                     <rotate y=\"1\" angle=\"{}\"/></transform></emitter>",
                    180.0 - 360.0 * turn
                )
            }
        };
        let _ = writeln!(self.xml, "  {text}");
        Ok(())
    }

    /// A colour, as a parameter of this name.
    fn colour(&mut self, name: &str, colour: &Colour) -> anyhow::Result<String> {
        let Some(index) = colour.texture else { return Ok(rgb(name, colour.value)) };
        let file = self.texture(index, colour.value)?;
        let Texture { name: image, look_up, .. } = &*self.scene.textures[index as usize];
        if look_up.set > 0 || look_up.across != look_up.up {
            self.notes.push(format!("{image}: lies by the first texture coordinates, and both ways alike"));
        }
        let look_up = *look_up;
        Ok(bitmap(name, &file, if look_up.nearest { "nearest" } else { "bilinear" }, look_up))
    }

    /// The file of a texture times a factor, linear.
    fn texture(&mut self, index: u32, factor: Rgb) -> anyhow::Result<String> {
        let key = (index, factor.to_array().map(f32::to_bits));
        if let Some(file) = self.textures.get(&key) {
            return Ok(file.clone());
        }
        let file = format!("texture{:04}.exr", self.textures.len());
        let picture = linear(&self.scene.textures[index as usize], factor);
        write_whole(&self.folder.join(&file), &encode_exr(&picture, &[], &[])?)?;
        self.textures.insert(key, file.clone());
        Ok(file)
    }
}

/// A texture, as a parameter of this name.
fn bitmap(name: &str, file: &str, filter: &str, look_up: LookUp) -> String {
    // Mitsuba knows one way for both.
    let wrap = match look_up.across {
        Wrap::Repeat => "repeat",
        Wrap::Clamp => "clamp",
        Wrap::Mirror => "mirror",
    };
    format!(
        "<texture name=\"{name}\" type=\"bitmap\"><string name=\"filename\" value=\"{file}\"/><string \
         name=\"filter_type\" value=\"{filter}\"/><string name=\"wrap_mode\" value=\"{wrap}\"/></texture>"
    )
}

/// How much of a surface is there, texel by texel.
fn mask(texture: &Texture, channel: u8, coverage: &Coverage) -> Picture {
    let channel = usize::from(channel);
    let grey = |texel: f32| Vec3::splat(coverage.of(texel));
    let pixels = match &texture.pixels {
        Pixels::Srgb8(texels) | Pixels::Linear8(texels) => {
            texels.iter().map(|texel| grey(f32::from(texel[channel]) / 255.0)).collect()
        }
        Pixels::Float(texels) => texels.iter().map(|texel| grey(texel.get(channel).copied().unwrap_or(1.0))).collect(),
    };
    Picture { width: texture.width, height: texture.height, pixels }
}

/// Mean over all directions of a photometric web: its rows by their bands of the sphere.
fn mean_of_web(web: &Texture) -> f32 {
    let Pixels::Float(texels) = &web.pixels else { return 0.0 };
    let (columns, last) = (web.width as usize, (web.height.max(2) - 1) as f32);
    let edge = |row: f32| (std::f32::consts::PI * row.clamp(0.0, last) / last).cos();
    let rows = texels.chunks(columns).zip(0_u16..).map(|(row, number)| {
        let (mean, at) = (row.iter().map(|texel| texel[0]).sum::<f32>() / columns as f32, f32::from(number));
        mean * (edge(at - 0.5) - edge(at + 0.5)) / 2.0
    });
    rows.sum()
}

/// A texture's colours as linear light, times a factor.
fn linear(texture: &Texture, factor: Rgb) -> Picture {
    let decode = |value: u8| linear_from_srgb(f64::from(value) / 255.0) as f32;
    let pixels = match &texture.pixels {
        Pixels::Srgb8(texels) => texels.iter().map(|[r, g, b, _]| Vec3::from([*r, *g, *b].map(decode))).collect(),
        Pixels::Linear8(texels) => {
            texels.iter().map(|[r, g, b, _]| Vec3::from([*r, *g, *b].map(f32::from)) / 255.0).collect()
        }
        Pixels::Float(texels) => texels.iter().map(|texel| Vec3::from(*texel)).collect::<Vec<_>>(),
    };
    let pixels = pixels.into_iter().map(|pixel| pixel * factor).collect();
    Picture { width: texture.width, height: texture.height, pixels }
}

fn rgb(name: &str, value: Rgb) -> String {
    format!("<rgb name=\"{name}\" value=\"{}\"/>", triple(value))
}

fn point(name: &str, at: Vec3) -> String {
    format!("<point name=\"{name}\" x=\"{}\" y=\"{}\" z=\"{}\"/>", at.x, at.y, at.z)
}

/// Shortest numbers that read back as the same bits.
fn triple(v: Vec3) -> String {
    format!("{}, {}, {}", v.x, v.y, v.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shipped_scene_is_written_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/veach_door");
        let scene = scenes::read::load(&path).unwrap().scene;
        let exported = mitsuba(&scene, folder.path()).unwrap();
        assert!(exported.notes.is_empty(), "{:?}", exported.notes);
        let xml = std::fs::read_to_string(&exported.file).unwrap();
        let mut triangles = 0;
        for name in xml.split("filename\" value=\"").skip(1).filter_map(|rest| rest.split('"').next()) {
            let bytes = std::fs::read(folder.path().join(name)).unwrap();
            if name.ends_with(".ply") {
                let header = String::from_utf8_lossy(&bytes[..300.min(bytes.len())]).into_owned();
                let count = header.split("element face ").nth(1).and_then(|rest| rest.lines().next()).unwrap();
                triangles += count.parse::<usize>().unwrap();
            }
        }
        assert_eq!(triangles, scene.triangle_count());
        assert_eq!(xml.matches("<emitter").count(), 1, "one lamp");
        assert!(xml.contains("value=\"320\"") && xml.contains("dielectric") && xml.contains("bitmap"));
    }
}
