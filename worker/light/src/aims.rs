//! How light is sent on its way: how often from which emitter, and through which discs if it comes from afar.
//!
//! Any choice that leaves nothing out is right on average. A good one sends light from where, and to where, it matters
//! to what is asked about: [`crate::importance`] makes it.

use std::f32::consts::PI;

use glam::Vec3;

use crate::targets::Ball;
use crate::warp;

/// How light of a light set leaves emitters.
#[derive(Clone, Debug, Default)]
pub struct Aims {
    /// Which emitter.
    pub choice: Choice,
    /// Where light from afar enters the scene.
    pub entry: Entry,
    /// Share of light paths that are sent towards clear glass wherever they begin or are scattered, until they have passed some
    /// ([`crate::walk`]).
    pub at_panes: f32,
}

/// How often each emitter is chosen: mostly by what was found of it, and by what was known before.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Choice {
    /// Cumulative probabilities, the last one 1.
    found: Vec<f64>,
    /// Likewise; empty if nothing was found.
    known: Vec<f64>,
    /// Share of what was known.
    defence: f64,
}

/// A part of a choice: those who take so many samples of each keep the strata of either.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Part {
    /// Both, at random.
    Any,
    /// By what was found.
    Found,
    /// By what was known.
    Known,
}

impl Choice {
    /// In proportion to weights that are not negative, of which one is positive.
    pub fn new(weights: &[f64]) -> Self {
        Self { found: cumulative(weights), ..Self::default() }
    }

    /// A share of `defence`, more than 0, like another choice; the rest in proportion to weights.
    pub fn mixed(weights: &[f64], known: &Self, defence: f64) -> Self {
        Self { found: cumulative(weights), known: cumulative(&known.shares()), defence }
    }

    /// Emitter number `i` is chosen so often.
    pub fn probability(&self, i: usize) -> f64 {
        let known = if self.known.is_empty() { 0.0 } else { step(&self.known, i) };
        (1.0 - self.defence) * step(&self.found, i) + self.defence * known
    }

    /// The emitter that 0 ≤ `u` < 1 falls to, and where in its share (0..1). `None` if there is none.
    pub fn choose(&self, part: Part, u: f64) -> Option<(usize, f64)> {
        match part {
            Part::Any if u < self.defence => choose(&self.known, u / self.defence),
            Part::Any => choose(&self.found, (u - self.defence) / (1.0 - self.defence)),
            Part::Found => choose(&self.found, u),
            Part::Known => choose(&self.known, u),
        }
    }

    /// Samples by what was known for each by what was found.
    pub fn known_for_each_found(&self) -> f64 {
        self.defence / (1.0 - self.defence)
    }

    /// Each emitter's probability.
    pub fn shares(&self) -> Vec<f64> {
        (0..self.found.len()).map(|i| self.probability(i)).collect()
    }
}

fn cumulative(weights: &[f64]) -> Vec<f64> {
    let mut sum = 0.0;
    let add = |weight: &f64| {
        sum += weight;
        sum
    };
    let mut sums: Vec<f64> = weights.iter().map(add).collect();
    for part in &mut sums {
        *part /= sum;
    }
    sums
}

fn step(sums: &[f64], i: usize) -> f64 {
    sums[i] - if i > 0 { sums[i - 1] } else { 0.0 }
}

fn choose(sums: &[f64], u: f64) -> Option<(usize, f64)> {
    let i = sums.partition_point(|sum| *sum <= u).min(sums.len().checked_sub(1)?);
    let low = if i > 0 { sums[i - 1] } else { 0.0 };
    Some((i, ((u - low) / (sums[i] - low)).clamp(0.0, 1.0)))
}

/// Where light from afar enters: through discs across its way. Besides one that covers what matters, discs twice as wide, four
/// times, and so on: what lies about it and lights it in turn is found by a density that falls no faster than with the square of
/// the distance, as the light that comes from there does.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Entry {
    /// One that covers everything.
    whole: Ball,
    /// And one that covers what matters; with how much of the light that is sent. The rest goes through all others alike.
    part: Option<(Ball, f32)>,
}

/// A disc that has more of the radius of the whole is no other.
const PART_RADIUS: f32 = 0.5;

impl Entry {
    /// Everywhere alike.
    pub fn whole(whole: Ball) -> Self {
        Self { whole, part: None }
    }

    /// So much of the light, below 1, through a disc that covers `part`; all alike where that is not much smaller.
    pub fn mostly(whole: Ball, part: Ball, share: f32) -> Self {
        let is_worthwhile = share > 0.0 && part.radius > 0.0 && part.radius < PART_RADIUS * whole.radius;
        Self { whole, part: is_worthwhile.then_some((part, share)) }
    }

    /// The lesser disc, if there is one.
    pub fn part(&self) -> Option<Ball> {
        self.part.map(|(ball, _)| ball)
    }

    /// Where light that comes from a direction starts, beyond everything. `u` = two coordinates, a choice.
    pub fn sample(&self, towards: Vec3, u: [f32; 3]) -> Vec3 {
        let ball = match self.part {
            Some((part, share)) if u[2] < share => part,
            Some((part, share)) => {
                let count = self.wider(part).count() + 1;
                let number = ((u[2] - share) / (1.0 - share) * count as f32) as usize;
                self.wider(part).nth(number).unwrap_or(self.whole)
            }
            None => self.whole,
        };
        self.through(ball, towards, [u[0], u[1]])
    }

    /// Discs between the part and the whole.
    fn wider(&self, part: Ball) -> impl Iterator<Item = Ball> {
        let radius = move |doubled: i32| part.radius * libm::exp2f(doubled as f32);
        let most = self.whole.radius;
        (1..).map(move |doubled| Ball { radius: radius(doubled), ..part }).take_while(move |ball| ball.radius < most)
    }

    /// The same for light that goes through a disc which covers `ball`.
    pub fn through(&self, ball: Ball, towards: Vec3, u: [f32; 2]) -> Vec3 {
        let (s, t) = warp::frame(towards);
        let d = warp::disc(u) * ball.radius;
        let origin = ball.centre + s * d.x + t * d.y;
        origin + towards * ((self.whole.centre - origin).dot(towards) + 2.0 * self.whole.radius)
    }

    /// Density of [`Self::sample`] among the rays that come from a direction: per unit area across it.
    pub fn density(&self, origin: Vec3, towards: Vec3) -> f32 {
        let whole = density_through(self.whole, origin, towards);
        match self.part {
            None => whole,
            Some((part, share)) => {
                let (count, sum) = self
                    .wider(part)
                    .fold((1, whole), |(count, sum), ball| (count + 1, sum + density_through(ball, origin, towards)));
                share * density_through(part, origin, towards) + (1.0 - share) * sum / count as f32
            }
        }
    }
}

/// Density of [`Entry::through`], likewise.
pub fn density_through(ball: Ball, origin: Vec3, towards: Vec3) -> f32 {
    let offset = origin - ball.centre;
    let across = (offset - towards * offset.dot(towards)).length();
    // A point on a disc's very edge may seem to lie outside.
    if across <= ball.radius * 1.0001 { 1.0 / (PI * ball.radius * ball.radius) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn emitters_are_chosen_as_often_as_their_weights_say() {
        let choice = Choice::new(&[1.0, 0.0, 3.0]);
        assert_eq!(choice.shares(), [0.25, 0.0, 0.75]);
        assert_eq!(choice.choose(Part::Any, 0.125), Some((0, 0.5)));
        assert_eq!(choice.choose(Part::Any, 0.25), Some((2, 0.0)), "what has no share is never chosen");
        assert_eq!(choice.choose(Part::Found, 0.625), Some((2, 0.5)));
        assert_eq!(Choice::default().choose(Part::Any, 0.5), None);
        let mixed = Choice::mixed(&[0.0, 1.0, 0.0], &choice, 0.25);
        assert_eq!(mixed.shares(), [0.0625, 0.75, 0.1875]);
        let n = 4096;
        let mut counts = [0; 3];
        for i in 0..n {
            let u = (f64::from(i) + 0.5) / f64::from(n);
            counts[mixed.choose(Part::Any, u).expect("there are three").0] += 1;
            assert_eq!(mixed.choose(Part::Found, u).map(|(i, _)| i), Some(1));
            assert_eq!(mixed.choose(Part::Known, u), choice.choose(Part::Any, u));
        }
        assert_eq!(counts, [256, 3072, 768]);
    }

    /// ∫ density over the plane is 1, and samples in the smaller disc are as frequent as it says.
    #[test]
    fn light_enters_as_densely_as_is_said() {
        let whole = Ball { centre: Vec3::new(1.0, -2.0, 0.5), radius: 10.0 };
        let part = Ball { centre: Vec3::new(3.0, 1.0, 2.0), radius: 1.0 };
        let entry = Entry::mostly(whole, part, 0.6);
        let towards = Vec3::new(0.36, 0.48, 0.8);
        let random = |i: u32, d: u32| (crate::sample::mix(4 * i + d) >> 8) as f32 / 16_777_216.0;
        let n = 100_000;
        let mut inside = 0;
        for i in 0..n {
            let origin = entry.sample(towards, [random(i, 0), random(i, 1), random(i, 2)]);
            assert!(entry.density(origin, towards) > 0.0);
            assert!(((origin - whole.centre).dot(towards) / 20.0 - 1.0).abs() < 1e-4, "beyond everything");
            inside += u32::from(density_through(part, origin, towards) > 0.0);
        }
        let expected = entry.density(part.centre, towards) * PI * part.radius * part.radius;
        assert!((inside as f32 / n as f32 / expected - 1.0).abs() < 0.01, "{inside} of {n} against {expected}");
        let (s, t) = warp::frame(towards);
        let side = 400;
        let cell = 40.0 / side as f32;
        let at = |i: i32| (i as f32 + 0.5) * cell - 20.0;
        let places = (0..side).flat_map(|i| (0..side).map(move |j| s * at(i) + t * at(j)));
        let sum: f32 = places.map(|place| entry.density(place, towards) * cell * cell).sum();
        assert!((sum - 1.0).abs() < 0.01, "{sum} in all");
        let [near, far] = [2.5, 7.0].map(|away| entry.density(part.centre - s * away, towards));
        assert!(far > 0.0 && near > 3.0 * far, "{near} near the part, {far} far from it");
    }

    #[test]
    fn a_disc_about_as_large_as_the_whole_is_left_out() {
        let whole = Ball { centre: Vec3::ZERO, radius: 2.0 };
        assert_eq!(Entry::mostly(whole, Ball { centre: Vec3::X, radius: 1.5 }, 0.5), Entry::whole(whole));
    }
}
