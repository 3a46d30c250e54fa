//! A room that needs little of a renderer, and the same room in a file full of things that nobody sees.

use std::sync::Arc;

use glam::{Mat3, Vec2, Vec3};
use scenes::{
    Camera, Colour, Coverage, Dielectric, Environment, Gloss, Key, Light, LookUp, Material, Mesh, Motion, Object,
    Offset, Pixels, Scalar, Scene, Surface, Texture, Transform,
};

/// A room of grey, red and green walls, open at the front, with two blocks and a point light: all is diffuse, and
/// nothing is textured, moves, or shines by itself.
pub fn plain_room() -> Scene {
    let mut mesh = Mesh::default();
    let wall = |mesh: &mut Mesh, corners: [Vec3; 4], material: u32| {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(corners);
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        mesh.materials.extend([material; 2]);
    };
    cuboid(Vec3::new(0.0, 1.0, 0.0), Vec3::ONE, &mut |face, corners| match face {
        0 => wall(&mut mesh, corners, 1),
        1 => wall(&mut mesh, corners, 2),
        5 => {}
        _ => wall(&mut mesh, corners, 0),
    });
    for (middle, half) in [([-0.35, 0.6, -0.3], [0.28, 0.6, 0.28]), ([0.35, 0.3, 0.3], [0.28, 0.3, 0.28])] {
        cuboid(Vec3::from(middle), Vec3::from(half), &mut |_, corners| wall(&mut mesh, corners, 0));
    }
    let paint = |name: &str, albedo: [f32; 3]| Material::diffuse(name, Vec3::from(albedo));
    Scene {
        name: "plain room".into(),
        camera: Camera {
            origin: Vec3::new(0.0, 1.0, 3.5),
            target: Vec3::new(0.0, 1.0, 0.0),
            up: Vec3::Y,
            fov_y_deg: 41.0,
            width: 320,
            height: 320,
            ..Camera::default()
        },
        meshes: vec![mesh.into()],
        objects: vec![Object::fixed("room", 0)],
        materials: vec![paint("grey", [0.7, 0.7, 0.7]), paint("red", [0.6, 0.1, 0.1]), paint("green", [0.1, 0.5, 0.1])],
        lights: vec![Light::Point { position: Vec3::new(0.0, 1.8, 0.0), intensity: Vec3::splat(1.5) }],
        ..Scene::default()
    }
}

/// The same picture, from a file that also holds glass, mirrors, gloss, textures, holes, lamps, a moving object, lights
/// and an environment: hidden, unused, or black.
pub fn laden_room() -> Scene {
    let mut scene = plain_room();
    scene.name = "plain room, laden".into();
    let texels = |texel: [u8; 4]| Pixels::Srgb8(vec![texel; 16]);
    let texture =
        |name: &str, pixels| Texture { name: name.into(), width: 4, height: 4, pixels, look_up: LookUp::REPEAT };
    scene.textures = [
        texture("paper", texels([200, 180, 160, 255])),
        texture("holes", texels([255, 255, 255, 0])),
        texture("night", Pixels::Float(vec![[0.0; 3]; 16])),
    ]
    .map(Arc::new)
    .into();
    let surface = |name: &str, surface| Material { surface, ..Material::diffuse(name, Vec3::ZERO) };
    let papered = Colour { value: Vec3::ONE, texture: Some(0) };
    scene.materials.extend([
        surface("mirror", Surface::Mirror { reflectance: Vec3::splat(0.9) }),
        surface("glass", Surface::Dielectric(Dielectric::clear(1.5, false))),
        surface("gloss", Surface::Glossy(Gloss::new(papered, Scalar::plain(0.2), Scalar::plain(0.5)))),
        surface("paper", Surface::Diffuse { albedo: papered }),
        Material { coverage: Some(Coverage::mask(1, 3, 0.5)), ..Material::diffuse("lace", Vec3::splat(0.5)) },
        Material { emission: Colour::plain(Vec3::splat(20.0)), ..Material::diffuse("lamp", Vec3::ZERO) },
    ]);
    // What nobody looks at: texture coordinates, and an object of all those materials that is hidden.
    let room = Arc::make_mut(&mut scene.meshes[0]);
    room.uvs = room.positions.iter().map(|p| Vec2::new(p.x, p.y)).collect();
    let mut things = Mesh { normals: vec![], ..Mesh::default() };
    cuboid(Vec3::new(0.0, 0.5, 0.5), Vec3::splat(0.3), &mut |face, corners| {
        let first = things.positions.len() as u32;
        things.positions.extend(corners);
        things.normals.extend([Vec3::Y; 4]);
        things.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        things.materials.extend([3 + face as u32; 2]);
    });
    scene.meshes.push(things.into());
    let key = |time, angle_deg| Key { time, translate: Vec3::ZERO, angle_deg };
    scene.objects.push(Object {
        scene_from_object: Transform { linear: Mat3::IDENTITY, translation: Vec3::X * 0.1 },
        motion: Some(Motion {
            pivot: Vec3::ZERO,
            axis: Vec3::Y,
            keys: vec![key(0.0, 0.0), key(1.0, 90.0)],
            poses: Vec::new(),
            offset: Offset::default(),
        }),
        visible: false,
        ..Object::fixed("things", 1)
    });
    let (position, direction) = (Vec3::new(0.2, 1.5, 0.2), -Vec3::Y);
    scene.lights.extend([
        Light::Spot { position, direction, intensity: Vec3::ZERO, cos_inner: 0.9, cos_outer: 0.8 },
        Light::Directional { direction, irradiance: Vec3::ZERO, diameter_deg: 0.0 },
    ]);
    scene.environment = Environment::Image { texture: 2, scale: Vec3::ONE, turn: 0.0 };
    scene
}

/// The faces of a box, by its middle and half its edges, in the order −x, +x, −y, +y, −z, +z.
fn cuboid(middle: Vec3, half: Vec3, face: &mut impl FnMut(usize, [Vec3; 4])) {
    for number in 0..6 {
        let axis = number / 2;
        let side = if number % 2 == 0 { -1.0 } else { 1.0 };
        let unit = |k: usize| Vec3::from_array(std::array::from_fn(|i| f32::from(u8::from(i == k % 3))));
        let (n, u, v) = (unit(axis) * side * half, unit(axis + 1) * half, unit(axis + 2) * side * half);
        let corner = |s: f32, t: f32| middle + n + u * s + v * t;
        face(number, [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]);
    }
}
