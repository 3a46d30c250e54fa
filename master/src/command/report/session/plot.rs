//! Errors against time, as SVG: time is linear, errors are logarithmic.

use anyhow::anyhow;
use plotters::prelude::*;

use super::judge::{Judged, Point};
use crate::command::report::plot::PALETTE;
use crate::command::report::tables::short;

/// One curve a play: a method has one colour, and is dashed in real time.
///
/// # Errors
/// If the plotting library fails.
pub(super) fn over_time(judged: &[Judged], what: &str, value: fn(&Point) -> f64) -> anyhow::Result<String> {
    let mut svg = String::new();
    drawn(judged, what, value, &mut svg).map_err(|error| anyhow!("a plot cannot be drawn: {error}"))?;
    Ok(svg)
}

fn drawn(
    judged: &[Judged],
    what: &str,
    value: fn(&Point) -> f64,
    svg: &mut String,
) -> Result<(), Box<dyn std::error::Error>> {
    let points = || judged.iter().flat_map(|judged| &judged.points);
    let last = points().map(|point| point.t).fold(0.1, f64::max);
    let seen = points().map(value).filter(|value| value.is_finite() && *value > 0.0);
    let (low, high) = seen.fold((f64::INFINITY, 0.0_f64), |(low, high), value| (low.min(value), high.max(value)));
    let (low, high) = if low <= high { (low / 1.3, high * 1.3) } else { (0.01, 1.0) };
    let root = SVGBackend::with_string(svg, (820, 420)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d(0.0..last * 1.02, (low..high).log_scale())?;
    chart
        .configure_mesh()
        .x_desc("seconds of the recording")
        .y_desc(what)
        .y_label_formatter(&|value| short(*value))
        .label_style(("sans-serif", 13))
        .axis_desc_style(("sans-serif", 14))
        .light_line_style(RGBColor(240, 240, 240))
        .draw()?;
    let names: Vec<&str> = judged.iter().map(|judged| judged.play.method.as_str()).collect();
    for one in judged {
        let number = names.iter().position(|name| *name == one.play.method).unwrap_or(0);
        let colour = PALETTE[names[..number].iter().collect::<std::collections::BTreeSet<_>>().len() % PALETTE.len()];
        let is_dashed = one.play.latency.is_some();
        let line = one.points.iter().map(|point| (point.t, value(point))).filter(|(_, value)| *value > 0.0);
        let drawn = match is_dashed {
            true => chart.draw_series(DashedLineSeries::new(line, 4, 4, colour.stroke_width(2)))?,
            false => chart.draw_series(LineSeries::new(line, colour.stroke_width(2)))?,
        };
        drawn.label(format!("{}, {}", one.play.method, one.play.mode)).legend(move |(x, y)| {
            PathElement::new(vec![(x, y), (if is_dashed { x + 8 } else { x + 18 }, y)], colour.stroke_width(2))
        });
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .label_font(("sans-serif", 13))
        .background_style(WHITE.mix(0.85))
        .border_style(RGBColor(200, 200, 200))
        .draw()?;
    root.present()?;
    Ok(())
}
