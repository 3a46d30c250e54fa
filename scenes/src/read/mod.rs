//! From files to [`Scene`]s: the only place of this room that touches the file system.
//!
//! [`load`] takes a folder, a scene JSON, an OBJ or a glTF file, or a luminaire's, and returns a sound scene (proved
//! by [`Scene::check`]) with notes about all that was repaired, left out or made up; or it refuses,
//! naming the file and the line or field. The same file gives the same scene, bit for bit, anywhere.
//!
//! Order of work: an edited scene ([`edited`]) names the one that it stands on; [`json`] names a model; [`wavefront`] or glTF reads it into a [`Draft`]; positions
//! are read in `f64` and moved so that the middle of the geometry becomes the origin, if it is far
//! away ([`Scene::centre`]); a camera and a light are made up if there is none.

mod defaults;
mod dialect;
mod edited;
mod enclosure;
mod error;
mod exr_header;
mod figure;
mod find;
mod glow;
mod gltf2;
mod json;
mod lamps;
mod limits;
mod luminaire;
mod mesh;
mod mtl;
mod obj;
mod polygon;
mod relief;
mod sky;
mod smoothing;
mod studio;
mod surface;
mod tangents;
mod text;
mod texture_name;
mod textures;
mod vertex_colours;
mod wavefront;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

pub use error::{Note, ReadError};
pub use exr_header::check_exr;
pub use luminaire::{Measured, photometry};

use crate::{Camera, Preset, SavedView, Scene};
use error::Notes;

/// A scene, and what the reader has to say about it.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// Sound: [`Scene::check`] holds.
    pub scene: Scene,
    /// In order of reading.
    pub notes: Vec<Note>,
    /// The moment that it was read at.
    pub time: f64,
    /// The file that was read.
    pub file: PathBuf,
    /// What that file stands on, if it is an edited scene ([`crate::edited`]).
    pub base: Option<Base>,
}

/// What an edited scene stands on.
#[derive(Clone, Debug)]
pub struct Base {
    /// Its file.
    pub file: PathBuf,
    /// Without the edits.
    pub scene: Scene,
    /// Views that are saved with the edits.
    pub views: Vec<SavedView>,
    /// How lamps are, under names.
    pub presets: Vec<Preset>,
}

/// A scene under way, in scene space.
struct Draft {
    scene: Scene,
    camera: Option<Camera>,
    /// Its file says what the sky is, be it black.
    sky_is_said: bool,
}

/// Reads a scene at the time that it was saved at, or 0; see [`load_at`].
///
/// # Errors
/// [`ReadError`] says which file, where in it, and what to do.
pub fn load(path: &Path) -> Result<Loaded, ReadError> {
    load_at(path, None)
}

/// Reads a scene: a folder (that holds `scene.json`, or exactly one `.obj`, `.gltf` or `.glb`) or one
/// of those files, or a file of photometric data (`.ies`, `.ldt`, `.eul`). Objects with keyframes are put where they are at `time`; if that is not given, at the one that an edited
/// scene was saved at, else 0.
///
/// # Errors
/// [`ReadError`] says which file, where in it, and what to do.
pub fn load_at(path: &Path, time: Option<f64>) -> Result<Loaded, ReadError> {
    let path = scene_file(path)?;
    let mut notes = Notes::default();
    let (scene, time, base) = match edited::open(&path)? {
        Some(file) => {
            let time = time.or(file.time).unwrap_or(0.0);
            if !time.is_finite() {
                return Err(ReadError::field(&path, "time", "is not finite"));
            }
            let (scene, base) = edited::read(&path, file, time, &mut notes)?;
            (scene, time, Some(base))
        }
        None => {
            let time = time.unwrap_or(0.0);
            (read_plain(&path, time, &mut notes)?, time, None)
        }
    };
    Ok(Loaded { scene, notes: notes.into_list(), time, file: path, base })
}

/// Reads a file that is no edited scene.
fn read_plain(path: &Path, time: f64, notes: &mut Notes) -> Result<Scene, ReadError> {
    let draft = match kind(path) {
        Some(Kind::Json) => json::read(path, time, notes)?,
        _ => read_model(path, &BTreeSet::new(), time, notes)?,
    };
    finish(path, draft, time, notes)
}

fn finish(path: &Path, draft: Draft, time: f64, notes: &mut Notes) -> Result<Scene, ReadError> {
    let mut scene = draft.scene;
    if scene.objects.iter().all(|object| scene.meshes[object.mesh as usize].triangles.is_empty()) {
        return Err(ReadError::file(path, format!("holds no triangle that could be drawn{}", notes.reasons())));
    }
    if scene.name.is_empty() {
        scene.name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    }
    scene.pose(time);
    let room = match draft.camera {
        Some(camera) => {
            scene.camera = camera;
            None
        }
        None => {
            let (camera, room) = defaults::camera(path, &scene, notes);
            scene.camera = camera;
            room
        }
    };
    defaults::light(path, &mut scene, draft.sky_is_said, room, notes);
    scene.check().map_err(|unsound| ReadError::field(path, unsound.place, unsound.what))?;
    Ok(scene)
}

/// Reads a model file into a draft, as it is at `time`. Objects in `movable` stay objects of their own.
fn read_model(path: &Path, movable: &BTreeSet<String>, time: f64, notes: &mut Notes) -> Result<Draft, ReadError> {
    match kind(path) {
        Some(Kind::Obj) => wavefront::read(path, movable, notes),
        Some(Kind::Gltf) => gltf2::read(path, time, notes),
        Some(Kind::Luminaire) => luminaire::stand::read(path, notes),
        _ => Err(ReadError::Kind(path.into())),
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Json,
    Obj,
    Gltf,
    Luminaire,
}

fn kind(path: &Path) -> Option<Kind> {
    match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
        "json" => Some(Kind::Json),
        "obj" => Some(Kind::Obj),
        "gltf" | "glb" => Some(Kind::Gltf),
        "ies" | "ldt" | "eul" => Some(Kind::Luminaire),
        _ => None,
    }
}

/// The file that a path means.
fn scene_file(path: &Path) -> Result<PathBuf, ReadError> {
    if !path.exists() {
        return Err(ReadError::Missing(path.into()));
    }
    if !path.is_dir() {
        return if kind(path).is_some() { Ok(path.into()) } else { Err(ReadError::Kind(path.into())) };
    }
    let json = path.join("scene.json");
    if json.is_file() {
        return Ok(json);
    }
    let entries = std::fs::read_dir(path).map_err(|source| ReadError::Io { path: path.into(), source })?;
    let mut models: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| matches!(kind(path), Some(Kind::Obj | Kind::Gltf)) && path.is_file())
        .collect();
    models.sort();
    let names = || models.iter().filter_map(|path| path.file_name()).map(|name| name.to_string_lossy().into_owned());
    match models.len() {
        1 => Ok(models.remove(0)),
        0 => Err(ReadError::Folder { path: path.into(), found: "there is none".into() }),
        _ => {
            let found = format!("there are {}: name one of them", names().take(8).collect::<Vec<_>>().join(", "));
            Err(ReadError::Folder { path: path.into(), found })
        }
    }
}
