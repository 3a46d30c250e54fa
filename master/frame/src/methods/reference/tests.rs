//! The reference's front end against answers that were never drawn.

use glam::DVec3;
use protocol::answer::{Body, Cost, Moments};
use protocol::question::{Ask, Asked, Question, WorldState};
use scenes::Camera;

use super::*;

fn setup() -> ReferenceSetup {
    let camera = Camera { width: 37, height: 21, ..Camera::default() };
    ReferenceSetup { world: WorldState::default(), camera, seed: 5, max_bounces: None }
}

/// Sample n of pixel (x, y) is a function of all three that scatters.
fn sample([x, y]: [u32; 2], n: u32) -> DVec3 {
    let hash = (u64::from(x) << 40 ^ u64::from(y) << 20 ^ u64::from(n)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let unit = (hash ^ hash >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9) as f64 / u64::MAX as f64;
    DVec3::new(unit, 0.5, 3.0 * unit * unit)
}

fn made_up(question: &Question) -> Body {
    let Ask::Reference(samples) = &question.ask else { panic!("this front end asks for samples") };
    let mut moments = Moments::zero(samples.rect.len());
    for (index, pixel) in samples.rect.pixels().enumerate() {
        for number in samples.first..samples.first + samples.count {
            moments.sum[index] += sample(pixel, number);
            moments.squares[index] += sample(pixel, number) * sample(pixel, number);
        }
    }
    Body::Moments(moments)
}

fn answer(front: &mut Reference, asked: &Asked) -> Absorbed {
    answer_with(front, asked, made_up(&asked.question))
}

fn answer_with(front: &mut Reference, asked: &Asked, body: Body) -> Absorbed {
    front.absorb(Answered { ticket: asked.ticket, body, worker: 0, cost: &Cost::default() })
}

/// Answers in an order that `pick` decides, until the front end is finished.
fn draw(front: &mut Reference, mut pick: impl FnMut(usize) -> usize) {
    let mut open = Vec::new();
    while !front.is_finished() {
        open.extend(front.ask(50));
        let question = open.swap_remove(pick(open.len()));
        assert_ne!(answer(front, &question), Absorbed::Unwanted);
        assert_eq!(answer(front, &question), Absorbed::Unwanted);
    }
}

#[test]
fn the_mean_and_its_variance_are_those_of_all_samples() {
    let mut front = Reference::new(setup());
    front.set_limit(3);
    draw(&mut front, |_| 0);
    assert_eq!(front.samples(), 48);
    let (mean, variance) = (front.show(Plane::Raw), front.variance());
    for [x, y] in [[0, 0], [36, 20], [17, 3]] {
        let samples: Vec<_> = (0..48).map(|n| sample([x, y], n)).collect();
        let expected = samples.iter().sum::<DVec3>() / 48.0;
        let spread = samples.iter().map(|s| (*s - expected) * (*s - expected)).sum::<DVec3>() / (47.0 * 48.0);
        assert!((mean.at(x, y).as_dvec3() - expected).abs().max_element() < 1e-6);
        assert!((variance.at(x, y).as_dvec3() - spread).abs().max_element() < 1e-8);
        assert_eq!(variance.at(x, y).y, 0.0, "what never varies is known for certain");
    }
}

#[test]
fn order_and_interruption_change_no_bit() {
    let mut straight = Reference::new(setup());
    straight.set_limit(5);
    draw(&mut straight, |_| 0);

    let mut number = 1_usize;
    let mut scattered = |open: usize| {
        number = number.wrapping_mul(48_271) % 2_147_483_647;
        number % open
    };
    let mut first = Reference::new(setup());
    first.set_limit(2);
    draw(&mut first, &mut scattered);
    assert_eq!(first.samples(), 32);
    let mut second = Reference::resume(setup(), first.state().clone());
    second.set_limit(5);
    draw(&mut second, &mut scattered);
    assert_eq!(second.state(), straight.state());
}

#[test]
fn the_noise_estimate_is_the_mean_variance_and_falls_as_one_over_n() {
    let noise = |samples| {
        let mut front = Reference::new(setup());
        front.set_limit(samples / SAMPLES_PER_FRAME);
        draw(&mut front, |_| 0);
        front.error().expect("many samples")
    };
    let (few, many) = (noise(64), noise(1024));
    assert!((few.rel_mse / many.rel_mse / 16.0 - 1.0).abs() < 0.05, "{few:?} {many:?}");
    assert!(few.low < few.rel_mse && few.rel_mse < few.high);
    // Red: mean ½, variance 1/12; green never varies; blue: 3u² has mean 1 and variance 9/5 − 1.
    let expected = (1.0 / 12.0 / 0.26 + 0.8 / 1.01) / 3.0 / 1024.0;
    assert!((many.rel_mse / expected - 1.0).abs() < 0.05, "{} {expected}", many.rel_mse);
}

#[test]
fn finishing_completes_the_frame_in_hand_and_no_more() {
    let mut front = Reference::new(setup());
    let question = &front.ask(1)[0];
    answer(&mut front, question);
    assert!(front.frame_progress() > 0.0);
    front.finish();
    draw_rest(&mut front);
    assert_eq!(front.frames(), 1);
}

fn draw_rest(front: &mut Reference) {
    while !front.is_finished() {
        for question in front.ask(100) {
            answer(front, &question);
        }
    }
}

#[test]
fn answers_of_another_kind_or_size_end_it() {
    for body in [Body::Moments(Moments::zero(1)), Body::Pixels(Default::default())] {
        let mut front = Reference::new(setup());
        let question = &front.ask(1)[0];
        assert_eq!(answer_with(&mut front, question, body), Absorbed::Unwanted);
        assert!(front.is_finished(), "a reference with gaps would judge wrongly");
    }
}

#[test]
fn a_checkpoint_is_gone_on_with_to_the_bits_of_a_picture_that_was_never_interrupted() {
    let mut whole = Reference::new(setup());
    whole.set_limit(3);
    draw(&mut whole, |_| 0);
    let mut first = Reference::new(setup());
    first.set_limit(1);
    draw(&mut first, |count| count - 1);
    let kept = first.keep().unwrap();
    let mut second = Reference::from_checkpoint(setup(), &kept).ok().unwrap();
    assert_eq!(second.frames(), 1);
    second.set_limit(3);
    draw(&mut second, |count| count / 2);
    assert_eq!(second.state(), whole.state());

    let refused = |setup: ReferenceSetup, bytes: &[u8]| Reference::from_checkpoint(setup, bytes).err();
    let others = [
        ReferenceSetup { seed: 6, ..setup() },
        ReferenceSetup { max_bounces: Some(1), ..setup() },
        ReferenceSetup { camera: Camera { width: 36, ..setup().camera }, ..setup() },
    ];
    for other in others {
        assert_eq!(refused(other, &kept), Some(NoCheckpoint::Another), "{other:?}");
    }
    for at in [0, 30, 70, kept.len() / 2, kept.len() - 1] {
        let mut broken = kept.clone();
        broken[at] ^= 1;
        assert_eq!(refused(setup(), &broken), Some(NoCheckpoint::Broken), "byte {at}");
    }
    for cut in [0, 31, kept.len() - 1] {
        assert_eq!(refused(setup(), &kept[..cut]), Some(NoCheckpoint::Broken), "{cut} bytes");
    }
}
