//! Rows 18, 27 to 30, 41, 49 to 51, 53, 68, 69, 73: glass and mirrors.

use protocol::question::Quality;

use crate::case::{Case, Effort, Finding, Method, Pace, Trial};
use crate::closed_form;
use crate::measure;
use crate::worlds::build::{Build, Fronts};
use crate::worlds::panes::{self, Outside};
use crate::worlds::skies::{self, Sky};
use crate::worlds::{furnaces, glass, relayed};

use Method::{Bounded, Igi, Paper};
use Pace::Quick;

/// The cases.
pub const CASES: &[Case] = &[
    Case {
        row: 18,
        name: "sun-through-a-slab",
        teaches: "a flat caustic is as bright as the glass lets through, with all reflections inside",
        pace: Quick,
        methods: &[Igi, Paper],
        run: |trial| {
            let exact = glass::sun_through_a_slab();
            // The caustic is even: a wider look loses nothing.
            let usual = photons_alone(trial);
            let quality = Quality { photon_radius: usual.photon_radius * 2.0, ..usual };
            vec![trial.agrees(&exact, &quality, exact.radiance)]
        },
    },
    Case {
        row: 27,
        name: "index-one",
        teaches: "glass of index 1 is not there, for eyes, lights and photons",
        pace: Quick,
        methods: &[Igi, Bounded, Method::Reference],
        run: |trial| vec![index_one(trial)],
    },
    Case {
        row: 28,
        name: "total-reflection",
        teaches: "beyond 41.8° no light leaves glass, and none is lost",
        pace: Quick,
        methods: Method::LIGHT,
        run: |trial| vec![trial.exact(&glass::light_caught_in_glass())],
    },
    Case {
        row: 28,
        name: "fresnel",
        teaches: "reflectance by angle and index, against the formula in double precision",
        pace: Quick,
        methods: &[Method::Machinery],
        run: |_| fresnel(),
    },
    Case {
        row: 29,
        name: "thin-glass",
        teaches: "a pane reflects 2R/(1+R) and lets the rest through",
        pace: Quick,
        methods: Method::LIGHT,
        run: |trial| [glass::pane_before_an_emitter(), glass::emitter_in_a_pane()].map(|e| trial.exact(&e)).into(),
    },
    Case {
        row: 29,
        name: "lamps-in-mirrors",
        teaches: "points, spots and suns shine through panes and out of mirrors for a path tracer, too",
        pace: Quick,
        methods: &[Method::Reference],
        run: |trial| {
            let suns = [(1, 30.0), (1, 75.0), (3, 50.0)].map(|(panes, angle)| relayed::sun_through_panes(panes, angle));
            let mirrors = [(0.5, false), (0.5, true)].map(|(r, spot)| relayed::between_mirrors(r, spot));
            let lamps = suns.into_iter().chain(mirrors).chain([relayed::point_through_a_tinted_pane()]);
            lamps.map(|exact| trial.exact(&exact)).collect()
        },
    },
    Case {
        row: 29,
        name: "lights-through-panes",
        teaches: "what stands behind panes shines through them as light samples, all of it",
        pace: Quick,
        methods: &[Igi],
        run: |trial| {
            let suns = [30.0, 75.0].map(|angle| relayed::sun_through_panes(1, angle));
            let points = [relayed::point_through_a_tinted_pane(), panes::light_through_slanting_panes(true)];
            let lamp = panes::light_through_slanting_panes(false);
            suns.into_iter().chain(points).chain([lamp]).map(|exact| trial.exact(&exact)).collect()
        },
    },
    Case {
        row: 29,
        name: "greenhouse",
        teaches: "each path through glass is counted once: a house of glass in uniform light is not there",
        pace: Quick,
        methods: &[Igi],
        run: |trial| {
            [
                (true, Outside::Sky, 0),
                (false, Outside::Room, 0),
                (false, Outside::Sky, 1000),
                (true, Outside::Room, 1000),
            ]
            .map(|(thin, outside, photons)| {
                let exact = panes::greenhouse(thin, outside);
                trial.agrees(&exact, &Quality { photons, ..trial.quality() }, exact.radiance)
            })
            .into()
        },
    },
    Case {
        row: 73,
        name: "lit-from-a-far-wall",
        teaches: "light of a wall outside that hardly ever finds the window lights the room all the same",
        pace: Quick,
        methods: &[Igi],
        // Unaimed, the light would come in flashes too rare to be known so well by so few rays.
        run: |trial| vec![trial.briefly().exact(&panes::lit_from_a_far_wall())],
    },
    Case {
        row: 30,
        name: "facing-mirrors",
        teaches: "image k in mirrors of ρ has ρ^k of the light, even where nothing but roulette ends a path",
        pace: Quick,
        methods: Method::UNBIASED,
        run: facing_mirrors,
    },
    Case {
        row: 41,
        name: "eye-in-glass",
        teaches: "radiance in glass is n² times as large",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| vec![trial.exact(&glass::eye_in_glass(1.5))],
    },
    Case {
        row: 41,
        name: "light-in-glass",
        teaches: "all flux of a light in the middle of a glass ball gets out",
        pace: Quick,
        methods: &[Igi],
        run: |trial| {
            let exact = glass::light_in_glass();
            vec![trial.roughly().agrees(&exact, &photons_alone(trial), exact.radiance)]
        },
    },
    Case {
        row: 69,
        name: "little-far-from-glass",
        teaches: "photons of a lamp in glass go where somebody looks, however little that is",
        pace: Quick,
        methods: &[Igi],
        run: |trial| {
            let exact = glass::light_in_glass_far_from_little();
            // The light is even: a wider look loses nothing.
            let quality = Quality { photon_radius: 0.1, shrink_radius: false, ..trial.quality() };
            vec![trial.roughly().agrees(&exact, &quality, exact.radiance)]
        },
    },
    Case {
        row: 68,
        name: "wide-photons",
        teaches: "photons wider than what they lie on lose none of their light",
        pace: Quick,
        methods: &[Igi],
        run: |trial| {
            let usual = photons_alone(trial);
            let quality = Quality { photon_radius: 0.1, shrink_radius: false, ..usual };
            // Where half of the light was lost, a rough look will do.
            let rough = Trial { effort: Effort::Rough, ..*trial };
            [1.0, 0.4]
                .map(glass::light_in_glass_over_little)
                .map(|exact| rough.agrees(&exact, &quality, exact.radiance))
                .into()
        },
    },
    Case {
        row: 41,
        name: "inside-a-wall",
        teaches: "an eye in a wall sees black, a light in one lights nothing",
        pace: Quick,
        methods: Method::VIRTUAL,
        run: inside_a_wall,
    },
    Case {
        row: 49,
        name: "glass-stack",
        teaches: "twenty panes one behind the other, all reflections between them",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| vec![trial.exact(&glass::stack(20))],
    },
    Case {
        row: 50,
        name: "roughness",
        teaches: "white metal from mirror to chalk reflects what its facets leave, and never more than all",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            let cases = [(0.0, 30.0), (0.01, 30.0), (0.3, 30.0), (0.6, 60.0), (1.0, 30.0), (1.0, 80.0)];
            let quality = Quality { light_samples: 256, importance: false, ..trial.quality() };
            cases
                .map(|(roughness, angle)| glass::rough_metal(roughness, angle))
                .map(|exact| trial.agrees(&exact, &quality, exact.radiance))
                .into()
        },
    },
    Case {
        row: 51,
        name: "index-extremes",
        teaches: "a glass ball under a uniform sky cannot be seen, whatever its index",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| [1.0001, 1.5, 4.0].map(|ior| trial.exact(&glass::ball_under_sky(ior))).into(),
    },
    Case {
        row: 53,
        name: "shared-caustics",
        teaches: "light of lamps and skies over mirrors is the same, however photons and rays share it",
        pace: Quick,
        methods: &[Igi],
        run: shared_caustics,
    },
];

/// One set with many photons and little else, where photons bring everything.
fn photons_alone(trial: &Trial) -> Quality {
    Quality { photons: 8_000, vpls: 1, light_samples: 1, interleave: [1, 1], importance: false, ..trial.quality() }
}

/// An emitter and a sky over mirrors, found by rays alone, by both about alike, and by photons nine times in ten.
fn shared_caustics(trial: &Trial) -> Vec<Finding> {
    let trial = &trial.roughly();
    let [_, ceiling] = furnaces::mirror_shaft([0.8, 0.2]);
    [ceiling, skies::mirror_well(Sky::Overcast)]
        .iter()
        .flat_map(|exact| {
            [("rays alone", 0, 1.0), ("both", 2_000, 1.0), ("photons mostly", 8_000, 4.0)].map(
                |(who, photons, wide)| {
                    let usual = Quality { importance: false, ..trial.quality() };
                    let quality = Quality { photons, photon_radius: usual.photon_radius * wide, ..usual };
                    let what = format!("{}: {who}", exact.name);
                    trial.compare(what, &exact.scene, &quality, exact.radiance, exact.tolerance)
                },
            )
        })
        .collect()
}

fn index_one(trial: &Trial) -> Finding {
    let [empty, with_ball] = glass::ball_in_a_box(1.0);
    let quality = trial.quality();
    let rough = measure::mean(&measure::picture(&empty, &quality, 9, 0));
    // A little less each than what leaves their difference just clear.
    let resolution = trial.resolution(1e-3) * rough * 0.6;
    let [without, with] = [&empty, &with_ball].map(|scene| trial.estimate(scene, &quality, resolution));
    Finding {
        error: without.error.hypot(with.error),
        resolution: trial.resolution(1e-3) * without.mean,
        ..Finding::exact("mean with a ball of index 1", without.mean, with.mean, 1e-3)
    }
}

/// Largest deviation from the formula over angles, for an index and its inverse.
fn fresnel() -> Vec<Finding> {
    let worst = |eta: f32| {
        let cosines = (0..=1000).map(|i| i as f32 / 1000.0);
        let off = cosines.map(|cos| {
            let (got, expected) = (light::surface::fresnel(cos, eta).0, closed_form::fresnel(cos.into(), eta.into()));
            (f64::from(got) - expected).abs()
        });
        off.fold(0.0, f64::max)
    };
    [1.0001, 1.5, 4.0, 1.0 / 1.5, 0.25]
        // At index 1.0001 the last degree before grazing hangs on the last digits of the index itself.
        .map(|eta| Finding {
            tolerance: if eta == 1.0001 { 1e-4 } else { 1e-6 },
            ..Finding::exact(format!("index {eta}: error"), 0.0, worst(eta), 0.0)
        })
        .into()
}

fn facing_mirrors(trial: &Trial) -> Vec<Finding> {
    let seen = [(0.9, 10), (0.5, 4), (1.0, 200)].map(|(r, images)| trial.exact(&glass::facing_mirrors(r, images)));
    // Long after roulette has begun; few paths come so far, and those weigh the more.
    let far = glass::facing_mirrors(1.0, 300);
    let rough = Trial { effort: Effort::Rough, ..*trial };
    seen.into_iter().chain([rough.exact(&far)]).collect()
}

fn inside_a_wall(trial: &Trial) -> Vec<Finding> {
    let look = |eye_in_wall: bool| {
        let mut build = Build::new("inside a wall");
        let (wall, emitter) = (build.paint(0.5, 0.0), build.paint(0.0, 1.0));
        build.sphere(glam::Vec3::ZERO, 1.0, 8, Fronts::Outwards, wall);
        let side = if eye_in_wall { 3.0 } else { 0.0 };
        build.sphere(glam::Vec3::X * side, 0.1, 4, Fronts::Outwards, emitter);
        let eye = if eye_in_wall { glam::Vec3::ZERO } else { glam::Vec3::X * 3.0 };
        build.seen(eye, glam::Vec3::X * 0.5, 40.0, 8)
    };
    let quality = trial.quality();
    let dark = |what: &str, eye_in_wall| {
        let pixels = measure::picture(&look(eye_in_wall), &quality, 2, 1);
        Finding::none(what, pixels.iter().filter(|p| **p != glam::DVec3::ZERO).count())
    };
    vec![dark("lit pixels, eye in a wall", true), dark("lit pixels, light in a wall", false)]
}
