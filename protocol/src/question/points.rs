//! Questions about single rays and single points, for front ends that keep what they know about light.
//!
//! **Promises** (docs/questions.md; each has its test).
//! * A ray with the address of pixel p and frame f, lit by the set that serves p in f, is that pixel of the tile.
//! * The first hit of a ray, asked about as a point with the same address, is lit by the same bits.
//! * What is answered about one ray or point does not depend on the others in its question.
//! * A point that the scene does not have is refused.

use glam::Vec3;
use scenes::{Absent, Camera, Scene, SurfacePoint};
use serde::{Deserialize, Serialize};

use super::{Ask, Lit};

/// Rays or points that are lit together: their shadow rays towards a light make one shaft.
pub const BLOCK: usize = 128;
/// Most rays or points of one question.
pub const POINTS_MAX: usize = 32 * BLOCK;
/// Most light groups that one question asks about apart.
pub const GROUPS_MAX: usize = 32;
/// Most pairs of a point and a virtual light that one question asks about.
pub const PAIRS_MAX: usize = 1 << 19;
/// What a question should take a thread, microseconds: long beside what it costs to ask, short beside a frame.
pub const QUESTION_MICROS: f64 = 6_000.0;

/// Whose random numbers are used: all chance in an answer is a function of this and of [`Lit`].
///
/// Not only pixels have addresses: whoever gives many points the same one has them share their error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Address {
    /// Column and row.
    pub pixel: [u32; 2],
    /// Number of the sample: that of the frame whose tile takes it.
    pub number: u32,
}

/// What each of some rays meets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rays {
    /// Where they come from, and the picture that they are rays of.
    pub camera: Camera,
    /// What light is chosen for ([`super::Quality::importance`]); `None` where it is chosen for nobody.
    pub view: Option<Camera>,
    /// At most [`POINTS_MAX`]; best sorted, so that neighbours make slim shafts.
    pub through: Vec<Ray>,
    /// By which light.
    pub lit: Lit,
}

/// A ray from the eye.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Ray {
    /// Whose random numbers it takes; without an aim, it goes through a random point of this pixel.
    pub address: Address,
    /// Goes exactly there. If it meets the surface there, it is lit exactly there; else where it ends.
    pub aim: Option<SurfacePoint>,
}

/// The light at points of surfaces, from all sides of the hemisphere above them, whoever looks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Points {
    /// What light is chosen for ([`super::Quality::importance`]). It is named because points are no part of any picture:
    /// chosen for a camera that moves, the light at a point would depend on who looked when.
    pub view: Option<Camera>,
    /// At most [`POINTS_MAX`]; best sorted.
    pub at: Vec<Point>,
    /// Which part of the light.
    pub part: Part,
    /// By which light.
    pub lit: Lit,
}

/// A point that is to be lit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Where.
    pub at: SurfacePoint,
    /// Whose random numbers it takes.
    pub address: Address,
}

/// Which part of the light at a point. Irradiance is W·m⁻² a channel, as if the surface were matt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Part {
    /// All irradiance: what a matt pixel has.
    All,
    /// Irradiance straight from lights, emitters and sky.
    Direct,
    /// The same, of each of some light groups apart: ascending indices into [`scenes::light_groups()`].
    DirectOf(Vec<u32>),
    /// All other irradiance.
    Indirect,
    /// From each virtual light of the set apart, `first ..` of them in the set's order: what it would bring unhidden, and
    /// whether it is hidden. What bounds cut off, and caustics, are of no virtual light.
    EachLight {
        /// Number of the first that is asked about.
        first: u32,
        /// How many, at least 1; the set may have fewer.
        count: u32,
    },
    /// What an eye here would see at the points if nothing were before them.
    Towards(Vec3),
}

impl Part {
    /// Irradiances that are answered for each point; none where more, or something else, is answered.
    pub fn irradiances(&self) -> usize {
        match self {
            Self::All | Self::Direct | Self::Indirect => 1,
            Self::DirectOf(groups) => groups.len(),
            Self::EachLight { .. } | Self::Towards(_) => 0,
        }
    }
}

/// How many rays or points a question should have where one takes a thread `micros_each` microseconds: whole blocks.
pub fn points_per_question(micros_each: f64) -> usize {
    let blocks = (QUESTION_MICROS / (micros_each * BLOCK as f64)).round();
    // Also of no number: casts saturate.
    (blocks as usize).clamp(1, POINTS_MAX / BLOCK) * BLOCK
}

/// What a question asks about that the scene does not have: then it is refused as a whole.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Unfit {
    /// A point.
    #[error("point {number} of the question is not in the scene: {absent}")]
    Point {
        /// Its place in the question.
        number: usize,
        /// Why.
        absent: Absent,
    },
    /// A light group.
    #[error("there is no light group {group}, only {count}")]
    Group {
        /// What was named.
        group: u32,
        /// How many there are.
        count: usize,
    },
}

impl Ask {
    /// Looks whether a scene has all that is asked about. `groups` says how many light groups it has.
    ///
    /// # Errors
    /// [`Unfit`] names the first thing that it does not have.
    pub fn check_in(&self, scene: &Scene, groups: impl FnOnce() -> usize) -> Result<(), Unfit> {
        let find = |(number, point): (usize, &SurfacePoint)| match scene.find_point(point) {
            Ok(_) => Ok(()),
            Err(absent) => Err(Unfit::Point { number, absent }),
        };
        match self {
            Self::Tile(_) | Self::Frames(_) | Self::Reference(_) | Self::Lights(_) => Ok(()),
            Self::Rays(rays) => {
                let mut aims =
                    rays.through.iter().enumerate().filter_map(|(number, ray)| Some((number, ray.aim.as_ref()?)));
                aims.try_for_each(find)
            }
            Self::Points(points) => {
                points.at.iter().map(|point| &point.at).enumerate().try_for_each(find)?;
                let Part::DirectOf(asked) = &points.part else { return Ok(()) };
                let count = groups();
                match asked.iter().find(|group| **group as usize >= count) {
                    Some(group) => Err(Unfit::Group { group: *group, count }),
                    None => Ok(()),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn questions_are_whole_blocks_of_some_milliseconds() {
        assert_eq!(points_per_question(4.0), 12 * BLOCK, "1500 points, rounded to whole blocks");
        assert_eq!(points_per_question(1e-9), POINTS_MAX);
        assert_eq!(points_per_question(1e9), BLOCK);
        for strange in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let points = points_per_question(strange);
            assert!(points.is_multiple_of(BLOCK) && (BLOCK..=POINTS_MAX).contains(&points), "{points}");
        }
    }
}
