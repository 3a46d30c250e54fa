//! Lamps that are mixed: at rest, each is drawn apart ([`Films`]); from then on dimming, colouring and switching them shows a
//! picture at once, without a ray. They are edits as any others, which the workers hear of when somebody does anything else.

use std::sync::Arc;
use std::time::{Duration, Instant};

use frame::live::{Event, Frame, Moment};
use frame::{Films, FrontEnd, Layer, Picture, Plane, View};
use scenes::{Change, Rgb, Scene, Shiner};

use super::super::driver::{Came, Driver};
use super::Session;
use crate::display::message::{MixStatus, ServerMessage};
use crate::live::record::What;

/// Mixing is wanted.
#[derive(Default)]
pub(super) struct Mixing {
    /// Of the view as it is, unless something else than lamps' powers has changed since.
    films: Option<Films>,
    held: Option<Held>,
}

/// Live rests, and the workers draw films.
struct Held {
    /// The scene as the workers last drew it for people, while theirs is lit otherwise.
    before: Arc<Scene>,
    /// With what people have done to its lamps since.
    now: Scene,
    drawing: Option<Drawing>,
    /// All films have their frames, and the workers have the scene as it was before.
    is_restored: bool,
    mixed: Option<Mixed>,
}

/// A film gets more frames.
struct Drawing {
    front: Box<dyn FrontEnd>,
    film: usize,
    /// Questions without an answer.
    open: usize,
}

/// What is seen instead of what the workers last drew for people.
struct Mixed {
    picture: Arc<Picture>,
    at: Instant,
    /// It was shown as the last.
    is_settled: bool,
}

/// Still frames before workers are taken for films: people see something first.
const FIRST_FRAMES: u32 = 4;
/// So many films there are at most, and of so many bytes in all.
const FILMS_MAX: usize = 24;
const BYTES_MAX: usize = 1 << 30;
/// A mix that has stayed for so long is shown without loss.
const SETTLES: Duration = Duration::from_millis(300);
/// Questions that may wait for workers.
const QUESTIONS_OPEN_MAX: usize = 1024;

impl Session {
    /// Whether lamps are mixed.
    pub(super) fn mixes(&self) -> bool {
        self.mixing.is_some()
    }

    /// Mixes lamps from now on, or draws all that people do.
    pub(super) fn set_mix(&mut self, on: bool) {
        if on {
            self.mixing.get_or_insert_default();
        } else {
            self.stop_mixing();
            self.mixing = None;
        }
        self.send_knobs();
    }

    /// The scene as people have it, without edits that wait to be made.
    pub(super) fn scene(&self) -> Option<&Scene> {
        scene(self.mixing.as_ref(), &self.driver)
    }

    /// The mix that is seen, if one is.
    pub(super) fn mixed(&self) -> Option<&Arc<Picture>> {
        self.mixing.as_ref()?.held.as_ref()?.mixed.as_ref().map(|mixed| &mixed.picture)
    }

    /// What each lamp brings to the mix that is seen, by names that differ; nothing if none is.
    pub(super) fn mix_shares(&self) -> Vec<(String, Picture)> {
        let Some(Mixing { films: Some(films), held: Some(Held { now, mixed: Some(_), .. }) }) = &self.mixing else {
            return Vec::new();
        };
        let mut names = std::collections::BTreeSet::new();
        let mut named = |(number, (lamp, share)): (usize, (Shiner, Picture))| {
            let mut name = name(now, lamp);
            if name.is_empty() || !names.insert(name.clone()) {
                name = format!("{name} (lamp {})", number + 1).trim_start().to_owned();
                names.insert(name.clone());
            }
            (name, share)
        };
        films.shares(now).unwrap_or_default().into_iter().enumerate().map(&mut named).collect()
    }

    /// How far the films are; `None` while none are wanted.
    pub(super) fn mix_status(&self) -> Option<MixStatus> {
        let films = self.mixing.as_ref()?.films.as_ref();
        let [drawn, lamps] = films.map_or([0, 0], Films::drawn);
        Some(MixStatus { drawn, lamps, frames: films.map_or(0, Films::frames) })
    }

    /// An event is handled: returns whether that was all there was to do, because it is mixed.
    pub(super) fn mix(&mut self, event: &Event) -> bool {
        let is_held = self.mixing.as_ref().is_some_and(|mixing| mixing.held.is_some());
        match event {
            Event::Watched(_) => return false,
            Event::Look(camera) if *camera == self.camera() => return false,
            Event::Edit(changes) if is_held && self.mix_edit(changes) => return true,
            _ => self.stop_mixing(),
        }
        let is_of_powers = |changes: &[Change]| {
            self.scene().is_some_and(|scene| changes.iter().all(|change| scene.is_of_power(change).is_some()))
        };
        let keeps_films = match event {
            Event::Edit(changes) => is_of_powers(changes),
            Event::Turn(knobs) => {
                let before = self.driver.live.knobs();
                (&knobs.method, knobs.seed) == (&before.method, before.seed)
            }
            _ => false,
        };
        if let Some(mixing) = self.mixing.as_mut().filter(|_| !keeps_films) {
            mixing.films = None;
        }
        false
    }

    /// To be called again and again: takes the workers when the picture rests, and goes on with what they draw.
    pub(super) fn go_on_mixing(&mut self) {
        let Some(mixing) = &self.mixing else { return };
        match &mixing.held {
            None => {
                let live = &self.driver.live;
                let is_still = !live.is_moving() && !live.has_news();
                let has_some = live.frames() >= FIRST_FRAMES || live.is_at_rest();
                let is_plain = self.settings.layer == Layer::FINAL && self.exposing.is_none() && self.watched;
                if is_still && has_some && is_plain {
                    self.hold();
                }
            }
            Some(held) if held.drawing.is_none() && !held.is_restored && self.watched => self.draw_next(),
            Some(_) => {}
        }
        let held = self.mixing.as_mut().and_then(|mixing| mixing.held.as_mut());
        let mixed = held.and_then(|held| held.mixed.as_mut());
        if let Some(mixed) = mixed.filter(|mixed| !mixed.is_settled && mixed.at.elapsed() >= SETTLES) {
            mixed.is_settled = true;
            let picture = Arc::clone(&mixed.picture);
            self.show_mix(picture, None, true);
        }
    }

    /// Waits for workers, as [`super::super::driver::Driver::recv`]; what they have drawn of a film is kept.
    pub(super) fn recv(&mut self, patience: Duration) -> bool {
        let held = self.mixing.as_mut().and_then(|mixing| mixing.held.as_mut());
        let Some(drawing) = held.and_then(|held| held.drawing.as_mut()) else { return self.driver.recv(patience) };
        let questions = drawing.front.ask(QUESTIONS_OPEN_MAX.saturating_sub(drawing.open));
        drawing.open += questions.len();
        if !questions.is_empty() {
            self.driver.cluster.ask(questions);
        }
        let came = self.driver.recv_apart(drawing.front.as_mut(), patience);
        match came {
            Came::Nothing => return false,
            Came::Answer => drawing.open = drawing.open.saturating_sub(1),
            Came::Other => {}
            Came::Distrust => self.begin_films_again(),
        }
        self.keep_film();
        true
    }

    /// Gives the workers back, lit as people have it.
    pub(super) fn stop_mixing(&mut self) {
        if self.mixing.as_ref().is_none_or(|mixing| mixing.held.is_none()) {
            return;
        }
        self.restore();
        if let Some(mixing) = &mut self.mixing {
            mixing.held = None;
        }
        // In a recording they are one edit: a replay draws them when people saw them drawn.
        let waiting = self.driver.live.waiting().to_vec();
        if !waiting.is_empty() {
            self.record(What::Edit(waiting));
        }
        self.driver.handle(Event::Held(false));
        self.handle_outcomes(None);
    }

    /// Takes the workers from Live.
    fn hold(&mut self) {
        let Some(before) = self.driver.cluster.shared_scene() else { return };
        let lamps = self.lamps(&before);
        let camera = self.camera();
        let bytes = camera.width as usize * camera.height as usize * size_of::<Rgb>();
        let most = FILMS_MAX.min(BYTES_MAX / bytes.max(1)).max(1);
        let Some(mixing) = &mut self.mixing else { return };
        if lamps.is_empty() {
            self.set_mix(false);
            return self.hub.send_all(&ServerMessage::Notice { text: "nothing shines that could be mixed".into() });
        }
        if !mixing.films.as_ref().is_some_and(|films| films.cover(&before)) {
            mixing.films = Some(Films::of(&lamps, most, |shiner| group(&before, shiner)));
        }
        let now = (*before).clone();
        mixing.held = Some(Held { before, now, drawing: None, is_restored: false, mixed: None });
        self.driver.handle(Event::Held(true));
        self.handle_outcomes(None);
    }

    /// All that shines, and all that was turned off here, with a power.
    fn lamps(&self, scene: &Scene) -> Vec<(Shiner, Rgb)> {
        let power = |shiner: Shiner| {
            let on = scene.power(shiner).filter(|power| power.max_element() > 0.0);
            on.or_else(|| self.hues.of(shiner).filter(|power| power.max_element() > 0.0))
        };
        scene.shiners().into_iter().filter_map(|shiner| Some((shiner, power(shiner)?))).collect()
    }

    /// Lights the workers' scene by the lamps of the next film, and begins with it.
    fn draw_next(&mut self) {
        let limit = self.driver.live.knobs().rest_after.max(1);
        let Some(mixing) = &mut self.mixing else { return };
        let (Some(films), Some(held)) = (&mixing.films, &mut mixing.held) else { return };
        let (Some((film, frames)), Some(scene)) = (films.next(&held.now, limit), self.driver.cluster.scene()) else {
            return self.restore();
        };
        let changes = films.alone(film, scene);
        let salt = ((film as u64 + 1) << 32) + u64::from(films.frames_of(film));
        let parallelism = self.driver.cluster.status().parallelism();
        let world = match changes.is_empty() {
            true => self.driver.cluster.state(),
            false => self.driver.cluster.change(changes).ok(),
        };
        let cluster = &self.driver.cluster;
        let (Some(world), Some(scene), Some(fields)) = (world, cluster.shared_scene(), cluster.fields()) else {
            return;
        };
        let knobs = self.driver.live.knobs();
        let (camera, seed) = (self.driver.live.camera(), knobs.seed.wrapping_add(salt));
        let mut front = knobs.method.begin(&View { world, scene, fields, camera, seed });
        front.set_limit(frames);
        front.set_parallelism(parallelism);
        held.drawing = Some(Drawing { front, film, open: 0 });
    }

    /// A film that has all the frames that were asked is kept, and the mix that is seen made better by it.
    fn keep_film(&mut self) {
        let Some(mixing) = &mut self.mixing else { return };
        let (Some(films), Some(held)) = (&mut mixing.films, &mut mixing.held) else { return };
        let Some(mut drawing) = held.drawing.take_if(|drawing| drawing.front.is_finished()) else { return };
        let frames = drawing.front.frames();
        if frames > 0 {
            films.add(drawing.film, drawing.front.show(Plane::Final), frames);
        }
        self.driver.cluster.cancel_all();
        // As soon as it is about as good as what people see.
        let [drawn, all] = films.drawn();
        let is_good = drawn == all && films.frames_in_all() >= FIRST_FRAMES * all as u32;
        if (held.mixed.is_some() || is_good)
            && let Some(picture) = films.mixed(&held.now)
        {
            self.show_mix(Arc::new(picture), None, false);
        }
    }

    /// Somebody computes wrongly, and may have drawn part of the films.
    fn begin_films_again(&mut self) {
        self.stop_mixing();
        if let Some(mixing) = &mut self.mixing {
            mixing.films = None;
        }
        self.driver.handle(Event::Distrusted);
        self.handle_outcomes(None);
    }

    /// Lights the workers' scene as it was before.
    fn restore(&mut self) {
        let held = self.mixing.as_mut().and_then(|mixing| mixing.held.as_mut());
        let Some(held) = held.filter(|held| !held.is_restored) else { return };
        (held.drawing, held.is_restored) = (None, true);
        self.driver.cluster.cancel_all();
        let Some(scene) = self.driver.cluster.scene() else { return };
        let other = |shiner: &Shiner| scene.power(*shiner) != held.before.power(*shiner);
        let back = |shiner: Shiner| scene.powered(shiner, held.before.power(shiner)?);
        let changes: Vec<Change> = scene.shiners().into_iter().filter(other).filter_map(back).collect();
        if !changes.is_empty() && self.driver.cluster.change(changes).is_ok() {
            // Live has the state of before by another revision.
            self.driver.begin();
        }
    }

    /// Edits of lamps' powers alone are shown at once, if there is a film of each lamp.
    fn mix_edit(&mut self, changes: &[Change]) -> bool {
        let began = self.driver.now();
        let Some(mixing) = &mut self.mixing else { return false };
        let (Some(films), Some(held)) = (&mixing.films, &mut mixing.held) else { return false };
        let mut now = held.now.clone();
        let mut is_made = |change: &Change| now.is_of_power(change).is_some() && change.apply(&mut now).is_ok();
        if !changes.iter().all(&mut is_made) {
            return false;
        }
        let Some(picture) = films.mixed(&now) else { return false };
        held.now = now;
        self.note_change();
        self.driver.handle(Event::Edit(changes.to_vec()));
        self.handle_outcomes(None);
        self.show_mix(Arc::new(picture), Some(began), false);
        true
    }

    fn show_mix(&mut self, picture: Arc<Picture>, since: Option<Moment>, is_settled: bool) {
        let (revision, camera) = (self.driver.live.revision(), self.camera());
        let Some(world) = self.driver.cluster.state() else { return };
        let Some(mixing) = &mut self.mixing else { return };
        let (Some(films), Some(held)) = (&mixing.films, &mut mixing.held) else { return };
        held.mixed = Some(Mixed { picture: Arc::clone(&picture), at: Instant::now(), is_settled });
        let frame = Frame {
            number: 0,
            revision,
            world,
            camera,
            layer: Layer::FINAL,
            marks: Vec::new(),
            since,
            picture,
            moving: None,
            ended: false,
            // Many frames would be sent without loss, which takes longer.
            frames: if is_settled { films.frames().max(1) } else { 1 },
            known: 1.0,
            finished: is_settled,
        };
        let input = self.input_of(revision);
        self.period.count(&frame);
        self.display.show(frame, input);
    }
}

/// As [`Session::scene`], for whoever changes other parts of a session meanwhile.
pub(super) fn scene<'a>(mixing: Option<&'a Mixing>, driver: &'a Driver) -> Option<&'a Scene> {
    let held = mixing.and_then(|mixing| mixing.held.as_ref());
    held.map(|held| &*held.before).or_else(|| driver.cluster.scene())
}

/// What lamps share a film, if there are too many for one each: those whose names differ by a number.
fn group(scene: &Scene, shiner: Shiner) -> String {
    name(scene, shiner).trim_end_matches(|c: char| c.is_ascii_digit() || " ._#-".contains(c)).to_owned()
}

/// What people call it; empty if its file does not say.
fn name(scene: &Scene, shiner: Shiner) -> String {
    match shiner {
        Shiner::Light(number) => scene.light_names.get(number as usize).cloned().unwrap_or_default(),
        Shiner::Material(number) | Shiner::Own { material: number, .. } => {
            scene.materials.get(number as usize).map_or_else(String::new, |material| material.name.clone())
        }
        Shiner::Sky => "sky".into(),
    }
}
