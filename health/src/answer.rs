//! What a request gets: bytes in, bytes out.

use crate::page::Page;

/// What a process has to say of itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Report {
    /// What it counts.
    pub page: Page,
    /// It does its work; or why it should be started again.
    pub alive: Result<(), String>,
    /// It can be given work, and what it does; or why not yet.
    pub ready: Result<String, String>,
}

/// Longest request that is read, bytes: ours are some hundred.
pub const REQUEST_MAX: usize = 8 << 10;

/// Answers a request for one of the three pages; every other one is refused in words. The report is made only if
/// somebody wants it.
pub fn answer(request: &[u8], report: impl FnOnce() -> Report) -> Vec<u8> {
    let (status, kind, body) = match path(request) {
        Err(refusal) => (refusal, PLAIN, format!("{refusal}\n")),
        Ok("/metrics") => (OK, PROMETHEUS, report().page.text().to_owned()),
        Ok("/healthz") => verdict(report().alive.map(|()| "ok".to_owned())),
        Ok("/readyz") => verdict(report().ready),
        Ok(_) => ("404 Not Found", PLAIN, "there are /metrics, /healthz and /readyz\n".to_owned()),
    };
    let length = body.len();
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nCache-Control: no-store\r\n\
         X-Content-Type-Options: nosniff\r\nConnection: close\r\n\r\n"
    );
    let body = if request.starts_with(b"HEAD ") { String::new() } else { body };
    (head + &body).into_bytes()
}

const OK: &str = "200 OK";
const PLAIN: &str = "text/plain; charset=utf-8";
const PROMETHEUS: &str = "text/plain; version=0.0.4; charset=utf-8";

fn verdict(said: Result<String, String>) -> (&'static str, &'static str, String) {
    match said {
        Ok(words) => (OK, PLAIN, words + "\n"),
        Err(reason) => ("503 Service Unavailable", PLAIN, reason + "\n"),
    }
}

/// What is asked for, without what follows a question mark.
fn path(request: &[u8]) -> Result<&str, &'static str> {
    const BAD: &str = "400 Bad Request";
    let line = request.split(|byte| *byte == b'\n').next().unwrap_or_default();
    let line = std::str::from_utf8(line).map_err(|_| BAD)?;
    let mut words = line.trim_end_matches('\r').split(' ');
    match (words.next(), words.next(), words.next(), words.next()) {
        (Some("GET" | "HEAD"), Some(target), Some(version), None) if version.starts_with("HTTP/1.") => {
            Ok(target.split('?').next().unwrap_or(target))
        }
        (Some(_), Some(_), Some(version), None) if version.starts_with("HTTP/1.") => Err("405 Method Not Allowed"),
        _ => Err(BAD),
    }
}

/// The request's head is complete.
pub fn is_complete(request: &[u8]) -> bool {
    request.windows(4).any(|end| end == b"\r\n\r\n") || request.windows(2).any(|end| end == b"\n\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report() -> Report {
        let mut page = Page::default();
        page.gauge("igi_up", "It runs.", 1.0);
        Report { page, alive: Ok(()), ready: Err("fetching 43 %".into()) }
    }

    fn said(request: &str) -> String {
        String::from_utf8(answer(request.as_bytes(), report)).unwrap()
    }

    #[test]
    fn the_three_pages_are_told_apart() {
        let metrics = said("GET /metrics HTTP/1.1\r\nHost: x\r\n\r\n");
        assert!(metrics.starts_with("HTTP/1.1 200 OK\r\n") && metrics.ends_with("igi_up 1\n"), "{metrics}");
        assert!(metrics.contains("version=0.0.4"));
        let health = said("GET /healthz?verbose HTTP/1.0\r\n\r\n");
        assert!(health.starts_with("HTTP/1.1 200") && health.ends_with("\r\n\r\nok\n"), "{health}");
        let ready = said("GET /readyz HTTP/1.1\r\n\r\n");
        assert!(ready.starts_with("HTTP/1.1 503") && ready.ends_with("fetching 43 %\n"), "{ready}");
        assert!(said("HEAD /healthz HTTP/1.1\r\n\r\n").ends_with("\r\n\r\n"));
    }

    #[test]
    fn everything_else_is_refused() {
        for (request, status) in [
            ("GET / HTTP/1.1\r\n\r\n", "404"),
            ("POST /metrics HTTP/1.1\r\n\r\n", "405"),
            ("GET /metrics\r\n\r\n", "400"),
            ("GET /metrics HTTP/2\r\n\r\n", "400"),
            ("", "400"),
            ("GET  /metrics HTTP/1.1\r\n\r\n", "400"),
        ] {
            assert!(said(request).starts_with(&format!("HTTP/1.1 {status}")), "{request:?}");
        }
        assert!(answer(&[0xff, 0xfe, b'\n'], report).starts_with(b"HTTP/1.1 400"));
    }

    #[test]
    fn a_head_ends_with_an_empty_line() {
        assert!(is_complete(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n") && is_complete(b"GET / HTTP/1.0\n\n"));
        assert!(!is_complete(b"GET / HTTP/1.1\r\nHost: x\r\n") && !is_complete(b""));
    }
}
