//! Rows 1 to 9: closed rooms full of light.

use std::f64::consts::PI;

use protocol::question::{Bound, Quality};

use crate::case::{Case, Exact, Finding, Method, Pace, Trial};
use crate::closed_form;
use crate::oracle::{Gate, Room};
use crate::worlds::emitters;
use crate::worlds::furnaces::{self, Source};

use Method::{Bounded, Igi, Paper};
use Pace::{Long, Quick};

/// The cases.
pub const CASES: &[Case] = &[
    Case {
        row: 1,
        name: "furnace-cube",
        teaches: "energy is neither made nor lost over any number of bounces",
        pace: Quick,
        methods: Method::LIGHT,
        run: |trial| [0.5, 0.9].map(|albedo| furnace_cube(trial, albedo)).into(),
    },
    Case {
        row: 1,
        name: "furnace-sphere",
        teaches: "the same where there are no corners",
        pace: Quick,
        methods: Method::LIGHT,
        run: |trial| [0.5, 0.9].map(|albedo| furnace_sphere(trial, albedo)).into(),
    },
    Case {
        row: 1,
        name: "furnace-stiff",
        teaches: "hundreds of bounces, then thousands, end by roulette and not by a limit",
        pace: Long,
        methods: &[Igi, Bounded, Method::Reference],
        run: |trial| [0.99, 0.999].map(|albedo| furnace_sphere(trial, albedo)).into(),
    },
    Case {
        row: 1,
        name: "furnace-limited",
        teaches: "a limit of K bounces keeps (1 − ρ^(K+1)) of the light",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| [1, 4].map(|most| furnace_limited(trial, most)).into(),
    },
    Case {
        row: 2,
        name: "white-ball",
        teaches: "a ball of albedo 1 under a uniform sky cannot be seen",
        pace: Quick,
        methods: Method::LIGHT,
        run: |trial| vec![trial.exact(&furnaces::white_ball())],
    },
    Case {
        row: 3,
        name: "lit-sphere",
        teaches: "a point light and glowing walls that must give the same radiance do",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            let quality = trial.quality_for(0.5);
            [Source::Point, Source::Walls]
                .map(furnaces::lit_sphere)
                .map(|exact| trial.agrees(&exact, &quality, exact.radiance))
                .into()
        },
    },
    Case {
        row: 4,
        name: "integrating-sphere",
        teaches: "G is the same between all points, so the placement of virtual lights cannot matter",
        pace: Quick,
        methods: Method::LIGHT,
        run: |trial| vec![integrating_sphere(trial)],
    },
    Case {
        row: 5,
        name: "bounded-sphere",
        teaches: "a bound below G takes exactly its share, and the compensation gives it back",
        pace: Quick,
        methods: &[Igi, Bounded],
        run: |trial| vec![bounded_sphere(trial)],
    },
    Case {
        row: 6,
        name: "concentric-spheres",
        teaches: "occlusion: wrong distributions of directions pass furnaces and fail here",
        pace: Quick,
        methods: Method::LIGHT,
        run: concentric_spheres,
    },
    Case {
        row: 7,
        name: "mirror-shaft",
        teaches: "light off a wall and over a mirror is found, whoever has to find it",
        pace: Quick,
        methods: Method::LIGHT,
        run: |trial| mirror_shaft(trial, [0.8, 0.2]),
    },
    Case {
        row: 7,
        name: "mirror-shaft-stiff",
        teaches: "the same with nine tenths of the light left after ten passes",
        pace: Long,
        methods: &[Igi, Bounded, Method::Reference],
        run: |trial| mirror_shaft(trial, [0.9, 0.99]),
    },
    Case {
        row: 8,
        name: "furnace-corner",
        teaches: "corners are as bright as the rest; without compensation, darker by what the bound says",
        pace: Quick,
        methods: Method::LIGHT,
        run: |trial| vec![in_a_cube(trial, furnaces::furnace_corner(0.7), 0.7)],
    },
    Case {
        row: 8,
        name: "furnace-corner-limited",
        teaches: "the bound takes nothing from the last reflection either, where paths have a limit",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| [1, 2].map(|most| corner_limited(trial, most)).into(),
    },
    Case {
        row: 9,
        name: "cie-cube",
        teaches: "CIE 171:2006, 5.8: the mean indirect light of a cube",
        pace: Quick,
        methods: Method::LIGHT,
        run: |trial| [0.1, 0.5, 0.9].map(|albedo| cie_cube(trial, albedo)).into(),
    },
    Case {
        row: 9,
        name: "cie-cube-stiff",
        teaches: "the same with up to a hundred bounces",
        pace: Long,
        methods: Method::UNBIASED,
        run: |trial| [0.95, 0.99].map(|albedo| cie_cube(trial, albedo)).into(),
    },
    Case {
        row: 9,
        name: "cie-cube-direct",
        teaches: "direct light of a point, to single precision",
        pace: Quick,
        methods: Method::LIGHT,
        run: |trial| {
            let quality = Quality { max_length: Some(0), vpls: 0, ..trial.quality() };
            emitters::cie_cube_direct().iter().map(|case| trial.agrees(case, &quality, case.radiance)).collect()
        },
    },
];

/// Reflections of light that virtual lights of at most `most` vertices bring, after the first:
/// Σ ρ^k over k = 0..=most.
fn series(albedo: f64, most: Option<u8>) -> f64 {
    match most {
        None => 1.0 / (1.0 - albedo),
        Some(most) => (1.0 - albedo.powi(i32::from(most) + 1)) / (1.0 - albedo),
    }
}

fn furnace_cube(trial: &Trial, albedo: f32) -> Finding {
    in_a_cube(trial, furnaces::furnace_cube(albedo), albedo)
}

/// A furnace in a cube of edge 2, seen by any camera.
fn in_a_cube(trial: &Trial, exact: Exact, albedo: f32) -> Finding {
    let quality = trial.quality_for(albedo);
    if trial.method.is_unbiased() {
        return trial.agrees(&exact, &quality, exact.radiance);
    }
    let room = Room::cube(1.0);
    let [emitters, surfaces] = Gate::pair(&quality, extent(&exact, &quality)).map(|gate| room.kept(&exact.scene, gate));
    let albedo = f64::from(albedo);
    let reflected = emitters + surfaces * (series(albedo, quality.max_length) - 1.0);
    trial.agrees(&exact, &quality, 1.0 + albedo * reflected)
}

fn furnace_sphere(trial: &Trial, albedo: f32) -> Finding {
    let exact = furnaces::furnace_sphere(albedo);
    let quality = trial.quality_for(albedo);
    let expected = if trial.method == Paper {
        let gate = Gate::pair(&quality, extent(&exact, &quality))[1];
        1.0 + f64::from(albedo) * gate.kept_in_sphere(1.0) * series(f64::from(albedo), quality.max_length)
    } else {
        exact.radiance
    };
    trial.agrees(&exact, &quality, expected)
}

/// The renderer's unit of bounds.
pub(super) fn extent(exact: &Exact, quality: &Quality) -> f64 {
    let prepared = light::Prepared::new(exact.scene.clone());
    f64::from(light::importance::Importance::new(&prepared, &prepared.scene.camera, quality).extent)
}

/// K counts vertices of light paths; the reflection towards the eye is one more.
fn furnace_limited(trial: &Trial, most: u8) -> Finding {
    let mut exact = furnaces::furnace_sphere(0.9);
    exact.name += &format!(", K = {most}");
    let expected = closed_form::furnace_bounces(1.0, f64::from(0.9_f32), i32::from(most) + 1);
    trial.agrees(&exact, &Quality { max_length: Some(most), ..trial.quality_for(0.9) }, expected)
}

fn corner_limited(trial: &Trial, most: u8) -> Finding {
    let mut exact = furnaces::furnace_corner(0.7);
    exact.name += &format!(", K = {most}");
    let expected = closed_form::furnace_bounces(1.0, f64::from(0.7_f32), i32::from(most) + 1);
    trial.agrees(&exact, &Quality { max_length: Some(most), ..trial.quality_for(0.7) }, expected)
}

fn integrating_sphere(trial: &Trial) -> Finding {
    let exact = furnaces::integrating_sphere(2.0, 100.0, 0.5);
    let quality = trial.quality_for(0.5);
    let gate = Gate::pair(&quality, extent(&exact, &quality))[1];
    let direct = 0.5 / PI * closed_form::integrating_sphere(100.0, 2.0, 0.0);
    let indirect = direct * (series(0.5, quality.max_length) - 1.0) * gate.kept_in_sphere(2.0);
    trial.agrees(&exact, &quality, if trial.method.is_unbiased() { exact.radiance } else { direct + indirect })
}

fn bounded_sphere(trial: &Trial) -> Finding {
    let exact = furnaces::integrating_sphere(2.0, 100.0, 0.5);
    let distance = 8.0;
    let kept = closed_form::bounded_sphere(2.0, 1.0 / (distance * distance));
    let bound = Bound::Geometry { distance: (distance / extent(&exact, &trial.quality_for(0.5))) as f32 };
    let direct = 0.5 / PI * closed_form::integrating_sphere(100.0, 2.0, 0.0);
    let kept = if trial.method.is_unbiased() { 1.0 } else { kept };
    let quality = Quality { bound, ..trial.quality_for(0.5) };
    trial.agrees(&exact, &quality, direct + kept * (exact.radiance - direct))
}

fn concentric_spheres(trial: &Trial) -> Vec<Finding> {
    let quality = trial.quality_for(0.8);
    // Light that has been reflected so often, on either sphere; the bound of neither mode bites but for
    // the paper's between near points of the shell.
    let most = quality.max_length.map_or(200, |most| usize::from(most) + 1);
    let (albedo, back) = ([0.5, 0.8], 0.25);
    let cases = furnaces::concentric_spheres();
    let kept = match Gate::pair(&quality, extent(&cases[0], &quality))[1] {
        gate @ Gate::Clip { .. } => gate.kept_in_sphere(2.0),
        _ => 1.0,
    };
    let mut order = [1.0, 0.0];
    let mut seen = order;
    for _ in 0..most {
        // All chords that are cut off are short, so the inner sphere hides none of them.
        let cut = (1.0 - kept) * albedo[1] * order[1];
        order = [albedo[0] * order[1], albedo[1] * (back * order[0] + (1.0 - back) * order[1])];
        seen = [seen[0] + order[0], seen[1] + order[1] - cut];
    }
    cases.iter().zip(seen).map(|(case, b)| trial.agrees(case, &quality, b / PI)).collect()
}

fn mirror_shaft(trial: &Trial, albedo: [f32; 2]) -> Vec<Finding> {
    let trial = &trial.roughly();
    let quality = trial.quality_for(albedo[1]);
    let room = Room::cube(1.0);
    let [first, second] = albedo.map(f64::from);
    let cases = furnaces::mirror_shaft(albedo);
    let both = cases.iter().enumerate().map(|(which, exact)| {
        if trial.method != Paper {
            return trial.agrees(exact, &quality, exact.radiance);
        }
        // The paper's virtual lights shine directly, its photons bring what emitters send over mirrors; light off
        // a plate over a mirror is nobody's. Light paths have four vertices: ceiling, floor, ceiling, floor.
        let mut facing = [0.0; 6];
        facing[if which == 0 { 3 } else { 2 }] = 1.0;
        let direct = room.irradiance(&exact.scene, facing, Gate::pair(&quality, extent(exact, &quality))[1]);
        let pair = first * second;
        let seen = match which {
            0 => 1.0 + first * direct * (second + second * pair),
            _ => second * (direct * (1.0 + pair + pair * pair) + (1.0 - direct)),
        };
        trial.agrees(exact, &quality, seen / PI)
    });
    both.collect()
}

/// The camera in the middle sees one whole wall. A closed room loses no flux at a reflection, so that the
/// mean over all walls is a series again; the paper's clipping takes a little more near edges.
fn cie_cube(trial: &Trial, albedo: f32) -> Finding {
    let exact = emitters::cie_cube(albedo);
    let quality = trial.quality_for(albedo);
    if trial.method.is_unbiased() {
        return trial.agrees(&exact, &quality, exact.radiance);
    }
    let room = Room::cube(2.0);
    let kept = room.kept(&exact.scene, Gate::pair(&quality, extent(&exact, &quality))[1]);
    let direct = 10_000.0 / 96.0;
    let albedo = f64::from(albedo);
    let indirect = direct * (series(albedo, quality.max_length) - 1.0) * kept;
    let loose = Exact { tolerance: 1e-2, ..exact };
    trial.agrees(&loose, &quality, albedo / PI * (direct + indirect))
}
