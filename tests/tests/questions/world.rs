//! A room with one of everything, and ways to ask about it.

use ::light::{LightSetCache, Prepared};
use cases::worlds::build::{Build, Fronts};
use glam::{Vec2, Vec3};
use protocol::answer::{Answer, Body, Fields};
use protocol::pack;
use protocol::question::{Address, Ask, Lit, Part, Point, Points, Quality, Question, Ray, Rays, Rect, Tile};
use scenes::{
    Colour, Coverage, Dielectric, Environment, Gloss, Light, LookUp, Material, Pixels, Scalar, Scene, Surface, Texture,
};

/// Matt walls, a mirror, glass, rough and sharp gloss, lamps of two materials, a light, and sky through a missing wall; a
/// textured floor, a fence with holes, a cloth most of which is there, and a veil most of which is not.
pub fn room() -> Scene {
    let mut build = Build::new("one of everything");
    let [grey, dark] = [0.7, 0.2].map(|albedo| build.paint(albedo, 0.0));
    let [lamp, glow] = [6.0, 0.5].map(|radiance| build.paint(0.3, radiance));
    let mirror = build.surface(Surface::Mirror { reflectance: Vec3::splat(0.8) });
    let glass = build.surface(Surface::Dielectric(Dielectric::clear(1.5, false)));
    let glossy = |roughness| {
        Surface::Glossy(Gloss::new(
            Colour::plain(Vec3::new(0.5, 0.4, 0.3)),
            Scalar::plain(roughness),
            Scalar::plain(0.2),
        ))
    };
    let [rough, sharp] = [0.7, 0.2].map(|roughness| build.surface(glossy(roughness)));
    let tiles = Colour { value: Vec3::splat(0.8), texture: Some(0) };
    let tiles = build.surface(Surface::Diffuse { albedo: tiles });
    let covers = [Coverage::mask(0, 3, 0.5), Coverage::plain(0.7), Coverage::plain(0.3)];
    let [fence, cloth, veil] = covers.map(|coverage| {
        build.material(Material { coverage: Some(coverage), ..Material::diffuse("partial", Vec3::splat(0.6)) })
    });
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    build.quad(-y, z, x, tiles);
    build.quad(y, x, z, grey);
    build.quad(Vec3::new(-0.6, 0.4, 0.4), x * 0.25, y * 0.25, cloth);
    build.quad(Vec3::new(0.5, 0.4, 0.4), x * 0.25, y * 0.25, veil);
    build.quad(Vec3::new(-0.05, 0.5, 0.3), x * 0.25, y * 0.2, fence);
    build.quad(-x, y, z, dark);
    build.quad(x, z, y, mirror);
    build.quad(-z, x, y, rough);
    build.quad(y * 0.98, x * 0.2, z * 0.2, lamp);
    build.quad(Vec3::new(-0.98, -0.4, 0.3), y * 0.2, z * 0.2, glow);
    build.quad(Vec3::new(-0.98, -0.4, -0.5), y * 0.1, z * 0.1, lamp);
    build.sphere(Vec3::new(0.3, -0.65, 0.1), 0.3, 2, Fronts::Outwards, glass);
    build.sphere(Vec3::new(-0.4, -0.7, -0.4), 0.25, 2, Fronts::Outwards, sharp);
    build.sphere(Vec3::new(-0.3, -0.1, 0.0), 0.15, 1, Fronts::Outwards, grey);
    build.light(Light::Point { position: Vec3::new(0.5, 0.5, 0.2), intensity: Vec3::new(0.3, 0.2, 0.1) });
    let pixels = [[255, 200, 100, 255], [100, 200, 255, 0], [100, 200, 255, 0], [255, 200, 100, 255]];
    let pixels = Pixels::Srgb8(pixels.into());
    let checks = Texture { name: "checks".into(), width: 2, height: 2, pixels, look_up: LookUp::REPEAT };
    build.texture(checks, |p| Vec2::new(p.x, p.y + p.z) * 3.0);
    let mut scene = build.seen(Vec3::new(0.0, 0.1, 2.6), Vec3::new(0.0, -0.1, 0.0), 45.0, 24);
    scene.environment = Environment::Constant(Vec3::new(0.1, 0.15, 0.2));
    scene
}

pub struct World {
    pub prepared: Prepared,
    cache: LightSetCache,
}

impl World {
    pub fn new(scene: Scene) -> Self {
        Self { prepared: Prepared::new(scene), cache: LightSetCache::default() }
    }

    pub fn fields(&self) -> Fields {
        Fields::of(&self.prepared.needs)
    }

    /// As it leaves the thread: not packed.
    pub fn raw(&self, ask: &Ask) -> Body {
        let question = Question { world: Default::default(), ask: ask.clone() };
        ::light::check(&self.prepared, &question).expect("the scene has what is asked about");
        let Answer { body, cost } = ::light::answer(&self.prepared, &self.cache, &question, &|| 0);
        assert_eq!(cost.dropped, 0);
        body
    }

    /// As the master gets it.
    pub fn packed(&self, ask: &Ask) -> Body {
        let question = Question { world: Default::default(), ask: ask.clone() };
        let mut body = self.raw(ask);
        assert_eq!(pack::drop_unsound(&mut body), 0);
        let packed = pack::pack(&question, &body, self.fields());
        assert!(packed.len() <= pack::packed_len_max(ask), "{} bytes", packed.len());
        let body = pack::unpack(&question, &packed, self.fields()).expect("what was packed can be unpacked");
        body.check_in(&self.prepared.scene).expect("hits are in the scene");
        body
    }

    /// Rays of its own camera, with its own light.
    pub fn rays(&self, through: Vec<Ray>, lit: Lit) -> Ask {
        let camera = self.prepared.scene.camera;
        Ask::Rays(Rays { camera, view: Some(camera), through, lit })
    }

    pub fn points(&self, at: Vec<Point>, part: Part, lit: Lit) -> Ask {
        Ask::Points(Points { view: Some(self.prepared.scene.camera), at, part, lit })
    }

    /// The whole picture.
    pub fn tile(&self, lit: Lit) -> Tile {
        let camera = self.prepared.scene.camera;
        Tile { camera, rect: Rect { x: 0, y: 0, width: camera.width, height: camera.height }, lit }
    }

    /// Where rays through all pixels of a set hit first, with their addresses.
    pub fn hits(&self, lit: Lit) -> Vec<Point> {
        let through: Vec<Ray> = rays_of(&self.tile(lit));
        let seen = self.raw(&self.rays(through.clone(), lit)).seen().expect("rays see");
        let point = |(hit, ray): (Option<scenes::SurfacePoint>, &Ray)| Some(Point { at: hit?, address: ray.address });
        seen.hits.into_iter().zip(&through).filter_map(point).collect()
    }

    /// How much of the surface is there, of a point that a ray has hit.
    pub fn coverage(&self, point: &Point) -> f32 {
        // Nothing of a hole can be hit.
        self.material(point).coverage.map_or(1.0, |coverage| coverage.of(1.0))
    }

    pub fn material(&self, point: &Point) -> &Material {
        let scene = &self.prepared.scene;
        let mesh = &scene.meshes[scene.objects[point.at.object as usize].mesh as usize];
        &scene.materials[mesh.materials[point.at.triangle as usize] as usize]
    }
}

/// The rays that are a tile's pixels.
pub fn rays_of(tile: &Tile) -> Vec<Ray> {
    let address = |pixel| Address { pixel, number: tile.lit.frame };
    tile.grid().pixels().map(|pixel| Ray { address: address(pixel), aim: None }).collect()
}

pub fn quality() -> Quality {
    Quality { light_samples: 4, vpls: 8, photons: 64, ..Quality::default() }
}

pub fn lit(set: u16, frame: u32) -> Lit {
    Lit { set, frame, seed: 5, quality: quality() }
}
