//! The viewers: where their messages go, which of them has the controls, which are in sight, and on how large a screen.

use std::collections::BTreeMap;
use std::sync::Arc;

use tokio::sync::mpsc;

use crate::display::hub::Viewer;
use crate::display::message::ServerMessage;

/// All viewers.
#[derive(Default)]
pub(super) struct Audience {
    seats: BTreeMap<Viewer, Seat>,
    /// The one that has the controls.
    holder: Option<Viewer>,
    /// The one that has asked for them last, until it is answered.
    asker: Option<Viewer>,
}

struct Seat {
    sender: mpsc::Sender<Arc<str>>,
    /// It is out of sight: the page lies behind others, the window is minimised.
    hidden: bool,
    /// Pixels of the place for the picture, as far as is known.
    screen: Option<[u32; 2]>,
}

/// What comes of asking for the controls.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Asked {
    /// They are the asker's.
    Given,
    /// This viewer has them, and decides.
    Of(Viewer),
}

impl Audience {
    /// A viewer comes; the first has the controls.
    pub fn join(&mut self, viewer: Viewer, sender: mpsc::Sender<Arc<str>>) {
        self.seats.insert(viewer, Seat { sender, hidden: false, screen: None });
        self.holder.get_or_insert(viewer);
    }

    /// A viewer goes; the controls are free if it had them.
    pub fn leave(&mut self, viewer: Viewer) {
        self.seats.remove(&viewer);
        self.holder = self.holder.filter(|holder| *holder != viewer);
        self.asker = self.asker.filter(|asker| *asker != viewer);
    }

    /// A viewer is out of sight, or in sight again.
    pub fn set_hidden(&mut self, viewer: Viewer, hidden: bool) {
        if let Some(seat) = self.seats.get_mut(&viewer) {
            seat.hidden = hidden;
        }
    }

    /// The pixels that a viewer has for the picture.
    pub fn set_screen(&mut self, viewer: Viewer, screen: [u32; 2]) {
        if let Some(seat) = self.seats.get_mut(&viewer) {
            seat.screen = Some(screen);
        }
    }

    /// Pixels that the controls' holder has for the picture, as far as is known.
    pub fn screen(&self) -> Option<[u32; 2]> {
        self.seats.get(&self.holder?)?.screen
    }

    /// A viewer is in sight.
    pub fn is_looking(&self) -> bool {
        self.seats.values().any(|seat| !seat.hidden)
    }

    /// The viewer that has the controls; `None`: they are free.
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

    /// The controls' holder, `from`, gives them to another viewer, or keeps them; then the one that has asked in vain is
    /// returned.
    ///
    /// # Errors
    /// In words: there is no such viewer.
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
            let _ = seat.sender.try_send(message.encode());
        }
    }

    /// The message that says which viewers there are, and which of them has the controls.
    pub fn controls(&self) -> ServerMessage {
        ServerMessage::Controls { holder: self.holder, viewers: self.seats.keys().copied().collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_controls_holder_decides_how_large_pictures_are_and_any_viewer_in_sight_keeps_them_coming() {
        let mut audience = Audience::default();
        assert!(!audience.is_looking());
        for viewer in [1, 2] {
            audience.join(viewer, mpsc::channel(1).0);
        }
        audience.set_screen(2, [390, 844]);
        assert_eq!((audience.holder(), audience.screen()), (Some(1), None));
        audience.set_screen(1, [1157, 900]);
        assert_eq!(audience.screen(), Some([1157, 900]));
        assert_eq!(audience.take(2), Asked::Of(1));
        assert_eq!(audience.give(1, 1), Ok(Some(2)), "2 has asked in vain");
        assert_eq!((audience.take(2), audience.give(1, 2)), (Asked::Of(1), Ok(None)));
        assert_eq!(audience.screen(), Some([390, 844]));
        assert!(audience.give(2, 7).is_err());
        audience.set_hidden(2, true);
        assert!(audience.is_looking());
        audience.set_hidden(1, true);
        assert!(!audience.is_looking());
        audience.set_hidden(2, false);
        audience.leave(2);
        assert_eq!((audience.is_looking(), audience.holder(), audience.screen()), (false, None, None));
        assert_eq!(audience.take(1), Asked::Given);
    }
}
