//! The few words of WebDriver (W3C) that these tests need, to chromedriver: JSON over plain HTTP. A client library
//! would bring seventy crates for them.

use std::io::{BufRead, BufReader};
use std::net::{Ipv4Addr, SocketAddr};
use std::process::{Child, Command, Stdio};

use base64::Engine;
use serde_json::{Value, json};

use super::master::request;

/// A chromedriver; killed when dropped.
pub struct Driver {
    process: Child,
    address: SocketAddr,
}

/// A window of Chromium without a screen; closed when dropped.
pub struct Window {
    address: SocketAddr,
    session: String,
}

impl Driver {
    /// Nothing, and a message, if it is not installed.
    pub fn start() -> Option<Self> {
        let found = Command::new("chromedriver")
            .arg("--port=0")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn();
        let Ok(mut process) = found else {
            let demanded = std::env::var_os("IGI_TEST_BROWSER").is_some();
            assert!(!demanded, "IGI_TEST_BROWSER is set, but chromedriver is not installed");
            eprintln!("skipped: chromedriver is not installed (Debian: apt-get install chromium chromium-driver)");
            return None;
        };
        let mut lines = BufReader::new(process.stdout.take()?).lines().map_while(Result::ok);
        let port = lines.by_ref().find_map(|line| {
            let (_, rest) = line.split_once("started successfully on port ")?;
            rest.trim_end_matches('.').parse().ok()
        });
        std::thread::spawn(move || lines.for_each(drop));
        let address = (Ipv4Addr::LOCALHOST, port.expect("chromedriver says where it listens")).into();
        Some(Self { process, address })
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
        let wanted = json!({ "alwaysMatch": { "goog:chromeOptions": options }, });
        let made = say(self.address, "POST /session", &json!({ "capabilities": wanted }));
        let session =
            made["sessionId"].as_str().unwrap_or_else(|| panic!("Chromium does not start: {made}")).to_string();
        let window = Window { address: self.address, session };
        window.say("POST", "timeouts", &json!({ "script": 120_000 }));
        window
    }
}

impl Window {
    /// Opens an address.
    pub fn go(&self, url: &str) {
        self.say("POST", "url", &json!({ "url": url }));
    }

    /// Runs a script in the page; what it returns.
    pub fn run(&self, script: &str) -> Value {
        self.say("POST", "execute/sync", &json!({ "script": script, "args": [] }))
    }

    /// Runs a script that says when it is done, by calling its last argument.
    pub fn run_and_wait(&self, script: &str) -> Value {
        self.say("POST", "execute/async", &json!({ "script": script, "args": [] }))
    }

    /// What can be seen, as PNG.
    pub fn photograph(&self) -> Vec<u8> {
        let taken = self.say("GET", "screenshot", &Value::Null);
        base64::engine::general_purpose::STANDARD.decode(taken.as_str().expect("a picture")).expect("base64")
    }

    fn say(&self, method: &str, what: &str, body: &Value) -> Value {
        let answer = say(self.address, &format!("{method} /session/{}/{what}", self.session), body);
        assert!(answer.get("error").is_none(), "{what} {body}: {answer}");
        answer
    }
}

fn say(address: SocketAddr, what: &str, body: &Value) -> Value {
    let body = if body.is_null() { String::new() } else { body.to_string() };
    let (_, answer) = request(address, what, "Content-Type: application/json\r\n", &body);
    let answer: Value = serde_json::from_slice(&answer).expect("chromedriver speaks JSON");
    answer["value"].clone()
}

impl Drop for Window {
    fn drop(&mut self) {
        let gone = format!("DELETE /session/{}", self.session);
        // A test that failed has more to say than its window.
        if !std::thread::panicking() {
            say(self.address, &gone, &Value::Null);
        }
    }
}

impl Drop for Driver {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
