//! The scene JSON (see `scenes/README.md`): a model file, a camera, lights, motion.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use glam::{DVec3, Vec3};
use serde::Deserialize;
use serde_json::Value;

use super::error::Notes;
use super::figure::Measure;
use super::find::find;
use super::lamps::Lamp;
use super::limits::{self, PICTURE_SIDE_MAX};
use super::textures::{Meaning, Textures};
use super::{Draft, ReadError, sky, text};
use crate::{Camera, Coverage, Environment, Key, LookUp, Motion, Offset, Rgb, Scene, Surface};

pub(super) type Triple = [f64; 3];

#[derive(Deserialize)]
struct File {
    name: Option<String>,
    #[serde(alias = "gltf", alias = "model")]
    obj: String,
    camera: Option<View>,
    #[serde(default)]
    lights: Vec<Lamp>,
    background: Option<Value>,
    environment: Option<Surroundings>,
    #[serde(default)]
    animation: Vec<Track>,
    #[serde(default)]
    movable: BTreeSet<String>,
    #[serde(default)]
    coverage: BTreeMap<String, f64>,
    #[serde(default)]
    priority: BTreeMap<String, u64>,
    #[serde(default)]
    multiple_scattering: bool,
    /// Read by people and tests.
    #[serde(rename = "format")]
    _format: Option<String>,
    #[serde(rename = "references")]
    _references: Option<Value>,
    #[serde(flatten)]
    unknown: BTreeMap<String, Value>,
}

#[derive(Deserialize)]
struct View {
    origin: Triple,
    target: Triple,
    #[serde(default = "up")]
    up: Triple,
    fov_y_deg: Option<f64>,
    /// Instead of a field of view: seen as if in parallel, so high in the scene.
    parallel_height: Option<f64>,
    #[serde(default)]
    two_point: bool,
    #[serde(default)]
    cut: bool,
    #[serde(default = "width")]
    width: u64,
    #[serde(default = "height")]
    height: u64,
    #[serde(flatten)]
    unknown: BTreeMap<String, Value>,
}

fn up() -> Triple {
    [0.0, 1.0, 0.0]
}

fn width() -> u64 {
    640
}

fn height() -> u64 {
    480
}

#[derive(Deserialize)]
struct Surroundings {
    image: Option<String>,
    sky: Option<sky::Entry>,
    #[serde(default)]
    scale: Scale,
    #[serde(default)]
    turn_deg: f64,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Scale {
    Grey(f64),
    Rgb(Triple),
}

impl Default for Scale {
    fn default() -> Self {
        Self::Grey(1.0)
    }
}

#[derive(Deserialize)]
struct Track {
    object: String,
    #[serde(default)]
    pivot: Triple,
    #[serde(default = "up")]
    axis: Triple,
    keyframes: Vec<Frame>,
}

#[derive(Deserialize)]
struct Frame {
    t: f64,
    #[serde(default)]
    translate: Triple,
    #[serde(default)]
    angle_deg: f64,
}

/// Reads a scene JSON and the model it names.
pub(super) fn read(path: &Path, time: f64, notes: &mut Notes) -> Result<Draft, ReadError> {
    let bytes = limits::read_bytes(path)?;
    let file: File = serde_json::from_str(&text::decode(&bytes))
        .map_err(|error| ReadError::line(path, line(&error), without_place(&error)))?;
    for field in file.unknown.keys().chain(file.camera.iter().flat_map(|camera| camera.unknown.keys())) {
        notes.at(path, field, "is not a field that is known here; it is ignored");
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let model = folder.join(&file.obj);
    if model.extension().is_some_and(|e| e.eq_ignore_ascii_case("json")) {
        return Err(ReadError::field(path, "obj", "names another scene.json; name an .obj, .gltf or .glb"));
    }
    let moving = file.animation.iter().map(|track| track.object.clone());
    let movable = file.movable.iter().cloned().chain(moving).collect();
    let mut draft = super::read_model(&model, &movable, time, notes)?;
    Reader { path, folder, notes }.apply(file, &mut draft)?;
    Ok(draft)
}

/// serde_json's words end in " at line 3 column 7"; the line stands before ours already.
pub(super) fn without_place(error: &serde_json::Error) -> String {
    let words = error.to_string();
    let end = words.rfind(" at line ").unwrap_or(words.len());
    format!("column {}: {}", error.column(), &words[..end])
}

/// Where it is wrong, from 1 on.
pub(super) fn line(error: &serde_json::Error) -> u32 {
    u32::try_from(error.line()).unwrap_or(u32::MAX)
}

/// What reads the parts of a scene JSON.
pub(super) struct Reader<'a> {
    pub(super) path: &'a Path,
    pub(super) folder: &'a Path,
    pub(super) notes: &'a mut Notes,
}

impl Reader<'_> {
    fn apply(&mut self, file: File, draft: &mut Draft) -> Result<(), ReadError> {
        draft.sky_is_said = file.background.is_some() || file.environment.is_some();
        let scene = &mut draft.scene;
        if let Some(name) = file.name {
            scene.name = name;
        }
        if let Some(view) = &file.camera {
            draft.camera = Some(self.camera(view, scene.centre)?);
        }
        for (i, entry) in file.lights.iter().enumerate() {
            self.lamp(&format!("lights[{i}]"), entry, scene)?;
        }
        if let Some(background) = &file.background {
            let figure = self.figure("background", background, None, Measure::Radiance)?;
            scene.lights_are_photometric |= figure.is_photometric;
            let radiance = figure.rgb;
            scene.environment =
                if radiance == Vec3::ZERO { Environment::Black } else { Environment::Constant(radiance) };
        }
        if let Some(surroundings) = &file.environment {
            self.environment(surroundings, scene)?;
        }
        for (i, track) in file.animation.iter().enumerate() {
            self.animate(&format!("animation[{i}]"), track, scene)?;
        }
        for (name, amount) in &file.coverage {
            self.cover(name, *amount, scene)?;
        }
        scene.multiple_scattering = file.multiple_scattering;
        for (name, priority) in &file.priority {
            self.prioritise(name, *priority, scene)?;
        }
        for name in &file.movable {
            if !scene.objects.iter().any(|object| object.name == *name) {
                self.notes.at(self.path, "movable", format!("there is no object `{name}`"));
            }
        }
        Ok(())
    }

    /// So much of a material is there, whatever the model says.
    fn cover(&mut self, name: &str, amount: f64, scene: &mut Scene) -> Result<(), ReadError> {
        if !(0.0..=1.0).contains(&amount) {
            return Err(self.refuse(&format!("coverage.{name}"), format!("{amount} is not within 0..1")));
        }
        let mut known = false;
        for material in scene.materials.iter_mut().filter(|material| material.name == name) {
            material.coverage = (amount < 1.0).then_some(Coverage::plain(amount as f32));
            known = true;
        }
        if !known {
            self.notes.at(self.path, "coverage", format!("there is no material `{name}`"));
        }
        Ok(())
    }

    /// Which glass is there where several are.
    fn prioritise(&mut self, name: &str, priority: u64, scene: &mut Scene) -> Result<(), ReadError> {
        let Ok(priority) = u8::try_from(priority) else {
            return Err(self.refuse(&format!("priority.{name}"), format!("{priority} is not within 0..255")));
        };
        let mut known = false;
        for material in scene.materials.iter_mut().filter(|material| material.name == name) {
            if let Surface::Dielectric(glass) | Surface::Glazed { glass, .. } = &mut material.surface {
                (glass.priority, known) = (priority, true);
            }
        }
        if !known {
            self.notes.at(self.path, "priority", format!("there is no glass `{name}`"));
        }
        Ok(())
    }

    fn camera(&self, view: &View, centre: DVec3) -> Result<Camera, ReadError> {
        let side = |field: &str, pixels: u64| match u32::try_from(pixels) {
            Ok(pixels) if (1..=PICTURE_SIDE_MAX).contains(&pixels) => Ok(pixels),
            _ => Err(self.refuse(&format!("camera.{field}"), format!("{pixels} is not within 1..{PICTURE_SIDE_MAX}"))),
        };
        let fov_y_deg = match (view.fov_y_deg, view.parallel_height) {
            (Some(deg), None) => deg,
            (None, Some(_)) => Camera::default().fov_y_deg.into(),
            (Some(_), Some(_)) => return Err(self.refuse("camera", "has a fov_y_deg or a parallel_height")),
            (None, None) => return Err(self.refuse("camera", "missing field `fov_y_deg` (or `parallel_height`)")),
        };
        let camera = Camera {
            origin: (DVec3::from(view.origin) - centre).as_vec3(),
            target: (DVec3::from(view.target) - centre).as_vec3(),
            up: DVec3::from(view.up).as_vec3(),
            fov_y_deg: fov_y_deg as f32,
            width: side("width", view.width)?,
            height: side("height", view.height)?,
            two_point: view.two_point,
            cut: view.cut,
        };
        camera.check().map_err(|what| self.refuse("camera", what))?;
        let Some(height) = view.parallel_height else { return Ok(camera) };
        if !(height > 0.0 && height.is_finite()) {
            return Err(self.refuse("camera.parallel_height", format!("{height} is no height")));
        }
        let camera = camera.parallel(height);
        camera.check().map_err(|what| self.refuse("camera.parallel_height", what))?;
        Ok(camera)
    }

    fn environment(&mut self, surroundings: &Surroundings, scene: &mut Scene) -> Result<(), ReadError> {
        let scale = match surroundings.scale {
            Scale::Grey(factor) => [factor; 3],
            Scale::Rgb(factors) => factors,
        };
        let scale = self.power("environment.scale", scale)?;
        match (&surroundings.image, &surroundings.sky) {
            (Some(image), None) => {
                let turn = surroundings.turn_deg / 360.0;
                if !turn.is_finite() {
                    return Err(self.refuse("environment.turn_deg", "is not finite"));
                }
                self.image(image, (scale, (turn - turn.round()) as f32), scene)
            }
            (None, Some(sky)) if surroundings.turn_deg == 0.0 => self.sky(sky, scale, scene),
            (None, Some(_)) => Err(self.refuse("environment.turn_deg", "is of images; a sky has `north_deg`")),
            _ => Err(self.refuse("environment", "needs either image or sky")),
        }
    }

    fn image(&mut self, image: &str, (scale, turn): (Rgb, f32), scene: &mut Scene) -> Result<(), ReadError> {
        let file = find(&[self.folder], image)
            .ok_or_else(|| self.refuse("environment.image", format!("`{image}` does not exist")))?;
        let mut textures = Textures::after(std::mem::take(&mut scene.textures));
        let bytes = limits::read_bytes(&file)?;
        // Longitude goes round; at the poles, where latitude ends, the renderer clamps all the same.
        match textures.add(&file, image, &bytes, Meaning::Radiance, LookUp::REPEAT) {
            Ok(texture) => scene.environment = Environment::Image { texture, scale, turn },
            Err(why) => {
                let stands_in = match scene.environment {
                    Environment::Black => "a white one of radiance 1 stands in for it",
                    _ => "`background` stands in for it",
                };
                self.notes.at(self.path, "environment.image", format!("`{image}`: {why}; {stands_in}"));
                if scene.environment == Environment::Black {
                    scene.environment = Environment::Constant(Vec3::ONE);
                }
            }
        }
        scene.textures = textures.list;
        Ok(())
    }

    fn animate(&self, place: &str, track: &Track, scene: &mut Scene) -> Result<(), ReadError> {
        let at = |field: &str| format!("{place}.{field}");
        let motion = self.motion(place, track, scene.centre)?;
        let names: Vec<String> = scene.objects.iter().map(|object| object.name.clone()).collect();
        let object = scene.objects.iter_mut().find(|object| object.name == track.object).ok_or_else(|| {
            let some = names.iter().take(20).map(String::as_str).collect::<Vec<_>>().join(", ");
            self.refuse(&at("object"), format!("there is no object `{}`; there are: {some}", track.object))
        })?;
        if !object.scene_from_object.is_identity() || object.motion.is_some() {
            return Err(self.refuse(&at("object"), "has a place of its own; only objects of OBJ files can be animated"));
        }
        object.motion = Some(motion);
        Ok(())
    }

    fn motion(&self, place: &str, track: &Track, centre: DVec3) -> Result<Motion, ReadError> {
        let at = |field: &str| format!("{place}.{field}");
        let turns = track.keyframes.iter().any(|key| key.angle_deg != 0.0);
        let axis = match (DVec3::from(track.axis).try_normalize(), turns) {
            (Some(axis), _) => axis.as_vec3(),
            (None, false) => Vec3::Y,
            (None, true) => return Err(self.refuse(&at("axis"), "has no direction")),
        };
        let mut keys = Vec::with_capacity(track.keyframes.len());
        for (i, frame) in track.keyframes.iter().enumerate() {
            let translate = DVec3::from(frame.translate).as_vec3();
            if !(frame.t.is_finite() && translate.is_finite() && frame.angle_deg.is_finite()) {
                return Err(self.refuse(&at(&format!("keyframes[{i}]")), "holds a number that is not finite"));
            }
            keys.push(Key { time: frame.t, translate, angle_deg: frame.angle_deg });
        }
        if keys.is_empty() {
            return Err(self.refuse(&at("keyframes"), "is empty; give at least one"));
        }
        keys.sort_by(|a, b| a.time.total_cmp(&b.time));
        let pivot = self.point(&at("pivot"), track.pivot, centre)?;
        Ok(Motion { pivot, axis, keys, poses: Vec::new(), offset: Offset::default() })
    }

    pub(super) fn point(&self, field: &str, point: Triple, centre: DVec3) -> Result<Vec3, ReadError> {
        let point = (DVec3::from(point) - centre).as_vec3();
        if point.is_finite() { Ok(point) } else { Err(self.refuse(field, "is too far away")) }
    }

    pub(super) fn direction(&self, field: &str, direction: DVec3) -> Result<Vec3, ReadError> {
        direction.try_normalize().map(|d| d.as_vec3()).ok_or_else(|| self.refuse(field, "has no direction"))
    }

    pub(super) fn power(&self, field: &str, power: Triple) -> Result<Rgb, ReadError> {
        let power = DVec3::from(power).as_vec3();
        let good = power.is_finite() && power.min_element() >= 0.0;
        if good { Ok(power) } else { Err(self.refuse(field, "must be three finite numbers, none negative")) }
    }

    pub(super) fn refuse(&self, field: &str, message: impl Into<String>) -> ReadError {
        ReadError::field(self.path, field, message)
    }
}
