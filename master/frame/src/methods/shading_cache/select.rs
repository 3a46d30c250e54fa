//! Which patches are looked at next: by hit and test on the picture, and by flood fill from what that finds (Tole et al. 2002,
//! section 4).

use std::collections::VecDeque;

use super::mesh::NONE;
use super::settings::Scale;

/// What patches are worth, pixel by pixel.
#[derive(Clone, Copy)]
pub(super) struct PriorityMap<'a> {
    pub width: usize,
    /// Of each pixel, which patch it sees of those in sight; [`NONE`] where there is none.
    pub patches: &'a [u32],
    /// Of each patch in sight.
    pub priorities: &'a [f32],
    pub scale: Scale,
    /// Probability that a pixel is chosen whatever its priority (ε).
    pub chance: f32,
}

/// Why a pixel was chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Why {
    Priority,
    Chance,
    Flood,
}

/// A line from 0 to 1 of what a priority is worth, and from where on a flood goes on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Normal {
    zero: f32,
    per_unit: f32,
    flood: f32,
}

/// Deviations from the mean that are told apart.
const DEVIATIONS: f64 = 4.0;

impl Normal {
    /// By the mean and the deviation of the priorities of all pixels that have some.
    pub fn of(priorities: impl Iterator<Item = f32>, scale: Scale) -> Self {
        let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for priority in priorities.map(f64::from) {
            (count, sum, squares) = (count + 1.0, sum + priority, squares + priority * priority);
        }
        let mean = sum / f64::max(count, 1.0);
        let deviation = (squares / f64::max(count, 1.0) - mean * mean).max(0.0).sqrt();
        let high = mean + DEVIATIONS * deviation;
        let low = match scale {
            Scale::Deviations => mean - DEVIATIONS * deviation,
            Scale::Worst => 0.0,
        };
        // Where all are alike, chance alone decides.
        let is_told_apart = high > low && (deviation > 0.0 || scale == Scale::Worst);
        let per_unit = if is_told_apart { 1.0 / (high - low) } else { 0.0 };
        Self { zero: low as f32, per_unit: per_unit as f32, flood: (mean + deviation) as f32 }
    }

    /// 0..1.
    pub fn probability(&self, priority: f32) -> f32 {
        ((priority - self.zero) * self.per_unit).clamp(0.0, 1.0)
    }
}

impl PriorityMap<'_> {
    /// Calls `choose` with a pixel and why it was chosen until that says that it is enough: first by hit and test, until
    /// half is, then by flood fill, then by hit and test again. `random` gives numbers of 32 bits by their index.
    pub fn select(&self, random: impl Fn(u32) -> u32, mut choose: impl FnMut(usize, Why) -> Enough) {
        let pixels = self.patches.len();
        let seen = self.patches.iter().filter(|patch| **patch != NONE);
        let normal = Normal::of(seen.map(|patch| self.priorities[*patch as usize]), self.scale);
        let mut chosen = VecDeque::new();
        let mut visited = vec![false; pixels];
        let mut is_flooded = false;
        // As many tests as there are pixels: else a picture that is right would take for ever.
        for test in 0..pixels as u32 {
            let pixel = ((u64::from(random(3 * test)) * pixels as u64) >> 32) as usize;
            if self.patches[pixel] == NONE {
                continue;
            }
            let unit = |index: u32| (random(index) >> 8) as f32 / 16_777_216.0;
            let is_chance = unit(3 * test + 1) < self.chance;
            let priority = self.priorities[self.patches[pixel] as usize];
            if !is_chance && unit(3 * test + 2) >= normal.probability(priority) {
                continue;
            }
            let enough = choose(pixel, if is_chance { Why::Chance } else { Why::Priority });
            if enough == Enough::All {
                return;
            }
            if !is_chance && !visited[pixel] {
                visited[pixel] = true;
                chosen.push_back(pixel);
            }
            if enough == Enough::Half && !is_flooded {
                is_flooded = true;
                if self.flood(&normal, std::mem::take(&mut chosen), &mut visited, &mut choose) {
                    return;
                }
            }
        }
        self.flood(&normal, chosen, &mut visited, &mut choose);
    }

    /// Chooses what is around chosen pixels and worth as much or more. True: it is enough.
    fn flood(
        &self,
        normal: &Normal,
        mut chosen: VecDeque<usize>,
        visited: &mut [bool],
        choose: &mut impl FnMut(usize, Why) -> Enough,
    ) -> bool {
        while let Some(pixel) = chosen.pop_front() {
            let x = pixel % self.width;
            let around = [
                (x > 0).then(|| pixel - 1),
                (x + 1 < self.width).then_some(pixel + 1),
                pixel.checked_sub(self.width),
                Some(pixel + self.width).filter(|below| *below < self.patches.len()),
            ];
            let here = self.priorities[self.patches[pixel] as usize];
            for there in around.into_iter().flatten().filter(|there| self.patches[*there] != NONE) {
                let worth = self.priorities[self.patches[there] as usize];
                if visited[there] || worth <= normal.flood || worth < here {
                    continue;
                }
                visited[there] = true;
                chosen.push_back(there);
                if self.patches[there] != self.patches[pixel] && choose(there, Why::Flood) == Enough::All {
                    return true;
                }
            }
        }
        false
    }
}

/// How much has been chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Enough {
    Little,
    Half,
    All,
}
