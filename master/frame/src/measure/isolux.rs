//! Lines of equal value on a grid: marching squares (Lorensen & Cline 1987, in the plane) between the middles of cells.

use super::Grid;

/// A piece of such a line, both ends on the grid's rectangle, from its origin, in the scene's unit.
pub type Segment = [[f64; 2]; 2];

/// The line where linear interpolation between neighbouring points has a value. Where four of them form a saddle, their
/// mean decides. Nothing is known between points of which one has no value.
pub fn isolines(grid: &Grid, values: &[Option<f64>], level: f64) -> Vec<Segment> {
    let [columns, rows] = grid.counts;
    let mut segments = Vec::new();
    for row in 0..rows.saturating_sub(1) {
        for column in 0..columns.saturating_sub(1) {
            let first = row * columns + column;
            // Once around.
            let corners = [first, first + 1, first + columns + 1, first + columns];
            let known: Vec<([f64; 2], f64)> =
                corners.iter().filter_map(|number| Some((grid.middle(*number), (*values.get(*number)?)?))).collect();
            if let Ok(corners) = <[_; 4]>::try_from(known) {
                square(&corners, level, &mut segments);
            }
        }
    }
    segments
}

fn square(corners: &[([f64; 2], f64); 4], level: f64, segments: &mut Vec<Segment>) {
    let is_above = corners.map(|(_, value)| value >= level);
    // Where the line crosses the side from a corner to the next.
    let crossings: Vec<(usize, [f64; 2])> = (0..4)
        .filter(|side| is_above[*side] != is_above[(side + 1) % 4])
        .map(|side| {
            let (mut low, mut high) = (corners[side], corners[(side + 1) % 4]);
            // The square beyond this side finds the same place, to the bit.
            if low.0 > high.0 {
                std::mem::swap(&mut low, &mut high);
            }
            let ((a, from), (b, to)) = (low, high);
            let share = (level - from) / (to - from);
            (side, [0, 1].map(|axis| a[axis] + (b[axis] - a[axis]) * share))
        })
        .collect();
    match crossings.as_slice() {
        [(_, a), (_, b)] => segments.push([*a, *b]),
        [(_, a), (_, b), (_, c), (_, d)] => {
            let mean = corners.iter().map(|(_, value)| value / 4.0).sum::<f64>();
            // The sides are crossed in order: corner 1 lies between the first two.
            let joins_1 = (mean >= level) != is_above[1];
            segments.extend(if joins_1 { [[*a, *b], [*c, *d]] } else { [[*b, *c], [*d, *a]] });
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn grid(side: usize) -> Grid {
        let axes = [DVec3::X, DVec3::Z];
        Grid { origin: DVec3::ZERO, axes, sides: [side as f64; 2], counts: [side; 2] }
    }

    /// Of a cone, lines are circles.
    #[test]
    fn lines_of_a_cone_are_circles() {
        const LEVEL: f64 = 12.3;
        let grid = grid(41);
        let far = |[x, y]: [f64; 2]| (x - 20.5).hypot(y - 20.5);
        let values: Vec<_> = (0..grid.len()).map(|number| Some(far(grid.middle(number)))).collect();
        let segments = isolines(&grid, &values, LEVEL);
        assert!(segments.iter().flatten().all(|end| (far(*end) - LEVEL).abs() < 0.02), "{segments:?}");
        let length: f64 = segments.iter().map(|[a, b]| (a[0] - b[0]).hypot(a[1] - b[1])).sum();
        assert!((length / (2.0 * LEVEL * std::f64::consts::PI) - 1.0).abs() < 0.01, "{length}");
        // Each end is met by another segment.
        let met = |end: &[f64; 2]| segments.iter().flatten().filter(|other| *other == end).count();
        assert!(segments.iter().flatten().all(|end| met(end) == 2));
    }

    #[test]
    fn a_saddle_is_cut_where_its_middle_says() {
        let grid = grid(2);
        let apart = |middle: f64| {
            let values = [2.0, middle, 2.0, middle].map(Some);
            // Corners in reading order: the two 2s are opposite.
            isolines(&grid, &[values[0], values[1], values[3], values[2]], 1.0)
        };
        for middle in [0.5, -3.0] {
            let segments = apart(middle);
            assert_eq!(segments.len(), 2);
            // Above the mean, the high corners hang together: lines go around the low ones, at (1.5, 0.5) and (0.5, 1.5).
            let around = |corner: [f64; 2]| {
                let far = |[x, y]: [f64; 2]| (x - corner[0]).abs() + (y - corner[1]).abs();
                segments.iter().any(|ends| ends.iter().all(|end| far(*end) <= 1.0 + 1e-12))
            };
            let (low, high) = (around([1.5, 0.5]) && around([0.5, 1.5]), around([0.5, 0.5]) && around([1.5, 1.5]));
            assert_eq!((low, high), if middle > 0.0 { (true, false) } else { (false, true) }, "{segments:?}");
        }
    }

    #[test]
    fn nothing_is_drawn_beside_what_is_unknown() {
        let grid = grid(3);
        let mut values: Vec<_> = (0..9).map(|number| Some(f64::from(number % 3))).collect();
        assert_eq!(isolines(&grid, &values, 0.5).len(), 2);
        values[4] = None;
        assert!(isolines(&grid, &values, 0.5).is_empty());
        assert!(isolines(&grid, &values[..5], 0.5).is_empty());
    }
}
