//! How lamps are, under names: kept with the session and in the saved scene. Who looks goes from one to the other, at once or
//! slowly, by edits as any others.

use scenes::Preset;

use super::Session;
use crate::display::message::ServerMessage;
use crate::live::kept::{LAMP_STATES_MAX, PRESETS_MAX};

impl Session {
    pub(super) fn save_preset(&mut self, name: String) -> Result<(), String> {
        let preset = Preset { name, lamps: self.lamp_states().ok_or("there is no scene yet")? };
        preset.check()?;
        let others = || self.presets.iter().filter(|other| other.name != preset.name);
        if others().count() >= PRESETS_MAX {
            return Err(format!("{PRESETS_MAX} presets are all that there is room for: forget one first"));
        }
        if others().map(|other| other.lamps.len()).sum::<usize>() + preset.lamps.len() > LAMP_STATES_MAX {
            return Err("there is no room for more lamps in presets: forget some first".into());
        }
        match self.presets.iter_mut().find(|other| other.name == preset.name) {
            Some(known) => *known = preset,
            None => self.presets.push(preset),
        }
        self.send_presets();
        Ok(())
    }

    pub(super) fn forget_preset(&mut self, number: usize) -> Result<(), String> {
        if number >= self.presets.len() {
            return Err(format!("there is no preset {}", number.saturating_add(1)));
        }
        self.presets.remove(number);
        self.send_presets();
        Ok(())
    }

    /// Has those of a file as well.
    pub(super) fn add_presets(&mut self, presets: Vec<Preset>) {
        for preset in presets {
            if !self.presets.iter().any(|known| known.name == preset.name) && self.presets.len() < PRESETS_MAX {
                self.presets.push(preset);
            }
        }
    }

    fn send_presets(&mut self) {
        self.note_change();
        self.hub.send_all(&self.presets_message());
    }

    pub(super) fn presets_message(&self) -> ServerMessage {
        ServerMessage::Presets { presets: self.presets.clone() }
    }
}
