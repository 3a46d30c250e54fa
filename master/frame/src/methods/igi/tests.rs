//! The front end against answers that were never drawn: a function of the question makes them up.

use std::convert::Infallible;

use glam::Vec3;
use proptest::prelude::*;
use protocol::answer::{Answer, Body, Cost, Fields, Moments, Pixels, over_frames};
use protocol::question::{Ask, Asked, Motion, Quality, Question, WorldState};
use scenes::Camera;

use super::{Igi, Setup};
use crate::Filter;
use crate::front_end::{Absorbed, Answered, FrontEnd, GivenUp, Plane};

fn setup(width: u32, height: u32, quality: Quality) -> Setup {
    Setup {
        world: WorldState { world: [7; 32], revision: 3 },
        camera: Camera { width, height, ..Camera::default() },
        quality,
        fields: Fields { emitted: true, surface: true },
        seed: 1,
        filter: Filter::plane(quality.interleave),
    }
}

/// A noisy wall in front of the eye: every number a function of pixel, set and frame.
fn made_up(question: &Question) -> Pixels {
    // The cross-check's question: as it is answered wrongly, it is given up.
    let Ask::Tile(tile) = &question.ask else { return Pixels::default() };
    let lens = tile.camera.lens();
    let mut pixels = Pixels::default();
    for [x, y] in tile.grid().pixels() {
        let hash = (u64::from(x) * 73_856_093) ^ (u64::from(y) * 19_349_663) ^ (u64::from(tile.lit.frame) * 83_492_791);
        let noise = (hash.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40) as f32 / (1u64 << 24) as f32;
        pixels.emitted.push(Vec3::new(0.0, noise * 0.1, 0.0));
        pixels.reflectance.push(Vec3::new(0.5, 0.25, (x % 2) as f32));
        pixels.irradiance.push(Vec3::splat(1.0 + noise + f32::from(tile.lit.set)));
        pixels.normal.push(Vec3::Z);
        pixels.distance.push(-3.0 / lens.direction(x as f32 + 0.5, y as f32 + 0.5).z);
    }
    pixels
}

fn answer(igi: &mut Igi, asked: &Asked) -> Absorbed {
    answer_by(igi, asked, &made_up)
}

/// Answers a question about one frame or several, by what each has.
fn answer_by(igi: &mut Igi, asked: &Asked, light: &dyn Fn(&Question) -> Pixels) -> Absorbed {
    let body = match &asked.question.ask {
        Ask::Frames(frames) => {
            let one = |tile| Question { world: asked.question.world, ask: Ask::Tile(tile) };
            let answer = |tile| Answer { body: Body::Pixels(light(&one(tile))), cost: Cost::default() };
            let Ok(mean) = over_frames(frames, |tile| Ok::<_, Infallible>(answer(tile)));
            mean.body
        }
        Ask::Reference(samples) => Body::Moments(Moments::zero(samples.rect.len())),
        _ => Body::Pixels(light(&asked.question)),
    };
    igi.absorb(Answered { ticket: asked.ticket, body, worker: 1, cost: &Cost::default() })
}

fn answer_with(igi: &mut Igi, asked: &Asked, pixels: Pixels) -> Absorbed {
    let (ticket, body) = (asked.ticket, Body::Pixels(pixels));
    igi.absorb(Answered { ticket, body, worker: 1, cost: &Cost::default() })
}

fn draw(igi: &mut Igi, frames: u32) {
    igi.set_limit(frames);
    while !igi.is_finished() {
        let questions = igi.ask(10);
        assert!(!questions.is_empty());
        for question in questions {
            assert_ne!(answer(igi, &question), Absorbed::Unwanted);
        }
    }
}

fn is_check(asked: &Asked) -> bool {
    matches!(asked.question.ask, Ask::Reference(_))
}

fn small(interleave: [u8; 2]) -> Quality {
    Quality { interleave, replicates: 2, ..Quality::default() }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]
    #[test]
    fn order_and_repetition_of_answers_change_no_bit(
        order in prop::collection::vec((any::<u16>(), any::<bool>()), 64),
        width in 1u32..40, height in 1u32..40, n in 1u8..4, m in 1u8..4,
    ) {
        let quality = small([n, m]);
        let mut straight = Igi::new(setup(width, height, quality));
        draw(&mut straight, 7);

        let mut shuffled = Igi::new(setup(width, height, quality));
        shuffled.set_limit(7);
        let mut waiting = Vec::new();
        let mut turn = 0;
        loop {
            waiting.extend(shuffled.ask(5));
            if waiting.is_empty() {
                break;
            }
            let (pick, again) = order[turn % order.len()];
            turn += 1;
            let question: Asked = waiting.swap_remove(usize::from(pick) % waiting.len());
            prop_assert_ne!(answer(&mut shuffled, &question), Absorbed::Unwanted);
            if again {
                prop_assert_eq!(answer(&mut shuffled, &question), Absorbed::Unwanted);
            }
        }
        prop_assert!(shuffled.is_finished());
        prop_assert_eq!(straight.show(Plane::Raw), shuffled.show(Plane::Raw));
        prop_assert_eq!(straight.show(Plane::Final), shuffled.show(Plane::Final));
        prop_assert_eq!(straight.show(Plane::Raw).sha256(), shuffled.show(Plane::Raw).sha256());
    }
}

#[test]
fn every_pixel_meets_every_set_in_a_round() {
    for (width, height) in [(1, 1), (1, 7), (5, 2), (50, 31)] {
        let quality = small([3, 2]);
        let mut igi = Igi::new(setup(width, height, quality));
        draw(&mut igi, 6);
        // Irradiance is 1 + set + noise; the mean over the sets 0..6 is 3.5 + noise.
        let raw = igi.show(Plane::Irradiance);
        for pixel in &raw.pixels {
            assert!((3.5..=4.5).contains(&pixel.x), "{width}x{height}: {pixel}");
        }
    }
}

#[test]
fn without_filter_the_picture_is_raw() {
    let mut igi = Igi::new(setup(33, 20, small([3, 3])));
    draw(&mut igi, 4);
    assert_ne!(igi.show(Plane::Final), igi.show(Plane::Raw));
    igi.set_filter(Filter::OFF);
    assert_eq!(igi.show(Plane::Final), igi.show(Plane::Raw));
}

#[test]
fn the_filter_mixes_all_sets_in_the_first_frame_and_keeps_texture() {
    let mut igi = Igi::new(setup(30, 30, small([3, 3])));
    draw(&mut igi, 1);
    let picture = igi.show(Plane::Final);
    for y in 1..29 {
        for x in 1..29 {
            let red = picture.at(x, y).x;
            let irradiance = red / 0.5 * std::f32::consts::PI;
            assert!((5.0..6.0).contains(&irradiance), "{x} {y}: {irradiance}");
            assert_eq!(picture.at(x, y).z == 0.0, x % 2 == 0, "texture stays sharp");
        }
    }
}

#[test]
fn the_filter_fades_where_it_blurs() {
    // A bright line in a dark wall, without any noise: two frames that agree show that it is there.
    let line = |question: &Question| {
        let mut pixels = made_up(question);
        let Ask::Tile(tile) = &question.ask else { return pixels };
        for (index, [x, _]) in tile.grid().pixels().enumerate() {
            pixels.irradiance[index] = Vec3::splat(if x == 15 { 10.0 } else { 1.0 });
            pixels.emitted[index] = Vec3::ZERO;
        }
        pixels
    };
    let mut igi = Igi::new(setup(30, 30, small([3, 3])));
    let [blurred, sharp] = [1, 2].map(|frames| {
        igi.set_limit(frames);
        while !igi.is_finished() {
            for question in igi.ask(usize::MAX) {
                answer_with(&mut igi, &question, line(&question.question));
            }
        }
        igi.show(Plane::Final).at(15, 15).x
    });
    let expected = 10.0 * 0.5 / std::f32::consts::PI;
    assert!(blurred < 0.6 * expected && (sharp - expected).abs() < 1e-4 * expected, "{blurred} {sharp}");
}

#[test]
fn what_is_shown_is_no_worse_than_the_raw_picture() {
    for side in [3, 4, 5] {
        // Mean over so many pictures: all pixels of a set err alike, so a single one proves little.
        let mut errors = vec![[[0.0; 2]; 2]; MOMENTS.len()];
        for seed in 0..8 {
            let picture = errors_of_stripes_and_wall([side, side], seed);
            errors
                .iter_mut()
                .flatten()
                .flatten()
                .zip(picture.into_iter().flatten().flatten())
                .for_each(|(a, b)| *a += b);
        }
        for (frames, [[stripes, wall], raw]) in MOMENTS.into_iter().zip(errors) {
            assert!(stripes <= 1.25 * raw[0], "{side}: stripes after {frames} frames: {stripes}, raw {}", raw[0]);
            assert!(wall <= 0.7 * raw[1], "{side}: wall after {frames} frames: {wall}, raw {}", raw[1]);
        }
    }
}

const MOMENTS: [u32; 6] = [2, 4, 9, 25, 64, 150];

/// Squared errors at some moments of the picture as shown and of the raw one, in its left half, which is striped, and
/// in its right half, which is plain.
fn errors_of_stripes_and_wall(interleave: [u8; 2], seed: u64) -> Vec<[[f64; 2]; 2]> {
    let (width, height) = (60, 45);
    let truth = |x: u32| if x < width / 2 && (x / 5).is_multiple_of(2) { 3.0 } else { 1.0 };
    let lit = |question: &Question| {
        let mut pixels = made_up(question);
        let Ask::Tile(tile) = &question.ask else { return pixels };
        let address = (seed << 40) + u64::from(tile.lit.frame) * 4096 + u64::from(tile.lit.set) + 1;
        let mixed = address.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let noise = ((mixed ^ (mixed >> 32)) & 0xff_ffff) as f32 / (1_u64 << 24) as f32;
        for (index, [x, _]) in tile.grid().pixels().enumerate() {
            pixels.irradiance[index] = Vec3::splat(truth(x) * (0.5 + noise));
            pixels.emitted[index] = Vec3::ZERO;
        }
        pixels.reflectance.fill(Vec3::splat(0.5));
        pixels
    };
    let error = |picture: &crate::Picture| {
        let mut sums = [0.0; 2];
        for (index, pixel) in picture.pixels.iter().enumerate() {
            let x = index as u32 % width;
            let off = pixel.x - truth(x) * 0.5 / std::f32::consts::PI;
            sums[usize::from(x >= width / 2)] += f64::from(off * off);
        }
        sums
    };
    let mut igi = Igi::new(setup(width, height, small(interleave)));
    let moments = MOMENTS.map(|frames| {
        igi.set_limit(frames);
        while !igi.is_finished() {
            for question in igi.ask(usize::MAX) {
                answer_by(&mut igi, &question, &lit);
            }
        }
        [error(&igi.show(Plane::Final)), error(&igi.show(Plane::Raw))]
    });
    moments.to_vec()
}

#[test]
fn old_answers_are_unwanted_after_a_restart() {
    let mut igi = Igi::new(setup(16, 16, small([2, 2])));
    let old = igi.ask(3);
    let mut next = setup(16, 16, small([2, 2]));
    next.world.revision += 1;
    igi.restart(next);
    assert_eq!(answer(&mut igi, &old[0]), Absorbed::Unwanted);
    let new = igi.ask(1);
    assert_eq!(answer(&mut igi, &new[0]), Absorbed::Kept);
}

#[test]
fn answers_of_the_wrong_size_are_given_up() {
    let mut igi = Igi::new(setup(16, 16, small([2, 2])));
    let question = &igi.ask(1)[0];
    assert_eq!(answer_with(&mut igi, question, Pixels::black(1)), Absorbed::Unwanted);
    assert_eq!(igi.gaps(), vec![rect_of(question)]);
    assert_eq!(answer(&mut igi, question), Absorbed::Unwanted);
}

#[test]
fn samples_that_are_not_finite_count_as_black_and_are_reported() {
    let mut igi = Igi::new(setup(4, 4, small([1, 1])));
    let question = &igi.ask(1)[0];
    let mut pixels = made_up(&question.question);
    pixels.irradiance[5].y = f32::NAN;
    pixels.emitted[6].x = f32::INFINITY;
    answer_with(&mut igi, question, pixels);
    assert_eq!(igi.dropped(), 2);
    let picture = igi.show(Plane::Final);
    assert!(picture.pixels.iter().all(|pixel| pixel.is_finite()));
    assert_eq!(igi.show(Plane::Raw).pixels[5], Vec3::ZERO);
}

#[test]
fn finishing_completes_the_frame_in_hand_and_asks_no_more() {
    let mut igi = Igi::new(setup(16, 16, small([2, 2])));
    let questions = igi.ask(5);
    igi.finish();
    assert!(!igi.is_finished());
    let rest = igi.ask(1000);
    for question in questions.iter().chain(&rest) {
        answer(&mut igi, question);
    }
    assert!(igi.is_finished());
    assert_eq!(igi.frames(), 1);
    assert!(igi.ask(1).is_empty());
}

#[test]
fn the_error_estimate_waits_for_a_round_of_each_replicate_and_then_holds() {
    let mut igi = Igi::new(setup(24, 24, small([2, 2])));
    draw(&mut igi, 7);
    assert_eq!(igi.error(), None);
    draw(&mut igi, 8);
    let estimate = igi.error().unwrap();
    assert!(estimate.low <= estimate.rel_mse && estimate.rel_mse <= estimate.high);

    // The made-up noise is uniform: its variance is known, and so is that of its mean.
    let radiance = |noise: f64| {
        let surface = |reflectance: f64| reflectance * (1.0 + 1.5 + noise) / std::f64::consts::PI;
        [surface(0.5), surface(0.25) + 0.1 * noise, surface(1.0)]
    };
    let (low, mid, high) = (radiance(0.0), radiance(0.5), radiance(1.0));
    let term = |c: usize| (high[c] - low[c]).powi(2) / 12.0 / 8.0 / (mid[c] * mid[c] + 0.01);
    let expected = (term(0) + term(1) + term(2) / 2.0) / 3.0;
    assert!((estimate.rel_mse / expected - 1.0).abs() < 0.2, "{} instead of {expected}", estimate.rel_mse);
}

#[test]
fn moving_pictures_have_no_error_estimate_and_keep_their_filter() {
    let mut igi = Igi::new(setup(16, 16, Quality { motion: Motion::Moving, ..small([2, 2]) }));
    draw(&mut igi, 40);
    assert_eq!(igi.error(), None);
    assert_ne!(igi.show(Plane::Final), igi.show(Plane::Raw));
}

fn rect_of(asked: &Asked) -> protocol::question::Rect {
    match &asked.question.ask {
        Ask::Tile(tile) => tile.rect,
        Ask::Reference(samples) => samples.rect,
        _ => panic!("nothing else is asked"),
    }
}

#[test]
fn what_is_given_up_keeps_its_mean_and_the_rest_goes_on() {
    let whole = |frames| {
        let mut igi = Igi::new(setup(60, 40, small([2, 2])));
        draw(&mut igi, frames);
        igi.show(Plane::Raw)
    };
    let (before, after) = (whole(4), whole(9));

    let mut igi = Igi::new(setup(60, 40, small([2, 2])));
    draw(&mut igi, 4);
    igi.set_limit(9);
    let deadly = igi.ask(1).remove(0);
    assert_eq!(igi.give_up(deadly.ticket), GivenUp::Part(rect_of(&deadly)));
    assert_eq!(igi.give_up(deadly.ticket), GivenUp::Unwanted, "only once");
    assert_eq!(answer(&mut igi, &deadly), Absorbed::Unwanted);
    let hole = rect_of(&deadly);
    while !igi.is_finished() {
        for question in igi.ask(10) {
            assert_ne!(rect_of(&question), hole, "it is asked again");
            answer(&mut igi, &question);
        }
    }
    assert_eq!(igi.frames(), 9);
    let picture = igi.show(Plane::Raw);
    for y in 0..40 {
        for x in 0..60 {
            let at = (y * 60 + x) as usize;
            let is_hole = (hole.x..hole.x + hole.width).contains(&x) && (hole.y..hole.y + hole.height).contains(&y);
            if is_hole {
                assert!((picture.pixels[at] - before.pixels[at]).abs().max_element() < 1e-5, "{x},{y}");
            } else {
                assert_eq!(picture.pixels[at], after.pixels[at], "{x},{y}");
            }
        }
    }
}

#[test]
fn a_picture_of_nothing_but_gaps_ends() {
    let mut igi = Igi::new(setup(60, 40, small([2, 2])));
    while !igi.is_finished() {
        for question in igi.ask(10) {
            igi.give_up(question.ticket);
        }
    }
    assert!(igi.frames() <= 3);
    assert!(igi.show(Plane::Raw).pixels.iter().all(|pixel| *pixel == Vec3::ZERO));

    // Whoever goes on from there has nothing to ask either, and knows why.
    let mut resumed = Igi::resume(setup(60, 40, small([2, 2])), &igi.checkpoint()).unwrap();
    resumed.set_limit(9);
    assert!(resumed.is_finished() && resumed.ask(10).is_empty());
    assert_eq!(resumed.gaps(), igi.gaps());
    assert_eq!(resumed.gaps().len(), igi.tiling.len());
}

#[test]
fn who_goes_on_from_a_checkpoint_ends_in_the_same_bits() {
    let setup = setup(60, 40, small([3, 2]));
    let mut straight = Igi::new(setup.clone());
    draw(&mut straight, 11);

    let mut first = Igi::new(setup.clone());
    first.set_limit(5);
    // Interrupted in the middle of frames 3, 4 and 5: more is asked than is answered.
    let asked = first.ask(usize::MAX);
    asked.iter().take(asked.len() - 9).for_each(|question| _ = answer(&mut first, question));
    let frames = first.frames();
    let bytes = first.checkpoint();
    let mut second = Igi::resume(setup.clone(), &bytes).unwrap();
    assert_eq!(second.frames(), frames);
    draw(&mut second, 11);
    for layer in [Plane::Raw, Plane::Final, Plane::Error, Plane::Normal, Plane::Irradiance] {
        assert_eq!(second.show(layer), straight.show(layer), "{layer:?}");
    }
    assert_eq!(second.error(), straight.error());

    let other = Setup { seed: 2, ..setup.clone() };
    assert_eq!(Igi::resume(other, &bytes).err(), Some(super::NoCheckpoint::Another));
    for damaged in [&bytes[..bytes.len() - 1], &bytes[1..], &[]] {
        assert_eq!(Igi::resume(setup.clone(), damaged).err(), Some(super::NoCheckpoint::Broken));
    }
}

/// The same picture, but that its frames are never asked for several at a time.
fn one_by_one(mut igi: Igi, frames: u32) -> Igi {
    for frame in 1..=frames {
        // Nothing fits before a limit that is one frame away.
        draw(&mut igi, frame);
    }
    igi
}

#[test]
fn a_picture_at_rest_is_asked_for_several_frames_at_a_time_and_is_the_same() {
    let setup = setup(50, 31, small([3, 2]));
    let mut igi = Igi::new(setup.clone());
    igi.set_limit(6 * 8 + 6 * 7 + 2);
    let mut asked = Vec::new();
    while !igi.is_finished() {
        for question in igi.ask(usize::MAX) {
            if !is_check(&question) {
                asked.push((question.ticket.batch, question.question.ask.frames()));
            }
            assert_ne!(answer(&mut igi, &question), Absorbed::Unwanted);
        }
    }
    asked.dedup();
    let single = |first: u32, count| (first..first + count).map(|frame| (frame, 1));
    let expected: Vec<_> = single(0, 48).chain((0..7).map(|round| (48 + 6 * round, 6))).chain(single(90, 2)).collect();
    assert_eq!(asked, expected, "one by one at first, and where less than a round is left");

    let mut single = one_by_one(Igi::new(setup), 92);
    assert_eq!((igi.frames(), igi.film.halves()), (92, single.film.halves()));
    for plane in [Plane::Raw, Plane::Final, Plane::Irradiance, Plane::Albedo, Plane::Distance, Plane::Error] {
        for (a, b) in igi.show(plane).pixels.iter().zip(&single.show(plane).pixels) {
            assert!(
                (*a - *b).abs().max_element() <= 1e-5 * b.abs().max_element().max(1.0),
                "{plane:?}: {a} is not {b}"
            );
        }
    }
    assert!(igi.error().is_some_and(|estimate| estimate.rel_mse.is_finite()));
}

#[test]
fn a_limit_within_frames_that_were_asked_for_at_once_has_them_asked_one_by_one() {
    let setup = setup(12, 8, small([3, 2]));
    let mut igi = Igi::new(setup.clone());
    draw(&mut igi, 48);
    igi.set_limit(u32::MAX);
    let before = igi.ask(usize::MAX);
    assert!(before.iter().all(|asked| is_check(asked) || asked.question.ask.frames() == 6));
    igi.set_limit(50);
    for late in &before {
        assert_eq!(answer(&mut igi, late), Absorbed::Unwanted, "nobody wants so much");
    }
    draw(&mut igi, 50);
    let mut straight = Igi::new(setup);
    draw(&mut straight, 50);
    assert_eq!(igi.show(Plane::Raw), straight.show(Plane::Raw));
    assert!(igi.gaps().is_empty());

    // Who is to finish does so with what is in hand.
    let mut igi = straight;
    igi.set_limit(u32::MAX);
    while igi.frames() < 60 {
        let question = igi.ask(1).remove(0);
        answer(&mut igi, &question);
    }
    let question = igi.ask(1).remove(0);
    answer(&mut igi, &question);
    igi.finish();
    while !igi.is_finished() {
        for question in igi.ask(usize::MAX) {
            answer(&mut igi, &question);
        }
    }
    assert_eq!(igi.frames(), 66);
}

#[test]
fn what_is_given_up_of_a_mean_keeps_the_mean_of_the_frames_before() {
    let mut igi = Igi::new(setup(50, 31, small([3, 2])));
    draw(&mut igi, 48);
    let before = igi.show(Plane::Raw);
    igi.set_limit(54);
    let questions = igi.ask(usize::MAX);
    let GivenUp::Part(rect) = igi.give_up(questions[0].ticket) else { panic!("it was asked") };
    for question in &questions {
        answer(&mut igi, question);
    }
    assert_eq!((igi.frames(), igi.is_finished()), (54, true));
    let after = igi.show(Plane::Raw);
    for [x, y] in rect.pixels() {
        let at = (y * after.width + x) as usize;
        assert!((before.pixels[at] - after.pixels[at]).abs().max_element() < 1e-5, "{x}, {y}");
    }
    assert_ne!(before, after);
}
