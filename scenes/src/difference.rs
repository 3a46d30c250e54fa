//! What was edited, seen from what it was and what it is: the state, and nothing of how it came about.

use crate::{Change, Light, Scene, Solid};

impl Scene {
    /// The changes that lead from this scene to another state of it; the camera's aside. In any order, but for photometric
    /// solids that lamps have, which come first; those that none has are left out.
    pub fn changes_to(&self, now: &Self) -> Vec<Change> {
        let mut changes = Vec::new();
        let solids = now.lights.iter().filter_map(|light| match light {
            Light::Luminaire { solid, .. } => Some(*solid),
            _ => None,
        });
        let end = solids.max().map_or(0, |last| last as usize + 1);
        for texture in self.textures.len()..end {
            let value = Solid::of(&now.textures[texture]);
            changes.extend(value.map(|value| Change::Solid { texture: texture as u32, value: value.into() }));
        }
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
        let own = |scene: &Self| -> Vec<(u32, Option<u32>, u32)> {
            let of = |(number, object): (u32, &crate::Object)| {
                let whole = (number, None);
                object.lifted.as_ref().map_or(whole, |lifted| (lifted.of, Some(lifted.piece)))
            };
            let all = (0..).zip(&scene.objects).map(|object| (of(object), &object.1.own));
            all.flat_map(|((object, piece), own)| own.iter().map(move |own| (object, piece, own.instead_of))).collect()
        };
        let mut named = [own(self), own(now)].concat();
        named.sort_unstable();
        named.dedup();
        for (object, piece, material) in named {
            let [was, is] = [self, now].map(|scene| scene.own_material(object, piece, material));
            if was != is {
                changes.push(Change::OwnMaterial { object, piece, material, value: is.cloned() });
            }
        }
        let shared = self.shared_materials().min(now.shared_materials());
        for (material, (was, is)) in (0..).zip(self.materials[..shared].iter().zip(&now.materials)) {
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
