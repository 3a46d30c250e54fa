//! Finished frames on their way to a collector: OTLP/HTTP with JSON bodies (opentelemetry-proto, `docs/specification.md`),
//! over plain HTTP to somebody near by.

use std::hash::{BuildHasher, RandomState};
use std::io::{Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use serde_json::{Value, json};

use super::Frame;

/// Sends frames from a thread of its own. Dropped, it sends what it has, if that does not take long.
pub(super) struct Exporter {
    /// `None` only while being dropped.
    frames: Option<SyncSender<Frame>>,
    thread: Option<JoinHandle<()>>,
    /// Frames that there was no room for.
    lost: u64,
}

/// Frames that wait for the collector; when it is full, frames are lost.
const WAITING_MAX: usize = 256;
/// Frames in a message.
const BATCH_MAX: usize = 32;
/// A frame waits so long for others.
const BATCH_TIME: Duration = Duration::from_secs(1);
/// Longest wait for the collector to connect, take a message, or answer.
const PATIENCE: Duration = Duration::from_secs(3);
/// What is read of its answer, bytes.
const REPLY_MAX: u64 = 16 << 10;

/// Where to.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Target {
    /// `HOST:PORT`.
    authority: String,
    path: String,
    service: String,
}

impl Exporter {
    /// Where `OTEL_EXPORTER_OTLP_TRACES_ENDPOINT`, or `OTEL_EXPORTER_OTLP_ENDPOINT` with `/v1/traces`, says; `None` if
    /// neither is set.
    pub(super) fn from_environment() -> Option<Result<Self, String>> {
        let variable = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
        let traces = variable("OTEL_EXPORTER_OTLP_TRACES_ENDPOINT");
        let general =
            || variable("OTEL_EXPORTER_OTLP_ENDPOINT").map(|base| format!("{}/v1/traces", base.trim_end_matches('/')));
        let url = traces.or_else(general)?;
        let service = variable("OTEL_SERVICE_NAME").unwrap_or_else(|| "igi-master".into());
        Some(Target::parse(&url, service).and_then(|target| Self::start(target).map_err(|error| error.to_string())))
    }

    fn start(target: Target) -> std::io::Result<Self> {
        let (sender, frames) = sync_channel(WAITING_MAX);
        let thread = std::thread::Builder::new().name("spans".into()).spawn(move || export(&target, &frames))?;
        Ok(Self { frames: Some(sender), thread: Some(thread), lost: 0 })
    }

    pub(super) fn put(&mut self, frame: Frame) {
        let sent = self.frames.as_ref().is_some_and(|frames| frames.try_send(frame).is_ok());
        self.lost += u64::from(!sent);
    }
}

impl Drop for Exporter {
    fn drop(&mut self) {
        self.frames = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        if self.lost > 0 {
            tracing::warn!("{} frames have no span: the collector is too slow", self.lost);
        }
    }
}

impl Target {
    fn parse(url: &str, service: String) -> Result<Self, String> {
        let wrong = || format!("`{url}` is no address to send spans to: http://HOST:PORT/PATH is one");
        let rest = url.strip_prefix("http://").ok_or_else(wrong)?;
        let (host, path) = rest.split_at(rest.find('/').unwrap_or(rest.len()));
        if host.is_empty() || url.contains(|c: char| c.is_whitespace() || c.is_control()) {
            return Err(wrong());
        }
        let has_port = host.rsplit_once(':').is_some_and(|(_, port)| port.parse::<u16>().is_ok());
        let authority = if has_port { host.to_owned() } else { format!("{host}:80") };
        let path = if path.is_empty() { "/".to_owned() } else { path.to_owned() };
        Ok(Self { authority, path, service })
    }
}

fn export(target: &Target, frames: &Receiver<Frame>) {
    let ids = RandomState::new();
    let (mut number, mut is_well, mut is_over) = (0, true, false);
    while !is_over {
        let Ok(first) = frames.recv() else { return };
        let mut batch = vec![first];
        let due = Instant::now() + BATCH_TIME;
        while batch.len() < BATCH_MAX {
            match frames.recv_timeout(due.saturating_duration_since(Instant::now())) {
                Ok(frame) => batch.push(frame),
                Err(RecvTimeoutError::Timeout) => break,
                Err(RecvTimeoutError::Disconnected) => {
                    is_over = true;
                    break;
                }
            }
        }
        let mut id = || {
            number += 1;
            ids.hash_one(number)
        };
        let spans: Vec<Value> = batch.iter().map(|frame| span(frame, [id(), id(), id()])).collect();
        let outcome = post(target, &message(&target.service, spans).to_string());
        match &outcome {
            // Once until it is well again.
            Err(reason) if is_well => tracing::warn!("{} frames have no span: {reason}", batch.len()),
            _ => {}
        }
        is_well = outcome.is_ok();
    }
}

fn message(service: &str, spans: Vec<Value>) -> Value {
    let scope = json!({ "name": "igi-master", "version": env!("CARGO_PKG_VERSION") });
    let resource = json!({ "attributes": [text("service.name", service)] });
    json!({ "resourceSpans": [{ "resource": resource, "scopeSpans": [{ "scope": scope, "spans": spans }] }] })
}

/// A frame is a trace of its own: nothing joins it to others but the order of time.
fn span(frame: &Frame, [high, low, own]: [u64; 3]) -> Value {
    let hash: String = frame.world.world[..8].iter().map(|byte| format!("{byte:02x}")).collect();
    let attributes = [
        number("igi.frame", frame.number),
        text("igi.world", &hash),
        number("igi.revision", frame.world.revision),
        number("igi.width", frame.size[0]),
        number("igi.height", frame.size[1]),
        number("igi.tiles", frame.answered as u64),
        number("igi.tiles_given_up", frame.given_up as u64),
        number("igi.thread_us", frame.micros),
        number("igi.answer_bytes", frame.bytes),
        json!({ "key": "igi.cancelled", "value": { "boolValue": frame.is_cancelled } }),
    ];
    let event = |tile: &super::Answer| {
        let attributes = [
            number("igi.set", tile.set),
            number("igi.x", tile.corner[0]),
            number("igi.y", tile.corner[1]),
            number("igi.worker", tile.worker),
            number("igi.thread_us", tile.micros),
            number("igi.answer_bytes", tile.bytes),
        ];
        json!({ "name": "tile", "timeUnixNano": nanos(tile.at), "attributes": attributes })
    };
    let status = if frame.given_up > 0 { json!({ "code": 2, "message": "tiles were given up" }) } else { json!({}) };
    json!({
        // Neither may be zero.
        "traceId": format!("{high:016x}{:016x}", low | 1),
        "spanId": format!("{:016x}", own | 1),
        "name": "frame",
        "kind": 1,
        "startTimeUnixNano": nanos(frame.begun),
        "endTimeUnixNano": nanos(frame.ended),
        "attributes": attributes,
        "events": frame.tiles.iter().map(event).collect::<Vec<_>>(),
        "droppedEventsCount": frame.answered - frame.tiles.len(),
        "status": status,
    })
}

/// 64-bit numbers are strings in the JSON of protocol buffers.
fn nanos(at: SystemTime) -> String {
    at.duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos().to_string()
}

fn number(key: &str, value: impl Into<u64>) -> Value {
    let value: u64 = value.into();
    json!({ "key": key, "value": { "intValue": value.to_string() } })
}

fn text(key: &str, value: &str) -> Value {
    json!({ "key": key, "value": { "stringValue": value } })
}

fn post(target: &Target, body: &str) -> Result<(), String> {
    let Target { authority, path, .. } = target;
    let failed = |error: std::io::Error| format!("the collector at {authority} does not take them: {error}");
    let mut addresses = authority.to_socket_addrs().map_err(failed)?;
    let address = addresses.next().ok_or_else(|| format!("{authority} has no address"))?;
    let mut stream = TcpStream::connect_timeout(&address, PATIENCE).map_err(failed)?;
    stream.set_read_timeout(Some(PATIENCE)).and_then(|()| stream.set_write_timeout(Some(PATIENCE))).map_err(failed)?;
    let head = format!(
        "POST {path} HTTP/1.1\r\nHost: {authority}\r\nContent-Type: application/json\r\nContent-Length: {}\r\n\
         Connection: close\r\n\r\n",
        body.len()
    );
    stream.write_all(head.as_bytes()).and_then(|()| stream.write_all(body.as_bytes())).map_err(failed)?;
    let mut reply = Vec::new();
    stream.take(REPLY_MAX).read_to_end(&mut reply).map_err(failed)?;
    let reply = String::from_utf8_lossy(&reply);
    let first = reply.lines().next().unwrap_or_default();
    match first.split(' ').nth(1) {
        Some(code) if code.starts_with('2') => Ok(()),
        _ => Err(format!("the collector at {authority} does not take them: it says `{first}`")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_read_or_refused() {
        let parse = |url: &str| Target::parse(url, "igi".into()).map(|target| (target.authority, target.path));
        let is = |authority: &str, path: &str| Ok((authority.to_owned(), path.to_owned()));
        assert_eq!(parse("http://localhost:4318/v1/traces"), is("localhost:4318", "/v1/traces"));
        assert_eq!(parse("http://[::1]:4318"), is("[::1]:4318", "/"));
        assert_eq!(parse("http://collector/x"), is("collector:80", "/x"));
        for wrong in ["", "localhost:4318", "https://localhost:4318", "http://", "http://a b/", "http://a\r\nX: y/"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }
}
