//! Pictures under way: how many come from far away, and that a replay draws the same.

use std::collections::{BTreeSet, VecDeque};

use proptest::prelude::*;
use protocol::answer::Cost;
use protocol::question::{Ask, Asked, Ticket};
use scenes::{Camera, Change};

use crate::Picture;
use crate::front_end::{Chosen, Effort};
use crate::live::tests::{Noted, Shell, camera, knobs, made_up};
use crate::live::{Event, Knobs, Making, Moment, Step};
use crate::methods::RENDER_CACHE;
use crate::methods::reference::REFERENCE;

/// A worker that answers one question after the other, so far away.
struct Far {
    shell: Shell,
    /// There and back, microseconds.
    round_trip: u64,
    known: BTreeSet<Ticket>,
    /// Questions by when they arrive, and answers by when they are back.
    there: VecDeque<(u64, Asked)>,
    back: VecDeque<(u64, Asked)>,
    free: u64,
    /// Where somebody looks from, and whether they edit instead.
    x: f32,
    edits: bool,
    /// How long each moving picture was waited for.
    waits: Vec<u64>,
    /// Pixels of the last, over those of a still one.
    share: f32,
}

/// Time that is measured, when it has settled, microseconds.
const MEASURED: u64 = 2_000_000;
/// Inputs come as fast as screens are drawn, microseconds.
const BETWEEN_INPUTS: u64 = 16_667;
/// What is drawn in a microsecond, in work of [`crate::front_end::Interactive::work`]: a picture at full size takes a tenth of
/// a second.
const SPEED: u64 = 5;

impl Far {
    fn new(round_trip: u64, rate: f32) -> Self {
        Self::drawing(knobs().method, round_trip, rate)
    }

    fn drawing(method: Chosen, round_trip: u64, rate: f32) -> Self {
        let large = Camera { width: 160, height: 120, ..camera(0.0) };
        let mut shell = Shell::at(large, Knobs { method, rate, rest_after: 1, ..knobs() });
        shell.settle();
        shell.frames.clear();
        shell.live.set_round_trip(round_trip);
        let (known, there, back, free) = (BTreeSet::new(), VecDeque::new(), VecDeque::new(), shell.now.0);
        Self { shell, round_trip, known, there, back, free, x: 0.0, edits: false, waits: Vec::new(), share: 0.0 }
    }

    /// What has been asked by now is on its way, and what nobody wants any more is not answered.
    fn send(&mut self) {
        for asked in &self.shell.open {
            if self.known.insert(asked.ticket) {
                self.there.push_back((self.shell.now.0 + self.round_trip / 2, asked.clone()));
            }
        }
        let is_wanted = |ticket: Ticket| self.shell.open.iter().any(|asked| asked.ticket == ticket);
        self.there.retain(|(_, asked)| is_wanted(asked.ticket));
        while let Some((arrival, asked)) = self.there.front()
            && (*arrival).max(self.free) <= self.shell.now.0
        {
            let lights = asked.question.ask.tile().map_or(0, |tile| {
                let quality = tile.lit.quality;
                u64::from(quality.light_samples) + u64::from(quality.vpls)
            });
            let work = asked.question.ask.len() as u64 * (10 + lights);
            self.free = (*arrival).max(self.free) + work / SPEED;
            let back = self.free + self.round_trip / 2;
            self.back.extend(self.there.pop_front().map(|(_, asked)| (back, asked)));
        }
    }

    /// Somebody looks around for so long.
    fn look_around(&mut self, micros: u64) {
        let (until, mut input) = (self.shell.now.0 + micros, self.shell.now.0);
        while self.shell.now.0 < until {
            let begins = self.there.front().map(|(arrival, _)| (*arrival).max(self.free));
            let answer = self.back.front().map(|(at, _)| *at);
            let wakes = self.shell.live.wake_at().map(|at| at.0);
            let next = [Some(input), begins, answer, wakes].into_iter().flatten().min().unwrap_or(input);
            self.shell.now = Moment(self.shell.now.0.max(next));
            let now = self.shell.now.0;
            if answer.is_some_and(|at| at <= now)
                && let Some((_, Asked { ticket, question })) = self.back.pop_front()
            {
                self.shell.open.retain(|asked| asked.ticket != ticket);
                let body = made_up(&question);
                self.shell.tell(Event::Answered { ticket, body, worker: 0, cost: Cost::default() });
            } else if input <= now {
                self.x += 0.001;
                input += BETWEEN_INPUTS;
                let Camera { width, height, .. } = self.shell.live.camera();
                self.shell.tell(match self.edits {
                    true => Event::Edit(vec![Change::Time(f64::from(self.x))]),
                    false => Event::Look(Camera { width, height, ..camera(self.x) }),
                });
            } else {
                self.shell.tell(Event::Woke);
            }
            self.send();
            let now = self.shell.now.0;
            for frame in self.shell.frames.drain(..).filter(|frame| frame.moving.is_some()) {
                self.share = frame.picture.pixels.len() as f32 / (160.0 * 120.0);
                // A late one may have been shown before.
                self.waits.extend(frame.since.map(|since| now - since.0));
            }
        }
    }

    /// Pictures a second, the median of waits, and the share of the pixels, once it has settled.
    fn measure(mut self) -> (f64, u64, f32) {
        self.look_around(3_000_000);
        self.waits.clear();
        self.look_around(MEASURED);
        self.waits.sort_unstable();
        (self.waits.len() as f64 * 1e6 / MEASURED as f64, self.waits[self.waits.len() / 2], self.share)
    }
}

#[test]
fn however_far_workers_are_pictures_come_as_fast_and_as_large() {
    let near = Far::new(0, 30.0).measure();
    for (round_trip, edits) in [(2_000, false), (100_000, false), (200_000, false), (100_000, true), (200_000, true)] {
        let (pictures, half, share) = Far { edits, ..Far::new(round_trip, 30.0) }.measure();
        assert!(pictures >= 25.0, "{pictures} pictures a second at {round_trip} us, edited: {edits}");
        // Far away, some of the way's time is taken from the pictures'.
        let least = if round_trip < 50_000 { 0.65 } else { 0.3 };
        assert!(share >= least * near.2, "they shrink for nothing: {share}, {}", near.2);
        assert!(half <= near.1 + round_trip + 30_000, "{half} us at {round_trip} us, {} next door", near.1);
    }
    assert!(near.0 >= 25.0, "{near:?}");
}

/// The way cannot be shortened, and what is drawn can: people see what they did within 145 ms, developing not counted.
#[test]
fn a_tenth_of_a_second_away_pictures_are_drawn_sooner() {
    for edits in [false, true] {
        let (pictures, half, share) = Far { edits, ..Far::new(100_000, 30.0) }.measure();
        assert!(pictures >= 25.0 && half <= 145_000, "{pictures} pictures a second after {half} us, {share}");
    }
}

#[test]
fn of_a_method_that_begins_afresh_several_are_under_way_as_well() {
    let near = Far::drawing(Chosen::new(&REFERENCE), 0, 30.0).measure();
    let far = Far::drawing(Chosen::new(&REFERENCE), 100_000, 30.0).measure();
    assert!(far.0 >= 25.0 && far.2 >= 0.3 * near.2, "{far:?}, {near:?}");
}

/// Batches are drawn one after the other while others are on the way, and that is no speed.
#[test]
fn however_far_workers_are_a_cache_asks_them_for_what_they_can_draw() {
    let share = |round_trip: u64| {
        let mut far = Far::drawing(Chosen::new(&RENDER_CACHE), round_trip, 30.0);
        far.look_around(3_000_000);
        let Effort(share) = far.shell.live.effort();
        let waiting = far.there.iter().filter(|(arrival, _)| *arrival <= far.shell.now.0).count();
        (share, waiting)
    };
    let near = share(0);
    for round_trip in [20_000, 100_000, 200_000] {
        let far = share(round_trip);
        assert!((0.6..1.5).contains(&(far.0 / near.0)), "{round_trip} us: {far:?}, {near:?}");
    }
}

#[test]
fn next_door_one_picture_is_under_way_at_a_time() {
    let mut near = Far::new(0, 30.0);
    near.look_around(2_000_000);
    assert!(near.shell.noted.iter().all(|noted| matches!(noted, Noted::Ended(_))) && !near.shell.noted.is_empty());
}

/// A shell with a picture under way and one begun behind it.
fn two_under_way() -> Shell {
    let mut shell = Shell::at(camera(0.0), knobs());
    shell.settle();
    shell.live.set_round_trip(200_000);
    shell.tell(Event::Look(camera(0.1)));
    shell.wait(10_000);
    shell.tell(Event::Look(camera(0.2)));
    assert_eq!(shell.live.under_way(), 1, "they do not begin at once");
    shell.wait(100_000);
    assert_eq!(shell.live.under_way(), 2);
    shell
}

#[test]
fn they_are_shown_in_order_each_with_its_own_camera() {
    let mut shell = two_under_way();
    let before = shell.frames.len();
    while shell.live.is_moving() {
        shell.answer(0);
    }
    let seen: Vec<f32> = shell.frames[before..].iter().map(|frame| frame.camera.origin.x).collect();
    assert_eq!(seen, [0.1, 0.2]);
    assert!(shell.frames[before..].iter().all(|frame| frame.known == 1.0 && frame.ended));
}

#[test]
fn one_that_is_overtaken_is_dropped_and_its_questions_with_it() {
    let mut shell = two_under_way();
    let before = shell.frames.len();
    let of_second = |asked: &Asked| matches!(&asked.question.ask, Ask::Tile(tile) if tile.camera.origin.x == 0.2);
    let since = Moment(shell.now.0 - 110_000);
    while let Some(at) = shell.open.iter().position(of_second) {
        shell.answer(at);
        if shell.frames.len() > before {
            break;
        }
    }
    let frame = &shell.frames[before];
    assert_eq!((frame.camera.origin.x, frame.known), (0.2, 1.0));
    assert_eq!(frame.since, Some(since), "who moved first waits still");
    let is_step = |step| move |noted: &Noted| *noted == Noted::Step(step);
    assert!(shell.noted.iter().any(is_step(Step::Began)) && shell.noted.iter().any(is_step(Step::Overtaken)));
    let is_first = |asked: &Asked| matches!(&asked.question.ask, Ask::Tile(tile) if tile.camera.origin.x == 0.1);
    assert!(!shell.open.iter().any(is_first), "nobody works for it any more");
}

#[test]
fn what_is_late_is_shown_as_far_as_it_has_come_and_the_next_goes_on() {
    let mut shell = two_under_way();
    let before = shell.frames.len();
    shell.answer(0);
    shell.wait(2_000_000);
    let frame = &shell.frames[before];
    assert!(frame.camera.origin.x == 0.1 && frame.known > 0.0 && frame.known < 1.0, "{}", frame.known);
    shell.settle();
    assert_eq!(shell.frames.last().unwrap().camera.origin.x, 0.2);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    /// What was recorded while several were under way is the same pictures again, whatever order answers come in: those that
    /// were shown then, but for what came late.
    #[test]
    fn a_replay_draws_the_same_whoever_answers(
        inputs in prop::collection::vec((0u8..8, 0usize..120, 0u64..60_000), 1..14),
        orders in prop::array::uniform2(prop::collection::vec(any::<u16>(), 40)),
    ) {
        enum Line { Input(Box<Event>), Noted(Noted) }
        let small = || Shell::at(camera(0.0), Knobs { effort: Some(Effort(0.5)), ..knobs() });
        let mut shell = small();
        shell.settle();
        shell.noted.clear();
        shell.live.set_round_trip(300_000);
        let mut lines = Vec::new();
        for (number, (kind, answers, micros)) in inputs.iter().enumerate() {
            let input = match kind {
                0 => Event::Edit(vec![Change::Time(number as f64)]),
                _ => Event::Look(camera(0.02 * number as f32 + 0.005 * f32::from(*kind))),
            };
            lines.push(Line::Input(Box::new(input.clone())));
            let note = |shell: &mut Shell, lines: &mut Vec<Line>| lines.extend(shell.noted.drain(..).map(Line::Noted));
            shell.tell(input);
            note(&mut shell, &mut lines);
            for i in 0..*answers {
                shell.answer(i * 7);
                note(&mut shell, &mut lines);
            }
            shell.wait(*micros);
            note(&mut shell, &mut lines);
        }
        let replay = |order: &[u16]| {
            let ends: Vec<Option<Effort>> = lines.iter().filter_map(|line| match line {
                Line::Noted(Noted::Ended(ended)) => Some(Some(ended.effort)),
                Line::Noted(Noted::Step(Step::Overtaken)) => Some(None),
                _ => None,
            }).collect();
            let mut shell = small();
            let (mut passed, mut hashes, mut picks) = (0, Vec::new(), order.iter().cycle());
            for line in &lines {
                match line {
                    Line::Input(input) => {
                        let effort = ends.get(passed + shell.live.under_way()).copied().flatten();
                        let making = Making::Held { still: 0 };
                        shell.tell(Event::Turn(Knobs { effort, making, ..knobs() }));
                        shell.tell((**input).clone());
                    }
                    Line::Noted(Noted::Step(step)) => {
                        passed += usize::from(*step == Step::Overtaken);
                        shell.tell(Event::Replayed(*step));
                    }
                    Line::Noted(Noted::Ended(ended)) => {
                        shell.noted.clear();
                        let making = Making::Of { batches: ended.batches, still: ended.still };
                        shell.tell(Event::Turn(Knobs { making, ..shell.live.knobs().clone() }));
                        let is_ended = |noted: &Noted| matches!(noted, Noted::Ended(_));
                        for _ in 0..10_000 {
                            if shell.noted.iter().any(is_ended) {
                                break;
                            }
                            shell.answer(usize::from(*picks.next().unwrap()));
                        }
                        prop_assert_eq!(shell.noted.iter().filter(|noted| is_ended(noted)).count(), 1);
                        passed += 1;
                        let last = shell.frames.last().unwrap();
                        hashes.push((last.camera.origin.x.to_bits(), Picture::sha256(&last.picture)));
                    }
                }
            }
            Ok(hashes)
        };
        let [first, second] = orders;
        prop_assert_eq!(replay(&first)?, replay(&second)?);
    }
}
