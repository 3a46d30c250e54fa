//! What a scene lacks and cannot do without: a camera, a light.

use std::path::Path;

use glam::{DVec3, Vec3};

use super::enclosure::{self, Room};
use super::error::Notes;
use super::mesh::Bounds;
use super::{glow, studio};
use crate::{Camera, Scene};

/// What glows lights a scene if it gives so much of daylight. Emitters of bare rooms give from 0.07 to 3, an LED next to 0.
const EMITTERS_SHARE: f64 = 0.02;
/// The same for what is no brighter than a white wall in daylight: a luminous ceiling gives more, a screen before a desk
/// less.
const SCREENS_SHARE: f64 = 0.1;

/// Gives light to a scene that has none, or next to none; unless its file says what its sky is, and something shines.
///
/// `room` is what the camera was made up in.
pub(super) fn light(path: &Path, scene: &mut Scene, sky_is_said: bool, room: Option<Room>, notes: &mut Notes) {
    let needs = crate::Needs::of(scene);
    if !needs.light() {
        let camera = scene.camera;
        studio::sky(scene, &camera);
        let mut lit = "nothing in the scene shines: lit by a studio's sky".to_owned();
        if let Some(room) = room.or_else(|| enclosure::room(scene, &bounds(scene))) {
            studio::lamp(scene, &room);
            lit += ", and by a lamp in the room";
        }
        notes.file(path, lit);
        return;
    }
    let only_glows = needs.bare_lights() + needs.suns == 0 && !needs.environment;
    if sky_is_said || !only_glows {
        return;
    }
    let glow = glow::of(scene);
    let percent = match 100.0 * glow.share_of_daylight {
        percent if percent < 0.1 => "less than 0.1 % of daylight".to_owned(),
        percent => format!("about {percent:.1} % of daylight"),
    };
    if glow.share_of_daylight < if glow.brightest > 1.0 { EMITTERS_SHARE } else { SCREENS_SHARE } {
        let camera = scene.camera;
        studio::sky(scene, &camera);
        let message = format!(
            "what glows gives the scene {percent}: lit by a studio's sky as well; \
             \"background\": [0, 0, 0] in a scene.json leaves it out"
        );
        notes.file(path, message);
    } else {
        notes.file(path, format!("lit by what glows in it ({percent}); \"background\" in a scene.json adds a sky"));
    }
}

/// A camera that sees everything: within a room, along its length; else from outside, a little above, along the longer floor
/// side.
pub(super) fn camera(path: &Path, scene: &Scene, notes: &mut Notes) -> (Camera, Option<Room>) {
    let bounds = bounds(scene);
    if let Some(room) = enclosure::room(scene, &bounds) {
        return (inside(path, scene, &room, notes), Some(room));
    }
    let middle = bounds.middle();
    let fov_y_deg = 45.0;
    let radius = (bounds.diameter() / 2.0).max(f64::from(f32::MIN_POSITIVE));
    let distance = 1.05 * radius / libm::sin(f64::to_radians(fov_y_deg) / 2.0);
    let size = bounds.max - bounds.min;
    let side = if size.x > size.z { DVec3::new(0.35, 0.3, 1.0) } else { DVec3::new(1.0, 0.3, 0.35) };
    let origin = middle + side.normalize() * distance;
    let camera = Camera {
        origin: origin.as_vec3(),
        target: middle.as_vec3(),
        up: Vec3::Y,
        fov_y_deg: fov_y_deg as f32,
        ..Camera::default()
    };
    say(path, scene, [origin, middle], "", notes);
    (camera, None)
}

/// A camera that stands near one end of a room, and looks to the other.
fn inside(path: &Path, scene: &Scene, room: &Room, notes: &mut Notes) -> Camera {
    // Somewhat below the middle of floor and ceiling, as eyes are.
    let level = DVec3::Y * (0.45 * room.up - 0.55 * room.down);
    let origin = room.middle - room.along * (0.8 * room.behind) + level;
    let target = room.middle + room.along * (0.5 * room.ahead) - DVec3::Y * (0.1 * room.down);
    say(path, scene, [origin, target], "in the room, ", notes);
    let (origin, target) = (origin.as_vec3(), target.as_vec3());
    Camera { origin, target, up: Vec3::Y, fov_y_deg: 65.0, ..Camera::default() }
}

fn say(path: &Path, scene: &Scene, places: [DVec3; 2], wherein: &str, notes: &mut Notes) {
    let [o, t] = places.map(|place| place + scene.centre);
    let message = format!(
        "no camera: made one {wherein}at [{:.4}, {:.4}, {:.4}] that looks at [{:.4}, {:.4}, {:.4}]",
        o.x, o.y, o.z, t.x, t.y, t.z
    );
    notes.file(path, message);
}

fn bounds(scene: &Scene) -> Bounds {
    let mut bounds = Bounds::default();
    for object in scene.objects.iter().filter(|object| object.visible) {
        for &position in &scene.meshes[object.mesh as usize].positions {
            bounds.add(object.scene_from_object.point(position).as_dvec3());
        }
    }
    bounds
}
