//! What the studio tells a viewer, read into types; the same words that pages hear.

use glam::Vec3;
use scenes::{Camera, Change, Light, Material, Transform};
use serde::Deserialize;

use crate::display::hues::Hues;
use crate::display::words::{Measured, ToneWords, View};
use crate::methods::Named;

/// What a viewer is told.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "tell", rename_all = "snake_case")]
pub(super) enum Told {
    /// Everything, from the beginning.
    Welcome(Box<Welcome>),
    /// How the knobs are turned.
    Knobs(Knobs),
    /// The colours of what is off.
    Hues { hues: Hues },
    /// The saved views.
    Views { views: Vec<View> },
    /// What an earlier master has kept, until somebody says what becomes of it.
    Offer { offer: Option<Offer> },
    /// Everybody looks from there now.
    Look { camera: Camera },
    /// Something to be read.
    Notice { text: String },
    /// The scene was edited.
    Edited {
        changes: Vec<Change>,
        /// Where that puts what moves by itself.
        #[serde(default)]
        poses: Vec<(u32, Transform)>,
        #[serde(default)]
        pieces: Vec<Piece>,
        steps: [usize; 2],
        #[serde(default)]
        by: Option<u64>,
    },
    /// Who has the controls, and who is there.
    Controls { holder: Option<u64> },
    /// A viewer asks for the controls.
    Asked { by: u64 },
    /// What lies at a spot of the picture.
    Picked { x: f32, y: f32, found: Option<Found> },
    /// Numbers at a spot of the picture.
    Probed { found: Option<Measured> },
    /// How things stand.
    Status(Box<Status>),
    /// What was said cannot be done.
    Refused { reason: String },
    /// A part of the picture cannot be drawn.
    Trouble { reason: String },
}

#[derive(Clone, Debug, Deserialize)]
pub(super) struct Welcome {
    pub you: u64,
    pub scene: SceneWords,
    pub camera: Camera,
    pub knobs: Knobs,
    /// The methods there are.
    pub methods: Vec<Method>,
    pub steps: [usize; 2],
}

/// The scene as viewers know it.
#[derive(Clone, Debug, Default, Deserialize)]
pub(super) struct SceneWords {
    pub objects: Vec<Thing>,
    /// Pieces of objects that somebody has done something to, or has selected.
    pub pieces: Vec<Piece>,
    pub materials: Vec<Material>,
    pub lights: Vec<Light>,
    /// Their names in the file; absent or empty where it gives none.
    #[serde(default)]
    pub light_names: Vec<String>,
    /// What the numbers of its files are on the light meter.
    pub unit: String,
    /// First and last key of what moves by itself.
    pub time: Option<[f64; 2]>,
    /// Of what is off.
    #[serde(skip)]
    pub hues: Hues,
}

/// An object as viewers know it.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Thing {
    pub name: String,
    pub place: Transform,
    pub visible: bool,
    /// Its corners in its own space.
    #[serde(rename = "box")]
    pub bounds: Option<[Vec3; 2]>,
    pub materials: Vec<u32>,
}

/// A piece of an object as viewers know it.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Piece {
    /// Index of the object.
    pub object: u32,
    /// Which of its pieces.
    pub piece: u32,
    /// Where it is in the object's own space.
    pub place: Transform,
    pub visible: bool,
    /// Its corners where it was modelled, in the object's own space.
    #[serde(rename = "box")]
    pub bounds: Option<[Vec3; 2]>,
    pub materials: Vec<u32>,
}

#[derive(Clone, Debug, Deserialize)]
pub(super) struct Knobs {
    /// Name of what is shown.
    pub layer: String,
    pub tone: ToneWords,
    /// Frames a second that are aimed at while something moves.
    pub rate: f32,
    pub method: Named,
}

/// A method as viewers know it.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Method {
    pub name: String,
    pub about: String,
    pub knobs: Vec<Knob>,
    pub layers: Vec<Layer>,
}

/// Something that can be set.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Knob {
    pub name: String,
    pub label: String,
    pub about: String,
    /// Of a choice, each with what it means.
    pub words: Vec<[String; 2]>,
    pub slider: Option<Slider>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
pub(super) struct Slider {
    pub least: f32,
    pub most: f32,
    pub step: f32,
}

/// Something that can be looked at.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Layer {
    pub name: String,
    pub label: String,
}

#[derive(Clone, Debug, Deserialize)]
pub(super) struct Found {
    pub object: u32,
    /// Nothing if the object falls into no pieces.
    pub piece: Option<Piece>,
    /// People mean the piece rather than the object.
    pub is_room: bool,
    pub material: u32,
    pub point: Vec3,
}

/// What an earlier master has kept.
#[derive(Clone, Copy, Debug, Deserialize)]
pub(super) struct Offer {
    /// When, seconds since 1970.
    pub saved: u64,
    pub edits: usize,
    /// The scene's files are others now.
    pub files_changed: bool,
}

/// How things stand.
#[derive(Clone, Debug, Default, Deserialize)]
pub(super) struct Status {
    pub rays_per_second: f64,
    pub answer_bytes_per_second: f64,
    /// The master's, p50 and p99.
    pub latency_ms: [Option<f64>; 2],
    /// Relative mean squared error, estimated.
    pub error: Option<f64>,
    pub workers: Vec<Hand>,
    pub ready: usize,
}

/// A worker.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Hand {
    pub name: String,
    pub state: String,
    pub threads: u32,
    /// Bytes of the scene that it has, and of all.
    pub progress: Option<[u64; 2]>,
}

impl SceneWords {
    /// Makes a change in this copy.
    pub fn learn(&mut self, change: &Change) {
        match change {
            Change::Transform { object, scene_from_object } => self.put(*object, *scene_from_object),
            Change::Visible { object, visible } => {
                if let Some(thing) = self.objects.get_mut(*object as usize) {
                    thing.visible = *visible;
                }
            }
            Change::PieceTransform { object, piece, whole_from_piece } => {
                if let Some(known) = self.piece_mut(*object, *piece) {
                    known.place = *whole_from_piece;
                }
            }
            Change::PieceVisible { object, piece, visible } => {
                if let Some(known) = self.piece_mut(*object, *piece) {
                    known.visible = *visible;
                }
            }
            Change::Material { material, value } => {
                if let Some(old) = self.materials.get_mut(*material as usize) {
                    self.hues.learn_material(*material, old, value);
                    *old = value.clone();
                }
            }
            Change::Light { light, value } => {
                if let Some(old) = self.lights.get_mut(*light as usize) {
                    self.hues.learn_light(*light, old, value);
                    *old = value.clone();
                }
            }
            // The camera is each viewer's own affair; where what moves is, the studio's.
            Change::Camera(_) | Change::Time(_) | Change::Offset { .. } => {}
        }
    }

    /// A lamp's name in its file; one is made up only where there is none.
    pub fn lamp_name(&self, index: usize) -> String {
        let made_up = || match self.lights.get(index) {
            Some(Light::Point { .. }) => format!("Point lamp {}", index + 1),
            Some(Light::Spot { .. }) => format!("Spot lamp {}", index + 1),
            Some(Light::Directional { .. }) => format!("Directional lamp {}", index + 1),
            None => String::new(),
        };
        self.light_names.get(index).filter(|name| !name.is_empty()).cloned().unwrap_or_else(made_up)
    }

    /// An object is there now.
    pub fn put(&mut self, object: u32, place: Transform) {
        if let Some(thing) = self.objects.get_mut(object as usize) {
            thing.place = place;
        }
    }

    /// Keeps what is told of a piece, unless it is known.
    pub fn meet(&mut self, piece: Piece) {
        if self.piece(piece.object, piece.piece).is_none() {
            self.pieces.push(piece);
        }
    }

    pub fn piece(&self, object: u32, piece: u32) -> Option<&Piece> {
        self.pieces.iter().find(|known| (known.object, known.piece) == (object, piece))
    }

    fn piece_mut(&mut self, object: u32, piece: u32) -> Option<&mut Piece> {
        self.pieces.iter_mut().find(|known| (known.object, known.piece) == (object, piece))
    }

    /// A piece as a thing that stands in the scene.
    pub fn piece_as_thing(&self, object: u32, piece: u32) -> Option<Thing> {
        let known = self.piece(object, piece)?;
        let whole = self.objects.get(object as usize)?;
        let made = known.materials.iter().filter_map(|material| Some(&*self.materials.get(*material as usize)?.name));
        let made = made.filter(|name| !name.is_empty()).take(3).collect::<Vec<_>>().join(", ");
        let name = if made.is_empty() { format!("Piece {}", piece + 1) } else { made };
        let (place, materials) = (whole.place.after(&known.place), known.materials.clone());
        Some(Thing { name, place, visible: known.visible, bounds: known.bounds, materials })
    }

    /// Whether a point lies among the objects: whoever stands in a room looks around, whoever stands before a thing turns
    /// it.
    pub fn surrounds(&self, point: Vec3) -> bool {
        let visible = self.objects.iter().filter(|thing| thing.visible);
        let corners: Vec<Vec3> = visible.filter_map(Thing::corners).flatten().collect();
        (0..3)
            .all(|axis| corners.iter().any(|c| c[axis] < point[axis]) && corners.iter().any(|c| c[axis] > point[axis]))
    }
}

impl Thing {
    /// Its eight corners, scene space.
    pub fn corners(&self) -> Option<[Vec3; 8]> {
        let [low, high] = self.bounds?;
        let corner = |i: usize| {
            let side = |axis: usize| if i >> axis & 1 == 1 { high[axis] } else { low[axis] };
            self.place.point(Vec3::new(side(0), side(1), side(2)))
        };
        Some(std::array::from_fn(corner))
    }
}

impl Piece {
    /// Something was done to it.
    pub fn is_lifted(&self) -> bool {
        !self.visible || !self.place.is_identity()
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::display::words;

    #[test]
    fn the_studios_words_about_a_scene_are_understood_and_edits_learned() {
        let mut scene = scenes::Scene { name: "box".into(), ..scenes::Scene::default() };
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let mesh = scenes::Mesh {
            positions,
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            materials: vec![0; 2],
            ..Default::default()
        };
        scene.meshes.push(mesh.into());
        let surface = scenes::Surface::Mirror { reflectance: Vec3::ONE };
        let emission = scenes::Colour::default();
        let material = Material { name: "m".into(), surface, emission, emits_both_sides: false, coverage: None };
        scene.materials.push(material);
        let place = Transform { linear: glam::Mat3::IDENTITY, translation: Vec3::Y };
        scene.objects.push(scenes::Object { scene_from_object: place, ..scenes::Object::fixed("o", 0) });
        let mut told: SceneWords = serde_json::from_value(words::scene(&scene)).unwrap();
        assert_eq!((told.objects[0].name.as_str(), told.materials.len()), ("o", 1));
        assert!(told.surrounds(Vec3::new(0.5, 1.5, 0.5)) && !told.surrounds(Vec3::new(0.5, 0.5, 0.5)));
        let elsewhere = Transform { translation: Vec3::X, ..place };
        told.learn(&Change::Transform { object: 0, scene_from_object: elsewhere });
        told.learn(&Change::Visible { object: 7, visible: false });
        assert_eq!(told.objects[0].place, elsewhere);
        assert_eq!(told.objects[0].corners().unwrap()[0], Vec3::X);

        // A piece is where its object is, and is known from when somebody has picked it.
        let shifted = Transform { translation: Vec3::Z, ..Transform::IDENTITY };
        let lift = Change::PieceTransform { object: 0, piece: 0, whole_from_piece: shifted };
        told.learn(&lift);
        assert!(told.pieces.is_empty());
        told.meet(serde_json::from_value(words::piece(&scene, 0, 0)).unwrap());
        assert!(!told.pieces[0].is_lifted());
        told.learn(&lift);
        let thing = told.piece_as_thing(0, 0).unwrap();
        assert_eq!((thing.name.as_str(), thing.place.translation), ("m", Vec3::X + Vec3::Z));
        assert!(told.pieces[0].is_lifted());
    }

    #[test]
    fn words_without_a_giver_are_understood() {
        let told = |value: serde_json::Value| serde_json::from_value::<Told>(value);
        let edited = told(json!({ "tell": "edited", "changes": [], "steps": [1, 0] }));
        assert!(matches!(edited, Ok(Told::Edited { by: None, steps: [1, 0], .. })), "{edited:?}");
        let nobody = told(json!({ "tell": "controls", "holder": null, "viewers": [] }));
        assert!(matches!(nobody, Ok(Told::Controls { holder: None })), "{nobody:?}");
    }
}
