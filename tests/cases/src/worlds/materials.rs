//! Frosted glass, glass that absorbs, glass in part, and sheets that let light through: what they leave of light, in closed form.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use scenes::{Colour, Dielectric, Light, Scalar, Specular, Surface};

use super::build::{Build, Fronts, Paint};
use super::emitters::above_floor;
use crate::case::Exact;
use crate::closed_form;

const IOR: f32 = 1.5;
const SIDE: u32 = 8;

/// Glass of some roughness.
fn frosted(roughness: f32, thin: bool) -> Surface {
    Surface::Dielectric(Dielectric { roughness: Scalar::plain(roughness), ..Dielectric::clear(IOR, thin) })
}

fn alpha(roughness: f32) -> f64 {
    f64::from(roughness).powi(2)
}

/// What shines on a plate of frosted glass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shines {
    /// A sky of radiance 1 all around.
    Sky,
    /// Walls of radiance 1 all around.
    Walls,
    /// That sky, but what passes the glass comes from a black plate.
    SkyBefore,
}

/// A plate of frosted glass in radiance 1, seen at an angle from its normal: from before it, or from within the glass, where
/// radiance is n² times as large. What facets keep from each other is dark.
pub fn frosted_plate(roughness: f32, angle_deg: f32, thin: bool, inside: bool, shines: Shines) -> Exact {
    let mut build = Build::new("frosted plate");
    let glass = build.surface(frosted(roughness, thin));
    // Its front is up.
    let side = if inside { -1.0 } else { 1.0 };
    build.quad(Vec3::ZERO, Vec3::Z, Vec3::X * side, glass);
    match shines {
        Shines::Sky => build.environment(1.0),
        Shines::Walls => {
            let wall = build.paint(0.0, 1.0);
            build.room(5.0, [wall; 6]);
        }
        Shines::SkyBefore => {
            build.environment(1.0);
            let black = build.paint(0.0, 0.0);
            build.quad(Vec3::Y * -0.002, Vec3::Z, Vec3::X, black);
        }
    }
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    let ior = f64::from(IOR);
    let eta = if inside && !thin { 1.0 / ior } else { ior };
    let [reflected, passed] = closed_form::rough_glass(alpha(roughness), f64::from(cos), eta, thin);
    let squeeze = if thin { 1.0 } else { 1.0 / (eta * eta) };
    let radiance = reflected + if shines == Shines::SkyBefore { 0.0 } else { passed * squeeze };
    let kind = if thin {
        "sheet"
    } else if inside {
        "glass from within"
    } else {
        "glass"
    };
    Exact {
        name: format!("{kind} of roughness {roughness} at {angle_deg}° in {shines:?}"),
        scene: build.seen(Vec3::new(sin, cos, 0.0) * 0.5, Vec3::ZERO, 1.0, SIDE),
        radiance,
        tolerance: 4e-3,
    }
}

/// The sun straight above a frosted sheet, which is looked at from below under an angle.
pub fn sun_in_a_frosted_sheet(roughness: f32, angle_deg: f32) -> Exact {
    let mut build = Build::new("sun in a frosted sheet");
    let glass = build.surface(frosted(roughness, true));
    build.quad(Vec3::ZERO, Vec3::Z, Vec3::X, glass);
    build.light(Light::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::ONE, diameter_deg: 0.0 });
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    let to = DVec3::new(f64::from(sin), 0.0, f64::from(cos));
    Exact {
        name: format!("sun in a sheet of roughness {roughness} at {angle_deg}°"),
        scene: build.seen(Vec3::new(sin, -cos, 0.0), Vec3::ZERO, 0.2, SIDE),
        radiance: closed_form::rough_sheet(alpha(roughness), to, DVec3::Z, IOR.into()),
        tolerance: 4e-3,
    }
}

/// A floor point close under a frosted sheet in sunlight from above.
pub fn sun_through_a_frosted_sheet(roughness: f32) -> Exact {
    let mut build = Build::new("sun through a frosted sheet");
    let (half, height) = (0.25, 0.2);
    let glass = build.surface(frosted(roughness, true));
    build.quad(Vec3::Y * height, Vec3::Z * half, Vec3::X * half, glass);
    build.light(Light::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::ONE, diameter_deg: 0.0 });
    let (steps, height) = (800, f64::from(height));
    let cell = |i: i32| ((f64::from(i) + 0.5) / f64::from(steps) * 2.0 - 1.0) * f64::from(half);
    let mut irradiance = 0.0;
    for (i, j) in (0..steps).flat_map(|i| (0..steps).map(move |j| (i, j))) {
        let (x, z) = (cell(i), cell(j));
        let d2 = x * x + z * z + height * height;
        let cos = height / d2.sqrt();
        let to = DVec3::new(x, z, height).normalize();
        let radiance = closed_form::rough_sheet(alpha(roughness), to, DVec3::Z, IOR.into());
        irradiance += radiance * cos * cos / d2 * (2.0 * f64::from(half) / f64::from(steps)).powi(2);
    }
    above_floor(build, format!("sun through a sheet of roughness {roughness}"), irradiance, 5e-3)
}

/// Glass that absorbs: `exp(−σ d)` is left after a way of d.
fn smoked(absorption: f32, thin: bool) -> Surface {
    Surface::Dielectric(Dielectric { absorption: Vec3::splat(absorption), ..Dielectric::clear(IOR, thin) })
}

/// What a slab passes of radiance along a line, all its reflections included, of which each way within leaves `left`.
fn slab(face: f64, left: f64) -> f64 {
    (1.0 - face).powi(2) * left / (1.0 - (face * left).powi(2))
}

/// An emitter of radiance 1 behind a slab of thickness 0.4 that absorbs, seen under an angle.
pub fn emitter_behind_a_slab(absorption: f32, angle_deg: f32) -> Exact {
    let mut build = Build::new("emitter behind a slab");
    let (glass, emitter) = (build.surface(smoked(absorption, false)), build.paint(0.0, 1.0));
    let thickness = 0.4_f32;
    build.block(Vec3::ZERO, Vec3::new(50.0, thickness / 2.0, 50.0), glass);
    build.quad(Vec3::Y * -1.0, Vec3::Z * 100.0, Vec3::X * 100.0, emitter);
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    let within = (1.0 - (f64::from(sin) / f64::from(IOR)).powi(2)).sqrt();
    let left = (-f64::from(absorption * thickness) / within).exp();
    Exact {
        name: format!("emitter through a slab of σ = {absorption} at {angle_deg}°"),
        scene: build.seen(Vec3::new(sin, cos, 0.0), Vec3::ZERO, 0.5, SIDE),
        radiance: slab(closed_form::fresnel(cos.into(), IOR.into()), left),
        tolerance: 1e-3,
    }
}

/// A ball of radius 1 that absorbs, under a sky of radiance 1, where light comes to it under an angle: what is not reflected
/// goes round within, by chords of the same length.
pub fn ball_that_absorbs(absorption: f32, angle_deg: f32) -> Exact {
    let mut build = Build::new("ball that absorbs");
    let ball = build.surface(smoked(absorption, false));
    build.sphere(Vec3::ZERO, 1.0, 200, Fronts::Outwards, ball);
    build.environment(1.0);
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    let face = closed_form::fresnel(cos.into(), IOR.into());
    let chord = 2.0 * (1.0 - (f64::from(sin) / f64::from(IOR)).powi(2)).sqrt();
    let left = (-f64::from(absorption) * chord).exp();
    // From far away, at a point so far from the middle.
    let (eye, at) = (Vec3::new(sin, 0.0, 50.0), Vec3::new(sin, 0.0, 0.0));
    Exact {
        name: format!("ball of σ = {absorption} at {angle_deg}°"),
        scene: build.seen(eye, at, 0.05, SIDE),
        radiance: face + (1.0 - face).powi(2) * left / (1.0 - face * left),
        tolerance: 5e-3,
    }
}

/// The sun straight above a slab that absorbs, above a small floor: all through photons.
pub fn sun_through_a_smoked_slab(absorption: f32) -> Exact {
    let mut build = Build::new("sun through a smoked slab");
    let glass = build.surface(smoked(absorption, false));
    build.block(Vec3::new(0.0, 0.5, 0.0), Vec3::new(0.2, 0.1, 0.2), glass);
    let floor = build.paint(0.5, 0.0);
    build.quad(Vec3::ZERO, Vec3::Z * 0.15, Vec3::X * 0.15, floor);
    build.light(Light::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::ONE, diameter_deg: 0.0 });
    let passed = slab(closed_form::fresnel(1.0, IOR.into()), (-f64::from(absorption) * 0.2).exp());
    Exact {
        name: format!("sun through a slab of σ = {absorption}"),
        scene: build.seen(Vec3::new(0.0, 0.2, 0.2), Vec3::ZERO, 15.0, SIDE),
        radiance: 0.5 / PI * passed,
        tolerance: 5e-3,
    }
}

/// A point light in the middle of a ball of glass that absorbs: its light leaves that straight, and what is reflected within
/// does so later, on the other side.
pub fn light_in_a_smoked_ball(absorption: f32) -> Exact {
    let (clear, radius) = (super::glass::light_in_glass(), 0.2);
    let mut scene = clear.scene;
    for material in &mut scene.materials {
        if let Surface::Dielectric(glass) = &mut material.surface {
            glass.absorption = Vec3::splat(absorption);
        }
    }
    let (face, left) = (closed_form::fresnel(1.0, IOR.into()), (-f64::from(absorption) * radius).exp());
    let radiance = clear.radiance * (1.0 - face) * left / (1.0 - face * left * left);
    Exact { name: format!("light in a ball of σ = {absorption}"), scene, radiance, ..clear }
}

const WATER: f32 = 1.33;

/// A flat vessel of glass about a middle, by half its inner edges, full of water of some σ, which was modelled to reach into
/// the walls.
fn vessel(build: &mut Build, middle: Vec3, inner: Vec3, absorption: f32) {
    let solid = |ior: f32, absorption: f32, priority: u8| {
        Surface::Dielectric(Dielectric {
            absorption: Vec3::splat(absorption),
            priority,
            ..Dielectric::clear(ior, false)
        })
    };
    let (water, glass) = (build.surface(solid(WATER, absorption, 1)), build.surface(solid(IOR, 0.0, 2)));
    let wall = Vec3::splat(inner.min_element() * 0.5);
    build.block(middle, inner + wall, glass);
    build.block(middle, inner + wall * 0.5, water);
    // Its inner walls: where glass ends, their fronts face the water.
    for axis in 0..3 {
        let unit = |k: usize| Vec3::from_array(std::array::from_fn(|i| f32::from(u8::from(i == k % 3))));
        for side in [-1.0, 1.0] {
            let (u, v) = (unit(axis + 1), unit(axis + 2) * -side);
            build.quad(middle + unit(axis) * inner * side, u * inner, v * inner, glass);
        }
    }
}

/// What the wall of such a vessel reflects along its normal, and passes, each way.
fn wall() -> [f64; 2] {
    let (outer, inner) = (closed_form::fresnel(1.0, IOR.into()), closed_form::fresnel(1.0, f64::from(IOR / WATER)));
    // Faces that lose no light add up by R / (1 − R).
    let passed = 1.0 / (1.0 + outer / (1.0 - outer) + inner / (1.0 - inner));
    [1.0 - passed, passed]
}

/// An emitter of radiance 1 seen through a glass of water of σ, or from within the water.
pub fn water_in_a_glass(absorption: f32, within: bool) -> Exact {
    let mut build = Build::new("water in a glass");
    vessel(&mut build, Vec3::ZERO, Vec3::new(5.0, 5.0, 0.2), absorption);
    let emitter = build.paint(0.0, 1.0);
    build.quad(Vec3::NEG_Z * 2.0, Vec3::X * 20.0, Vec3::Y * 20.0, emitter);
    let ([reflected, passed], left) = (wall(), (-f64::from(absorption) * 0.4).exp());
    let round = 1.0 - (reflected * left).powi(2);
    let (place, radiance) = match within {
        false => (1.0, passed * passed * left / round),
        // In water all radiance is n² times as large; from the middle of it.
        true => (0.0, f64::from(WATER).powi(2) * passed * left.sqrt() / round),
    };
    Exact {
        name: format!("emitter through water of σ = {absorption} in a glass, eye at {place}"),
        scene: build.seen(Vec3::Z * place, Vec3::NEG_Z, 0.5, SIDE),
        radiance,
        tolerance: 2e-3,
    }
}

/// A ball of glass full of water under a uniform sky cannot be seen.
pub fn ball_of_water() -> Exact {
    let mut build = Build::new("ball of water in glass");
    let solid = |ior, priority| Surface::Dielectric(Dielectric { priority, ..Dielectric::clear(ior, false) });
    let (glass, water) = (build.surface(solid(IOR, 2)), build.surface(solid(WATER, 1)));
    build.sphere(Vec3::ZERO, 1.0, 32, Fronts::Outwards, glass);
    build.sphere(Vec3::ZERO, 0.85, 32, Fronts::Outwards, water);
    build.sphere(Vec3::ZERO, 0.7, 32, Fronts::Inwards, glass);
    build.environment(1.0);
    let scene = build.seen(Vec3::new(0.0, 0.0, 4.0), Vec3::ZERO, 30.0, SIDE);
    Exact { name: "ball of water in glass under a uniform sky".into(), scene, radiance: 1.0, tolerance: 1e-3 }
}

/// The sun straight above a glass of water, above a small floor: all through photons.
pub fn sun_through_water(absorption: f32) -> Exact {
    let mut build = Build::new("sun through water");
    vessel(&mut build, Vec3::Y * 0.5, Vec3::new(0.3, 0.1, 0.3), absorption);
    let floor = build.paint(0.5, 0.0);
    build.quad(Vec3::ZERO, Vec3::Z * 0.15, Vec3::X * 0.15, floor);
    build.light(Light::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::ONE, diameter_deg: 0.0 });
    let ([reflected, passed], left) = (wall(), (-f64::from(absorption) * 0.2).exp());
    Exact {
        name: format!("sun through water of σ = {absorption} in a glass"),
        scene: build.seen(Vec3::new(0.0, 0.2, 0.2), Vec3::ZERO, 15.0, SIDE),
        radiance: 0.5 / PI * passed * passed * left / (1.0 - (reflected * left).powi(2)),
        tolerance: 5e-3,
    }
}

fn glazed(build: &mut Build, amount: f32, base: f32) -> Paint {
    let surface = Surface::Glazed {
        amount: Scalar::plain(amount),
        glass: Dielectric { roughness: Scalar::plain(0.0), ..Dielectric::clear(IOR, true) },
        base: Colour::plain(Vec3::splat(base)),
        metalness: Scalar::plain(0.0),
        f0: 0.0,
        specular: Specular::WHOLE,
    };
    build.surface(surface)
}

/// An emitter of radiance 1 behind a pane of which so much is glass, the rest black.
pub fn emitter_behind_glass_in_part(amount: f32) -> Exact {
    let mut build = Build::new("emitter behind glass in part");
    let (pane, emitter) = (glazed(&mut build, amount, 0.0), build.paint(0.0, 1.0));
    build.quad(Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 2.0, pane);
    build.quad(Vec3::Z * -5.0, Vec3::X * 20.0, Vec3::Y * 20.0, emitter);
    let passed = 1.0 - closed_form::sheet(closed_form::fresnel(1.0, IOR.into()));
    Exact {
        name: format!("emitter behind a pane that is glass by {amount}"),
        scene: build.seen(Vec3::Z, Vec3::ZERO, 1.0, SIDE),
        radiance: f64::from(amount) * passed,
        tolerance: 1e-3,
    }
}

/// The sun at an angle over a floor point under a large pane of which so much is glass.
pub fn sun_through_glass_in_part(amount: f32, angle_deg: f32) -> Exact {
    let mut build = Build::new("sun through glass in part");
    let pane = glazed(&mut build, amount, 0.0);
    build.quad(Vec3::Y * 0.5, Vec3::Z * 50.0, Vec3::X * 50.0, pane);
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    build.light(Light::Directional { direction: Vec3::new(sin, -cos, 0.0), irradiance: Vec3::ONE, diameter_deg: 0.0 });
    let passed = 1.0 - closed_form::sheet(closed_form::fresnel(cos.into(), IOR.into()));
    let irradiance = f64::from(cos) * passed * f64::from(amount);
    above_floor(build, format!("sun at {angle_deg}° through a pane that is glass by {amount}"), irradiance, 2e-3)
}

/// A block that emits ½ and reflects half in a closed house of panes that are glass in part and else white paint, or of
/// hardly frosted glass, in radiance 1: all is 1; who counts a path twice gets more.
pub fn house(walls: House, thin: bool) -> Exact {
    let mut build = Build::new("house");
    let wall = match walls {
        House::InPart => glazed(&mut build, 0.4, 1.0),
        House::Frosted => build.surface(frosted(0.22, thin)),
    };
    let block = build.paint(0.5, 0.5);
    if !thin {
        build.block(Vec3::ZERO, Vec3::splat(1.05), wall);
    }
    build.room(1.0, [wall; 6]);
    build.block(Vec3::ZERO, Vec3::new(0.4, 0.1, 0.4), block);
    let outside = build.paint(0.0, 1.0);
    build.room(2.0, [outside; 6]);
    Exact {
        name: format!("block in a house of {walls:?} {}", if thin { "panes" } else { "walls" }),
        scene: build.seen(Vec3::new(0.0, 0.4, 0.3), Vec3::Y * 0.1, 20.0, SIDE),
        radiance: 1.0,
        // Facets keep a little.
        tolerance: if walls == House::Frosted { 1.2e-2 } else { 2e-3 },
    }
}

/// Of what a house is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum House {
    /// Panes that are glass in part.
    InPart,
    /// Frosted glass.
    Frosted,
}

fn sheet(build: &mut Build, albedo: f32, transmittance: f32) -> Paint {
    let grey = |value| Colour::plain(Vec3::splat(value));
    build.surface(Surface::Translucent { albedo: grey(albedo), transmittance: grey(transmittance) })
}

/// A closed cube of paper that nothing is lost in, in walls of radiance 1, from within, and its outside: both have radiance 1.
pub fn paper_furnace(inside: bool) -> Exact {
    let mut build = Build::new("paper furnace");
    let paper = sheet(&mut build, 0.3, 0.7);
    build.room(1.0, [paper; 6]);
    let wall = build.paint(0.0, 1.0);
    build.room(2.0, [wall; 6]);
    let eye = if inside { Vec3::new(0.3, 0.2, 0.1) } else { Vec3::new(1.5, 0.3, 0.4) };
    Exact {
        name: format!("paper seen from {}", if inside { "within" } else { "without" }),
        scene: build.seen(eye, Vec3::new(1.0, 0.1, 0.0), 20.0, SIDE),
        radiance: 1.0,
        tolerance: 2e-3,
    }
}

/// A point light over a small sheet of paper, over a floor point: seen from below, it shines like a lamp.
pub fn lamp_over_paper() -> Exact {
    let mut build = Build::new("lamp over paper");
    let paper = sheet(&mut build, 0.2, 0.6);
    let (half, height, lamp) = (0.3_f32, 0.5_f64, 1.5_f64);
    build.quad(Vec3::Y * height as f32, Vec3::Z * half, Vec3::X * half, paper);
    // Keeps the light that passes beside it from the floor.
    let black = build.paint(0.0, 0.0);
    build.holed_ceiling(height as f32, 20.0, half, black);
    build.light(Light::Point { position: Vec3::Y * lamp as f32, intensity: Vec3::ONE });
    let (steps, half) = (400, f64::from(half));
    let cell = |i: i32| ((f64::from(i) + 0.5) / f64::from(steps) * 2.0 - 1.0) * half;
    let mut irradiance = 0.0;
    for (i, j) in (0..steps).flat_map(|i| (0..steps).map(move |j| (i, j))) {
        let r2 = cell(i).powi(2) + cell(j).powi(2);
        let above = lamp - height;
        let arriving = above / (r2 + above * above).powf(1.5);
        let d2 = r2 + height * height;
        irradiance += arriving * 0.6 / PI * height * height / (d2 * d2) * (2.0 * half / f64::from(steps)).powi(2);
    }
    above_floor(build, "floor under lit paper".into(), irradiance, 3e-3)
}

/// The same sheet, looked at from below: its middle has `τ E / π`.
pub fn paper_against_light() -> Exact {
    let mut build = Build::new("paper against light");
    let paper = sheet(&mut build, 0.2, 0.6);
    build.quad(Vec3::ZERO, Vec3::Z, Vec3::X, paper);
    build.light(Light::Point { position: Vec3::Y * 2.0, intensity: Vec3::ONE });
    Exact {
        name: "paper against the light".into(),
        scene: build.seen(Vec3::new(0.3, -0.5, 0.2), Vec3::ZERO, 1.0, SIDE),
        radiance: 0.6 / PI / 4.0,
        tolerance: 1e-3,
    }
}
