//! Answers about single rays and points: every number is encoded by itself ([`absolute`]), rounded by the address of
//! its ray or point, so that what comes out does not depend on what else was asked with it.
//!
//! ```text
//! seen       := [ hits , unless an eye was named ] , [ emitted: colours ] ,
//!               [ reflectance , irradiance: colours , normals , distances: 4 planes, f32 ]
//! hits       := kinds: plane , objects , triangles: 4 planes each, u32 , u , v: 4 planes each, f32
//! irradiance := colours
//! each light := lights of the set u32 , lights told of u32 , colours , bits: one a colour, whether it is visible
//! ```
//! Bytes a ray: 17 for its hit, 4 emitted, 15 for what a surface adds.

use scenes::{Rgb, SurfacePoint};

use super::dither::{Dither, mix};
use super::{EACH_LIGHT, IRRADIANCE, PackError, Reader, SATURATED, SEEN, absolute, black, normal, pixels, planes_mut};
use crate::answer::{Body, EachLight, Fields, Pixels, Seen};
use crate::question::{Address, Ask, GROUPS_MAX, Lit, PAIRS_MAX, POINTS_MAX, Part, Points, Ray};

/// Bytes of a hit.
const HIT: usize = 1 + 4 * 4;

/// The most bytes of what rays meet.
pub(super) const fn seen_len_max(rays: usize) -> usize {
    1 + (HIT + 3 * absolute::COLOUR + 3 + 4) * rays
}

/// The bytes of what each of so many virtual lights brings to so many points.
const fn each_light_len(pairs: usize) -> usize {
    1 + 2 * size_of::<u32>() + absolute::COLOUR * pairs + pairs.div_ceil(8)
}

/// The most bytes that an answer about points can have.
pub(super) const PACKED_MAX: usize = {
    let (seen, each) = (seen_len_max(POINTS_MAX), each_light_len(PAIRS_MAX));
    let irradiance = 1 + absolute::COLOUR * POINTS_MAX * GROUPS_MAX;
    let most = if seen > each { seen } else { each };
    if most > irradiance { most } else { irradiance }
};

/// The most bytes of the answer to a question.
pub(super) fn packed_len_max(asked: &Points) -> usize {
    let len = asked.at.len();
    match asked.part {
        Part::Towards(_) => seen_len_max(len),
        Part::EachLight { count, .. } => each_light_len(len.saturating_mul(count as usize).min(PAIRS_MAX)),
        _ => 1 + absolute::COLOUR * len * asked.part.irradiances(),
    }
}

/// Turns irradiances that are not finite, or negative, black, and counts them.
pub(super) fn drop_unsound(irradiance: &mut [Rgb]) -> u64 {
    let unsound = |rgb: &&mut Rgb| !rgb.is_finite() || rgb.min_element() < 0.0;
    irradiance.iter_mut().filter(unsound).map(|rgb| *rgb = Rgb::ZERO).count() as u64
}

// Fields round independently: their products and sums are formed later.
const EMITTED: u64 = 0;
const REFLECTANCE: u64 = 1;
/// All of it, of rays and points alike: so a ray's hit, asked about as a point, has the ray's bits.
const ALL: u64 = 2;
const DIRECT: u64 = 3;
const INDIRECT: u64 = 4;
/// That of group g is this and g.
const GROUP: u64 = 16;

/// The threshold of a field of what has this address.
fn threshold(lit: &Lit, address: Address, field: u64) -> f32 {
    let Address { pixel: [x, y], number } = address;
    let words = [u64::from(lit.frame) << 32 | u64::from(lit.set), u64::from(x) << 32 | u64::from(y), u64::from(number)];
    let key = words.into_iter().fold(mix(lit.seed), |key, word| mix(key ^ word));
    Dither::new(key, field).threshold(0)
}

/// Lays out what rays meet, or points that an eye sees.
pub(super) fn write_seen(seen: &Seen, ask: &Ask, fields: Fields) -> Vec<u8> {
    let lit = match ask {
        Ask::Rays(rays) => &rays.lit,
        Ask::Points(points) => &points.lit,
        Ask::Tile(_) | Ask::Frames(_) | Ask::Reference(_) | Ask::Lights(_) => return vec![SEEN],
    };
    let address = |i: usize| match ask {
        Ask::Rays(rays) => rays.through[i].address,
        Ask::Points(points) => points.at[i].address,
        Ask::Tile(_) | Ask::Frames(_) | Ask::Reference(_) | Ask::Lights(_) => Address::default(),
    };
    let mut out = Vec::with_capacity(seen_len_max(seen.pixels.len()));
    out.push(0);
    if let Ask::Rays(rays) = ask {
        write_hits(&seen.hits, &rays.through, &mut out);
    }
    let Pixels { emitted, reflectance, irradiance, normal, distance } = &seen.pixels;
    let rounding = |field: u64| move |i: usize| threshold(lit, address(i), field);
    let mut saturated = false;
    if fields.emitted {
        saturated |= absolute::write(emitted, rounding(EMITTED), &mut out);
    }
    if fields.surface {
        saturated |= absolute::write(reflectance, rounding(REFLECTANCE), &mut out);
        saturated |= absolute::write(irradiance, rounding(ALL), &mut out);
        normal::write(normal, &mut out);
        write_words(distance.iter().map(|distance| distance.to_bits()), distance.len(), &mut out);
    }
    out[0] = SEEN | pixels::flags(fields) | if saturated { SATURATED } else { 0 };
    out
}

/// Reads what [`write_seen`] wrote about `len` rays; or about points, which have no rays of their own.
pub(super) fn read_seen(
    from: &mut Reader,
    len: usize,
    rays: Option<&[Ray]>,
    fields: Fields,
) -> Result<Seen, PackError> {
    if from.u8()? & !SATURATED != SEEN | pixels::flags(fields) {
        return Err(PackError::OtherFields);
    }
    let hits = match rays {
        Some(rays) => read_hits(from, rays)?,
        None => Vec::new(),
    };
    let emitted = if fields.emitted { absolute::read(from, len)? } else { black(len) };
    if !fields.surface {
        return Ok(Seen { pixels: Pixels { emitted, ..Pixels::black(len) }, hits });
    }
    let (reflectance, irradiance) = (absolute::read(from, len)?, absolute::read(from, len)?);
    let normal = normal::read(from, len)?;
    let distance: Vec<f32> = read_words(from, len)?.map(f32::from_bits).collect();
    if distance.iter().any(|distance| !(*distance >= 0.0 && distance.is_finite())) {
        return Err(PackError::Invalid("a distance that is negative or not finite"));
    }
    Ok(Seen { pixels: Pixels { emitted, reflectance, irradiance, normal, distance }, hits })
}

// Kinds of hits, and flags of the second.
const NOTHING: u8 = 0;
const SOMETHING: u8 = 1;
const THE_AIM: u8 = 2;
const BACK: u8 = 4;
const TURNED: u8 = 8;

fn write_hits(hits: &[Option<SurfacePoint>], rays: &[Ray], out: &mut Vec<u8>) {
    let kind = |(hit, ray): (&Option<SurfacePoint>, &Ray)| match hit {
        None => NOTHING,
        // What differs in the sign of a zero goes as it is.
        Some(hit) if ray.aim.is_some_and(|aim| name(&aim) == name(hit)) => THE_AIM,
        Some(hit) => SOMETHING | if hit.back { BACK } else { 0 } | if hit.turned { TURNED } else { 0 },
    };
    let kinds: Vec<u8> = hits.iter().zip(rays).map(kind).collect();
    out.extend_from_slice(&kinds);
    for word in 0..4 {
        let words = kinds.iter().zip(hits).map(|(kind, hit)| match hit {
            Some(hit) if *kind != THE_AIM => words_of(hit)[word],
            _ => 0,
        });
        write_words(words, hits.len(), out);
    }
}

fn read_hits(from: &mut Reader, rays: &[Ray]) -> Result<Vec<Option<SurfacePoint>>, PackError> {
    let len = rays.len();
    let kinds = from.take(len)?;
    let mut words = [const { Vec::new() }; 4];
    for words in &mut words {
        *words = read_words(from, len)?.collect();
    }
    let hit = |i: usize| {
        let [object, triangle, u, v] = words.each_ref().map(|words: &Vec<u32>| words[i]);
        let is_empty = [object, triangle, u, v] == [0; 4];
        match (kinds[i], rays[i].aim) {
            (NOTHING, _) if is_empty => Ok(None),
            (THE_AIM, Some(aim)) if is_empty => Ok(Some(aim)),
            (kind, _) if kind & !(BACK | TURNED) == SOMETHING => {
                let uv = [u, v].map(f32::from_bits);
                let (back, turned) = (kind & BACK != 0, kind & TURNED != 0);
                let hit = SurfacePoint { object, triangle, uv, back, turned };
                hit.is_inside().then_some(Some(hit)).ok_or(PackError::Invalid("a hit outside of its triangle"))
            }
            _ => Err(PackError::Invalid("an unknown kind of hit")),
        }
    };
    (0..len).map(hit).collect()
}

fn words_of(point: &SurfacePoint) -> [u32; 4] {
    let [u, v] = point.uv.map(f32::to_bits);
    [point.object, point.triangle, u, v]
}

/// All of it, the signs of zeros included.
fn name(point: &SurfacePoint) -> ([u32; 4], bool, bool) {
    (words_of(point), point.back, point.turned)
}

/// As planes of one kind of byte, so that high bytes, which are alike, compress.
fn write_words(words: impl Iterator<Item = u32>, len: usize, out: &mut Vec<u8>) {
    let mut planes = planes_mut::<4>(out, len);
    for (i, word) in words.enumerate() {
        for (plane, byte) in planes.iter_mut().zip(word.to_le_bytes()) {
            plane[i] = byte;
        }
    }
}

fn read_words<'a>(from: &mut Reader<'a>, len: usize) -> Result<impl Iterator<Item = u32> + use<'a>, PackError> {
    let planes = from.planes::<4>(len)?;
    Ok((0..len).map(move |i| u32::from_le_bytes(planes.map(|plane| plane[i]))))
}

/// Lays out irradiances.
pub(super) fn write_irradiance(irradiance: &[Rgb], ask: &Ask) -> Vec<u8> {
    let mut out = vec![IRRADIANCE];
    let Ask::Points(Points { at, part, lit, .. }) = ask else { return out };
    let each = part.irradiances().max(1);
    let field = |number: usize| match part {
        Part::Direct => DIRECT,
        Part::Indirect => INDIRECT,
        Part::DirectOf(groups) => GROUP + u64::from(groups[number]),
        Part::All | Part::EachLight { .. } | Part::Towards(_) => ALL,
    };
    let threshold = |i: usize| threshold(lit, at[i / each].address, field(i % each));
    if absolute::write(irradiance, threshold, &mut out) {
        out[0] |= SATURATED;
    }
    out
}

/// Lays out what each virtual light brings, rounded to the nearest: such numbers are compared, not averaged.
pub(super) fn write_each_light(each: &EachLight) -> Vec<u8> {
    let mut out = vec![EACH_LIGHT];
    out.extend(each.of.to_le_bytes());
    out.extend(each.lights.to_le_bytes());
    if absolute::write(&each.unhidden, |_| 0.5, &mut out) {
        out[0] |= SATURATED;
    }
    let byte = |bits: &[bool]| bits.iter().rev().fold(0, |byte, bit| byte << 1 | u8::from(*bit));
    out.extend(each.visible.chunks(8).map(byte));
    out
}

/// Reads the answer to a question about points.
pub(super) fn read(from: &mut Reader, asked: &Points, fields: Fields) -> Result<Body, PackError> {
    let len = asked.at.len();
    let demand = |from: &mut Reader, tag: u8| match from.u8()? & !SATURATED == tag {
        true => Ok(()),
        false => Err(PackError::OtherFields),
    };
    match asked.part {
        Part::Towards(_) => {
            let hits = asked.at.iter().map(|point| Some(point.at)).collect();
            Ok(Body::Seen(Seen { hits, ..read_seen(from, len, None, fields)? }))
        }
        Part::EachLight { first, count } => {
            demand(from, EACH_LIGHT)?;
            let (of, lights) = (from.u32()?, from.u32()?);
            if lights != of.saturating_sub(first).min(count) {
                return Err(PackError::Invalid("another number of virtual lights than the set has"));
            }
            let pairs = len * lights as usize;
            let unhidden = absolute::read(from, pairs)?;
            let bytes = from.take(pairs.div_ceil(8))?;
            let visible = (0..pairs).map(|i| bytes[i / 8] >> (i % 8) & 1 == 1).collect();
            if !pairs.is_multiple_of(8) && bytes.last().is_some_and(|last| last >> (pairs % 8) != 0) {
                return Err(PackError::Invalid("bits of no virtual light"));
            }
            Ok(Body::EachLight(EachLight { of, lights, unhidden, visible }))
        }
        _ => {
            demand(from, IRRADIANCE)?;
            Ok(Body::Irradiance(absolute::read(from, len * asked.part.irradiances())?))
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;

    use super::*;
    use crate::question::{Quality, Question, Rays, WorldState};

    const FIELDS: Fields = Fields { emitted: true, surface: true };

    fn lit() -> Lit {
        Lit { set: 1, frame: 4, seed: 9, quality: Quality::default() }
    }

    fn question(ask: Ask) -> Question {
        Question { world: WorldState::default(), ask }
    }

    fn points(len: u32, part: Part) -> Question {
        let at = (0..len).map(|i| crate::question::Point { address: address(i), ..Default::default() }).collect();
        question(Ask::Points(Points { view: None, at, part, lit: lit() }))
    }

    fn address(i: u32) -> Address {
        Address { pixel: [i * 7 % 640, i], number: 2 }
    }

    fn there_and_back(question: &Question, body: &Body) -> Body {
        let packed = super::super::pack(question, body, FIELDS);
        assert!(packed.len() <= super::super::packed_len_max(&question.ask));
        for end in 0..packed.len() {
            assert!(super::super::unpack(question, &packed[..end], FIELDS).is_err(), "cut at {end}, it was taken");
        }
        assert!(
            super::super::unpack(question, &[&packed[..], &[0]].concat(), FIELDS).is_err(),
            "a longer one was taken"
        );
        super::super::unpack(question, &packed, FIELDS).expect("it was just packed")
    }

    #[test]
    fn hits_and_distances_are_exact() {
        let hit = |i: u32| SurfacePoint {
            object: i % 3,
            triangle: i << 20 | 77,
            uv: [i as f32 / 64.0, 1.0 / 3.0],
            back: i.is_multiple_of(2),
            turned: i.is_multiple_of(5),
        };
        let through: Vec<Ray> =
            (0..40).map(|i| Ray { address: address(i), aim: (i % 4 > 1).then(|| hit(i)) }).collect();
        // Some reach their aim, some meet the other side of it, something else, or nothing.
        let hits: Vec<Option<SurfacePoint>> = (0..40)
            .map(|i| match i % 8 {
                0 | 2 => None,
                3 => Some(SurfacePoint { back: !hit(i).back, ..hit(i) }),
                5 | 6 => Some(hit(i + 1)),
                _ => Some(hit(i)),
            })
            .collect();
        let mut pixels = Pixels::black(40);
        pixels.distance.iter_mut().enumerate().for_each(|(i, distance)| *distance = 1.0 / (i + 3) as f32);
        let rays = Rays { camera: scenes::Camera::default(), view: None, through, lit: lit() };
        let sent = Body::Seen(Seen { pixels, hits });
        assert_eq!(there_and_back(&question(Ask::Rays(rays)), &sent), sent);
    }

    #[test]
    fn what_each_light_brings_is_rounded_to_the_nearest() {
        let part = Part::EachLight { first: 2, count: 3 };
        let pairs = 5 * 3;
        let colour = |i: usize| Vec3::new(i as f32, 0.3 * i as f32, 0.0);
        let each = EachLight {
            of: 9,
            lights: 3,
            unhidden: (0..pairs).map(colour).collect(),
            visible: (0..pairs).map(|i| i % 4 == 1).collect(),
        };
        let Body::EachLight(back) = there_and_back(&points(5, part.clone()), &Body::EachLight(each.clone())) else {
            panic!("another body");
        };
        assert_eq!((back.of, back.lights, &back.visible), (9, 3, &each.visible));
        for (sent, got) in each.unhidden.iter().zip(&back.unhidden) {
            assert!((*sent - *got).abs().max_element() <= sent.max_element() / 254.0, "{got} is not near {sent}");
        }
        // The set has fewer than were asked for, but not fewer than are told of.
        for (of, lights, fits) in [(4, 2, true), (1, 0, true), (4, 3, false), (9, 2, false), (0, 9, false)] {
            let pairs = 5 * lights as usize;
            let each = EachLight { of, lights, unhidden: vec![Vec3::ONE; pairs], visible: vec![true; pairs] };
            let question = points(5, part.clone());
            let packed = super::super::pack(&question, &Body::EachLight(each), FIELDS);
            assert_eq!(super::super::unpack(&question, &packed, FIELDS).is_ok(), fits, "{lights} of {of}");
        }
    }

    proptest! {
        #[test]
        fn rounding_goes_by_the_address_alone(len in 1..20_usize, part in 0..4_usize, x in 0.01_f32..100.0) {
            let part = [Part::All, Part::Direct, Part::Indirect, Part::DirectOf(vec![3, 8])][part].clone();
            let each = part.irradiances();
            let sent: Vec<Rgb> = (0..len * each).map(|i| Vec3::new(x, x / 3.0, 0.7) * (i + 1) as f32).collect();
            let Ok(all) = read_back(&points(len as u32, part.clone()), &sent) else { panic!("it was just packed") };
            // The last one alone.
            let Question { world, ask: Ask::Points(mut one) } = points(len as u32, part) else { panic!("points") };
            one.at.drain(..len - 1);
            let alone = read_back(&Question { world, ask: Ask::Points(one) }, &sent[(len - 1) * each..]);
            prop_assert_eq!(&alone.expect("it was just packed")[..], &all[(len - 1) * each..]);
        }

        #[test]
        fn any_bytes_are_refused_or_sound(tag: u8, bytes in prop::collection::vec(any::<u8>(), 0..300), part in 0..4_usize) {
            let bytes = [&[[SEEN | 3, IRRADIANCE, EACH_LIGHT, tag][usize::from(tag) % 4]], &bytes[..]].concat();
            let part = [
                Part::All, Part::DirectOf(vec![1, 2]), Part::EachLight { first: 0, count: 2 }, Part::Towards(Vec3::ONE)
            ][part].clone();
            let through = (0..5).map(|i| Ray { address: address(i), aim: (i == 2).then(SurfacePoint::default) }).collect();
            let rays = Rays { camera: scenes::Camera::default(), view: None, through, lit: lit() };
            for question in [points(5, part), question(Ask::Rays(rays))] {
                let Ok(body) = super::super::unpack(&question, &bytes, FIELDS) else { continue };
                let colours = match body {
                    Body::Seen(seen) => {
                        prop_assert!(seen.hits.iter().flatten().all(SurfacePoint::is_inside));
                        prop_assert!(seen.pixels.distance.iter().all(|distance| distance.is_finite()));
                        [seen.pixels.emitted, seen.pixels.reflectance, seen.pixels.irradiance].concat()
                    }
                    Body::Irradiance(irradiance) => irradiance,
                    Body::EachLight(each) => each.unhidden,
                    other => panic!("{other:?}"),
                };
                prop_assert!(colours.iter().all(|colour| colour.is_finite() && colour.min_element() >= 0.0));
            }
        }
    }

    fn read_back(question: &Question, sent: &[Rgb]) -> Result<Vec<Rgb>, PackError> {
        let packed = super::super::pack(question, &Body::Irradiance(sent.to_vec()), FIELDS);
        super::super::unpack(question, &packed, FIELDS).map(|body| body.irradiance().expect("irradiance"))
    }
}
