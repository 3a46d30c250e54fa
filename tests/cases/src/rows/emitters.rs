//! Rows 10 to 17, 19, 21, 22: emitters and skies above floors.

use glam::Vec3;
use protocol::question::{Bound, Quality};

use crate::case::{Case, Exact, Finding, Method, Pace, Trial};
use crate::closed_form;
use crate::oracle::{Gate, Room};
use crate::worlds::skies::{self, Sky};
use crate::worlds::{emitters, stress};

use Method::{Bounded, Igi};
use Pace::{Long, Quick};

/// The cases.
pub const CASES: &[Case] = &[
    Case {
        row: 10,
        name: "point-light",
        teaches: "I cosθ / d², up to grazing angles",
        pace: Quick,
        methods: Method::LIGHT,
        run: |trial| {
            let places = [Vec3::Y, Vec3::new(3.0, 1.0, 2.0), Vec3::new(0.0, 1e-3, 5.0)];
            places.map(|to| trial.exact(&emitters::point_above_floor(to))).into()
        },
    },
    Case {
        row: 11,
        name: "rectangle-lamp",
        teaches: "area lamps, sampled as virtual lights",
        pace: Quick,
        methods: Method::LIGHT,
        run: |trial| {
            [([2.0, 2.0], 1.0), ([0.5, 3.0], 0.7)]
                .map(|(sides, h)| many(trial, &emitters::rectangle_above_floor(sides, h)))
                .into()
        },
    },
    Case {
        row: 12,
        name: "polygon-lamp",
        teaches: "Lambert's formula for any polygon",
        pace: Quick,
        methods: Method::LIGHT,
        run: |trial| vec![many(trial, &emitters::polygon_above_floor(&emitters::tilted_pentagon()))],
    },
    Case {
        row: 13,
        name: "disc-and-ball",
        teaches: "lamps of many triangles, half of them turned away",
        pace: Quick,
        methods: Method::LIGHT,
        run: |trial| {
            let ball = emitters::ball_above_floor(0.5, Vec3::new(1.0, 1.5, 0.0));
            vec![many(trial, &emitters::disc_above_floor(1.0, 0.5)), many(trial, &ball)]
        },
    },
    Case {
        row: 14,
        name: "wall-lamp",
        teaches: "a glowing wall that stands on the floor, close by",
        pace: Quick,
        methods: &[Igi, Bounded, Method::Reference],
        run: |trial| [0.1, 1.0].map(|h| many(trial, &emitters::wall_beside_floor(1.0, 0.5, h))).into(),
    },
    Case {
        row: 15,
        name: "bound-near-wall",
        teaches: "what a bound takes beside an endless wall, by h√b; the compensation gives it back",
        pace: Quick,
        methods: &[Igi, Bounded],
        run: |trial| bound_near_wall(trial, &[0, 3, 6]),
    },
    Case {
        row: 15,
        name: "bound-near-wall-all",
        teaches: "the same for the whole list of h√b",
        pace: Long,
        methods: &[Igi, Bounded],
        run: |trial| bound_near_wall(trial, &[0, 1, 2, 3, 4, 5, 6, 7]),
    },
    Case {
        row: 16,
        name: "cube-faces",
        teaches: "form factors between the faces of a cube",
        pace: Quick,
        methods: Method::LIGHT,
        run: cube_faces,
    },
    Case {
        row: 17,
        name: "sky",
        teaches: "uniform and overcast skies on floors and walls",
        pace: Quick,
        methods: Method::LIGHT,
        run: |trial| {
            let both = [Sky::Uniform, Sky::Overcast];
            let scenes = both.map(skies::open_floor).into_iter().chain(both.map(skies::open_wall));
            scenes.map(|exact| many(trial, &exact)).collect()
        },
    },
    Case {
        row: 17,
        name: "roof-opening",
        teaches: "a small part of the sky is found",
        pace: Long,
        methods: Method::UNBIASED,
        run: |trial| vec![most_hidden(trial, &skies::roof_opening())],
    },
    Case {
        row: 19,
        name: "light-in-a-corner",
        teaches: "a light on three faces at once lights the other three, by an eighth of its flux",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            let quality = Quality { max_length: Some(0), vpls: 0, ..trial.quality() };
            let [far, dark] = emitters::light_in_a_corner();
            // Nothing is expected, so that no noise is small beside it: all rays that are allowed are traced.
            let mut grazed = trial.briefly().agrees(&dark, &quality, dark.radiance);
            // The light's cosine is a rounding, not 0, and near the light it counts over the square of the distance: the
            // mean hangs on few points. The reference rounds the direction from the point itself, which is coarser.
            let rounding = if trial.method == Method::Reference { 1e-6 } else { 1e-8 };
            grazed.tolerance = rounding * far.radiance;
            grazed.resolution = 10.0 * grazed.tolerance;
            vec![trial.agrees(&far, &quality, far.radiance), grazed]
        },
    },
    Case {
        row: 21,
        name: "grazing-light",
        teaches: "offsets against self-shadowing must not show in the cosine",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| [0.02, 1.0].map(|half| trial.exact(&emitters::grazing_light(half))).into(),
    },
    Case {
        row: 22,
        name: "dim-beside-bright",
        teaches: "a dim lamp is not starved by one 10⁹ times brighter that lights nothing here",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| vec![most_hidden(trial, &emitters::emitter_beside_a_hidden_sun(1.0, 1e9))],
    },
    Case {
        row: 38,
        name: "hundred-thousand-lamps",
        teaches: "lamps of which each is chosen once in a million times are still chosen often enough",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| vec![split_emitter(trial, 256)],
    },
    Case {
        row: 38,
        name: "million-lamps",
        teaches: "2²⁰ lamps light a floor like one as large",
        pace: Long,
        methods: Method::UNBIASED,
        run: |trial| vec![split_emitter(trial, 725)],
    },
];

/// More points on emitters than usual: these scenes have nothing else, and all points on them matter.
fn many(trial: &Trial, exact: &Exact) -> Finding {
    trial.agrees(exact, &Quality { light_samples: 64, importance: false, ..trial.quality() }, exact.radiance)
}

/// The same where most of the light goes elsewhere, so that importance has something to find.
fn most_hidden(trial: &Trial, exact: &Exact) -> Finding {
    trial.agrees(exact, &Quality { light_samples: 64, ..trial.quality() }, exact.radiance)
}

fn bound_near_wall(trial: &Trial, which: &[usize]) -> Vec<Finding> {
    let wall = emitters::endless_wall();
    let quality = Quality { light_samples: 1024, importance: false, ..trial.quality() };
    let extent = super::closed_rooms::extent(&wall, &quality) as f32;
    // A floor point sees half of what an endless glowing ceiling would send.
    let all = f64::from(emitters::FLOOR) / 2.0;
    let each = which.iter().map(|i| {
        let (h_sqrt_b, kept) = closed_form::KEPT_BY_BOUND[*i];
        // b = 1/d², and emitters are bounded closer by a constant.
        let distance = light::vpl::EMITTERS_CLOSER / (h_sqrt_b as f32 * extent);
        let bound = Bound::Geometry { distance };
        let quality = Quality { bound, ..quality };
        let lost = if trial.method == Bounded { (1.0 - kept) * all } else { 0.0 };
        let mut finding = trial.agrees(&wall, &quality, wall.radiance - lost);
        finding.what = format!("h√b = {h_sqrt_b}");
        finding
    });
    each.collect()
}

fn cube_faces(trial: &Trial) -> Vec<Finding> {
    let (room, quality) = (Room::cube(1.0), Quality { light_samples: 64, importance: false, ..trial.quality() });
    let lit = [5, 0];
    let both = emitters::cube_faces().into_iter().zip(lit).map(|(exact, face)| {
        let gate = Gate::pair(&quality, super::closed_rooms::extent(&exact, &quality))[0];
        let mut radiance = [0.0; 6];
        radiance[face] = 1.0;
        // The quadrature's own error divides out.
        let [open, gated] = [Gate::Open, gate].map(|gate| room.irradiance(&exact.scene, radiance, gate));
        let expected = if trial.method.is_unbiased() { exact.radiance } else { exact.radiance * gated / open };
        trial.agrees(&exact, &quality, expected)
    });
    both.collect()
}

fn split_emitter(trial: &Trial, cuts: u32) -> Finding {
    let whole = emitters::rectangle_above_floor([2.0, 2.0], 1.0);
    let scene = stress::split_emitters(&whole.scene, cuts);
    let name = format!("{} lamps", 2 * cuts * cuts);
    let began = (trial.clock)();
    drop(light::Prepared::new(scene.clone()));
    let built = (trial.clock)() - began;
    many(trial, &Exact { name, scene, ..whole }).note(format!("built in {:.2} s", built as f64 / 1e6))
}
