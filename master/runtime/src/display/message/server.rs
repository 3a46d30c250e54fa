//! What viewers are sent.

use std::sync::Arc;

use frame::live::pick;
use glam::Vec3;
use protocol::schedule::WorkerState;
use scenes::{Camera, Change, Preset, SavedView, Scene, Transform};
use serde::{Deserialize, Serialize};

use super::{MeterReading, MethodInfo, PieceInfo, SceneInfo, SolidInfo, Spot, ToneSettings, scene};
use crate::cluster::WorkerInfo;
use crate::display::hues::Hues;
use crate::methods::Named;

/// A message to viewers, to all of them unless its description says otherwise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "tell", rename_all = "snake_case")]
pub enum ServerMessage {
    /// To one viewer, when it joins or asks for it: the current state. [`Self::Edited`], [`Self::Hues`], [`Self::Views`],
    /// [`Self::Offer`] and [`Self::Controls`] follow, with the rest of it.
    Welcome(Box<Welcome>),
    /// How pictures are made and shown from now on.
    Knobs(Knobs),
    /// The colours of what is off.
    Hues {
        /// All of them.
        hues: Hues,
    },
    /// The saved views.
    Views {
        /// All of them, in order.
        views: Vec<SavedView>,
    },
    /// How lamps are, under names.
    Presets {
        /// All of them, in order.
        presets: Vec<Preset>,
    },
    /// What an earlier master has kept.
    Offer {
        /// `None` once it has been taken up or forgotten, and if there was none.
        offer: Option<Offer>,
    },
    /// The camera was moved by none of the viewers: they go on from there.
    Look {
        /// There.
        camera: Camera,
    },
    /// The scene was saved as a file, for every command to read.
    Saved {
        /// Where, on the master's machine.
        file: String,
        /// How many edits it holds.
        edits: usize,
    },
    /// The luminaire whose file a viewer sent hangs.
    Hung {
        /// The number of that viewer.
        by: u64,
        /// Indices into [`Scene::lights`].
        lights: Vec<u32>,
        /// What it gives, and what is to be said of its file.
        text: String,
    },
    /// For people to read.
    Notice {
        /// A sentence.
        text: String,
    },
    /// The scene was edited.
    Edited(Edited),
    /// The viewers, and which of them has the controls.
    Controls {
        /// The number of a viewer; `None`: they are free.
        holder: Option<u64>,
        /// Numbers of all viewers, ascending.
        viewers: Vec<u64>,
    },
    /// To the holder of the controls: another viewer asks for them.
    Asked {
        /// The number of that viewer.
        by: u64,
    },
    /// The answer to [`super::ClientMessage::Pick`].
    Picked(Picked),
    /// The answer to [`super::ClientMessage::Walk`].
    Walked {
        /// Where the eyes are then.
        origin: Vec3,
    },
    /// The answer to [`super::ClientMessage::Probe`].
    Probed(Probed),
    /// Speeds and workers, several times a second.
    Status(Box<Status>),
    /// To one viewer: its message was not carried out.
    Refused {
        /// For people.
        reason: String,
    },
    /// Something went wrong: a part of the picture cannot be drawn, or an edit was refused late.
    Trouble {
        /// For people.
        reason: String,
    },
}

/// The current state.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Welcome {
    /// The number of the viewer that this is sent to.
    pub you: u64,
    /// The scene, without edits that wait to be made.
    pub scene: SceneInfo,
    /// From where it is looked at, and how large.
    pub camera: Camera,
    /// How pictures are made and shown.
    pub knobs: Knobs,
    /// As in [`Edited::steps`].
    pub steps: [usize; 2],
    /// Of this program.
    pub version: String,
    /// The methods there are, the default one first.
    pub methods: Vec<MethodInfo>,
}

/// How pictures are made and shown.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Knobs {
    /// Name of the layer that is shown.
    pub layer: String,
    /// Frames a second that are aimed at while something moves.
    pub rate: f32,
    /// The method, and the values of its knobs.
    pub method: Named,
    /// Brightness and curve.
    pub tone: ToneSettings,
    /// Frames that a still picture is made of.
    pub rest_after: u32,
    /// Whether still pictures are shown denoised; `None`: there is no denoiser.
    pub denoise: Option<bool>,
    /// Whether lamps are drawn apart while the picture rests.
    pub mix: bool,
}

/// What an earlier master has kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Offer {
    /// When, seconds since 1970.
    pub saved: u64,
    /// How many edits.
    pub edits: usize,
    /// The scene's files have changed since.
    pub files_changed: bool,
}

/// An edit of the scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Edited {
    /// In order.
    pub changes: Vec<Change>,
    /// Where they put what moves by itself: number of an object, scene space from object space.
    pub poses: Vec<(u32, Transform)>,
    /// The pieces that they are about, as they were before.
    pub pieces: Vec<PieceInfo>,
    /// The photometric solids that they bring along, for lamps to have.
    pub solids: Vec<SolidInfo>,
    /// How many steps can be undone, and how many redone.
    pub steps: [usize; 2],
    /// The viewer that made them, and shows them already; `None` for undo, redo and what was kept.
    pub by: Option<u64>,
}

/// What lies at a spot of the picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Picked {
    /// The spot that was asked about.
    #[serde(flatten)]
    pub spot: Spot,
    /// `None` where there is no surface.
    pub found: Option<Hit>,
}

/// Where a ray from the eye meets the scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hit {
    /// As in [`pick::Picked`].
    pub object: u32,
    /// The piece of the object; `None` if the object is one piece.
    pub piece: Option<PieceInfo>,
    /// As in [`pick::Picked`].
    pub is_room: bool,
    /// As in [`pick::Picked`].
    pub material: u32,
    /// As in [`pick::Picked`].
    pub point: Vec3,
    /// As in [`pick::Picked`].
    pub normal: Vec3,
    /// As in [`pick::Picked`].
    pub distance: f32,
}

/// What the light meter reads at a spot of the picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Probed {
    /// The spot that was asked about.
    #[serde(flatten)]
    pub spot: Spot,
    /// The pixel there: column, row.
    pub pixel: [u32; 2],
    /// `None` as long as nothing is known of that pixel.
    pub found: Option<MeterReading>,
}

/// Speeds since the last status, and the workers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// Pictures that were shown.
    pub pictures_per_second: f64,
    /// Some of them were moving ones.
    pub moving: bool,
    /// Rays that workers have traced.
    pub rays_per_second: f64,
    /// Answers of workers, packed.
    pub answer_bytes_per_second: f64,
    /// From inputs to pictures that are ready to be sent, milliseconds: half of them took less, and 99 of 100. `None`
    /// before the first.
    pub latency_ms: [Option<f64>; 2],
    /// Estimated relative mean squared error; `None` while it is unknown.
    pub error: Option<f64>,
    /// To workers, since the beginning.
    pub bytes_sent: u64,
    /// From workers, since the beginning.
    pub bytes_received: u64,
    /// All of them, by number.
    pub workers: Vec<WorkerStatus>,
    /// How many of them answer questions.
    pub ready: usize,
    /// Of moving pictures, as in [`frame::front_end::Effort`].
    pub effort: f32,
    /// How far lamps are drawn apart; `None` while that is not wanted.
    pub mix: Option<MixStatus>,
}

/// How far lamps are drawn apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MixStatus {
    /// Films that can be mixed; once all can, edits of lamps are.
    pub drawn: usize,
    /// Films that there will be; 0 before that is known.
    pub lamps: usize,
    /// Frames of the film that has the fewest.
    pub frames: u32,
}

/// A worker.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WorkerStatus {
    /// Its number.
    pub worker: u32,
    /// What it calls itself.
    pub name: String,
    /// What it is doing.
    pub state: WorkerState,
    /// Questions that it answers at a time.
    pub threads: usize,
    /// Questions that it has answered.
    pub answered: u64,
    /// Bytes of its answers.
    pub bytes: u64,
    /// Parts of the scene that it has, and all parts; `None` unless it fetches some.
    pub progress: Option<(u32, u32)>,
    /// It is in this process.
    pub local: bool,
}

impl ServerMessage {
    /// As it is sent, JSON.
    pub fn encode(&self) -> Arc<str> {
        // This fails for maps whose keys are neither text nor numbers, and there are none.
        serde_json::to_string(self).unwrap_or_default().into()
    }

    /// The answer to [`super::ClientMessage::Pick`].
    pub fn picked(scene: &Scene, spot: Spot, picked: Option<pick::Picked>) -> Self {
        let found = picked.map(|picked| {
            let pick::Picked { object, piece, is_room, material, point, normal, distance } = picked;
            let piece = piece.map(|piece| PieceInfo::of(scene, object, piece));
            Hit { object, piece, is_room, material, point, normal, distance }
        });
        Self::Picked(Picked { spot, found })
    }
}

impl Edited {
    /// Of changes that the scene can take, which come after others that wait to be made.
    pub fn of(scene: &Scene, waiting: &[Change], changes: Vec<Change>, steps: [usize; 2], by: Option<u64>) -> Self {
        let (poses, pieces) = (scene::poses(scene, waiting, &changes), scene::pieces(scene, &changes));
        let (solids, changes): (Vec<_>, Vec<_>) =
            changes.into_iter().partition(|change| matches!(change, Change::Solid { .. }));
        let solids = solids.iter().filter_map(SolidInfo::of_change).collect();
        Self { changes, poses, pieces, solids, steps, by }
    }
}

impl From<&WorkerInfo> for WorkerStatus {
    fn from(info: &WorkerInfo) -> Self {
        Self {
            worker: info.worker,
            name: info.name.clone(),
            state: info.state,
            threads: info.threads,
            answered: info.answered,
            bytes: info.answer_bytes,
            progress: info.progress,
            local: info.address.is_none(),
        }
    }
}

#[cfg(test)]
mod tests {
    use frame::front_end::{Slider, Value};
    use frame::tone::Operator;
    use scenes::views::LampState;
    use scenes::{Material, Shiner};
    use serde_json::json;

    use super::super::{KnobInfo, KnobKind, LayerInfo, ObjectInfo};
    use super::*;

    const SPOT: Spot = Spot { x: 0.25, y: 0.5 };

    fn piece() -> PieceInfo {
        let bounds = Some([Vec3::ZERO, Vec3::ONE]);
        let own = vec![(3, Material::diffuse("red", Vec3::X))];
        PieceInfo { object: 1, piece: 2, place: Transform::IDENTITY, visible: true, bounds, materials: vec![3], own }
    }

    fn knobs() -> Knobs {
        let tone = ToneSettings { exposure: -1.5, operator: Operator::Agx };
        let settings = [("vpls".to_owned(), Value::Whole(24)), ("fade".to_owned(), Value::Switch(true))];
        let method = Named { name: "igi".into(), settings: settings.into() };
        Knobs { layer: "lux".into(), rate: 12.5, method, tone, rest_after: 64, denoise: Some(true), mix: true }
    }

    fn welcome() -> Welcome {
        let object = ObjectInfo {
            name: "o".into(),
            place: Transform::IDENTITY,
            visible: true,
            moves: false,
            bounds: None,
            materials: vec![0, 1],
            own: Vec::new(),
        };
        let scene = SceneInfo {
            name: "room".into(),
            triangles: 12,
            objects: vec![object],
            pieces: vec![piece()],
            light_names: vec![String::new(), "Sun".into()],
            textures: vec!["oak".into()],
            time: Some([0.0, 4.0]),
            unit: "lx".into(),
            ..SceneInfo::default()
        };
        let knob = |name: &str, kind, words: &[[&str; 2]], slider| KnobInfo {
            name: name.into(),
            label: "Label".into(),
            about: "About".into(),
            kind,
            words: words.iter().map(|pair| pair.map(Into::into)).collect(),
            slider,
        };
        let slider = Slider { least: 1.0, most: 64.0, step: 1.0 };
        let method = MethodInfo {
            name: "igi".into(),
            about: "A".into(),
            knobs: vec![
                knob("vpls", KnobKind::Whole, &[], Some(slider)),
                knob("filter", KnobKind::Choice, &[["plane", "P"]], None),
            ],
            layers: vec![LayerInfo { name: "lux".into(), label: "Illuminance".into() }],
        };
        let (camera, version) = (Camera::default(), "0.1.0".into());
        Welcome { you: 7, scene, camera, knobs: knobs(), steps: [2, 1], version, methods: vec![method] }
    }

    fn status() -> Status {
        let worker = WorkerStatus {
            worker: 3,
            name: "büro".into(),
            state: WorkerState::Preparing,
            threads: 8,
            answered: 5,
            bytes: 600,
            progress: Some((4, 9)),
            local: false,
        };
        Status {
            pictures_per_second: 9.5,
            moving: true,
            rays_per_second: 1e6,
            answer_bytes_per_second: 2e5,
            latency_ms: [Some(40.5), None],
            error: Some(0.25),
            bytes_sent: 1,
            bytes_received: 2,
            workers: vec![worker],
            ready: 1,
            effort: 0.5,
            mix: Some(MixStatus { drawn: 1, lamps: 3, frames: 0 }),
        }
    }

    /// The page reads this JSON by name, and no compiler tells it of other names.
    #[test]
    fn the_json_of_every_message_is_what_pages_read() {
        let identity =
            json!({ "linear": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], "translation": [0.0, 0.0, 0.0] });
        let camera = json!(Camera::default());
        let piece_json = json!({
            "object": 1, "piece": 2, "place": identity, "visible": true, "box": [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]],
            "materials": [3], "own": [[3, Material::diffuse("red", Vec3::X)]],
        });
        let knobs_json = json!({
            "layer": "lux", "rate": 12.5, "method": { "name": "igi", "settings": { "fade": true, "vpls": 24 } },
            "tone": { "exposure": -1.5, "operator": "agx" }, "rest_after": 64, "denoise": true, "mix": true,
        });
        let with = |tag: &str, mut json: serde_json::Value| {
            json["tell"] = tag.into();
            json
        };
        let own = [("1/2/3".into(), Vec3::Z)].into();
        let hues = Hues { lights: [(2, Vec3::X)].into(), materials: [(11, Vec3::Y)].into(), own, sky: None };
        let lamps = vec![LampState { lamp: Shiner::Light(2), of: "Sun".into(), power: Vec3::X }];
        let picture = Some("data:image/jpeg;base64,AA==".into());
        let from = SavedView { target: Vec3::X, up: Vec3::Y, fov_y_deg: 45.0, ..SavedView::default() };
        let presets = vec![Preset { name: "evening".into(), lamps: lamps.clone() }];
        let view = SavedView { name: "north".into(), picture, lamps, ..from };
        let hit = Hit {
            object: 1,
            piece: Some(piece()),
            is_room: true,
            material: 3,
            point: Vec3::X,
            normal: Vec3::Y,
            distance: 2.5,
        };
        let reading = MeterReading { lux: 512.0, candela_per_m2: 163.0, distance: 2.5, ..MeterReading::default() };
        let edited = Edited {
            changes: vec![Change::Time(2.0), Change::Visible { object: 1, visible: false }],
            poses: vec![(1, Transform::IDENTITY)],
            pieces: vec![piece()],
            solids: vec![SolidInfo { texture: 1, name: "a.ies".into(), steradians: 2.5 }],
            steps: [3, 0],
            by: None,
        };
        let cases = [
            (
                ServerMessage::Welcome(welcome().into()),
                json!({
                    "tell": "welcome", "you": 7, "camera": camera, "knobs": knobs_json, "steps": [2, 1], "version": "0.1.0",
                    "scene": {
                        "name": "room", "triangles": 12, "pieces": [piece_json], "materials": [], "lights": [],
                        "light_names": ["", "Sun"], "environment": "Black", "textures": ["oak"], "solids": [], "time": [0.0, 4.0], "unit": "lx",
                        "objects": [{
                            "name": "o", "place": identity, "visible": true, "moves": false, "box": null, "materials": [0, 1], "own": [],
                        }],
                    },
                    "methods": [{
                        "name": "igi", "about": "A", "layers": [{ "name": "lux", "label": "Illuminance" }],
                        "knobs": [
                            {
                                "name": "vpls", "label": "Label", "about": "About", "kind": "whole", "words": [],
                                "slider": { "least": 1.0, "most": 64.0, "step": 1.0 },
                            },
                            {
                                "name": "filter", "label": "Label", "about": "About", "kind": "choice",
                                "words": [["plane", "P"]], "slider": null,
                            },
                        ],
                    }],
                }),
            ),
            (ServerMessage::Knobs(knobs()), with("knobs", knobs_json.clone())),
            (
                ServerMessage::Hues { hues },
                json!({
                    "tell": "hues",
                    "hues": { "lights": { "2": [1.0, 0.0, 0.0] }, "materials": { "11": [0.0, 1.0, 0.0] }, "own": { "1/2/3": [0.0, 0.0, 1.0] } },
                }),
            ),
            (
                ServerMessage::Views { views: vec![view] },
                json!({
                    "tell": "views",
                    "views": [{
                        "name": "north", "origin": [0.0, 0.0, 0.0], "target": [1.0, 0.0, 0.0], "up": [0.0, 1.0, 0.0],
                        "fov_y_deg": 45.0, "picture": "data:image/jpeg;base64,AA==",
                        "lamps": [{ "lamp": { "Light": 2 }, "of": "Sun", "power": [1.0, 0.0, 0.0] }],
                    }],
                }),
            ),
            (
                ServerMessage::Presets { presets },
                json!({ "tell": "presets", "presets": [{ "name": "evening", "lamps": [{ "lamp": { "Light": 2 }, "of": "Sun", "power": [1.0, 0.0, 0.0] }] }] }),
            ),
            (
                ServerMessage::Offer { offer: Some(Offer { saved: 9, edits: 4, files_changed: true }) },
                json!({ "tell": "offer", "offer": { "saved": 9, "edits": 4, "files_changed": true } }),
            ),
            (ServerMessage::Offer { offer: None }, json!({ "tell": "offer", "offer": null })),
            (ServerMessage::Look { camera: Camera::default() }, json!({ "tell": "look", "camera": camera })),
            (
                ServerMessage::Saved { file: "a.json".into(), edits: 2 },
                json!({ "tell": "saved", "file": "a.json", "edits": 2 }),
            ),
            (
                ServerMessage::Hung { by: 2, lights: vec![3], text: "a".into() },
                json!({ "tell": "hung", "by": 2, "lights": [3], "text": "a" }),
            ),
            (ServerMessage::Notice { text: "a".into() }, json!({ "tell": "notice", "text": "a" })),
            (
                ServerMessage::Edited(edited),
                json!({
                    "tell": "edited", "steps": [3, 0], "by": null, "pieces": [piece_json], "poses": [[1, identity]],
                    "solids": [{ "texture": 1, "name": "a.ies", "steradians": 2.5 }],
                    "changes": [{ "Time": 2.0 }, { "Visible": { "object": 1, "visible": false } }],
                }),
            ),
            (
                ServerMessage::Controls { holder: Some(1), viewers: vec![1, 2] },
                json!({ "tell": "controls", "holder": 1, "viewers": [1, 2] }),
            ),
            (
                ServerMessage::Controls { holder: None, viewers: vec![] },
                json!({ "tell": "controls", "holder": null, "viewers": [] }),
            ),
            (ServerMessage::Asked { by: 2 }, json!({ "tell": "asked", "by": 2 })),
            (
                ServerMessage::Picked(Picked { spot: SPOT, found: Some(hit) }),
                json!({
                    "tell": "picked", "x": 0.25, "y": 0.5,
                    "found": {
                        "object": 1, "piece": piece_json, "is_room": true, "material": 3, "point": [1.0, 0.0, 0.0],
                        "normal": [0.0, 1.0, 0.0], "distance": 2.5,
                    },
                }),
            ),
            (ServerMessage::Walked { origin: Vec3::X }, json!({ "tell": "walked", "origin": [1.0, 0.0, 0.0] })),
            (
                ServerMessage::Probed(Probed { spot: SPOT, pixel: [50, 60], found: Some(reading) }),
                json!({
                    "tell": "probed", "x": 0.25, "y": 0.5, "pixel": [50, 60],
                    "found": {
                        "radiance": [0.0, 0.0, 0.0], "irradiance": [0.0, 0.0, 0.0], "reflectance": [0.0, 0.0, 0.0],
                        "distance": 2.5, "lux": 512.0, "candela_per_m2": 163.0,
                    },
                }),
            ),
            (
                ServerMessage::Status(status().into()),
                json!({
                    "tell": "status", "pictures_per_second": 9.5, "moving": true, "rays_per_second": 1e6,
                    "answer_bytes_per_second": 2e5, "latency_ms": [40.5, null], "error": 0.25, "bytes_sent": 1,
                    "bytes_received": 2, "ready": 1, "effort": 0.5, "mix": { "drawn": 1, "lamps": 3, "frames": 0 },
                    "workers": [{
                        "worker": 3, "name": "büro", "state": "preparing", "threads": 8, "answered": 5, "bytes": 600,
                        "progress": [4, 9], "local": false,
                    }],
                }),
            ),
            (ServerMessage::Refused { reason: "no".into() }, json!({ "tell": "refused", "reason": "no" })),
            (ServerMessage::Trouble { reason: "oh".into() }, json!({ "tell": "trouble", "reason": "oh" })),
        ];
        for (message, json) in cases {
            let text = message.encode();
            assert_eq!(serde_json::from_str::<serde_json::Value>(&text).unwrap(), json);
            assert_eq!(serde_json::from_str::<ServerMessage>(&text).unwrap(), message, "{text}");
        }
    }
}
