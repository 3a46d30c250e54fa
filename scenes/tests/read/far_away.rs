//! Scenes far from the origin, and scenes of other sizes.

use glam::{DVec3, Vec3};
use scenes::Light;
use scenes::read::Loaded;

use crate::folder::Folder;

const CORNERS: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.001, 0.0], [1.003, 1.0, 0.25], [0.0, 1.0, 0.002]];

fn room(scale: f64, offset: DVec3) -> Loaded {
    let place = |p: [f64; 3]| DVec3::from(p) * scale + offset;
    let mut obj = String::from("o thing\n");
    for corner in CORNERS.map(place) {
        obj += &format!("v {} {} {}\n", corner.x, corner.y, corner.z);
    }
    obj += "f 1 2 3\nf 1 3 4\n";
    let array = |p: DVec3| format!("[{}, {}, {}]", p.x, p.y, p.z);
    let (eye, lamp) = (array(place([0.5, 0.5, 3.0])), array(place([0.0, 2.0, 1.0])));
    let (target, pivot) = (array(place([0.5, 0.5, 0.0])), array(place([0.25, 0.0, 0.0])));
    let json = format!(
        r#"{{"obj": "a.obj", "camera": {{"origin": {eye}, "target": {target}, "fov_y_deg": 40}},
        "lights": [{{"type": "point", "position": {lamp}, "intensity": [1, 1, 1]}}],
        "animation": [{{"object": "thing", "pivot": {pivot}, "keyframes": [{{"t": 0, "angle_deg": 90}}]}}]}}"#
    );
    Folder::of(&[("a.obj", obj.as_bytes()), ("scene.json", json.as_bytes())]).load("")
}

fn points(loaded: &Loaded) -> Vec<Vec3> {
    let scene = &loaded.scene;
    let Light::Point { position, .. } = scene.lights[0] else { panic!("the light changed its kind") };
    let mesh = &scene.meshes[scene.objects[0].mesh as usize];
    let posed = mesh.positions.iter().map(|p| scene.objects[0].scene_from_object.point(*p));
    posed.chain([position, scene.camera.origin, scene.camera.target]).collect()
}

#[test]
fn a_scene_a_million_metres_away_keeps_its_millimetres() {
    let near = room(1.0, DVec3::ZERO);
    let far = room(1.0, DVec3::new(1e6, -2e6, 3e6));
    assert_eq!(near.scene.centre, DVec3::ZERO);
    assert!(far.scene.centre.x > 9e5);
    let shift = points(&near)[0] - points(&far)[0];
    for (a, b) in points(&near).into_iter().zip(points(&far)) {
        assert!((a - b - shift).length() < 1e-5, "{a} {b}");
    }
}

#[test]
fn scaling_by_a_power_of_two_scales_every_bit() {
    for (offset, power) in [(0.0, 10), (0.0, -10), (1024.0, 4), (1024.0, -20)] {
        let factor = f64::from(2.0_f32).powi(power);
        let (one, other) = (room(1.0, DVec3::splat(offset)), room(factor, DVec3::splat(offset) * factor));
        assert_eq!(other.scene.centre, one.scene.centre * factor);
        for (a, b) in points(&one).into_iter().zip(points(&other)) {
            assert_eq!(a * factor as f32, b, "scaled by 2^{power}");
        }
    }
}
