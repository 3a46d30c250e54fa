//! The seven promises, where light is made.

use std::sync::LazyLock;

use glam::Vec3;
use proptest::prelude::*;
use protocol::answer::{Body, EachLight, Pixels};
use protocol::message::check_question;
use protocol::question::{
    Address, Ask, BLOCK, Bound, GROUPS_MAX, Lit, PAIRS_MAX, POINTS_MAX, Part, Point, Points, Quality, Question, Ray,
    Rays, Unfit,
};
use scenes::{Absent, Camera, Change, Rgb, Surface, SurfacePoint, Transform};

use crate::world::{World, lit, quality, rays_of, room};

static ROOM: LazyLock<World> = LazyLock::new(|| World::new(room()));

/// Every bit of what pixels say.
fn bits(pixels: &Pixels, i: usize) -> Vec<u32> {
    let vectors = [pixels.emitted[i], pixels.reflectance[i], pixels.irradiance[i], pixels.normal[i]];
    vectors.iter().flat_map(|v| v.to_array()).chain([pixels.distance[i]]).map(f32::to_bits).collect()
}

fn rgb_bits(rgb: &Rgb) -> [u32; 3] {
    rgb.to_array().map(f32::to_bits)
}

/// Puts things into an order that a seed decides.
fn shuffle<T>(things: &mut [T], mut seed: u64) {
    for i in (1..things.len()).rev() {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        things.swap(i, (seed >> 33) as usize % (i + 1));
    }
}

#[test]
fn a_ray_with_the_address_of_a_pixel_is_that_pixel() {
    for (set, frame) in [(0, 0), (4, 0), (8, 7), (2, 40)] {
        let lit = lit(set, frame);
        let tile = ROOM.tile(lit);
        let pixels = ROOM.raw(&Ask::Tile(tile.clone())).pixels().expect("tiles have pixels");
        let mut order: Vec<usize> = (0..pixels.len()).collect();
        shuffle(&mut order, u64::from(frame));
        let rays = rays_of(&tile);
        let through: Vec<Ray> = order.iter().map(|i| rays[*i]).collect();
        let seen = ROOM.raw(&ROOM.rays(through, lit)).seen().expect("rays see");
        assert!(pixels.irradiance.iter().any(|e| *e != Vec3::ZERO) && pixels.emitted.iter().any(|e| *e != Vec3::ZERO));
        for (ray, pixel) in order.into_iter().enumerate() {
            assert_eq!(bits(&seen.pixels, ray), bits(&pixels, pixel), "pixel {pixel} of set {set} in frame {frame}");
        }
        // After the wire, up to its rounding: 1/127 of the largest channel, twice.
        let [tile, rays] = [Ask::Tile(tile.clone()), ROOM.rays(rays, lit)].map(|ask| ROOM.packed(&ask));
        let (tile, rays) = (tile.pixels().expect("pixels"), rays.seen().expect("rays").pixels);
        for i in 0..tile.len() {
            let [a, b] = [&tile, &rays].map(|pixels| pixels.irradiance[i]);
            assert!((a - b).abs().max_element() <= a.max_element() * 2.0 / 127.0, "{a} and {b}");
        }
    }
}

#[test]
fn the_first_hit_of_a_ray_asked_about_as_a_point_is_lit_by_the_same_bits() {
    let (mut matt, mut veils, mut others) = (0, 0, 0);
    for (set, frame) in [(0, 0), (5, 3)] {
        let lit = lit(set, frame);
        let through = rays_of(&ROOM.tile(lit));
        for answer in [World::raw, World::packed] {
            let seen = answer(&ROOM, &ROOM.rays(through.clone(), lit)).seen().expect("rays see");
            let hits: Vec<(usize, Point)> = (0..through.len())
                .filter_map(|i| Some((i, Point { at: seen.hits[i]?, address: through[i].address })))
                .collect();
            let points = hits.iter().map(|(_, point)| *point).collect();
            let irradiance = answer(&ROOM, &ROOM.points(points, Part::All, lit)).irradiance().expect("irradiance");
            for ((i, point), irradiance) in hits.iter().zip(&irradiance) {
                assert!(irradiance.is_finite());
                // Where gloss, mirrors and glass are met, a pixel has the light of more than its first hit.
                if !matches!(ROOM.material(point).surface, Surface::Diffuse { .. }) {
                    others += 1;
                } else if ROOM.coverage(point) < 0.5 {
                    // Never to be smoothed: it is among what the pixel emits.
                    veils += 1;
                    assert_eq!(seen.pixels.irradiance[*i], Vec3::ZERO, "ray {i}");
                } else {
                    assert_eq!(rgb_bits(irradiance), rgb_bits(&seen.pixels.irradiance[*i]), "ray {i}");
                    matt += 1;
                }
            }
        }
    }
    assert!(matt > 60 && veils > 3 && others > 60, "{matt} matt, {veils} veils, {others} others");
}

#[test]
fn a_ray_that_gets_to_its_aim_is_what_an_eye_sees_there() {
    let camera = ROOM.prepared.scene.camera;
    let (mut met, mut passed) = (0, 0);
    for set in 0..9 {
        let lit = lit(set, 2);
        let points = ROOM.hits(lit);
        let aimed = points.iter().map(|point| Ray { address: point.address, aim: Some(point.at) }).collect();
        for answer in [World::raw, World::packed] {
            let rays = answer(&ROOM, &ROOM.rays(Vec::clone(&aimed), lit)).seen().expect("rays see");
            let part = Part::Towards(camera.lens().origin());
            let seen = answer(&ROOM, &ROOM.points(points.clone(), part, lit)).seen().expect("points are seen");
            for (i, point) in points.iter().enumerate() {
                // Whether what is there in part lets a ray pass, chance decides for each direction: a last bit may make
                // another of it.
                let is_solid = |at: SurfacePoint| ROOM.coverage(&Point { at, ..*point }) == 1.0;
                if rays.hits[i] != Some(point.at) && !(is_solid(point.at) && rays.hits[i].is_none_or(is_solid)) {
                    passed += 1;
                    continue;
                }
                met += 1;
                assert_eq!(rays.hits[i], Some(point.at), "what a ray has hit can be hit again");
                assert_eq!(bits(&rays.pixels, i), bits(&seen.pixels, i), "point {i}");
            }
        }
        // From behind the wall, the wall is seen.
        let behind = Camera { origin: Vec3::new(0.0, -0.2, -5.0), target: Vec3::ZERO, ..camera };
        let ask = Ask::Rays(Rays { camera: behind, view: Some(camera), through: aimed, lit });
        let hits = ROOM.packed(&ask).seen().expect("rays see").hits;
        let met = hits.iter().zip(&points).filter(|(hit, point)| **hit == Some(point.at)).count();
        assert!(met < points.len() / 4, "{met} of {} points are seen through a wall", points.len());
    }
    assert!(passed > 4 && met > 10 * passed, "{met} met, {passed} did not");
}

/// One answer a ray or point, whatever is asked about.
fn split(body: Body, len: usize) -> Vec<Vec<u32>> {
    match body {
        Body::Seen(seen) => (0..len)
            .map(|i| {
                let SurfacePoint { object, triangle, uv, back, turned } = seen.hits[i].unwrap_or_default();
                let hit = [object, triangle, uv[0].to_bits(), uv[1].to_bits(), back.into(), turned.into()];
                [bits(&seen.pixels, i), hit.into()].concat()
            })
            .collect(),
        Body::Irradiance(all) => {
            all.chunks(all.len() / len).map(|some| some.iter().flat_map(rgb_bits).collect()).collect()
        }
        Body::EachLight(EachLight { lights, unhidden, visible, .. }) => unhidden
            .chunks(lights as usize)
            .zip(visible.chunks(lights as usize))
            .map(|(some, bits)| some.iter().flat_map(rgb_bits).chain(bits.iter().map(|bit| (*bit).into())).collect())
            .collect(),
        other => panic!("{other:?} is no answer about rays or points"),
    }
}

fn groups() -> Vec<u32> {
    (0..ROOM.prepared.groups().len() as u32).collect()
}

fn parts() -> Vec<Part> {
    let each = Part::EachLight { first: 1, count: 20 };
    vec![
        Part::All,
        Part::Direct,
        Part::DirectOf(groups()),
        Part::Indirect,
        each,
        Part::Towards(Vec3::new(0.1, 0.2, 2.0)),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    /// Nor on their order, or how many there are: before and after the wire.
    #[test]
    fn an_answer_does_not_depend_on_its_neighbours(set in 0..9_u16, frame in 0..30_u32, seed: u64, take in 1..300_usize) {
        let lit = lit(set, frame);
        let mut points = ROOM.hits(lit);
        let rays: Vec<Ray> = rays_of(&ROOM.tile(lit))
            .into_iter()
            .enumerate()
            .map(|(i, ray)| Ray { aim: (i % 3 == 0).then(|| points[i % points.len()].at), ..ray })
            .collect();
        // More than a block, and than two.
        let own = points.clone();
        for more in 1..5 {
            let address = |address| Address { number: frame + more, ..address };
            points.extend(own.iter().map(|point| Point { address: address(point.address), ..*point }));
        }
        assert!(points.len() > 2 * BLOCK, "{} points", points.len());
        let ask = |part: &Option<Part>, chosen: &[usize]| match part {
            None => ROOM.rays(chosen.iter().map(|i| rays[i % rays.len()]).collect(), lit),
            Some(part) => ROOM.points(chosen.iter().map(|i| points[*i]).collect(), part.clone(), lit),
        };
        let all: Vec<usize> = (0..points.len()).collect();
        let mut some = all.clone();
        shuffle(&mut some, seed);
        some.truncate(take);
        for part in parts().into_iter().map(Some).chain([None]) {
            for answer in [World::raw, World::packed] {
                let whole = split(answer(&ROOM, &ask(&part, &all)), all.len());
                let chosen = split(answer(&ROOM, &ask(&part, &some)), some.len());
                for (place, number) in some.iter().enumerate() {
                    prop_assert!(chosen[place] == whole[*number], "number {number} of {part:?} differs");
                }
            }
        }
    }
}

/// What counts as the same place as a lamp is a matter of the point, not of one far away that was asked with it.
#[test]
fn a_point_far_away_takes_no_light_from_one_near_a_lamp() {
    let mut build = cases::worlds::build::Build::new("a plain");
    let [ground, lamp] = [0.0, 1.0].map(|radiance| build.paint(0.5, radiance));
    build.quad(Vec3::ZERO, Vec3::Z, Vec3::X, ground);
    build.quad(Vec3::X * 1e6, Vec3::Z, Vec3::X, ground);
    build.quad(Vec3::Y * 0.5, Vec3::X * 0.2, Vec3::Z * 0.2, lamp);
    let world = World::new(build.seen(Vec3::new(0.0, 3.0, 5.0), Vec3::ZERO, 45.0, 8));
    let quality = Quality { importance: false, bound: Bound::None, ..quality() };
    let lit = Lit { set: 0, frame: 0, seed: 1, quality };
    // In the middle of either patch of ground, which are a thousand kilometres apart.
    let [near, far] = [0, 2].map(|triangle| {
        let at = SurfacePoint { triangle, uv: [0.0, 0.5], ..SurfacePoint::default() };
        Point { at, address: Address::default() }
    });
    let ask = |at| world.raw(&Ask::Points(Points { view: None, at, part: Part::Direct, lit })).irradiance().unwrap();
    let alone = ask(vec![near])[0];
    assert!(alone.min_element() > 0.01, "{alone} under a lamp");
    assert_eq!(ask(vec![near, far])[0], alone);
}

/// Up to the rounding of sums.
fn close(a: Rgb, b: Rgb) -> bool {
    (a - b).abs().max_element() <= 1e-5 * a.max_element().max(1e-3)
}

#[test]
fn parts_make_the_whole() {
    let count = groups().len();
    assert_eq!(count, 5, "a light, two lamps of one material, one of another, the sky");
    let mut brought = vec![0; count];
    for set in 0..9 {
        let lit = lit(set, u32::from(set) * 5);
        let points = ROOM.hits(lit);
        let ask = |part| ROOM.raw(&ROOM.points(points.clone(), part, lit)).irradiance().expect("irradiance");
        let (all, direct, indirect) = (ask(Part::All), ask(Part::Direct), ask(Part::Indirect));
        let by_group = ask(Part::DirectOf(groups()));
        for i in 0..points.len() {
            assert!(close(direct[i] + indirect[i], all[i]), "{} + {} is not {}", direct[i], indirect[i], all[i]);
            let groups = &by_group[i * count..][..count];
            let sum: Rgb = groups.iter().sum();
            assert!(close(sum, direct[i]), "{sum} is not {}", direct[i]);
            brought.iter_mut().zip(groups).for_each(|(brought, e)| *brought += usize::from(*e != Vec3::ZERO));
        }
        let some = ask(Part::DirectOf(vec![1, 3]));
        for (i, pair) in some.chunks(2).enumerate() {
            assert_eq!(pair, [by_group[i * count + 1], by_group[i * count + 3]]);
        }
    }
    assert!(brought.iter().all(|points| *points > 10), "{brought:?} points have light of each group");
}

/// Also what the bound cuts off of a lamp is direct.
#[test]
fn in_a_black_room_all_light_is_direct() {
    let mut build = cases::worlds::build::Build::new("black");
    let [wall, lamp] = [0.0, 4.0].map(|radiance| build.paint(0.0, radiance));
    build.room(1.0, [wall; 6]);
    // Outside, where no light gets to: a scene where nothing reflects needs no compensation.
    let grey = build.paint(0.5, 0.0);
    build.quad(Vec3::X * 1.2, Vec3::Y * 0.1, Vec3::Z * 0.1, grey);
    build.quad(Vec3::Y * -0.98, Vec3::Z * 0.3, Vec3::X * 0.3, lamp);
    build.quad(Vec3::Y * -0.985, Vec3::X * 0.3, Vec3::Z * 0.3, lamp);
    let world = World::new(build.seen(Vec3::new(0.0, 0.0, 0.9), Vec3::Y * -0.8, 70.0, 24));
    let points: Vec<Point> = (0..64)
        .map(|i| {
            // About the middle of the floor.
            let at = SurfacePoint { triangle: 4, uv: [i as f32 / 640.0, 0.45], ..SurfacePoint::default() };
            Point { at, address: Address { pixel: [i, 0], number: i } }
        })
        .collect();
    let ask = |part, lit| world.raw(&world.points(points.clone(), part, lit)).irradiance().expect("irradiance");
    let [open, bounded] =
        [Bound::None, quality().bound].map(|bound| Lit { quality: Quality { bound, ..quality() }, ..lit(0, 0) });
    assert!((0..64).all(|i| close(ask(Part::All, bounded)[i], ask(Part::Direct, bounded)[i])));
    assert!(ask(Part::Indirect, bounded).iter().all(|e| *e == Vec3::ZERO));
    assert!(ask(Part::All, bounded) != ask(Part::All, open), "the bound cuts nothing off");
}

/// Without bounds and caustics, virtual lights are all there is.
#[test]
fn each_light_adds_up_to_the_whole() {
    let bound = Bound::None;
    let quality = Quality { bound, bias_compensation: false, photons: 0, indirect_caustics: false, ..quality() };
    let lit = Lit { quality, ..lit(2, 1) };
    let points = ROOM.hits(lit);
    let all = ROOM.raw(&ROOM.points(points.clone(), Part::All, lit)).irradiance().expect("irradiance");
    let ask = |first, count| {
        ROOM.raw(&ROOM.points(points.clone(), Part::EachLight { first, count }, lit)).each_light().expect("lights")
    };
    let each = ask(0, 1000);
    assert!(each.of == each.lights && each.of > 4, "{} lights", each.of);
    let mut hidden = 0;
    for (i, all) in all.iter().enumerate() {
        let pairs = i * each.lights as usize..(i + 1) * each.lights as usize;
        let mut sum = Vec3::ZERO;
        for pair in pairs {
            hidden += u32::from(!each.visible[pair] && each.unhidden[pair] != Vec3::ZERO);
            if each.visible[pair] {
                sum += each.unhidden[pair];
            }
        }
        assert!(close(sum, *all), "point {i}: {sum} is not {all}");
    }
    assert!(hidden > 0, "no light is hidden anywhere");
    let middle = ask(2, 3);
    assert_eq!((middle.of, middle.lights), (each.of, 3));
    for i in 0..points.len() {
        assert_eq!(middle.unhidden[3 * i..][..3], each.unhidden[i * each.lights as usize + 2..][..3]);
    }
    assert_eq!(ask(each.of, 7).lights, 0, "there is no light after the last");
}

#[test]
fn light_at_a_point_does_not_depend_on_who_looks() {
    let lit = lit(0, 0);
    let points: Vec<Point> = ROOM
        .hits(lit)
        .into_iter()
        .filter(|point| matches!(ROOM.material(point).surface, Surface::Diffuse { .. }))
        .collect();
    let ask = |camera: Camera, view: Camera| {
        let through = points.iter().map(|point| Ray { address: point.address, aim: Some(point.at) }).collect();
        ROOM.raw(&Ask::Rays(Rays { camera, view: Some(view), through, lit })).seen().expect("rays see")
    };
    let camera = ROOM.prepared.scene.camera;
    let moved = Camera { origin: Vec3::new(0.4, 0.3, 1.9), ..camera };
    let (here, there) = (ask(camera, camera), ask(moved, camera));
    let both = (0..points.len()).filter(|i| here.hits[*i] == there.hits[*i] && here.hits[*i].is_some());
    let both: Vec<usize> = both.collect();
    assert!(both.len() > points.len() / 2, "{} of {} are seen from both", both.len(), points.len());
    for i in both {
        assert_eq!(here.pixels.irradiance[i], there.pixels.irradiance[i]);
    }
    assert_ne!(here.pixels.irradiance, ask(camera, moved).pixels.irradiance, "light is chosen for a view");
}

#[test]
fn what_the_scene_does_not_have_is_refused() {
    let refusal = |world: &World, ask: Ask| {
        ::light::check(&world.prepared, &Question { world: Default::default(), ask }).expect_err("it is refused")
    };
    let lit = lit(0, 0);
    let sound = ROOM.hits(lit);
    let wrong = SurfacePoint { triangle: 1 << 20, ..sound[0].at };
    let mut at = sound[..40].to_vec();
    at[7].at = wrong;
    let ask = ROOM.points(at, Part::All, lit);
    assert!(matches!(refusal(&ROOM, ask), Unfit::Point { number: 7, absent: Absent::Triangle { .. } }));
    let aim = vec![Ray::default(), Ray { aim: Some(wrong), ..Ray::default() }];
    assert!(matches!(refusal(&ROOM, ROOM.rays(aim, lit)), Unfit::Point { number: 1, .. }));
    let ask = ROOM.points(sound[..3].to_vec(), Part::DirectOf(vec![0, 5]), lit);
    assert_eq!(refusal(&ROOM, ask), Unfit::Group { group: 5, count: 5 });

    // A ball is lifted: its points go with it. It is hidden: they are refused.
    let mut world = World::new(room());
    let mesh = &world.prepared.scene.meshes[0];
    let ball = mesh.triangles.len() - 1;
    let piece = mesh.pieces().of_triangle(ball);
    let point = Point { at: SurfacePoint { triangle: ball as u32, uv: [0.3; 2], ..wrong }, ..sound[0] };
    let ask = world.points(vec![point], Part::All, lit);
    let before = world.raw(&ask).irradiance().unwrap();
    let whole_from_piece = Transform { translation: Vec3::new(0.05, 0.1, 0.1), ..Transform::IDENTITY };
    world.prepared.apply(&Change::PieceTransform { object: 0, piece, whole_from_piece }).unwrap();
    let moved = World::new((*world.prepared.scene).clone());
    assert_ne!(moved.raw(&ask).irradiance().unwrap(), before);
    world.prepared.apply(&Change::PieceVisible { object: 0, piece, visible: false }).unwrap();
    assert!(matches!(refusal(&world, ask), Unfit::Point { number: 0, absent: Absent::Hidden { .. } }));
}

#[test]
fn questions_beyond_their_bounds_are_refused_by_name() {
    let refused = |ask: Ask| check_question(&Question { world: Default::default(), ask }).is_err();
    let lit = lit(0, 0);
    let camera = Camera { width: 64, height: 48, ..Camera::default() };
    let rays = |count, edit: &dyn Fn(&mut Rays)| {
        let mut rays = Rays { camera, view: Some(camera), through: vec![Ray::default(); count], lit };
        edit(&mut rays);
        refused(Ask::Rays(rays))
    };
    assert!(!rays(1, &|_| {}) && !rays(POINTS_MAX, &|_| {}));
    assert!(rays(0, &|_| {}) && rays(POINTS_MAX + 1, &|_| {}));
    assert!(rays(1, &|rays| rays.view = None), "light chosen for a view that is not named");
    assert!(!rays(1, &|rays| (rays.view, rays.lit.quality.importance) = (None, false)));
    assert!(rays(1, &|rays| rays.through[0].address.pixel = [64, 0]));
    assert!(rays(1, &|rays| rays.through[0].aim = Some(SurfacePoint { uv: [f32::NAN, 0.0], ..Default::default() })));
    assert!(rays(1, &|rays| rays.lit.set = 9));
    assert!(rays(1, &|rays| rays.camera.fov_y_deg = 200.0));
    assert!(rays(1, &|rays| rays.view = Some(Camera { width: 0, ..camera })));
    let points = |count, part: Part, edit: &dyn Fn(&mut Points)| {
        let mut points = Points { view: Some(camera), at: vec![Point::default(); count], part, lit };
        edit(&mut points);
        refused(Ask::Points(points))
    };
    assert!(!points(POINTS_MAX, Part::All, &|_| {}) && points(POINTS_MAX + 1, Part::All, &|_| {}));
    assert!(points(0, Part::Direct, &|_| {}));
    assert!(points(1, Part::All, &|points| points.view = None));
    assert!(points(1, Part::All, &|points| points.at[0].at.uv = [0.7, 0.7]));
    assert!(points(1, Part::Towards(Vec3::splat(f32::INFINITY)), &|_| {}));
    assert!(!points(1, Part::DirectOf((0..GROUPS_MAX as u32).collect()), &|_| {}));
    assert!(points(1, Part::DirectOf((0..=GROUPS_MAX as u32).collect()), &|_| {}));
    assert!(points(1, Part::DirectOf(vec![]), &|_| {}) && points(1, Part::DirectOf(vec![2, 1]), &|_| {}));
    let each = |count| Part::EachLight { first: 0, count };
    let most = (PAIRS_MAX / BLOCK) as u32;
    assert!(
        !points(BLOCK, each(most), &|_| {}) && points(BLOCK, each(most + 1), &|_| {}) && points(1, each(0), &|_| {})
    );
    assert!(points(POINTS_MAX, each(u32::MAX), &|_| {}), "products do not overflow");
}
