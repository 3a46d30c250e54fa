//! Spans of frames (feature `otel`), as a collector gets them that this test itself is.

use std::collections::BTreeSet;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpListener;
use std::process::{Command, Output, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use serde_json::Value;

const CORNELL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell");
const FRAMES: usize = 3;

/// Answers every request with this status; what comes in: the first line, and the body.
fn collector(status: &'static str) -> (String, Receiver<(String, Value)>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let (sender, requests) = channel();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let mut stream = BufReader::new(stream.unwrap());
            let mut lines = Vec::new();
            loop {
                let mut line = String::new();
                stream.read_line(&mut line).unwrap();
                if line.trim().is_empty() {
                    break;
                }
                lines.push(line.trim().to_ascii_lowercase());
            }
            assert!(lines.contains(&"content-type: application/json".to_owned()), "{lines:?}");
            let length = lines.iter().find_map(|line| line.strip_prefix("content-length: ")).unwrap().parse().unwrap();
            let mut body = vec![0; length];
            stream.read_exact(&mut body).unwrap();
            let _ = sender.send((lines[0].clone(), serde_json::from_slice(&body).unwrap()));
            write!(stream.get_mut(), "HTTP/1.1 {status}\r\nContent-Length: 2\r\nConnection: close\r\n\r\n{{}}")
                .unwrap();
        }
    });
    (format!("http://{address}"), requests)
}

fn render(variable: &str, endpoint: &str) -> Output {
    let folder = tempfile::tempdir().unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_igi-master"));
    command.current_dir(folder.path()).env_remove("RUST_LOG").env_remove("IGI_WORKERS").env_remove("IGI_LISTEN");
    command.args(["render", CORNELL, "--size", "48x36", "--frames", "3", "--workers", "embedded:2", "-o", "a.exr"]);
    command.env(variable, endpoint).env("OTEL_SERVICE_NAME", "a master").stdin(Stdio::null());
    command.output().expect("the program starts")
}

fn attribute<'a>(of: &'a Value, key: &str) -> &'a Value {
    let all = of["attributes"].as_array().expect("attributes are a list");
    let one = all.iter().find(|one| one["key"] == key).unwrap_or_else(|| panic!("no {key} in {of}"));
    one["value"].as_object().and_then(|value| value.values().next()).expect("a value of some kind")
}

fn number(value: &Value) -> u64 {
    value.as_str().expect("64 bits are a string").parse().expect("a number")
}

#[test]
fn every_frame_is_a_span_and_every_tile_an_event_within_it() {
    let (endpoint, requests) = collector("200 OK");
    let output = render("OTEL_EXPORTER_OTLP_ENDPOINT", &endpoint);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut spans = Vec::new();
    while let Ok((first, body)) = requests.recv_timeout(Duration::from_millis(500)) {
        assert_eq!(first, "post /v1/traces http/1.1");
        let resource = &body["resourceSpans"][0];
        assert_eq!(attribute(&resource["resource"], "service.name"), "a master");
        spans.extend(resource["scopeSpans"][0]["spans"].as_array().expect("spans are a list").clone());
    }
    assert_eq!(spans.len(), FRAMES);
    let tiles = spans[0]["events"].as_array().unwrap().len();
    assert!(tiles >= 9, "one for each light set, at least");
    for (at, span) in spans.iter().enumerate() {
        assert_eq!((span["name"].as_str(), number(attribute(span, "igi.frame"))), (Some("frame"), at as u64));
        assert_eq!(number(attribute(span, "igi.width")), 48);
        assert_eq!(attribute(span, "igi.cancelled"), false);
        let [begun, ended] = ["startTimeUnixNano", "endTimeUnixNano"].map(|key| number(&span[key]));
        let events = span["events"].as_array().unwrap();
        assert_eq!((events.len(), number(attribute(span, "igi.tiles"))), (tiles, tiles as u64));
        let key = |event| ["igi.set", "igi.x", "igi.y"].map(|key| number(attribute(event, key)));
        assert_eq!(events.iter().map(key).collect::<BTreeSet<_>>().len(), tiles, "a tile is there twice");
        assert!(events.iter().all(|event| (begun..=ended).contains(&number(&event["timeUnixNano"]))));
        let sum: u64 = events.iter().map(|event| number(attribute(event, "igi.thread_us"))).sum();
        assert!(sum > 0 && sum == number(attribute(span, "igi.thread_us")));
        let [trace, own] = ["traceId", "spanId"].map(|key| span[key].as_str().unwrap().len());
        assert_eq!([trace, own], [32, 16]);
    }
    let traces: BTreeSet<_> = spans.iter().map(|span| span["traceId"].as_str().unwrap()).collect();
    assert_eq!(traces.len(), FRAMES);
}

#[test]
fn a_collector_that_refuses_or_is_not_there_costs_spans_and_no_picture() {
    let (endpoint, requests) = collector("503 Service Unavailable");
    let output = render("OTEL_EXPORTER_OTLP_TRACES_ENDPOINT", &format!("{endpoint}/spans"));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && said.contains("503"), "{said}");
    assert_eq!(requests.recv().unwrap().0, "post /spans http/1.1");
    for (nowhere, words) in [("http://127.0.0.1:1", "127.0.0.1:1"), ("https://example.org", "no spans")] {
        let output = render("OTEL_EXPORTER_OTLP_ENDPOINT", nowhere);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success() && said.contains(words), "{said}");
    }
}
