//! Glass and mirrors: rows 18, 27 to 30, 41, and stiff ones of our own.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::Vec3;
use scenes::{Coat, Colour, Coverage, Dielectric, Gloss, Light, Material, Scalar, Scene, Sheen, Specular, Surface};

use super::build::{Build, Fronts};
use crate::case::Exact;
use crate::closed_form::{self, Under};

/// Pixels to a side.
const SIDE: u32 = 8;

fn glass(ior: f32, thin: bool) -> Surface {
    Surface::Dielectric(Dielectric::clear(ior, thin))
}

/// Row 27: a lit room, empty, then with a ball of that index of refraction in it. With index 1 both
/// give the same picture.
pub fn ball_in_a_box(ior: f32) -> [Scene; 2] {
    [false, true].map(|with_ball| {
        let mut build = Build::new("ball in a box");
        let (wall, red, emitter) = (build.paint(0.6, 0.0), build.paint(0.2, 0.0), build.paint(0.0, 8.0));
        build.room(1.0, [red, wall, wall, wall, wall, wall]);
        build.quad(Vec3::Y * 0.99, Vec3::X * 0.3, Vec3::Z * 0.3, emitter);
        if with_ball {
            let ball = build.surface(glass(ior, false));
            build.sphere(Vec3::new(0.1, -0.3, 0.0), 0.5, 32, Fronts::Outwards, ball);
        }
        build.seen(Vec3::new(0.0, 0.0, 0.95), Vec3::new(0.0, -0.1, 0.0), 80.0, 32)
    })
}

/// Row 28: the eye is inside a block of glass of index 1.5 and looks at its side beyond the critical
/// angle of 41.8°, under 60°. Outside all is black; the block's far end is an emitter of radiance 1, and
/// all of it arrives.
pub fn light_caught_in_glass() -> Exact {
    let mut build = Build::new("light caught in glass");
    let (side, emitter) = (build.surface(glass(1.5, false)), build.paint(0.0, 1.0));
    // A long block from x = −1 to 9; its end at x = 8, inside, faces the eye.
    build.quad(Vec3::new(4.0, -1.0, 0.0), Vec3::X * 5.0, Vec3::Z * 5.0, side);
    build.quad(Vec3::new(4.0, 1.0, 0.0), Vec3::Z * 5.0, Vec3::X * 5.0, side);
    build.quad(Vec3::X * 8.0, Vec3::Z * 5.0, Vec3::Y, emitter);
    // 60° from the normal: 30° above the side.
    let (sin, cos) = 30.0_f32.to_radians().sin_cos();
    Exact {
        name: "total internal reflection".into(),
        scene: build.seen(Vec3::ZERO, Vec3::new(cos, -sin, 0.0), 5.0, SIDE),
        radiance: 1.0,
        tolerance: 1e-6,
    }
}

/// Row 29: an emitter of radiance 1 seen straight through a pane of thin glass.
pub fn pane_before_an_emitter() -> Exact {
    let reflected = closed_form::sheet(closed_form::fresnel(1.0, 1.5));
    pane("lamp through thin glass", -1.0, 1.0 - reflected)
}

/// Row 29: the same emitter behind the eye, seen in the pane.
pub fn emitter_in_a_pane() -> Exact {
    pane("lamp in thin glass", 1.0, closed_form::sheet(closed_form::fresnel(1.0, 1.5)))
}

/// The eye looks along −z at a pane at z = 0; an emitter stands at distance 5, before (+1) or behind it.
fn pane(name: &str, side: f32, radiance: f64) -> Exact {
    let mut build = Build::new("pane");
    let (pane, emitter) = (build.surface(glass(1.5, true)), build.paint(0.0, 1.0));
    build.quad(Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 2.0, pane);
    // Its front faces the pane.
    build.quad(Vec3::Z * (5.0 * side), Vec3::X * 20.0, Vec3::Y * (-20.0 * side), emitter);
    Exact { name: name.into(), scene: build.seen(Vec3::Z, Vec3::ZERO, 1.0, SIDE), radiance, tolerance: 1e-5 }
}

/// Row 18: the sun straight above a slab of glass (index 1.5) above a small floor: what arrives is
/// `(1 − R)/(1 + R)` of it, flat, all through photons.
pub fn sun_through_a_slab() -> Exact {
    let mut build = Build::new("sun through a slab");
    let (slab, floor) = (build.surface(glass(1.5, false)), build.paint(0.5, 0.0));
    build.block(Vec3::new(0.0, 0.5, 0.0), Vec3::new(0.2, 0.1, 0.2), slab);
    build.quad(Vec3::ZERO, Vec3::Z * 0.15, Vec3::X * 0.15, floor);
    build.light(Light::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::ONE, diameter_deg: 0.0 });
    let face = closed_form::fresnel(1.0, 1.5);
    Exact {
        name: "caustic under a slab".into(),
        scene: build.seen(Vec3::new(0.0, 0.2, 0.2), Vec3::ZERO, 15.0, SIDE),
        radiance: 0.5 / PI * (1.0 - closed_form::sheet(face)),
        tolerance: 5e-3,
    }
}

/// Row 30: the eye between two mirrors looks up at an emitter across them, seen after exactly `images`
/// reflections.
pub fn facing_mirrors(reflectance: f32, images: u32) -> Exact {
    let mut build = Build::new("facing mirrors");
    let (mirror, emitter) =
        (build.surface(Surface::Mirror { reflectance: Vec3::splat(reflectance) }), build.paint(0.0, 1.0));
    let top = 4.0;
    build.quad(Vec3::NEG_X, Vec3::Y * 5.0, Vec3::Z * 5.0, mirror);
    build.quad(Vec3::X, Vec3::Z * 5.0, Vec3::Y * 5.0, mirror);
    build.quad(Vec3::Y * top, Vec3::X, Vec3::Z * 5.0, emitter);
    // Reflection k happens at height (2k − 1) · slope: the emitter hangs half-way to the next.
    let slope = top / (2 * images) as f32;
    Exact {
        name: format!("image {images} in mirrors of {reflectance}"),
        scene: build.seen(Vec3::ZERO, Vec3::new(1.0, slope, 0.0), 5e-4 * slope.to_degrees(), SIDE),
        radiance: f64::from(reflectance).powi(images as i32),
        tolerance: 1e-3,
    }
}

/// A ball of any glass under a uniform sky: it cannot be seen, since what it does not reflect it lets
/// through, and the squeeze of radiance undoes itself.
pub fn ball_under_sky(ior: f32) -> Exact {
    let mut build = Build::new("glass ball under a uniform sky");
    let ball = build.surface(glass(ior, false));
    build.sphere(Vec3::ZERO, 1.0, 32, Fronts::Outwards, ball);
    build.environment(1.0);
    Exact {
        name: format!("ball of index {ior} under a uniform sky"),
        scene: build.seen(Vec3::new(0.0, 0.0, 4.0), Vec3::ZERO, 30.0, SIDE),
        radiance: 1.0,
        tolerance: 1e-3,
    }
}

/// Row 41: the eye inside that ball. In glass all radiance is n² times as large.
pub fn eye_in_glass(ior: f32) -> Exact {
    let inside = ball_under_sky(ior);
    let mut scene = inside.scene;
    (scene.camera.origin, scene.camera.target) = (Vec3::new(0.1, 0.2, 0.0), Vec3::NEG_Z);
    Exact { name: format!("eye in glass of index {ior}"), scene, radiance: f64::from(ior).powi(2), ..inside }
}

/// Row 41: a point light in the middle of a ball of glass shines as if that was not there: what is
/// reflected inside comes out on the other side.
pub fn light_in_glass() -> Exact {
    let mut build = Build::new("light in glass");
    let (ball, floor) = (build.surface(glass(1.5, false)), build.paint(0.5, 0.0));
    build.sphere(Vec3::Y, 0.2, 100, Fronts::Outwards, ball);
    build.quad(Vec3::ZERO, Vec3::Z * 0.5, Vec3::X * 0.5, floor);
    build.light(Light::Point { position: Vec3::Y, intensity: Vec3::ONE });
    // A wide view: few photons fall anywhere.
    let scene = build.seen(Vec3::new(0.0, 0.2, 0.2), Vec3::ZERO, 50.0, SIDE);
    // Mean of cosθ/d² over what is seen.
    let (lens, eye) = (scene.camera.lens(), scene.camera.origin.as_dvec3());
    let irradiance = (0..SIDE * SIDE).map(|i| {
        let direction = lens.direction((i % SIDE) as f32 + 0.5, (i / SIDE) as f32 + 0.5).as_dvec3();
        let at = eye - direction * (eye.y / direction.y);
        (at - glam::DVec3::Y).length().powi(-3)
    });
    let mean = irradiance.sum::<f64>() / f64::from(SIDE * SIDE);
    Exact { name: "light in the middle of a glass ball".into(), scene, radiance: 0.5 / PI * mean, tolerance: 5e-3 }
}

/// The same over a floor of two centimetres half a metre away: one photon in eight thousand that leave at random comes there.
pub fn light_in_glass_far_from_little() -> Exact {
    const HEIGHT: f32 = 0.5;
    let mut build = Build::new("light in glass far from little");
    let (ball, floor) = (build.surface(glass(1.5, false)), build.paint(0.5, 0.0));
    build.sphere(Vec3::Y * HEIGHT, 0.05, 100, Fronts::Outwards, ball);
    build.quad(Vec3::ZERO, Vec3::Z * 0.01, Vec3::X * 0.01, floor);
    build.light(Light::Point { position: Vec3::Y * HEIGHT, intensity: Vec3::ONE });
    let mut scene = build.seen(Vec3::new(0.0, 0.02, 0.02), Vec3::ZERO, 10.0, SIDE);
    // Smooth: through flat facets, the floor would be lit in a pattern.
    let mesh = Arc::make_mut(&mut scene.meshes[0]);
    let normal = |at: &Vec3| if at.y > 0.5 * HEIGHT { (*at - Vec3::Y * HEIGHT).normalize() } else { Vec3::ZERO };
    mesh.normals = mesh.positions.iter().map(normal).collect();
    Exact {
        name: "light in a glass ball far from little".into(),
        scene,
        radiance: 0.5 / PI / f64::from(HEIGHT).powi(2),
        tolerance: 5e-3,
    }
}

/// A spot in the middle of a glass ball shines on a floor no larger than photons are wide, of which so much is there. All
/// that falls on it is seen, from afar. What one wall of the ball reflects goes to the other, and by reflections there back: of
/// all orders, 1/(1 + R) comes down.
pub fn light_in_glass_over_little(amount: f32) -> Exact {
    const HALF: f32 = 0.05;
    const SUBPIXELS: u32 = 64;
    let middle = Vec3::Y * 0.3;
    let mut build = Build::new("light in glass over little");
    let ball = build.surface(glass(1.5, false));
    let coverage = (amount < 1.0).then(|| Coverage::plain(amount));
    let floor = build.material(Material { coverage, ..Material::diffuse("floor", Vec3::splat(0.5)) });
    build.sphere(middle, 0.2, 100, Fronts::Outwards, ball);
    build.quad(Vec3::ZERO, Vec3::Z * HALF, Vec3::X * HALF, floor);
    // As bright all over the floor.
    let [cos_inner, cos_outer] = [15.0_f32, 16.0].map(|angle| angle.to_radians().cos());
    build.light(Light::Spot { position: middle, direction: -Vec3::Y, intensity: Vec3::ONE, cos_inner, cos_outer });
    // Past the ball.
    let scene = build.seen(Vec3::new(0.0, 0.4, 1.0) * 4.0, Vec3::ZERO, 1.6, SIDE);
    // cosθ/d² where the floor is seen.
    let (lens, eye) = (scene.camera.lens(), scene.camera.origin.as_dvec3());
    let along = |i: u32| (i as f32 + 0.5) / SUBPIXELS as f32;
    let irradiance = |i: u32| {
        let direction = lens.direction(along(i % (SIDE * SUBPIXELS)), along(i / (SIDE * SUBPIXELS))).as_dvec3();
        let at = eye - direction * (eye.y / direction.y);
        let is_floor = at.x.abs().max(at.z.abs()) < f64::from(HALF);
        let offset = middle.as_dvec3() - at;
        if is_floor { offset.y / offset.length().powi(3) } else { 0.0 }
    };
    let count = (SIDE * SUBPIXELS).pow(2);
    let mean = (0..count).map(irradiance).sum::<f64>() / f64::from(count);
    Exact {
        name: format!("light in a glass ball over little, of which {amount} is there"),
        scene,
        radiance: f64::from(amount) * 0.5 / PI * mean / (1.0 + closed_form::fresnel(1.0, 1.5)),
        tolerance: 1e-2,
    }
}

/// So many panes of thin glass between the eye and an emitter of radiance 1, all reflections between
/// them: m faces of reflectance R let `(1 − R)/(1 + (m − 1) R)` through.
pub fn stack(panes: u32) -> Exact {
    let mut build = Build::new("stack");
    let (pane, emitter) = (build.surface(glass(1.5, true)), build.paint(0.0, 1.0));
    for i in 0..panes {
        build.quad(Vec3::NEG_Z * i as f32 * 0.1, Vec3::X * 2.0, Vec3::Y * 2.0, pane);
    }
    build.quad(Vec3::NEG_Z * 5.0, Vec3::X * 20.0, Vec3::Y * 20.0, emitter);
    let (face, faces) = (closed_form::fresnel(1.0, 1.5), f64::from(2 * panes));
    Exact {
        name: format!("{panes} panes"),
        scene: build.seen(Vec3::Z, Vec3::ZERO, 1.0, SIDE),
        radiance: (1.0 - face) / (1.0 + (faces - 1.0) * face),
        tolerance: 1e-3,
    }
}

/// Row 56: a white plate under clear lacquer of that roughness and a uniform sky, seen at that angle from its normal:
/// nothing is lost.
pub fn lacquered_plate(roughness: f32, angle_deg: f32) -> Exact {
    let metal = rough_metal(roughness, angle_deg);
    let mut scene = metal.scene;
    for material in &mut scene.materials {
        if let Surface::Glossy(Gloss { metalness, .. }) = &mut material.surface {
            *metalness = Scalar::plain(0.0);
        }
    }
    Exact { name: format!("lacquer of roughness {roughness} at {angle_deg}°"), scene, radiance: 1.0, tolerance: 2e-3 }
}

/// A plate of plastic, black or white, whose highlights have that roughness, strength and grey (KHR_materials_specular), under a
/// uniform sky, seen at that angle from its normal.
pub fn highlighted_plate(roughness: f32, amount: f32, grey: f32, white: bool, angle_deg: f32) -> Exact {
    let mut scene = rough_metal(roughness, angle_deg).scene;
    let base = Colour::plain(Vec3::splat(if white { 1.0 } else { 0.0 }));
    let specular = Specular { amount: Scalar::plain(amount), colour: Colour::plain(Vec3::splat(grey)) };
    scene.materials[0].surface =
        Surface::Glossy(Gloss { specular, ..Gloss::new(base, Scalar::plain(roughness), Scalar::plain(0.0)) });
    let ends = [(0.04 * grey).min(1.0) * amount, amount].map(f64::from);
    let seen = closed_form::highlight(f64::from(roughness).powi(2), ends, f64::from(angle_deg).to_radians().cos());
    let over = if white { "white" } else { "black" };
    Exact {
        name: format!("highlight of {amount} × {grey}, roughness {roughness}, over {over} at {angle_deg}°"),
        scene,
        radiance: if white { 1.0 } else { seen },
        tolerance: 4e-3,
    }
}

/// A plate under white sheen of that strength and roughness and a uniform sky, seen at that angle from its normal.
pub fn plate_under_sheen(strength: f32, roughness: f32, under: Under, angle_deg: f32) -> Exact {
    let gloss = match under {
        Under::Matt(albedo) => Gloss {
            specular: Specular { amount: Scalar::plain(0.0), ..Specular::WHOLE },
            ..Gloss::new(Colour::plain(Vec3::splat(albedo as f32)), Scalar::plain(1.0), Scalar::plain(0.0))
        },
        Under::Metal(alpha) => {
            Gloss::new(Colour::plain(Vec3::ONE), Scalar::plain(alpha.sqrt() as f32), Scalar::plain(1.0))
        }
    };
    let sheen = Sheen { colour: Colour::plain(Vec3::splat(strength)), roughness: Scalar::plain(roughness) };
    let mut scene = rough_metal(0.5, angle_deg).scene;
    scene.materials[0].surface = Surface::Glossy(Gloss { sheen: Some(sheen), ..gloss });
    let cos = f64::from(angle_deg).to_radians().cos();
    Exact {
        name: format!("sheen of {strength}, roughness {roughness}, over {under:?} at {angle_deg}°"),
        scene,
        radiance: closed_form::sheen(f64::from(strength), f64::from(roughness).powi(2), under, cos),
        tolerance: 5e-3,
    }
}

/// Such a plate, white below, where the walls are that [`metal_in_a_furnace`] has.
pub fn sheen_in_a_furnace(roughness: f32, under: Under) -> Exact {
    let plate = plate_under_sheen(0.8, roughness, under, 40.0);
    let mut furnace = metal_in_a_furnace(0.5);
    furnace.scene.materials[0].surface = plate.scene.materials[0].surface.clone();
    Exact { name: format!("{} in a furnace", plate.name), radiance: plate.radiance, tolerance: 7e-3, ..furnace }
}

/// A white plate of that roughness, metal or not, under a coat of another and a uniform sky.
pub fn coated_plate(amount: f32, coat: f32, roughness: f32, metal: bool, angle_deg: f32) -> Exact {
    let mut scene = rough_metal(roughness, angle_deg).scene;
    for material in &mut scene.materials {
        if let Surface::Glossy(Gloss { metalness, coat: over, .. }) = &mut material.surface {
            *metalness = Scalar::plain(if metal { 1.0 } else { 0.0 });
            *over = Some(Coat { amount: Scalar::plain(amount), roughness: Scalar::plain(coat) });
        }
    }
    let alpha = |roughness: f32| f64::from(roughness).powi(2).max(1e-3);
    let under = (if metal { 1.0 } else { f64::from(0.04_f32) }, alpha(roughness));
    let cos = f64::from(angle_deg).to_radians().cos();
    let what = if metal { "metal" } else { "plastic" };
    Exact {
        name: format!("{amount} of a coat of roughness {coat} over {what} of {roughness} at {angle_deg}°"),
        scene,
        radiance: closed_form::lacquered(f64::from(amount), alpha(coat), under, !metal, cos),
        tolerance: 3e-3,
    }
}

/// A white metal plate of that roughness under a uniform sky, seen at that angle from its normal: what it
/// reflects is what single scattering by GGX facets leaves.
pub fn rough_metal(roughness: f32, angle_deg: f32) -> Exact {
    let mut build = Build::new("rough metal");
    let metal = build.surface(white_metal(roughness));
    build.quad(Vec3::ZERO, Vec3::Z, Vec3::X, metal);
    build.environment(1.0);
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    let alpha = f64::from(roughness).powi(2).max(1e-3);
    Exact {
        name: format!("metal of roughness {roughness} at {angle_deg}°"),
        scene: build.seen(Vec3::new(sin, cos, 0.0), Vec3::ZERO, 1.0, SIDE),
        radiance: closed_form::ggx_albedo(alpha, f64::from(cos)),
        tolerance: 2e-3,
    }
}

/// A small plate of white metal in the middle of a ball whose walls shine and reflect by halves: from everywhere comes
/// radiance 1, half of it off surfaces.
pub fn metal_in_a_furnace(roughness: f32) -> Exact {
    let mut build = Build::new("metal in a furnace");
    let (metal, wall) = (build.surface(white_metal(roughness)), build.paint(0.5, 0.5));
    build.quad(Vec3::ZERO, Vec3::Z * 0.03, Vec3::X * 0.03, metal);
    build.sphere(Vec3::ZERO, 1.0, 24, Fronts::Inwards, wall);
    let (sin, cos) = 40.0_f32.to_radians().sin_cos();
    Exact {
        name: format!("metal of roughness {roughness} in a furnace"),
        scene: build.seen(Vec3::new(sin, cos, 0.0) * 0.5, Vec3::ZERO, 2.0, SIDE),
        radiance: closed_form::ggx_albedo(f64::from(roughness).powi(2), f64::from(cos)),
        tolerance: 5e-3,
    }
}

/// Such a plate under a whole coat where the walls are.
pub fn coat_in_a_furnace(coat: f32, roughness: f32, metal: bool) -> Exact {
    const ANGLE: f32 = 40.0;
    let plate = coated_plate(1.0, coat, roughness, metal, ANGLE);
    let mut furnace = metal_in_a_furnace(roughness);
    furnace.scene.materials[0].surface = plate.scene.materials[0].surface.clone();
    Exact { name: format!("{} in a furnace", plate.name), radiance: plate.radiance, ..furnace }
}

/// A metal plate of that roughness and grey under a uniform sky, with the light that meets several of its facets: white
/// metal reflects all there is.
pub fn whole_metal(roughness: f32, grey: f32, angle_deg: f32) -> Exact {
    let Exact { mut scene, .. } = rough_metal(roughness, angle_deg);
    for material in &mut scene.materials {
        if let Surface::Glossy(Gloss { base, .. }) = &mut material.surface {
            *base = Colour::plain(Vec3::splat(grey));
        }
    }
    scene.multiple_scattering = true;
    let (alpha, cos) = (f64::from(roughness).powi(2), f64::from(angle_deg).to_radians().cos());
    Exact {
        name: format!("all of metal {grey} of roughness {roughness} at {angle_deg}°"),
        scene,
        radiance: if grey < 1.0 { closed_form::whole_metal(alpha, f64::from(grey), cos) } else { 1.0 },
        tolerance: 3e-3,
    }
}

/// White metal of which nothing is lost, where the walls are that [`metal_in_a_furnace`] has: they light it, and it them.
pub fn whole_metal_in_a_furnace(roughness: f32) -> Exact {
    let mut furnace = metal_in_a_furnace(roughness);
    furnace.scene.multiple_scattering = true;
    Exact { name: format!("all of {}", furnace.name), radiance: 1.0, ..furnace }
}

fn white_metal(roughness: f32) -> Surface {
    Surface::Glossy(Gloss::new(Colour::plain(Vec3::ONE), Scalar::plain(roughness), Scalar::plain(1.0)))
}
