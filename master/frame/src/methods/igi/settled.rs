//! How pictures at rest are drawn once they have settled: one light set a frame for all pixels, instead of one for each pixel
//! of a block.
//!
//! **Why.** Interleaved sets make neighbours err in different ways, so that the filter has something to average. It fades,
//! and then they only cost: as many sets to be made a frame as a block has pixels, and shafts and packets as much wider.
//! Without them a frame takes two thirds of the time, in small pictures a third, and says as much about each pixel.
//!
//! **How.** After some rounds of all sets ([`YOUNG_ROUNDS`]) questions name an interleaving of 1×1. What was a set of a
//! rectangle is a part of it now, so that there are as many questions as before, and each is about as many pixels. Replicates go on
//! taking turns by rounds; as the questions of one round are to have one sequence, each replicate has a seed of its own, and the
//! index in its sequence, and so the photon radius, go on from where they were. All of it is a function of settings and
//! frame.

use protocol::question::{Lit, Motion, Quality, Rect};

/// Rounds of all light sets in which frames are asked for one by one, and pixels of a block differ: by then more than a dozen
/// samples in each pixel tell surfaces apart, a round more is a small step, and the filter has little left to do.
pub(super) const YOUNG_ROUNDS: u32 = 8;

/// By what a settled frame is lit; `None` where light sets are those of the settings.
pub(super) fn lit(quality: &Quality, seed: u64, frame: u32) -> Option<Lit> {
    let sets = u32::from(quality.sets());
    let round = frame / sets;
    if sets == 1 || quality.motion != Motion::Still || round < YOUNG_ROUNDS {
        return None;
    }
    let replicate = quality.replicate_of(frame);
    let rounds_before = round / u32::from(quality.replicates.max(1));
    Some(Lit {
        set: 0,
        frame: rounds_before.saturating_mul(sets).saturating_add(frame % sets),
        seed: seed.wrapping_add(GOLDEN.wrapping_mul(u64::from(replicate) + 1)),
        quality: Quality { interleave: [1, 1], replicates: 1, ..*quality },
    })
}

/// 2⁶⁴ over the golden ratio: seeds that people choose are not so far apart.
const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// Part number `index` of a rectangle that is cut into `columns` × `rows` parts of about the same size; it may be empty.
pub(super) fn part(rect: Rect, [columns, rows]: [u8; 2], index: u16) -> Rect {
    let (column, row) = (u32::from(index) % u32::from(columns), u32::from(index) / u32::from(columns));
    let cut = |length: u32, count: u8, i: u32| (u64::from(length) * u64::from(i) / u64::from(count)) as u32;
    let (left, right) = (cut(rect.width, columns, column), cut(rect.width, columns, column + 1));
    let (top, bottom) = (cut(rect.height, rows, row), cut(rect.height, rows, row + 1));
    Rect { x: rect.x + left, y: rect.y + top, width: right - left, height: bottom - top }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn parts_make_the_rectangle() {
        for (width, height) in [(192, 96), (50, 31), (2, 1)] {
            let rect = Rect { x: 7, y: 3, width, height };
            let mut seen = BTreeSet::new();
            for index in 0..6 {
                part(rect, [3, 2], index).pixels().for_each(|pixel| assert!(seen.insert(pixel), "{pixel:?} twice"));
            }
            assert!(seen.into_iter().eq(rect.pixels().collect::<BTreeSet<_>>()));
        }
    }

    /// Each replicate goes through one sequence of its own, number by number.
    #[test]
    fn replicates_go_on_where_they_were() {
        let quality = Quality { interleave: [3, 2], replicates: 4, ..Quality::default() };
        assert!(lit(&quality, 9, 6 * YOUNG_ROUNDS - 1).is_none());
        let mut next = std::collections::BTreeMap::new();
        for frame in 6 * YOUNG_ROUNDS..400 {
            let lit = lit(&quality, 9, frame).expect("it has settled");
            assert_eq!((lit.set, lit.quality.sets(), lit.quality.replicate_of(lit.frame)), (0, 1, 0));
            let expected = next.entry(lit.seed).or_insert(6 * YOUNG_ROUNDS / 4);
            assert_eq!(lit.frame, *expected, "frame {frame}");
            *expected += 1;
        }
        assert!(next.len() == 4 && !next.contains_key(&9), "a sequence for each, and none that was begun");
    }

    #[test]
    fn only_pictures_at_rest_that_are_interleaved_settle() {
        let late = 1 << 20;
        for motion in [Motion::Moving, Motion::Fresh] {
            assert!(lit(&Quality { motion, ..Quality::default() }, 1, late).is_none());
        }
        assert!(lit(&Quality { interleave: [1, 1], ..Quality::default() }, 1, late).is_none());
    }
}
