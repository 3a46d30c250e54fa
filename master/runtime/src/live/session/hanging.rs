//! Luminaires' files that viewers send: a lamp that is there gets the photometric solid, or a new one is hung up where the file
//! was dropped. The lamps are edits as any others; the solid itself stays with the scene, so that they can be taken back and made
//! again.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use frame::live::pick;
use glam::Vec3;
use scenes::change::{LIGHTS_MAX, Lamp};
use scenes::photometry::{LUMENS_PER_WATT, luminance, photometric};
use scenes::read::{Measured, photometry};
use scenes::solid::{Solid, solid_angle};
use scenes::{Change, Light, Rgb, Scene, Shiner};

use super::Session;
use crate::display::hub::Viewer;
use crate::display::message::{LUMINAIRE_FILE_MAX, ServerMessage, Spot};

/// What the solids that viewers have sent may take, bytes: they go to every worker with the edits.
const SOLIDS_BYTES_MAX: usize = 4 << 20;
/// From a surface, as a share of its distance from the eye.
const OFF: f32 = 0.005;
/// Above a floor without a ceiling, as [`scenes::read`] hangs a luminaire alone.
const HEIGHT: f32 = 2.7;
/// As steep, a surface is a floor or a ceiling: the upright part of its normal.
const LEVEL: f32 = 0.5;

/// Where something hangs.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Place {
    position: Vec3,
    /// Unit.
    direction: Vec3,
    /// Unit; across it.
    side: Vec3,
}

impl Session {
    /// Hangs up a luminaire from the bytes of its file (base64): in place of lamps, or, if none is named, where something is seen.
    ///
    /// # Errors
    /// In words: what is wrong with the file, by its name and line; or that there is no such lamp.
    pub(super) fn hang(
        &mut self,
        viewer: Viewer,
        (file, data): (&str, &str),
        lights: &[u32],
        at: Option<Spot>,
    ) -> Result<(), String> {
        let bytes = STANDARD.decode(data).map_err(|_| format!("{file}: did not come whole"))?;
        if bytes.len() > LUMINAIRE_FILE_MAX {
            let (size, most) = (bytes.len() >> 10, LUMINAIRE_FILE_MAX >> 10);
            return Err(format!("{file}: has {size} KiB; a luminaire's file has at most {most}"));
        }
        let measured = photometry(file, &bytes).map_err(|error| error.to_string())?;
        let scene = self.edited_scene().ok_or("there is no scene yet")?;
        let solid = self.number_of(&measured.solid, &scene)?;
        let (mut changes, mut said) = (Vec::new(), Vec::new());
        for light in lights {
            let lamp = scene.lamp(*light).ok_or_else(|| format!("there is no lamp {light}"))?;
            let place = Place::of(&lamp.light)
                .ok_or_else(|| format!("{}: a sun is nowhere, and cannot be a luminaire", name(&lamp.name, *light)))?;
            let shown = Some(lamp.light.power()).filter(|power| *power != Rgb::ZERO);
            let hue = shown.or_else(|| self.hues.of(Shiner::Light(*light))).unwrap_or(Rgb::ONE);
            let before = lumens(&lamp.light, &scene).filter(|before| *before > 0.0);
            let (value, lm) = place.hang(hue, &measured, solid);
            let before = before.map_or(String::new(), |before| format!(" instead of {before:.0}"));
            said.push(format!("{}: {lm:.0} lm{before}", name(&lamp.name, *light)));
            changes.push(Change::Light { light: *light, value });
        }
        let mut hung = lights.to_vec();
        if lights.is_empty() {
            let at = at.ok_or("neither a lamp nor a place is named for the luminaire")?;
            let place = self.place_at(&scene, at);
            let free = (0..).zip(&scene.lights).find(|(_, light)| light.is_absent()).map(|(number, _)| number);
            let light = free.unwrap_or(scene.lights.len() as u32);
            if light >= LIGHTS_MAX.max(scene.lights.len() as u32) {
                return Err(format!("a scene has at most {LIGHTS_MAX} lamps"));
            }
            let (value, lm) = place.hang(Rgb::ONE, &measured, solid);
            let name = free_name(&scene, &measured.solid.name);
            said.push(format!("{name}: {lm:.0} lm"));
            changes.push(Change::Lamp { light, value: Some(Lamp { name, light: value }) });
            hung.push(light);
        }
        if solid as usize >= scene.textures.len() {
            self.make(vec![Change::Solid { texture: solid, value: measured.solid.clone().into() }], None)?;
        }
        self.edit(changes, None, None)?;
        let more = if said.len() > NAMED_MAX { format!(" and {} more", said.len() - NAMED_MAX) } else { String::new() };
        said.truncate(NAMED_MAX);
        let of = measured.lamps.map_or(String::new(), |lamps| format!(", of {lamps:.0} lm of its lamps"));
        let notes: String = measured.notes.iter().map(|note| format!("; {note}")).collect();
        let text =
            format!("{}{more} ({:.0} lm{of}, {:.0} cd at most{notes})", said.join(", "), measured.flux, measured.peak);
        // To all, so that it comes behind the edit.
        self.hub.send_all(&ServerMessage::Hung { by: viewer, lights: hung, text });
        Ok(())
    }

    /// By which number a scene has a solid, or will have it.
    fn number_of(&self, solid: &Solid, scene: &Scene) -> Result<u32, String> {
        let texture = solid.texture();
        if let Some(known) = scene.textures.iter().position(|known| **known == texture) {
            return Ok(known as u32);
        }
        let base = self.scene_file.as_ref().map_or(0, |file| file.base.textures.len());
        let own = scene.textures.iter().skip(base).filter_map(|texture| Solid::of(texture));
        let bytes = own.map(|solid| solid.bytes()).sum::<usize>() + solid.bytes();
        if bytes > SOLIDS_BYTES_MAX {
            let most = SOLIDS_BYTES_MAX >> 20;
            return Err(format!(
                "{}: luminaires' files of one scene take at most {most} MiB; save it and open it",
                solid.name
            ));
        }
        Ok(scene.textures.len() as u32)
    }

    /// Where a luminaire is hung that was dropped there: on a ceiling or a wall, aimed away from it; over anything level, on
    /// the ceiling above, aimed down; and where nothing is, before the eye.
    fn place_at(&self, scene: &Scene, at: Spot) -> Place {
        let camera = self.camera();
        let Some(found) = self.pick(scene, at) else {
            return Place::new(camera.origin.lerp(camera.target, 0.6), Vec3::NEG_Y);
        };
        let off = OFF * found.distance;
        if found.normal.y < LEVEL {
            return Place::new(found.point + found.normal * off, found.normal);
        }
        let above = pick::pick(scene, found.point + Vec3::Y * off, Vec3::Y).map(|ceiling| ceiling.distance);
        Place::new(found.point + Vec3::Y * above.unwrap_or(HEIGHT).max(off), Vec3::NEG_Y)
    }
}

impl Place {
    /// With its side as luminaires of a scene's file have it that says none.
    fn new(position: Vec3, direction: Vec3) -> Self {
        let usual = if direction.x.abs() < 0.9 { Vec3::X } else { Vec3::NEG_Z };
        Self { position, direction, side: usual.reject_from_normalized(direction).normalize() }
    }

    /// Where a lamp is; `None` of suns.
    fn of(light: &Light) -> Option<Self> {
        match *light {
            Light::Point { position, .. } => Some(Self::new(position, Vec3::NEG_Y)),
            Light::Spot { position, direction, .. } => Some(Self::new(position, direction)),
            Light::Luminaire { position, direction, side, .. } => Some(Self { position, direction, side }),
            Light::Directional { .. } => None,
        }
    }

    /// The luminaire there, and its lumens.
    fn hang(self, hue: Rgb, measured: &Measured, solid: u32) -> (Light, f64) {
        let Self { position, direction, side } = self;
        let share = measured.share(direction);
        let white = hue.as_dvec3() / luminance(hue.as_dvec3());
        let intensity = (white * (measured.peak * share / f64::from(LUMENS_PER_WATT))).as_vec3();
        (Light::Luminaire { position, direction, side, intensity, solid }, measured.flux * share)
    }
}

/// What a lamp sends in all; `None` of suns.
fn lumens(light: &Light, scene: &Scene) -> Option<f64> {
    let directions = match light {
        Light::Point { .. } => 4.0 * std::f64::consts::PI,
        // Between its cones a spot falls off as the square of a ramp in the cosine.
        Light::Spot { cos_inner, cos_outer, .. } => {
            let [inner, outer] = [*cos_inner, *cos_outer].map(f64::from);
            2.0 * std::f64::consts::PI * (1.0 - inner + (inner - outer) / 3.0)
        }
        Light::Luminaire { solid, .. } => solid_angle(&scene.textures[*solid as usize]),
        Light::Directional { .. } => return None,
    };
    Some(f64::from(photometric(light.power())) * directions)
}

/// Lamps that are named when many are hung.
const NAMED_MAX: usize = 3;

fn name(name: &str, light: u32) -> String {
    if name.is_empty() { format!("lamp {}", light + 1) } else { name.to_owned() }
}

/// The file's name without its ending, with a number if a lamp is called so.
fn free_name(scene: &Scene, file: &str) -> String {
    let stem = file.rsplit_once('.').map_or(file, |(stem, _)| stem);
    let is_free = |name: &str| !scene.light_names.iter().any(|known| known == name);
    let numbered = (2..).map(|number| format!("{stem} {number}"));
    std::iter::once(stem.to_owned()).chain(numbered).find(|name| is_free(name)).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_in_the_papers_is_true() {
        let row = format!("| bytes of the solids of such files in a scene | {} MiB |", SOLIDS_BYTES_MAX >> 20);
        assert!(include_str!("../../../../../SECURITY.md").contains(&row), "{row}: SECURITY.md says otherwise");
    }

    #[test]
    fn a_lamp_keeps_its_place_aim_and_hue_and_its_lumens_are_the_files() {
        let text = b"TILT=INCLUDE\n1\n2\n0 90\n1 0.5\n1 500 1 3 1 1 2 0 0 0\n1 1 10\n0 45 90\n0\n100 50 0\n";
        let measured = photometry("a.ies", text).unwrap();
        let (position, direction) = (Vec3::new(1.0, 2.0, 3.0), Vec3::X);
        let spot = Light::Spot { position, direction, intensity: Rgb::X, cos_inner: 0.9, cos_outer: 0.5 };
        let place = Place::of(&spot).unwrap();
        let (light, lumens) = place.hang(Rgb::new(1.0, 0.5, 0.25), &measured, 3);
        // Aimed at the horizon, its lamp burns with half of its light.
        assert!((lumens / (measured.flux / 2.0) - 1.0).abs() < 1e-6, "{lumens}");
        let Light::Luminaire { position: at, direction: aim, intensity, solid, side } = light else {
            panic!("no luminaire")
        };
        assert_eq!((at, aim, solid), (position, direction, 3));
        assert!(side.dot(aim).abs() < 1e-6 && (photometric(intensity) - 50.0).abs() < 1e-3, "{side} {intensity}");
        assert!((intensity.x / intensity.z - 4.0).abs() < 1e-4, "of its hue: {intensity}");
        assert_eq!(Place::of(&Light::ABSENT), None, "a sun is nowhere");
    }
}
