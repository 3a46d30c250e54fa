//! Rows 24, 25, 32: what files must not do to light.

use std::path::Path;

use glam::{DVec3, Vec3};
use protocol::answer::{Body, Pixels};
use protocol::pack;
use protocol::question::Quality;
use scenes::read::{self, Loaded};
use scenes::{Environment, LookUp, Scene, Texture};

use super::edges::{differing, rough_mean};
use crate::case::{Case, Finding, Method, Pace, Trial};
use crate::measure::picture;
use crate::worlds::{glass, hunted, stress};

use Method::{Igi, Machinery};
use Pace::Quick;

/// The cases.
pub const CASES: &[Case] = &[
    Case {
        row: 24,
        name: "a-million-metres-away",
        teaches: "a scene 10⁶ m from the origin looks as it does here",
        pace: Quick,
        methods: &[Igi],
        run: a_million_metres_away,
    },
    Case {
        row: 25,
        name: "broken-triangles",
        teaches: "triangles without area, or with a corner that is no number, leave no trace but a note",
        pace: Quick,
        methods: &[Igi],
        run: broken_triangles,
    },
    Case {
        row: 25,
        name: "needles",
        teaches: "triangles a million times as long as wide leave no hole",
        pace: Quick,
        methods: Method::VIRTUAL,
        run: |trial| {
            let [whole, needles] = stress::needles().map(|scene| rough_mean(trial, &scene, 4));
            vec![Finding::exact("mean over that of the whole square", 1.0, needles / whole, 1e-3)]
        },
    },
    Case {
        row: 25,
        name: "nothing-added",
        teaches: "meshes without triangles and hidden objects change no bit",
        pace: Quick,
        methods: Method::VIRTUAL,
        run: |trial| {
            let scene = &glass::ball_in_a_box(1.5)[1];
            let quality = trial.quality();
            let both = [scene, &hunted::with_nothing_added(scene)].map(|scene| picture(scene, &quality, 1, 1));
            vec![differing("pixels that differ", &both[0], &both[1])]
        },
    },
    Case {
        row: 32,
        name: "numbers-that-are-none",
        teaches: "NaN, infinite and negative numbers are refused or dropped, and counted",
        pace: Quick,
        methods: &[Machinery],
        run: |_| numbers_that_are_none(),
    },
];

/// Reads files from a folder of their own; `None` if it cannot be written or is refused.
fn load(files: &[(&str, String)]) -> Result<Loaded, String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    for (name, text) in files {
        std::fs::write(folder.path().join(name), text).map_err(|error| error.to_string())?;
    }
    let first: &Path = files[0].0.as_ref();
    read::load(&folder.path().join(first)).map_err(|error| error.to_string())
}

/// A floor and two walls of odd corners, an emitter and a camera, all moved by an offset.
fn room_at(offset: DVec3) -> Result<Scene, String> {
    let place = |x: f64, y: f64, z: f64| DVec3::new(x, y, z) + offset;
    let corners = [
        [-1.0, 0.0, -1.0],
        [1.003, 0.0, -1.0],
        [1.0, 0.0, 1.0],
        [-1.0, 0.001, 1.0],
        [-1.0, 2.0, -1.0],
        [1.0, 1.997, -1.0],
        [-1.0, 2.0, 1.0],
    ];
    let mut obj = String::new();
    for p in corners.map(|[x, y, z]| place(x, y, z)) {
        obj += &format!("v {} {} {}\n", p.x, p.y, p.z);
    }
    obj += "f 1 4 3 2\nf 1 2 6 5\nf 1 5 7 4\n";
    let text = |p: DVec3| format!("[{}, {}, {}]", p.x, p.y, p.z);
    let (eye, target) = (text(place(1.5, 1.2, 2.5)), text(place(-0.2, 0.6, -0.2)));
    let json = format!(
        r#"{{"obj": "a.obj", "background": [0, 0, 0],
        "camera": {{"origin": {eye}, "target": {target}, "fov_y_deg": 40, "width": 24, "height": 24}},
        "lights": [{{"type": "point", "position": {}, "intensity": [1, 1, 1]}}]}}"#,
        text(place(0.5, 1.5, 0.5))
    );
    Ok(load(&[("scene.json", json), ("a.obj", obj)])?.scene)
}

fn a_million_metres_away(trial: &Trial) -> Vec<Finding> {
    let scenes = (room_at(DVec3::ZERO), room_at(DVec3::new(1e6, -2e6, 3e6)));
    let (Ok(near), Ok(far)) = scenes else { return vec![Finding::holds("both are read", false)] };
    let quality = Quality { interleave: [1, 1], ..trial.quality() };
    let [near, far] = [near, far].map(|scene| picture(&scene, &quality, 16, 1));
    let square = |(a, b): (&DVec3, &DVec3)| (*a - *b).length_squared() / 3.0;
    let rmse = (near.iter().zip(&far).map(square).sum::<f64>() / near.len() as f64).sqrt();
    let brightest = near.iter().map(|p| p.max_element()).fold(0.0, f64::max);
    let note = format!("brightest pixel {brightest:.3}");
    vec![Finding { tolerance: 1e-3, ..Finding::exact("RMSE against the scene here", 0.0, rmse, 0.0) }.note(note)]
}

fn broken_triangles(trial: &Trial) -> Vec<Finding> {
    let loaded = stress::obj_with_broken_triangles().map(|text| load(&[("a.obj", text)]));
    let [Ok(clean), Ok(broken)] = loaded else { return vec![Finding::holds("both are read", false)] };
    let view = |mut scene: Scene| {
        (scene.camera.width, scene.camera.height) = (32, 24);
        picture(&scene, &trial.quality(), 1, 1)
    };
    let counted = broken.notes.iter().any(|note| note.to_string().contains("3 triangles without area"));
    let pixels = differing("pixels that differ", &view(clean.scene), &view(broken.scene));
    vec![pixels, Finding::holds("what was dropped is counted", counted)]
}

fn numbers_that_are_none() -> Vec<Finding> {
    // Samples.
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0];
    let mut pixels = Pixels::black(3 * bad.len() + 1);
    for (i, number) in bad.into_iter().enumerate() {
        pixels.emitted[i] = Vec3::new(1.0, number, 1.0);
        pixels.irradiance[bad.len() + i] = Vec3::new(number, 1.0, 1.0);
        pixels.distance[2 * bad.len() + i] = number;
    }
    let mut body = Body::Pixels(pixels);
    let dropped = pack::drop_unsound(&mut body);
    let pixels = body.pixels().unwrap_or_default();
    let left = pixels.emitted.iter().chain(&pixels.irradiance).filter(|c| **c != Vec3::ZERO).count();
    // Texels, which may come over the network.
    let texel = |number: f32| {
        let pixels = scenes::Pixels::Float(vec![[1.0, number, 1.0]]);
        let mut scene = stress::dark_room();
        let sky = Texture { name: "sky".into(), width: 1, height: 1, pixels, look_up: LookUp::REPEAT };
        scene.textures.push(sky.into());
        scene.environment = Environment::Image { texture: 0, scale: Vec3::ONE, turn: 0.0 };
        scene.check().is_ok()
    };
    let accepted = bad.into_iter().filter(|number| texel(*number)).count();
    // Files.
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let vertices = load(&[("a.obj", format!("{triangle}v nan 0 0\nv 0 inf 0\nf 1 2 4\nf 1 2 5\n"))]);
    let normals = load(&[("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn nan 0 0\nf 1//1 2//1 3//1\n".to_string())]);
    let albedo = load(&[
        ("a.obj", format!("mtllib a.mtl\nusemtl m\n{triangle}")),
        ("a.mtl", "newmtl m\nKd nan 0.5 0.5\n".to_string()),
    ]);
    let said = |loaded: &Result<Loaded, String>| loaded.as_ref().map_or(true, |l| !l.notes.is_empty());
    let sound = |loaded: &Result<Loaded, String>| loaded.as_ref().map_or(true, |l| l.scene.check().is_ok());
    let files = [vertices, normals, albedo];
    vec![
        Finding::exact("samples dropped and counted", 3.0 * bad.len() as f64, dropped as f64, 0.0),
        Finding::none("channels left of them", left),
        Finding::none("bad texels accepted", accepted),
        Finding::none("unsound scenes from files", files.iter().filter(|file| !sound(file)).count()),
        Finding::none("files repaired in silence", files.iter().filter(|file| !said(file)).count()),
    ]
}
