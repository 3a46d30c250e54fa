//! Plots on logarithmic axes, as SVG.

use std::ops::Range;

use anyhow::anyhow;
use frame::metrics::Decomposition;
use plotters::prelude::*;

use super::judgement::Series;
use super::record::View;

/// Error against time: every curve with its intervals, the law fitted to its last decade (dashed), and the
/// reference's own noise (grey).
///
/// # Errors
/// If the plotting library fails.
pub fn error_plot(series: &[Series], floor: Option<f64>, seconds: &str) -> anyhow::Result<String> {
    let colours = colours(series);
    let curves: Vec<Curve> =
        series.iter().zip(colours).map(|(series, colour)| error_curve(series, colour, floor)).collect();
    draw(&curves, floor, &Axes { y: "relMSE", ..Axes::of_errors(seconds) })
}

/// Noise and bias apart, of the raw pictures: variance as a line, bias² dashed with its interval.
///
/// # Errors
/// If the plotting library fails.
pub fn parts_plot(series: &[Series], seconds: &str) -> anyhow::Result<String> {
    let each = series.iter().zip(colours(series)).filter(|(series, _)| series.view == View::Raw);
    let curves: Vec<Curve> = each.flat_map(|(series, colour)| parts_curves(series, colour)).collect();
    draw(&curves, None, &Axes { y: "part of relMSE", ..Axes::of_errors(seconds) })
}

/// A line to draw.
pub(crate) struct Curve {
    pub(crate) label: String,
    pub(crate) colour: RGBColor,
    pub(crate) is_dashed: bool,
    pub(crate) is_bold: bool,
    /// Time (or what else is drawn to the right), value, lower and upper end.
    pub(crate) points: Vec<[f64; 4]>,
    /// A dashed line beside it.
    pub(crate) guide: Vec<(f64, f64)>,
}

/// What the axes say, and where the legend is.
pub(crate) struct Axes<'a> {
    pub(crate) x: &'a str,
    pub(crate) y: &'a str,
    /// How values are written.
    pub(crate) value: fn(f64) -> String,
    pub(crate) legend: SeriesLabelPosition,
}

impl<'a> Axes<'a> {
    fn of_errors(seconds: &'a str) -> Self {
        Self { x: seconds, y: "", value: |value| format!("{value:.0e}"), legend: SeriesLabelPosition::UpperRight }
    }
}

fn error_curve(series: &Series, colour: RGBColor, floor: Option<f64>) -> Curve {
    let slope = series.slope.map(|(law, _)| format!("  slope {:.2} ({:.0})", law.slope, series.expected));
    let last = series.points.last().map_or(0.0, |point| point.samples);
    let decade = series.points.iter().filter(|point| point.samples >= last / 10.5);
    let guide = series
        .slope
        .map(|(law, _)| decade.map(|point| (point.seconds, law.at(point.samples) + floor.unwrap_or(0.0))).collect());
    let points = series.points.iter().map(|point| {
        let error = point.rel_mse;
        [point.seconds, error.value, error.low, error.high]
    });
    Curve {
        label: format!("{}{}", series.name, slope.unwrap_or_default()),
        colour,
        is_dashed: false,
        is_bold: series.view == View::Shown || series.is_rival,
        points: points.collect(),
        guide: guide.unwrap_or_default(),
    }
}

fn parts_curves(series: &Series, colour: RGBColor) -> [Curve; 2] {
    let parts = || series.points.iter().filter_map(|point| Some((point.seconds, point.parts?)));
    let variance = parts().map(|(x, p)| [x, p.variance.value, p.variance.low, p.variance.high]);
    // A line only where it is above 0 beyond chance; elsewhere the upper end says all there is to say.
    let seen = |p: &Decomposition| if p.bias2.low > 0.0 { p.bias2.value } else { f64::NAN };
    let bias2 = parts().map(|(x, p)| [x, seen(&p), p.bias2.low, p.bias2.high]);
    let curve = |label: String, is_dashed: bool, points: Vec<[f64; 4]>| Curve {
        label,
        colour,
        is_dashed,
        is_bold: !is_dashed,
        points,
        guide: Vec::new(),
    };
    [
        curve(format!("{}: variance", series.name), false, variance.collect()),
        curve(format!("{}: bias²", series.name), true, bias2.collect()),
    ]
}

/// A colour for each method, the same for all its views.
fn colours(series: &[Series]) -> Vec<RGBColor> {
    let base = |series: &Series| series.name.trim_end_matches(" raw").to_string();
    let mut names: Vec<String> = Vec::new();
    for one in series {
        if !names.contains(&base(one)) {
            names.push(base(one));
        }
    }
    let number = |one: &Series| names.iter().position(|name| *name == base(one)).unwrap_or(0);
    series.iter().map(|one| PALETTE[number(one) % PALETTE.len()]).collect()
}

/// All curves on logarithmic axes.
///
/// # Errors
/// If the plotting library fails.
pub(crate) fn draw(curves: &[Curve], floor: Option<f64>, axes: &Axes) -> anyhow::Result<String> {
    let mut svg = String::new();
    drawn(curves, floor, axes, &mut svg).map_err(|error| anyhow!("a plot cannot be drawn: {error}"))?;
    Ok(svg)
}

fn drawn(
    curves: &[Curve],
    floor: Option<f64>,
    axes: &Axes,
    svg: &mut String,
) -> Result<(), Box<dyn std::error::Error>> {
    let points = || curves.iter().flat_map(|curve| &curve.points);
    let times = around(points().map(|[time, ..]| *time), 1.3);
    let values = around(points().map(|[_, value, ..]| *value).chain(floor), 2.0);
    let root = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d(times.clone().log_scale(), values.clone().log_scale())?;
    chart
        .configure_mesh()
        .x_desc(axes.x)
        .y_desc(axes.y)
        .x_label_formatter(&|time| super::tables::short(*time))
        .y_label_formatter(&|value| (axes.value)(*value))
        .label_style((FONT, 13))
        .axis_desc_style((FONT, 14))
        .bold_line_style(RGBColor(215, 215, 215))
        .light_line_style(RGBColor(240, 240, 240))
        .draw()?;
    if let Some(floor) = floor {
        let line = DashedLineSeries::new([(times.start, floor), (times.end, floor)], 8, 4, GREY.stroke_width(2));
        chart.draw_series(line)?.label("noise of the reference").legend(|(x, y)| key(x, y, GREY, true));
    }
    let inside = |value: f64| value.clamp(values.start, values.end);
    for curve in curves {
        let colour = curve.colour;
        let width = if curve.is_bold { 2 } else { 1 };
        let seen = || curve.points.iter().filter(|[time, value, ..]| *time > 0.0 && *value > 0.0);
        for [time, _, low, high] in curve.points.iter().filter(|[time, .., high]| *time > 0.0 && *high > 0.0) {
            // An interval that reaches down to 0 has only an upper end worth drawing: a short mark.
            let low = if *low > 0.0 { inside(*low) } else { inside(*high * 0.9) };
            let bar = vec![(*time, low), (*time, inside(*high))];
            chart.draw_series([PathElement::new(bar, colour.mix(0.35).stroke_width(3))])?;
        }
        let line = seen().map(|[time, value, ..]| (*time, *value));
        let drawn = if curve.is_dashed {
            chart.draw_series(DashedLineSeries::new(line, 3, 4, colour.stroke_width(width)))?
        } else {
            chart.draw_series(LineSeries::new(line, colour.stroke_width(width)))?
        };
        let is_dashed = curve.is_dashed;
        drawn.label(&curve.label).legend(move |(x, y)| key(x, y, colour, is_dashed));
        let dots = seen().map(|[time, value, ..]| {
            let style = if curve.is_bold { colour.filled() } else { colour.stroke_width(1) };
            Circle::new((*time, *value), 3, style)
        });
        chart.draw_series(dots)?;
        if curve.guide.len() > 1 {
            let guide = curve.guide.iter().map(|(time, value)| (*time, inside(*value)));
            chart.draw_series(DashedLineSeries::new(guide, 6, 5, BLACK.mix(0.6).stroke_width(1)))?;
        }
    }
    chart
        .configure_series_labels()
        .position(axes.legend.clone())
        .label_font((FONT, 13))
        .background_style(WHITE.mix(0.85))
        .border_style(RGBColor(200, 200, 200))
        .draw()?;
    root.present()?;
    Ok(())
}

/// A short line for the legend.
fn key(x: i32, y: i32, colour: RGBColor, is_dashed: bool) -> PathElement<(i32, i32)> {
    let end = if is_dashed { x + 8 } else { x + 18 };
    PathElement::new(vec![(x, y), (end, y)], colour.stroke_width(2))
}

/// A range around all values above 0, with so much room on both sides.
fn around(values: impl Iterator<Item = f64>, room: f64) -> Range<f64> {
    let seen = values.filter(|value| value.is_finite() && *value > 0.0);
    let (low, high) = seen.fold((f64::INFINITY, 0.0_f64), |(low, high), value| (low.min(value), high.max(value)));
    if low <= high { low / room..high * room } else { 0.1..10.0 }
}

/// Okabe and Ito's colours, which most people can tell apart.
pub(crate) const PALETTE: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(90, 90, 90),
];
const GREY: RGBColor = RGBColor(150, 150, 150);
const FONT: &str = "sans-serif";
const SIZE: (u32, u32) = (820, 520);
