//! A master that is killed while somebody edits, again and again.

use std::path::Path;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::master::{Master, Watcher};
use super::room;
use super::session::{kept, until};

const FLAGS: [&str; 9] =
    ["--size", "64x48", "--rest-after", "2", "--preset", "draft", "--workers", "embedded:1", "--resume"];

/// What somebody has made of two candles, W/sr: both are always of the same strength. With what undoing and redoing lead to.
#[derive(Clone, Debug, PartialEq)]
struct State {
    strength: u32,
    before: Vec<u32>,
    after: Vec<u32>,
}

impl State {
    fn edit(&mut self, strength: u32) {
        self.before.push(std::mem::replace(&mut self.strength, strength));
        self.after.clear();
    }

    /// Whether there was something.
    fn undo(&mut self) -> bool {
        let Some(before) = self.before.pop() else { return false };
        self.after.push(std::mem::replace(&mut self.strength, before));
        true
    }

    fn redo(&mut self) -> bool {
        let Some(after) = self.after.pop() else { return false };
        self.before.push(std::mem::replace(&mut self.strength, after));
        true
    }

    /// As far as it outlives a master.
    fn kept(mut self) -> Self {
        for steps in [&mut self.before, &mut self.after] {
            steps.drain(..steps.len().saturating_sub(runtime::live::kept::STEPS_KEPT));
        }
        self
    }
}

/// The candles in the scene's files.
const BEGINNING: u32 = 100;
const CANDLES: [usize; 2] = [0, 1];

/// As xorshift draws, below that.
fn draw(seed: &mut u64, below: u64) -> u64 {
    *seed ^= *seed << 13;
    *seed ^= *seed >> 7;
    *seed ^= *seed << 17;
    *seed % below
}

/// Both candles in one edit.
fn edit(strength: u32) -> Value {
    let intensity = [strength; 3];
    let candle = |light: usize| {
        let position = [0.5 * light as f64 - 0.75, 1.4, 0.8];
        json!({ "Light": { "light": light, "value": { "Point": { "position": position, "intensity": intensity } } } })
    };
    json!({ "say": "edit", "changes": CANDLES.map(candle), "gesture": null })
}

/// How strong both are after these changes, by a list of lights before; they must be the same.
fn strength(lights: &Value, edited: &Value) -> u32 {
    let changes = edited["changes"].as_array().expect("changes");
    let [first, second] = CANDLES.map(|light| {
        let of = |change: &&Value| change["Light"]["light"] == light;
        let value = changes.iter().rev().find(of).map_or(&lights[light], |change| &change["Light"]["value"]);
        value["Point"]["intensity"][0].as_f64().expect("a number") as u32
    });
    assert_eq!(first, second, "half of an edit: {edited}");
    first
}

/// The next strength is another than all before.
struct Person {
    seed: u64,
    state: State,
    next: u32,
}

impl Person {
    /// Does something; what was told of it has come when this returns.
    async fn act(&mut self, watcher: &mut Watcher) {
        let message = match draw(&mut self.seed, 10) {
            0 | 1 if self.state.undo() => json!({ "say": "undo" }),
            2 if self.state.redo() => json!({ "say": "redo" }),
            _ => {
                self.next += 1;
                self.state.edit(self.next);
                edit(self.next)
            }
        };
        watcher.send(message).await;
        watcher.recv("edited").await;
    }
}

/// What is told of the edit after which there are so many steps to undo and to redo; what was made before may be told late.
async fn after(watcher: &mut Watcher, steps: [usize; 2]) -> Value {
    loop {
        let edited = watcher.recv("edited").await;
        if edited["steps"] == json!(steps) {
            return edited;
        }
    }
}

/// Kills, each by a seed, of masters that go on where the one before was killed.
async fn storm(kills: u64, folder: &Path, user: &Path) {
    let state = State { strength: BEGINNING, before: Vec::new(), after: Vec::new() };
    let mut person = Person { seed: 0, state, next: 1000 };
    for kill in 1..=kills {
        person.seed = kill.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let master = Master::of_user(user, "127.0.0.1:0", folder, &FLAGS);
        let mut watcher = Watcher::join(&master).await;
        watcher.recv("edited").await;
        // What has been kept for a moment is there whatever comes.
        for _ in 0..=draw(&mut person.seed, 20) {
            person.act(&mut watcher).await;
        }
        person.next += 1;
        person.state.edit(person.next);
        watcher.send(edit(person.next)).await;
        watcher.recv("edited").await;
        let last = format!("[{0}.0,{0}.0,{0}.0]", person.next);
        until("it is kept", || kept(user).iter().any(|session| session["edits"].to_string().contains(&last))).await;
        let mut states = vec![person.state.clone()];
        let ends = Instant::now() + Duration::from_millis(draw(&mut person.seed, 900));
        while Instant::now() < ends {
            person.act(&mut watcher).await;
            states.push(person.state.clone());
            tokio::time::sleep(Duration::from_millis(draw(&mut person.seed, 8))).await;
        }
        drop(master);

        // The next one is in a state that was there, as a whole.
        let master = Master::of_user(user, "127.0.0.1:0", folder, &FLAGS);
        let mut watcher = Watcher::join(&master).await;
        let welcome = watcher.recv("welcome").await;
        let (lights, steps) = (&welcome["scene"]["lights"], &welcome["steps"]);
        // What waits to be made follows.
        let is = strength(lights, &watcher.recv("edited").await);
        let known = states.into_iter().rev().map(State::kept);
        let mut known =
            known.filter(|state| state.strength == is && json!([state.before.len(), state.after.len()]) == *steps);
        person.state = known.next().unwrap_or_else(|| panic!("kill {kill}: it came back with {is}, steps {steps}"));
        // And so is what undoing leads to.
        let Some(before) = person.state.before.last() else { continue };
        let [undo, redo] = [person.state.before.len(), person.state.after.len()];
        watcher.send(json!({ "say": "undo" })).await;
        assert_eq!(strength(lights, &after(&mut watcher, [undo - 1, redo + 1]).await), *before, "kill {kill}");
        watcher.send(json!({ "say": "redo" })).await;
        assert_eq!(strength(lights, &after(&mut watcher, [undo, redo]).await), is, "kill {kill}");
    }
}

/// A few times, or as often as IGI_TEST_KILLS says.
#[tokio::test]
async fn a_master_killed_in_a_storm_of_edits_comes_back_in_a_state_that_was_there() {
    let (folder, user) = (tempfile::tempdir().expect("a folder"), tempfile::tempdir().expect("a folder"));
    room::write_candles(folder.path(), [BEGINNING as f32; 4]);
    let kills =
        std::env::var("IGI_TEST_KILLS").ok().map_or(2, |kills| kills.parse().expect("IGI_TEST_KILLS: a number"));
    storm(kills, folder.path(), user.path()).await;
}
