//! The cache: a fixed number of shaded points of the scene, each with its place, its light and its age.
//!
//! A new point takes the slot of the oldest in the next group of [`GROUP`], round robin: exactly the oldest of all would
//! cost a search, and whatever is stale goes in the end (Walter et al. 1999, section 4.3). Ages are bytes with eight bits
//! behind the point; 255 is the end (Walter et al. 2002).
//!
//! What all points are asked for in every picture lies together, by kind; the rest is touched only where it is needed. A
//! picture takes points in the order of its pixels, and waits for memory the less the more slots are in that order, too. So
//! a new point first looks for one that no pixel shows near the points that it is seen beside.

use std::collections::BTreeSet;

use glam::Vec3;
use rayon::prelude::*;
use scenes::SurfacePoint;

use super::places::{GROUP, NOWHERE, Places};
use super::point::{Hint, Known, Light, Origin, Place, Sampled, Traced};

/// Steps of an age's unit.
pub(super) const AGE_UNIT: u32 = 256;
/// The greatest age.
pub(super) const AGE_MAX: u16 = u16::MAX;
/// From this age on a point is evicted.
const AGE_EVICTED: u16 = 255 << 8;
/// Points that no pixel shows age so many times as fast: they are likely to be of no use any more.
const UNSEEN: u32 = 3;
/// Points of objects that are being moved age so many times as fast.
const MOVING: u8 = 2;
/// Groups to either side in which a new point looks for one that is not seen.
const NEAR_GROUPS: usize = 4;
/// Groups that a thread takes at a time, at least.
const GROUPS_AT_A_TIME: usize = 64;
/// No pixel can have shown the point yet.
const NEW: u32 = u32::MAX - 1;

/// A slot's number, and which of the points that have been there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Id {
    pub slot: u32,
    serial: u32,
}

/// See the module's documentation.
#[derive(Clone, Debug, Default)]
pub(super) struct Points {
    places: Vec<Places>,
    /// Slots that are not empty.
    occupied: usize,
    ages: Vec<u16>,
    /// The pixel that shows the point.
    pixels: Vec<u32>,
    /// Of the points' hints.
    speeds: Vec<u8>,
    sampled: Vec<Sampled>,
    /// Of [`Sampled::light`], for those who look at nothing else.
    radiances: Vec<Vec3>,
    traced: Vec<Traced>,
    next_serial: u32,
    next_group: usize,
    /// Ageing that was less than a step so far, in `1 / len` steps.
    carry: u64,
}

impl Points {
    /// Nothing in `capacity` slots, rounded up to whole groups.
    pub fn new(capacity: usize) -> Self {
        let len = slots(capacity);
        Self {
            places: vec![Places::NOTHING; len / GROUP],
            ages: vec![0; len],
            pixels: vec![NEW; len],
            speeds: vec![1; len],
            sampled: vec![Sampled::default(); len],
            radiances: vec![Vec3::ZERO; len],
            traced: vec![Traced::default(); len],
            ..Self::default()
        }
    }

    /// Bytes of a slot.
    pub const BYTES: usize = size_of::<Places>() / GROUP
        + size_of::<Sampled>()
        + size_of::<Vec3>()
        + size_of::<Traced>()
        + size_of::<u32>()
        + size_of::<u16>()
        + size_of::<u8>();

    /// The same points in another number of slots, in the same order; the oldest are lost where there is no room.
    pub fn resized(&self, capacity: usize) -> Self {
        let mut resized = Self { next_serial: self.next_serial, ..Self::new(capacity) };
        let mut kept: Vec<u32> = (0..self.len() as u32).filter(|slot| self.place(*slot).is_some()).collect();
        kept.sort_by_key(|slot| self.age(*slot));
        kept.truncate(resized.len());
        kept.sort_unstable();
        let count = kept.len();
        for (number, from) in kept.into_iter().enumerate() {
            let to = resized.spread(number, count);
            resized.set_place(to, self.place(from));
            let (to, from) = (to as usize, from as usize);
            resized.ages[to] = self.ages[from];
            resized.speeds[to] = self.speeds[from];
            resized.sampled[to] = self.sampled[from];
            resized.radiances[to] = self.radiances[from];
            resized.traced[to] = self.traced[from];
        }
        resized
    }

    /// Whether so many slots are what `capacity` asks for.
    pub fn fits(&self, capacity: usize) -> bool {
        self.len() == slots(capacity)
    }

    /// Number of slots.
    pub fn len(&self) -> usize {
        self.ages.len()
    }

    /// There is no point.
    pub fn is_empty(&self) -> bool {
        self.occupied == 0
    }

    /// Where the point lies; `None`: the slot is empty.
    pub fn place(&self, slot: u32) -> Option<Place> {
        self.places[slot as usize / GROUP].get(slot as usize % GROUP)
    }

    fn set_place(&mut self, slot: u32, place: Option<Place>) {
        let (group, at) = (&mut self.places[slot as usize / GROUP], slot as usize % GROUP);
        self.occupied -= usize::from(group.get(at).is_some());
        self.occupied += usize::from(place.is_some());
        group.set(at, place);
    }

    /// Where all points lie, group by group.
    pub fn places(&self) -> &[Places] {
        &self.places
    }

    /// For those who find out which pixels show what: where all points lie, group by group, and the pixel of each.
    pub fn projected(&mut self) -> (&[Places], &mut [u32]) {
        (&self.places, &mut self.pixels)
    }

    pub fn age(&self, slot: u32) -> u16 {
        self.ages[slot as usize]
    }

    pub fn sampled(&self, slot: u32) -> &Sampled {
        &self.sampled[slot as usize]
    }

    pub fn light(&self, slot: u32) -> &Light {
        &self.sampled[slot as usize].light
    }

    /// The point's radiance.
    pub fn radiance(&self, slot: u32) -> Vec3 {
        self.radiances[slot as usize]
    }

    pub fn name(&self, slot: u32) -> Option<SurfacePoint> {
        self.traced[slot as usize].name
    }

    pub fn last(&self, slot: u32) -> Option<(Vec3, Origin)> {
        self.traced[slot as usize].last
    }

    /// The point got to know what it is a point of.
    pub fn set_name(&mut self, slot: u32, name: SurfacePoint) {
        self.traced[slot as usize].name = Some(name);
    }

    /// The point was asked again and is as it was, in another state of the world.
    pub fn confirm(&mut self, slot: u32, last: (Vec3, Origin)) {
        let sampled = &mut self.sampled[slot as usize];
        sampled.revision = sampled.revision.max(last.1.revision);
        self.traced[slot as usize].last = Some(last);
        self.renew(slot);
    }

    /// The point that is in a slot now.
    pub fn id(&self, slot: u32) -> Id {
        Id { slot, serial: self.traced[slot as usize].serial }
    }

    /// The point is still there.
    pub fn has(&self, id: Id) -> bool {
        (id.slot as usize) < self.len()
            && self.traced[id.slot as usize].serial == id.serial
            && self.place(id.slot).is_some()
    }

    /// The slot of point `number` of `count` that are in the order of a picture, when all slots are theirs: so that empty
    /// slots are left in all groups alike.
    pub fn spread(&self, number: usize, count: usize) -> u32 {
        (number * self.len() / count.max(1)) as u32
    }

    /// A new point: over one that no pixel shows, near this slot, or else over an old one.
    pub fn insert_near(&mut self, slot: u32, place: Place, known: Known) -> u32 {
        let (home, groups) = (slot as usize / GROUP, self.places.len());
        let there = (0..=NEAR_GROUPS).flat_map(|far| [home.checked_sub(far), Some(home + far)]);
        for group in there.flatten().filter(|group| *group < groups) {
            let unseen = (group * GROUP..(group + 1) * GROUP).filter(|slot| self.pixels[*slot] == NOWHERE);
            if let Some(slot) = unseen.max_by_key(|slot| self.ages[*slot]) {
                self.put(slot as u32, place, known);
                return slot as u32;
            }
        }
        self.insert(place, known)
    }

    /// A new point, over an old one.
    pub fn insert(&mut self, place: Place, known: Known) -> u32 {
        let group = self.next_group;
        self.next_group = (self.next_group + 1) % self.places.len();
        let slots = group * GROUP..(group + 1) * GROUP;
        let worth =
            |slot: &usize| (self.places[group].get(slot % GROUP).is_some(), std::cmp::Reverse(self.ages[*slot]));
        let slot = slots.min_by_key(worth).unwrap_or(0) as u32;
        self.put(slot, place, known);
        slot
    }

    /// Another point in this slot.
    pub fn put(&mut self, slot: u32, place: Place, known: Known) {
        self.set_place(slot, Some(place));
        self.next_serial = self.next_serial.wrapping_add(1);
        self.pixels[slot as usize] = NEW;
        self.traced[slot as usize].serial = self.next_serial;
        self.resample(slot, known);
    }

    /// The same point, of which more is known.
    pub fn resample(&mut self, slot: u32, known: Known) {
        let at = slot as usize;
        let Known { name, sampled, last } = known;
        self.traced[at] = Traced { name, last, ..self.traced[at] };
        self.sampled[at] = sampled;
        (self.radiances[at], self.speeds[at]) = (sampled.light.radiance(), sampled.hint.speed());
        self.renew(slot);
    }

    /// The point is up to date.
    pub fn renew(&mut self, slot: u32) {
        self.ages[slot as usize] = 0;
    }

    #[cfg(test)]
    pub fn set_count(&mut self, slot: u32, count: u8) {
        self.sampled[slot as usize].count = count;
    }

    /// All points that there are.
    #[cfg(test)]
    pub fn all(&self) -> Vec<(u32, Place)> {
        (0..self.len() as u32).filter_map(|slot| Some((slot, self.place(slot)?))).collect()
    }

    /// No pixel shows the point.
    pub fn hide(&mut self, slot: u32) {
        self.pixels[slot as usize] = NOWHERE;
    }

    /// The pixel that shows the point.
    pub fn pixel(&self, slot: u32) -> Option<usize> {
        let pixel = self.pixels[slot as usize];
        (pixel < NEW).then_some(pixel as usize)
    }

    /// Whether a pixel shows the point.
    #[cfg(test)]
    pub fn is_seen(&self, slot: u32) -> bool {
        self.pixel(slot).is_some()
    }

    #[cfg(test)]
    pub fn see(&mut self, slot: u32, pixel: u32) {
        self.pixels[slot as usize] = pixel;
    }

    /// So many steps older, before its time (section 4.1).
    pub fn age_early(&mut self, slot: u32, steps: u16) {
        let age = &mut self.ages[slot as usize];
        *age = age.saturating_add(steps);
    }

    /// A frame later: all points are a unit older (1999).
    pub fn age_by_frame(&mut self, moving: &BTreeSet<u32>) {
        self.age_all(AGE_UNIT, moving);
    }

    /// So many samples later: a point that nobody asks about is 128 units old when as many have come as there are slots,
    /// about when it is overwritten (2002).
    pub fn age_by_samples(&mut self, samples: usize, moving: &BTreeSet<u32>) {
        let len = self.len() as u64;
        let due = self.carry + 128 * u64::from(AGE_UNIT) * samples as u64;
        self.carry = due % len;
        self.age_all((due / len).min(u64::from(u16::MAX)) as u32, moving);
    }

    /// Points that are 255 units old go (2002).
    pub fn evict(&mut self) {
        if self.ages.iter().all(|age| *age < AGE_EVICTED) {
            return;
        }
        for slot in 0..self.len() as u32 {
            if self.age(slot) >= AGE_EVICTED {
                self.set_place(slot, None);
            }
        }
    }

    /// Empty slots, too: nobody asks for their age.
    fn age_all(&mut self, steps: u32, moving: &BTreeSet<u32>) {
        // Nothing that is multiplied here comes near the limit of its type.
        let steps = steps.min(u32::from(AGE_MAX));
        let older = |age: u16, pixel: u32, speed: u8| {
            let unseen = if pixel == NOWHERE { UNSEEN } else { 1 };
            let by = steps.wrapping_mul(unseen).wrapping_mul(u32::from(speed));
            u32::from(age).wrapping_add(by).min(u32::from(AGE_MAX)) as u16
        };
        let each = self.ages.iter_mut().zip(&self.pixels).zip(&self.speeds);
        if moving.is_empty() {
            return each.for_each(|((age, pixel), speed)| *age = older(*age, *pixel, *speed));
        }
        for (((age, pixel), speed), traced) in each.zip(&self.traced) {
            let is_moving = traced.name.is_some_and(|name| moving.contains(&name.object));
            *age = older(*age, *pixel, (*speed).max(if is_moving { MOVING } else { 1 }));
        }
    }

    /// Light has changed, nobody knows where: means that cannot be asked again by the same numbers count as few samples, so
    /// that new ones soon prevail.
    pub fn doubt(&mut self, samples: u8, is_doubted: impl Fn(&Light) -> bool) {
        for (sampled, traced) in self.sampled.iter_mut().zip(&self.traced) {
            if traced.last.is_none() && is_doubted(&sampled.light) {
                sampled.count = sampled.count.min(samples);
            }
        }
    }

    /// The light of matt points in the scene is another: `change` is told of each point's place and of its last sample. A
    /// point that has none left counts as nothing.
    pub fn relight(&mut self, change: impl Fn(Vec3, Option<&Origin>, &mut Sampled) + Sync) {
        let points = self.sampled.par_chunks_mut(GROUP).zip(self.radiances.par_chunks_mut(GROUP));
        let points = points.zip(self.traced.par_chunks(GROUP)).zip(&self.places).with_min_len(GROUPS_AT_A_TIME);
        points.for_each(|(((sampled, radiances), traced), places)| {
            let points = sampled.iter_mut().zip(radiances).zip(traced).enumerate();
            for (at, ((sampled, radiance), traced)) in points {
                if let Some(Place::Near(place)) = places.get(at).filter(|_| sampled.light.is_matt()) {
                    change(place, traced.last.as_ref().map(|(_, origin)| origin), sampled);
                    *radiance = sampled.light.radiance();
                }
            }
        });
    }

    /// Points get other hints, and are so much older.
    pub fn reconsider(&mut self, hint: impl Fn(&SurfacePoint) -> Option<Hint>, steps: u16) {
        for slot in 0..self.len() {
            if let Some(hint) = self.traced[slot].name.as_ref().and_then(&hint) {
                (self.sampled[slot].hint, self.speeds[slot]) = (hint, hint.speed());
                self.age_early(slot as u32, steps);
            }
        }
    }

    /// Removes points without a name that lie where `is_there` says.
    pub fn remove_nameless(&mut self, is_there: impl Fn(Vec3) -> bool) {
        for slot in 0..self.len() as u32 {
            if self.name(slot).is_none()
                && let Some(Place::Near(place)) = self.place(slot)
                && is_there(place)
            {
                self.set_place(slot, None);
            }
        }
    }

    /// Finds the points anew that `place` knows a place for; those that it has none for are gone.
    pub fn carry(&mut self, concerns: impl Fn(&SurfacePoint) -> bool, place: impl Fn(&SurfacePoint) -> Option<Vec3>) {
        for slot in 0..self.len() as u32 {
            if let Some(name) = self.name(slot).filter(&concerns)
                && self.place(slot).is_some()
            {
                self.set_place(slot, place(&name).map(Place::Near));
            }
        }
    }
}

/// Whole groups.
fn slots(capacity: usize) -> usize {
    capacity.next_multiple_of(GROUP).max(GROUP)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known(brightness: f32) -> Known {
        let light = Light { emitted: Vec3::splat(brightness), ..Light::default() };
        Known { sampled: Sampled { light, count: 1, ..Sampled::default() }, ..Known::default() }
    }

    fn full(slots: usize) -> Points {
        let mut points = Points::new(slots);
        for i in 0..slots {
            points.insert(Place::Near(Vec3::X * i as f32), known(i as f32));
        }
        points
    }

    #[test]
    fn a_new_point_takes_an_empty_slot_or_the_oldest_of_the_next_eight() {
        let mut points = full(16);
        assert!(points.all().len() == 16, "groups take turns, and empty slots go first");
        points.age_early(5, 7);
        points.age_early(6, 9);
        points.age_early(12, 3);
        assert_eq!(points.insert(Place::Near(Vec3::ZERO), known(1.0)), 6);
        assert_eq!(points.insert(Place::Near(Vec3::ZERO), known(1.0)), 12);
        assert_eq!(points.insert(Place::Near(Vec3::ZERO), known(1.0)), 5);
        points.set_place(8, None);
        assert_eq!(points.insert(Place::Near(Vec3::ZERO), known(1.0)), 8);
    }

    #[test]
    fn a_new_point_takes_the_place_of_one_that_is_not_seen_near_by_if_there_is_any() {
        let mut points = full(8 * GROUP * (NEAR_GROUPS + 1));
        (0..points.len() as u32).for_each(|slot| points.see(slot, slot));
        let unseen = (NEAR_GROUPS * GROUP) as u32;
        points.hide(unseen);
        points.hide(unseen + 1);
        points.age_early(unseen + 1, 1);
        assert_eq!(points.insert_near(3, Place::Near(Vec3::ZERO), known(1.0)), unseen + 1, "the older of two");
        assert_eq!(points.insert_near(3, Place::Near(Vec3::ZERO), known(1.0)), unseen);
        points.age_early(5, 7);
        assert_eq!(points.insert_near(3, Place::Near(Vec3::ZERO), known(1.0)), 5, "none: the oldest of the next group");
    }

    #[test]
    fn whoever_was_overwritten_is_not_taken_for_who_is_there_now() {
        let mut points = full(8);
        let id = points.id(3);
        assert!(points.has(id));
        points.put(3, Place::Near(Vec3::ZERO), known(2.0));
        assert!(!points.has(id) && points.has(points.id(3)));
        points.set_place(3, None);
        assert!(!points.has(points.id(3)));
    }

    #[test]
    fn ages_go_by_frames_or_by_samples_and_faster_for_what_is_unseen_specular_or_moving() {
        let mut points = full(64);
        (0..64).for_each(|slot| points.see(slot, slot));
        points.hide(1);
        let specular = Sampled { hint: Hint::Specular, ..known(2.0).sampled };
        points.put(2, Place::Near(Vec3::ZERO), Known { sampled: specular, ..known(2.0) });
        points.see(2, 2);
        points.set_name(3, SurfacePoint { object: 7, ..SurfacePoint::default() });
        let none = BTreeSet::new();
        points.age_by_frame(&none);
        let ages = |points: &Points| [0, 1, 2, 3].map(|slot| points.age(slot));
        assert_eq!(ages(&points), [256, 768, 1024, 256]);
        points.age_by_frame(&BTreeSet::from([7]));
        assert_eq!(ages(&points), [512, 1536, 2048, 768]);
        // One sample a time, as many as there are slots: half of the life, to the last bit, whatever is carried.
        let mut points = full(64);
        (0..64).for_each(|slot| points.see(slot, slot));
        for _ in 0..64 {
            points.age_by_samples(1, &none);
        }
        assert_eq!(points.age(0), 128 << 8);
        points.age_by_samples(63, &none);
        points.evict();
        assert!(points.place(0).is_some());
        points.age_by_samples(1, &none);
        points.evict();
        assert!(points.is_empty() && points.all().is_empty(), "at 255 points go");
        let mut points = full(8);
        (0..400).for_each(|_| points.age_by_frame(&none));
        assert!(!points.is_empty() && points.age(0) == AGE_MAX, "they get no older");
    }

    #[test]
    fn another_number_of_slots_keeps_the_youngest() {
        let mut points = full(32);
        (0..32).for_each(|slot| points.age_early(slot, 100 - slot as u16));
        let fewer = points.resized(8);
        let mut left: Vec<f32> = (0..8).map(|slot| fewer.light(slot).emitted.x).collect();
        left.sort_by(f32::total_cmp);
        // Groups are filled in turn: the last holds every fourth.
        assert_eq!(left, [3.0, 7.0, 11.0, 15.0, 19.0, 23.0, 27.0, 31.0]);
        let more = points.resized(100);
        assert_eq!(more.all().len(), 32);
        assert!(more.len() == 104 && (0..32).all(|slot| points.has(points.id(slot))));
    }

    #[test]
    fn points_go_where_their_objects_go() {
        let mut points = full(8);
        for (slot, object) in [(0, 1), (1, 2), (2, 2)] {
            let triangle = slot;
            points.set_name(slot, SurfacePoint { object, triangle, ..SurfacePoint::default() });
        }
        points.carry(|name| name.object == 2, |name| (name.triangle == 1).then_some(Vec3::splat(9.0)));
        assert_eq!(points.place(0), Some(Place::Near(Vec3::ZERO)));
        assert_eq!(points.place(1), Some(Place::Near(Vec3::splat(9.0))));
        assert_eq!(points.place(2), None);
        assert!(points.place(3).is_some(), "what has no name stays");
    }
}
