//! What a scene lacks and cannot do without: a camera, a light.

use std::path::Path;

use glam::{DVec3, Vec3};

use super::error::Notes;
use super::glow;
use super::mesh::Bounds;
use crate::{Camera, Environment, Scene};

/// Radiance of the environment that lights a scene without light.
const DAYLIGHT: Vec3 = Vec3::ONE;

/// What glows lights a scene if it gives so much of daylight. Emitters of bare rooms give from 0.07 to 3, an LED next to 0.
const EMITTERS_SHARE: f64 = 0.02;
/// The same for what is no brighter than a white wall in daylight: a luminous ceiling gives more, a screen before a desk
/// less.
const SCREENS_SHARE: f64 = 0.1;

/// Gives light to a scene that has none, or next to none; unless its file says what its sky is, and something shines.
pub(super) fn light(path: &Path, scene: &mut Scene, sky_is_said: bool, notes: &mut Notes) {
    let needs = crate::Needs::of(scene);
    if !needs.light() {
        scene.environment = Environment::Constant(DAYLIGHT);
        notes.file(path, "nothing in the scene shines: lit by a white environment of radiance 1");
        return;
    }
    let only_glows = needs.point_lights + needs.spot_lights + needs.directional_lights == 0 && !needs.environment;
    if sky_is_said || !only_glows {
        return;
    }
    let glow = glow::of(scene);
    let percent = match 100.0 * glow.share_of_daylight {
        percent if percent < 0.1 => "less than 0.1 % of daylight".to_owned(),
        percent => format!("about {percent:.1} % of daylight"),
    };
    if glow.share_of_daylight < if glow.brightest > 1.0 { EMITTERS_SHARE } else { SCREENS_SHARE } {
        scene.environment = Environment::Constant(DAYLIGHT);
        let message = format!(
            "what glows gives the scene {percent}: lit by a white environment of radiance 1 as well; \
             \"background\": [0, 0, 0] in a scene.json leaves it out"
        );
        notes.file(path, message);
    } else {
        notes.file(path, format!("lit by what glows in it ({percent}); \"background\" in a scene.json adds a sky"));
    }
}

/// A camera that sees everything: from outside, a little above, along the longer floor side.
pub(super) fn camera(path: &Path, scene: &Scene, notes: &mut Notes) -> Camera {
    let bounds = bounds(scene);
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
    let [o, t] = [origin + scene.centre, middle + scene.centre];
    let message = format!(
        "no camera: made one at [{:.4}, {:.4}, {:.4}] that looks at [{:.4}, {:.4}, {:.4}]",
        o.x, o.y, o.z, t.x, t.y, t.z
    );
    notes.file(path, message);
    camera
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
