//! What the studio does so that a session outlives it: it hands its state on when that has changed, and takes up what an
//! earlier master has kept, if people want that.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use frame::live::Event;
use frame::live::edits::{Edits, Step};
use protocol::parts::Manifest;
use scenes::{Camera, Scene};
use serde_json::json;

use super::Studio;
use crate::console::Console;
use crate::display::hues::Hues;
use crate::display::message::{Offer, ServerMessage, Viewpoint};
use crate::live::keeper::{Keeper, Opened, Slot};
use crate::live::session::{Files, STEPS_KEPT, Session, VERSION, VIEWS_MAX};

/// How the session is kept.
pub(super) struct Keeping {
    keeper: Option<Keeper>,
    /// Where the scene is, what its files said, hashes of its parts, and of all of it.
    path: PathBuf,
    scene: Arc<Scene>,
    manifest: Manifest,
    files: String,
    /// What an earlier master has kept, as long as nobody has said what to do with it.
    offer: Option<(Slot, Session)>,
    /// Something has changed since it was handed on last.
    is_stale: bool,
    handed_on: Instant,
    /// Why it could not be kept, as people were told.
    trouble: Option<String>,
}

/// A changed state is handed on after so long: more than this and one writing of a file is never lost.
const BETWEEN: Duration = Duration::from_millis(400);

impl Studio {
    /// Keeps the session from now on, and offers what an earlier master has kept. `scene` is as the files say.
    pub fn keep_session(&mut self, opened: Opened, path: PathBuf, scene: Arc<Scene>) -> std::io::Result<()> {
        let Opened { own, mut found, views, .. } = opened;
        let Some(manifest) = self.driver.cluster.manifest().cloned() else { return Ok(()) };
        let files = Files { scene: &scene, manifest: &manifest }.print();
        self.views = views;
        let mut take = |has_edits: bool| {
            let place = found.iter().position(|(_, session)| session.has_edits() == has_edits)?;
            Some(found.remove(place))
        };
        // Views alone need no answer: that session goes on.
        let (offer, own) = (take(true), take(false).map(|(slot, _)| slot).or(own));
        let (keeper, handed_on) = (own.map(Keeper::start).transpose()?, Instant::now());
        let (is_stale, trouble) = (!self.views.is_empty(), None);
        self.keeping = Some(Keeping { keeper, path, scene, manifest, files, offer, is_stale, handed_on, trouble });
        Ok(())
    }

    /// Something that is kept has changed.
    pub(super) fn note_change(&mut self) {
        if let Some(keeping) = &mut self.keeping {
            keeping.is_stale = true;
        }
    }

    /// Hands the state on if it is time to, and says if the last could not be kept.
    pub(super) fn keep_if_stale(&mut self) {
        let Some(keeping) = &mut self.keeping else { return };
        let trouble = keeping.keeper.as_ref().and_then(Keeper::trouble);
        let is_due = keeping.is_stale && keeping.handed_on.elapsed() >= BETWEEN;
        if trouble != keeping.trouble {
            keeping.trouble.clone_from(&trouble);
            if let Some(reason) = trouble {
                tracing::error!("the session cannot be kept: {reason}");
                self.send_all(&ServerMessage::Notice { text: format!("This session cannot be kept: {reason}") });
            }
        }
        if is_due {
            self.hand_on();
        }
    }

    fn hand_on(&mut self) {
        let state = self.state();
        let Some((keeping, session)) = self.keeping.as_mut().zip(state) else { return };
        (keeping.is_stale, keeping.handed_on) = (false, Instant::now());
        if let Some(keeper) = &keeping.keeper {
            keeper.keep(session);
        }
    }

    /// All that is kept, as it is now, with the edits that wait to be made.
    fn state(&self) -> Option<Session> {
        let Keeping { path, scene, manifest, files, .. } = self.keeping.as_ref()?;
        let mut changes = scene.changes_to(self.driver.cluster.scene()?);
        for change in self.driver.live.waiting() {
            changes.retain(|earlier| !change.supersedes(earlier));
            // One that only restores what the files say is no edit.
            changes.extend(Some(change.clone()).filter(|change| change.undo(scene).as_ref() != Some(change)));
        }
        let saved = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
        Some(Session {
            igi_kept: VERSION,
            scene: path.clone(),
            files: files.clone(),
            saved,
            edits: Files { scene, manifest }.kept(changes),
            history: self.edits.history(STEPS_KEPT),
            hues: self.hues.clone(),
            camera: self.driver.live.camera(),
            tone: self.tone_settings(),
            views: self.views.clone(),
        })
    }

    /// What an earlier master has kept, for viewers.
    pub(super) fn offer_message(&self) -> ServerMessage {
        let offer = self.keeping.as_ref().and_then(|keeping| Some((keeping, keeping.offer.as_ref()?)));
        let offer = offer.map(|(keeping, (_, session))| {
            let files_changed = session.files != keeping.files;
            Offer { saved: session.saved, edits: session.edits.len(), files_changed }
        });
        ServerMessage::Offer { offer }
    }

    /// The same, in words for the command line.
    pub fn offer_in_words(&self) -> Option<String> {
        let keeping = self.keeping.as_ref()?;
        let (_, session) = keeping.offer.as_ref()?;
        let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
        let changed = if session.files == keeping.files { "" } else { "; the scene's files have changed since" };
        let edits = counted(session.edits.len(), "edit");
        let ago = crate::spoken::duration(now.saturating_sub(session.saved) as f64);
        Some(format!("kept from {ago} ago: {edits} of this scene{changed}"))
    }

    /// Takes up what an earlier master has kept, as far as it fits; in words, what came of it.
    ///
    /// # Errors
    /// In words: there is nothing, or no scene yet.
    pub fn take_up(&mut self) -> Result<String, String> {
        let scene = self.driver.cluster.scene().ok_or("there is no scene yet")?;
        let keeping = self.keeping.as_mut().ok_or("no session is kept")?;
        let (slot, session) = keeping.offer.take().ok_or("there is nothing to take up")?;
        let files = Files { scene: &keeping.scene, manifest: &keeping.manifest };
        let has_changed = session.files != keeping.files;
        let (mut changes, left_out) = session.fitting(files);
        changes.retain(|change| change.check(scene).is_ok());
        let history: Option<[Vec<Step>; 2]> = session.fitting_history(files);
        match history.filter(|_| self.edits.steps() == [0, 0]) {
            Some(history) => self.edits = Edits::with_history(history),
            None if changes.is_empty() => {}
            None => self.edits.remember(scene, self.driver.live.waiting(), &changes, None),
        }
        match keeping.keeper.take() {
            Some(keeper) => {
                keeper.go_on_in(slot);
                keeping.keeper = Some(keeper);
            }
            None => keeping.keeper = Keeper::start(slot).ok(),
        }
        let hues = if has_changed || !session.hues.is_sound(scene) { Hues::default() } else { session.hues };
        let taken = counted(changes.len(), "edit");
        self.make(changes, None)?;
        self.hues.lights.extend(hues.lights);
        self.hues.materials.extend(hues.materials);
        for view in session.views {
            if !self.views.contains(&view) && self.views.len() < VIEWS_MAX {
                self.views.push(view);
            }
        }
        let Camera { width, height, .. } = self.driver.live.camera();
        let camera = Camera { width, height, ..session.camera };
        self.handle(Event::Look(camera));
        self.manner.tone = session.tone.into();
        self.develop_otherwise();
        self.hand_on();
        let mut words = format!("{taken} taken up");
        if has_changed {
            words += "; the scene's files have changed since they were made";
        }
        if !left_out.is_empty() {
            let shown = left_out.iter().take(NAMED_MAX).map(String::as_str).collect::<Vec<_>>().join(", ");
            let more = left_out.len().saturating_sub(NAMED_MAX);
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            words += &format!("; what was done to {shown}{more} fits no longer and is left out");
        }
        self.send_all(&ServerMessage::Look { camera });
        self.send_all(&self.hues_message());
        self.send_all(&self.views_message());
        self.send_all(&self.offer_message());
        self.send_all(&ServerMessage::Notice { text: words.clone() });
        Ok(words)
    }

    /// Forgets what an earlier master has kept, but for its views.
    pub fn start_afresh(&mut self) {
        if let Some((slot, _)) = self.keeping.as_mut().and_then(|keeping| keeping.offer.take()) {
            slot.forget();
            self.hand_on();
        }
        self.send_all(&self.offer_message());
    }

    /// The last state is written, and what became of it is said.
    pub(super) fn finish_keeping(&mut self, narrator: &Console) {
        if self.keeping.as_ref().is_some_and(|keeping| keeping.is_stale) {
            self.hand_on();
        }
        let edits = self.state().map_or(0, |session| session.edits.len());
        let Some(Keeping { keeper, offer, .. }) = self.keeping.take() else { return };
        let outcome = keeper.map_or(Err("sessions of other masters have all places".into()), Keeper::finish);
        let (line, path) = match outcome {
            Ok(Some(path)) if edits == 0 => {
                (format!("nothing is edited; saved views are kept in {}", path.display()), Some(path))
            }
            Ok(Some(path)) => {
                let edits = counted(edits, "edit");
                (format!("{edits} kept in {}; --resume goes on from there", path.display()), Some(path))
            }
            Ok(None) => ("nothing is edited: there is nothing to keep".into(), None),
            Err(reason) => (format!("the session is not kept: {reason}"), None),
        };
        narrator.line(&line);
        if offer.is_some() {
            narrator.line("what was kept before is kept still: --resume takes it up, --fresh forgets it");
        }
        let path = path.map(|path| path.display().to_string());
        narrator.emit("kept", json!({ "path": path, "edits": edits }));
    }

    /// Saves or forgets a view.
    pub(super) fn save_view(&mut self, view: Viewpoint) -> Result<(), String> {
        view.camera([4, 3])?;
        if self.views.len() >= VIEWS_MAX {
            return Err(format!("{VIEWS_MAX} views are saved, which is all there is room for: forget one first"));
        }
        self.views.push(Viewpoint { at: 0.0, ..view });
        self.send_views();
        Ok(())
    }

    pub(super) fn forget_view(&mut self, number: usize) -> Result<(), String> {
        if number >= self.views.len() {
            return Err(format!("there is no view {}", number.saturating_add(1)));
        }
        self.views.remove(number);
        self.send_views();
        Ok(())
    }

    fn send_views(&mut self) {
        self.note_change();
        self.send_all(&self.views_message());
    }

    pub(super) fn views_message(&self) -> ServerMessage {
        ServerMessage::Views { views: self.views.clone() }
    }

    pub(super) fn hues_message(&self) -> ServerMessage {
        ServerMessage::Hues { hues: self.hues.clone() }
    }
}

/// Things that are named when they do not fit.
const NAMED_MAX: usize = 5;

pub(crate) fn counted(count: usize, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}
