//! The pictures of a play beside the truth.

use frame::Picture;
use frame::metrics::{Difference, flip, non_finite};
use frame::tone::Tone;

use super::play::{Play, Shot};
use super::truths::Truths;
use crate::command::report::tables::short;

/// A play, and how far its pictures are from the truth.
pub(super) struct Judged {
    /// Pictures and figures.
    pub play: Play,
    /// Of those pictures whose truth is known, in order.
    pub points: Vec<Point>,
    /// The standing picture's.
    pub standing: Option<Point>,
    /// Values of pictures that are not finite.
    pub non_finite: u64,
}

/// One picture's error.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    /// Seconds since the beginning of the recording.
    pub t: f64,
    /// Line of the last input that it shows.
    pub shows: usize,
    /// mean (x − r)² / (r² + 0.01) of linear radiance.
    pub rel_mse: f64,
    /// LDR-FLIP of 8-bit pictures at exposure 0.
    pub flip: f64,
    /// 99.9 % of the values differ by no more than this.
    pub percentile_999: f64,
    /// Share of the pixels that nothing was known of.
    pub unknown: f64,
}

/// Compares what can be compared.
pub(super) fn judge(play: Play, truths: &Truths) -> Judged {
    let point = |shot: &Shot| Some(compare(shot, truths.of(shot.shows)?));
    let points = play.shots.iter().filter_map(point).collect();
    let standing = play.standing.as_ref().and_then(point);
    let bad = play.shots.iter().chain(&play.standing).map(|shot| non_finite(&shot.picture)).sum();
    Judged { points, standing, non_finite: bad, play }
}

/// What people see of a picture that was drawn smaller.
pub(super) fn as_seen(picture: &Picture, truth: &Picture) -> Picture {
    if picture.same_size(truth) { picture.clone() } else { picture.enlarged(truth.width, truth.height) }
}

fn compare(shot: &Shot, truth: &Picture) -> Point {
    let seen = as_seen(&shot.picture, truth);
    let difference = Difference::between(&seen, truth).ok();
    let flip = flip(&Tone::PLAIN.develop(truth), &Tone::PLAIN.develop(&seen));
    Point {
        t: shot.t,
        shows: shot.shows,
        rel_mse: difference.map_or(f64::INFINITY, |difference| difference.rel_mse),
        flip: flip.map_or(1.0, |map| map.mean),
        percentile_999: difference.map_or(f64::INFINITY, |difference| difference.percentile_999),
        unknown: 1.0 - f64::from(shot.known),
    }
}

impl Judged {
    /// Mean over the pictures.
    pub fn mean(&self, of: impl Fn(&Point) -> f64) -> Option<f64> {
        let count = self.points.len();
        (count > 0).then(|| self.points.iter().map(of).sum::<f64>() / count as f64)
    }

    /// The worst picture's.
    pub fn worst(&self, of: impl Fn(&Point) -> f64) -> Option<f64> {
        self.points.iter().map(of).max_by(f64::total_cmp)
    }

    /// In a line.
    pub fn said(&self) -> String {
        let number = |value: Option<f64>| value.map_or("–".to_owned(), |value| format!("{value:.3}"));
        let Play { method, mode, .. } = &self.play;
        let (mean, worst) = (number(self.mean(|point| point.flip)), number(self.worst(|point| point.flip)));
        let rel_mse = self.mean(|point| point.rel_mse).map_or("–".to_owned(), short);
        let standing = number(self.standing.map(|point| point.flip));
        format!("{method}, {mode}: FLIP {mean} (worst {worst}; standing {standing}), relMSE {rel_mse}")
    }
}
