//! Who watches: who hears what, who has the controls, who looks, and on how large a screen.

use std::collections::BTreeMap;
use std::sync::Arc;

use tokio::sync::mpsc;

use crate::display::hub::Viewer;
use crate::display::message::ServerMessage;

/// Everybody who is there.
#[derive(Default)]
pub(super) struct Audience {
    seats: BTreeMap<Viewer, Seat>,
    /// Who has the controls.
    holder: Option<Viewer>,
    /// Who has asked for them last, and was not answered yet.
    asker: Option<Viewer>,
}

struct Seat {
    ear: mpsc::Sender<Arc<str>>,
    /// Nobody sees what is shown there: the page lies behind others, the window is minimised.
    hidden: bool,
    /// Pixels of the place for the picture, as far as is known.
    screen: Option<[u32; 2]>,
}

/// What comes of asking for the controls.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Asked {
    /// They are the asker's.
    Given,
    /// Somebody else has to decide.
    Of(Viewer),
}

impl Audience {
    /// Somebody comes; the first has the controls.
    pub fn join(&mut self, viewer: Viewer, ear: mpsc::Sender<Arc<str>>) {
        self.seats.insert(viewer, Seat { ear, hidden: false, screen: None });
        self.holder.get_or_insert(viewer);
    }

    /// Somebody goes; the controls are free if he had them.
    pub fn leave(&mut self, viewer: Viewer) {
        self.seats.remove(&viewer);
        self.holder = self.holder.filter(|holder| *holder != viewer);
        self.asker = self.asker.filter(|asker| *asker != viewer);
    }

    /// A viewer is seen by nobody, or by somebody again.
    pub fn hide(&mut self, viewer: Viewer, hidden: bool) {
        if let Some(seat) = self.seats.get_mut(&viewer) {
            seat.hidden = hidden;
        }
    }

    /// A viewer has so many pixels for the picture.
    pub fn measure(&mut self, viewer: Viewer, screen: [u32; 2]) {
        if let Some(seat) = self.seats.get_mut(&viewer) {
            seat.screen = Some(screen);
        }
    }

    /// Pixels that whoever has the controls has for the picture.
    pub fn screen(&self) -> Option<[u32; 2]> {
        self.seats.get(&self.holder?)?.screen
    }

    /// Somebody looks.
    pub fn is_looking(&self) -> bool {
        self.seats.values().any(|seat| !seat.hidden)
    }

    /// Who has the controls.
    pub fn holder(&self) -> Option<Viewer> {
        self.holder
    }

    /// A viewer asks for the controls.
    pub fn take(&mut self, viewer: Viewer) -> Asked {
        match self.holder {
            Some(holder) if holder != viewer => {
                self.asker = Some(viewer);
                Asked::Of(holder)
            }
            _ => {
                self.holder = Some(viewer);
                Asked::Given
            }
        }
    }

    /// Who has the controls, `from`, gives them to another, or keeps them; then whoever has asked in vain.
    ///
    /// # Errors
    /// In words: nobody is there who could have them.
    pub fn give(&mut self, from: Viewer, to: Viewer) -> Result<Option<Viewer>, String> {
        if !self.seats.contains_key(&to) {
            return Err(format!("there is no viewer {to}"));
        }
        self.holder = Some(to);
        Ok(self.asker.take().filter(|_| to == from))
    }

    /// Sends a message to one viewer.
    pub fn send(&self, viewer: Viewer, message: &ServerMessage) {
        if let Some(seat) = self.seats.get(&viewer) {
            // A viewer whose messages pile up misses it, and may ask for everything again.
            let _ = seat.ear.try_send(message.encode());
        }
    }

    /// The message that says who has the controls, and who is there.
    pub fn controls(&self) -> ServerMessage {
        ServerMessage::Controls { holder: self.holder, viewers: self.seats.keys().copied().collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_has_the_controls_decides_how_large_pictures_are_and_any_eye_keeps_them_coming() {
        let mut audience = Audience::default();
        assert!(!audience.is_looking());
        for viewer in [1, 2] {
            audience.join(viewer, mpsc::channel(1).0);
        }
        audience.measure(2, [390, 844]);
        assert_eq!((audience.holder(), audience.screen()), (Some(1), None));
        audience.measure(1, [1157, 900]);
        assert_eq!(audience.screen(), Some([1157, 900]));
        assert_eq!(audience.take(2), Asked::Of(1));
        assert_eq!(audience.give(1, 1), Ok(Some(2)), "2 is told that 1 keeps them");
        assert_eq!((audience.take(2), audience.give(1, 2)), (Asked::Of(1), Ok(None)));
        assert_eq!(audience.screen(), Some([390, 844]));
        assert!(audience.give(2, 7).is_err());
        audience.hide(2, true);
        assert!(audience.is_looking());
        audience.hide(1, true);
        assert!(!audience.is_looking());
        audience.hide(2, false);
        audience.leave(2);
        assert_eq!((audience.is_looking(), audience.holder(), audience.screen()), (false, None, None));
        assert_eq!(audience.take(1), Asked::Given);
    }
}
