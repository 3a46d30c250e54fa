//! Prometheus' text format, version 0.0.4: families of samples, each with a line that says what it is.
//!
//! Names are ours and constant: `igi_…`, the unit last, counters end in `_total`. Values of labels are
//! constant words or numbers of ours, so that no series is ever made by what a peer says.

use std::fmt::Write;

use crate::histogram::Histogram;

/// A page of measures; [`Page::text`] is what Prometheus reads.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Page(String);

impl Page {
    /// Something that only grows.
    pub fn counter(&mut self, name: &'static str, help: &'static str, value: f64) {
        self.family(name, help, "counter");
        self.sample(name, "", value);
    }

    /// Something that only grows, by kind: pairs of the label's value and the count.
    pub fn counters(
        &mut self,
        name: &'static str,
        help: &'static str,
        label: &'static str,
        kinds: impl IntoIterator<Item = (&'static str, f64)>,
    ) {
        self.family(name, help, "counter");
        self.samples(name, label, kinds);
    }

    /// How something stands now.
    pub fn gauge(&mut self, name: &'static str, help: &'static str, value: f64) {
        self.family(name, help, "gauge");
        self.sample(name, "", value);
    }

    /// How something stands now, by kind: pairs of the label's value and the number.
    pub fn gauges(
        &mut self,
        name: &'static str,
        help: &'static str,
        label: &'static str,
        kinds: impl IntoIterator<Item = (&'static str, f64)>,
    ) {
        self.family(name, help, "gauge");
        self.samples(name, label, kinds);
    }

    /// As [`Self::counter`], for each of several that are there: pairs of a number of ours and the count.
    pub fn counter_each(
        &mut self,
        name: &'static str,
        help: &'static str,
        label: &'static str,
        each: impl IntoIterator<Item = (u32, f64)>,
    ) {
        self.family(name, help, "counter");
        self.samples_each(name, label, each);
    }

    /// As [`Self::gauge`], for each of several that are there: pairs of a number of ours and the value.
    pub fn gauge_each(
        &mut self,
        name: &'static str,
        help: &'static str,
        label: &'static str,
        each: impl IntoIterator<Item = (u32, f64)>,
    ) {
        self.family(name, help, "gauge");
        self.samples_each(name, label, each);
    }

    /// How long something took.
    pub fn histogram(&mut self, name: &'static str, help: &'static str, durations: &Histogram) {
        self.family(name, help, "histogram");
        for (end, count) in durations.cumulative() {
            let end = number(end);
            let _ = writeln!(self.0, "{name}_bucket{{le=\"{end}\"}} {count}");
        }
        let _ = writeln!(self.0, "{name}_sum {}\n{name}_count {}", number(durations.sum()), durations.count());
    }

    /// All of it.
    pub fn text(&self) -> &str {
        &self.0
    }

    fn family(&mut self, name: &str, help: &str, kind: &str) {
        let _ = writeln!(self.0, "# HELP {name} {help}\n# TYPE {name} {kind}");
    }

    fn samples(&mut self, name: &str, label: &str, kinds: impl IntoIterator<Item = (&'static str, f64)>) {
        for (kind, value) in kinds {
            self.sample(name, &format!("{{{label}=\"{kind}\"}}"), value);
        }
    }

    fn samples_each(&mut self, name: &str, label: &str, each: impl IntoIterator<Item = (u32, f64)>) {
        for (number, value) in each {
            self.sample(name, &format!("{{{label}=\"{number}\"}}"), value);
        }
    }

    fn sample(&mut self, name: &str, labels: &str, value: f64) {
        let _ = writeln!(self.0, "{name}{labels} {}", number(value));
    }
}

/// A number as Prometheus writes it.
fn number(value: f64) -> String {
    match value {
        f64::INFINITY => "+Inf".into(),
        f64::NEG_INFINITY => "-Inf".into(),
        value => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_is_prometheus_own() {
        let mut page = Page::default();
        page.counter("igi_tiles_total", "Tiles done.", 3.0);
        page.gauges("igi_workers", "Workers.", "state", [("ready", 2.0), ("slow", 0.0)]);
        page.counter_each("igi_answers_total", "Answers.", "worker", [(3, 7.0), (5, 0.0)]);
        let mut durations = Histogram::new(&[0.5]);
        durations.add(0.25);
        durations.add(2.0);
        page.histogram("igi_frame_seconds", "Frames.", &durations);
        let expected = "\
# HELP igi_tiles_total Tiles done.
# TYPE igi_tiles_total counter
igi_tiles_total 3
# HELP igi_workers Workers.
# TYPE igi_workers gauge
igi_workers{state=\"ready\"} 2
igi_workers{state=\"slow\"} 0
# HELP igi_answers_total Answers.
# TYPE igi_answers_total counter
igi_answers_total{worker=\"3\"} 7
igi_answers_total{worker=\"5\"} 0
# HELP igi_frame_seconds Frames.
# TYPE igi_frame_seconds histogram
igi_frame_seconds_bucket{le=\"0.5\"} 1
igi_frame_seconds_bucket{le=\"+Inf\"} 2
igi_frame_seconds_sum 2.25
igi_frame_seconds_count 2
";
        assert_eq!(page.text(), expected);
    }
}
