//! The viewer in browsers: one page, its parts, and a WebSocket for each viewer.
//!
//! Everything that comes in is hostile until checked: the [`door`] decides whom to let in, what a
//! viewer sends is bounded in size and read into closed types, and what waits for a slow one is at
//! most one picture and some messages.

mod assets;
mod door;
mod watcher;
mod window;

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use axum::Router;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{Path, Query, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Redirect, Response};
use axum::routing::get;
use health::Guests;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::TcpListener;
use tokio::sync::oneshot;
use tokio::time::timeout;

pub use door::Door;

use crate::display::hub::{Command, Hub};
use crate::display::message::{LUMINAIRE_MESSAGE_MAX, Spot};
use crate::files::OutputKind;

/// The server; it stops when this is dropped.
pub struct Browser {
    address: SocketAddr,
    url: String,
    url_once: String,
    runtime: Option<tokio::runtime::Runtime>,
}

/// What every request shares.
#[derive(Clone)]
struct House {
    door: Arc<Door>,
    hub: Hub,
    next_viewer: Arc<AtomicU64>,
    present: Arc<AtomicUsize>,
    /// How many pictures of each name were saved, so that no two have the same.
    saved: Arc<Mutex<BTreeMap<String, u32>>>,
}

/// Viewers that may watch at a time.
const VIEWERS_MAX: usize = 32;
/// Connections at a time that are no viewers' yet; others wait in the system's queue.
const CONNECTIONS_MAX: usize = 64;
/// Longest time for such a connection to ask for something, and for all that it asks and hears.
const REQUEST_PATIENCE: Duration = Duration::from_secs(10);
const CONNECTION_PATIENCE: Duration = Duration::from_secs(300);
/// Longest wait for the session to hand a picture over.
const PICTURE_PATIENCE: Duration = Duration::from_secs(30);
/// Longest wait for viewers to go.
const FAREWELL: Duration = Duration::from_secs(1);

impl Browser {
    /// Listens.
    ///
    /// # Errors
    /// In words: the address cannot be listened at.
    pub fn start(door: Door, hub: Hub) -> Result<Self, String> {
        let wanted = door.address();
        let cannot = |error: &dyn std::fmt::Display| {
            format!("cannot serve browsers at {wanted}: {error}; choose another address or port with --http")
        };
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .thread_name("browser")
            .enable_all()
            .build()
            .map_err(|error| cannot(&error))?;
        let listener = runtime.block_on(TcpListener::bind(wanted)).map_err(|error| cannot(&error))?;
        let address = listener.local_addr().map_err(|error| cannot(&error))?;
        let (url, url_once) = (door.url(address), door.url_once(address));
        let (door, next_viewer) = (Arc::new(door), Arc::new(AtomicU64::new(1)));
        let house = House { door, hub, next_viewer, present: Arc::default(), saved: Arc::default() };
        runtime.spawn(attend(listener, routes(house)));
        Ok(Self { address, url, url_once, runtime: Some(runtime) })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// What to open in a browser.
    pub fn url(&self) -> String {
        self.url.clone()
    }

    /// What a browser that is started here is to open: others can read its command line.
    pub fn url_once(&self) -> String {
        self.url_once.clone()
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_timeout(FAREWELL);
        }
    }
}

/// Answers connections. None holds a place for long without having shown that it may watch, nor against others who come.
async fn attend(listener: TcpListener, service: Router) {
    let mut guests = Guests::new(CONNECTIONS_MAX);
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(REQUEST_PATIENCE);
    loop {
        let Ok((client, from)) = listener.accept().await else {
            // Out of descriptors, perhaps: others may give some back.
            tokio::time::sleep(Duration::from_millis(100)).await;
            continue;
        };
        // A picture is small, and somebody waits for it: it is not held back for more (Nagle's algorithm).
        let _ = client.set_nodelay(true);
        let connection = http.serve_connection(TokioIo::new(client), TowerToHyperService::new(service.clone()));
        let guest = tokio::spawn(async move {
            // Ends when it has become a viewer's, too. A client that is late or hangs up has lost interest.
            let _ = timeout(CONNECTION_PATIENCE, connection.with_upgrades()).await;
        });
        guests.seat(from.ip(), guest.abort_handle());
    }
}

fn routes(house: House) -> Router {
    Router::new()
        .route("/", get(page))
        .route("/assets/{name}", get(asset))
        .route("/socket", get(socket))
        .route("/picture.png", get(picture_png))
        .route("/picture.exr", get(picture_exr))
        .layer(middleware::from_fn_with_state(house.clone(), guard))
        .with_state(house)
}

/// What a link may carry.
#[derive(serde::Deserialize)]
struct Ticket {
    token: Option<String>,
    once: Option<String>,
}

/// Refuses requests that the door does not admit; every answer says how browsers should treat it.
async fn guard(
    State(house): State<House>,
    Query(ticket): Query<Ticket>,
    headers: HeaderMap,
    request: Request,
    next: Next,
) -> Response {
    // The page's parts are no secret, and style sheets cannot carry a ticket.
    let is_public = request.uri().path().starts_with("/assets/");
    let mut response = match house.door.admits(&headers, ticket.token.as_deref(), is_public) {
        Ok(()) => next.run(request).await,
        Err((StatusCode::UNAUTHORIZED, reason)) => match ticket.once.and_then(|once| house.door.redeem(&once)) {
            Some(token) => Redirect::to(&format!("/?token={token}")).into_response(),
            None => (StatusCode::UNAUTHORIZED, reason).into_response(),
        },
        Err(refusal) => refusal.into_response(),
    };
    let named = |name: &'static str, value: &'static str| {
        (header::HeaderName::from_static(name), header::HeaderValue::from_static(value))
    };
    response.headers_mut().extend([
        named("content-security-policy", POLICY),
        named("x-content-type-options", "nosniff"),
        named("referrer-policy", "no-referrer"),
        named("cache-control", "no-store"),
    ]);
    response
}

/// Nothing from elsewhere, and no other site's frame.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; \
                      img-src 'self' blob: data:; connect-src 'self' ws: wss:; frame-ancestors 'none'; base-uri 'none'";

async fn page() -> Response {
    assets::find("index.html").map_or_else(|| StatusCode::NOT_FOUND.into_response(), assets::Asset::answer)
}

async fn asset(Path(name): Path<String>) -> Response {
    assets::find(&name).map_or_else(|| StatusCode::NOT_FOUND.into_response(), assets::Asset::answer)
}

async fn socket(State(house): State<House>, upgrade: WebSocketUpgrade) -> Response {
    let place = house.present.fetch_add(1, Ordering::Relaxed);
    let seat = watcher::Seat(Arc::clone(&house.present));
    if place >= VIEWERS_MAX {
        return (StatusCode::SERVICE_UNAVAILABLE, "too many viewers").into_response();
    }
    let viewer = house.next_viewer.fetch_add(1, Ordering::Relaxed);
    upgrade
        .max_message_size(LUMINAIRE_MESSAGE_MAX)
        .max_frame_size(LUMINAIRE_MESSAGE_MAX)
        .on_upgrade(move |socket| watcher::watch(socket, viewer, house.hub, seat, watcher::BEAT))
}

/// Where the light meter stands, if it does.
#[derive(serde::Deserialize)]
struct Meter {
    meter_x: Option<f32>,
    meter_y: Option<f32>,
}

async fn picture_png(State(house): State<House>, Query(meter): Query<Meter>) -> Response {
    picture(&house, meter, OutputKind::Png, "image/png", "png").await
}

async fn picture_exr(State(house): State<House>, Query(meter): Query<Meter>) -> Response {
    picture(&house, meter, OutputKind::Exr, "image/x-exr", "exr").await
}

async fn picture(house: &House, meter: Meter, kind: OutputKind, mime: &'static str, ending: &str) -> Response {
    let (reply, taken) = oneshot::channel();
    let busy = || (StatusCode::SERVICE_UNAVAILABLE, "there is no picture yet; try again").into_response();
    let spot = meter.meter_x.zip(meter.meter_y).filter(|(x, y)| x.is_finite() && y.is_finite());
    let meter = spot.map(|(x, y)| Spot { x, y });
    if !house.hub.command(Command::Picture { meter, reply }) {
        return busy();
    }
    let Ok(Ok(taken)) = timeout(PICTURE_PATIENCE, taken).await else { return busy() };
    let name = taken.name.clone();
    match tokio::task::spawn_blocking(move || taken.encode(kind)).await {
        Ok(Ok(bytes)) => {
            let mut saved = house.saved.lock().unwrap_or_else(PoisonError::into_inner);
            let number = saved.entry(format!("{name}.{ending}")).and_modify(|number| *number += 1).or_insert(1);
            let disposition = disposition(&name, *number, ending);
            ([(header::CONTENT_TYPE, mime.to_string()), (header::CONTENT_DISPOSITION, disposition)], bytes)
                .into_response()
        }
        _ => (StatusCode::INTERNAL_SERVER_ERROR, "the picture cannot be encoded").into_response(),
    }
}

/// What a browser calls the file: in plain letters for old ones, and in any (RFC 6266).
fn disposition(name: &str, number: u32, ending: &str) -> String {
    let plain: String = name.chars().map(|c| if c.is_ascii() { c } else { '_' }).collect();
    let exact: String = name
        .bytes()
        .map(|byte| match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' => char::from(byte).to_string(),
            _ => format!("%{byte:02X}"),
        })
        .collect();
    format!("attachment; filename=\"{plain}-{number}.{ending}\"; filename*=UTF-8''{exact}-{number}.{ending}")
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};
    use std::net::TcpStream;
    use std::time::Instant;

    use super::*;
    use crate::cluster::{Cluster, ClusterOptions};
    use crate::display::hub::LUMINAIRES_WAITING;
    use crate::display::message::{CLIENT_MESSAGE_MAX, LUMINAIRE_FILE_MAX};

    #[test]
    fn silent_strangers_are_few_and_keep_nobody_out() {
        let cluster = Cluster::start(ClusterOptions { embedded: Some(1), ..ClusterOptions::default() }).unwrap();
        let door = Door::new("127.0.0.1:0".parse().unwrap(), None).unwrap();
        let browser = Browser::start(door, Hub::new(cluster.waker())).unwrap();
        let mut silent: Vec<_> = (0..200).map(|_| TcpStream::connect(browser.address()).unwrap()).collect();
        let mut client = TcpStream::connect(browser.address()).unwrap();
        client.write_all(b"GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n").unwrap();
        let (mut answer, asked) = (Vec::new(), Instant::now());
        client.read_to_end(&mut answer).unwrap();
        assert!(answer.starts_with(b"HTTP/1.1 200"));
        assert!(asked.elapsed() < REQUEST_PATIENCE, "it waited for a silent one to lose its place");
        // The oldest had to go; that is seen as the end of its connection.
        silent[0].set_read_timeout(Some(REQUEST_PATIENCE)).unwrap();
        assert!(matches!(silent[0].read(&mut [0]), Ok(0) | Err(_)));
    }

    #[test]
    fn files_are_offered_under_their_names() {
        let header = disposition("büro-illuminance", 2, "png");
        assert!(header.contains("filename=\"b_ro-illuminance-2.png\""), "{header}");
        assert!(header.ends_with("filename*=UTF-8''b%C3%BCro-illuminance-2.png"), "{header}");
    }

    #[test]
    fn the_table_in_the_papers_is_true() {
        let papers = include_str!("../../../../../SECURITY.md");
        for (what, limit) in [
            ("viewers at a time", VIEWERS_MAX.to_string()),
            ("connections that are no viewers' yet", CONNECTIONS_MAX.to_string()),
            ("time for one of these to ask", format!("{} s", REQUEST_PATIENCE.as_secs())),
            ("time for all that it asks and hears", format!("{} s", CONNECTION_PATIENCE.as_secs())),
            ("bytes of a viewer's message", format!("{} KiB", CLIENT_MESSAGE_MAX >> 10)),
            ("bytes of a luminaire's file that a viewer sends", format!("{} KiB", LUMINAIRE_FILE_MAX >> 10)),
            ("files of luminaires of a viewer that wait to be read", LUMINAIRES_WAITING.to_string()),
            ("silence until a viewer is gone", format!("{} s", watcher::BEAT.silence.as_secs())),
            ("messages of a viewer that wait to be handled", crate::display::hub::CLIENT_MESSAGES_MAX.to_string()),
        ] {
            assert!(papers.contains(&format!("| {what} | {limit} |")), "{what} is {limit}: SECURITY.md says otherwise");
        }
    }
}
