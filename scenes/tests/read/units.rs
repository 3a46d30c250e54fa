//! Lights in their units, and skies by formula.

use glam::Vec3;
use scenes::photometry::photometric;
use scenes::read::Loaded;
use scenes::{Environment, Light, Pixels, Scene};

use crate::folder::{Folder, notes};

const OBJ: &[u8] = b"v -1 0 0\nv 1 0 0\nv 0 2 0\nf 1 2 3\n";

fn try_load(fields: &str) -> Result<Loaded, String> {
    let json = format!(r#"{{"obj": "a.obj", {fields}}}"#);
    let folder = Folder::of(&[("a.obj", OBJ), ("scene.json", json.as_bytes())]);
    folder.try_load("").map_err(|error| error.to_string())
}

fn load(fields: &str) -> Scene {
    try_load(fields).unwrap().scene
}

fn lamp(fields: &str) -> Scene {
    load(&format!(r#""lights": [{{{fields}}}]"#))
}

fn close(found: f32, expected: f32) {
    assert!((found / expected - 1.0).abs() < 1e-5, "{found}, expected {expected}");
}

#[test]
fn typed_figures_are_what_a_meter_reads() {
    let point = |rest: &str| lamp(&format!(r#""type": "point", "position": [0, 1, 0], {rest}"#));
    let read = |scene: &Scene| photometric(scene.lights[0].power());
    for typed in ["400 cd", "400cd", " 0.4 kcd", "4e2 cd", "400\u{a0}cd"] {
        let scene = point(&format!(r#""intensity": "{typed}""#));
        close(read(&scene), 400.0);
        assert!(scene.lights_are_photometric);
    }
    close(read(&point(r#""intensity": "1500 lm""#)), 1500.0 / (4.0 * std::f32::consts::PI));
    assert_eq!(point(r#""intensity": "2.5 W/sr""#).lights[0].power(), Vec3::splat(2.5));
    // Whatever the colour.
    for colour in [r#""2700 K""#, r#"{"xy": [0.46, 0.41]}"#, "[3, 0, 0]", "[0.1, 0.1, 5]"] {
        let scene = point(&format!(r#""intensity": "400 cd", "colour": {colour}"#));
        close(read(&scene), 400.0);
    }
    let warm = point(r#""intensity": {"value": "400 cd", "colour": "2700 K"}"#).lights[0].power();
    assert!(warm.x > 1.5 * warm.y && warm.y > 1.5 * warm.z && warm.z > 0.0, "{warm}");
    // Three numbers are watts, as ever.
    let plain = point(r#""intensity": [4, 5, 6]"#);
    assert_eq!((plain.lights[0].power(), plain.lights_are_photometric), (Vec3::new(4.0, 5.0, 6.0), false));
}

#[test]
fn a_spot_s_lumens_are_those_in_its_cone() {
    let scene = lamp(
        r#""type": "spot", "position": [0, 1, 0], "direction": [0, -1, 0], "intensity": "1000 lm", "inner_deg": 20, "outer_deg": 40"#,
    );
    let Light::Spot { cos_inner, cos_outer, intensity, .. } = scene.lights[0] else { panic!("no spot") };
    // ∫ of the fall-off over the cone, by the midpoint rule in the cosine.
    let n = 10_000;
    let mean: f32 = (0..n)
        .map(|i| {
            let cos = cos_outer + (1.0 - cos_outer) * (i as f32 + 0.5) / n as f32;
            ((cos - cos_outer) / (cos_inner - cos_outer)).min(1.0).powi(2) / n as f32
        })
        .sum();
    let lumens = photometric(intensity) * mean * 2.0 * std::f32::consts::PI * (1.0 - cos_outer);
    assert!((lumens / 1000.0 - 1.0).abs() < 1e-3, "{lumens}");
}

#[test]
fn suns_and_backgrounds_have_units_too() {
    let scene = load(
        r#""background": {"value": "3000 cd/m2", "colour": "6500 K"},
        "lights": [{"type": "directional", "direction": [0, -1, 0], "irradiance": "80 klx", "angular_diameter_deg": 0.53}]"#,
    );
    let Environment::Constant(radiance) = scene.environment else { panic!("no sky") };
    close(photometric(radiance), 3000.0);
    let Light::Directional { irradiance, diameter_deg, .. } = scene.lights[0] else { panic!("no sun") };
    close(photometric(irradiance), 80_000.0);
    assert_eq!(diameter_deg, 0.53);
    close(
        photometric(match load(r#""background": "100 cd/m²""#).environment {
            Environment::Constant(radiance) => radiance,
            _ => panic!("no sky"),
        }),
        100.0,
    );
}

#[test]
fn a_unit_that_does_not_fit_is_named_with_its_field() {
    let point = |rest: &str| format!(r#""lights": [{{"type": "point", "position": [0, 1, 0], {rest}}}]"#);
    let sun = |rest: &str| format!(r#""lights": [{{"type": "directional", "direction": [0, -1, 0], {rest}}}]"#);
    for (fields, expected) in [
        (point(r#""intensity": "400 lx""#), "lights[0].intensity: `400 lx` has another unit than cd, lm, W/sr"),
        (point(r#""intensity": "400""#), "lights[0].intensity: `400` has another unit"),
        (point(r#""intensity": "bright""#), "lights[0].intensity: `bright` is no number with a unit"),
        (point(r#""intensity": "-4 cd""#), "lights[0].intensity: `-4 cd` is negative"),
        (point(r#""intensity": "1e999 cd""#), "lights[0].intensity: `1e999 cd` is negative or not finite"),
        (point(r#""intensity": "1e300 cd""#), "lights[0].intensity: `1e300 cd` is beyond"),
        (point(r#""intensity": 400"#), "lights[0].intensity: must be three numbers, or a figure with its unit"),
        (point(r#""intensity": "4 cd", "colour": "900 K""#), "lights[0].colour: `900 K` is not within 1667..25000 K"),
        (point(r#""intensity": "4 cd", "colour": "warm""#), "lights[0].colour: `warm` is no number of kelvin"),
        (point(r#""intensity": "4 cd", "colour": {"xy": [0.9, 0.9]}"#), "lights[0].colour: xy: [0.9,0.9]"),
        (point(r#""intensity": "4 cd", "colour": [0, 0, 0]"#), "lights[0].colour: must be kelvin"),
        (point(r#""intensity": [1, 1, 1], "colour": "2700 K""#), "lights[0].colour: goes with a figure"),
        (sun(r#""irradiance": "4 cd""#), "lights[0].irradiance: `4 cd` has another unit than lx"),
        (sun(r#""irradiance": [1, 1, 1], "angular_diameter_deg": 200"#), "angular_diameter_deg: 200 is neither 0"),
        (sun(r#""irradiance": [1, 1, 1], "angular_diameter_deg": -1"#), "angular_diameter_deg: -1 is neither 0"),
        (r#""background": "4 lx""#.into(), "background: `4 lx` has another unit than cd/m2"),
    ] {
        let error = try_load(&fields).unwrap_err();
        assert!(error.contains(expected), "{fields}\n{error}");
    }
}

const MUNICH: &str = r#""latitude": 48.14, "longitude": 11.58, "date": "2026-06-21", "time": "14:00", "utc_offset": 2"#;

fn sky(fields: &str) -> String {
    format!(r#""environment": {{"sky": {{{fields}}}}}"#)
}

#[test]
fn a_sky_has_a_sun_where_place_and_time_put_it() {
    let loaded = try_load(&sky(&format!(r#""model": "cie", "type": 12, {MUNICH}"#))).unwrap();
    // The hour angle is 11.1°, 44 minutes after true noon, and the declination 23.43°: sin h = 0.897.
    assert!(notes(&loaded).contains("the sun stands 63.8° high, 203.6°"), "{}", notes(&loaded));
    let scene = loaded.scene;
    let Light::Directional { direction, irradiance, diameter_deg } = scene.lights[0] else { panic!("no sun") };
    assert_eq!((diameter_deg, scene.light_names.as_slice()), (0.53, &["sun".to_owned()][..]));
    assert!((direction.y + 63.77_f32.to_radians().sin()).abs() < 3e-3, "{direction}");
    assert!(direction.z < -0.3 && direction.x > 0.05, "it shines from south and a little west: {direction}");
    assert!((50_000.0..120_000.0).contains(&photometric(irradiance)), "{irradiance}");
    // What the table integrates to is what the sky brings: 10 to 25 klx under a clear sky.
    let Environment::Image { texture, scale, .. } = scene.environment else { panic!("no sky") };
    let texture = &scene.textures[texture as usize];
    let Pixels::Float(texels) = &texture.pixels else { panic!("no radiance") };
    let (width, height) = (texture.width as usize, texture.height as usize);
    let mut level = Vec3::ZERO;
    for (i, texel) in texels.iter().enumerate().take(width * height / 2) {
        let edge = |row: usize| (std::f32::consts::PI * row as f32 / height as f32).cos();
        let (top, bottom) = (edge(i / width), edge(i / width + 1));
        level +=
            Vec3::from(*texel) * scale * ((top * top - bottom * bottom) / 2.0 * std::f32::consts::TAU / width as f32);
    }
    let lux = photometric(level);
    assert!((5_000.0..25_000.0).contains(&lux), "{lux}");
    // The ground sends back a fifth of that and of the sun's.
    let ground = photometric(Vec3::from(texels[width * height - 1]));
    let all = lux + photometric(irradiance) * -direction.y;
    assert!((ground * std::f32::consts::PI / (0.2 * all) - 1.0).abs() < 1e-2, "{ground} of {all}");
}

#[test]
fn a_sky_is_as_bright_as_is_said_and_its_sun_can_be_left_out() {
    let scene = load(&sky(r#""model": "cie", "type": 5, "sun_altitude_deg": 30, "zenith": "1000 cd/m2", "ground": 0"#));
    let Pixels::Float(texels) = &scene.textures[0].pixels else { panic!("no radiance") };
    close(photometric(Vec3::from(texels[0])), 1000.0);
    assert_eq!((scene.lights.len(), texels[texels.len() - 1]), (0, [0.0; 3]));
    let given =
        r#""model": "preetham", "turbidity": 3, "sun_altitude_deg": 30, "sun_azimuth_deg": 90, "north_deg": 90, "#;
    let scene = load(&sky(&format!(r#"{given} "sun": {{"irradiance": "50 klx", "colour": "4000 K"}}"#)));
    close(photometric(scene.lights[0].power()), 50_000.0);
    let Light::Directional { direction, .. } = scene.lights[0] else { panic!("no sun") };
    assert!((direction - Vec3::new(0.0, -0.5, -0.75_f32.sqrt())).length() < 1e-5, "east is +z here: {direction}");
    assert_eq!(load(&sky(&format!(r#"{given} "sun": false"#))).lights.len(), 0);
}

#[test]
fn a_sky_that_cannot_be_is_refused_by_its_field() {
    for (fields, expected) in [
        (r#""model": "cie", "type": 16, "sun_altitude_deg": 9"#.to_owned(), "environment.sky.type: must be 1 to 15"),
        (r#""model": "hosek", "sun_altitude_deg": 9"#.to_owned(), "environment.sky.model: `hosek` is neither"),
        (r#""model": "preetham", "type": 1, "sun_altitude_deg": 9"#.to_owned(), "environment.sky.type: goes with"),
        (r#""model": "preetham""#.to_owned(), "environment.sky.latitude: is missing"),
        (r#""model": "preetham", "sun_altitude_deg": -3"#.to_owned(), "the sun is 3.0° below the horizon"),
        (
            r#""model": "preetham", "sun_altitude_deg": 9, "turbidity": 90"#.to_owned(),
            "turbidity: 90 is not within 1.7..10",
        ),
        (r#""model": "preetham", "sun_altitude_deg": 9, "ground": 2"#.to_owned(), "ground: is a reflectance"),
        (
            r#""model": "preetham", "sun_altitude_deg": 9, "zenith": "9 lx""#.to_owned(),
            "environment.sky.zenith: `9 lx`",
        ),
        (
            format!(r#""model": "cie", "type": 1, {}"#, MUNICH.replace("06-21", "02-30")),
            "environment.sky.date: is no date of the years 1900 to 2100",
        ),
        (format!(r#""model": "cie", "type": 1, {}"#, MUNICH.replace("14:00", "2 pm")), "environment.sky.time: must be"),
        (format!(r#""model": "cie", "type": 1, {}"#, MUNICH.replace("14:00", "02:00")), "below the horizon then"),
    ] {
        let error = try_load(&sky(&fields)).unwrap_err();
        assert!(error.contains(expected), "{fields}\n{error}");
    }
    let error = try_load(r#""environment": {"scale": 2}"#).unwrap_err();
    assert!(error.contains("environment: needs either image or sky"), "{error}");
}
