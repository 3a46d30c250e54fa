//! All numbers, one row a look, for programs.

use frame::metrics::Interval;

use super::judgement::{Point, Series};

/// The first line of the file.
pub const HEADING: &str = "scene,method,view,look,runs,samples,seconds,wall_seconds,cpu_seconds,rel_mse,rel_mse_low,\
rel_mse_high,rel_mse_worst,rmse,smape,flip,percentile_99_9,non_finite,variance,variance_low,variance_high,bias2,bias2_low,\
bias2_high,reference_noise,eye_rays,shadow_rays,light_rays,compensation_rays,photon_queries,bytes\n";

/// Rows of a scene: powers of two, then marks. What is not known is empty.
pub fn rows(scene: &str, series: &[Series], floor: Option<f64>, marks: &[f64]) -> String {
    let mut text = String::new();
    for one in series {
        for point in &one.points {
            text += &row(scene, one, "power", point, floor);
        }
        for (point, mark) in one.marks.iter().zip(marks) {
            if let Some(point) = point {
                text += &row(scene, one, &format!("{mark} s"), point, floor);
            }
        }
    }
    text
}

fn row(scene: &str, series: &Series, look: &str, point: &Point, floor: Option<f64>) -> String {
    let number = |value: f64| if value.is_finite() { format!("{value:e}") } else { String::new() };
    let three = |interval: Option<Interval>| match interval {
        Some(i) => [i.value, i.low, i.high].map(number).join(","),
        None => ",,".to_string(),
    };
    let cost = &point.cost;
    let fields = [
        quoted(scene),
        quoted(&series.name),
        format!("{:?}", series.view).to_lowercase(),
        look.to_string(),
        point.runs.to_string(),
        number(point.samples),
        number(point.seconds),
        number(point.wall),
        number(point.cpu),
        three(Some(point.rel_mse)),
        number(point.worst),
        number(point.rmse),
        number(point.smape),
        number(point.flip),
        number(point.percentile_999),
        point.non_finite.to_string(),
        three(point.parts.map(|parts| parts.variance)),
        three(point.parts.map(|parts| parts.bias2)),
        floor.map_or(String::new(), number),
        cost.eye_rays.to_string(),
        cost.shadow_rays.to_string(),
        cost.light_rays.to_string(),
        cost.compensation_rays.to_string(),
        cost.photon_queries.to_string(),
        point.bytes.to_string(),
    ];
    fields.join(",") + "\n"
}

/// A field that may contain anything.
pub fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_string() }
}

#[cfg(test)]
mod tests {
    use super::quoted;

    #[test]
    fn names_with_commas_are_quoted() {
        assert_eq!([quoted("a b"), quoted("a,\"b\"")], ["a b", "\"a,\"\"b\"\"\""]);
    }
}
