//! Tests of `pack`.

use glam::Vec3;
use proptest::prelude::*;

use super::dither;
use super::*;
use crate::answer::{LIGHTS_MAX, LightPoint, Means, Moments, Pixels};
use crate::question::{Frames, Lights, Lit, Quality, Rect, Samples, Tile, WorldState};

const ALL: Fields = Fields { emitted: true, surface: true };

fn made_of(len: usize, at: impl Fn(usize) -> [Vec3; 4], distance: impl Fn(usize) -> f32) -> Pixels {
    let mut pixels = Pixels::black(len);
    for i in 0..len {
        [pixels.emitted[i], pixels.reflectance[i], pixels.irradiance[i], pixels.normal[i]] = at(i);
        pixels.distance[i] = distance(i);
    }
    pixels
}

/// A question about `len` pixels; its rounding is a function of `key`.
fn question(len: usize, key: u64) -> Question {
    let quality = Quality { interleave: [1, 1], ..Quality::default() };
    let rect = Rect { x: 0, y: 0, width: len as u32, height: 1 };
    let tile = Tile { camera: scenes::Camera::default(), rect, lit: Lit { set: 0, frame: 0, seed: key, quality } };
    Question { world: WorldState::default(), ask: Ask::Tile(tile) }
}

fn pack(pixels: &Pixels, fields: Fields, key: u64) -> Vec<u8> {
    super::pack(&question(pixels.len(), key), &Body::Pixels(pixels.clone()), fields)
}

fn unpack(bytes: &[u8], len: usize, fields: Fields) -> Result<Pixels, PackError> {
    super::unpack(&question(len, 0), bytes, fields).map(|body| body.pixels().expect("a tile is answered by pixels"))
}

fn drop_unsound(pixels: &mut Pixels) -> u64 {
    pixels::drop_unsound(pixels)
}

fn packed_len_max(len: usize) -> usize {
    super::packed_len_max(&question(len, 0).ask)
}

fn there_and_back(sent: &Pixels, key: u64) -> Pixels {
    let packed = pack(sent, ALL, key);
    assert!(packed.len() <= packed_len_max(sent.len()));
    let squeezed = compress(&packed);
    assert_eq!(decompress(&squeezed, packed.len()).unwrap(), packed);
    unpack(&packed, sent.len(), ALL).unwrap()
}

fn light(i: usize) -> Vec3 {
    let x = dither::mix(i as u64);
    let channel = |shift: u64| (x >> shift & 0xffff) as f32 / 65536.0;
    Vec3::new(channel(0), channel(16), channel(32)) * (1.0 + (x >> 48 & 15) as f32)
}

fn any_light() -> impl Strategy<Value = Vec3> {
    let channel = prop_oneof![4 => 0.0..10.0_f32, 1 => 1e-20..1e9_f32, 1 => Just(0.0)];
    prop::array::uniform3(channel).prop_map(Vec3::from_array)
}

fn any_normal() -> impl Strategy<Value = Vec3> {
    prop::array::uniform3(-1.0..1.0_f32).prop_map(|v| Vec3::from_array(v).normalize_or_zero())
}

fn any_pixels() -> impl Strategy<Value = Pixels> {
    let reflectance = prop::array::uniform3(0.0..1.0_f32).prop_map(Vec3::from_array);
    let distance = prop_oneof![Just(0.0), 1e-3..1e6_f32, 2.0..3.0_f32];
    prop::collection::vec((any_light(), reflectance, any_light(), any_normal(), distance), 0..64).prop_map(|entries| {
        let mut pixels = Pixels::default();
        for (emitted, reflectance, irradiance, normal, distance) in entries {
            pixels.emitted.push(emitted);
            pixels.reflectance.push(reflectance);
            pixels.irradiance.push(irradiance);
            pixels.normal.push(normal);
            pixels.distance.push(distance);
        }
        pixels
    })
}

proptest! {
    #[test]
    fn what_arrives_is_what_was_sent_within_the_promised_errors(sent in any_pixels(), key: u64) {
        let got = there_and_back(&sent, key);
        let tile_max = |field: &[Vec3]| field.iter().map(|rgb| rgb.max_element()).fold(0.0, f32::max);
        for i in 0..sent.len() {
            for (sent, got) in [(&sent.emitted, &got.emitted), (&sent.irradiance, &got.irradiance)] {
                let floor = tile_max(sent) * 2.0_f32.powi(-37);
                let bound = (sent[i].max_element() / 255.0).max(floor);
                prop_assert!((sent[i] - got[i]).abs().max_element() <= bound, "{:?} became {:?}", sent[i], got[i]);
            }
            let root = (sent.reflectance[i] * 2.0 * tile_max(&sent.reflectance)).map(f32::sqrt);
            let bound = root * (2.0 / 255.0) + Vec3::splat(2.0 / 65025.0);
            let error = (sent.reflectance[i] - got.reflectance[i]).abs();
            prop_assert!(error.cmple(bound).all(), "{:?} became {:?}", sent.reflectance[i], got.reflectance[i]);

            if sent.normal[i] == Vec3::ZERO {
                prop_assert_eq!(got.normal[i], Vec3::ZERO);
            } else {
                let sine = f64::from(sent.normal[i].cross(got.normal[i]).length());
                prop_assert!(sine.asin().to_degrees() < 0.06 && sent.normal[i].dot(got.normal[i]) > 0.0);
            }
            prop_assert_eq!(sent.distance[i] == 0.0, got.distance[i] == 0.0);
            prop_assert!((sent.distance[i] - got.distance[i]).abs() <= 4e-4 * sent.distance[i]);
        }
    }

    #[test]
    fn random_bytes_are_refused_or_give_finite_pixels(mut bytes in prop::collection::vec(any::<u8>(), 0..400), len in 0..40_usize) {
        if let Some(flags) = bytes.first_mut() {
            *flags &= 7;
        }
        for fields in [ALL, Fields { emitted: true, surface: false }, Fields { emitted: false, surface: true }] {
            if let Ok(mut pixels) = unpack(&bytes, len, fields) {
                prop_assert_eq!(pixels.len(), len);
                prop_assert_eq!(drop_unsound(&mut pixels), 0);
            }
        }
        if let Ok(raw) = decompress(&bytes, 1000) {
            prop_assert!(raw.len() <= 1000);
        }
    }

    #[test]
    fn damaged_records_are_refused_or_give_finite_pixels(
        sent in any_pixels(), cut in 0.0..1.0_f64, at in 0.0..1.0_f64, flip in 1_u8..,
    ) {
        let packed = pack(&sent, ALL, 1);
        let place = |share: f64| (packed.len() as f64 * share) as usize;
        prop_assert!(unpack(&packed[..place(cut)], sent.len(), ALL).is_err());
        let mut damaged = packed.clone();
        damaged[place(at)] ^= flip;
        if let Ok(mut pixels) = unpack(&damaged, sent.len(), ALL) {
            prop_assert_eq!(drop_unsound(&mut pixels), 0);
        }
        let mut squeezed = compress(&packed);
        let at = (squeezed.len() as f64 * at) as usize;
        squeezed[at] ^= flip;
        let _ = decompress(&squeezed, packed.len());
    }
}

#[test]
fn rounding_is_unbiased() {
    let sent = made_of(500, |i| [light(i), light(i + 1000) / 16.0, light(i + 2000), Vec3::Z], |_| 1.0);
    let frames = 2000;
    let mut sum = vec![[glam::DVec3::ZERO; 4]; sent.len()];
    for frame in 0..frames {
        let got = there_and_back(&sent, dither::mix(frame));
        for (i, sum) in sum.iter_mut().enumerate() {
            let fields =
                [got.emitted[i], got.reflectance[i], got.irradiance[i], got.reflectance[i] * got.irradiance[i]];
            for (sum, field) in sum.iter_mut().zip(fields) {
                *sum += field.as_dvec3();
            }
        }
    }
    for (i, sum) in sum.iter().enumerate() {
        let [e, r, l] = [sent.emitted[i], sent.reflectance[i], sent.irradiance[i]].map(|rgb| rgb.as_dvec3());
        // One rounding is off by less than a step; means of 2000 by less than 5σ = 5 · step / 2 / √2000.
        let root_step = |x: f64| 2.0 * x.sqrt() / 255.0 + 1.0 / 65025.0;
        let steps = [
            glam::DVec3::splat(e.max_element() / 255.5),
            glam::DVec3::new(root_step(r.x), root_step(r.y), root_step(r.z)),
            glam::DVec3::splat(l.max_element() / 255.5),
        ];
        let product_step = steps[1] * l + r * steps[2] + steps[1] * steps[2];
        for ((sum, truth), step) in sum.iter().zip([e, r, l, r * l]).zip([steps[0], steps[1], steps[2], product_step]) {
            let off = (*sum / frames as f64 - truth).abs();
            let bound = step * (2.5 / (frames as f64).sqrt());
            assert!(off.cmple(bound).all(), "pixel {i}: mean of {truth} is off by {off}, allowed {bound}");
        }
    }
}

#[test]
fn few_colours_are_exact_and_cost_next_to_nothing() {
    let walls = [Vec3::new(0.725, 0.71, 0.68), Vec3::new(0.63, 0.065, 0.05), Vec3::new(0.1, 1.0 / 3.0, 1e-12)];
    let sent = made_of(900, |i| [walls[i / 450], walls[i / 300], Vec3::ZERO, Vec3::Y], |_| 2.5);
    let got = there_and_back(&sent, 7);
    assert_eq!(got, sent);
    assert!(compress(&pack(&sent, ALL, 7)).len() < 200);
}

#[test]
fn representable_light_stays_exact_under_every_key() {
    let exact = |i: usize| Vec3::new((i % 512) as f32, (i * 7 % 512) as f32, (i * 13 % 512) as f32) * 0.125;
    let sent = made_of(5000, |i| [exact(i), Vec3::ZERO, exact(i + 3), Vec3::X], |_| 1.0);
    for key in 0..20 {
        assert_eq!(there_and_back(&sent, key), sent);
    }
}

#[test]
fn axes_and_grey_survive() {
    let axes = [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z];
    let grey = |i: usize| Vec3::splat(light(i).x);
    let sent = made_of(600, |i| [grey(i), grey(i + 1) / 16.0, grey(i + 2), axes[i % 6]], |i| 1.0 + i as f32 * 1e-6);
    let got = there_and_back(&sent, 3);
    assert_eq!(got.normal, sent.normal);
    assert_eq!(got.distance, sent.distance);
    for field in [got.emitted, got.reflectance, got.irradiance] {
        assert!(field.iter().all(|rgb| rgb.x == rgb.y && rgb.y == rgb.z));
    }
}

#[test]
fn a_billion_and_a_trillionth_fit_one_tile_and_nothing_overflows() {
    let bright = |i: usize| light(i) * if i.is_multiple_of(2) { 1e9 } else { 1e-3 };
    let sent = made_of(1000, |i| [bright(i), Vec3::ONE, bright(i + 1), Vec3::Z], |_| 1.0);
    let packed = pack(&sent, ALL, 5);
    assert!(!is_saturated(&packed));
    for value in [f32::MAX, f32::INFINITY, LARGEST] {
        let sent = made_of(1000, |i| [light(i), Vec3::ONE, light(i) * value, Vec3::Z], |_| f32::MAX);
        let packed = pack(&sent, ALL, 5);
        assert!(is_saturated(&packed));
        let mut got = unpack(&packed, 1000, ALL).unwrap();
        assert_eq!(drop_unsound(&mut got), 0);
    }
}

#[test]
fn unsound_pixels_are_dropped_and_counted() {
    let mut sent = made_of(100, |i| [light(i), light(i), light(i), Vec3::Z], |_| 1.0);
    sent.irradiance[3].y = f32::NAN;
    sent.emitted[4].x = f32::INFINITY;
    sent.reflectance[5].z = -1.0;
    sent.distance[6] = f32::NEG_INFINITY;
    assert_eq!(drop_unsound(&mut sent), 4);
    assert_eq!(drop_unsound(&mut sent), 0);
    assert_eq!(sent.radiance(3), Vec3::ZERO);
    assert_eq!(there_and_back(&sent, 0).distance[6], 0.0);
}

#[test]
fn fields_a_scene_lacks_stay_home() {
    let sent = made_of(64, |i| [light(i), light(i), light(i), Vec3::Z], |_| 1.0);
    let nothing = Fields { emitted: false, surface: false };
    assert_eq!(pack(&sent, nothing, 0).len(), 1);
    assert_eq!(unpack(&[0], 64, nothing).unwrap(), Pixels::black(64));
    let emitted = pack(&sent, Fields { emitted: true, surface: false }, 0);
    assert_eq!(unpack(&emitted, 64, ALL), Err(PackError::OtherFields));
}

#[test]
fn hostile_lengths_reserve_nothing() {
    let claims = |length: u32, kind: u8| [&length.to_le_bytes()[..], &[kind], &[0; 20]].concat();
    assert!(matches!(decompress(&claims(u32::MAX, LZ4), 1 << 20), Err(PackError::TooLong { .. })));
    assert_eq!(decompress(&claims(1 << 20, LZ4), 1 << 20), Err(PackError::Broken));
    assert_eq!(decompress(&claims(21, 0), 1 << 20), Err(PackError::Broken));
    assert!(matches!(unpack(&[3, 2, 0], u32::MAX as usize, ALL), Err(PackError::Cut { .. })));
}

const LZ4: u8 = 1;

/// A question for reference samples of so many pixels.
fn reference(len: usize) -> Question {
    let rect = Rect { x: 0, y: 0, width: len as u32, height: 1 };
    let camera = scenes::Camera::default();
    let samples = Samples { camera, rect, first: 0, count: 1, seed: 0, max_bounces: None };
    Question { world: WorldState::default(), ask: Ask::Reference(samples) }
}

proptest! {
    #[test]
    fn reference_samples_keep_every_bit(numbers in prop::collection::vec(prop::array::uniform6(0.0..1e300_f64), 0..50)) {
        let sent = Moments {
            sum: numbers.iter().map(|n| glam::dvec3(n[0], n[1], n[2])).collect(),
            squares: numbers.iter().map(|n| glam::dvec3(n[3], n[4], n[5])).collect(),
        };
        let question = reference(sent.len());
        let packed = super::pack(&question, &Body::Moments(sent.clone()), ALL);
        prop_assert_eq!(packed.len(), super::packed_len_max(&question.ask));
        prop_assert_eq!(super::unpack(&question, &packed, ALL), Ok(Body::Moments(sent)));
        for end in 0..packed.len() {
            prop_assert!(super::unpack(&question, &packed[..end], ALL).is_err());
        }
        let too_long = [&packed[..], &[0]].concat();
        prop_assert_eq!(super::unpack(&question, &too_long, ALL), Err(PackError::Trailing(1)));
    }
}

#[test]
fn sums_that_are_unsound_are_refused_and_those_of_our_own_dropped() {
    let question = reference(2);
    for bad in [f64::NAN, f64::INFINITY, -1.0] {
        let mut body = Body::Moments(Moments::zero(2));
        if let Body::Moments(moments) = &mut body {
            moments.squares[1].y = bad;
        }
        let packed = super::pack(&question, &body, ALL);
        assert!(matches!(super::unpack(&question, &packed, ALL), Err(PackError::Invalid(_))));
        assert_eq!(super::drop_unsound(&mut body), 1);
        assert_eq!(body, Body::Moments(Moments::zero(2)));
    }
}

fn lights() -> Question {
    let (camera, quality) = (scenes::Camera::default(), Quality::default());
    let lights = Lights { camera, lit: Lit { set: 0, frame: 0, seed: 0, quality } };
    Question { world: WorldState::default(), ask: Ask::Lights(lights) }
}

#[test]
fn virtual_lights_keep_every_bit_and_unsound_ones_are_refused() {
    let light = |x: f32| LightPoint {
        position: glam::vec3(x, -1e30, 3.0),
        normal: glam::Vec3::X,
        strength: glam::vec3(0.1, x.abs(), 7.0),
        depth: 300,
    };
    let sent = vec![light(0.1), light(-2.0)];
    let packed = super::pack(&lights(), &Body::Lights(sent.clone()), ALL);
    assert_eq!(super::unpack(&lights(), &packed, ALL), Ok(Body::Lights(sent.clone())));
    for end in 0..packed.len() {
        assert!(super::unpack(&lights(), &packed[..end], ALL).is_err());
    }
    let claims = [&[16][..], &u32::MAX.to_le_bytes()].concat();
    assert!(matches!(super::unpack(&lights(), &claims, ALL), Err(PackError::Invalid(_))));
    let many = super::pack(&lights(), &Body::Lights(vec![light(1.0); LIGHTS_MAX + 1]), ALL);
    assert_eq!(many.len(), super::packed_len_max(&lights().ask), "the rest is cut off");
    let bad = super::pack(&lights(), &Body::Lights(vec![light(f32::NAN)]), ALL);
    assert!(matches!(super::unpack(&lights(), &bad, ALL), Err(PackError::Invalid(_))));
    let mut body = Body::Lights(vec![light(0.1), light(f32::NAN), light(-2.0)]);
    assert_eq!((super::drop_unsound(&mut body), body), (1, Body::Lights(sent)));
}

#[test]
fn an_answer_of_the_other_kind_is_refused() {
    let none = super::pack(&lights(), &Body::Lights(vec![]), ALL);
    assert_eq!(unpack(&none, 3, ALL), Err(PackError::OtherFields));
    assert_eq!(super::unpack(&lights(), &pack(&Pixels::black(3), ALL, 0), ALL), Err(PackError::OtherFields));
    let pixels = pack(&Pixels::black(3), ALL, 0);
    assert_eq!(super::unpack(&reference(3), &pixels, ALL), Err(PackError::OtherFields));
    let sums = super::pack(&reference(3), &Body::Moments(Moments::zero(3)), ALL);
    assert_eq!(unpack(&sums, 3, ALL), Err(PackError::OtherFields));
}

/// The same about several frames.
fn frames(len: usize, key: u64) -> Question {
    let Question { world, ask } = question(len, key);
    let Ask::Tile(tile) = ask else { panic!("it is about a tile") };
    Question { world, ask: Ask::Frames(Frames { tile, count: 9 }) }
}

fn means_there_and_back(sent: &Means, key: u64, fields: Fields) -> Means {
    let question = frames(sent.len(), key);
    let packed = super::pack(&question, &Body::Means(sent.clone()), fields);
    assert!(packed.len() <= super::packed_len_max(&question.ask));
    super::unpack(&question, &packed, fields).unwrap().means().expect("frames are answered by means")
}

proptest! {
    #[test]
    fn means_arrive_within_the_promised_errors(
        sent in prop::collection::vec((any_light(), any_light()), 1..64), key: u64,
    ) {
        let (emitted, reflected): (Vec<_>, Vec<_>) = sent.into_iter().unzip();
        let sent = Means { emitted, reflected };
        let got = means_there_and_back(&sent, key, ALL);
        for (sent, got) in [(&sent.emitted, &got.emitted), (&sent.reflected, &got.reflected)] {
            let floor = sent.iter().map(|rgb| rgb.max_element()).fold(0.0, f32::max) * 2.0_f32.powi(-43);
            for (sent, got) in sent.iter().zip(got) {
                let bound = (sent.max_element() / 16383.0).max(floor);
                prop_assert!((*sent - *got).abs().max_element() <= bound, "{sent:?} became {got:?}");
            }
        }
        let without = means_there_and_back(&sent, key, Fields { emitted: false, surface: true });
        prop_assert_eq!((without.emitted.len(), &without.reflected), (0, &got.reflected));
    }

    #[test]
    fn random_bytes_are_refused_or_give_finite_means(mut bytes in prop::collection::vec(any::<u8>(), 0..400), len in 0..40_usize) {
        if let Some(flags) = bytes.first_mut() {
            *flags &= 7;
        }
        for fields in [ALL, Fields { emitted: true, surface: false }, Fields { emitted: false, surface: true }] {
            if let Ok(mut body) = super::unpack(&frames(len, 0), &bytes, fields) {
                prop_assert_eq!((body.len(), super::drop_unsound(&mut body)), (len, 0));
            }
        }
    }

    #[test]
    fn damaged_means_are_refused_or_finite(
        sent in prop::collection::vec(any_light(), 1..64), at: prop::sample::Index, flip in 1_u8..,
    ) {
        let sent = Means { emitted: sent.clone(), reflected: sent };
        let question = frames(sent.len(), 0);
        let mut bytes = super::pack(&question, &Body::Means(sent), ALL);
        let at = at.index(bytes.len());
        bytes[at] ^= flip;
        if let Ok(mut body) = super::unpack(&question, &bytes, ALL) {
            prop_assert_eq!(super::drop_unsound(&mut body), 0);
        }
    }
}

#[test]
fn rounding_of_means_is_unbiased() {
    // Enough colours that no palette can hold them.
    let sent: Vec<Vec3> = (0..64).map(light).collect();
    let (mut sum, turns) = (vec![glam::DVec3::ZERO; sent.len()], 4000);
    for key in 0..turns {
        let means = Means { emitted: Vec::new(), reflected: sent.clone() };
        let got = means_there_and_back(&means, key, Fields { emitted: false, surface: true });
        sum.iter_mut().zip(got.reflected).for_each(|(sum, got)| *sum += got.as_dvec3());
    }
    for (sum, sent) in sum.iter().zip(&sent) {
        let error = (*sum / turns as f64 - sent.as_dvec3()).abs().max_element();
        // A step is 1/16384 of the largest channel; the mean of so many is off by some hundredths of it.
        assert!(error < f64::from(sent.max_element()) / 16384.0 * 0.05, "{sent} becomes {error} more or less");
    }
}

#[test]
fn an_answer_about_one_frame_is_none_about_several() {
    let pixels = pack(&Pixels::black(3), ALL, 0);
    assert!(super::unpack(&frames(3, 0), &pixels, ALL).is_err());
    let means = super::pack(&frames(3, 0), &Body::Means(Means::black(3)), ALL);
    assert!(unpack(&means, 3, ALL).is_err());
    let odd = Means { emitted: vec![Vec3::splat(f32::NAN), Vec3::ONE], reflected: vec![Vec3::ONE, -Vec3::ONE] };
    let mut body = Body::Means(odd);
    assert_eq!(super::drop_unsound(&mut body), 2);
    assert_eq!(body, Body::Means(Means::black(2)));
}
