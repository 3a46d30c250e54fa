//! The cache: a fixed number of shaded points of the scene, each with its place, its light and its age.
//!
//! A new point takes the slot of the oldest in the next group of [`GROUP`], round robin: exactly the oldest of all would
//! cost a search, and whatever is stale goes in the end (Walter et al. 1999, section 4.3). Ages are bytes with eight bits
//! behind the point; 255 is the end (Walter et al. 2002).

use std::collections::BTreeSet;
use std::f32::consts::FRAC_1_PI;

use glam::Vec3;
use protocol::question::Address;
use scenes::SurfacePoint;

/// Slots that are looked at for one to overwrite.
pub(super) const GROUP: usize = 8;
/// Steps of an age's unit.
pub(super) const AGE_UNIT: u32 = 256;
/// The greatest age.
pub(super) const AGE_MAX: u16 = u16::MAX;
/// From this age on a point is evicted.
const AGE_EVICTED: u16 = 255 << 8;
/// Points that no pixel shows age so many times as fast: they are likely to be of no use any more.
const UNSEEN: u32 = 3;
/// No pixel shows the point; or none can have shown it yet.
const NOWHERE: u32 = u32::MAX;
const NEW: u32 = u32::MAX - 1;

/// What a point's light is made of; its radiance is `emitted + reflectance · irradiance / π`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Light {
    /// Never smoothed.
    pub emitted: Vec3,
    pub reflectance: Vec3,
    pub irradiance: Vec3,
    /// Unit; zero where nothing matt is seen.
    pub normal: Vec3,
}

impl Light {
    /// Towards the eye, W·m⁻²·sr⁻¹.
    pub fn radiance(&self) -> Vec3 {
        self.emitted + self.reflectance * self.irradiance * FRAC_1_PI
    }
}

/// Where a point lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Place {
    /// In the scene.
    Near(Vec3),
    /// Infinitely far, in this direction.
    Far(Vec3),
}

/// How fast a point gets out of date: the renderer's hint (section 4.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Hint {
    #[default]
    Matt,
    /// Its light depends on where the eye is.
    Specular,
}

impl Hint {
    fn speed(self) -> u8 {
        match self {
            Self::Matt => 1,
            Self::Specular => 4,
        }
    }
}

/// Points of objects that are being moved age so many times as fast.
const MOVING: u8 = 2;

/// Whose random numbers lit a sample, and in which state of the world: asked again, it is the same bits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Origin {
    pub address: Address,
    /// Light set and frame.
    pub set: u16,
    pub frame: u32,
    pub revision: u32,
}

/// All about a point but where it lies and how old it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Known {
    /// `None`: of the sky, or of a still picture.
    pub name: Option<SurfacePoint>,
    /// Mean of its samples.
    pub light: Light,
    /// Samples in the mean; 0 if light has changed since.
    pub count: u8,
    /// The state of the world that it is known to be of.
    pub revision: u32,
    pub hint: Hint,
    /// The last sample, and how it can be had again; `None`: it cannot.
    pub last: Option<(Vec3, Origin)>,
}

/// A slot's number, and which of the points that have been there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Id {
    pub slot: u32,
    serial: u32,
}

/// See the module's documentation.
#[derive(Clone, Debug, Default)]
pub(super) struct Points {
    /// `None`: the slot is empty.
    places: Vec<Option<Place>>,
    /// Slots that are not.
    occupied: usize,
    ages: Vec<u16>,
    /// The pixel that shows the point.
    pixels: Vec<u32>,
    known: Vec<Known>,
    /// Of [`Known::light`] and of [`Known::hint`], for those who look at all points.
    radiances: Vec<Vec3>,
    speeds: Vec<u8>,
    serials: Vec<u32>,
    next_serial: u32,
    next_group: usize,
    /// Ageing that was less than a step so far, in `1 / len` steps.
    carry: u64,
}

impl Points {
    /// Nothing in `capacity` slots, rounded up to whole groups.
    pub fn new(capacity: usize) -> Self {
        let len = capacity.next_multiple_of(GROUP).max(GROUP);
        let nothing =
            Known { name: None, light: Light::default(), count: 0, revision: 0, hint: Hint::Matt, last: None };
        Self {
            places: vec![None; len],
            ages: vec![0; len],
            pixels: vec![NEW; len],
            known: vec![nothing; len],
            radiances: vec![Vec3::ZERO; len],
            speeds: vec![1; len],
            serials: vec![0; len],
            ..Self::default()
        }
    }

    /// Bytes of a slot.
    pub const BYTES: usize = size_of::<Option<Place>>()
        + size_of::<Known>()
        + size_of::<Vec3>()
        + size_of::<[u32; 2]>()
        + size_of::<u16>()
        + size_of::<u8>();

    /// The same points in another number of slots; the oldest are lost where there is no room.
    pub fn resized(&self, capacity: usize) -> Self {
        let mut resized = Self { next_serial: self.next_serial, ..Self::new(capacity) };
        let mut slots: Vec<usize> = (0..self.len()).filter(|slot| self.places[*slot].is_some()).collect();
        slots.sort_by_key(|slot| self.ages[*slot]);
        slots.truncate(resized.len());
        for (to, from) in slots.into_iter().enumerate() {
            resized.places[to] = self.places[from];
            resized.ages[to] = self.ages[from];
            resized.known[to] = self.known[from];
            resized.radiances[to] = self.radiances[from];
            resized.speeds[to] = self.speeds[from];
            resized.serials[to] = self.serials[from];
            resized.occupied += 1;
        }
        resized
    }

    /// Number of slots.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// There is no point.
    pub fn is_empty(&self) -> bool {
        self.occupied == 0
    }

    pub fn places(&self) -> &[Option<Place>] {
        &self.places
    }

    pub fn age(&self, slot: u32) -> u16 {
        self.ages[slot as usize]
    }

    pub fn known(&self, slot: u32) -> &Known {
        &self.known[slot as usize]
    }

    /// The point's radiance.
    pub fn radiance(&self, slot: u32) -> Vec3 {
        self.radiances[slot as usize]
    }

    /// The point got to know what it is a point of.
    pub fn name(&mut self, slot: u32, name: SurfacePoint) {
        self.known[slot as usize].name = Some(name);
    }

    /// The point was asked again and is as it was, in another state of the world.
    pub fn confirm(&mut self, slot: u32, last: (Vec3, Origin)) {
        let known = &mut self.known[slot as usize];
        (known.revision, known.last) = (last.1.revision, Some(last));
        self.renew(slot);
    }

    /// The point that is in a slot now.
    pub fn id(&self, slot: u32) -> Id {
        Id { slot, serial: self.serials[slot as usize] }
    }

    /// The point is still there.
    pub fn has(&self, id: Id) -> bool {
        let slot = id.slot as usize;
        self.places.get(slot).is_some_and(Option::is_some) && self.serials[slot] == id.serial
    }

    /// A new point, over an old one.
    pub fn insert(&mut self, place: Place, known: Known) -> u32 {
        let group = self.next_group * GROUP..(self.next_group + 1) * GROUP;
        self.next_group = (self.next_group + 1) % (self.len() / GROUP);
        let worth = |slot: &usize| (self.places[*slot].is_some(), std::cmp::Reverse(self.ages[*slot]));
        let slot = group.min_by_key(worth).unwrap_or(0);
        self.put(slot as u32, place, known);
        slot as u32
    }

    /// Another point in this slot.
    pub fn put(&mut self, slot: u32, place: Place, known: Known) {
        let at = slot as usize;
        self.occupied += usize::from(self.places[at].is_none());
        self.next_serial = self.next_serial.wrapping_add(1);
        (self.places[at], self.known[at]) = (Some(place), known);
        (self.radiances[at], self.speeds[at]) = (known.light.radiance(), known.hint.speed());
        (self.ages[at], self.pixels[at], self.serials[at]) = (0, NEW, self.next_serial);
    }

    /// The point is up to date.
    pub fn renew(&mut self, slot: u32) {
        self.ages[slot as usize] = 0;
    }

    #[cfg(test)]
    pub fn set_count(&mut self, slot: u32, count: u8) {
        self.known[slot as usize].count = count;
    }

    #[cfg(test)]
    pub fn remove(&mut self, slot: u32) {
        self.occupied -= usize::from(self.places[slot as usize].take().is_some());
    }

    /// Forgets which pixels show what.
    pub fn unsee(&mut self) {
        self.pixels.fill(NOWHERE);
    }

    /// A pixel shows the point.
    pub fn see(&mut self, slot: u32, pixel: u32) {
        self.pixels[slot as usize] = pixel;
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
        for (at, age) in self.places.iter_mut().zip(&self.ages) {
            if *age >= AGE_EVICTED && at.take().is_some() {
                self.occupied -= 1;
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
        for (((age, pixel), speed), known) in each.zip(&self.known) {
            let is_moving = known.name.is_some_and(|name| moving.contains(&name.object));
            *age = older(*age, *pixel, (*speed).max(if is_moving { MOVING } else { 1 }));
        }
    }

    /// Light has changed, nobody knows where: means that cannot be asked again by the same numbers count as few samples, so
    /// that new ones soon prevail.
    pub fn doubt(&mut self, samples: u8) {
        for known in self.known.iter_mut().filter(|known| known.last.is_none()) {
            known.count = known.count.min(samples);
        }
    }

    /// Removes points without a name that lie where `is_there` says.
    pub fn remove_nameless(&mut self, is_there: impl Fn(Vec3) -> bool) {
        for (at, known) in self.places.iter_mut().zip(&self.known) {
            if let Some(Place::Near(place)) = *at
                && known.name.is_none()
                && is_there(place)
            {
                *at = None;
                self.occupied -= 1;
            }
        }
    }

    /// Finds the points anew that `place` knows a place for; those that it has none for are gone.
    pub fn carry(&mut self, concerns: impl Fn(&SurfacePoint) -> bool, place: impl Fn(&SurfacePoint) -> Option<Vec3>) {
        for (at, known) in self.places.iter_mut().zip(&self.known) {
            if let (Some(_), Some(name)) = (&at, &known.name)
                && concerns(name)
            {
                *at = place(name).map(Place::Near);
                self.occupied -= usize::from(at.is_none());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known(brightness: f32) -> Known {
        let light = Light { emitted: Vec3::splat(brightness), ..Light::default() };
        Known { name: None, light, count: 1, revision: 0, hint: Hint::Matt, last: None }
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
        assert!((0..16).all(|slot| points.places()[slot].is_some()), "groups take turns, and empty slots go first");
        points.age_early(5, 7);
        points.age_early(6, 9);
        points.age_early(12, 3);
        assert_eq!(points.insert(Place::Near(Vec3::ZERO), known(1.0)), 6);
        assert_eq!(points.insert(Place::Near(Vec3::ZERO), known(1.0)), 12);
        assert_eq!(points.insert(Place::Near(Vec3::ZERO), known(1.0)), 5);
        points.remove(8);
        assert_eq!(points.insert(Place::Near(Vec3::ZERO), known(1.0)), 8);
    }

    #[test]
    fn whoever_was_overwritten_is_not_taken_for_who_is_there_now() {
        let mut points = full(8);
        let id = points.id(3);
        assert!(points.has(id));
        points.put(3, Place::Near(Vec3::ZERO), known(2.0));
        assert!(!points.has(id) && points.has(points.id(3)));
        points.remove(3);
        assert!(!points.has(points.id(3)));
    }

    #[test]
    fn ages_go_by_frames_or_by_samples_and_faster_for_what_is_unseen_specular_or_moving() {
        let mut points = full(64);
        (0..64).for_each(|slot| points.see(slot, slot));
        points.unsee();
        (0..64).filter(|slot| *slot != 1).for_each(|slot| points.see(slot, slot));
        points.put(2, Place::Near(Vec3::ZERO), Known { hint: Hint::Specular, ..known(2.0) });
        points.see(2, 2);
        points.name(3, SurfacePoint { object: 7, ..SurfacePoint::default() });
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
        assert!(points.places()[0].is_some());
        points.age_by_samples(1, &none);
        points.evict();
        assert!(points.is_empty() && points.places().iter().all(Option::is_none), "at 255 points go");
        let mut points = full(8);
        (0..400).for_each(|_| points.age_by_frame(&none));
        assert!(!points.is_empty() && points.age(0) == AGE_MAX, "they get no older");
    }

    #[test]
    fn another_number_of_slots_keeps_the_youngest() {
        let mut points = full(32);
        (0..32).for_each(|slot| points.age_early(slot, 100 - slot as u16));
        let fewer = points.resized(8);
        let mut left: Vec<f32> = (0..8).map(|slot| fewer.known(slot).light.emitted.x).collect();
        left.sort_by(f32::total_cmp);
        // Groups are filled in turn: the last holds every fourth.
        assert_eq!(left, [3.0, 7.0, 11.0, 15.0, 19.0, 23.0, 27.0, 31.0]);
        let more = points.resized(100);
        assert_eq!(more.places().iter().flatten().count(), 32);
        assert!((0..32).all(|slot| !points.has(points.id(slot)) || more.len() == 104));
    }

    #[test]
    fn points_go_where_their_objects_go() {
        let mut points = full(8);
        for (slot, object) in [(0, 1), (1, 2), (2, 2)] {
            let triangle = slot;
            points.name(slot, SurfacePoint { object, triangle, ..SurfacePoint::default() });
        }
        points.carry(|name| name.object == 2, |name| (name.triangle == 1).then_some(Vec3::splat(9.0)));
        assert_eq!(points.places()[0], Some(Place::Near(Vec3::ZERO)));
        assert_eq!(points.places()[1], Some(Place::Near(Vec3::splat(9.0))));
        assert_eq!(points.places()[2], None);
        assert!(points.places()[3].is_some(), "what has no name stays");
    }
}
