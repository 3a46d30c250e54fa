//! How far a worker is, and how fast its answers come: together, how many questions keep it busy.
//!
//! Between a master and a worker that is far away, questions and answers lie on the way like water in a pipe: as many as
//! come through in the time of there and back. Fewer, and threads are idle; more only wait in line.
//!
//! The way is what the transport measures, and does not contain waiting at the worker: else a full line would look like
//! a long way, and grow. A line on the way itself, before a narrow link, does look like one; so the way counts up to
//! [`ROUND_TRIP_MAX`] only.

use super::Moment;

/// What is known of one worker.
#[derive(Debug, Default)]
pub(super) struct Window {
    /// There and back, microseconds.
    round_trip: u64,
    /// When its last answer came.
    last: Moment,
    /// Time that it was busy, microseconds, and answers in it; what is old counts less.
    busy: u64,
    answers: u64,
}

/// A way beyond this is a line before a narrow link, or too far for work that somebody waits for, microseconds.
const ROUND_TRIP_MAX: u64 = 400_000;
/// A longer pause between answers says nothing more about a pace, microseconds.
const PAUSE_MAX: u64 = 1_000_000;
/// So much of a question comes from adding up fractions.
const ROUNDING: f64 = 1e-6;
/// Answers by which a worker's pace is known …
const KNOWN_AFTER: u64 = 8;
/// … and after which they count half.
const HALVED_AFTER: u64 = 64;

impl Window {
    /// An answer has come to what was sent then; the way is as long as that.
    pub(super) fn answered(&mut self, sent: Moment, round_trip: u64, now: Moment) {
        self.round_trip = round_trip.min(ROUND_TRIP_MAX);
        // Since it could have begun: its last answer is on the way, too, but just before this one.
        let begun = self.last.0.max(sent.0.saturating_add(self.round_trip));
        self.busy += now.0.saturating_sub(begun).min(PAUSE_MAX);
        self.answers += 1;
        self.last = now;
        if self.answers >= HALVED_AFTER {
            (self.busy, self.answers) = (self.busy / 2, self.answers / 2);
        }
    }

    /// There and back, microseconds.
    pub(super) fn round_trip(&self) -> u64 {
        self.round_trip
    }

    /// Answers a microsecond, if that is known.
    fn pace(&self) -> Option<f64> {
        (self.answers >= KNOWN_AFTER).then(|| self.answers as f64 / self.busy.max(1) as f64)
    }

    /// Questions and answers that are on the way when it is always busy.
    pub(super) fn holds(&self) -> usize {
        self.pace().map_or(0, |pace| (self.round_trip as f64 * pace) as usize)
    }

    /// Questions that it can answer until `end`, microseconds from now.
    pub(super) fn share(&self, end: f64) -> usize {
        self.pace().map_or(0, |pace| ((end - self.round_trip as f64) * pace - ROUNDING).ceil().max(0.0) as usize)
    }
}

/// When so many questions can be answered, if each worker takes its share; microseconds from now. Who is too far away
/// to be back by then has no share.
pub(super) fn end<'a>(windows: impl Iterator<Item = &'a Window>, questions: usize) -> f64 {
    let mut known: Vec<_> = windows.filter_map(|window| Some((window.round_trip, window.pace()?))).collect();
    known.sort_unstable_by_key(|(round_trip, _)| *round_trip);
    // Questions that the nearest would have answered by then if they had begun at once, and what they answer.
    let (mut ahead, mut pace, mut end) = (questions as f64, 0.0, f64::INFINITY);
    for (round_trip, its) in known {
        if round_trip as f64 >= end {
            break;
        }
        ahead += round_trip as f64 * its;
        pace += its;
        end = ahead / pace;
    }
    end
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Answers one question after the other, each in `micros`, as far away as that, with so many in flight.
    fn window(round_trip: u64, micros: u64, in_flight: u64) -> Window {
        let mut window = Window::default();
        let mut came = std::collections::VecDeque::from(vec![0; in_flight as usize]);
        let mut free = 0;
        for _ in 0..1000 {
            let sent = came.pop_front().unwrap_or(0);
            free = (sent + round_trip / 2).max(free) + micros;
            window.answered(Moment(sent), round_trip, Moment(free + round_trip / 2));
            came.push_back(free + round_trip / 2);
        }
        window
    }

    #[test]
    fn it_holds_what_comes_through_in_the_time_of_the_way_however_full_it_was() {
        for in_flight in [1, 3, 20, 60] {
            assert_eq!(window(100_000, 5_000, in_flight).holds(), 20, "{in_flight} in flight");
        }
        assert_eq!(window(200, 5_000, 3).holds(), 0, "next door nothing lies on the way");
    }

    #[test]
    fn a_narrow_link_does_not_make_it_grow_for_ever() {
        // The link takes 8 ms for an answer, and a line of 10 s has formed before it.
        assert_eq!(window(10_000_000, 8_000, 1000).holds(), (ROUND_TRIP_MAX / 8_000) as usize);
    }

    #[test]
    fn shares_are_what_each_can_answer_until_all_is_answered() {
        let three = [window(100_000, 2_000, 3), window(100_000, 2_000, 3), window(100_000, 2_000, 3)];
        let at = end(three.iter(), 54);
        assert!(three.iter().all(|window| window.share(at) == 18), "{at}");
        // Two next door have done it all before an answer from far away could be here.
        let mixed = [window(200, 2_000, 3), window(200, 2_000, 3), window(100_000, 2_000, 3)];
        let at = end(mixed.iter(), 54);
        assert_eq!(mixed.each_ref().map(|window| window.share(at)), [27, 27, 0]);
        // With more to do, who is far away takes part.
        let at = end(mixed.iter(), 540);
        assert_eq!(
            mixed.iter().map(|window| window.share(at) as i64 - 180).map(|more| more.signum()).collect::<Vec<_>>(),
            [1, 1, -1]
        );
        // A slow one takes less.
        let uneven = [window(100_000, 2_000, 3), window(100_000, 20_000, 3)];
        let at = end(uneven.iter(), 110);
        assert_eq!(uneven.each_ref().map(|window| window.share(at)), [100, 10]);
    }
}
