//! What people have done to a scene, as a file keeps it for the next master: its state, not how it came about.
//!
//! A session is about the scene as its files describe it. When these have changed since, an edit fits only if what it is
//! about is still there as it was: by its number, or else as the only one of its kind.

pub mod folder;
#[cfg(test)]
mod tests;
pub mod writer;

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use frame::live::edits::Step;
use protocol::message::PICTURE_SIDE_MAX;
use protocol::parts::{Manifest, hash, short};
use scenes::change::About;
use scenes::{Camera, Change, Dielectric, Gloss, Material, Object, Preset, SavedView, Scalar, Scene, Surface};
use serde::{Deserialize, Serialize};

use crate::display::hues::Hues;
use crate::display::message::ToneSettings;

/// What is kept of a session.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KeptSession {
    /// Version of this format.
    pub igi_kept: u32,
    /// Where the scene is.
    pub scene: PathBuf,
    /// What its files were, in digits, but for camera and time.
    pub files: String,
    /// When it was written, seconds since 1970.
    pub saved: u64,
    /// What leads from the files to what people saw.
    pub edits: Vec<KeptEdit>,
    /// What lamps of the edits and of the history may have: [`Change::Solid`], in order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub solids: Vec<Change>,
    /// Steps that could be taken back, and made again.
    pub history: [Vec<Step>; 2],
    /// The colours of what was off.
    pub hues: Hues,
    /// From where people looked.
    pub camera: Camera,
    /// How bright, and by which curve.
    pub tone: ToneSettings,
    /// Saved views.
    pub views: Vec<SavedView>,
    /// How lamps are, under names.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub presets: Vec<Preset>,
}

/// An edit, and what it is about.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KeptEdit {
    /// What was done.
    pub change: Change,
    /// What it was done to, by name, and as the files had it, in digits; `None` for the time.
    pub subject: Option<Subject>,
}

/// What an edit is about.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Subject {
    /// For people.
    pub name: String,
    /// A hash of all that it was in the files.
    pub print: String,
}

/// The version that is written and read.
pub const VERSION: u32 = 1;
/// Longest file, bytes.
pub const FILE_MAX: u64 = 16 << 20;
/// Steps of the history that are kept.
pub const STEPS_KEPT: usize = 100;
/// Saved views of a scene.
pub const VIEWS_MAX: usize = 500;
/// Presets of a scene's lamps.
pub const PRESETS_MAX: usize = 100;
/// Lamps in all saved views together, and in all presets: files stay as long as can be read again.
pub const LAMP_STATES_MAX: usize = 50_000;

/// A scene as its files describe it, and hashes of its parts.
#[derive(Clone, Copy, Debug)]
pub struct Files<'a> {
    /// Not edited yet.
    pub scene: &'a Scene,
    /// Its meshes and textures.
    pub manifest: &'a Manifest,
}

impl KeptSession {
    /// The scene is not as its files say.
    pub fn has_edits(&self) -> bool {
        !self.edits.is_empty()
    }

    /// How many textures its scene's files had, if lamps have solids behind them.
    pub fn textures_of_files(&self) -> usize {
        let first = self.solids.first().cloned().and_then(|mut solid| solid.solid_mut().copied());
        first.map_or(usize::MAX, |first| first as usize)
    }

    /// Reads a session.
    ///
    /// # Errors
    /// Names the file, and what is wrong with it.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let context = || format!("{}: cannot be taken up", path.display());
        let mut bytes = Vec::new();
        let file = File::open(path).with_context(context)?;
        file.take(FILE_MAX + 1).read_to_end(&mut bytes).with_context(context)?;
        ensure!(bytes.len() as u64 <= FILE_MAX, "{}: is too long for a session", path.display());
        let session: Self = serde_json::from_slice(&bytes).with_context(context)?;
        let version = session.igi_kept;
        ensure!(version == VERSION, "{}: is of version {version}, and this program reads {VERSION}", path.display());
        session.check().map_err(|what| anyhow::anyhow!("{}: {what}", path.display()))?;
        Ok(session)
    }

    fn check(&self) -> Result<(), String> {
        self.camera.check().map_err(|what| format!("camera: {what}"))?;
        let sides = [self.camera.width, self.camera.height];
        let is_drawn = sides.into_iter().all(|side| side <= PICTURE_SIDE_MAX);
        let is_short = self.views.len().max(self.presets.len() * VIEWS_MAX / PRESETS_MAX) <= VIEWS_MAX
            && self.history.iter().all(|steps| steps.len() <= STEPS_KEPT);
        let demand = |is_so: bool, what: &str| if is_so { Ok(()) } else { Err(what.to_owned()) };
        demand(is_drawn, "camera: is too large a picture")?;
        demand(is_short, "holds more views or steps than are kept")?;
        demand(self.tone.exposure.is_finite(), "tone: the exposure is no number")?;
        self.views.iter().try_for_each(SavedView::check).map_err(|what| format!("views: {what}"))?;
        self.presets.iter().try_for_each(Preset::check).map_err(|what| format!("presets: {what}"))
    }

    /// As a file holds it, without the history if that would be too long.
    ///
    /// # Errors
    /// Even so it is too long.
    pub fn encode(&mut self) -> anyhow::Result<Vec<u8>> {
        let bytes = serde_json::to_vec(self)?;
        if bytes.len() as u64 <= FILE_MAX {
            return Ok(bytes);
        }
        self.history = Default::default();
        let bytes = serde_json::to_vec(self)?;
        ensure!(bytes.len() as u64 <= FILE_MAX, "there are too many edits for a file of {} MiB", FILE_MAX >> 20);
        Ok(bytes)
    }

    /// What of it fits a scene: the changes, and the names of what has gone or is another.
    pub fn fitting(&self, files: Files) -> (Vec<Change>, Vec<String>) {
        let (mut fitting, mut left_out) = (Vec::new(), Vec::new());
        for KeptEdit { change, subject } in &self.edits {
            match files.fit(change, subject.as_ref()).filter(|change| change.check(files.scene).is_ok()) {
                Some(change) => fitting.push(change),
                None => left_out.push(subject.as_ref().map_or("the time".into(), |subject| subject.name.clone())),
            }
        }
        left_out.dedup();
        (fitting, left_out)
    }

    /// The history, if the files are what they were and each of its changes can be made.
    pub fn fitting_history(&self, files: Files) -> Option<[Vec<Step>; 2]> {
        let mut changes = self.history.iter().flatten().flat_map(|(forth, back)| forth.iter().chain(back));
        let fits = self.files == files.print() && changes.all(|change| change.check(files.scene).is_ok());
        fits.then(|| self.history.clone())
    }
}

impl Files<'_> {
    /// All that the files say, in digits: edited files give others. Camera and time are not part of it.
    pub fn print(&self) -> String {
        let Scene { name, centre, materials, lights, environment, .. } = self.scene;
        let objects: Vec<_> = self.scene.objects.iter().map(|object| self.object(object)).collect();
        let Manifest { meshes, textures, .. } = self.manifest;
        digits(&(name, centre, objects, materials, lights, environment, meshes, textures))
    }

    /// Edits with what they are about.
    pub fn kept(&self, changes: Vec<Change>) -> Vec<KeptEdit> {
        changes.into_iter().map(|change| KeptEdit { subject: self.subject(&change), change }).collect()
    }

    /// What a change is about; `None` for the time, and for what does not exist.
    fn subject(&self, change: &Change) -> Option<Subject> {
        if let Change::Lamp { light, value: Some(lamp) } = change {
            // What stood there, if anything did.
            return Some(Subject { name: lamp.name.clone(), print: digits(&self.scene.lamp(*light)) });
        }
        let about = change.about()?;
        let name = about.name(self.scene)?.to_owned();
        let (name, print) = match (about, change) {
            (About::Object(number), Change::OwnMaterial { material, value: Some(value), .. }) => {
                let was = self.scene.materials.get(*material as usize)?;
                let print = [self.object(&self.scene.objects[number as usize]), self.material(was, value)].concat();
                (name, print)
            }
            (About::Object(number), _) => (name, self.object(&self.scene.objects[number as usize])),
            (About::Material(number), Change::Material { value, .. }) => {
                (name, self.material(&self.scene.materials[number as usize], value))
            }
            (About::Material(number), _) => (name, digits(&self.scene.materials[number as usize])),
            (About::Light(number), _) => {
                let name = if name.is_empty() { format!("lamp {}", number + 1) } else { name };
                (name, digits(&self.scene.lights[number as usize]))
            }
        };
        Some(Subject { name, print })
    }

    /// The change for what it was about, wherever that is now.
    fn fit(&self, change: &Change, subject: Option<&Subject>) -> Option<Change> {
        if let Change::Lamp { value: Some(_), .. } = change {
            let print = |subject: &Subject| subject.print.clone();
            return (self.subject(change).as_ref().map(print) == subject.map(print)).then(|| change.clone());
        }
        let Some(what) = change.about() else { return subject.is_none().then(|| change.clone()) };
        let subject = subject?;
        let is_it = |number: u32| {
            let there = change.of_number(number);
            self.subject(&there).is_some_and(|found| found.print == subject.print).then_some(there)
        };
        if let Some(there) = is_it(what.number()) {
            return Some(there);
        }
        let mut others = (0..what.count(self.scene)).filter_map(is_it);
        others.next().filter(|_| others.next().is_none())
    }

    fn object(&self, object: &Object) -> String {
        let mesh = self.manifest.meshes.get(object.mesh as usize);
        // Where something that moves is, its keys say.
        let place = object.motion.is_none().then_some(object.scene_from_object);
        digits(&(&object.name, mesh, place, &object.motion, object.visible))
    }

    /// A material of the files, and the textures of what it has become.
    fn material(&self, was: &Material, is: &Material) -> String {
        let textures = |material: &Material| -> Vec<_> {
            let used = textures_of(material).into_iter().flatten();
            used.map(|texture| self.manifest.textures.get(texture as usize)).collect()
        };
        digits(&(was, textures(was), textures(is)))
    }
}

fn textures_of(material: &Material) -> Vec<Option<u32>> {
    let of = |scalar: &Scalar| scalar.texture.map(|(texture, _)| texture);
    let glass = |glass: &Dielectric| [glass.transmittance.texture, of(&glass.roughness)];
    let mut textures = match &material.surface {
        Surface::Diffuse { albedo } => vec![albedo.texture],
        Surface::Glossy(Gloss { base, roughness, metalness, specular, sheen, coat, .. }) => {
            let of_coat = coat.iter().flat_map(|coat| [of(&coat.amount), of(&coat.roughness)]);
            let of_sheen = sheen.iter().flat_map(|sheen| [sheen.colour.texture, of(&sheen.roughness)]);
            let of_lobe = [of(roughness), of(metalness), of(&specular.amount), specular.colour.texture];
            [base.texture].into_iter().chain(of_lobe).chain(of_sheen).chain(of_coat).collect()
        }
        Surface::Mirror { .. } => Vec::new(),
        Surface::Dielectric(it) => glass(it).to_vec(),
        Surface::Glazed { amount, glass: it, base, metalness, specular, .. } => {
            let opaque = [base.texture, of(metalness), of(&specular.amount), specular.colour.texture];
            glass(it).into_iter().chain([of(amount)]).chain(opaque).collect()
        }
        Surface::Translucent { albedo, transmittance } => vec![albedo.texture, transmittance.texture],
    };
    let mask = material.coverage.and_then(|coverage| coverage.amount.texture).map(|(texture, _)| texture);
    textures.extend([material.emission.texture, mask]);
    textures
}

/// A short hash of anything.
fn digits(value: &impl Serialize) -> String {
    short(&hash(&serde_json::to_vec(value).unwrap_or_default()))
}
