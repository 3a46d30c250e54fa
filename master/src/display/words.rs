//! What viewers say, and what they are told: JSON, hostile until it has been read into these types and
//! checked against the scene.

use std::collections::BTreeMap;

use frame::front_end::{Panel, Values};
use frame::live::edits;
use frame::live::pick::{self, Picked};
use frame::tone::Operator;
use glam::Vec3;
use scenes::photometry::LUMENS_PER_WATT;
use scenes::{Camera, Change, Scene, Transform};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::hues::Hues;
use crate::methods;

/// Longest message of a viewer, bytes: a material or a few hundred moved objects fit.
pub const SAID_MAX: usize = 64 << 10;

/// What a viewer says. All but the last seven need the controls.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "say", rename_all = "snake_case")]
pub enum Said {
    /// Look from elsewhere.
    Look(View),
    /// Edit the scene.
    Edit {
        /// In order.
        changes: Vec<Change>,
        /// Edits with the same number are one step to be undone.
        gesture: Option<u64>,
        /// As in [`View::at`].
        #[serde(default)]
        at: f64,
    },
    /// Take the last step back.
    Undo,
    /// Make the last step that was taken back again.
    Redo,
    /// Expose and develop otherwise.
    Tone(ToneWords),
    /// Choose the exposure by the current picture.
    AutoExpose,
    /// Show something else.
    Inspect {
        /// Name of a layer of the method.
        layer: String,
    },
    /// Turn knobs of the method.
    Turn {
        /// By name; all others stay as they are.
        values: BTreeMap<String, frame::front_end::Value>,
    },
    /// Aim at another frame rate while something moves.
    Rate {
        /// Frames a second.
        rate: f32,
    },
    /// Have pictures made by another method, as it is by default.
    Method {
        /// Its name.
        name: String,
    },
    /// Save a view beside the others.
    SaveView(View),
    /// Forget a saved view.
    ForgetView {
        /// From 0 on.
        number: usize,
    },
    /// Go on with what an earlier master has kept.
    TakeUp,
    /// Forget it.
    StartAfresh,
    /// Give the controls to another; to oneself: keep them, whoever has asked.
    Give {
        /// The number of a viewer.
        to: u64,
    },
    /// The place for the picture, which is drawn as large for whoever has the controls.
    Shape {
        /// Pixels of the screen.
        width: u32,
        /// Pixels of the screen.
        height: u32,
    },
    /// Nobody sees what is shown here, or somebody does again: a page that lies behind others, a window that is minimised.
    Hidden {
        /// Whether it is so.
        hidden: bool,
    },
    /// Ask for the controls: given at once if nobody has them.
    Take,
    /// What is here? Answered with `picked`.
    Pick(Spot),
    /// What are the numbers here? Answered with `probed`.
    Probe(Spot),
    /// A picture is on the screen: the next may come.
    Drawn {
        /// Which.
        number: u64,
    },
    /// Tell me everything again.
    Refresh,
}

/// From where somebody looks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct View {
    /// As in [`Camera`].
    pub origin: Vec3,
    /// As in [`Camera`].
    pub target: Vec3,
    /// As in [`Camera`].
    pub up: Vec3,
    /// As in [`Camera`].
    pub fov_y_deg: f32,
    /// The viewer's own clock; comes back with the first picture that shows this.
    #[serde(default)]
    pub at: f64,
}

/// Brightness and curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ToneWords {
    /// Stops.
    pub exposure: f32,
    /// Curve.
    pub operator: OperatorWord,
}

/// A point of the picture, 0..=1 from its top left corner.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spot {
    /// Across.
    pub x: f32,
    /// Down.
    pub y: f32,
}

/// What the light meter reads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// From the surface to the eye, W·m⁻²·sr⁻¹.
    pub radiance: Vec3,
    /// On the surface, W·m⁻².
    pub irradiance: Vec3,
    /// Fraction reflected.
    pub reflectance: Vec3,
    /// From the eye, in the scene's unit.
    pub distance: f32,
    /// Of the irradiance.
    pub lux: f32,
    /// Of the radiance.
    pub candela_per_m2: f32,
}

/// [`Operator`] in words.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "named as what they stand for")]
pub enum OperatorWord {
    None,
    Reinhard,
    Aces,
    Agx,
}

impl OperatorWord {
    /// The curve.
    pub fn operator(self) -> Operator {
        match self {
            Self::None => Operator::None,
            Self::Reinhard => Operator::Reinhard,
            Self::Aces => Operator::Aces,
            Self::Agx => Operator::Agx,
        }
    }

    /// The word for a curve.
    pub fn of(operator: Operator) -> Self {
        match operator {
            Operator::None => Self::None,
            Operator::Reinhard => Self::Reinhard,
            Operator::Aces => Self::Aces,
            Operator::Agx => Self::Agx,
        }
    }
}

impl View {
    /// The camera, with a picture of this size.
    ///
    /// # Errors
    /// In words, if nothing can be seen so.
    pub fn camera(&self, [width, height]: [u32; 2]) -> Result<Camera, String> {
        let View { origin, target, up, fov_y_deg, .. } = *self;
        let camera = Camera { origin, target, up, fov_y_deg, width, height };
        camera.check().map(|()| camera)
    }
}

impl Said {
    /// Only who has the controls may say this.
    pub fn needs_controls(&self) -> bool {
        !matches!(self, Self::Take | Self::Shape { .. } | Self::Hidden { .. } | Self::Drawn { .. })
            && !self.is_question()
    }

    /// Changes nothing, and is answered to who asks.
    pub fn is_question(&self) -> bool {
        matches!(self, Self::Pick(_) | Self::Probe(_) | Self::Refresh)
    }

    /// When the same viewer says this right after `earlier`, that need not be heard: another look, or more of one drag.
    pub fn supersedes(&self, earlier: &Self) -> bool {
        match (self, earlier) {
            (Self::Look(_), Self::Look(_)) | (Self::Shape { .. }, Self::Shape { .. }) => true,
            (Self::Edit { changes, gesture, .. }, Self::Edit { changes: earlier, gesture: before, .. }) => {
                let is_set = |old: &Change| changes.iter().any(|change| change.supersedes(old));
                gesture.is_some() && gesture == before && earlier.iter().all(is_set)
            }
            _ => false,
        }
    }
}

/// The scene as a viewer needs it: everything that can be edited, and boxes around the objects; of pieces of objects, those
/// that were lifted.
pub fn scene(scene: &Scene) -> Value {
    let objects = scene.objects[..scene.wholes()].iter().enumerate().map(|(number, object)| {
        let box_ = pick::bounds(scene, number as u32);
        json!({
            "name": object.name, "place": object.scene_from_object, "visible": object.visible,
            "moves": object.motion.is_some(), "box": box_,
            "materials": listed(scene.meshes[object.mesh as usize].materials.clone()),
        })
    });
    let lifted = scene.objects.iter().filter_map(|object| object.lifted.as_ref());
    let times = scene.objects.iter().filter_map(|object| object.motion.as_ref()).flat_map(|motion| &motion.keys);
    let times = times.map(|key| key.time);
    let span = times.fold(None, |span: Option<[f64; 2]>, t| {
        let [from, to] = span.unwrap_or([t; 2]);
        Some([from.min(t), to.max(t)])
    });
    json!({
        "name": scene.name,
        "triangles": scene.triangle_count(),
        "objects": objects.take(LISTED_MAX).collect::<Vec<_>>(),
        "pieces": lifted.take(LISTED_MAX).map(|lifted| piece(scene, lifted.of, lifted.piece)).collect::<Vec<_>>(),
        "materials": scene.materials.get(..LISTED_MAX.min(scene.materials.len())),
        "lights": scene.lights.get(..LISTED_MAX.min(scene.lights.len())),
        "light_names": scene.light_names.get(..LISTED_MAX.min(scene.light_names.len())),
        "textures": scene.textures.iter().take(LISTED_MAX).map(|texture| &texture.name).collect::<Vec<_>>(),
        "time": span,
        "unit": unit(scene),
    })
}

/// What the numbers of a scene's files are on the light meter.
fn unit(scene: &Scene) -> String {
    if scene.lights_are_photometric {
        return "as in the file: lights in cd and lx".into();
    }
    format!("1 W/m² in the files is {LUMENS_PER_WATT} lx")
}

/// The methods there are, each with what viewers can set and look at.
pub fn described_methods() -> Value {
    let knob = |knob: &frame::front_end::Knob| {
        let (kind, words) = match knob.values {
            Values::Whole { .. } => ("whole", Vec::new()),
            Values::Real { .. } => ("real", Vec::new()),
            Values::Switch => ("switch", Vec::new()),
            Values::Choice(words) => ("choice", words.iter().map(|(word, about)| [*word, *about]).collect()),
            Values::Pair { .. } | Values::Word { .. } => return None,
        };
        let slider = match knob.panel {
            Panel::Hidden => return None,
            Panel::Shown => None,
            Panel::Slider(slider) => Some(slider),
        };
        Some(json!({
            "name": knob.name, "label": knob.label, "about": knob.about, "kind": kind, "words": words, "slider": slider,
        }))
    };
    let layer = |layer: &frame::Layer| json!({ "name": layer.name, "label": layer.label });
    let method = |method: &&dyn frame::Method| {
        let knobs: Vec<Value> = method.knobs().iter().filter_map(knob).collect();
        let layers: Vec<Value> = method.layers().iter().map(layer).collect();
        json!({ "name": method.name(), "about": method.about(), "knobs": knobs, "layers": layers })
    };
    methods::all().iter().map(method).collect()
}

/// More than these are not told to viewers; they can still be picked.
const LISTED_MAX: usize = 4096;
/// Materials told of an object.
const MATERIALS_LISTED: usize = 64;

/// The first few different ones.
fn listed(mut materials: Vec<u32>) -> Vec<u32> {
    materials.sort_unstable();
    materials.dedup();
    materials.truncate(MATERIALS_LISTED);
    materials
}

/// A piece of an object, which must exist, as a viewer needs it.
pub fn piece(scene: &Scene, object: u32, piece: u32) -> Value {
    let lifted = scene.piece(object, piece);
    let mesh = &scene.meshes[scene.objects[object as usize].mesh as usize];
    let materials = mesh.pieces().triangles(piece).iter().map(|triangle| mesh.materials[*triangle as usize]).collect();
    json!({
        "object": object, "piece": piece, "place": lifted.whole_from_piece, "visible": lifted.visible,
        "box": pick::bounds_of_piece(scene, object, piece), "materials": listed(materials),
    })
}

/// The pieces that some changes are about; the scene must be able to take the changes.
pub fn pieces(scene: &Scene, changes: &[Change]) -> Vec<Value> {
    let mut named: Vec<_> = changes
        .iter()
        .filter_map(|change| match change {
            Change::PieceTransform { object, piece, .. } | Change::PieceVisible { object, piece, .. } => {
                Some((*object, *piece))
            }
            _ => None,
        })
        .collect();
    named.sort_unstable();
    named.dedup();
    named.into_iter().map(|(object, number)| piece(scene, object, number)).collect()
}

/// Where changes put what moves by itself, when they and those that wait have been made: only the master knows.
pub fn poses(scene: &Scene, waiting: &[Change], changes: &[Change]) -> Vec<(u32, Transform)> {
    let all = [waiting, changes].concat();
    let (time, is_later) = (edits::time(scene, &all), changes.iter().any(|change| matches!(change, Change::Time(_))));
    let is_put =
        |number: u32| changes.iter().any(|change| matches!(change, Change::Offset { object, .. } if *object == number));
    let moved = (0..).zip(&scene.objects).take(LISTED_MAX).filter(|(_, object)| object.motion.is_some());
    let moved = moved.map(|(number, _)| number).filter(|number| is_later || is_put(*number));
    moved.filter_map(|number| Some((number, edits::motion(scene, &all, number)?.at(time)))).collect()
}

/// The colours of what is off.
pub fn hues(hues: &Hues) -> Value {
    json!({ "tell": "hues", "hues": hues })
}

/// The answer to [`Said::Pick`].
pub fn picked(scene: &Scene, spot: Spot, picked: Option<Picked>) -> Value {
    let found = picked.map(|picked| {
        let Picked { object, piece: number, is_room, material, point, normal, distance } = picked;
        json!({
            "object": object, "piece": number.map(|number| piece(scene, object, number)), "is_room": is_room,
            "material": material, "point": point, "normal": normal, "distance": distance,
        })
    });
    json!({ "tell": "picked", "x": spot.x, "y": spot.y, "found": found })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_pages_say_is_understood_and_nothing_else() {
        let said = |text: &str| serde_json::from_str::<Said>(text);
        let look = said(r#"{"say":"look","origin":[0,1,2],"target":[0,0,0],"up":[0,1,0],"fov_y_deg":40,"at":12.5}"#);
        assert!(matches!(look, Ok(Said::Look(View { at: 12.5, .. }))), "{look:?}");
        let moved = r#"{"say":"edit","gesture":3,"changes":[{"Transform":{"object":1,"scene_from_object":
            {"linear":[1,0,0,0,1,0,0,0,1],"translation":[0,1,0]}}}]}"#;
        assert!(matches!(said(moved), Ok(Said::Edit { gesture: Some(3), .. })), "{:?}", said(moved));
        assert!(matches!(said(r#"{"say":"undo"}"#), Ok(Said::Undo)));
        assert!(matches!(said(r#"{"say":"inspect","layer":"lux"}"#), Ok(Said::Inspect { layer }) if layer == "lux"));
        for wrong in
            ["", "{}", "[]", r#"{"say":"format_disk"}"#, r#"{"say":"give","to":-1}"#, r#"{"say":"pick","x":"a"}"#]
        {
            assert!(said(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn only_more_of_the_same_drag_supersedes_an_edit() {
        let edit = |changes: &[Change], gesture| Said::Edit { changes: changes.to_vec(), gesture, at: 0.0 };
        let hide = |object| Change::Visible { object, visible: false };
        let drag = edit(&[Change::Time(1.0)], Some(1));
        assert!(edit(&[hide(1), Change::Time(2.0)], Some(1)).supersedes(&drag));
        for other in [
            edit(&[Change::Time(2.0)], Some(2)),
            edit(&[Change::Time(2.0)], None),
            edit(&[hide(1)], Some(1)),
            Said::Undo,
        ] {
            assert!(!other.supersedes(&drag), "{other:?}");
        }
        assert!(!edit(&[hide(1)], None).supersedes(&edit(&[hide(1)], None)), "two steps to be undone");
    }

    #[test]
    fn where_a_time_and_an_offset_put_what_moves_is_told() {
        let key = |time: f64| scenes::Key { time, translate: Vec3::splat(time as f32), angle_deg: 0.0 };
        let (keys, offset) = (vec![key(0.0), key(4.0)], scenes::Offset::default());
        let motion = scenes::Motion { pivot: Vec3::ZERO, axis: Vec3::Y, keys, offset };
        let mut objects = vec![scenes::Object::fixed("a", 0), scenes::Object::fixed("b", 0)];
        objects[1].motion = Some(motion);
        let scene = Scene { objects, ..Scene::default() };
        let at = |place: Vec3| vec![(1, Transform { translation: place, ..Transform::IDENTITY })];
        let time = [Change::Time(2.0)];
        let hide = [Change::Visible { object: 0, visible: false }];
        let put = [Change::Offset { object: 1, offset: scenes::Offset { shift: Vec3::X, ..offset } }];
        assert_eq!(poses(&scene, &[], &time), at(Vec3::splat(2.0)));
        assert_eq!(poses(&scene, &time, &put), at(Vec3::new(3.0, 2.0, 2.0)));
        assert_eq!(poses(&scene, &time, &hide), []);
    }

    #[test]
    fn views_that_show_nothing_are_refused() {
        let view = |target: Vec3, fov_y_deg: f32| View { origin: Vec3::ZERO, target, up: Vec3::Y, fov_y_deg, at: 0.0 };
        assert!(view(Vec3::X, 40.0).camera([8, 8]).is_ok());
        for (target, fov) in [(Vec3::ZERO, 40.0), (Vec3::Y, 40.0), (Vec3::X, 0.0), (Vec3::X, f32::NAN)] {
            assert!(view(target, fov).camera([8, 8]).is_err());
        }
    }
}
