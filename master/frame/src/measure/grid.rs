//! How many points a grid has, and where they lie.

use glam::DVec3;

/// A rectangle of cells in the scene, a point in the middle of each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// The corner where both coordinates are 0, scene space.
    pub origin: DVec3,
    /// Unit vectors along columns' and rows' numbers, at right angles.
    pub axes: [DVec3; 2],
    /// Lengths of the sides, in the scene's unit.
    pub sides: [f64; 2],
    /// Numbers of columns and rows.
    pub counts: [usize; 2],
}

impl Grid {
    /// How many cells there are.
    pub fn len(&self) -> usize {
        self.counts[0] * self.counts[1]
    }

    /// There is no cell.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Column and row of a cell; they are counted row by row.
    pub fn cell(&self, number: usize) -> [usize; 2] {
        [number % self.counts[0], number / self.counts[0]]
    }

    /// Sides of a cell, in the scene's unit.
    pub fn spacing(&self) -> [f64; 2] {
        [0, 1].map(|axis| self.sides[axis] / self.counts[axis] as f64)
    }

    /// The middle of a cell on the rectangle, from its origin.
    pub fn middle(&self, number: usize) -> [f64; 2] {
        let (cell, spacing) = (self.cell(number), self.spacing());
        [0, 1].map(|axis| (cell[axis] as f64 + 0.5) * spacing[axis])
    }

    /// The middle of a cell, scene space.
    pub fn point(&self, number: usize) -> DVec3 {
        let [a, b] = self.middle(number);
        self.origin + self.axes[0] * a + self.axes[1] * b
    }
}

/// Numbers of columns and rows for an area of these sides, metres, each above 0: EN 12464-1, annex A. The spacing is at
/// most p = 0.2 · 5^(lg d), d being the longer side, or the shorter one where the other is twice as long or more; p is at
/// most 10 m. The nearest whole number of points goes along d, and along the other side as many as make the cells squarest.
pub fn counts(sides: [f64; 2]) -> [usize; 2] {
    let (along, across) = if sides[0] >= sides[1] { (0, 1) } else { (1, 0) };
    let (long, short) = (sides[along], sides[across]);
    let (leading, d) = if long >= 2.0 * short { (across, short) } else { (along, long) };
    let spacing = (0.2 * libm::pow(5.0, libm::log10(d))).min(SPACING_MAX);
    let nearest = |ratio: f64| (ratio.round() as usize).clamp(1, COUNT_MAX);
    let mut counts = [1; 2];
    counts[leading] = nearest(d / spacing);
    let spacing = d / counts[leading] as f64;
    counts[1 - leading] = nearest(sides[1 - leading] / spacing);
    counts
}

/// Metres: EN 12464-1, annex A.
const SPACING_MAX: f64 = 10.0;
/// Most points along a side: no table is longer.
const COUNT_MAX: usize = 1000;

#[cfg(test)]
mod tests {
    use super::*;

    /// Of EN 12464-1, table A.1: length of the area, points; where the table does not round its spacings up.
    #[test]
    fn as_many_points_as_the_norm_has_them() {
        for (length, points) in [(1.0, 5), (2.0, 6), (5.0, 8), (10.0, 10), (100.0, 20)] {
            assert_eq!(counts([length, length]), [points; 2], "{length} m");
        }
    }

    #[test]
    fn cells_are_about_square_whichever_side_is_longer() {
        for sides in [[6.0, 4.0], [4.0, 6.0], [30.0, 2.5], [0.8, 12.0], [1e5, 1e5], [1e-3, 1e-3]] {
            let [columns, rows] = counts(sides);
            let cell = [sides[0] / columns as f64, sides[1] / rows as f64];
            assert!((0.6..1.7).contains(&(cell[0] / cell[1])), "{sides:?}: {cell:?}");
        }
        assert_eq!(counts([30.0, 2.5])[1], counts([2.5, 2.5])[1], "of a corridor, the width decides");
        assert_eq!(counts([1e9, 1.0])[0], COUNT_MAX);
    }

    #[test]
    fn points_lie_in_the_middle_of_cells() {
        let grid = Grid { origin: DVec3::X, axes: [DVec3::X, DVec3::Z], sides: [4.0, 3.0], counts: [2, 3] };
        assert_eq!((grid.len(), grid.cell(3)), (6, [1, 1]));
        assert_eq!(grid.point(3), DVec3::new(4.0, 0.0, 1.5));
    }
}
