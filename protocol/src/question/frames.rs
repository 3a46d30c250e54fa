//! The same pixels in several frames at once: for pictures at rest, in which nobody looks at single frames any more.

use serde::{Deserialize, Serialize};

use super::{Lit, Motion, Quality, Tile};

/// The pixels of a tile in its frame and those that follow, each lit by the light set that serves these pixels there. The answer is their
/// mean, without what tells surfaces apart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Frames {
    /// The pixels, in the first frame.
    pub tile: Tile,
    /// How many frames, 1..=[`FRAMES_MAX`].
    pub count: u16,
}

/// Most frames that one question may ask for: so many light sets more a worker makes for it, and so much later it is heard.
pub const FRAMES_MAX: u16 = 16;

impl Frames {
    /// One frame after the other.
    pub fn tiles(&self) -> impl Iterator<Item = Tile> + use<> {
        let Tile { camera, rect, lit } = self.tile;
        (0..u32::from(self.count)).map(move |later| {
            let frame = lit.frame.saturating_add(later);
            let [x, y] = lit.quality.residue_of(lit.set, lit.frame);
            Tile { camera, rect, lit: Lit { frame, set: lit.quality.set_of(x, y, frame), ..lit } }
        })
    }
}

impl Quality {
    /// Number of frames that one question may be about where nothing moves, so that a round of all light sets is made of whole
    /// questions: then all its frames are of one replicate. 1: there is nothing to be gained.
    pub fn frames_at_once(&self) -> u16 {
        match self.motion {
            Motion::Still => {
                let divides = |count: &u16| self.sets().is_multiple_of(*count);
                (1..=FRAMES_MAX).rev().find(divides).unwrap_or(1)
            }
            Motion::Moving | Motion::Fresh => 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_round_is_made_of_whole_questions() {
        let at_once = |interleave: [u8; 2]| Quality { interleave, ..Quality::default() }.frames_at_once();
        assert_eq!(
            [[1, 1], [2, 2], [3, 3], [4, 4], [5, 5], [7, 5], [16, 16], [1, 13]].map(at_once),
            [1, 4, 9, 16, 5, 7, 16, 13]
        );
        assert_eq!(Quality { motion: Motion::Moving, ..Quality::default() }.frames_at_once(), 1);
        assert_eq!(Quality { motion: Motion::Fresh, ..Quality::default() }.frames_at_once(), 1);
    }
}
