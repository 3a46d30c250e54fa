//! A plan in false colours with its isolux lines, as pixels.

use frame::measure::{Grid, between, isolines};
use frame::tone::Image8;

use super::{Sheet, spoken};
use runtime::display::paint::{Legend, Ramp, Scale};
use runtime::display::saved::with_caption;
use runtime::display::short_number;
use runtime::files::encode_png;

/// Where nothing is measured.
const NOTHING: [u8; 3] = [225; 3];
const LINE: [u8; 3] = [255; 3];
/// Pixels that the longer side should have, and the fewest and most of a cell's side.
const SIDE: f64 = 900.0;
const CELL: [f64; 2] = [4.0, 90.0];

/// The file: the plan, and below it what its colours mean, and the figures.
pub(super) fn png(sheet: &Sheet) -> anyhow::Result<Vec<u8>> {
    let mut image = plan(sheet);
    let scale = pixels_per_unit(&sheet.plan.grid);
    for level in levels(sheet) {
        for segment in isolines(&sheet.plan.grid, &means(sheet), level) {
            let ends = segment.map(|end| on_paper(sheet, end).map(|at| at * scale));
            line(&mut image, ends);
        }
    }
    let [from, to] = sheet.scale.map(|value| value as f32);
    let scale = Scale { unit: "lx", from, to, logarithmic: true, ramp: Ramp::Turbo };
    let title = format!("illuminance, {}; lines at {} lx", sheet.title, listed(&levels(sheet)));
    let figures = &sheet.figures;
    let mut said = format!(
        "Emin {}, Eavg {}, Emax {}, Uo = Emin/Eavg {}",
        spoken(figures.min, " lx"),
        spoken(figures.average, " lx"),
        spoken(figures.max, " lx"),
        spoken(figures.uniformity, "")
    )
    .replace('±', "+-");
    if sheet.plan.buried > 0 {
        said += &format!("; {} points left out (grey)", sheet.plan.buried);
    }
    encode_png(&with_caption(image, Some(&Legend { title, scale: Some(scale) }), Some(&said)))
}

/// What of the grid was not measured, if anything.
pub(super) fn left_out(sheet: &Sheet) -> Option<String> {
    let count = sheet.plan.buried;
    let points = if count == 1 { "point" } else { "points" };
    (count > 0).then(|| format!("{count} {points} within furniture or right under something, drawn in grey"))
}

/// The steps that have a line. Below the first colour, towards the dark, there would be no end of them.
pub(super) fn levels(sheet: &Sheet) -> Vec<f64> {
    between([sheet.figures.min.value.max(sheet.scale[0]), sheet.figures.max.value])
}

/// Round numbers in a row.
pub(super) fn listed(levels: &[f64]) -> String {
    levels.iter().map(|level| short_number(*level as f32)).collect::<Vec<_>>().join(", ")
}

/// Illuminances, lx.
pub(super) fn means(sheet: &Sheet) -> Vec<Option<f64>> {
    sheet.values.iter().map(|value| value.map(|value| value.value)).collect()
}

/// Where a place of the grid is on paper, from the upper left corner, in the scene's unit.
pub(super) fn on_paper(sheet: &Sheet, [x, y]: [f64; 2]) -> [f64; 2] {
    [x, if sheet.plan.rises { sheet.plan.grid.sides[1] - y } else { y }]
}

/// The colour of an illuminance: equal steps are equal factors.
pub(super) fn colour(scale: [f64; 2], lux: f64) -> [u8; 3] {
    let share = (lux.max(f64::MIN_POSITIVE) / scale[0]).ln() / (scale[1] / scale[0]).ln();
    Ramp::Turbo.at(share as f32)
}

/// The colours alone, linear between points; as a cell's own where a neighbour is not measured.
pub(super) fn plan(sheet: &Sheet) -> Image8 {
    let grid = &sheet.plan.grid;
    let scale = pixels_per_unit(grid);
    let [width, height] = grid.sides.map(|side| ((side * scale).round() as u32).max(1));
    let values = means(sheet);
    let pixel = |x: u32, y: u32| {
        let [a, b] = on_paper(sheet, [x, y].map(|at| (f64::from(at) + 0.5) / scale));
        between_points(grid, &values, [a, b]).map_or(NOTHING, |lux| colour(sheet.scale, lux))
    };
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| [x, y])).map(|[x, y]| pixel(x, y)).collect();
    Image8 { width, height, pixels }
}

fn pixels_per_unit(grid: &Grid) -> f64 {
    let longest = grid.sides[0].max(grid.sides[1]);
    let [a, b] = grid.spacing();
    let wanted = SIDE / longest;
    // However many or few the cells.
    (wanted * a.min(b)).clamp(CELL[0], CELL[1]) / a.min(b)
}

fn between_points(grid: &Grid, values: &[Option<f64>], place: [f64; 2]) -> Option<f64> {
    let spacing = grid.spacing();
    let at = [0, 1].map(|axis| place[axis] / spacing[axis] - 0.5);
    let most = grid.counts.map(|count| (count - 1) as f64);
    let value = |x: f64, y: f64| {
        let [column, row] = [x.clamp(0.0, most[0]), y.clamp(0.0, most[1])];
        values[row as usize * grid.counts[0] + column as usize]
    };
    let own = value(at[0].round(), at[1].round())?;
    let [x, y] = at.map(f64::floor);
    let [s, t] = [at[0] - x, at[1] - y];
    let corners = [value(x, y), value(x + 1.0, y), value(x, y + 1.0), value(x + 1.0, y + 1.0)];
    let [Some(a), Some(b), Some(c), Some(d)] = corners else { return Some(own) };
    Some((a * (1.0 - s) + b * s) * (1.0 - t) + (c * (1.0 - s) + d * s) * t)
}

/// A line of a pixel's width, by its ends in pixels.
fn line(image: &mut Image8, [from, to]: [[f64; 2]; 2]) {
    let steps = (to[0] - from[0]).abs().max((to[1] - from[1]).abs()).ceil().max(1.0) as u32;
    for step in 0..=steps {
        let share = f64::from(step) / f64::from(steps);
        let [x, y] = [0, 1].map(|axis| (from[axis] + (to[axis] - from[axis]) * share) as u32);
        if x < image.width && y < image.height {
            image.pixels[(y * image.width + x) as usize] = LINE;
        }
    }
}
