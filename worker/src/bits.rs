//! By what two builds know that they compute the same: a hash of what this one computes.
//!
//! Same question, same answer, bit for bit, is promised by one source to itself; of two builds nobody knows before they have
//! computed something. So each draws a small room with matt walls, gloss, a mirror and glass once, when it first meets a peer,
//! and tells the hash of its packed answers. Comments, messages and processors make no difference to it; kernels, random
//! numbers, rounding and packing do.

use std::sync::{Arc, OnceLock};

use glam::Vec3;
use protocol::message::Bits;
use protocol::pack::pack;
use protocol::parts::hash;
use protocol::question::{Ask, Lit, Quality, Question, Rect, Samples, Tile, WorldState};
use scenes::{Camera, Colour, Dielectric, Gloss, Light as Lamp, Material, Mesh, Object, Scalar, Scene, Surface};

use crate::renderer::{Light, Renderer};

/// Of this build; computed when it is first asked for, which takes some hundredths of a second.
pub fn of_this_build() -> Bits {
    static BITS: OnceLock<Bits> = OnceLock::new();
    *BITS.get_or_init(|| of(&Light::default()))
}

/// Of anybody who answers.
fn of<C: Renderer>(renderer: &C) -> Bits {
    let (world, camera) = (renderer.build(Arc::new(room())), CAMERA);
    let rect = Rect { x: 0, y: 0, width: camera.width, height: camera.height };
    let quality = Quality { interleave: [2, 2], photons: 200, vpls: 8, light_samples: 4, ..Quality::default() };
    let tile = |set| Ask::Tile(Tile { camera, rect, lit: Lit { set, frame: u32::from(set), seed: 7, quality } });
    let samples = Samples { camera, rect, first: 0, count: 1, seed: 7, max_bounces: None };
    let packed: Vec<u8> = (0..quality.sets())
        .map(tile)
        .chain([Ask::Reference(samples)])
        .flat_map(|ask| {
            let question = Question { world: WorldState::default(), ask };
            let answer = renderer.answer(&world, &question, &|| 0);
            pack(&question, &answer.body, renderer.fields(&world))
        })
        .collect();
    let mut bits = Bits::default();
    let length = bits.len();
    bits.copy_from_slice(&hash(&packed)[..length]);
    bits
}

const CAMERA: Camera = Camera {
    origin: Vec3::new(0.1, 0.2, 0.95),
    target: Vec3::new(0.0, -0.2, 0.0),
    up: Vec3::Y,
    fov_y_deg: 75.0,
    width: 24,
    height: 16,
    two_point: false,
    cut: false,
};

/// The room from −1 to 1, with a lamp below its ceiling, a point light, and three blocks.
fn room() -> Scene {
    let mut mesh = Mesh::default();
    let matt = |albedo: Vec3| Surface::Diffuse { albedo: Colour::plain(albedo) };
    let gloss =
        Surface::Glossy(Gloss::new(Colour::plain(Vec3::new(0.7, 0.5, 0.3)), Scalar::plain(0.4), Scalar::plain(0.5)));
    let surfaces = [
        matt(Vec3::splat(0.7)),
        matt(Vec3::new(0.6, 0.1, 0.1)),
        gloss,
        Surface::Mirror { reflectance: Vec3::splat(0.9) },
        Surface::Dielectric(Dielectric::clear(1.5, false)),
        matt(Vec3::ZERO),
    ];
    let material = |(number, surface)| Material { surface, ..Material::diffuse(format!("{number}"), Vec3::ZERO) };
    let mut materials: Vec<Material> = surfaces.into_iter().enumerate().map(material).collect();
    materials[5].emission = Colour::plain(Vec3::splat(6.0));
    block(&mut mesh, Vec3::ZERO, Vec3::splat(-1.0), [0, 0, 1, 0, 0, 1]);
    block(&mut mesh, Vec3::new(-0.5, -0.7, -0.4), Vec3::splat(0.3), [2; 6]);
    block(&mut mesh, Vec3::new(0.5, -0.7, -0.5), Vec3::splat(0.3), [3; 6]);
    block(&mut mesh, Vec3::new(0.1, -0.75, 0.2), Vec3::splat(0.22), [4; 6]);
    block(&mut mesh, Vec3::Y * 0.97, Vec3::new(0.3, 0.02, 0.3), [5; 6]);
    Scene {
        meshes: vec![mesh.into()],
        objects: vec![Object::fixed("room", 0)],
        materials,
        lights: vec![Lamp::Point { position: Vec3::new(-0.6, 0.5, 0.4), intensity: Vec3::splat(0.4) }],
        camera: CAMERA,
        ..Scene::default()
    }
}

/// A block about a place, of half so large sides, in a material a face; its faces look inwards where sides are negative.
fn block(mesh: &mut Mesh, middle: Vec3, half: Vec3, materials: [u32; 6]) {
    /// Counter-clockwise from outside; bits of a corner are its x, y, z.
    const FACES: [[u32; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let first = mesh.positions.len() as u32;
    let side = |corner: u32, bit: u32| if corner >> bit & 1 == 1 { 1.0 } else { -1.0 };
    mesh.positions.extend((0..8).map(|i| middle + half * Vec3::new(side(i, 0), side(i, 1), side(i, 2))));
    for ([a, b, c, d], material) in FACES.into_iter().zip(materials) {
        mesh.triangles.extend([[a, b, c], [a, c, d]].map(|corners| corners.map(|corner| first + corner)));
        mesh.materials.extend([material; 2]);
    }
}

#[cfg(test)]
mod tests {
    use protocol::answer::{Answer, Body, Fields};
    use protocol::question::Unfit;
    use scenes::Change;
    use scenes::change::Refused;

    use super::*;
    use crate::renderer::LightWorld;

    /// Computes as this build, but for the last bit of one colour of one pixel.
    struct Otherwise;

    impl Renderer for Otherwise {
        type World = LightWorld;

        fn build(&self, scene: Arc<Scene>) -> LightWorld {
            Light::default().build(scene)
        }

        fn edit(&self, world: &mut LightWorld, change: &Change) -> Result<(), Refused> {
            Light::default().edit(world, change)
        }

        fn fields(&self, world: &LightWorld) -> Fields {
            Light::default().fields(world)
        }

        fn check(&self, world: &LightWorld, question: &Question) -> Result<(), Unfit> {
            Light::default().check(world, question)
        }

        fn answer(&self, world: &LightWorld, question: &Question, clock: &dyn Fn() -> u64) -> Answer {
            let mut answer = Light::default().answer(world, question, clock);
            if let Body::Moments(moments) = &mut answer.body {
                let value = &mut moments.sum[200].y;
                *value = f64::from_bits(value.to_bits() ^ 1);
            }
            answer
        }
    }

    #[test]
    fn who_computes_one_bit_otherwise_is_another() {
        assert_eq!(of(&Light::default()), of_this_build());
        assert_ne!(of(&Otherwise), of_this_build());
    }

    /// Else it would not tell whether their kernels are the same.
    #[test]
    fn everything_in_the_room_is_seen_and_lit() {
        let light = Light::default();
        let world = light.build(Arc::new(room()));
        let rect = Rect { x: 0, y: 0, width: CAMERA.width, height: CAMERA.height };
        let samples = Samples { camera: CAMERA, rect, first: 0, count: 16, seed: 7, max_bounces: None };
        let question = Question { world: WorldState::default(), ask: Ask::Reference(samples) };
        let Body::Moments(moments) = light.answer(&world, &question, &|| 0).body else {
            panic!("moments were asked for")
        };
        let lit = moments.sum.iter().filter(|sum| sum.min_element() > 0.0).count();
        assert!(lit * 20 > moments.sum.len() * 19, "{lit} of {} pixels are lit", moments.sum.len());
    }
}
