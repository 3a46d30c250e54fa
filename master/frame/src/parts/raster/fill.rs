//! Which pixels of a band of rows a facet covers, and whether it is the nearest there.

use scenes::Scene;

use super::facet::Facet;
use super::project::SUBPIXELS;

/// Rows that one thread fills at a time.
pub(super) const BAND_ROWS: usize = 16;

/// Some rows of the picture.
pub(super) struct Band<'a> {
    pub first_row: usize,
    /// Pixels in a row.
    pub width: usize,
    pub inverse_depths: &'a mut [f32],
    pub seen: &'a mut [u32],
}

/// One edge of a facet: 0 or more on its inside.
#[derive(Clone, Copy)]
struct Edge {
    /// From a pixel to the next one, and to the next row.
    across: i64,
    down: i64,
    /// At the middle of the pixel in column 0 and row 0.
    first: i64,
    /// One over `across`, about.
    by_across: f64,
}

impl Edge {
    fn between([x0, y0]: [i32; 2], [x1, y1]: [i32; 2]) -> Self {
        let [x0, y0, x1, y1] = [x0, y0, x1, y1].map(i64::from);
        let (dx, dy) = (x1 - x0, y1 - y0);
        let middle = i64::from(SUBPIXELS / 2);
        let first = dx * (middle - y0) - dy * (middle - x0);
        // A middle that lies on an edge belongs to the facet on its right, or below.
        let has_middles = dy < 0 || dy == 0 && dx > 0;
        let (across, down) = (-dy * i64::from(SUBPIXELS), dx * i64::from(SUBPIXELS));
        Self { across, down, first: first - i64::from(!has_middles), by_across: 1.0 / across as f64 }
    }

    /// Those of some columns of a row that are inside of it; the last before the first if none is.
    #[inline]
    fn narrow(&self, [left, right]: [i32; 2], y: i32) -> [i32; 2] {
        let at = self.first + self.across * i64::from(left) + self.down * i64::from(y);
        if (at >= 0) == (self.across >= 0) {
            return if at >= 0 { [left, right] } else { [left, left - 1] };
        }
        // It is crossed so many pixels from the left: as a quotient of rounded numbers says, and whole ones after it.
        let guess = -(at as f64) * self.by_across;
        let count = right - left + 1;
        let mut steps = if guess < f64::from(count) { guess as i64 } else { i64::from(count) };
        let is_inside = |steps: i64| at + self.across * steps >= 0;
        let inside_first = at >= 0;
        while steps < i64::from(count) && is_inside(steps) == inside_first {
            steps += 1;
        }
        while steps > 0 && is_inside(steps - 1) != inside_first {
            steps -= 1;
        }
        let steps = steps as i32;
        if inside_first { [left, left + steps - 1] } else { [left + steps, right] }
    }
}

impl Band<'_> {
    /// Shows the facet where it is nearer than what was shown before.
    pub fn fill(&mut self, scene: &Scene, number: u32, facet: &Facet) {
        let [a, b, c] = facet.corners;
        let edges = [Edge::between(a, b), Edge::between(b, c), Edge::between(c, a)];
        let rows = self.inverse_depths.len() / self.width;
        let first = facet.rows[0].max(self.first_row as i32);
        let last = facet.rows[1].min((self.first_row + rows) as i32 - 1);
        for y in first..=last {
            let mut columns = facet.columns;
            for edge in &edges {
                if columns[0] <= columns[1] {
                    columns = edge.narrow(columns, y);
                }
            }
            if columns[0] <= columns[1] {
                self.show(columns, y, scene, (number, facet));
            }
        }
    }

    /// Columns of a row that the facet covers.
    fn show(&mut self, [left, right]: [i32; 2], y: i32, scene: &Scene, (number, facet): (u32, &Facet)) {
        let start = (y as usize - self.first_row) * self.width;
        let pixels = start + left as usize..start + right as usize + 1;
        let depths = self.inverse_depths[pixels.clone()].iter_mut();
        let here = (left..).zip(depths.zip(&mut self.seen[pixels]));
        let middle = f64::from(y) + 0.5;
        let [a, b, c] = facet.inverse_depth;
        let row = b * middle + c;
        let [low, high] = facet.inverse_depths;
        if facet.has_holes {
            for (x, (depth, seen)) in here {
                let x = f64::from(x) + 0.5;
                let new = within((a * x + row) as f32, low, high);
                if new > *depth && facet.is_there(scene, x, middle) {
                    (*depth, *seen) = (new, number);
                }
            }
            return;
        }
        // Without a branch, so that several pixels are done at a time.
        for (x, (depth, seen)) in here {
            let new = within((a * (f64::from(x) + 0.5) + row) as f32, low, high);
            let is_nearer = new > *depth;
            *depth = if is_nearer { new } else { *depth };
            *seen = if is_nearer { number } else { *seen };
        }
    }
}

/// As `clamp`, in two instructions.
#[inline(always)]
fn within(value: f32, low: f32, high: f32) -> f32 {
    let value = if value > low { value } else { low };
    if value < high { value } else { high }
}
