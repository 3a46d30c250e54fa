//! How much to draw while something moves, so that a chosen frame rate is held.
//!
//! The work of a frame is about `pixels · (eye path + lights)`. The pace learns how much of it is done
//! in a second and takes the largest picture that fits the time of a frame: resolution and lights fall
//! together. It goes down at once and up step by step, with a gap between the two, so that it
//! settles.

use protocol::question::{Motion, Quality};

use super::Moment;

/// Holds the frame rate of moving pictures.
#[derive(Clone, Debug)]
pub struct Pace {
    /// Time of a frame that is aimed at, microseconds.
    target: u64,
    /// Work a microsecond, as far as is known.
    speed: Option<f64>,
    step: usize,
    /// Time that a frame of this level takes, microseconds, as far as is known.
    expected: u64,
}

/// How much is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// Sides of the picture over those of a still one, 0..=1.
    pub scale: f32,
    /// Lights and virtual lights over those of a still picture, 0..=1.
    pub lights: f32,
}

/// Sides of the picture, from full to least; each step is about a third less work. The least is enough for a screen of
/// four thousand columns on two cores.
const SCALES: [f32; 16] =
    [1.0, 0.84, 0.7, 0.58, 0.5, 0.42, 0.35, 0.29, 0.24, 0.2, 0.165, 0.135, 0.11, 0.09, 0.074, 0.06];
/// Pixels of a moving picture as long as no speed is known: quick anywhere.
const FIRST_PIXELS: f64 = 30_000.0;
/// Work of an eye path, in units of a light's.
const EYE_WORK: f64 = 10.0;
/// Pixels that a moving picture has at least on its shorter side.
const SHORTER_SIDE_MIN: u32 = 48;
/// The share of the time aimed at above which the picture shrinks, and below which it may grow.
const TOO_SLOW: f64 = 1.15;
const ROOM_FOR_MORE: f64 = 0.9;
/// Weight of the last frame in what is known of the speed.
const FRESH: f64 = 0.35;

impl Pace {
    /// Nothing known; `rate` in frames a second, above 0, of still pictures of this size and kind.
    pub fn new(rate: f32, size: [u32; 2], rest: &Quality) -> Self {
        let mut pace = Self { target: period(rate), speed: None, step: 0, expected: 0 };
        pace.resize(size, rest);
        pace
    }

    /// Still pictures have this size from now on.
    pub fn resize(&mut self, size: [u32; 2], rest: &Quality) {
        let fits = |step: &usize| match self.speed {
            Some(speed) => work(size, rest, level(*step)) / speed <= self.target as f64,
            None => level(*step).size(size).map(f64::from).iter().product::<f64>() <= FIRST_PIXELS,
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

    /// What the next moving frame should be.
    pub fn level(&self) -> Level {
        level(self.step)
    }

    /// Learns from a moving frame of the current level, `done` of which (0..=1) took that long, and
    /// decides what the next should be. So much of it was the way to workers and back, `way` microseconds: a smaller
    /// picture would take that as well. What is left of the time aimed at is for drawing, at least half of it, because a
    /// picture that nobody recognises would not be there in time either.
    pub fn learn(&mut self, size: [u32; 2], rest: &Quality, done: f32, micros: u64, way: u64) {
        let (micros, room) = (micros.saturating_sub(way), self.target.saturating_sub(way).max(self.target / 2));
        let work = |step| work(size, rest, level(step));
        let speed = work(self.step) * f64::from(done.max(0.01)) / micros.max(1) as f64;
        let known = self.speed.map_or(speed, |old| old + (speed - old) * FRESH);
        self.speed = Some(known);
        let time = |step| work(step) / known / room as f64;
        if time(self.step) > TOO_SLOW {
            let fits = (self.step..SCALES.len()).find(|step| time(*step) <= 1.0);
            self.step = fits.unwrap_or(SCALES.len() - 1);
        } else if self.step > 0 && time(self.step - 1) < ROOM_FOR_MORE {
            self.step -= 1;
        }
        self.expected = (work(self.step) / known + way as f64).min(EXPECTED_MAX) as u64;
    }

    /// How long a moving frame may take before what has come of it is shown, from when it began: twice what is
    /// aimed at, or what can be expected where even the least is too much.
    pub fn deadline(&self, began: Moment) -> Moment {
        Moment(began.0 + (2 * self.target.max(self.expected)).max(DEADLINE_MIN))
    }
}

impl Level {
    /// The picture's size.
    pub fn size(&self, [width, height]: [u32; 2]) -> [u32; 2] {
        let least = SHORTER_SIDE_MIN as f32 / width.min(height).max(1) as f32;
        let scale = self.scale.max(least).min(1.0);
        [width, height].map(|side| ((side as f32 * scale).round() as u32).max(1))
    }

    /// The estimator's knobs: the same light sets in every frame, wherever the camera is, so that
    /// light does not flicker (algorithms.md B5); no importance, which would follow the camera.
    pub fn quality(&self, rest: &Quality) -> Quality {
        let fewer = |count: u16| ((f32::from(count) * self.lights).ceil() as u16).clamp(1, count.max(1));
        Quality {
            light_samples: fewer(rest.light_samples),
            vpls: fewer(rest.vpls),
            photons: (rest.photons as f32 * self.lights).ceil() as u32,
            importance: false,
            // Who asks for the paper's gets the paper's.
            motion: if rest.motion == Motion::Fresh { Motion::Fresh } else { Motion::Moving },
            replicates: 1,
            ..*rest
        }
    }
}

fn level(step: usize) -> Level {
    let scale = SCALES[step.min(SCALES.len() - 1)];
    Level { scale, lights: scale.clamp(0.25, 0.5) }
}

fn work(size: [u32; 2], rest: &Quality, level: Level) -> f64 {
    let [width, height] = level.size(size).map(f64::from);
    let quality = level.quality(rest);
    width * height * (EYE_WORK + f64::from(quality.light_samples) + f64::from(quality.vpls))
}

fn period(rate: f32) -> u64 {
    (1e6 / f64::from(rate.clamp(RATE_MIN, RATE_MAX))) as u64
}

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

    const SIZE: [u32; 2] = [640, 480];

    /// Runs frames on a machine of the given speed; the rate that it settles at.
    fn settle(pace: &mut Pace, speed: f64) -> f64 {
        let rest = Quality::default();
        let mut micros = 0.0;
        for _ in 0..40 {
            micros = work(SIZE, &rest, pace.level()) / speed;
            pace.learn(SIZE, &rest, 1.0, micros as u64, 0);
        }
        1e6 / micros
    }

    #[test]
    fn it_holds_the_rate_on_machines_of_very_different_speed() {
        for speed in [3.0, 10.0, 30.0] {
            let mut pace = Pace::new(10.0, SIZE, &Quality::default());
            let rate = settle(&mut pace, speed);
            assert!((8.5..=16.0).contains(&rate), "{rate} frames/s at speed {speed}");
        }
    }

    #[test]
    fn it_begins_with_a_quick_picture_on_any_screen_and_knows_the_speed_on_the_next() {
        let rest = Quality::default();
        for size in [[200, 150], SIZE, [1157, 900], [3840, 2160]] {
            let [width, height] = Pace::new(10.0, size, &rest).level().size(size);
            assert!(f64::from(width * height) < 1.05 * FIRST_PIXELS, "{size:?}: {width}x{height}");
        }
        let mut pace = Pace::new(10.0, SIZE, &rest);
        settle(&mut pace, 20.0);
        let large = SIZE.map(|side| 3 * side);
        let before = work(SIZE, &rest, pace.level());
        pace.resize(large, &rest);
        let after = work(large, &rest, pace.level());
        assert!((0.5..1.6).contains(&(after / before)), "as much work as before: {}", after / before);
    }

    #[test]
    fn it_follows_workers_that_come_and_go_and_then_stays() {
        let mut pace = Pace::new(10.0, SIZE, &Quality::default());
        settle(&mut pace, 20.0);
        let with_many = pace.level().scale;
        settle(&mut pace, 4.0);
        let with_few = pace.level();
        assert!(with_few.scale < with_many);
        settle(&mut pace, 4.0);
        assert_eq!(pace.level(), with_few, "nothing has changed");
    }

    #[test]
    fn a_long_way_does_not_make_pictures_small_that_are_drawn_at_once() {
        let (mut pace, rest, way) = (Pace::new(10.0, SIZE, &Quality::default()), Quality::default(), 150_000);
        for _ in 0..40 {
            let micros = work(SIZE, &rest, pace.level()) / 1e4;
            pace.learn(SIZE, &rest, 1.0, micros as u64 + way, way);
        }
        assert_eq!(pace.level().size(SIZE), SIZE);
        assert!(pace.deadline(Moment(0)).0 > 2 * way, "nobody gives up what is on its way");
    }

    #[test]
    fn a_fast_machine_draws_at_full_size() {
        let mut pace = Pace::new(10.0, SIZE, &Quality::default());
        settle(&mut pace, 1e6);
        assert_eq!(pace.level().size(SIZE), SIZE);
    }

    #[test]
    fn small_pictures_stay_recognisable() {
        assert_eq!(level(9).size([64, 48]), [64, 48]);
        assert_eq!(level(9).size([10, 1]), [10, 1]);
    }
}
