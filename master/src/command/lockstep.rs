//! A recording, picture by picture: time stands still while one is drawn, so that none is shown half. What comes out is a
//! function of the recording alone, whoever the workers are and however long they take.

use frame::Chosen;
use frame::front_end::Effort;
use frame::live::pace::EFFORT_MAX;
use frame::live::{Event, Frame, Knobs, Making, Step};

use crate::command::script::Script;
use runtime::failure::Failure;
use runtime::live::player::Player;
use runtime::live::record::{Line, What};

/// How pictures are asked for.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Asked {
    /// The recording was made with another method: where that drew, this one may have nothing to draw.
    pub(crate) is_other_method: bool,
    /// Samples for each pixel of every moving picture; `None`: as the recording has it.
    pub(crate) effort: Option<Effort>,
}

/// A moving picture.
pub(crate) struct Played<'a> {
    /// What people see.
    pub(crate) frame: &'a Frame,
    /// Line of the recording in which it ends.
    pub(crate) line: usize,
    /// Line of the last input that it shows.
    pub(crate) shows: usize,
    /// Nothing but the camera has changed since the one before.
    pub(crate) has_only_looked: bool,
    /// Who has drawn it.
    pub(crate) player: &'a Player,
}

/// Plays all of it, shows `watch` every moving picture, and gives the still one at the end, with how many there were.
/// `methods` as of [`Script::methods`]; `watch` may end it early by an error.
///
/// # Errors
/// [`Failure`] if the recording does not fit the method, no worker draws, or `watch` has had enough.
pub(crate) fn play(
    script: &Script,
    player: &mut Player,
    (mut knobs, methods): (Knobs, &[Chosen]),
    asked: Asked,
    watch: &mut dyn FnMut(&Played<'_>) -> Result<(), Failure>,
) -> Result<Frame, Failure> {
    let lines = &script.lines;
    let mut methods = methods.iter().skip(1);
    let shown: Vec<(Effort, [u32; 2])> = lines.iter().filter_map(|line| shown(&line.what, asked.effort)).collect();
    // Pictures that have ended so far, those that this method does not draw among them.
    let mut passed = 0;
    // The input that was the last so far at each revision.
    let mut inputs: Vec<(u64, usize)> = Vec::new();
    for (index, line) in lines.iter().enumerate() {
        match &line.what {
            What::Shown { batches, still, .. } => {
                passed += 1;
                if !player.live().is_moving() && !player.live().has_news() {
                    // A method that shows pictures at once has shown all inputs by now that another has gathered.
                    if asked.is_other_method {
                        continue;
                    }
                    return Err(script.wrong(line, &"a moving picture, and nothing that moves"));
                }
                let making = Making::Of { batches: *batches, still: *still };
                player.handle(Event::Turn(Knobs { making, ..player.live().knobs().clone() }));
                let frame = player.wait_for(|frame| frame.moving.is_some() && frame.ended)?;
                let other = frame.frames.max(1);
                if other != (*batches).max(1) && !asked.is_other_method {
                    let words = format!("a picture of {batches} batches, of which this program draws {other}");
                    return Err(script.wrong(line, &words));
                }
                let has_only_looked = index.checked_sub(1).is_some_and(|i| matches!(lines[i].what, What::Look(_)));
                let at = inputs.partition_point(|(revision, _)| *revision <= frame.revision);
                let shows = at.checked_sub(1).map_or(0, |at| inputs[at].1);
                watch(&Played { frame: &frame, line: index, shows, has_only_looked, player })?;
            }
            What::Began {} => player.handle(Event::Replayed(Step::Began)),
            What::Overtaken {} => {
                passed += 1;
                player.handle(Event::Replayed(Step::Overtaken));
            }
            // The picture that begins next has the effort of the next that was begun, and is made of as much.
            What::Look(_) | What::Edit(_) | What::Turn(_) => {
                if let What::Turn(_) = line.what {
                    knobs.method = methods.next().cloned().unwrap_or(knobs.method);
                }
                let next = shown.get(passed + player.live().under_way()).copied();
                let (effort, still) = (next.map(|(effort, _)| effort), next.map_or(0, |(_, [_, still])| still));
                player.handle(Event::Turn(Knobs { effort, making: Making::Held { still }, ..knobs.clone() }));
                match &line.what {
                    What::Look(camera) => player.handle(Event::Look(*camera)),
                    What::Edit(changes) => player.handle(Event::Edit(changes.clone())),
                    What::Turn(_) | What::Began {} | What::Overtaken {} | What::Shown { .. } => {}
                }
                inputs.push((player.live().revision(), index));
            }
        }
    }
    player.handle(Event::Turn(knobs));
    Ok(player.wait_for_rest()?)
}

/// At what effort a moving picture is drawn that ends so; of how many batches, and after how many still frames.
fn shown(what: &What, other: Option<Effort>) -> Option<(Effort, [u32; 2])> {
    match *what {
        What::Shown { effort, batches, still } => {
            let effort = other.unwrap_or(Effort(effort));
            Some((Effort(effort.0.clamp(EFFORT_MIN, EFFORT_MAX)), [batches, still]))
        }
        // Nobody sees it.
        What::Overtaken {} => Some((Effort(EFFORT_MIN), [1, 0])),
        What::Look(_) | What::Edit(_) | What::Turn(_) | What::Began {} => None,
    }
}

/// Number of moving pictures of a recording, at most.
pub(crate) fn pictures(lines: &[Line]) -> usize {
    lines.iter().filter(|line| matches!(line.what, What::Shown { .. })).count()
}

/// Less is no picture.
const EFFORT_MIN: f32 = 1e-4;
