//! The points of a tile, arranged so that shafts towards them are slim.

use glam::Vec3;

/// Points that many apexes are to be tested against.
pub struct Targets {
    points: Vec<Vec3>,
}

impl Targets {
    /// Arranges points; best are up to 256 of a picture tile.
    pub fn new(points: impl IntoIterator<Item = Vec3>) -> Self {
        Self { points: points.into_iter().collect() }
    }

    /// How many points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The points, in the order given.
    pub fn points(&self) -> impl Iterator<Item = Vec3> + '_ {
        self.points.iter().copied()
    }
}
