//! What was edited, seen from what it was and what it is: the state, and nothing of how it came about.

use crate::{Change, Scene};

impl Scene {
    /// The changes that lead from this scene to another state of it, in any order; the camera's aside.
    pub fn changes_to(&self, now: &Self) -> Vec<Change> {
        let mut changes = Vec::new();
        let wholes = self.wholes().min(now.wholes());
        for (object, (was, is)) in (0..).zip(self.objects[..wholes].iter().zip(&now.objects)) {
            match (&was.motion, &is.motion) {
                (Some(was), Some(is)) if was.offset != is.offset => {
                    changes.push(Change::Offset { object, offset: is.offset });
                }
                (None, None) if was.scene_from_object != is.scene_from_object => {
                    changes.push(Change::Transform { object, scene_from_object: is.scene_from_object });
                }
                _ => {}
            }
            if was.visible != is.visible {
                changes.push(Change::Visible { object, visible: is.visible });
            }
        }
        let pieces = |scene: &Self| -> Vec<(u32, u32)> {
            let lifted = scene.objects.iter().filter_map(|object| object.lifted.as_ref());
            lifted.map(|lifted| (lifted.of, lifted.piece)).collect()
        };
        let mut named = [pieces(self), pieces(now)].concat();
        named.sort_unstable();
        named.dedup();
        for (object, piece) in named {
            let (was, is) = (self.piece(object, piece), now.piece(object, piece));
            if was.whole_from_piece != is.whole_from_piece {
                changes.push(Change::PieceTransform { object, piece, whole_from_piece: is.whole_from_piece });
            }
            if was.visible != is.visible {
                changes.push(Change::PieceVisible { object, piece, visible: is.visible });
            }
        }
        for (material, (was, is)) in (0..).zip(self.materials.iter().zip(&now.materials)) {
            if was != is {
                changes.push(Change::Material { material, value: is.clone() });
            }
        }
        for light in 0..self.lights.len().max(now.lights.len()) as u32 {
            match (self.lamp(light), now.lamp(light)) {
                (was, is) if was == is => {}
                (Some(was), Some(is)) if was.name == is.name => {
                    changes.push(Change::Light { light, value: is.light });
                }
                (_, value) => changes.push(Change::Lamp { light, value }),
            }
        }
        if self.environment != now.environment {
            changes.push(Change::Environment(now.environment));
        }
        if self.time != now.time {
            changes.push(Change::Time(now.time));
        }
        changes
    }
}
