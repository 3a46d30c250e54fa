//! What the numbers say, in sentences.

use super::judgement::Series;
use super::record::View;
use super::subject::Subject;

/// A sentence, and whether it is bad news.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// For people.
    pub text: String,
    /// Something is not as it should be.
    pub is_amiss: bool,
}

/// What a scene's curves show: floors, slopes, and who is ahead at equal time.
pub fn findings(subject: &Subject, series: &[Series], marks: &[f64]) -> Vec<Finding> {
    let mut found = Vec::new();
    for one in series.iter().filter(|series| series.view == View::Raw) {
        found.extend(limit(one, subject.floor));
    }
    let rivals: Vec<&Series> = series.iter().filter(|series| series.is_rival).collect();
    for shown in series.iter().filter(|series| series.view == View::Shown && !series.is_rival) {
        for (mark, seconds) in marks.iter().enumerate() {
            found.extend(rivals.iter().filter_map(|rival| ahead(shown, rival, mark, *seconds)));
        }
    }
    for one in series.iter().filter(|series| series.non_finite() > 0) {
        let text = format!("{}: {} values are not finite; there must be none", one.name, one.non_finite());
        found.push(Finding { text, is_amiss: true });
    }
    found
}

/// Where a method is heading: its slope and what all runs have in common.
fn limit(series: &Series, floor: Option<f64>) -> Option<Finding> {
    let last = series.last()?;
    let parts = last.parts?;
    let mut text = format!("{}: ", series.name);
    let mut is_amiss = false;
    if let Some((law, interval)) = &series.slope {
        text += &format!(
            "over the last decade the error falls as samples to the power {:.2} ({:.2} to {:.2}), expected {:.0}; ",
            law.slope, interval.low, interval.high, series.expected
        );
        // Steeper than expected is no worry.
        is_amiss = interval.low > series.expected + SLOPE_TOLERANCE;
    }
    let bias = parts.bias2;
    let of_noise = if floor.is_some() { "beyond the reference's noise" } else { "the reference's noise included" };
    // What ought to fall for ever must not be mostly bias: a floor that the slope does not show yet.
    is_amiss |= series.expected < 0.0 && last.runs > 1 && bias.low > 0.0 && bias.value > parts.variance.value;
    text += &if last.runs < 2 {
        "one run cannot tell bias from noise".to_string()
    } else if bias.low > 0.0 && bias.value > 0.1 * parts.variance.value {
        format!(
            "after {} samples {:.0} % of it is common to all runs: bias² {:.1e} ({:.1e} to {:.1e}), {of_noise}",
            last.samples,
            100.0 * bias.value / (bias.value + parts.variance.value),
            bias.value,
            bias.low,
            bias.high
        )
    } else {
        format!("no bias is seen after {} samples: bias² below {:.1e} {of_noise}", last.samples, bias.high.max(0.0))
    };
    Some(Finding { text, is_amiss })
}

/// Two methods at equal time.
fn ahead(ours: &Series, theirs: &Series, mark: usize, seconds: f64) -> Option<Finding> {
    let [a, b] = [ours, theirs].map(|series| series.marks.get(mark).cloned().flatten());
    let (a, b) = (a?, b?);
    let factor = b.rel_mse.value / a.rel_mse.value;
    let apart = a.rel_mse.high < b.rel_mse.low || b.rel_mse.high < a.rel_mse.low;
    let verdict = match factor {
        _ if !apart => "no difference beyond chance".to_string(),
        1.0.. => format!("{factor:.1} times lower"),
        _ => format!("{:.1} times HIGHER", 1.0 / factor),
    };
    let text = format!(
        "at {seconds:.0} s, {} has relMSE {} and {} has {}: {verdict}",
        ours.name,
        super::tables::short(a.rel_mse.value),
        theirs.name,
        super::tables::short(b.rel_mse.value)
    );
    Some(Finding { text, is_amiss: apart && factor < 1.0 })
}

/// A slope that is off by more is worth a thought (algorithms.md D5).
const SLOPE_TOLERANCE: f64 = 0.2;

#[cfg(test)]
mod tests {
    use frame::metrics::{Decomposition, Interval, PowerLaw};
    use protocol::answer::Cost;

    use super::super::judgement::Point;
    use super::*;

    /// A value known to a tenth of itself.
    fn about(value: f64) -> Interval {
        Interval { value, low: value - 0.1 * value.abs(), high: value + 0.1 * value.abs() }
    }

    fn point(rel_mse: f64, bias2: f64) -> Point {
        Point {
            runs: 8,
            samples: 100.0,
            seconds: 1.0,
            wall: 1.0,
            cpu: 2.0,
            rel_mse: about(rel_mse),
            worst: rel_mse,
            rmse: 0.0,
            smape: 0.0,
            flip: 0.0,
            percentile_999: 0.0,
            non_finite: 0,
            parts: Some(Decomposition { variance: about(rel_mse - bias2), bias2: about(bias2) }),
            cost: Cost::default(),
            bytes: 0,
        }
    }

    fn series(name: &str, view: View, is_rival: bool, slope: f64, point: Point) -> Series {
        let law = PowerLaw { slope, scale: 1.0 };
        Series {
            name: name.to_string(),
            view,
            is_rival,
            expected: -1.0,
            slope: Some((law, Interval { value: slope, low: slope - 0.05, high: slope + 0.05 })),
            points: vec![point.clone()],
            marks: vec![Some(point)],
            pictures: vec![None],
        }
    }

    #[test]
    fn floors_are_told_from_noise() {
        let noisy = limit(&series("a", View::Raw, false, -1.0, point(1e-3, -1e-6)), Some(1e-5)).unwrap();
        assert!(noisy.text.contains("no bias is seen") && !noisy.is_amiss, "{}", noisy.text);
        let soon = limit(&series("a", View::Raw, false, -1.0, point(1e-3, 6e-4)), Some(1e-5)).unwrap();
        assert!(soon.is_amiss, "a floor that the slope does not show yet: {}", soon.text);
        let stuck = limit(&series("a", View::Raw, false, -0.4, point(1e-3, 8e-4)), Some(1e-5)).unwrap();
        assert!(stuck.text.contains("80 % of it is common to all runs") && stuck.is_amiss, "{}", stuck.text);
    }

    #[test]
    fn the_last_point_is_one_that_all_runs_have() {
        let mut curve = series("a", View::Raw, false, -1.0, point(1e-3, 0.0));
        // The first frame came together with the second in one run; three were quick enough for a fifth look.
        let runs = [7, 8, 8, 8, 3];
        curve.points = runs.map(|runs| Point { runs, ..point(1e-3, 0.0) }).into();
        curve.points.iter_mut().zip([1.0, 2.0, 4.0, 8.0, 16.0]).for_each(|(point, samples)| point.samples = samples);
        assert_eq!(curve.last().map(|point| point.samples), Some(8.0));
    }

    #[test]
    fn who_is_ahead_is_said_only_if_it_is_no_chance() {
        let ours = |error: f64| series("igi", View::Shown, false, -1.0, point(error, 0.0));
        let theirs = series("path", View::Raw, true, -1.0, point(0.01, 0.0));
        let said = |error: f64| ahead(&ours(error), &theirs, 0, 10.0).unwrap();
        assert!(said(0.002).text.ends_with("5.0 times lower") && !said(0.002).is_amiss);
        assert!(said(0.03).text.ends_with("3.0 times HIGHER") && said(0.03).is_amiss);
        assert!(said(0.0105).text.ends_with("no difference beyond chance") && !said(0.0105).is_amiss);
    }
}
