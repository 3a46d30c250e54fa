//! How a session outlives its master: its state goes to the writer when it has changed, and what an earlier master has kept
//! is taken up, if people want that.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use frame::live::Event;
use frame::live::edits::{Edits, Step};
use protocol::parts::Manifest;
use scenes::views::LampState;
use scenes::{Camera, Change, SavedView, Scene, Shiner, Solid};
use serde_json::json;

use super::{Session, mixing};
use crate::console::Console;
use crate::display::hues::Hues;
use crate::display::message::{Offer, ServerMessage, Viewpoint};
use crate::live::kept::folder::{Opened, Slot};
use crate::live::kept::writer::Writer;
use crate::live::kept::{Files, KeptSession, LAMP_STATES_MAX, STEPS_KEPT, VERSION, VIEWS_MAX};

/// How the session is kept.
pub(super) struct Keeping {
    /// `None` if there is no folder for it.
    writer: Option<Writer>,
    /// Where the scene is, as its files describe it, and hashes of its parts and of all of it.
    path: PathBuf,
    scene: Arc<Scene>,
    manifest: Manifest,
    files: String,
    /// What an earlier master has kept, until it is taken up or forgotten.
    offer: Option<(Slot, KeptSession)>,
    /// Something has changed since the writer was given the state.
    is_stale: bool,
    given_at: Instant,
    /// Why it could not be kept, as viewers were sent.
    trouble: Option<String>,
}

/// The writer is given a changed state after this time: more than this and one writing of a file is never lost.
const BETWEEN: Duration = Duration::from_millis(400);

impl Session {
    /// Keeps the session from now on, and offers what an earlier master has kept. `scene` is as the files say.
    pub fn keep_session(&mut self, opened: Opened, path: PathBuf, scene: Arc<Scene>) -> std::io::Result<()> {
        let Opened { own, mut found, views, .. } = opened;
        let Some(manifest) = self.driver.cluster.manifest().cloned() else { return Ok(()) };
        let files = Files { scene: &scene, manifest: &manifest }.print();
        // Those of the scene's file are older.
        if !views.is_empty() {
            self.views = views;
        }
        let mut take = |has_edits: bool| {
            let place = found.iter().position(|(_, session)| session.has_edits() == has_edits)?;
            Some(found.remove(place))
        };
        // Views alone need no answer: that session goes on.
        let (offer, own) = (take(true), take(false).map(|(slot, _)| slot).or(own));
        let (writer, given_at) = (own.map(Writer::start).transpose()?, Instant::now());
        let (is_stale, trouble) = (!self.views.is_empty(), None);
        self.keeping = Some(Keeping { writer, path, scene, manifest, files, offer, is_stale, given_at, trouble });
        Ok(())
    }

    /// Shows views of a file, too.
    pub(super) fn add_views(&mut self, views: Vec<SavedView>) {
        for view in views {
            if !self.views.contains(&view) && self.views.len() < VIEWS_MAX {
                self.views.push(view);
            }
        }
    }

    /// Something that is kept has changed.
    pub(super) fn note_change(&mut self) {
        if let Some(keeping) = &mut self.keeping {
            keeping.is_stale = true;
        }
    }

    /// Gives the writer the state if it is time to, and sends a notice if the last could not be kept.
    pub(super) fn keep_if_stale(&mut self) {
        let Some(keeping) = &mut self.keeping else { return };
        let trouble = keeping.writer.as_ref().and_then(Writer::trouble);
        let is_due = keeping.is_stale && keeping.given_at.elapsed() >= BETWEEN;
        if trouble != keeping.trouble {
            keeping.trouble.clone_from(&trouble);
            if let Some(reason) = trouble {
                tracing::error!("the session cannot be kept: {reason}");
                self.hub.send_all(&ServerMessage::Notice { text: format!("This session cannot be kept: {reason}") });
            }
        }
        if is_due {
            self.give_to_writer();
        }
    }

    fn give_to_writer(&mut self) {
        let state = self.state();
        let Some((keeping, session)) = self.keeping.as_mut().zip(state) else { return };
        (keeping.is_stale, keeping.given_at) = (false, Instant::now());
        if let Some(writer) = &keeping.writer {
            writer.write(session);
        }
    }

    /// All that is kept, as it is now, with the edits that wait to be made.
    fn state(&self) -> Option<KeptSession> {
        let Keeping { path, scene, manifest, files, .. } = self.keeping.as_ref()?;
        let mut changes = self.changes_from(scene)?;
        changes.retain(|change| !matches!(change, Change::Solid { .. }));
        let saved = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
        Some(KeptSession {
            igi_kept: VERSION,
            scene: path.clone(),
            files: files.clone(),
            saved,
            edits: Files { scene, manifest }.kept(changes),
            solids: self.solids(scene)?,
            history: self.edits.history(STEPS_KEPT),
            hues: self.hues.clone(),
            camera: self.camera(),
            tone: self.tone_settings(),
            views: self.views.clone(),
            presets: self.presets.clone(),
        })
    }

    /// What leads from an earlier state of the scene to what it is now, with the edits that wait to be made.
    pub(super) fn changes_from(&self, was: &Scene) -> Option<Vec<Change>> {
        let mut changes = was.changes_to(self.scene()?);
        for change in self.driver.live.waiting() {
            changes.retain(|earlier| !change.supersedes(earlier));
            // One that only restores what was is no edit.
            changes.extend(Some(change.clone()).filter(|change| change.undo(was).as_ref() != Some(change)));
        }
        Some(changes)
    }

    /// The photometric solids that stand behind those of an earlier state of the scene, with those that wait.
    pub(super) fn solids(&self, was: &Scene) -> Option<Vec<Change>> {
        let is_solid = |change: &Change| matches!(change, Change::Solid { .. });
        if self.scene()?.textures.len() <= was.textures.len() && !self.driver.live.waiting().iter().any(is_solid) {
            return Some(Vec::new());
        }
        let scene = self.edited_scene()?;
        let brought = (0..).zip(&scene.textures).skip(was.textures.len());
        let change = |(texture, solid): (u32, &Arc<scenes::Texture>)| {
            Some(Change::Solid { texture, value: Solid::of(solid)?.into() })
        };
        Some(brought.filter_map(change).collect())
    }

    /// The message that says what an earlier master has kept.
    pub(super) fn offer_message(&self) -> ServerMessage {
        let offer = self.keeping.as_ref().and_then(|keeping| Some((keeping, keeping.offer.as_ref()?)));
        let offer = offer.map(|(keeping, (_, session))| {
            let files_changed = session.files != keeping.files;
            Offer { saved: session.saved, edits: session.edits.len(), files_changed }
        });
        ServerMessage::Offer { offer }
    }

    /// The same, a sentence for the command line; `None` if there is nothing to take up.
    pub fn offer_line(&self) -> Option<String> {
        let keeping = self.keeping.as_ref()?;
        let (_, session) = keeping.offer.as_ref()?;
        let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
        let changed = if session.files == keeping.files { "" } else { "; the scene's files have changed since" };
        let edits = counted(session.edits.len(), "edit");
        let ago = crate::spoken::duration(now.saturating_sub(session.saved) as f64);
        Some(format!("kept from {ago} ago: {edits} of this scene{changed}"))
    }

    /// Takes up what an earlier master has kept, as far as it fits, and returns a sentence that says what came of it.
    ///
    /// # Errors
    /// In words: there is nothing to take up, or no scene yet.
    pub fn take_up(&mut self) -> Result<String, String> {
        let scene = mixing::scene(self.mixing.as_ref(), &self.driver).ok_or("there is no scene yet")?;
        let keeping = self.keeping.as_mut().ok_or("no session is kept")?;
        let (slot, mut session) = keeping.offer.take().ok_or("there is nothing to take up")?;
        let mut with_solids = Scene::clone(&keeping.scene);
        let (was, is) = (session.textures_of_files(), with_solids.textures.len());
        let solids: Vec<Change> = session.solids.drain(..).map(|solid| solid.behind_textures(was, is)).collect();
        let solids: Vec<Change> = solids.into_iter().filter(|solid| solid.apply(&mut with_solids).is_ok()).collect();
        session.edits.iter_mut().for_each(|edit| edit.change = edit.change.clone().behind_textures(was, is));
        let files = Files { scene: &with_solids, manifest: &keeping.manifest };
        let has_changed = session.files != keeping.files;
        let (mut changes, left_out) = session.fitting(files);
        let mut now = scene.clone();
        solids.iter().for_each(|solid| drop(solid.apply(&mut now)));
        changes.retain(|change| change.check(&now).is_ok());
        let history: Option<[Vec<Step>; 2]> = session.fitting_history(files);
        match history.filter(|_| self.edits.steps() == [0, 0]) {
            Some(history) => self.edits = Edits::with_history(history),
            None if changes.is_empty() => {}
            None => self.edits.remember(scene, self.driver.live.waiting(), &changes, None),
        }
        match &keeping.writer {
            Some(writer) => writer.go_on_in(slot),
            None => keeping.writer = Writer::start(slot).ok(),
        }
        let hues = if has_changed || !session.hues.is_sound(scene) { Hues::default() } else { session.hues };
        let taken = counted(changes.len(), "edit");
        self.make([solids, changes].concat(), None)?;
        self.hues.lights.extend(hues.lights);
        self.hues.materials.extend(hues.materials);
        self.hues.own.extend(hues.own);
        self.hues.sky = hues.sky.or(self.hues.sky);
        self.add_views(session.views);
        self.add_presets(session.presets);
        let Camera { width, height, .. } = self.camera();
        let camera = Camera { width, height, ..session.camera };
        self.handle_event(Event::Look(camera));
        self.settings.tone = session.tone.into();
        self.apply_settings();
        self.give_to_writer();
        let mut text = format!("{taken} taken up");
        if has_changed {
            text += "; the scene's files have changed since they were made";
        }
        if !left_out.is_empty() {
            let shown = left_out.iter().take(NAMED_MAX).map(String::as_str).collect::<Vec<_>>().join(", ");
            let more = left_out.len().saturating_sub(NAMED_MAX);
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            text += &format!("; what was done to {shown}{more} fits no longer and is left out");
        }
        self.hub.send_all(&ServerMessage::Look { camera });
        self.hub.send_all(&self.hues_message());
        self.hub.send_all(&self.views_message());
        self.hub.send_all(&self.presets_message());
        self.hub.send_all(&self.offer_message());
        self.hub.send_all(&ServerMessage::Notice { text: text.clone() });
        Ok(text)
    }

    /// Forgets what an earlier master has kept, but for its views.
    pub fn start_afresh(&mut self) {
        if let Some((slot, _)) = self.keeping.as_mut().and_then(|keeping| keeping.offer.take()) {
            slot.forget();
            self.give_to_writer();
        }
        self.hub.send_all(&self.offer_message());
    }

    /// Has the last state written, and prints what came of it.
    pub(super) fn finish_keeping(&mut self, console: &Console) {
        if self.keeping.as_ref().is_some_and(|keeping| keeping.is_stale) {
            self.give_to_writer();
        }
        let edits = self.state().map_or(0, |session| session.edits.len());
        let Some(Keeping { writer, offer, .. }) = self.keeping.take() else { return };
        let outcome = writer.map_or(Err("sessions of other masters have all places".into()), Writer::finish);
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
        console.line(&line);
        if offer.is_some() {
            console.line("what was kept before is kept still: --resume takes it up, --fresh forgets it");
        }
        let path = path.map(|path| path.display().to_string());
        console.emit("kept", json!({ "path": path, "edits": edits }));
    }

    pub(super) fn save_view(
        &mut self,
        from: &Viewpoint,
        name: String,
        picture: Option<String>,
        with_lamps: bool,
    ) -> Result<(), String> {
        if self.views.len() >= VIEWS_MAX {
            return Err(format!("{VIEWS_MAX} views are saved, which is all there is room for: forget one first"));
        }
        let lamps = if with_lamps { self.lamp_states().ok_or("there is no scene yet")? } else { Vec::new() };
        let Viewpoint { origin, target, up, fov_y_deg, two_point, cut, .. } = *from;
        let view = SavedView { name, origin, target, up, fov_y_deg, two_point, cut, picture, lamps };
        view.check()?;
        let states: usize = self.views.iter().map(|view| view.lamps.len()).sum();
        if states + view.lamps.len() > LAMP_STATES_MAX {
            return Err("there is no room for more lamps in saved views: forget some views first".into());
        }
        self.views.push(view);
        self.send_views();
        Ok(())
    }

    pub(super) fn name_view(&mut self, number: usize, name: String) -> Result<(), String> {
        let view = self.views.get(number).ok_or_else(|| no_view(number))?;
        let view = SavedView { name, ..view.clone() };
        view.check()?;
        self.views[number] = view;
        self.send_views();
        Ok(())
    }

    /// Has lamps as they are in a view, as one edit.
    pub(super) fn relight(&mut self, number: usize) -> Result<(), String> {
        let view = self.views.get(number).ok_or_else(|| no_view(number))?;
        let changes = view.relit(&self.edited_scene().ok_or("there is no scene yet")?);
        if changes.is_empty() { Ok(()) } else { self.edit(changes, None, None) }
    }

    /// All lamps as they are, those included that were turned off here.
    pub(super) fn lamp_states(&self) -> Option<Vec<LampState>> {
        let scene = self.edited_scene()?;
        Some(LampState::all(&scene, |lamp| self.hues.of(lamp).is_some() || matches!(lamp, Shiner::Light(_))))
    }

    /// The scene with the edits that wait to be made.
    pub(super) fn edited_scene(&self) -> Option<Scene> {
        let mut scene = self.scene()?.clone();
        // Whoever sent them has checked them.
        self.driver.live.waiting().iter().for_each(|change| drop(change.apply(&mut scene)));
        Some(scene)
    }

    pub(super) fn forget_view(&mut self, number: usize) -> Result<(), String> {
        if number >= self.views.len() {
            return Err(no_view(number));
        }
        self.views.remove(number);
        self.send_views();
        Ok(())
    }

    fn send_views(&mut self) {
        self.note_change();
        self.hub.send_all(&self.views_message());
    }

    pub(super) fn views_message(&self) -> ServerMessage {
        ServerMessage::Views { views: self.views.clone() }
    }

    pub(super) fn hues_message(&self) -> ServerMessage {
        ServerMessage::Hues { hues: self.hues.clone() }
    }
}

fn no_view(number: usize) -> String {
    format!("there is no view {}", number.saturating_add(1))
}

/// Things that are named when they do not fit.
const NAMED_MAX: usize = 5;

/// A number of things, in words.
pub fn counted(count: usize, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}
