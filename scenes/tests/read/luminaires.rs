//! Luminaires by their files.

use glam::Vec3;
use scenes::photometry::photometric;
use scenes::read::{Loaded, photometry};
use scenes::solid::solid_angle;
use scenes::{Light, Pixels};

use crate::folder::{Folder, notes};

const OBJ: &[u8] = b"v -1 0 0\nv 1 0 0\nv 0 2 0\nf 1 2 3\n";
/// 100 cd straight down, 50 at 45°, none from 90° on; of one lamp of 500 lm.
const IES: &[u8] =
    b"IESNA:LM-63-2002\r\n[TEST] none\r\nTILT=INCLUDE\r\n1\r\n2\r\n0 90\r\n1 0.5\r\n1 500 1 3 1 1 2 0 0 0\r\n1 1 10\r\n0 45 90\r\n0\r\n100 50 0\r\n";

fn try_load(profile: (&str, &[u8]), fields: &str) -> Result<Loaded, String> {
    let json = format!(
        r#"{{"obj": "a.obj", "lights": [{{"type": "luminaire", "name": "desk", "profile": "{}", "position": [0, 2, 0]{fields}}}]}}"#,
        profile.0
    );
    let folder = Folder::of(&[("a.obj", OBJ), ("scene.json", json.as_bytes()), profile]);
    folder.try_load("").map_err(|error| error.to_string())
}

fn load(fields: &str) -> Loaded {
    try_load(("lamp.ies", IES), fields).unwrap()
}

fn peak(fields: &str) -> f32 {
    photometric(load(fields).scene.lights[0].power())
}

fn close(found: f32, expected: f32) {
    assert!((found / expected - 1.0).abs() < 1e-3, "{found}, expected {expected}");
}

#[test]
fn a_luminaire_hangs_aims_and_shines_as_its_file_says() {
    let loaded = load("");
    // ∫ of what falls evenly to 0 at 90°: 2π · 100 · (1 − 2/π) lm.
    assert!(
        notes(&loaded).contains("lamp.ies: shines with 228 lm, of 500 lm of its lamps, 100 cd at most"),
        "{}",
        notes(&loaded)
    );
    let scene = loaded.scene;
    let Light::Luminaire { position, direction, side, intensity, solid } = scene.lights[0] else {
        panic!("no luminaire")
    };
    assert_eq!((position, direction, side), (Vec3::Y * 2.0, Vec3::NEG_Y, Vec3::X));
    close(photometric(intensity), 100.0);
    assert!(scene.lights_are_photometric && scene.light_names == ["desk"]);
    let web = &scene.textures[solid as usize];
    assert_eq!((web.width, web.height), (1, 5), "a step of 45° meets all angles");
    let Pixels::Float(texels) = &web.pixels else { panic!("no web") };
    assert_eq!(texels.iter().map(|texel| texel[0]).collect::<Vec<_>>(), [1.0, 0.5, 0.0, 0.0, 0.0]);
}

#[test]
fn it_can_be_dimmed_coloured_tilted_turned_and_of_other_lumens() {
    close(peak(r#", "dimming": 0.25"#), 25.0);
    close(peak(r#", "colour": "2700 K""#), 100.0);
    let flux = peak(r#", "lumens": 1000"#);
    close(peak(r#", "lumens": "2 klm""#), 2.0 * flux);
    // Aimed at the horizon, its lamp has half of its light; half-way, three quarters.
    close(peak(r#", "direction": [1, 0, 0]"#), 50.0);
    close(peak(r#", "target": [2, 0, 0]"#), 75.0);
    let side = |fields: &str| match load(fields).scene.lights[0] {
        Light::Luminaire { side, .. } => side,
        _ => panic!("no luminaire"),
    };
    // From above, x to the right and −z up: counter-clockwise.
    assert!((side(r#", "turn_deg": 90"#) - Vec3::NEG_Z).length() < 1e-6, "{}", side(r#", "turn_deg": 90"#));
    assert!((side(r#", "side": [0, 3, 4]"#) - Vec3::Z).length() < 1e-6);
}

/// 300 cd in all directions downwards.
fn ldt() -> String {
    let mut lines = vec!["nobody", "1", "1", "1", "0", "2", "90", "", "", "", "", ""];
    lines.extend(["0"; 9]);
    lines.extend(["100", "100", "1", "0", "1", "1", "", "1500", "", "", "10"]);
    lines.extend(["0"; 10]);
    lines.extend(["0", "0", "90", "200", "200"]);
    lines.join("\n")
}

#[test]
fn eulumdat_is_known_by_its_name() {
    let text = ldt();
    let scene = try_load(("lamp.LDT", text.as_bytes()), "").unwrap().scene;
    close(photometric(scene.lights[0].power()), 300.0);
}

#[test]
fn what_is_wrong_is_named_with_its_field_or_line() {
    for (fields, expected) in [
        (r#", "dimming": 2"#, "lights[0].dimming: 2 is not within 0..1"),
        (r#", "lumens": 0"#, "lights[0].lumens: must be more than 0"),
        (r#", "lumens": "5 lx""#, "lights[0].lumens: `5 lx` has another unit"),
        (r#", "colour": "5 K""#, "lights[0].colour: `5 K` is not within"),
        (r#", "direction": [0, 0, 0]"#, "lights[0].direction: has no direction"),
        (r#", "direction": [0, 1, 0], "target": [0, 0, 0]"#, "has a direction or a target"),
        (r#", "side": [0, 1, 0]"#, "lights[0].side: has no direction across"),
    ] {
        let error = try_load(("lamp.ies", IES), fields).unwrap_err();
        assert!(error.contains(expected), "{fields}\n{error}");
    }
    let error =
        try_load(("other.ies", IES), "").map(|_| ()).and(try_load(("lamp.ies", b"TILT=NONE\n1 2 x"), "")).unwrap_err();
    assert!(error.contains("lamp.ies:2: `x` is no number, where the multiplier should be"), "{error}");
    let dark = String::from_utf8_lossy(IES).replace("100 50 0", "0 0 0");
    let error = try_load(("lamp.ies", dark.as_bytes()), "").unwrap_err();
    assert!(error.contains("sends no light in any direction"), "{error}");
}

/// Opened as a scene of its own, it hangs where the camera sees what it lights.
#[test]
fn a_file_alone_hangs_over_a_floor_and_before_a_wall() {
    let upwards = String::from_utf8(IES.to_vec()).unwrap().replace("0 45 90\r\n", "90 135 180\r\n");
    let ldt = ldt();
    let folder = Folder::of(&[
        ("Desk lamp.IES", IES),
        ("up.ies", upwards.as_bytes()),
        ("desk.ldt", ldt.as_bytes()),
        ("scene.json", br#"{ "model": "Desk lamp.IES", "name": "by JSON" }"#),
        ("broken.ies", b"TILT=NONE\n1 2\n"),
    ]);
    for (file, name, surfaces) in [
        ("Desk lamp.IES", "Desk lamp", vec!["floor", "wall"]),
        ("", "by JSON", vec!["floor", "wall"]),
        ("desk.ldt", "desk", vec!["floor", "wall"]),
        ("up.ies", "up", vec!["floor", "wall", "ceiling"]),
    ] {
        let loaded = folder.load(file);
        assert!(notes(&loaded).contains("a luminaire alone: hung 2.7 m above a floor"), "{}", notes(&loaded));
        let scene = loaded.scene;
        assert_eq!(scene.name, name);
        assert_eq!(scene.objects.iter().map(|object| object.name.as_str()).collect::<Vec<_>>(), surfaces);
        let [Light::Luminaire { position, direction, .. }] = scene.lights[..] else { panic!("one luminaire") };
        assert_eq!((position, direction, scene.light_names.len()), (Vec3::Y * 2.7, Vec3::NEG_Y, 1));
        assert!(scene.lights_are_photometric && scene.environment == scenes::Environment::Black);
        let facing = |object: usize| {
            let mesh = &scene.meshes[scene.objects[object].mesh as usize];
            let [a, b, c] = mesh.triangles[0].map(|corner| mesh.positions[corner as usize]);
            (b - a).cross(c - a).normalize().dot((position - a).normalize())
        };
        assert!((0..surfaces.len()).all(|object| facing(object) > 0.0), "all surfaces face the lamp");
        // Below the lamp, behind it, and itself.
        let camera = &scene.camera;
        let ahead = (camera.target - camera.origin).normalize();
        for place in [Vec3::ZERO, Vec3::new(0.0, 1.5, -1.0), position] {
            let off = ahead.dot((place - camera.origin).normalize()).acos().to_degrees();
            assert!(off < camera.fov_y_deg / 2.0, "{place} is seen: {off}");
        }
    }
    let refused = folder.try_load("broken.ies").unwrap_err().to_string();
    assert!(refused.contains("broken.ies:2: "), "{refused}");
}

#[test]
fn a_file_that_is_sent_says_the_same_as_one_that_lies_there_and_reads_no_other() {
    let sent = photometry("C:\\Downloads/lamp.ies", IES).unwrap();
    let Light::Luminaire { intensity, solid, .. } = load("").scene.lights[0] else { panic!("no luminaire") };
    assert_eq!(sent.solid.texture(), *load("").scene.textures[solid as usize]);
    close(sent.peak as f32, photometric(intensity));
    assert!((sent.flux / (200.0 * std::f64::consts::PI - 400.0) - 1.0).abs() < 1e-4, "{}", sent.flux);
    let lumens = sent.peak * solid_angle(&sent.solid.texture());
    assert!((lumens / sent.flux - 1.0).abs() < 1e-6, "{lumens} {}", sent.flux);
    assert_eq!((sent.lamps, sent.share(Vec3::NEG_Y), sent.share(Vec3::X)), (Some(500.0), 1.0, 0.5));
    photometry("lamp.LDT", ldt().as_bytes()).unwrap();

    let folder = Folder::of(&[("tilt.tlt", b"1\n2\n0 90\n1 0.5\n")]);
    let tilt = folder.path("tilt.tlt");
    let named =
        format!("IESNA:LM-63-2002\nTILT={}\n1 500 1 3 1 1 2 0 0 0\n1 1 10\n0 45 90\n0\n100 50 0\n", tilt.display());
    let long = "x".repeat(300);
    for (name, bytes, expected) in [
        ("lamp.ies", named.as_bytes(), "lamp.ies:2: TILT="),
        ("lamp.ies", b"IESNA:LM-63-2002\nTILT=NONE\n1 500 1 3 one".as_slice(), "lamp.ies:3: `one` is no number"),
        ("lamp.ies", b"", "has no line TILT="),
        ("lamp.ldt", b"nobody\n1\n", "lamp.ldt"),
        ("a\nb.ies", IES, "cannot be shown"),
        (&long, IES, "too long"),
    ] {
        let error = photometry(name, bytes).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}
