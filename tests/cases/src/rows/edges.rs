//! Rows 20, 23, 26, 31, 33, 37, 39: the edges of single precision and of the settings.

use glam::{DVec3, Vec3};
use light::photons::{Photon, PhotonMap};
use light::vpl::{Gate, Shape, Vpl};
use protocol::question::{Bound, Quality};

use crate::case::{Case, Finding, Method, Pace, Trial};
use crate::measure::{self, Stage, mean, picture, unsound};
use crate::worlds::{furnaces, glass, hunted, stress};

use Method::{Igi, Machinery};
use Pace::Quick;

/// The cases.
pub const CASES: &[Case] = &[
    Case {
        row: 20,
        name: "light-on-the-point",
        teaches: "a virtual light on the point it lights brings nothing and no NaN",
        pace: Quick,
        methods: &[Igi],
        run: light_on_the_point,
    },
    Case {
        row: 20,
        name: "geometry-term",
        teaches: "the bounded geometry term between near points of a sphere, in single precision",
        pace: Quick,
        methods: &[Machinery],
        run: |_| geometry_term(),
    },
    Case {
        row: 23,
        name: "scaling-by-powers-of-two",
        teaches: "no epsilon has a unit: scaling a scene by 2^k changes no bit",
        pace: Quick,
        methods: Method::VIRTUAL,
        run: scaling_by_powers_of_two,
    },
    Case {
        row: 23,
        name: "scaling-by-a-million",
        teaches: "scenes of a micrometre and of a thousand kilometres have their radiance",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            let sizes = [1e-6_f32, 1e6].map(|s| furnaces::integrating_sphere(s, 100.0 * s * s, 0.5));
            sizes.map(|exact| trial.agrees(&exact, &trial.quality_for(0.5), exact.radiance)).into()
        },
    },
    Case {
        row: 26,
        name: "doubled-surfaces",
        teaches: "of two surfaces in one place the first wins, everywhere",
        pace: Quick,
        methods: Method::VIRTUAL,
        run: |trial| {
            let scene = &glass::ball_in_a_box(1.5)[0];
            let both = [scene, &stress::doubled(scene)].map(|scene| picture(scene, &trial.quality(), 2, 1));
            vec![differing("pixels that differ", &both[0], &both[1])]
        },
    },
    Case {
        row: 31,
        name: "no-light",
        teaches: "without light all is black, and nothing is traced for it",
        pace: Quick,
        methods: Method::VIRTUAL,
        run: no_light,
    },
    Case {
        row: 33,
        name: "denormals",
        teaches: "radiance and albedo at the end of single precision: kept or flushed, never anything else",
        pace: Quick,
        methods: Method::VIRTUAL,
        run: denormals,
    },
    Case {
        row: 37,
        name: "one-of-each",
        teaches: "one lamp, one path, one photon: unbiased over runs",
        pace: Quick,
        methods: &[Igi],
        run: |trial| {
            let quality = Quality { light_samples: 1, vpls: 1, photons: 1, ..trial.quality_for(0.5) };
            let exact = furnaces::integrating_sphere(2.0, 100.0, 0.5);
            vec![trial.agrees(&exact, &quality, exact.radiance)]
        },
    },
    Case {
        row: 39,
        name: "tiny-photon-radius",
        teaches: "grid cells beyond 2³¹ and below 0 find what brute force finds",
        pace: Quick,
        methods: &[Machinery],
        run: |_| tiny_photon_radius(),
    },
];

/// Number of pixels that are not the same bits.
pub fn differing(what: &str, one: &[DVec3], other: &[DVec3]) -> Finding {
    let count = one.iter().zip(other).filter(|(a, b)| a != b).count() + one.len().abs_diff(other.len());
    Finding::none(what, count)
}

fn light_on_the_point(trial: &Trial) -> Vec<Finding> {
    let bounds = [Bound::None, Bound::Geometry { distance: 0.1 }, Bound::Clip { distance: 0.02 }];
    let each = bounds.map(|bound| {
        let quality = Quality { bound, vpls: 200, interleave: [1, 1], ..trial.quality() };
        let stage = Stage::new(&stress::touching_corner(), quality);
        let exposure = stage.expose(1, 0..4);
        let count = unsound(&exposure.pixels) + exposure.cost.dropped as usize;
        Finding::none(format!("unsound samples, {bound:?}"), count)
    });
    each.into()
}

/// On a unit sphere `G = 1/4` between any two points. Near points have lost most of their digits; what is left
/// must stay within the bound.
fn geometry_term() -> Vec<Finding> {
    let middle = Vec3::new(3.0, -2.0, 5.0);
    let on_sphere = |angle: f32| middle + Vec3::new(angle.sin(), angle.cos(), 0.0);
    let term = |distance: f32, gate| {
        let (x, y) = (on_sphere(0.3), on_sphere(0.3 + distance));
        let vpl = Vpl {
            position: y,
            normal: (middle - y).normalize(),
            strength: Vec3::ONE,
            shape: Shape::Surface,
            depth: 1,
            source: 0,
            density: None,
        };
        f64::from(vpl.irradiance(x, (middle - x).normalize(), gate).0.x)
    };
    let open = [(1.0, 1e-5), (1e-2, 2e-3)].map(|(distance, tolerance)| {
        Finding::exact(format!("G at distance {distance}"), 0.25, term(distance, Gate::Open), tolerance)
    });
    let near = [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 0.0].map(|distance| {
        let g = term(distance, Gate::Bound { most: 1.0 });
        Finding::holds(format!("0 ≤ G ≤ bound at distance {distance}"), (0.0..=1.0).contains(&g))
            .note(format!("G = {g}"))
    });
    open.into_iter().chain(near).collect()
}

fn scaling_by_powers_of_two(trial: &Trial) -> Vec<Finding> {
    let scenes = [glass::ball_in_a_box(1.5)[1].clone(), hunted::room_with_outdoors(true, true)];
    let each = scenes.iter().flat_map(|scene| {
        let here = picture(scene, &trial.quality(), 2, 3);
        [0.25, 1024.0, 2.0_f32.powi(-20), 2.0_f32.powi(20)].map(|s| {
            let there = picture(&stress::scaled(scene, s), &trial.quality(), 2, 3);
            differing(&format!("pixels of {} that differ at scale {s}", scene.name), &here, &there)
        })
    });
    each.collect()
}

fn no_light(trial: &Trial) -> Vec<Finding> {
    let exposure = Stage::new(&stress::dark_room(), trial.quality()).expose(1, 0..2);
    let lit = exposure.pixels.iter().filter(|p| **p != DVec3::ZERO).count();
    let cost = exposure.cost;
    let rays = cost.light_rays + cost.shadow_rays + cost.compensation_rays + cost.photon_queries;
    vec![Finding::none("lit pixels", lit), Finding::none("rays for light", rays as usize)]
}

fn denormals(trial: &Trial) -> Vec<Finding> {
    let exact = hunted::almost_nothing();
    let quality = trial.quality();
    let timed = |scene: &scenes::Scene| {
        let began = (trial.clock)();
        let pixels = picture(scene, &quality, 8, 1);
        (pixels, (trial.clock)() - began)
    };
    let (pixels, time) = timed(&exact.scene);
    let mut bright = exact.scene.clone();
    bright.materials[0].emission.value = Vec3::ONE;
    let ratio = time as f64 / timed(&bright).1.max(1) as f64;
    let got = mean(&pixels);
    let kept_or_flushed = got == 0.0 || (got / exact.radiance - 1.0).abs() < 0.1;
    let fate = if got == 0.0 { "flushed" } else { "kept" };
    vec![
        Finding::none("unsound pixels", unsound(&pixels)),
        Finding::holds("denormals are kept or flushed", kept_or_flushed)
            .note(format!("{fate}: {got:.2e} of {:.2e}; takes {ratio:.1} times as long as radiance 1", exact.radiance)),
    ]
}

fn tiny_photon_radius() -> Vec<Finding> {
    let random = |i: u32, salt: u32| light::sample::mix(i * 4 + salt) as f32 / 4_294_967_296.0;
    let each = [(1.0_f32, 0.0_f32), (1e-3, -5e-4), (1e4, -5e3), (1.0, 3e5)].map(|(scale, offset)| {
        let point = |i: u32| Vec3::new(random(i, 0), random(i, 1), 0.05 * random(i, 2)) * scale + Vec3::splat(offset);
        let flux = |i: u32| Vec3::splat(random(i, 3));
        let photon = |i| Photon { position: point(i), normal: Vec3::Z, from: Vec3::Z, flux: flux(i), shines_on: false };
        let photons: Vec<Photon> = (0..2000).map(photon).collect();
        let mut worst = 0.0_f64;
        for radius in [0.05 * scale, 1e-9 * scale] {
            let map = PhotonMap::new(photons.clone(), radius);
            for i in 0..200 {
                let at = if i % 2 == 0 { point(5000 + i) } else { photons[i as usize].position };
                let near = photons.iter().filter(|p| p.position.distance_squared(at) <= radius * radius);
                let brute = near.map(|p| f64::from(p.flux.x)).sum::<f64>();
                let found = f64::from(map.gather(at, Vec3::Z, |_| Vec3::ONE).x)
                    * std::f64::consts::PI
                    * f64::from(radius).powi(2);
                worst = worst.max((found - brute).abs() / brute.max(1e-9));
            }
        }
        let what = format!("relative deviation, scene of {scale} at {offset}");
        Finding { tolerance: 1e-5, ..Finding::exact(what, 0.0, worst, 0.0) }
    });
    each.into()
}

/// The picture's mean over few frames, for scenes that only have to agree with each other.
pub fn rough_mean(trial: &Trial, scene: &scenes::Scene, frames: u32) -> f64 {
    mean(&measure::picture(scene, &trial.quality(), frames, 1))
}
