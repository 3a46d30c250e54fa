//! What viewers send: hostile until it has been read into these types and checked against the scene.

use std::collections::BTreeMap;

use frame::front_end::Value;
use glam::Vec3;
use scenes::Change;
use serde::{Deserialize, Serialize};

use super::{Spot, ToneSettings, Viewpoint};

/// Longest message of a viewer, bytes: a material or a few hundred moved objects fit.
pub const CLIENT_MESSAGE_MAX: usize = 64 << 10;
/// Largest file of a luminaire that a viewer may send, bytes …
pub const LUMINAIRE_FILE_MAX: usize = 1 << 20;
/// … and the longest message with one: base64 has four letters for three bytes.
pub const LUMINAIRE_MESSAGE_MAX: usize = LUMINAIRE_FILE_MAX / 3 * 4 + CLIENT_MESSAGE_MAX;

/// A message from a viewer. [`Self::needs_controls`] tells which only the holder of the controls may send.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "say", rename_all = "snake_case")]
pub enum ClientMessage {
    /// Look from elsewhere.
    Look(Viewpoint),
    /// Edit the scene.
    Edit {
        /// In order.
        changes: Vec<Change>,
        /// Edits with the same number are one step to be undone.
        gesture: Option<u64>,
        /// As in [`Viewpoint::at`].
        #[serde(default)]
        at: f64,
    },
    /// Hang up a luminaire by its file of photometric data. Answered with [`super::ServerMessage::Hung`].
    Hang {
        /// The file's name; its ending says which format it has.
        file: String,
        /// Its bytes, base64; [`LUMINAIRE_FILE_MAX`] at most.
        data: String,
        /// Instead of these lamps, where they are and aimed as they are.
        #[serde(default)]
        lights: Vec<u32>,
        /// If none is named: a new lamp on what is seen here, or on the ceiling above it.
        #[serde(default)]
        at: Option<Spot>,
    },
    /// Take the last step back.
    Undo,
    /// Make the last step that was taken back again.
    Redo,
    /// Expose and tone-map otherwise.
    Tone(ToneSettings),
    /// Show still pictures denoised, or as they are.
    Denoise {
        /// Denoised.
        on: bool,
    },
    /// Draw each lamp apart while the picture rests, so that dimming them shows at once; or draw all anew.
    Mix {
        /// Apart.
        on: bool,
    },
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
        values: BTreeMap<String, Value>,
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
    /// Save the scene as it is now, edits and view, as a scene file. Where, the master's command line says.
    Save,
    /// Save a view beside the others.
    SaveView {
        /// From where.
        #[serde(flatten)]
        view: Viewpoint,
        /// For people.
        #[serde(default)]
        name: String,
        /// As [`scenes::SavedView::picture`].
        #[serde(default)]
        picture: Option<String>,
        /// With the lamps as they are.
        #[serde(default)]
        lamps: bool,
    },
    /// Call a saved view otherwise.
    NameView {
        /// From 0 on.
        number: usize,
        /// For people.
        name: String,
    },
    /// Light the scene as it is in a saved view, in one step to be undone.
    Relight {
        /// From 0 on.
        number: usize,
    },
    /// Forget a saved view.
    ForgetView {
        /// From 0 on.
        number: usize,
    },
    /// Keep how all lamps are now, under a name: one that is kept already is written over.
    SavePreset {
        /// For people.
        name: String,
    },
    /// Forget how lamps were.
    ForgetPreset {
        /// From 0 on.
        number: usize,
    },
    /// Go on with the session that an earlier master has kept.
    TakeUp,
    /// Forget that session.
    StartAfresh,
    /// Give the controls to another viewer, or to oneself: keep them although another has asked.
    Give {
        /// The number of a viewer.
        to: u64,
    },
    /// The place for the picture, which is drawn as large as the controls' holder has it.
    Shape {
        /// Pixels of the screen.
        width: u32,
        /// Pixels of the screen.
        height: u32,
    },
    /// Whether the viewer is out of sight: a page behind others, a minimised window.
    Hidden {
        /// It is.
        hidden: bool,
    },
    /// Ask for the controls: given at once if they are free.
    Take,
    /// What is here? Answered with [`super::ServerMessage::Picked`].
    Pick(Spot),
    /// Where does a step lead? Answered with [`super::ServerMessage::Walked`].
    Walk {
        /// Where the eyes are.
        origin: Vec3,
        /// How far people want to go.
        by: Vec3,
        /// How high eyes are above the ground.
        height: f32,
    },
    /// What are the numbers here? Answered with [`super::ServerMessage::Probed`].
    Probe(Spot),
    /// A picture is on the screen: the next may come.
    Drawn {
        /// Which.
        number: u64,
    },
    /// Send the current state again, from [`super::ServerMessage::Welcome`] on.
    Refresh,
}

impl ClientMessage {
    /// Only the holder of the controls may send this.
    pub fn needs_controls(&self) -> bool {
        !matches!(self, Self::Take | Self::Shape { .. } | Self::Hidden { .. } | Self::Drawn { .. })
            && !self.is_question()
    }

    /// Longest message of its kind, bytes.
    pub fn longest(&self) -> usize {
        if matches!(self, Self::Hang { .. }) { LUMINAIRE_MESSAGE_MAX } else { CLIENT_MESSAGE_MAX }
    }

    /// Changes nothing, and is answered to its sender alone.
    pub fn is_question(&self) -> bool {
        matches!(self, Self::Pick(_) | Self::Probe(_) | Self::Walk { .. } | Self::Refresh)
    }

    /// When the same viewer sends this right after `earlier`, that can be dropped: another look, or more of one drag.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_pages_send_is_read_and_nothing_else() {
        let read = |text: &str| serde_json::from_str::<ClientMessage>(text);
        let look = read(r#"{"say":"look","origin":[0,1,2],"target":[0,0,0],"up":[0,1,0],"fov_y_deg":40,"at":12.5}"#);
        assert!(matches!(look, Ok(ClientMessage::Look(Viewpoint { at: 12.5, .. }))), "{look:?}");
        let moved = r#"{"say":"edit","gesture":3,"changes":[{"Transform":{"object":1,"scene_from_object":
            {"linear":[1,0,0,0,1,0,0,0,1],"translation":[0,1,0]}}}]}"#;
        assert!(matches!(read(moved), Ok(ClientMessage::Edit { gesture: Some(3), .. })), "{:?}", read(moved));
        assert!(matches!(read(r#"{"say":"undo"}"#), Ok(ClientMessage::Undo)));
        assert!(matches!(read(r#"{"say":"save"}"#), Ok(ClientMessage::Save)));
        let inspect = read(r#"{"say":"inspect","layer":"lux"}"#);
        assert!(matches!(inspect, Ok(ClientMessage::Inspect { layer }) if layer == "lux"));
        for wrong in
            ["", "{}", "[]", r#"{"say":"format_disk"}"#, r#"{"say":"give","to":-1}"#, r#"{"say":"pick","x":"a"}"#]
        {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn only_more_of_the_same_drag_supersedes_an_edit() {
        let edit = |changes: &[Change], gesture| ClientMessage::Edit { changes: changes.to_vec(), gesture, at: 0.0 };
        let hide = |object| Change::Visible { object, visible: false };
        let drag = edit(&[Change::Time(1.0)], Some(1));
        assert!(edit(&[hide(1), Change::Time(2.0)], Some(1)).supersedes(&drag));
        for other in [
            edit(&[Change::Time(2.0)], Some(2)),
            edit(&[Change::Time(2.0)], None),
            edit(&[hide(1)], Some(1)),
            ClientMessage::Undo,
        ] {
            assert!(!other.supersedes(&drag), "{other:?}");
        }
        assert!(!edit(&[hide(1)], None).supersedes(&edit(&[hide(1)], None)), "two steps to be undone");
    }
}
