//! How much to draw while something moves, so that a chosen frame rate is held.
//!
//! The pace learns how much of a method's work is done in a second ([`crate::Interactive::work`]) and takes the greatest
//! effort that fits the time of a frame. It goes down at once and up step by step, with a gap between the two, so that it
//! settles.

use super::Moment;
use crate::front_end::Effort;

/// Holds the frame rate of moving pictures.
#[derive(Clone, Debug)]
pub struct Pace {
    /// Time of a frame that is aimed at, microseconds.
    target: u64,
    /// Work a microsecond, as far as is known.
    speed: Option<f64>,
    step: usize,
    /// Time that workers draw a frame of this effort for, microseconds, as far as is known.
    expected: u64,
}

/// Square roots of efforts, from most to least, 1 being full size; each step is about a third less work. The least is enough for a
/// screen of four thousand columns on two cores.
const SCALES: [f32; 20] = [
    2.0, 1.68, 1.41, 1.19, 1.0, 0.84, 0.7, 0.58, 0.5, 0.42, 0.35, 0.29, 0.24, 0.2, 0.165, 0.135, 0.11, 0.09, 0.074,
    0.06,
];
/// Pixels of a moving picture as long as no speed is known: quick anywhere.
const FIRST_PIXELS: f64 = 30_000.0;
/// The share of the time aimed at above which the effort falls, and below which it may rise.
const TOO_SLOW: f64 = 1.15;
const ROOM_FOR_MORE: f64 = 0.9;
/// More than full size is drawn only in less than this, microseconds: as long as screens show more pictures, they are worth more.
const BEYOND_FULL: u64 = 16_667;
/// Weight of the last frame in what is known of the speed.
const FRESH: f64 = 0.35;

impl Pace {
    /// Nothing known; `rate` in frames a second, above 0, of still pictures with so many pixels, whose moving ones are so
    /// much work.
    pub fn new(rate: f32, pixels: f64, work: impl Fn(Effort) -> f64) -> Self {
        let mut pace = Self { target: period(rate), speed: None, step: 0, expected: 0 };
        pace.resize(pixels, work);
        pace
    }

    /// Still pictures have this size from now on.
    pub fn resize(&mut self, pixels: f64, work: impl Fn(Effort) -> f64) {
        let fits = |step: &usize| match self.speed {
            Some(speed) => work(effort(*step)) / speed <= self.target as f64,
            None => pixels * f64::from(effort(*step).0) <= FIRST_PIXELS,
        };
        self.step = (0..SCALES.len()).find(fits).unwrap_or(SCALES.len() - 1);
    }

    /// Aims at another rate from now on.
    pub fn aim(&mut self, rate: f32) {
        self.target = period(rate);
    }

    /// Time of a frame that is aimed at, microseconds.
    pub fn target(&self) -> u64 {
        self.target
    }

    /// What the next moving picture may take.
    pub fn effort(&self) -> Effort {
        effort(self.step)
    }

    /// Learns from so much work of moving pictures, which took that long to draw, and decides what the next should be. `waits`: so much of each picture's time, microseconds, is not for drawing. What
    /// is left of the time aimed at is for drawing, at least half of it, because a picture that nobody recognises would not be
    /// there in time either.
    pub fn learn(&mut self, work: impl Fn(Effort) -> f64, drawn: f64, micros: u64, waits: u64) {
        let room = self.target.saturating_sub(waits).max(self.target / 2);
        let work = |step| work(effort(step));
        let speed = drawn.max(0.01 * work(self.step)) / micros.max(1) as f64;
        let known = self.speed.map_or(speed, |old| old + (speed - old) * FRESH);
        self.speed = Some(known);
        let room = |step: usize| if SCALES[step] > 1.0 { room.min(BEYOND_FULL) } else { room };
        let time = |step| work(step) / known / room(step) as f64;
        if time(self.step) > TOO_SLOW {
            let fits = (self.step..SCALES.len()).find(|step| time(*step) <= 1.0);
            self.step = fits.unwrap_or(SCALES.len() - 1);
        } else if self.step > 0 && time(self.step - 1) < ROOM_FOR_MORE {
            self.step -= 1;
        }
        self.expected = (work(self.step) / known).min(EXPECTED_MAX) as u64;
    }

    /// Time that workers draw a moving picture for, microseconds; what is aimed at as long as nothing is known.
    pub fn drawing(&self) -> u64 {
        if self.speed.is_some() { self.expected } else { self.target }
    }

    /// How long a moving picture may take before what has come of it is shown, from when it began: twice what is
    /// aimed at, or what can be expected where even the least is too much, or takes so long to workers and back, microseconds.
    pub fn deadline(&self, began: Moment, round_trip: u64) -> Moment {
        Moment(began.0 + (2 * self.target.max(self.expected + round_trip)).max(DEADLINE_MIN))
    }
}

fn effort(step: usize) -> Effort {
    let scale = SCALES[step.min(SCALES.len() - 1)];
    Effort(scale * scale)
}

fn period(rate: f32) -> u64 {
    (1e6 / f64::from(rate.clamp(RATE_MIN, RATE_MAX))) as u64
}

/// No moving picture is worth more.
pub const EFFORT_MAX: f32 = 4.0;
/// Frames a second that can be aimed at.
pub const RATE_MIN: f32 = 0.5;
/// … and at most.
pub const RATE_MAX: f32 = 120.0;
/// Nothing is expected to take longer, microseconds.
const EXPECTED_MAX: f64 = 5e6;
/// Nothing is given up before this, microseconds.
const DEADLINE_MIN: u64 = 60_000;

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: f64 = 640.0 * 480.0;

    /// As a method has it whose work is its pixels.
    fn work(pixels: f64) -> impl Fn(Effort) -> f64 {
        move |Effort(share)| pixels * f64::from(share) * 26.0
    }

    /// Runs frames on a machine of the given speed; the rate that it settles at.
    fn settle(pace: &mut Pace, speed: f64) -> f64 {
        let mut micros = 0.0;
        for _ in 0..40 {
            micros = work(SIZE)(pace.effort()) / speed;
            let drawn = work(SIZE)(pace.effort());
            pace.learn(work(SIZE), drawn, micros as u64, 0);
        }
        1e6 / micros
    }

    #[test]
    fn it_holds_the_rate_on_machines_of_very_different_speed() {
        for speed in [3.0, 10.0, 30.0] {
            let mut pace = Pace::new(10.0, SIZE, work(SIZE));
            let rate = settle(&mut pace, speed);
            assert!((8.5..=16.0).contains(&rate), "{rate} frames/s at speed {speed}");
        }
    }

    #[test]
    fn it_begins_with_a_quick_picture_on_any_screen_and_knows_the_speed_on_the_next() {
        for [width, height] in [[200.0, 150.0], [640.0, 480.0], [1157.0, 900.0], [3840.0, 2160.0]] {
            let pixels: f64 = width * height;
            let Effort(share) = Pace::new(10.0, pixels, work(pixels)).effort();
            assert!(pixels * f64::from(share) < 1.05 * FIRST_PIXELS, "{width}x{height}: {share}");
        }
        let mut pace = Pace::new(10.0, SIZE, work(SIZE));
        settle(&mut pace, 20.0);
        let large = 9.0 * SIZE;
        let before = work(SIZE)(pace.effort());
        pace.resize(large, work(large));
        let after = work(large)(pace.effort());
        assert!((0.5..1.6).contains(&(after / before)), "as much work as before: {}", after / before);
    }

    #[test]
    fn it_follows_workers_that_come_and_go_and_then_stays() {
        let mut pace = Pace::new(10.0, SIZE, work(SIZE));
        settle(&mut pace, 20.0);
        let with_many = pace.effort();
        settle(&mut pace, 4.0);
        let with_few = pace.effort();
        assert!(with_few < with_many);
        settle(&mut pace, 4.0);
        assert_eq!(pace.effort(), with_few, "nothing has changed");
    }

    #[test]
    fn a_long_round_trip_does_not_make_pictures_small_that_are_drawn_at_once() {
        let (mut pace, round_trip) = (Pace::new(10.0, SIZE, work(SIZE)), 150_000);
        for _ in 0..40 {
            let micros = work(SIZE)(pace.effort()) / 1e4;
            let drawn = work(SIZE)(pace.effort());
            pace.learn(work(SIZE), drawn, micros as u64, round_trip);
        }
        assert!(pace.effort() >= Effort(1.0));
        assert!(pace.deadline(Moment(0), round_trip).0 > 2 * round_trip, "nobody gives up what is on its way");
    }

    #[test]
    fn a_fast_machine_draws_at_full_size_and_a_faster_one_as_many_pictures_as_are_seen_and_better_ones() {
        let effort = |millis: f64| {
            let mut pace = Pace::new(10.0, SIZE, work(SIZE));
            settle(&mut pace, work(SIZE)(Effort(1.0)) / (1e3 * millis));
            pace.effort()
        };
        // What a picture of full size takes.
        assert_eq!([80.0, 30.0, 13.0].map(effort), [Effort(1.0); 3]);
        assert!((Effort(1.1)..Effort(1.9)).contains(&effort(9.0)));
        assert_eq!([2.0, 0.01].map(effort), [Effort(EFFORT_MAX); 2]);
    }
}
