//! Luminaires by their files.

use glam::Vec3;
use scenes::photometry::photometric;
use scenes::read::Loaded;
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

#[test]
fn eulumdat_is_known_by_its_name() {
    let mut lines = vec!["nobody", "1", "1", "1", "0", "2", "90", "", "", "", "", ""];
    lines.extend(["0"; 9]);
    lines.extend(["100", "100", "1", "0", "1", "1", "", "1500", "", "", "10"]);
    lines.extend(["0"; 10]);
    lines.extend(["0", "0", "90", "200", "200"]);
    let text = lines.join("\n");
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
