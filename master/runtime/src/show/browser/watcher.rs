//! One viewer: its messages go to the session, the session's messages to it, and pictures as
//! fast as it can take them.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use axum::extract::ws::{CloseFrame, Message, WebSocket};
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::mpsc;
use tokio::time::{Instant, timeout};

use super::window::Window;
use crate::display::hub::{Command, Hub, Viewer};
use crate::display::message::{ClientMessage, ServerMessage};

/// Messages for one viewer alone that may wait for it.
const OWN_MESSAGES_MAX: usize = 64;
/// A viewer that does not take a message, or acknowledge a picture, in this time is gone.
const PATIENCE: Duration = Duration::from_secs(20);

/// What is said to a viewer that does not wait.
const ONE_FILE: &str = "one luminaire's file at a time: the last is still to be read";

/// How it is found out that a viewer is gone which did not close its connection: it may have the controls.
#[derive(Clone, Copy)]
pub(super) struct Beat {
    /// It is asked for a sign of life this often; browsers answer by themselves.
    pub(super) between: Duration,
    /// … and is gone if it has sent nothing for this long.
    pub(super) silence: Duration,
}

pub(super) const BEAT: Beat = Beat { between: Duration::from_secs(10), silence: Duration::from_secs(30) };

/// A place among the viewers, given back when dropped.
pub(super) struct Seat(pub(super) Arc<AtomicUsize>);

impl Drop for Seat {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Carries everything to and fro until the viewer goes.
pub(super) async fn watch(mut socket: WebSocket, viewer: Viewer, hub: Hub, _seat: Seat, beat: Beat) {
    let (sender, mut own_messages) = mpsc::channel(OWN_MESSAGES_MAX);
    let mut messages = hub.messages();
    let mut frames = hub.frames();
    frames.mark_changed();
    if !hub.command(Command::Joined { viewer, sender }) {
        return;
    }
    let mut window = Window::new();
    let (mut last_received, mut next_ping) = (Instant::now(), Instant::now() + beat.between);
    let reason = loop {
        let overdue = window.since().unwrap_or_else(Instant::now) + PATIENCE;
        let message = tokio::select! {
            received = recv(&mut socket, &mut last_received) => match received {
                Some(Ok(Message::Text(json))) => match serde_json::from_str(&json) {
                    Ok(ClientMessage::Drawn { number }) => {
                        window.drawn(number, Instant::now());
                        continue;
                    }
                    Ok(message) if json.len() > message.longest() => break "a message is too long",
                    Ok(message) => {
                        let is_file = matches!(message, ClientMessage::Hang { .. });
                        match hub.command(Command::Message { viewer, message }) {
                            true => continue,
                            false if is_file => text(&ServerMessage::Refused { reason: ONE_FILE.into() }.encode()),
                            false => break "too much at once",
                        }
                    }
                    Err(error) => text(&ServerMessage::Refused { reason: error.to_string() }.encode()),
                },
                Some(Ok(Message::Ping(_) | Message::Pong(_))) => continue,
                Some(Ok(Message::Binary(_))) => break "viewers speak JSON",
                Some(Ok(Message::Close(_)) | Err(_)) | None => break "",
            },
            message = own_messages.recv() => match message {
                Some(message) => text(&message),
                None => break "the master has finished",
            },
            message = messages.recv() => match message {
                Ok(message) => text(&message),
                // It missed some: the whole state again.
                Err(RecvError::Lagged(_)) => {
                    hub.command(Command::Message { viewer, message: ClientMessage::Refresh });
                    continue;
                }
                Err(RecvError::Closed) => break "the master has finished",
            },
            changed = frames.changed(), if window.has_room() => {
                if changed.is_err() {
                    break "the master has finished";
                }
                let Some(frame) = frames.borrow_and_update().clone() else { continue };
                let number = frame.header.number;
                // Encoding would hold the other viewers up.
                let encoded = tokio::task::spawn_blocking(move || frame.message().map(|bytes| Message::binary(bytes.to_vec())).map_err(str::to_owned));
                match encoded.await {
                    Ok(Ok(message)) => {
                        window.send(number, Instant::now());
                        message
                    }
                    Ok(Err(error)) => {
                        tracing::error!("a picture cannot be shown: {error}");
                        continue;
                    }
                    Err(_) => break "the master has finished",
                }
            }
            () = tokio::time::sleep_until(overdue), if window.since().is_some() => break "no picture was drawn for too long",
            () = tokio::time::sleep_until(next_ping) => {
                if last_received.elapsed() >= beat.silence {
                    break "no sign of life for too long";
                }
                next_ping = Instant::now() + beat.between;
                Message::Ping(Default::default())
            }
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

/// The next message, if one comes, and when it came.
async fn recv(socket: &mut WebSocket, last_received: &mut Instant) -> Option<Result<Message, axum::Error>> {
    let received = socket.recv().await;
    *last_received = Instant::now();
    received
}

fn text(message: &Arc<str>) -> Message {
    Message::Text(message.as_ref().into())
}

#[cfg(test)]
mod tests {
    use axum::Router;
    use axum::extract::ws::WebSocketUpgrade;
    use axum::routing::get;
    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    use tokio::net::{TcpListener, TcpStream};

    use super::*;
    use crate::cluster::{Cluster, ClusterOptions};

    /// Its machine may have been switched off.
    #[test]
    fn a_viewer_that_gives_no_sign_of_life_is_gone_and_one_that_does_stays() {
        let cluster = Cluster::start(ClusterOptions { embedded: Some(1), ..ClusterOptions::default() }).unwrap();
        let hub = Hub::new(cluster.waker());
        let beat = Beat { between: Duration::from_millis(40), silence: Duration::from_millis(400) };
        let inner = hub.clone();
        let join = move |upgrade: WebSocketUpgrade| async move {
            upgrade.on_upgrade(move |socket| watch(socket, 1, inner, Seat(Arc::default()), beat))
        };
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async {
            let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
            let mut client = TcpStream::connect(listener.local_addr().unwrap()).await.unwrap();
            tokio::spawn(async { axum::serve(listener, Router::new().route("/", get(join))).await });
            let upgrade = "GET / HTTP/1.1\r\nHost: a\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
                           Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n";
            client.write_all(upgrade.as_bytes()).await.unwrap();
            let mut head = Vec::new();
            while !head.ends_with(b"\r\n\r\n") {
                head.push(client.read_u8().await.unwrap());
            }
            // It answers (masked, as clients do) for longer than a silence may be, then never again.
            for _ in 0..15 {
                assert_eq!(client.read_u16().await.unwrap(), 0x8900, "it is asked for a sign of life");
                client.write_all(&[0x8a, 0x80, 0, 0, 0, 0]).await.unwrap();
            }
            // Kept, as the session keeps the sender.
            let mut commands = Vec::new();
            let mut is_gone = || {
                commands.extend(std::iter::from_fn(|| hub.next_command()));
                commands.iter().any(|command| matches!(command, Command::Left { viewer: 1 }))
            };
            assert!(!is_gone());
            let mut rest = Vec::new();
            timeout(PATIENCE, client.read_to_end(&mut rest)).await.expect("it is sent away").unwrap();
            assert!(String::from_utf8_lossy(&rest).contains("no sign of life"));
            assert!(is_gone());
        });
    }
}
