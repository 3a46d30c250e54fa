//! A master that serves a scene, as a process; and the requests and words that reach it.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use std::time::Duration;

use futures_util::{SinkExt, StreamExt};
use serde_json::{Value, json};
use tokio::net::TcpStream as Stream;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async};

/// Longest wait for anything.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// The master's program, built now if it is not: cargo builds it only for its own package's tests.
pub fn program() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        let test = std::env::current_exe().expect("this test has a path");
        let folder = test.parent().and_then(Path::parent).expect("tests lie in PROFILE/deps");
        let profile = folder.file_name().and_then(|name| name.to_str()).expect("a profile's folder");
        let mut build = Command::new(env!("CARGO"));
        build.args(["build", "--quiet", "--package", "master", "--bin", "igi-master"]);
        build.args(["--profile", if profile == "debug" { "dev" } else { profile }]);
        build.arg("--target-dir").arg(folder.parent().expect("a target folder"));
        assert!(build.status().expect("cargo runs").success(), "igi-master cannot be built");
        folder.join("igi-master")
    })
}

pub fn scene(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes").join(name)
}

/// A master; killed when dropped.
pub struct Master {
    process: Child,
    pub address: SocketAddr,
    pub url: String,
}

impl Master {
    /// Serves a scene with these flags.
    pub fn start(name: &str, flags: &[&str]) -> Self {
        Self::at("127.0.0.1:0", name, flags)
    }

    pub fn at(http: &str, name: &str, flags: &[&str]) -> Self {
        let mut command = Command::new(program());
        for variable in ["IGI_WORKERS", "IGI_LISTEN", "IGI_TOKEN", "IGI_HTTP", "IGI_VIEWER_TOKEN", "RUST_LOG"] {
            command.env_remove(variable);
        }
        command.arg("serve").arg(scene(name)).args(["--http", http, "--json", "--quiet"]).args(flags);
        let mut process = command.stdin(Stdio::null()).stdout(Stdio::piped()).spawn().expect("igi-master starts");
        let mut lines = BufReader::new(process.stdout.take().expect("its output")).lines();
        let serving = lines.by_ref().map_while(Result::ok).find_map(|line| {
            let event: Value = serde_json::from_str(&line).ok()?;
            (event["event"] == "serving").then_some(event)
        });
        let serving = serving.expect("it says where it serves");
        // Nobody may stop it from talking.
        std::thread::spawn(move || lines.map_while(Result::ok).for_each(drop));
        let text = |field: &str| serving[field].as_str().expect("a text").to_string();
        Self { process, address: text("address").parse().expect("an address"), url: text("url") }
    }

    /// A plain request: status line and headers in lower case, and body.
    pub fn get(&self, path: &str, headers: &str) -> (String, Vec<u8>) {
        request(self.address, &format!("GET {path}"), headers, "")
    }
}

/// A plain request to anyone: status line and headers in lower case, and body.
pub fn request(address: SocketAddr, what: &str, headers: &str, body: &str) -> (String, Vec<u8>) {
    let mut stream = TcpStream::connect(address).expect("it listens");
    stream.set_read_timeout(Some(PATIENCE)).expect("a socket");
    let has_host = headers.to_lowercase().contains("host:");
    let host = if has_host { String::new() } else { format!("Host: {address}\r\n") };
    let length = body.len();
    let head = format!("{what} HTTP/1.1\r\n{host}{headers}Content-Length: {length}\r\nConnection: close\r\n\r\n");
    stream.write_all((head + body).as_bytes()).expect("it reads");
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).expect("it answers");
    let end = answer.windows(4).position(|four| four == b"\r\n\r\n").expect("headers end");
    (String::from_utf8_lossy(&answer[..end]).to_lowercase(), answer[end + 4..].to_vec())
}

impl Drop for Master {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// A viewer that is no browser.
pub struct Watcher(WebSocketStream<MaybeTlsStream<Stream>>);

/// A picture that came.
pub struct Seen {
    pub header: Value,
    pub image: image::RgbImage,
}

impl Watcher {
    pub async fn join(master: &Master) -> Self {
        let request = format!("ws://{}/socket", master.address).into_client_request().expect("a request");
        Self(connect_async(request).await.expect("it lets viewers in").0)
    }

    pub async fn say(&mut self, words: Value) {
        self.say_raw(Message::Text(words.to_string().into())).await;
    }

    pub async fn say_raw(&mut self, message: Message) {
        self.0.send(message).await.expect("it listens");
    }

    /// The next message; pictures are acknowledged. Nothing if the master has closed.
    async fn next(&mut self) -> Option<Result<Value, Seen>> {
        loop {
            let message = tokio::time::timeout(PATIENCE, self.0.next()).await.expect("something comes in time")?;
            match message.ok()? {
                Message::Text(text) => return Some(Ok(serde_json::from_str(&text).expect("JSON"))),
                Message::Binary(bytes) => {
                    let length = u32::from_le_bytes(bytes[..4].try_into().expect("four bytes")) as usize;
                    let header: Value = serde_json::from_slice(&bytes[4..4 + length]).expect("a header");
                    self.say(json!({ "say": "drawn", "number": header["number"] })).await;
                    let image = image::load_from_memory(&bytes[4 + length..]).expect("a picture").to_rgb8();
                    return Some(Err(Seen { header, image }));
                }
                Message::Close(_) => return None,
                _ => {}
            }
        }
    }

    /// The next words of this kind.
    pub async fn hear(&mut self, tell: &str) -> Value {
        loop {
            if let Ok(words) = self.next().await.expect("it goes on")
                && words["tell"] == tell
            {
                return words;
            }
        }
    }

    /// The next picture that is as wanted.
    pub async fn see(&mut self, wanted: impl Fn(&Value) -> bool) -> Seen {
        loop {
            if let Err(seen) = self.next().await.expect("it goes on")
                && wanted(&seen.header)
            {
                return seen;
            }
        }
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
