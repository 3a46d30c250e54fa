//! The few commands of WebDriver (W3C) that these tests need, to chromedriver: JSON over plain HTTP. A client library
//! would bring seventy crates for them.

use std::io::{BufRead, BufReader, Write};
use std::net::{Ipv4Addr, SocketAddr};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use base64::Engine;
use serde_json::{Value, json};

use super::http::request;

/// A chromedriver; killed when dropped.
pub struct Driver {
    process: Child,
    address: SocketAddr,
}

/// A window of Chromium without a screen; closed when dropped.
pub struct Window {
    address: SocketAddr,
    session: String,
    /// When the test must be over.
    end: Instant,
}

/// Longest wait for any one thing.
pub const PATIENCE: Duration = Duration::from_secs(20);
/// Longest life of a window: a test that takes longer has failed.
const LIFE: Duration = Duration::from_secs(120);
/// Longest wait for a window to close.
const FAREWELL: Duration = Duration::from_secs(5);

impl Driver {
    /// Nothing, and a message, unless IGI_TEST_BROWSER asks for it.
    pub fn start() -> Option<Self> {
        if std::env::var_os("IGI_TEST_BROWSER").is_none() {
            // Past the harness, which swallows what tests that pass print.
            let reason =
                "tests in a browser were skipped: IGI_TEST_BROWSER=1 runs them, with chromium and chromedriver";
            let _ = writeln!(std::io::stderr(), "{reason}");
            return None;
        }
        let mut command = Command::new("chromedriver");
        let started = command.arg("--port=0").stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
        let mut process = started.expect("chromedriver starts (Debian: apt-get install chromium chromium-driver)");
        let lines = BufReader::new(process.stdout.take().expect("its output")).lines().map_while(Result::ok);
        let (sender, ports) = mpsc::channel();
        std::thread::spawn(move || {
            for line in lines {
                let port = line.split_once("started successfully on port ");
                if let Some(port) = port.and_then(|(_, rest)| rest.trim_end_matches('.').parse::<u16>().ok()) {
                    let _ = sender.send(port);
                }
            }
        });
        let mut driver = Self { process, address: (Ipv4Addr::LOCALHOST, 0).into() };
        driver.address.set_port(ports.recv_timeout(PATIENCE).expect("chromedriver says where it listens"));
        Some(driver)
    }

    /// Opens a window.
    pub fn window(&self, width: u32, height: u32, phone: bool) -> Window {
        let size = format!("--window-size={width},{height}");
        let flags =
            ["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars", &size];
        let mut options = json!({ "args": flags });
        if phone {
            let metrics = json!({ "width": width, "height": height, "pixelRatio": 2.0, "touch": true });
            options["mobileEmulation"] = json!({ "deviceMetrics": metrics });
        }
        let patience = PATIENCE.as_millis() as u64;
        let wanted = json!({
            "goog:chromeOptions": options, "goog:loggingPrefs": { "browser": "ALL" },
            "timeouts": { "script": patience, "pageLoad": patience, "implicit": 0 },
        });
        let wanted = json!({ "capabilities": { "alwaysMatch": wanted } });
        let end = Instant::now() + LIFE;
        let made = command(self.address, "POST /session", &wanted, left(end));
        let session = made["sessionId"].as_str().unwrap_or_else(|| panic!("Chromium does not start: {made}"));
        Window { address: self.address, session: session.to_string(), end }
    }
}

impl Window {
    /// Opens an address.
    pub fn go(&self, url: &str) {
        self.command("POST", "url", &json!({ "url": url }));
    }

    /// Has a script run in every page that is opened from now on, before the page's own.
    pub fn before_all_else(&self, script: &str) {
        let add = "Page.addScriptToEvaluateOnNewDocument";
        self.command("POST", "goog/cdp/execute", &json!({ "cmd": add, "params": { "source": script } }));
    }

    /// Changes the size of the window and how many pixels a point of it has.
    pub fn reshape(&self, [width, height]: [u32; 2], ratio: f64) {
        let params = json!({ "width": width, "height": height, "deviceScaleFactor": ratio, "mobile": false });
        self.command(
            "POST",
            "goog/cdp/execute",
            &json!({ "cmd": "Emulation.setDeviceMetricsOverride", "params": params }),
        );
        // Without a screen, the page learns of another ratio only when it is drawn, and it is drawn when it is looked at.
        self.photograph();
    }

    /// Runs a script in the page; what it returns.
    pub fn run(&self, script: &str) -> Value {
        self.command("POST", "execute/sync", &json!({ "script": script, "args": [] }))
    }

    /// Runs a script that says when it is done, by calling its last argument.
    pub fn run_and_wait(&self, script: &str) -> Value {
        self.command("POST", "execute/async", &json!({ "script": script, "args": [] }))
    }

    /// Presses at a place of the window, goes to the others in turn, lets go: a real mouse, or a finger.
    pub fn drag(&self, pointer: &str, places: &[[f64; 2]]) {
        let to = |place: &[f64; 2], duration: u32| {
            let [x, y] = place.map(f64::round);
            json!({ "type": "pointerMove", "duration": duration, "x": x as i64, "y": y as i64, "origin": "viewport" })
        };
        let mut actions = vec![to(&places[0], 0), json!({ "type": "pointerDown", "button": 0 })];
        actions.extend(places[1..].iter().map(|place| to(place, 20)));
        actions.push(json!({ "type": "pointerUp", "button": 0 }));
        let hand =
            json!({ "type": "pointer", "id": pointer, "parameters": { "pointerType": pointer }, "actions": actions });
        self.command("POST", "actions", &json!({ "actions": [hand] }));
    }

    /// Moves the mouse to a place of the window.
    pub fn hover(&self, place: [f64; 2]) {
        let [x, y] = place.map(|v| v.round() as i64);
        let to = json!({ "type": "pointerMove", "duration": 20, "x": x, "y": y, "origin": "viewport" });
        let hand =
            json!({ "type": "pointer", "id": "mouse", "parameters": { "pointerType": "mouse" }, "actions": [to] });
        self.command("POST", "actions", &json!({ "actions": [hand] }));
    }

    /// Turns a mouse's wheel over a place by so many pixels.
    pub fn wheel(&self, place: [f64; 2], by: i64) {
        let [x, y] = place.map(|v| v.round() as i64);
        let scroll = json!({ "type": "scroll", "duration": 20, "x": x, "y": y, "deltaX": 0, "deltaY": by, "origin": "viewport" });
        self.command(
            "POST",
            "actions",
            &json!({ "actions": [{ "type": "wheel", "id": "wheel", "actions": [scroll] }] }),
        );
    }

    /// Holds the first keys while it strikes the last (as in the standard's table of keys).
    pub fn keys(&self, keys: &[&str]) {
        let key = |kind: &str, key: &&str| json!({ "type": kind, "value": key });
        // So long that keys that move while they are held do so.
        let hold = json!({ "type": "pause", "duration": 120 });
        let down = keys.iter().map(|k| key("keyDown", k));
        let actions: Vec<_> = down.chain([hold]).chain(keys.iter().rev().map(|k| key("keyUp", k))).collect();
        self.command("POST", "actions", &json!({ "actions": [{ "type": "key", "id": "keys", "actions": actions }] }));
    }

    /// What can be seen, as PNG.
    pub fn photograph(&self) -> Vec<u8> {
        let taken = self.command("GET", "screenshot", &Value::Null);
        base64::engine::general_purpose::STANDARD.decode(taken.as_str().expect("a picture")).expect("base64")
    }

    /// What the browser complained of since it was last asked.
    pub fn complaints(&self) -> Vec<String> {
        let log = self.command("POST", "se/log", &json!({ "type": "browser" }));
        let severe = log.as_array().into_iter().flatten().filter(|entry| entry["level"] == "SEVERE");
        severe.map(|entry| entry["message"].to_string()).collect()
    }

    fn command(&self, method: &str, what: &str, body: &Value) -> Value {
        let path = format!("{method} /session/{}/{what}", self.session);
        let answer = command(self.address, &path, body, left(self.end));
        assert!(answer.get("error").is_none(), "{what} {body}: {answer}");
        answer
    }
}

fn left(end: Instant) -> Duration {
    let left = end.saturating_duration_since(Instant::now());
    assert!(!left.is_zero(), "the test takes longer than {} s", LIFE.as_secs());
    // Scripts that wait give up first, with a better message.
    left.min(PATIENCE + Duration::from_secs(5))
}

fn command(address: SocketAddr, what: &str, body: &Value, patience: Duration) -> Value {
    let body = if body.is_null() { String::new() } else { body.to_string() };
    let answer = request(address, what, "Content-Type: application/json\r\n", &body, patience);
    let (_, answer) = answer.unwrap_or_else(|error| panic!("chromedriver does not answer {what}: {error}"));
    let answer: Value = serde_json::from_slice(&answer).expect("chromedriver speaks JSON");
    answer["value"].clone()
}

impl Drop for Window {
    fn drop(&mut self) {
        // Also when the test has failed: a browser that is not closed lives on.
        let gone = format!("DELETE /session/{}", self.session);
        let _ = request(self.address, &gone, "", "", FAREWELL);
    }
}

impl Drop for Driver {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
