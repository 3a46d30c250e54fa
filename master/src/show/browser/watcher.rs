//! One viewer: what it says goes to the studio, what the studio says goes to it, and pictures as
//! fast as it can take them.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use axum::extract::ws::{CloseFrame, Message, WebSocket};
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::mpsc;
use tokio::time::{Instant, timeout};

use crate::live::hub::{Command, Hub, Viewer};
use crate::live::words::Said;

/// Words for one viewer alone that may wait for it.
const EAR_MAX: usize = 64;
/// A viewer that does not take a message, or say that it has drawn a picture, in this time is gone.
const PATIENCE: Duration = Duration::from_secs(20);

/// A place among the viewers, given back when dropped.
pub(super) struct Seat(pub(super) Arc<AtomicUsize>);

impl Drop for Seat {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Carries everything to and fro until the viewer goes.
pub(super) async fn watch(mut socket: WebSocket, viewer: Viewer, hub: Hub, _seat: Seat) {
    let (ear, mut own_words) = mpsc::channel(EAR_MAX);
    let mut words = hub.words();
    let mut pictures = hub.pictures();
    pictures.mark_changed();
    if !hub.command(Command::Joined { viewer, ear }) {
        return;
    }
    // The picture that is on its way: the next goes out when this is on the screen.
    let mut under_way: Option<(u64, Instant)> = None;
    let reason = loop {
        let overdue = under_way.map_or_else(|| Instant::now() + PATIENCE, |(_, since)| since + PATIENCE);
        let message = tokio::select! {
            heard = socket.recv() => match heard {
                Some(Ok(Message::Text(text))) => match serde_json::from_str(&text) {
                    Ok(Said::Drawn { number }) => {
                        under_way = under_way.filter(|(waited_for, _)| *waited_for != number);
                        continue;
                    }
                    Ok(said) => match hub.command(Command::Said { viewer, said }) {
                        true => continue,
                        false => break "too much at once",
                    },
                    Err(error) => {
                        let error = error.to_string();
                        Message::Text(serde_json::json!({ "tell": "refused", "reason": error }).to_string().into())
                    }
                },
                Some(Ok(Message::Ping(_) | Message::Pong(_))) => continue,
                Some(Ok(Message::Binary(_))) => break "viewers speak JSON",
                Some(Ok(Message::Close(_)) | Err(_)) | None => break "",
            },
            said = own_words.recv() => match said {
                Some(words) => text(&words),
                None => break "the master has finished",
            },
            said = words.recv() => match said {
                Ok(words) => text(&words),
                // It missed some: everything again.
                Err(RecvError::Lagged(_)) => {
                    hub.command(Command::Said { viewer, said: Said::Refresh });
                    continue;
                }
                Err(RecvError::Closed) => break "the master has finished",
            },
            changed = pictures.changed(), if under_way.is_none() => {
                if changed.is_err() {
                    break "the master has finished";
                }
                let Some(picture) = pictures.borrow_and_update().clone() else { continue };
                let number = picture.header.number;
                // Encoding would hold the other viewers up.
                let encoded = tokio::task::spawn_blocking(move || picture.message().map(|bytes| Message::binary(bytes.to_vec())).map_err(str::to_owned));
                match encoded.await {
                    Ok(Ok(message)) => {
                        under_way = Some((number, Instant::now()));
                        message
                    }
                    Ok(Err(error)) => {
                        tracing::error!("a picture cannot be shown: {error}");
                        continue;
                    }
                    Err(_) => break "the master has finished",
                }
            }
            () = tokio::time::sleep_until(overdue), if under_way.is_some() => break "no picture was drawn for too long",
        };
        if !matches!(timeout(PATIENCE, socket.send(message)).await, Ok(Ok(()))) {
            break "";
        }
    };
    hub.command(Command::Left { viewer });
    if !reason.is_empty() {
        let goodbye = Message::Close(Some(CloseFrame { code: 1000, reason: reason.into() }));
        let _ = timeout(PATIENCE, socket.send(goodbye)).await;
    }
}

fn text(words: &Arc<str>) -> Message {
    Message::Text(words.as_ref().into())
}
