//! A master that serves a scene, as a process; and the requests and messages that reach it.

use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use futures_util::{SinkExt, StreamExt};
use serde_json::{Value, json};
use tests::programs::program;
use tokio::net::TcpStream;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async_with_config};

use super::http::{Answer, request};

/// Longest wait for anything.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// A shipped scene.
pub fn scene(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes").join(name)
}

/// A master; killed when dropped.
pub struct Master {
    process: Child,
    pub address: SocketAddr,
    pub url: String,
    /// What it says from when it serves on.
    events: Receiver<Value>,
    /// Its user's folder, unless that is somebody else's.
    state: Option<tempfile::TempDir>,
}

impl Master {
    /// Serves a shipped scene with these flags.
    pub fn start(name: &str, flags: &[&str]) -> Self {
        Self::at("127.0.0.1:0", &scene(name), flags)
    }

    /// Serves any scene at an address.
    pub fn at(http: &str, scene: &Path, flags: &[&str]) -> Self {
        let state = tempfile::tempdir().expect("a folder");
        let mut master = Self::of_user(state.path(), http, scene, flags);
        master.state = Some(state);
        master
    }

    /// The same, of a user whose sessions are kept in this folder.
    pub fn of_user(state: &Path, http: &str, scene: &Path, flags: &[&str]) -> Self {
        Self::run(&program("igi-master"), state, http, scene, flags)
    }

    /// Serves a shipped scene by another program.
    pub fn of_program(program: &Path, name: &str, flags: &[&str]) -> Self {
        let state = tempfile::tempdir().expect("a folder");
        let mut master = Self::run(program, state.path(), "127.0.0.1:0", &scene(name), flags);
        master.state = Some(state);
        master
    }

    fn run(program: &Path, state: &Path, http: &str, scene: &Path, flags: &[&str]) -> Self {
        let mut command = Command::new(program);
        for variable in ["IGI_WORKERS", "IGI_LISTEN", "IGI_TOKEN", "IGI_HTTP", "IGI_VIEWER_TOKEN", "RUST_LOG"] {
            command.env_remove(variable);
        }
        command.env("XDG_STATE_HOME", state);
        command.arg("serve").arg(scene).args(["--http", http, "--json", "--quiet"]).args(flags);
        let mut process = command.stdin(Stdio::null()).stdout(Stdio::piped()).spawn().expect("igi-master starts");
        let mut lines = BufReader::new(process.stdout.take().expect("its output")).lines();
        let serving = lines.by_ref().map_while(Result::ok).find_map(|line| {
            let event: Value = serde_json::from_str(&line).ok()?;
            (event["event"] == "serving").then_some(event)
        });
        let serving = serving.expect("it says where it serves");
        // Its output is always read, so that it never waits.
        let (sender, events) = channel();
        std::thread::spawn(move || {
            let parsed = lines.map_while(Result::ok).filter_map(|line| serde_json::from_str(&line).ok());
            parsed.for_each(|event| drop(sender.send(event)));
        });
        let text = |field: &str| serving[field].as_str().expect("a text").to_string();
        let address = text("address").parse().expect("an address");
        Self { process, address, url: text("url"), events, state: None }
    }

    /// Interrupts it as Ctrl-C does, and returns the event of this kind that it prints before it ends.
    pub fn interrupted(&mut self, event: &str) -> Value {
        let status = Command::new("kill").args(["-INT", &self.process.id().to_string()]).status().expect("kill runs");
        assert!(status.success());
        assert_eq!(self.process.wait().expect("it ends").code(), Some(130));
        self.events.iter().find(|printed| printed["event"] == event).expect("it says so")
    }

    /// A plain request.
    pub fn get(&self, path: &str, headers: &str) -> Answer {
        request(self.address, &format!("GET {path}"), headers, "", PATIENCE).expect("it answers")
    }
}

impl Drop for Master {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// A viewer that is no browser.
pub struct Watcher(WebSocketStream<MaybeTlsStream<TcpStream>>);

/// A picture that came.
pub struct ReceivedFrame {
    pub header: Value,
    pub image: image::RgbImage,
}

impl Watcher {
    pub async fn join(master: &Master) -> Self {
        let request = format!("ws://{}/socket", master.address).into_client_request().expect("a request");
        let is_sent_at_once = true;
        let joined = connect_async_with_config(request, None, is_sent_at_once).await;
        Self(joined.expect("it lets viewers in").0)
    }

    /// Sends a message.
    pub async fn send(&mut self, message: Value) {
        self.send_raw(Message::Text(message.to_string().into())).await;
    }

    pub async fn send_raw(&mut self, message: Message) {
        self.0.send(message).await.expect("it listens");
    }

    /// Sends what the master may hang up at before it has all come.
    pub async fn send_too_much(&mut self, message: Message) {
        let _ = self.0.send(message).await;
    }

    /// The next message; pictures are acknowledged. `None` if the master has closed.
    async fn next(&mut self) -> Option<Result<Value, ReceivedFrame>> {
        loop {
            let message = tokio::time::timeout(PATIENCE, self.0.next()).await.expect("something comes in time")?;
            match message.ok()? {
                Message::Text(text) => return Some(Ok(serde_json::from_str(&text).expect("JSON"))),
                Message::Binary(bytes) => {
                    let length = u32::from_le_bytes(bytes[..4].try_into().expect("four bytes")) as usize;
                    let header: Value = serde_json::from_slice(&bytes[4..4 + length]).expect("a header");
                    self.send(json!({ "say": "drawn", "number": header["number"] })).await;
                    let image = image::load_from_memory(&bytes[4 + length..]).expect("a picture").to_rgb8();
                    return Some(Err(ReceivedFrame { header, image }));
                }
                Message::Close(_) => return None,
                _ => {}
            }
        }
    }

    /// The next message of this kind.
    pub async fn recv(&mut self, tell: &str) -> Value {
        self.wait(tell, |message| message.ok().filter(|message| message["tell"] == tell)).await
    }

    /// The next picture whose header is as wanted.
    pub async fn recv_frame(&mut self, wanted: impl Fn(&Value) -> bool) -> ReceivedFrame {
        self.wait("a picture", |message| message.err().filter(|seen| wanted(&seen.header))).await
    }

    /// The first message that is as wanted. The master never falls silent, so each alone may come in time and none be right.
    async fn wait<T>(&mut self, what: &str, wanted: impl Fn(Result<Value, ReceivedFrame>) -> Option<T>) -> T {
        let found = async {
            loop {
                if let Some(found) = wanted(self.next().await.expect("it goes on")) {
                    return found;
                }
            }
        };
        tokio::time::timeout(PATIENCE, found).await.unwrap_or_else(|_| panic!("{what} does not come in time"))
    }

    /// Whether the master ends the conversation in time.
    pub async fn ends(&mut self) -> bool {
        while let Ok(message) = tokio::time::timeout(PATIENCE, self.0.next()).await {
            if !matches!(message, Some(Ok(Message::Text(_) | Message::Binary(_) | Message::Ping(_) | Message::Pong(_))))
            {
                return true;
            }
        }
        false
    }
}
