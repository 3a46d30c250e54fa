//! Highlights of lights without surface on glossy floors: one reflection, so their truth is an integral over the picture
//! alone, here by the midpoint rule in `f64`.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use scenes::{Coat, Colour, Dielectric, Light, Scalar, Scene, Surface};

use super::build::Build;
use crate::case::Exact;
use crate::closed_form;

/// What lies on the floor. Nothing is under the lobe: all that is seen is the highlight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Gloss {
    /// White metal of that roughness.
    Metal(f32),
    /// Black lacquer of F₀ = 0.04 and that roughness.
    Lacquer(f32),
}

/// How the eye sees the floor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seen {
    /// Straight.
    Directly,
    /// In a mirror of reflectance 0.9.
    InMirror,
    /// In metal as smooth as gloss can be, of F₀ = 0.9.
    InMetal,
    /// Through a pane of index 1.5.
    ThroughPane,
}

/// A light without surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lamp {
    /// Shines everywhere alike.
    Point,
    /// Its cone ends within the picture.
    Spot,
    /// Parallel rays.
    Sun,
    /// As much from a disc so narrow that no lobe here tells it from them.
    Disc,
}

/// Edges of the picture, in pixels, and of the grid that the truth is summed on.
const SIDE: u32 = 8;
const GRID: u32 = 256;
/// Points along the edges of a panel.
const PANEL: u32 = 24;
/// Where point and spot hang, and where the sun comes from.
const PLACE: Vec3 = Vec3::new(0.1, 1.2, -2.2);
const TOWARDS_SUN: Vec3 = Vec3::new(0.05, 0.6, -1.2);
const SPOT_DEG: [f32; 2] = [4.0, 12.0];
/// Mirror, metal or pane stand across here.
const SCREEN: Vec3 = Vec3::new(0.0, 1.2, 2.4);

/// The highlight of a lamp on a floor.
pub fn highlight(gloss: Gloss, lamp: Lamp, seen: Seen) -> Exact {
    let mut build = Build::new("highlight");
    build.floor(gloss);
    let screen = match seen {
        Seen::Directly => None,
        Seen::InMirror => Some(Surface::Mirror { reflectance: Vec3::splat(0.9) }),
        Seen::InMetal => Some(metal(0.9, 0.0)),
        Seen::ThroughPane => Some(Surface::Dielectric(Dielectric::clear(1.5, true))),
    };
    if let Some(surface) = screen {
        let paint = build.surface(surface);
        build.quad(SCREEN, Vec3::X * 0.35, Vec3::Y * 0.35, paint);
        // Keeps the sun off it, which it would send to the floor a second time.
        let shade = build.paint(0.0, 0.0);
        build.quad(Vec3::new(0.0, 2.1, 0.6), Vec3::X * 0.5, Vec3::Y * 0.4, shade);
    }
    build.light(lamp.light());
    let (eye, target) = (Vec3::new(0.0, 1.8, 3.6), Vec3::ZERO);
    let straight = build.clone().seen(eye, target, 16.0, SIDE);
    let behind = |p: Vec3| Vec3::new(p.x, p.y, 2.0 * SCREEN.z - p.z);
    let scene = match seen {
        Seen::Directly | Seen::ThroughPane => straight.clone(),
        Seen::InMirror | Seen::InMetal => build.seen(behind(eye), behind(target), 16.0, SIDE),
    };
    let radiance = mean(&straight, GRID, |ray| {
        let cos = ray.direction.z.abs();
        let passed = match seen {
            Seen::Directly => 1.0,
            Seen::InMirror => 0.9,
            Seen::InMetal => 0.9 + 0.1 * (1.0 - cos).powi(5),
            Seen::ThroughPane => 1.0 - closed_form::sheet(closed_form::fresnel(cos, 1.5)),
        };
        let (irradiance, from) = lamp.at(ray.floor);
        passed * gloss.lobe(-ray.direction, from) * irradiance
    });
    Exact { name: format!("{gloss:?}, {lamp:?}, {seen:?}"), scene, radiance, tolerance: 2e-3 }
}

/// The highlight of a square panel of radiance 1 that hangs where point and spot do, and shines down.
pub fn panel(gloss: Gloss, half: f32) -> Exact {
    let (scene, place) = panel_over(gloss, half, None);
    let radiance = mean(&scene, 48, |ray| panel_light(gloss, half, place, ray));
    Exact { name: format!("{gloss:?} under a panel of {:.1} m", 2.0 * half), scene, radiance, tolerance: 5e-3 }
}

/// The same with its image in a wall behind it that is a mirror of reflectance 0.9, of two squares side by side.
pub fn mirrored_panel(gloss: Gloss, half: f32) -> Exact {
    const WALL: f32 = -2.5;
    let (scene, place) = panel_over(gloss, half, Some(WALL));
    let image = DVec3::new(place.x, place.y, 2.0 * f64::from(WALL) - place.z);
    let radiance =
        mean(&scene, 48, |ray| panel_light(gloss, half, place, ray) + 0.9 * panel_light(gloss, half, image, ray));
    Exact {
        name: format!("{gloss:?}, a panel of {:.1} m before a mirror", 2.0 * half),
        scene,
        radiance,
        tolerance: 5e-3,
    }
}

/// A floor, a panel and its place, and perhaps a mirror across the view that begins at the floor.
fn panel_over(gloss: Gloss, half: f32, wall: Option<f32>) -> (Scene, DVec3) {
    let mut build = Build::new("panel");
    build.floor(gloss);
    let lamp = build.paint(0.0, 1.0);
    build.quad(PLACE, Vec3::X * half, Vec3::Z * half, lamp);
    if let Some(z) = wall {
        let mirror = build.surface(Surface::Mirror { reflectance: Vec3::splat(0.9) });
        for x in [-2.0, 2.0] {
            build.quad(Vec3::new(x, 2.0, z), Vec3::X * 2.0, Vec3::Y * 2.0, mirror);
        }
    }
    let (target, fov) = if wall.is_some() { (Vec3::new(0.0, 0.0, -0.4), 20.0) } else { (Vec3::ZERO, 16.0) };
    (build.seen(Vec3::new(0.0, 1.8, 3.6), target, fov, SIDE), PLACE.as_dvec3())
}

/// What the floor reflects of a panel that lies about a place.
fn panel_light(gloss: Gloss, half: f32, place: DVec3, ray: &Ray) -> f64 {
    let half = f64::from(half);
    let at = |i: u32| (2.0 * (f64::from(i) + 0.5) / f64::from(PANEL) - 1.0) * half;
    let spots = (0..PANEL * PANEL).map(|i| place + DVec3::new(at(i % PANEL), 0.0, at(i / PANEL)));
    let light = spots.map(|spot| {
        let to_lamp = spot - ray.floor;
        let from = to_lamp.normalize();
        gloss.lobe(-ray.direction, from) * from.y * from.y / to_lamp.length_squared()
    });
    light.sum::<f64>() * (2.0 * half / f64::from(PANEL)).powi(2)
}

/// The highlights of a point light and of its image in a wall that is a mirror of reflectance 0.9.
pub fn mirrored_lamp(gloss: Gloss) -> Exact {
    let mut build = Build::new("mirrored lamp");
    build.floor(gloss);
    let mirror = build.surface(Surface::Mirror { reflectance: Vec3::splat(0.9) });
    build.quad(Vec3::new(0.0, 2.0, -2.5), Vec3::X * 4.0, Vec3::Y * 2.0, mirror);
    build.light(Lamp::Point.light());
    let scene = build.seen(Vec3::new(0.0, 1.8, 3.6), Vec3::new(0.0, 0.0, -0.4), 20.0, SIDE);
    let radiance = mean(&scene, GRID, |ray| {
        let by = |strength: f64, place: DVec3| {
            let to_lamp = place - ray.floor;
            let from = to_lamp.normalize();
            strength * gloss.lobe(-ray.direction, from) * from.y / to_lamp.length_squared()
        };
        let place = PLACE.as_dvec3();
        by(1.0, place) + by(0.9, DVec3::new(place.x, place.y, -5.0 - place.z))
    });
    Exact { name: format!("{gloss:?}, lamp before a mirror"), scene, radiance, tolerance: 1e-2 }
}

/// A lamp over a floor of that albedo under lacquer of that roughness; *radiance* is the mean irradiance of what is seen.
pub fn lamp_over_lacquer(albedo: f32, roughness: f32, lamp: Lamp) -> Exact {
    let mut build = Build::new("lamp over lacquer");
    let floor = build.surface(Surface::Glossy(scenes::Gloss::new(
        Colour::plain(Vec3::splat(albedo)),
        Scalar::plain(roughness),
        Scalar::plain(0.0),
    )));
    build.quad(Vec3::ZERO, Vec3::Z * 2.5, Vec3::X * 2.5, floor);
    build.light(lamp.light());
    let scene = build.seen(Vec3::new(0.0, 1.8, 3.6), Vec3::ZERO, 16.0, SIDE);
    let irradiance = mean(&scene, GRID, |ray| lamp.at(ray.floor).0);
    let name = format!("albedo {albedo} under lacquer of roughness {roughness}, {lamp:?}");
    Exact { name, scene, radiance: irradiance, tolerance: 5e-3 }
}

/// What a floor is made of that sends no light of a lamp to most eyes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Floor {
    /// White, of that roughness.
    Metal(f32),
    /// A perfect one.
    Mirror,
    /// A sheet of it.
    Glass,
    /// Black plastic under a coat of that roughness.
    Coated(f32),
}

/// A lamp over such a floor; *radiance* is the mean irradiance of what is seen.
pub fn lamp_over(floor: Floor, lamp: Lamp) -> Exact {
    let mut build = Build::new("lamp over a floor of anything");
    let paint = build.surface(match floor {
        Floor::Metal(roughness) => metal(1.0, roughness),
        Floor::Mirror => Surface::Mirror { reflectance: Vec3::ONE },
        Floor::Glass => Surface::Dielectric(Dielectric::clear(1.5, true)),
        Floor::Coated(roughness) => Surface::Glossy(scenes::Gloss {
            coat: Some(Coat { amount: Scalar::plain(1.0), roughness: Scalar::plain(roughness) }),
            ..scenes::Gloss::new(Colour::plain(Vec3::ZERO), Scalar::plain(0.6), Scalar::plain(0.0))
        }),
    });
    build.quad(Vec3::ZERO, Vec3::Z * 2.5, Vec3::X * 2.5, paint);
    build.light(lamp.light());
    let scene = build.seen(Vec3::new(0.0, 1.8, 3.6), Vec3::ZERO, 16.0, SIDE);
    let irradiance = mean(&scene, GRID, |ray| lamp.at(ray.floor).0);
    Exact { name: format!("{floor:?}, {lamp:?}"), scene, radiance: irradiance, tolerance: 5e-3 }
}

/// A ray of the eye, and where it meets the floor.
struct Ray {
    direction: DVec3,
    floor: DVec3,
}

/// Mean over the picture, all of which shows the floor y = 0.
fn mean(scene: &scenes::Scene, grid: u32, radiance: impl Fn(&Ray) -> f64) -> f64 {
    let (lens, eye) = (scene.camera.lens(), scene.camera.origin.as_dvec3());
    let place = |i: u32| (i as f32 + 0.5) * SIDE as f32 / grid as f32;
    let at = |i: u32| {
        let direction = lens.direction(place(i % grid), place(i / grid)).as_dvec3().normalize();
        radiance(&Ray { direction, floor: eye - direction * (eye.y / direction.y) })
    };
    (0..grid * grid).map(at).sum::<f64>() / f64::from(grid * grid)
}

fn metal(base: f32, roughness: f32) -> Surface {
    let plain = Scalar::plain;
    Surface::Glossy(scenes::Gloss::new(Colour::plain(Vec3::splat(base)), plain(roughness), plain(1.0)))
}

impl Build {
    fn floor(&mut self, gloss: Gloss) {
        let surface = match gloss {
            Gloss::Metal(roughness) => metal(1.0, roughness),
            Gloss::Lacquer(roughness) => Surface::Glossy(scenes::Gloss::new(
                Colour::plain(Vec3::ZERO),
                Scalar::plain(roughness),
                Scalar::plain(0.0),
            )),
        };
        let floor = self.surface(surface);
        self.quad(Vec3::ZERO, Vec3::Z * 2.5, Vec3::X * 2.5, floor);
    }
}

impl Gloss {
    /// Value of the lobe on a floor (y up): Schlick's Fresnel term, Trowbridge and Reitz's facets, Smith's masking with
    /// heights correlated.
    fn lobe(self, to: DVec3, from: DVec3) -> f64 {
        let (f0, roughness) = match self {
            Self::Metal(roughness) => (1.0, roughness),
            Self::Lacquer(roughness) => (f64::from(0.04_f32), roughness),
        };
        let alpha = f64::from(roughness).powi(2);
        let half = (to + from).normalize();
        let root = |cos: f64| (alpha * alpha + (1.0 - alpha * alpha) * cos * cos).sqrt();
        let facets = alpha * alpha / (PI * (half.y * half.y * (alpha * alpha - 1.0) + 1.0).powi(2));
        let visible = 0.5 / (from.y * root(to.y) + to.y * root(from.y));
        (f0 + (1.0 - f0) * (1.0 - to.dot(half)).powi(5)) * facets * visible
    }
}

impl Lamp {
    fn light(self) -> Light {
        match self {
            Self::Point => Light::Point { position: PLACE, intensity: Vec3::ONE },
            Self::Spot => Light::Spot {
                position: PLACE,
                direction: -PLACE.normalize(),
                intensity: Vec3::ONE,
                cos_inner: SPOT_DEG[0].to_radians().cos(),
                cos_outer: SPOT_DEG[1].to_radians().cos(),
            },
            Self::Sun | Self::Disc => {
                let diameter_deg = if self == Self::Disc { 0.53 } else { 0.0 };
                Light::Directional { direction: -TOWARDS_SUN.normalize(), irradiance: Vec3::ONE, diameter_deg }
            }
        }
    }

    /// Irradiance of a place of the floor, and the unit direction that it comes from.
    fn at(self, floor: DVec3) -> (f64, DVec3) {
        let to_lamp = PLACE.as_dvec3() - floor;
        let from = to_lamp.normalize();
        let intensity = match self {
            Self::Sun | Self::Disc => {
                let from = TOWARDS_SUN.as_dvec3().normalize();
                return (from.y, from);
            }
            Self::Point => 1.0,
            Self::Spot => {
                let [inner, outer] = SPOT_DEG.map(|deg| f64::from(deg).to_radians().cos());
                ((from.dot(PLACE.as_dvec3().normalize()) - outer) / (inner - outer)).clamp(0.0, 1.0).powi(2)
            }
        };
        (intensity * from.y / to_lamp.length_squared(), from)
    }
}
