//! A recording by one method, and what is kept of it: some pictures, and figures about all.

use std::sync::Arc;
use std::time::{Duration, Instant};

use frame::live::latency::Latency;
use frame::live::{Event, Frame};
use frame::parts::reproject;
use frame::{Chosen, Picture};
use protocol::answer::Cost;

use super::settings::{Mode, Settings};
use crate::command::lockstep::{Asked, Played, play};
use crate::command::report::progress::Progress;
use crate::command::script::Script;
use runtime::cluster::ClusterOptions;
use runtime::failure::Failure;
use runtime::interrupt::Interrupt;
use runtime::live::player::Player;
use runtime::live::record::What;

/// What came of playing a recording.
pub(super) struct Play {
    /// Of the method, or variant.
    pub method: String,
    /// How it was played.
    pub mode: Mode,
    /// Pictures that are compared, in order.
    pub shots: Vec<Shot>,
    /// What people see after a second in which nothing moves; in step: after as many still frames as light sets.
    pub standing: Option<Shot>,
    /// Moving pictures.
    pub pictures: usize,
    /// How long they took.
    pub seconds: f64,
    /// Change from picture to picture where only the camera has moved.
    pub flicker: Option<f64>,
    /// From an input until a browser could show it; of what was played in real time.
    pub latency: Option<Latency>,
    /// What answers cost.
    pub cost: Cost,
    /// Packed size of answers.
    pub bytes: u64,
}

/// A picture that people saw.
#[derive(Clone)]
pub(super) struct Shot {
    /// Seconds since the beginning of the recording.
    pub t: f64,
    /// Line of the last input that it shows.
    pub shows: usize,
    /// As large as it was drawn.
    pub picture: Arc<Picture>,
    /// Share of its pixels that something was known of.
    pub known: f32,
}

impl Play {
    fn new(method: &str, mode: Mode) -> Self {
        Self {
            method: method.to_owned(),
            mode,
            shots: Vec::new(),
            standing: None,
            pictures: 0,
            seconds: 0.0,
            flicker: None,
            latency: None,
            cost: Cost::default(),
            bytes: 0,
        }
    }

    /// The states that its pictures show.
    pub fn states(&self) -> impl Iterator<Item = usize> + '_ {
        self.shots.iter().chain(&self.standing).map(|shot| shot.shows)
    }
}

/// The lines in which the pictures end that are compared: evenly spread, the last among them.
fn samples(script: &Script, count: usize) -> Vec<usize> {
    let is_shown = |(_, line): &(usize, &runtime::live::record::Line)| matches!(line.what, What::Shown { .. });
    let shown: Vec<usize> = script.lines.iter().enumerate().filter(is_shown).map(|(index, _)| index).collect();
    let count = count.min(shown.len());
    (1..=count).map(|number| shown[number * shown.len() / count - 1]).collect()
}

fn shot(script: &Script, frame: &Frame, shows: usize) -> Shot {
    let t = script.lines.get(shows).map_or(0.0, |line| line.t);
    Shot { t, shows, picture: Arc::clone(&frame.picture), known: frame.known }
}

/// Still frames at the end of what is played in step, as a replay has them.
const STILL_FRAMES: u32 = 9;

/// Plays it picture by picture.
///
/// # Errors
/// [`Failure`] if no worker draws.
pub(super) fn in_step(
    script: &Script,
    (name, chosen): (&str, &Chosen),
    ratio: Option<u32>,
    settings: &Settings,
    interrupt: &Interrupt,
    progress: &mut Progress,
) -> Result<Play, Failure> {
    let mode = Mode::InStep(ratio);
    let methods = script.methods(Some(chosen))?;
    let knobs = script.knobs(chosen.clone(), STILL_FRAMES);
    let mut player = Player::start(script.scene.clone(), knobs.clone(), options(settings), true)?;
    let (samples, mut made) = (samples(script, settings.samples), Play::new(name, mode));
    let all = crate::command::lockstep::pictures(&script.lines);
    let (mut flicker, mut compared) = (0.0, 0);
    let mut last: Option<reproject::Shown> = None;
    let mut is_interrupted = false;
    let asked = Asked { is_other_method: true, effort: mode.effort() };
    let began = Instant::now();
    let end = play(script, &mut player, (knobs, &methods), asked, &mut |played: &Played| {
        made.pictures += 1;
        if samples.contains(&played.line) {
            made.shots.push(shot(script, played.frame, played.shows));
        }
        let shown = played.player.live().shown().cloned();
        if let (true, Some(last), Some(shown)) = (played.has_only_looked, &last, &shown)
            && let Some((change, _)) = reproject::flicker(last, shown)
        {
            (flicker, compared) = (flicker + change, compared + 1);
        }
        last = shown;
        progress.running(&format!("{name}, {mode}"), made.pictures as f64 / all as f64);
        is_interrupted = interrupt.asked();
        // An error is the only way out; it is nobody's business.
        if is_interrupted { Err(Failure::Usage(String::new())) } else { Ok(()) }
    });
    made.seconds = began.elapsed().as_secs_f64();
    let end = match end {
        _ if is_interrupted => return Ok(made),
        end => end?,
    };
    made.standing = Some(shot(script, &end, last_input(script)));
    made.flicker = (compared > 0).then(|| flicker / f64::from(compared));
    (made.cost, made.bytes) = player.take_cost();
    Ok(made)
}

fn last_input(script: &Script) -> usize {
    script.lines.iter().rposition(|line| matches!(line.what, What::Look(_) | What::Edit(_))).unwrap_or(0)
}

/// Plays it as time goes, and stands for a second.
///
/// # Errors
/// [`Failure`] if no worker draws.
pub(super) fn in_real_time(
    script: &Script,
    (name, chosen): (&str, &Chosen),
    settings: &Settings,
    interrupt: &Interrupt,
    progress: &mut Progress,
) -> Result<Play, Failure> {
    let knobs = script.knobs(chosen.clone(), u32::MAX);
    let mut player = Player::start(script.scene.clone(), knobs, options(settings), false)?;
    // It begins as a recording does that begins at rest.
    let still = script.lines.iter().find_map(|line| match line.what {
        What::Shown { still, .. } => Some(still),
        _ => None,
    });
    player.wait_for(|frame| frame.moving.is_none() && frame.frames >= still.unwrap_or(0).max(1))?;
    player.take_latency();
    player.take_cost();
    let mut caught = Caught::new(script, settings.samples);
    let (begins, ends) =
        (script.lines.first().map_or(0.0, |line| line.t), script.lines.last().map_or(0.0, |line| line.t));
    let began = Instant::now();
    for (index, line) in script.lines.iter().enumerate() {
        let event = match &line.what {
            What::Look(camera) => Event::Look(*camera),
            What::Edit(changes) => Event::Edit(changes.clone()),
            // What was turned of the recorded method means nothing to this one.
            What::Turn(_) | What::Began {} | What::Overtaken {} | What::Shown { .. } => continue,
        };
        caught.wait(&mut player, began + seconds(line.t - begins));
        if interrupt.asked() {
            break;
        }
        player.handle(event);
        caught.inputs.push((player.live().revision(), index));
        progress.running(&format!("{name}, {}", Mode::RealTime), (line.t - begins) / (ends - begins).max(0.1));
    }
    let took = began.elapsed().as_secs_f64();
    let pictures = caught.moving;
    caught.wait(&mut player, Instant::now() + STANDING);
    let (cost, bytes) = player.take_cost();
    let latency = Some(player.take_latency());
    let standing = caught.last.clone();
    let shots = caught.nearest.into_iter().flatten().collect();
    Ok(Play { shots, standing, pictures, seconds: took, latency, cost, bytes, ..Play::new(name, Mode::RealTime) })
}

/// How long a view stands until it should be good.
const STANDING: Duration = Duration::from_secs(1);

fn seconds(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds.max(0.0)).unwrap_or_default()
}

fn options(settings: &Settings) -> ClusterOptions {
    ClusterOptions { embedded: Some(settings.threads), give_way: true, ..ClusterOptions::default() }
}

/// Pictures as they come.
struct Caught<'a> {
    script: &'a Script,
    /// The input that was the last at each revision.
    inputs: Vec<(u64, usize)>,
    /// States that should be compared, by line …
    wanted: Vec<usize>,
    /// … and the picture of each that shows it, or what comes next to it.
    nearest: Vec<Option<Shot>>,
    last: Option<Shot>,
    moving: usize,
}

impl<'a> Caught<'a> {
    fn new(script: &'a Script, count: usize) -> Self {
        let is_input = |line: usize| matches!(script.lines[line].what, What::Look(_) | What::Edit(_));
        let wanted =
            samples(script, count).into_iter().filter_map(|shown| (0..shown).rev().find(|line| is_input(*line)));
        let wanted: Vec<usize> = wanted.collect();
        let nearest = vec![None; wanted.len()];
        Self { script, inputs: Vec::new(), wanted, nearest, last: None, moving: 0 }
    }

    fn wait(&mut self, player: &mut Player, until: Instant) {
        loop {
            let left = until.saturating_duration_since(Instant::now());
            if let Some(frame) = player.recv(left) {
                self.catch(&frame);
            } else if left.is_zero() {
                return;
            }
        }
    }

    fn catch(&mut self, frame: &Frame) {
        let at = self.inputs.partition_point(|(revision, _)| *revision <= frame.revision);
        let Some((_, shows)) = at.checked_sub(1).map(|at| self.inputs[at]) else { return };
        self.moving += usize::from(frame.moving.is_some());
        let shot = shot(self.script, frame, shows);
        for (wanted, nearest) in self.wanted.iter().zip(&mut self.nearest).filter(|_| frame.moving.is_some()) {
            let is_nearer = |than: &Shot| shows.abs_diff(*wanted) <= than.shows.abs_diff(*wanted);
            if nearest.as_ref().is_none_or(is_nearer) {
                *nearest = Some(shot.clone());
            }
        }
        self.last = Some(shot);
    }
}
