//! From pictures to errors: every look of every run compared with the reference.

use frame::Picture;
use frame::metrics::{Decomposition, Difference, Gram, Interval, PowerLaw, SizesDiffer, flip};
use frame::tone::Tone;
use protocol::answer::Cost;
use rayon::prelude::*;

use super::record::{Look, Record, Slope, View};
use super::settings::Clock;
use super::subject::Subject;

/// One curve: a method in one view.
#[derive(Debug)]
pub struct Series {
    /// For plots and tables.
    pub name: String,
    /// Which picture of the method.
    pub view: View,
    /// A path tracer to be compared with.
    pub is_rival: bool,
    /// How its error ought to fall.
    pub expected: Slope,
    /// How it did fall over the last decade, beyond the reference's noise: fitted to the mean error, with an
    /// interval from the runs one by one.
    pub slope: Option<(PowerLaw, Interval)>,
    /// After 1, 2, 4, … samples.
    pub points: Vec<Point>,
    /// At the marks that were reached.
    pub marks: Vec<Option<Point>>,
    /// What the first run looked like at the marks.
    pub pictures: Vec<Option<Picture>>,
}

/// The error at one moment, over all runs that came so far.
#[derive(Clone, Debug)]
pub struct Point {
    /// Number of runs.
    pub runs: usize,
    /// Frames, or samples a pixel; the mean over runs, as all that follows.
    pub samples: f64,
    /// Seconds by the clock that counts.
    pub seconds: f64,
    /// Seconds by the watch.
    pub wall: f64,
    /// Seconds of all threads.
    pub cpu: f64,
    /// mean (x − r)² / (r² + 0.01).
    pub rel_mse: Interval,
    /// That of the worst run.
    pub worst: f64,
    /// √ mean (x − r)².
    pub rmse: f64,
    /// Symmetric mean absolute percentage error, 0..=2.
    pub smape: f64,
    /// FLIP of the pictures at exposure 0, 0..=1.
    pub flip: f64,
    /// 99.9 % of the values differ by no more than this.
    pub percentile_999: f64,
    /// Values that are infinite or no number, in all runs together; must be 0.
    pub non_finite: u64,
    /// Noise and bias apart, where there are two runs.
    pub parts: Option<Decomposition>,
    /// What it cost.
    pub cost: Cost,
    /// Bytes of answers.
    pub bytes: u64,
}

/// All curves of a method.
pub fn judge(record: &Record, subject: &Subject, clock: Clock) -> Vec<Series> {
    let views = record.method.views.iter().enumerate();
    views.map(|(index, view)| series(record, index, *view, subject, clock)).collect()
}

fn series(record: &Record, index: usize, view: View, subject: &Subject, clock: Clock) -> Series {
    let looks_at = |number: usize| -> Vec<&Look> {
        record.runs.iter().filter_map(|run| run.powers.get(number)?.as_ref()).collect()
    };
    let longest = record.runs.iter().map(|run| run.powers.len()).max().unwrap_or(0);
    let points: Vec<Point> =
        (0..longest).filter_map(|number| point(&looks_at(number), index, subject, clock)).collect();
    let marks = record.runs.first().map_or(0, |run| run.marks.len());
    let at_mark =
        |mark: usize| -> Vec<&Look> { record.runs.iter().filter_map(|run| run.marks[mark].as_ref()).collect() };
    let floor = subject.floor.unwrap_or(0.0);
    let raw_of_several = view == View::Raw && record.method.views.len() > 1;
    Series {
        name: if raw_of_several { format!("{} raw", record.method.name) } else { record.method.name.clone() },
        view,
        is_rival: record.method.is_rival,
        expected: record.method.expected,
        slope: slope(record, index, subject, floor, &points),
        points,
        marks: (0..marks).map(|mark| point(&at_mark(mark), index, subject, clock)).collect(),
        pictures: (0..marks).map(|mark| at_mark(mark).first().map(|look| look.pictures[index].clone())).collect(),
    }
}

fn point(looks: &[&Look], index: usize, subject: &Subject, clock: Clock) -> Option<Point> {
    let pictures: Vec<&Picture> = looks.iter().map(|look| &look.pictures[index]).collect();
    let shown = Tone::PLAIN.develop(&subject.reference);
    let judged: Result<Vec<(Difference, f64)>, SizesDiffer> = pictures
        .par_iter()
        .map(|picture| {
            let difference = Difference::between(picture, &subject.reference)?;
            let seen = flip(&shown, &Tone::PLAIN.develop(picture)).ok_or(SizesDiffer)?;
            Ok((difference, seen.mean))
        })
        .collect();
    let judged = judged.ok()?;
    let errors: Vec<f64> = judged.iter().map(|(difference, _)| difference.rel_mse).collect();
    let runs = looks.len();
    let mean = |value: &dyn Fn(usize) -> f64| (0..runs).map(value).sum::<f64>() / runs as f64;
    let gram = Gram::of(&pictures, &subject.reference).ok()?;
    Some(Point {
        runs,
        samples: mean(&|run| looks[run].samples as f64),
        seconds: mean(&|run| clock.seconds(looks[run].elapsed)),
        wall: mean(&|run| looks[run].elapsed.wall),
        cpu: mean(&|run| looks[run].elapsed.cpu),
        rel_mse: Interval::of_mean(&errors)?,
        worst: errors.iter().copied().fold(0.0, f64::max),
        rmse: mean(&|run| judged[run].0.rmse),
        smape: mean(&|run| judged[run].0.smape),
        flip: mean(&|run| judged[run].1),
        percentile_999: mean(&|run| judged[run].0.percentile_999),
        non_finite: judged.iter().map(|(difference, _)| difference.non_finite).sum(),
        parts: gram.decompose(subject.floor.unwrap_or(0.0), runs as u64),
        cost: mean_cost(looks),
        bytes: looks.iter().map(|look| look.bytes).sum::<u64>() / runs as u64,
    })
}

/// How the error falls with the number of samples, over the last decade of them.
fn slope(
    record: &Record,
    index: usize,
    subject: &Subject,
    floor: f64,
    points: &[Point],
) -> Option<(PowerLaw, Interval)> {
    // The last points have fewer runs where runs differ in length: a law needs the same runs all along.
    let most = most_runs(points)?;
    let whole: Vec<&Point> = points.iter().filter(|point| point.runs == most).collect();
    let mean: Vec<(f64, f64)> = whole.iter().map(|point| (point.samples, point.rel_mse.value - floor)).collect();
    let law = PowerLaw::of_last_decade(&mean)?;
    let of_run = |run: &super::record::Run| {
        let looks = run.powers.iter().flatten();
        let looks = looks.filter(|look| whole.iter().any(|point| point.samples == look.samples as f64));
        let errors: Option<Vec<(f64, f64)>> = looks
            .map(|look| {
                let gram = Gram::of(&[&look.pictures[index]], &subject.reference).ok()?;
                Some((look.samples as f64, gram.errors()[0] - floor))
            })
            .collect();
        PowerLaw::of_last_decade(&errors?).map(|law| law.slope)
    };
    let slopes: Vec<f64> = record.runs.par_iter().filter_map(of_run).collect();
    Some((law, Interval { value: law.slope, ..Interval::of_mean(&slopes)? }))
}

/// The number of runs that most points have: some skip a power of two, and some end earlier.
fn most_runs(points: &[Point]) -> Option<usize> {
    points.iter().map(|point| point.runs).max()
}

fn mean_cost(looks: &[&Look]) -> Cost {
    let mut sum = Cost::default();
    looks.iter().for_each(|look| sum += look.cost);
    let runs = looks.len().max(1) as u64;
    let Cost { eye_rays, shadow_rays, light_rays, compensation_rays, photon_queries, dropped, micros } = sum;
    Cost {
        eye_rays: eye_rays / runs,
        shadow_rays: shadow_rays / runs,
        light_rays: light_rays / runs,
        compensation_rays: compensation_rays / runs,
        photon_queries: photon_queries / runs,
        // A sum: one is one too many.
        dropped,
        micros: micros.map(|time| time / runs),
    }
}

impl Series {
    /// Time and error, point by point.
    pub fn curve(&self) -> Vec<(f64, f64)> {
        self.points.iter().map(|point| (point.seconds, point.rel_mse.value)).collect()
    }

    /// The last point that all runs reached.
    pub fn last(&self) -> Option<&Point> {
        let most = most_runs(&self.points)?;
        self.points.iter().rev().find(|point| point.runs == most)
    }

    /// Values that are not finite, at any look.
    pub fn non_finite(&self) -> u64 {
        let looks = self.points.iter().chain(self.marks.iter().flatten());
        looks.map(|point| point.non_finite + point.cost.dropped).sum()
    }
}
