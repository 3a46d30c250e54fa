//! Tables: the errors at equal time, the times to equal error, and what it cost.

use frame::metrics::{Interval, time_to};

use super::judgement::{Point, Series};

/// A table as rows of words, the first row its heading.
pub type Table = Vec<Vec<String>>;

/// Errors at one mark.
pub fn equal_time(series: &[Series], mark: usize) -> Table {
    let heading = ["method", "samples", "relMSE", "95 %", "worst run", "RMSE", "SMAPE", "FLIP", "99.9 %", "runs"];
    let row = |series: &Series, point: &Point| {
        vec![
            series.name.clone(),
            short(point.samples),
            short(point.rel_mse.value),
            range(point.rel_mse),
            short(point.worst),
            short(point.rmse),
            short(point.smape),
            format!("{:.3}", point.flip),
            short(point.percentile_999),
            point.runs.to_string(),
        ]
    };
    let rows = series.iter().filter_map(|series| Some(row(series, series.marks.get(mark)?.as_ref()?)));
    with_heading(&heading, rows)
}

/// Seconds until the error is below some levels, and the product of error and time.
pub fn equal_error(series: &[Series]) -> Table {
    let mut heading = vec!["method".to_string()];
    heading.extend(LEVELS.map(|level| format!("s to {level}")));
    heading.push("error × s at the end".to_string());
    let row = |series: &Series| {
        let curve = series.curve();
        let mut row = vec![series.name.clone()];
        row.extend(LEVELS.map(|level| time_to(&curve, level).map_or("–".to_string(), short)));
        row.push(series.last().map_or("–".to_string(), |point| short(point.rel_mse.value * point.seconds)));
        row
    };
    std::iter::once(heading).chain(series.iter().map(row)).collect()
}

/// What a sample costs, at the end of the runs.
pub fn costs(series: &[Series], preparations: &[(String, f64)]) -> Table {
    let heading = [
        "method",
        "preparation s",
        "samples/s",
        "CPU s per wall s",
        "eye rays",
        "shadow rays",
        "light rays",
        "compensation rays",
        "photon queries",
        "bytes",
    ];
    let rows = preparations.iter().filter_map(|(name, preparation)| {
        let point = series.iter().find(|series| series.name == *name)?.last()?;
        let per_sample = |count: u64| if count == 0 { "–".into() } else { short(count as f64 / point.samples) };
        Some(vec![
            name.clone(),
            format!("{preparation:.1}"),
            short(point.samples / point.seconds),
            if point.cpu.is_finite() { format!("{:.2}", point.cpu / point.wall) } else { "–".into() },
            per_sample(point.cost.eye_rays),
            per_sample(point.cost.shadow_rays),
            per_sample(point.cost.light_rays),
            per_sample(point.cost.compensation_rays),
            per_sample(point.cost.photon_queries),
            per_sample(point.bytes),
        ])
    });
    with_heading(&heading, rows)
}

/// Slopes, and noise and bias apart, at the end of the runs.
pub fn limits(series: &[Series]) -> Table {
    let heading = ["method", "samples", "slope", "95 %", "expected", "variance", "95 %", "bias²", "95 %"];
    let rows = series.iter().filter_map(|series| {
        let (point, none) = (series.last()?, || "–".to_string());
        let parts = point.parts;
        Some(vec![
            series.name.clone(),
            short(point.samples),
            series.slope.map_or_else(none, |(law, _)| format!("{:.2}", law.slope)),
            series.slope.map_or_else(none, |(_, i)| format!("{:.2} to {:.2}", i.low, i.high)),
            format!("{:.0}", series.expected),
            parts.map_or_else(none, |p| short(p.variance.value)),
            parts.map_or_else(none, |p| range(p.variance)),
            parts.map_or_else(none, |p| short(p.bias2.value)),
            parts.map_or_else(none, |p| range(p.bias2)),
        ])
    });
    with_heading(&heading, rows)
}

fn with_heading(heading: &[&str], rows: impl Iterator<Item = Vec<String>>) -> Table {
    std::iter::once(heading.iter().map(ToString::to_string).collect()).chain(rows).collect()
}

fn range(interval: Interval) -> String {
    if interval.low.is_finite() && interval.high.is_finite() {
        format!("{} to {}", short(interval.low), short(interval.high))
    } else {
        "one run".to_string()
    }
}

/// A number with three digits that count.
pub fn short(value: f64) -> String {
    let size = value.abs();
    match size {
        _ if !value.is_finite() => value.to_string(),
        _ if size == 0.0 => "0".to_string(),
        _ if size >= 1e6 => format!("{value:.2e}"),
        _ if size >= 99.95 => format!("{value:.0}"),
        _ if size >= 9.995 => trimmed(format!("{value:.1}")),
        _ if size >= 0.9995 => trimmed(format!("{value:.2}")),
        _ if size >= 0.01 => trimmed(format!("{value:.3}")),
        _ if size >= 0.001 => trimmed(format!("{value:.5}")),
        _ => format!("{value:.2e}"),
    }
}

/// Without zeros that say nothing.
fn trimmed(number: String) -> String {
    number.trim_end_matches('0').trim_end_matches('.').to_string()
}

/// Errors that are worth knowing the time to: a clean picture, and one that is hard to tell from right.
const LEVELS: [f64; 3] = [0.03, 0.01, 0.001];

#[cfg(test)]
mod tests {
    use super::short;

    #[test]
    fn numbers_are_short() {
        let numbers = [0.0, 1.0, 0.25, 123.4, 12_345.6, 0.00123, 1.234e-5, -2.5e7, 10.0];
        let expected = ["0", "1", "0.25", "123", "12346", "0.00123", "1.23e-5", "-2.50e7", "10"];
        assert_eq!(numbers.map(short), expected);
    }
}
