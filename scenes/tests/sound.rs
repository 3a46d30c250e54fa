//! What [`Scene::check`] refuses, what changes refuse, and what a scene needs.

use std::sync::Arc;

use glam::{Mat3, Vec2, Vec3};
use proptest::prelude::*;
use scenes::{
    Camera, Change, Colour, Coverage, Dielectric, Environment, Gloss, Key, Light, LookUp, Material, Mesh, Motion,
    Needs, Object, Offset, Pixels, Scalar, Scene, Sheen, Specular, Surface, Texture, Transform,
};

fn matt() -> Gloss {
    Gloss::new(Colour::plain(Vec3::ONE), Scalar::plain(1.0), Scalar::plain(0.0))
}

/// With one of everything.
fn scene() -> Scene {
    let texture = |pixels| Texture { name: "t".into(), width: 1, height: 1, pixels, look_up: LookUp::REPEAT };
    let glossy = Surface::Glossy(Gloss::new(
        Colour { value: Vec3::ONE, texture: Some(0) },
        Scalar { value: 1.0, texture: Some((1, 1)) },
        Scalar::plain(0.5),
    ));
    let mut shiny = Material { surface: glossy, ..Material::diffuse("shiny", Vec3::ONE) };
    shiny.coverage = Some(Coverage::mask(0, 3, 0.5));
    let glass = Surface::Dielectric(Dielectric::clear(1.5, false));
    let glass = Material { surface: glass, ..Material::diffuse("glass", Vec3::ONE) };
    let mut lamp = Material::diffuse("lamp", Vec3::splat(0.5));
    lamp.emission = Colour::plain(Vec3::splat(10.0));
    let mesh = Mesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z],
        normals: vec![Vec3::Z, Vec3::ZERO, Vec3::Y, Vec3::X],
        uvs: vec![Vec2::ZERO; 4],
        triangles: vec![[0, 1, 2], [0, 2, 3], [0, 3, 1]],
        materials: vec![0, 1, 2],
        ..Mesh::default()
    };
    let keys = vec![
        Key { time: 0.0, translate: Vec3::ZERO, angle_deg: 0.0 },
        Key { time: 1.0, translate: Vec3::X, angle_deg: 90.0 },
    ];
    let mut moving = Object::fixed("moving", 0);
    moving.motion =
        Some(Motion { pivot: Vec3::ZERO, axis: Vec3::Y, keys, poses: Vec::new(), offset: Offset::default() });
    Scene {
        meshes: vec![mesh.into()],
        objects: vec![Object::fixed("fixed", 0), moving],
        materials: vec![shiny, glass, lamp],
        textures: vec![
            texture(Pixels::Srgb8(vec![[255; 4]])).into(),
            texture(Pixels::Linear8(vec![[255; 4]])).into(),
            texture(Pixels::Float(vec![[1.0; 3]])).into(),
        ],
        lights: vec![
            Light::Point { position: Vec3::ONE, intensity: Vec3::ONE },
            Light::Spot {
                position: Vec3::ONE,
                direction: Vec3::X,
                intensity: Vec3::ONE,
                cos_inner: 0.9,
                cos_outer: 0.5,
            },
            Light::Directional { direction: Vec3::X, irradiance: Vec3::ZERO, diameter_deg: 0.0 },
        ],
        light_names: vec![],
        environment: Environment::Image { texture: 2, scale: Vec3::ONE, turn: 0.0 },
        ..Scene::default()
    }
}

#[test]
fn a_sound_scene_is_sound() {
    scene().check().unwrap();
    Scene::default().check().unwrap();
}

type Break = fn(&mut Scene);

fn mesh(scene: &mut Scene) -> &mut Mesh {
    Arc::make_mut(&mut scene.meshes[0])
}

fn texture_of(scene: &mut Scene, index: usize) -> &mut Texture {
    Arc::make_mut(&mut scene.textures[index])
}

#[test]
fn every_broken_promise_is_found_and_named() {
    let breaks: &[(&str, Break)] = &[
        ("centre", |s| s.centre.x = f64::NAN),
        ("camera", |s| s.camera.target = s.camera.origin),
        ("camera", |s| s.camera.up = Vec3::Z),
        ("camera", |s| s.camera.fov_y_deg = f32::NAN),
        ("camera", |s| s.camera.width = 0),
        ("meshes[0].positions[2]", |s| mesh(s).positions[2].y = f32::INFINITY),
        ("meshes[0].normals[1]", |s| mesh(s).normals[1] = Vec3::splat(2.0)),
        ("meshes[0].uvs[3]", |s| mesh(s).uvs[3].x = f32::NAN),
        ("meshes[0]", |s| mesh(s).uvs.truncate(2)),
        ("meshes[0]", |s| mesh(s).normals.truncate(3)),
        ("meshes[0]", |s| mesh(s).materials.truncate(1)),
        ("meshes[0].triangles[1]", |s| mesh(s).triangles[1] = [0, 1, 4]),
        ("meshes[0].triangles[2]", |s| mesh(s).triangles[2] = [1, 1, 2]),
        ("meshes[0].materials[0]", |s| mesh(s).materials[0] = 3),
        ("objects[1]", |s| s.objects[1].mesh = 1),
        ("objects[0].scene_from_object", |s| s.objects[0].scene_from_object.translation.x = f32::NAN),
        ("objects[0].scene_from_object", |s| {
            s.objects[0].scene_from_object.linear = Mat3::from_diagonal(Vec3::new(1.0, 0.0, 1.0))
        }),
        ("objects[1].motion.keys", |s| s.objects[1].motion.as_mut().unwrap().keys.clear()),
        ("objects[1].motion.keys", |s| s.objects[1].motion.as_mut().unwrap().keys.reverse()),
        ("objects[1].motion.offset.own", |s| s.objects[1].motion.as_mut().unwrap().offset.own.linear = Mat3::ZERO),
        ("objects[1].motion", |s| s.objects[1].motion.as_mut().unwrap().offset.shift.x = f32::NAN),
        ("objects[1].motion", |s| s.time = f64::NAN),
        ("objects[1].motion.axis", |s| s.objects[1].motion.as_mut().unwrap().axis = Vec3::ZERO),
        ("materials[0].base", |s| {
            s.materials[0].surface = Surface::Glossy(Gloss::new(
                Colour { value: Vec3::ONE, texture: Some(9) },
                Scalar::plain(1.0),
                Scalar::plain(0.0),
            ))
        }),
        ("materials[0].specular.colour", |s| {
            let colour = Colour::plain(Vec3::splat(-1.0));
            s.materials[0].surface =
                Surface::Glossy(Gloss { specular: Specular { colour, ..Specular::WHOLE }, ..matt() })
        }),
        ("materials[0].sheen.colour", |s| {
            let sheen = Some(Sheen { colour: Colour::plain(Vec3::splat(1.5)), roughness: Scalar::plain(0.5) });
            s.materials[0].surface = Surface::Glossy(Gloss { sheen, ..matt() })
        }),
        ("materials[2].albedo", |s| {
            s.materials[2].surface = Surface::Diffuse { albedo: Colour::plain(Vec3::splat(1.5)) }
        }),
        ("materials[1].ior", |s| s.materials[1].surface = Surface::Dielectric(Dielectric::clear(0.0, true))),
        ("materials[1].reflectance", |s| s.materials[1].surface = Surface::Mirror { reflectance: Vec3::splat(-0.1) }),
        ("materials[2].emission", |s| s.materials[2].emission.value.x = -1.0),
        ("materials[2].emission", |s| s.materials[2].emission.value.x = f32::INFINITY),
        ("materials[0].coverage", |s| s.materials[0].coverage.as_mut().unwrap().amount.texture = Some((0, 4))),
        ("textures[0]", |s| texture_of(s, 0).width = 2),
        ("textures[1]", |s| {
            let texture = texture_of(s, 1);
            (texture.width, texture.pixels) = (0, Pixels::Linear8(vec![]));
        }),
        ("textures[2].pixels[0]", |s| texture_of(s, 2).pixels = Pixels::Float(vec![[0.0, f32::NAN, 0.0]])),
        ("lights[0].position", |s| s.lights[0] = Light::Point { position: Vec3::NAN, intensity: Vec3::ONE }),
        ("lights[0]", |s| s.lights[0] = Light::Point { position: Vec3::ONE, intensity: Vec3::NEG_X }),
        ("lights[2].direction", |s| {
            s.lights[2] = Light::Directional { direction: Vec3::ZERO, irradiance: Vec3::ONE, diameter_deg: 0.0 }
        }),
        ("environment", |s| s.environment = Environment::Image { texture: 0, scale: Vec3::ONE, turn: 0.0 }),
        ("environment", |s| s.environment = Environment::Image { texture: 7, scale: Vec3::ONE, turn: 0.0 }),
        ("environment", |s| s.environment = Environment::Constant(Vec3::NEG_ONE)),
    ];
    for (i, (place, hurt)) in breaks.iter().enumerate() {
        let mut scene = scene();
        hurt(&mut scene);
        let unsound = scene.check().expect_err(&format!("break {i}, in {place}, is not found"));
        assert_eq!(unsound.place, *place, "break {i}: {unsound}");
    }
}

#[test]
fn changes_are_applied_or_refused_whole() {
    let mut scene = scene();
    let turned = Transform { linear: Mat3::from_diagonal(Vec3::splat(2.0)), translation: Vec3::X };
    Change::Transform { object: 0, scene_from_object: turned }.apply(&mut scene).unwrap();
    assert_eq!(scene.objects[0].scene_from_object, turned);
    Change::Time(1.0).apply(&mut scene).unwrap();
    assert!((scene.objects[1].scene_from_object.point(Vec3::Z) - Vec3::new(2.0, 0.0, 0.0)).length() < 1e-6);

    let before = scene.clone();
    let flat = Transform { linear: Mat3::ZERO, translation: Vec3::ZERO };
    let refused = [
        Change::Camera(Camera { fov_y_deg: 200.0, ..Camera::default() }),
        Change::Transform { object: 0, scene_from_object: flat },
        Change::Transform { object: 5, scene_from_object: turned },
        Change::Transform { object: 1, scene_from_object: turned },
        Change::Offset { object: 0, offset: Offset::default() },
        Change::Offset { object: 1, offset: Offset { shift: Vec3::NAN, ..Offset::default() } },
        Change::Offset { object: 1, offset: Offset { own: flat, ..Offset::default() } },
        Change::Visible { object: 2, visible: false },
        Change::Light { light: 0, value: Light::Point { position: Vec3::NAN, intensity: Vec3::ONE } },
        Change::Light { light: 3, value: Light::Point { position: Vec3::ONE, intensity: Vec3::ONE } },
        Change::Material { material: 0, value: Material::diffuse("bright", Vec3::splat(2.0)) },
        Change::Time(f64::NAN),
    ];
    for change in refused {
        let error = change.apply(&mut scene).expect_err(&format!("{change:?}"));
        assert!(error.to_string().starts_with("change refused: "), "{error}");
        assert_eq!(scene, before);
    }
}

#[test]
fn needs_count_what_visible_objects_use() {
    let mut scene = scene();
    let needs = Needs::of(&scene);
    assert_eq!((needs.objects, needs.animated, needs.triangles, needs.emissive_triangles), (2, 1, 6, 2));
    assert_eq!((needs.glass, needs.glossy, needs.diffuse, needs.coverage, needs.textured), (1, 1, 2, 1, 1));
    assert_eq!((needs.point_lights, needs.spot_lights, needs.directional_lights), (1, 1, 0), "a black sun is none");
    assert!(needs.environment_image && needs.smooth_normals && needs.caustics() && needs.instances());
    scene.objects.iter_mut().for_each(|object| object.visible = false);
    scene.lights.clear();
    scene.environment = Environment::Black;
    assert_eq!(Needs::of(&scene), Needs::default());
}

/// Of metal that is as smooth as this, or plastic, nothing but what rays that follow its lobe find is to be had.
#[test]
fn smooth_metals_spread_no_light() {
    let spreads = |roughness: f32, metalness: f32, multiple_scattering: bool| {
        let mut scene = Scene { multiple_scattering, ..scene() };
        let (base, metalness) = (Colour::plain(Vec3::ONE), Scalar::plain(metalness));
        let surface = Surface::Glossy(Gloss::new(base, Scalar::plain(roughness), metalness));
        scene.materials.iter_mut().for_each(|material| material.surface = surface.clone());
        let needs = Needs::of(&scene);
        assert!(needs.diffuse > 0 && needs.caustics() == (needs.sharp > 0), "lit by a point");
        scene.lights.clear();
        assert_eq!(Needs::of(&scene).caustics(), needs.spreading > 0 && needs.sharp > 0);
        needs.spreading > 0
    };
    assert!(!spreads(0.3, 1.0, false), "smooth metal");
    assert!(
        spreads(0.3, 0.9, false) && spreads(0.3, 1.0, true) && spreads(0.5, 1.0, false),
        "a base, facets, a rough lobe"
    );
}

proptest! {
    #[test]
    fn motion_is_rigid_passes_its_keys_and_rests_outside(time in -1.0..4.0_f64, angle in -720.0..720.0_f64) {
        let keys = vec![
            Key { time: 0.0, translate: Vec3::ZERO, angle_deg: 0.0 },
            Key { time: 2.0, translate: Vec3::new(1.0, 2.0, 3.0), angle_deg: angle },
        ];
        let motion = Motion { pivot: Vec3::new(1.0, 0.0, -1.0), axis: Vec3::new(0.6, 0.0, 0.8), keys, poses: Vec::new(), offset: Offset::default() };
        let pose = motion.at(time);
        prop_assert!((pose.linear * pose.linear.transpose() - Mat3::IDENTITY).to_cols_array().iter().all(|c| c.abs() < 1e-5));
        prop_assert!((pose.linear.determinant() - 1.0).abs() < 1e-5);
        prop_assert!(motion.at(0.0).is_identity());
        prop_assert_eq!(motion.at(time.max(2.0)), motion.at(2.0));
        let pivot = pose.point(motion.pivot) - motion.pivot;
        let s = (time / 2.0).clamp(0.0, 1.0) as f32;
        prop_assert!((pivot - Vec3::new(1.0, 2.0, 3.0) * s).length() < 1e-5);
    }

    #[test]
    fn what_moves_goes_on_from_where_it_was_put(
        held in 0.0..2.0_f64, later in 0.0..2.0_f64, by in prop::array::uniform3(-5.0..5.0_f32),
        turn in 0.1..3.0_f32, size in 0.2..3.0_f32
    ) {
        let keys = vec![
            Key { time: 0.0, translate: Vec3::ZERO, angle_deg: 0.0 },
            Key { time: 2.0, translate: Vec3::new(1.0, 2.0, 3.0), angle_deg: 200.0 },
        ];
        let (pivot, axis) = (Vec3::new(1.0, 0.0, -1.0), Vec3::new(0.6, 0.0, 0.8));
        let file = Motion { pivot, axis, keys, poses: Vec::new(), offset: Offset::default() };
        let put = |motion: &Motion, place: Transform| {
            Motion { offset: motion.offset_to(held, &place), ..motion.clone() }
        };
        let near = |a: Transform, b: Transform| {
            a.linear.abs_diff_eq(b.linear, 1e-4) && a.translation.abs_diff_eq(b.translation, 1e-3)
        };
        let shifted = |place: Transform, by: Vec3| Transform { translation: place.translation + by, ..place };
        let by = Vec3::from(by);

        // Shifted: so is its whole way, whatever was done to it before.
        let once = put(&file, shifted(file.at(held), by));
        prop_assert!(near(once.at(held), shifted(file.at(held), by)));
        prop_assert!(near(once.at(later), shifted(file.at(later), by)));

        // Turned and sized about a point of its own: that point keeps its way.
        let point = Vec3::new(0.3, 0.4, -0.2);
        let (map, pivot) = (Mat3::from_rotation_z(turn) * size, once.at(held).point(point));
        let place = once.at(held);
        let around = Transform { linear: map * place.linear, translation: pivot + map * (place.translation - pivot) };
        let twice = put(&once, around);
        prop_assert!(near(twice.at(held), around));
        prop_assert!(twice.at(later).point(point).abs_diff_eq(once.at(later).point(point), 1e-3));
        prop_assert!((twice.at(later).linear.determinant().cbrt() - size).abs() < 1e-4 * size);

        // Of a drag, only where it ends counts; and what was put back is where it was.
        let ends = put(&put(&twice, shifted(around, by)), shifted(around, 2.0 * by));
        prop_assert_eq!(ends.offset, put(&twice, shifted(around, 2.0 * by)).offset);
        prop_assert!(near(put(&ends, around).at(later), twice.at(later)));
    }

    #[test]
    fn what_is_seen_at_a_pixel_is_seen_in_its_direction(x in 0.0..640.0_f32, y in 0.0..480.0_f32, far in 0.1..100.0_f32) {
        let lens = Camera { origin: Vec3::new(1.0, 2.0, 3.0), ..Camera::default() }.lens();
        let (px, py, distance) = lens.project(lens.origin() + lens.direction(x, y) * far).unwrap();
        prop_assert!((px - x).abs() < 0.01 && (py - y).abs() < 0.01 && (distance - far).abs() < 1e-4 * far);
    }
}
