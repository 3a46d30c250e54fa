//! The loop against people who do anything at any time, and workers who answer when they like.

use glam::Vec3;
use proptest::prelude::*;
use protocol::answer::{Body, Cost, LightPoint, Means, Moments, Pixels, Seen};
use protocol::question::{Ask, Asked, Frames, Question};

use super::*;
use crate::front_end::{Chosen, Value};
use crate::methods::RENDER_CACHE;
use crate::methods::igi::IGI;
use crate::methods::reference::REFERENCE;

pub(super) fn knobs() -> Knobs {
    let values = [("interleave", Value::Pair([2, 2])), ("replicates", Value::Whole(1))];
    let method = Chosen::new(&IGI).with(values).unwrap();
    Knobs { method, seed: 1, rate: 10.0, effort: None, rest_after: 3, layer: Layer::FINAL, making: Making::InTime }
}

fn with(name: &str, value: Value) -> Knobs {
    let knobs = knobs();
    Knobs { method: knobs.method.with([(name, value)]).unwrap(), ..knobs }
}

fn lights() -> Knobs {
    Knobs { layer: knobs().method.layer("lights").unwrap(), ..knobs() }
}

pub(super) fn camera(x: f32) -> Camera {
    Camera { origin: Vec3::new(x, 0.0, 3.0), width: 64, height: 56, ..Camera::default() }
}

/// A wall whose brightness tells the world's revision and the camera's place.
pub(super) fn made_up(question: &Question) -> Body {
    let colour = |camera: &Camera| Vec3::new(question.world.revision as f32 + 1.0, camera.origin.x + 100.0, 0.0);
    let tile = match &question.ask {
        Ask::Tile(tile) => tile,
        Ask::Frames(Frames { tile, .. }) => {
            let (emitted, len) = (colour(&tile.camera), tile.grid().len());
            return Body::Means(Means { emitted: vec![emitted; len], ..Means::black(len) });
        }
        Ask::Reference(samples) => {
            let mut moments = Moments::zero(samples.rect.len());
            moments.sum.fill(colour(&samples.camera).as_dvec3() * f64::from(samples.count));
            return Body::Moments(moments);
        }
        Ask::Lights(lights) => return Body::Lights(vec![light(f32::from(lights.lit.set)), light(100.0)]),
        Ask::Rays(rays) => {
            let count = rays.through.len();
            let pixels = Pixels { emitted: vec![colour(&rays.camera); count], ..Pixels::black(count) };
            return Body::Seen(Seen { pixels, hits: vec![None; count] });
        }
        Ask::Points(_) => panic!("nobody asks for points"),
    };
    let mut pixels = Pixels::default();
    for _ in tile.grid().pixels() {
        pixels.emitted.push(colour(&tile.camera));
        pixels.reflectance.push(Vec3::splat(0.5));
        pixels.irradiance.push(Vec3::ZERO);
        pixels.normal.push(Vec3::Z);
        pixels.distance.push(3.0);
    }
    Body::Pixels(pixels)
}

/// A virtual light on the wall, so far to the right, and one far behind it.
fn light(x: f32) -> LightPoint {
    let position = if x < 50.0 { Vec3::new(0.1 * x, 0.0, 0.0) } else { Vec3::new(0.0, 0.0, -x) };
    LightPoint { position, normal: Vec3::Z, strength: Vec3::splat(x + 1.0), depth: 1 }
}

/// Carries out the loop's actions; keeps the questions.
pub(super) struct Shell {
    pub(super) live: Live,
    world: u32,
    pub(super) open: Vec<Asked>,
    pub(super) frames: Vec<Frame>,
    /// What would be recorded besides inputs, in order.
    pub(super) noted: Vec<Noted>,
    pub(super) now: Moment,
    /// How long a picture takes to develop.
    cost: u64,
}

/// What happens to moving pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Noted {
    Step(Step),
    Ended(Ended),
}

impl Shell {
    fn new() -> Self {
        Self::with(knobs())
    }

    fn with(knobs: Knobs) -> Self {
        Self::at(camera(0.0), knobs)
    }

    pub(super) fn at(camera: Camera, knobs: Knobs) -> Self {
        let (open, frames, noted) = (Vec::new(), Vec::new(), Vec::new());
        let mut shell = Self { live: Live::new(camera, knobs), world: 0, open, frames, noted, now: Moment(0), cost: 0 };
        shell.publish();
        shell
    }

    fn publish(&mut self) {
        let world = WorldState { world: [1; 32], revision: self.world };
        let (scene, fields) = (Arc::default(), Fields { emitted: true, surface: true });
        self.tell(Event::Published { world, scene, fields });
    }

    pub(super) fn tell(&mut self, event: Event) {
        for action in self.live.handle(event, self.now) {
            match action {
                Action::Publish { behind, .. } => {
                    self.world += 1;
                    if !behind {
                        // The cluster forgets what was asked about another world.
                        self.open.clear();
                    }
                    self.publish();
                }
                Action::Forget => self.open.clear(),
                Action::Cancel(old) => self.open.retain(|asked| !old.contains(&asked.ticket)),
                Action::Note(step) => self.noted.push(Noted::Step(step)),
                Action::Ask(questions) => self.open.extend(questions),
                Action::Show => {
                    self.noted.extend(self.live.ended().map(Noted::Ended));
                    let frame = self.live.picture(self.now);
                    self.now.0 += if frame.is_some() { self.cost } else { 0 };
                    self.frames.extend(frame);
                }
            }
        }
    }

    pub(super) fn answer(&mut self, pick: usize) {
        if self.open.is_empty() {
            return;
        }
        let Asked { ticket, question } = self.open.remove(pick % self.open.len());
        let body = made_up(&question);
        self.tell(Event::Answered { ticket, body, worker: 0, cost: Cost::default() });
    }

    /// As [`Self::answer`], wrongly.
    fn lie(&mut self) {
        if self.open.is_empty() {
            return self.wait(1000);
        }
        let Asked { ticket, question } = self.open.remove(0);
        self.tell(Event::Answered { ticket, body: wrong(&question), worker: 0, cost: Cost::default() });
    }

    pub(super) fn wait(&mut self, micros: u64) {
        self.now.0 += micros;
        self.tell(Event::Woke);
    }

    fn edit(&mut self) {
        self.tell(Event::Edit(vec![Change::Time(0.0)]));
    }

    /// Nothing more is done by people; workers answer everything.
    pub(super) fn settle(&mut self) {
        for _ in 0..100_000 {
            while !self.open.is_empty() {
                self.now.0 += 100;
                self.answer(0);
            }
            match self.live.wake_at() {
                Some(at) => self.now = self.now.max(at),
                None => return,
            }
            self.tell(Event::Woke);
        }
        panic!("it never rests");
    }
}

/// A worker computes wrongly while people look around, and is found: what it gave is in no picture any more, of no method.
#[test]
fn what_was_drawn_of_wrong_answers_is_forgotten() {
    let cached = Chosen::new(&RENDER_CACHE).with([("interleave", Value::Pair([2, 2]))]).unwrap();
    for method in [knobs().method, Chosen::new(&REFERENCE), cached] {
        let knobs = Knobs { method, ..knobs() };
        let settled = |shell: &mut Shell| {
            shell.settle();
            let last = shell.frames.last().expect("something is shown");
            assert!(last.finished);
            last.picture.sha256()
        };
        let mut honest = Shell::with(knobs.clone());
        honest.tell(Event::Look(camera(0.5)));
        let truth = settled(&mut honest);
        for is_still in [false, true] {
            let mut shell = Shell::with(knobs.clone());
            for x in [0.1, 0.3, 0.5] {
                shell.tell(Event::Look(camera(x)));
                for _ in 0..if is_still { 2000 } else { 60 } {
                    shell.lie();
                }
                shell.wait(20_000);
            }
            let late = shell.open.first().cloned();
            shell.tell(Event::Distrusted);
            late.into_iter().for_each(|Asked { ticket, question }| {
                let body = wrong(&question);
                shell.tell(Event::Answered { ticket, body, worker: 0, cost: Cost::default() });
            });
            assert_eq!(settled(&mut shell), truth, "{:?}, still: {is_still}", knobs.method);
        }
    }
}

/// What a worker of another revision would say.
fn wrong(question: &Question) -> Body {
    let world = WorldState { revision: question.world.revision + 7, ..question.world };
    made_up(&Question { world, ask: question.ask.clone() })
}

#[derive(Clone, Debug)]
enum Deed {
    Look(u8),
    Edit,
    Answer(u16),
    Lose(u16),
    Repeat(u16),
    Wait(u32),
}

fn deed() -> impl Strategy<Value = Deed> {
    prop_oneof![
        1 => any::<u8>().prop_map(Deed::Look),
        1 => Just(Deed::Edit),
        12 => any::<u16>().prop_map(Deed::Answer),
        1 => any::<u16>().prop_map(Deed::Lose),
        1 => any::<u16>().prop_map(Deed::Repeat),
        2 => (0u32..200_000).prop_map(Deed::Wait),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn whatever_happens_the_last_state_is_shown_and_no_older_one_after_a_newer(
        steps in prop::collection::vec(deed(), 1..200),
        method in 0..3_usize,
        round_trip in prop::sample::select(vec![0, 50_000, 300_000]),
    ) {
        // Pictures are what is answered, whatever the scene is.
        let values = [("interleave", Value::Pair([2, 2])), ("guide", Value::Switch(false))];
        let cached = Chosen::new(&RENDER_CACHE).with(values).unwrap();
        // Means of what was kept are rounded; the reference keeps nothing.
        let slack = if method == 1 { 0.0 } else { 1e-3 };
        let method = [knobs().method, Chosen::new(&REFERENCE), cached][method].clone();
        let mut shell = Shell::with(Knobs { method, ..knobs() });
        shell.live.set_round_trip(round_trip);
        let (mut looked, mut edits) = (0.0, 0);
        let mut late = Vec::new();
        for step in steps {
            match step {
                Deed::Look(x) => {
                    looked = f32::from(x) / 256.0;
                    shell.tell(Event::Look(camera(looked)));
                }
                Deed::Edit => {
                    edits += 1;
                    shell.edit();
                }
                Deed::Answer(pick) => {
                    late.extend(shell.open.first().cloned());
                    shell.answer(usize::from(pick));
                }
                // A worker forgets: whoever keeps questions asks it again, sooner or later.
                Deed::Lose(pick) if !shell.open.is_empty() => {
                    let at = usize::from(pick) % shell.open.len();
                    let question = shell.open.swap_remove(at);
                    shell.open.push(question);
                }
                // An answer comes twice, or long after its question was forgotten.
                Deed::Repeat(pick) if !late.is_empty() => {
                    let Asked { ticket, question }: Asked = late[usize::from(pick) % late.len()].clone();
                    let body = made_up(&question);
                    // What was asked of another world never gets here: the cluster drops it.
                    shell.tell(Event::Answered { ticket, body, worker: 1, cost: Cost::default() });
                }
                Deed::Wait(micros) => shell.wait(u64::from(micros)),
                Deed::Lose(_) | Deed::Repeat(_) => {}
            }
        }
        shell.settle();

        let last = shell.frames.last().expect("something is shown");
        prop_assert!(last.finished && last.moving.is_none() && last.frames == 3 && last.known == 1.0);
        prop_assert_eq!([last.picture.width, last.picture.height], [64, 56]);
        prop_assert_eq!(last.camera, camera(looked));
        let expected = Vec3::new(shell.world as f32 + 1.0, looked + 100.0, 0.0);
        prop_assert!(last.picture.pixels.iter().all(|pixel| *pixel == expected), "{:?}", last.picture.pixels[0]);
        prop_assert!(shell.world <= edits, "one revision a frame at most");
        prop_assert!(shell.frames.is_sorted_by(|a, b| a.number < b.number && a.revision <= b.revision));
        for frame in &shell.frames {
            // Whatever is filled in is a state that was shown, never black, never from the future.
            let newest = frame.world.revision as f32 + 1.0;
            let is_between = |p: &Vec3| p.x >= 1.0 - slack && p.x <= newest + slack * newest;
            prop_assert!(frame.picture.pixels.iter().all(is_between), "{:?}", frame.picture.pixels[0]);
        }
    }
}

#[test]
fn while_people_move_frames_keep_coming_and_each_takes_the_newest_state() {
    let mut shell = Shell::new();
    shell.settle();
    let before = shell.frames.len();
    for step in 1..=800 {
        shell.tell(Event::Look(camera(step as f32 / 1000.0)));
        shell.now.0 += 1000;
        shell.answer(0);
    }
    let moving: Vec<_> = shell.frames[before..].iter().filter(|frame| frame.moving.is_some()).collect();
    assert!(moving.len() > 3, "{}", moving.len());
    assert!(moving.windows(2).all(|pair| pair[1].revision > pair[0].revision + 10), "inputs gather");
    assert!(moving.iter().all(|frame| frame.since.is_some_and(|since| since <= shell.now)));
    assert!(moving.windows(2).all(|pair| pair[1].since > pair[0].since), "each input is new in one picture");
}

#[test]
fn at_the_deadline_what_came_is_shown_and_the_rest_is_the_last_picture() {
    let mut shell = Shell::new();
    shell.settle();
    shell.edit();
    shell.answer(0);
    shell.wait(1_000_000);
    let frame = shell.frames.last().unwrap();
    assert!(frame.moving.is_some() && frame.known > 0.0 && frame.known < 0.5, "{}", frame.known);
    let (old, new) = (1.0, 2.0);
    assert!(frame.picture.pixels.iter().all(|pixel| pixel.x == old || pixel.x == new));
    assert!(frame.picture.pixels.iter().any(|pixel| pixel.x == old));
}

#[test]
fn a_moving_frame_that_no_picture_shows_has_ended_all_the_same() {
    let mut shell = Shell::new();
    shell.settle();
    shell.tell(Event::Turn(Knobs { layer: Layer::DISTANCE, ..knobs() }));
    shell.edit();
    shell.answer(0);
    let count = shell.frames.len();
    shell.wait(1_000_000);
    assert_eq!(shell.frames.len(), count, "a layer waits for a whole frame");
    assert!(matches!(shell.noted.last(), Some(Noted::Ended(_))) && shell.live.ended().is_none());
}

#[test]
fn a_camera_that_moves_is_followed_even_if_nobody_answers() {
    let mut shell = Shell::new();
    shell.settle();
    let count = shell.frames.len();
    shell.tell(Event::Look(camera(0.2)));
    shell.wait(250_000);
    let frame = &shell.frames[count];
    assert_eq!((frame.camera.origin.x, frame.known), (0.2, 0.0));
    assert!(frame.picture.pixels.iter().all(|pixel| pixel.x == 1.0), "the last picture, from the new place");
}

#[test]
fn filter_and_layer_do_not_begin_again() {
    let mut shell = Shell::new();
    shell.settle();
    shell.tell(Event::Turn(Knobs { layer: Layer::DISTANCE, ..with("filter", Value::Word("off".into())) }));
    let frame = shell.frames.last().unwrap();
    assert_eq!((frame.frames, frame.layer), (3, Layer::DISTANCE));
    assert!(shell.open.is_empty());
    shell.tell(Event::Turn(with("vpls", Value::Whole(3))));
    assert!(!shell.open.is_empty(), "another estimator does");
    shell.settle();
    assert!(shell.frames.last().unwrap().moving.is_none());
}

#[test]
fn virtual_lights_are_asked_for_when_somebody_wants_to_see_them() {
    let mut shell = Shell::new();
    shell.settle();
    assert!(shell.frames.last().unwrap().marks.is_empty());
    shell.tell(Event::Turn(lights()));
    let of_sets = |open: &[Asked]| open.iter().filter(|asked| matches!(asked.question.ask, Ask::Lights(_))).count();
    assert_eq!((shell.open.len(), of_sets(&shell.open)), (4, 4), "once a set, and nothing else");
    // One set is lost.
    let lost = shell.open.pop().unwrap();
    shell.tell(Event::Unanswered(lost.ticket));
    shell.settle();
    let frame = shell.frames.last().unwrap();
    assert_eq!((frame.frames, frame.marks.len()), (3, 6));
    assert_eq!(frame.marks.iter().filter(|dot| dot.hidden).count(), 3, "those behind the wall");
    let first = frame.marks.iter().find(|dot| !dot.hidden).unwrap();
    assert_eq!((first.x, first.y, first.depth), (0.5, 0.5, 1));
    assert!(first.strength < 0.02);
    // Moving pictures show them, too, from the new place.
    shell.tell(Event::Look(camera(0.5)));
    shell.settle();
    let frame = shell.frames.last().unwrap();
    let of_last = frame.marks.iter().filter(|dot| dot.depth == 1).count();
    assert!(of_last >= 4 && frame.camera.origin.x == 0.5, "{of_last} lights are seen");
    shell.tell(Event::Turn(knobs()));
    assert!(shell.open.is_empty() && shell.frames.last().unwrap().marks.is_empty());
}

#[test]
fn nobody_waits_for_a_question_that_was_given_up() {
    let mut shell = Shell::new();
    while shell.open.len() > 1 {
        shell.answer(0);
    }
    let lost = shell.open.pop().unwrap();
    shell.tell(Event::Unanswered(lost.ticket));
    assert!(shell.frames.last().unwrap().known > 0.9);
}

/// Each light set lights the wall differently: what interleaving makes of noise.
fn set_by_set(question: &Question) -> Body {
    let Ask::Tile(tile) = &question.ask else { return made_up(question) };
    let Body::Pixels(mut pixels) = made_up(question) else { panic!("a tile's answer") };
    pixels.emitted.clear();
    pixels.irradiance.fill(Vec3::splat(1.0 + f32::from(tile.lit.set)));
    Body::Pixels(pixels)
}

/// How much pixels differ from the mean of those beside them.
fn comb(picture: &Picture) -> f32 {
    let width = picture.width as usize;
    let rows = picture.pixels.chunks(width).flat_map(|row| row.windows(3));
    rows.map(|three| (three[1].x - (three[0].x + three[2].x) / 2.0).abs()).fold(0.0, f32::max)
}

#[test]
fn the_first_still_frame_grows_from_coarse_to_fine_without_a_comb() {
    let mut shell = Shell::new();
    let answer = |shell: &mut Shell, at: usize| {
        let Asked { ticket, question } = shell.open.remove(at);
        let body = set_by_set(&question);
        shell.tell(Event::Answered { ticket, body, worker: 0, cost: Cost::default() });
    };
    while shell.live.frames() == 0 {
        answer(&mut shell, 0);
    }
    let whole = shell.frames.last().unwrap().picture.pixels[0];
    shell.tell(Event::Look(camera(0.5)));
    while shell.live.is_moving() {
        answer(&mut shell, 0);
    }
    let before = shell.frames.len();
    // As they were asked: set by set.
    while shell.live.frames() == 0 {
        answer(&mut shell, 0);
        shell.wait(1_000_000);
    }
    let coarse: Vec<_> = shell.frames[before..].iter().filter(|frame| frame.frames == 0).collect();
    assert!(coarse.len() > 20, "{} pictures before the first frame", coarse.len());
    assert!(coarse.is_sorted_by(|a, b| a.known <= b.known), "more and more of it is there");
    assert!(coarse[0].known > 0.1, "none is developed again that shows nothing new: {}", coarse[0].known);
    for frame in &coarse {
        // Between rectangles that have come and those that have not there may be an edge; a comb is everywhere.
        let combed = frame.picture.pixels.chunks(64).filter(|row| {
            let edges = row.windows(3).filter(|three| (three[1].x - (three[0].x + three[2].x) / 2.0).abs() > 0.05);
            edges.count() > 16
        });
        assert_eq!(combed.count(), 0, "at {}", frame.known);
    }
    let end = shell.frames.last().unwrap();
    assert!(end.frames == 1 && comb(&end.picture) < 0.05, "{}", comb(&end.picture));
    assert!((end.picture.pixels[0] - whole).abs().max_element() < 0.05);
}

#[test]
fn however_long_pictures_take_to_develop_answers_are_heard() {
    let mut shell = Shell::new();
    shell.settle();
    shell.tell(Event::Turn(Knobs { seed: 2, ..knobs() }));
    shell.cost = 2_000_000;
    let (before, began) = (shell.frames.len() as u64, shell.now.0);
    while shell.live.frames() < 2 {
        shell.now.0 += 300_000;
        shell.answer(0);
    }
    let (shown, spent) = (shell.frames.len() as u64 - before, shell.now.0 - began);
    assert!(shown > 2 && shown * shell.cost < spent / 3, "{shown} pictures in {spent} us");
}

#[test]
fn while_nobody_looks_workers_rest_once_a_frame_is_whole_and_nothing_is_lost() {
    let mut watched = Shell::new();
    watched.settle();
    let expected = watched.frames.pop().unwrap().picture;

    // Answered as asked: the first frame is whole before the others.
    let settle = |shell: &mut Shell| {
        while !shell.open.is_empty() {
            let last = shell.open.remove(0);
            shell.open.push(last);
            shell.answer(shell.open.len() - 1);
        }
        shell.settle();
    };
    let mut shell = Shell::new();
    shell.tell(Event::Watched(false));
    settle(&mut shell);
    let frame = shell.frames.last().unwrap();
    assert_eq!((frame.frames, frame.finished), (1, false), "whoever comes finds a picture");
    shell.tell(Event::Watched(true));
    assert!(!shell.open.is_empty(), "at once");
    // Nobody looks while some questions are answered and others are not.
    (0..7).for_each(|pick| shell.answer(3 * pick));
    shell.tell(Event::Watched(false));
    assert!(shell.open.is_empty());
    shell.tell(Event::Turn(lights()));
    assert!(shell.open.is_empty());
    shell.tell(Event::Watched(true));
    shell.settle();
    let end = shell.frames.last().unwrap();
    assert_eq!((end.frames, end.finished, end.marks.is_empty()), (3, true, false));
    assert_eq!(*end.picture, *expected);

    // What moves is drawn to its end.
    shell.tell(Event::Watched(false));
    shell.tell(Event::Look(camera(0.3)));
    settle(&mut shell);
    let end = shell.frames.last().unwrap();
    assert_eq!((end.frames, end.camera.origin.x, end.known), (1, 0.3, 1.0));
}

#[test]
fn another_size_is_news_and_the_first_picture_of_it_is_quick() {
    let mut shell = Shell::new();
    shell.settle();
    shell.tell(Event::Look(Camera { width: 1280, height: 1120, ..camera(0.0) }));
    let Ask::Tile(tile) = &shell.open[0].question.ask else { panic!("a tile is asked for") };
    assert!(tile.camera.width < 320, "{}", tile.camera.width);
    shell.settle();
    let end = shell.frames.last().unwrap();
    assert_eq!([end.picture.width, end.picture.height], [1280, 1120]);
    assert!(end.picture.pixels.iter().all(|pixel| pixel.x == 1.0));
}
