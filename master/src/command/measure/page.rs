//! The report: a page that needs nothing but itself, made to be printed.

use std::fmt::Write;

use frame::measure::isolines;

use super::drawing::{self, colour, levels, means, on_paper};
use super::glare::Glare;
use super::view::View;
use super::{Sheet, spoken, tables};
use crate::command::report::page::{escaped, opening, table};
use crate::command::report::strip::address;
use runtime::display::short_number;

/// The whole page. `unit` says what lux and candela are of, in words.
///
/// # Errors
/// A picture cannot be encoded.
pub(super) fn page(
    scene: &str,
    (sheet, view, glare): (Option<&Sheet>, Option<&View>, Option<&Glare>),
    unit: &str,
) -> anyhow::Result<String> {
    let mut html = opening(&format!("Light in {}", escaped(scene)));
    let _ = writeln!(html, "<style>{}</style>", include_str!("page.css"));
    if let Some(sheet) = sheet {
        html += &grid(sheet)?;
    }
    if let Some(view) = view {
        let [min, mean, max] = view.figures().map(|value| short_number(value as f32));
        let _ = writeln!(
            html,
            "<h2>Luminance of the view</h2>\n<figure><img alt=\"luminances in false colours\" src=\"{}\"></figure>\n\
             <p>Least {min}, mean {mean}, greatest {max} cd/m².</p>\n<p class=\"faint\">{}.</p>",
            address(&view.image())?,
            escaped(&view.method)
        );
    }
    if let Some(glare) = glare {
        let [rating, of] = glare.said();
        let _ = writeln!(
            html,
            "<h2>Glare of the view</h2>\n<p>{}</p>\n<p class=\"faint\">{}.</p>",
            escaped(&rating),
            escaped(&of)
        );
    }
    let _ = writeln!(
        html,
        "<p class=\"faint\">Light is in {}. Made by igi {}.</p>\n</body></html>",
        escaped(unit),
        env!("CARGO_PKG_VERSION")
    );
    Ok(html)
}

fn grid(sheet: &Sheet) -> anyhow::Result<String> {
    let Sheet { plan, figures, values, title, method, .. } = sheet;
    let mut html = format!("<h2>Illuminance: {}</h2>\n<figure>{}</figure>\n", escaped(title), drawn(sheet)?);
    let header = ["", "value", "within (95 %)"].map(str::to_owned).to_vec();
    let row = |(name, figure, unit): (&str, frame::measure::Measured, &str)| {
        let number = |value: f64| format!("{}{unit}", short_number(value as f32));
        vec![name.to_owned(), number(figure.value), number(figure.within)]
    };
    let rows: Vec<_> = [header].into_iter().chain(tables::named(figures).map(row)).collect();
    html += &table("Figures", &rows);
    let metres = |lengths: [f64; 2]| lengths.map(|length| format!("{:.2}", length * plan.metre)).join(" × ");
    let [columns, rows] = plan.grid.counts;
    let facts = [
        ("Area", format!("{} m", metres(plan.grid.sides))),
        (
            "Grid",
            format!(
                "{columns} × {rows}, {} points, {} m apart",
                values.iter().flatten().count(),
                metres(plan.grid.spacing())
            ),
        ),
        ("Rule", "EN 12464-1, annex A: p = 0.2 · 5^lg d".to_owned()),
        ("Isolux lines", format!("{} lx", drawing::listed(&levels(sheet)))),
        ("Measured by", method.clone()),
    ];
    html += "<dl>";
    let facts = facts.into_iter().chain(drawing::left_out(sheet).map(|said| ("Left out", said)));
    facts.for_each(|(name, fact)| _ = write!(html, "<dt>{name}</dt><dd>{}</dd>", escaped(&fact)));
    html += "</dl>\n";
    Ok(html)
}

/// Width of the drawing, and of the strip for the legend beside it, in its own unit.
const WIDTH: f64 = 760.0;
const LEGEND: f64 = 110.0;
/// More points than these have no numbers of their own in the drawing.
const NUMBERS_MAX: usize = 400;
/// Steps of the legend's colours.
const STEPS: u32 = 48;

/// Colours, isolux lines with their illuminances, points with theirs, and the legend.
fn drawn(sheet: &Sheet) -> anyhow::Result<String> {
    let grid = &sheet.plan.grid;
    let scale = WIDTH / grid.sides[0].max(grid.sides[1]);
    let [width, height] = grid.sides.map(|side| side * scale);
    let tall = height.max(220.0);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {:.0} {tall:.0}\" width=\"{:.0}\" role=\"img\" \
         aria-label=\"illuminance in false colours\" font-family=\"system-ui, sans-serif\" font-size=\"11\">",
        width + LEGEND,
        width + LEGEND
    );
    let _ = write!(
        svg,
        "<image href=\"{}\" width=\"{width:.2}\" height=\"{height:.2}\" preserveAspectRatio=\"none\"/>",
        address(&drawing::plan(sheet))?
    );
    let values = means(sheet);
    let at = |place: [f64; 2]| on_paper(sheet, place).map(|at| at * scale);
    for level in levels(sheet) {
        let mut path = String::new();
        let segments = isolines(grid, &values, level);
        for [[a, b], [c, d]] in segments.iter().map(|segment| segment.map(at)) {
            let _ = write!(path, "M{a:.1} {b:.1}L{c:.1} {d:.1}");
        }
        let _ = write!(svg, "<path d=\"{path}\" stroke=\"#fff\" stroke-width=\"1.4\" fill=\"none\"/>");
        if let Some([x, y]) = segments.get(segments.len() / 2).map(|segment| at(segment[0])) {
            let _ = write!(
                svg,
                "<text x=\"{x:.1}\" y=\"{y:.1}\" {HALO} font-weight=\"700\">{}</text>",
                short_number(level as f32)
            );
        }
    }
    let points = sheet.values.iter().enumerate().filter_map(|(number, value)| Some((number, value.as_ref()?)));
    if sheet.values.iter().flatten().count() <= NUMBERS_MAX {
        let size = (0.28 * grid.spacing()[0] * scale).clamp(5.0, 11.0);
        for (number, value) in points {
            let [x, y] = at(grid.middle(number));
            let text = short_number(value.value as f32);
            let _ = write!(
                svg,
                "<text x=\"{x:.1}\" y=\"{y:.1}\" {HALO} font-size=\"{size:.1}\"><title>{}</title>{text}</text>",
                spoken(*value, " lx")
            );
        }
    }
    svg += &legend(sheet.scale, width + 24.0);
    Ok(svg + "</svg>")
}

/// Black on any ground.
const HALO: &str = "text-anchor=\"middle\" dominant-baseline=\"middle\" fill=\"#000\" stroke=\"#fff\" stroke-width=\"2.5\" \
                    paint-order=\"stroke\"";

/// A column of colours with round numbers.
fn legend(scale: [f64; 2], x: f64) -> String {
    let (top, height) = (14.0, 190.0);
    let step = height / f64::from(STEPS);
    let mut svg = String::new();
    for number in 0..STEPS {
        let share = (f64::from(number) + 0.5) / f64::from(STEPS);
        let [r, g, b] = colour(scale, scale[0] * (scale[1] / scale[0]).powf(share));
        let y = top + height - step * f64::from(number + 1);
        let _ = write!(
            svg,
            "<rect x=\"{x:.1}\" y=\"{y:.2}\" width=\"16\" height=\"{:.2}\" fill=\"rgb({r},{g},{b})\"/>",
            step + 0.3
        );
    }
    let [low, high] = scale;
    let mut marks = vec![low];
    marks.extend(frame::measure::between(scale));
    marks.push(high);
    // Where many steps fit, every one would not.
    let every = marks.len().div_ceil(12);
    for mark in marks.iter().step_by(every) {
        let share = (mark / low).ln() / (high / low).ln();
        let y = top + height * (1.0 - share);
        let _ = write!(
            svg,
            "<text x=\"{:.1}\" y=\"{y:.1}\" dominant-baseline=\"middle\">{} lx</text>",
            x + 22.0,
            short_number(*mark as f32)
        );
    }
    svg
}

#[cfg(test)]
mod tests {
    use frame::measure::{Grid, Measured, Plan, Tally};
    use glam::DVec3;

    use super::*;

    /// Illuminance that doubles from column to column, with a point missing.
    fn sheet() -> Sheet {
        let grid = Grid { origin: DVec3::ZERO, axes: [DVec3::X, DVec3::Z], sides: [4.0, 2.0], counts: [4, 2] };
        let mut points = vec![Some(scenes::SurfacePoint::default()); 8];
        points[7] = None;
        let lux = |number: usize| 100.0 * f64::from(1 << (number % 4));
        let mut tally = Tally::new(7, 4);
        (0..4).for_each(|replicate| tally.add(replicate, (0..7).map(lux)));
        let values = (0..8).map(|number| (number < 7).then(|| Measured { value: lux(number), within: 1.0 })).collect();
        let (title, method) = ("<desk>".to_owned(), "by hand".to_owned());
        let plan = Plan { grid, metre: 1.0, points, buried: 1, rises: false };
        Sheet { plan, values, figures: tally.figures().unwrap(), scale: [100.0, 1000.0], title, method }
    }

    #[test]
    fn the_page_says_every_figure_and_draws_every_point() {
        let html = page("room & hall", (Some(&sheet()), None, None), "watts").unwrap();
        for word in [
            "room &amp; hall",
            "&lt;desk&gt;",
            "100 lx",
            "800 lx",
            "Uo = Emin/Eavg",
            "7 points",
            "1 point within furniture",
            "150, 200, 300, 500, 750 lx",
        ] {
            assert!(html.contains(word), "{word}");
        }
        assert_eq!(html.matches("<title>").count(), 8, "that of the page, and of each point");
        assert_eq!(html.matches("<svg").count(), html.matches("</svg>").count());
    }

    #[test]
    fn a_point_in_the_dark_brings_no_lines_without_end() {
        let mut sheet = sheet();
        sheet.figures.min.value = 0.0;
        assert_eq!(levels(&sheet), [150.0, 200.0, 300.0, 500.0, 750.0]);
    }

    #[test]
    fn the_table_has_a_line_for_every_point() {
        let csv = tables::csv(&sheet());
        assert_eq!(csv.lines().filter(|line| line.starts_with(char::is_numeric)).count(), 7, "{csv}");
        assert!(csv.contains("# left out: 1 point within furniture"), "{csv}");
        assert!(csv.contains("\n3,0,3.5000,0.5000,800,1\n"), "{csv}");
    }

    #[test]
    fn colours_are_of_a_fixed_scale_and_what_is_not_measured_is_grey() {
        let image = drawing::plan(&sheet());
        let at = |x: f64, y: f64| {
            let [x, y] = [(x * f64::from(image.width)) as u32, (y * f64::from(image.height)) as u32];
            image.pixels[(y * image.width + x) as usize]
        };
        let off = |a: [u8; 3], b: [u8; 3]| (0..3).map(|i| a[i].abs_diff(b[i])).max();
        assert!(off(at(0.125, 0.25), colour([100.0, 1000.0], 100.0)) < Some(8));
        assert_eq!(at(0.99, 0.99), [225; 3]);
        assert!(drawing::png(&sheet()).unwrap().starts_with(&[0x89, b'P']));
    }
}
