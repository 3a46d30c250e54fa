//! How many pictures are on their way to a viewer at a time: as many as its way holds, and no line before it.
//!
//! A viewer says of each picture when it is drawn. As long as that takes no longer than it did for one alone, there may be one
//! more; when pictures wait for each other, on a narrow link or in a slow browser, there is one less. So the newest picture is
//! never behind a line of older ones, and a far viewer sees as many a second as a near one.

use std::collections::VecDeque;
use std::time::Duration;

use tokio::time::Instant;

/// Pictures on their way to one viewer at most.
pub(super) const PICTURES_MAX: usize = 16;

/// Those of one viewer.
#[derive(Debug)]
pub(super) struct Window {
    /// Numbers of pictures that it has not drawn yet, and when they were sent; oldest first.
    on_the_way: VecDeque<(u64, Instant)>,
    /// How many there may be.
    size: f64,
    /// How long one takes that waits for no other, as far as is known.
    alone: Option<Duration>,
}

/// One takes no longer than alone: within this of it. Screens and timers count in such steps.
const GRAIN: Duration = Duration::from_millis(8);
/// What is known of one alone follows what is seen, when that is more, by this share: pictures grow, ways get longer.
const FORGETS: u32 = 64;

impl Window {
    /// None on the way, and nothing known.
    pub fn new() -> Self {
        Self { on_the_way: VecDeque::new(), size: 1.0, alone: None }
    }

    /// One more may be sent.
    pub fn has_room(&self) -> bool {
        self.on_the_way.len() < (self.size as usize).clamp(1, PICTURES_MAX)
    }

    /// One was sent.
    pub fn send(&mut self, number: u64, now: Instant) {
        self.on_the_way.push_back((number, now));
    }

    /// It says that it has drawn one.
    pub fn drawn(&mut self, number: u64, now: Instant) {
        let Some(place) = self.on_the_way.iter().position(|(sent, _)| *sent == number) else { return };
        let Some((_, sent)) = self.on_the_way.remove(place) else { return };
        let took = now.saturating_duration_since(sent);
        let alone = self.alone.map_or(took, |alone| if took < alone { took } else { alone + (took - alone) / FORGETS });
        self.alone = Some(alone);
        if took <= alone + alone / 4 + GRAIN {
            self.size = (self.size + 1.0 / self.size).min(PICTURES_MAX as f64);
        } else if took > alone + alone / 2 + 2 * GRAIN {
            self.size = (self.size - 1.0).max(1.0);
        }
    }

    /// Since when it has the oldest that it has not drawn.
    pub fn since(&self) -> Option<Instant> {
        self.on_the_way.front().map(|(_, sent)| *sent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A viewer so far away, whose link or browser takes so long for each picture, and pictures that come so often; how many a
    /// second it is sent in the end, and how long the last takes.
    fn watch(round_trip: u64, each: u64, every: u64) -> (f64, u64) {
        let (mut window, start) = (Window::new(), Instant::now());
        let at = |micros: u64| start + Duration::from_micros(micros);
        let (mut acks, mut free, mut sent, mut took) = (VecDeque::new(), 0, 0_u64, 0);
        let mut is_new = false;
        for now in (0..20_000_000).step_by(1000) {
            while let Some((number, begun, _)) = acks.pop_front_if(|(_, _, back): &mut (u64, u64, u64)| *back <= now) {
                window.drawn(number, at(now));
                took = now - begun;
            }
            is_new |= now.is_multiple_of(every);
            if is_new && window.has_room() {
                (is_new, sent) = (false, sent + u64::from(now >= 10_000_000));
                window.send(now, at(now));
                free = (now + round_trip / 2).max(free) + each;
                acks.push_back((now, now, free + round_trip / 2));
            }
        }
        (sent as f64 / 10.0, took)
    }

    #[test]
    fn a_far_viewer_sees_as_many_as_a_near_one() {
        for round_trip in [1_000, 30_000, 100_000, 200_000, 400_000] {
            let (rate, took) = watch(round_trip, 2_000, 33_000);
            assert!(rate > 29.0, "{rate} a second at {round_trip} us");
            assert!(took <= round_trip + 4_000, "{took} us at {round_trip} us");
        }
    }

    #[test]
    fn before_a_narrow_link_there_is_no_long_line() {
        for (round_trip, each) in [(1_000, 100_000), (20_000, 60_000), (100_000, 100_000), (100_000, 400_000)] {
            let (rate, took) = watch(round_trip, each, 16_000);
            assert!(rate > 0.7e6 / (round_trip + each) as f64, "{rate} a second");
            assert!(took < 2 * (round_trip + each) + 50_000, "{took} us for {round_trip} and {each} us");
        }
    }

    #[test]
    fn what_a_viewer_makes_up_counts_for_nothing() {
        let mut window = Window::new();
        let now = Instant::now();
        window.send(7, now);
        (0..1000).for_each(|number| window.drawn(number + 8, now));
        assert!(!window.has_room() && window.since() == Some(now));
        // Who says of all at once that they are drawn gets as many as anybody, and no more.
        for number in 0..1000 {
            window.drawn(number, now);
            window.send(number + 1, now);
        }
        (2000..3000).for_each(|number| {
            if window.has_room() {
                window.send(number, now)
            }
        });
        assert_eq!(window.on_the_way.len(), PICTURES_MAX);
    }
}
