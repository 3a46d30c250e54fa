//! Decides who may watch.
//!
//! On this machine's own address: every page that was opened here, and no other page that a browser
//! happens to have open (its name for us is checked, and where it comes from). On any other
//! address: whoever has the token.

use std::net::SocketAddr;
use std::sync::{Mutex, MutexGuard, PoisonError};

use axum::http::{HeaderMap, HeaderName, StatusCode, header};
use rustls::crypto::ring;
use subtle::ConstantTimeEq;

/// Decides who comes in.
pub struct Door {
    address: SocketAddr,
    token: Option<String>,
    /// Opens once: it is on the command line of the browser that is started here, where others can read it.
    once: Mutex<Option<String>>,
}

/// Characters that a token has at least.
const TOKEN_MIN: usize = 12;
/// … and at most: it is part of an address.
const TOKEN_MAX: usize = 128;

impl Door {
    /// A door at an address. Other addresses than loopback get a token, a fresh one if none is given.
    ///
    /// # Errors
    /// The token is too short, too long, or of characters that an address cannot have.
    pub fn new(address: SocketAddr, token: Option<String>) -> Result<Self, String> {
        if let Some(token) = &token {
            let plain = token.chars().all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c));
            if !plain || !(TOKEN_MIN..=TOKEN_MAX).contains(&token.len()) {
                return Err(format!(
                    "--viewer-token must be {TOKEN_MIN} to {TOKEN_MAX} letters, digits, or any of - _ ."
                ));
            }
        }
        let token = match token {
            None if !address.ip().is_loopback() => Some(fresh_token()?),
            token => token,
        };
        let once = token.as_ref().map(|_| fresh_token()).transpose()?;
        Ok(Self { address, token, once: Mutex::new(once) })
    }

    pub(super) fn address(&self) -> SocketAddr {
        self.address
    }

    /// What to open, when listening at `bound`.
    pub(super) fn url(&self, bound: SocketAddr) -> String {
        place(bound, "token", self.token.as_deref())
    }

    /// The same, for one browser that is started here: it opens once.
    pub(super) fn url_once(&self, bound: SocketAddr) -> String {
        place(bound, "once", self.once().as_deref())
    }

    /// The token, for the first that comes with what opens once.
    pub(super) fn redeem(&self, once: &str) -> Option<&str> {
        let mut ours = self.once();
        let is_it = ours.as_ref().is_some_and(|ours| ours.as_bytes().ct_eq(once.as_bytes()).into());
        if is_it {
            *ours = None;
        }
        self.token.as_deref().filter(|_| is_it)
    }

    fn once(&self) -> MutexGuard<'_, Option<String>> {
        self.once.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether a request may pass.
    ///
    /// # Errors
    /// The answer to it.
    pub(super) fn admits(
        &self,
        headers: &HeaderMap,
        token: Option<&str>,
        is_public: bool,
    ) -> Result<(), (StatusCode, &'static str)> {
        let text = |name: HeaderName| headers.get(name).and_then(|value| value.to_str().ok());
        let host = text(header::HOST).ok_or((StatusCode::BAD_REQUEST, "a request needs a Host"))?;
        // A page elsewhere whose name was made to point here (DNS rebinding) still has its own name.
        if self.address.ip().is_loopback() && !is_own_name(host) {
            return Err((StatusCode::FORBIDDEN, "this viewer answers to localhost only"));
        }
        // A page elsewhere may not open a socket here with this browser's help.
        if let Some(origin) = text(header::ORIGIN) {
            let theirs = origin.split_once("://").map(|(_, host)| host);
            if theirs != Some(host) {
                return Err((StatusCode::FORBIDDEN, "another site's page may not watch"));
            }
        }
        let known = match (&self.token, token) {
            (None, _) => true,
            (Some(token), Some(theirs)) => token.as_bytes().ct_eq(theirs.as_bytes()).into(),
            (Some(_), None) => false,
        };
        if known || is_public {
            Ok(())
        } else {
            Err((StatusCode::UNAUTHORIZED, "the address needs ?token=…, as the master prints it"))
        }
    }
}

/// An address with what lets in.
fn place(bound: SocketAddr, name: &str, secret: Option<&str>) -> String {
    let host = match bound.ip() {
        ip if ip.is_unspecified() => format!("{}:{}", crate::cluster::quic::reachable_address(ip), bound.port()),
        _ => bound.to_string(),
    };
    match secret {
        Some(secret) => format!("http://{host}/?{name}={secret}"),
        None => format!("http://{host}/"),
    }
}

/// Names of this machine for itself, at any port: one may have been forwarded.
fn is_own_name(host: &str) -> bool {
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split(']').next().unwrap_or(""),
        None => host.split(':').next().unwrap_or(""),
    };
    let is_loopback = name.parse::<std::net::IpAddr>().is_ok_and(|ip| ip.is_loopback());
    is_loopback || name.eq_ignore_ascii_case("localhost")
}

fn fresh_token() -> Result<String, String> {
    let mut secret = [0; 16];
    let random = ring::default_provider().secure_random;
    random.fill(&mut secret).map_err(|_| "the system has no random numbers")?;
    Ok(secret.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(host: &str, origin: Option<&str>) -> HeaderMap {
        let mut headers = HeaderMap::new();
        headers.insert(header::HOST, host.parse().unwrap());
        origin.map(|origin| headers.insert(header::ORIGIN, origin.parse().unwrap()));
        headers
    }

    #[test]
    fn pages_of_this_machine_come_in_and_others_do_not() {
        let door = Door::new("127.0.0.1:8080".parse().unwrap(), None).unwrap();
        let admits = |host: &str, origin| door.admits(&headers(host, origin), None, false).is_ok();
        assert!(admits("127.0.0.1:8080", None) && admits("localhost:1234", None) && admits("[::1]:8080", None));
        assert!(admits("localhost:8080", Some("http://localhost:8080")));
        assert!(!admits("evil.example:8080", None), "a name that points here");
        assert!(!admits("localhost:8080", Some("http://evil.example")), "a page elsewhere");
        assert!(!admits("localhost:8080", Some("null")) && !admits("localhost:8080", Some("http://localhost:1")));
        assert!(door.admits(&HeaderMap::new(), None, true).is_err());
    }

    #[test]
    fn other_addresses_want_the_token() {
        let address: SocketAddr = "192.0.2.1:80".parse().unwrap();
        let door = Door::new(address, None).unwrap();
        let token = door.token.clone().unwrap();
        let status =
            |token: Option<&str>, public| door.admits(&headers("host", None), token, public).err().map(|e| e.0);
        assert_eq!(status(Some(&token), false), None);
        assert_eq!(status(None, true), None);
        for wrong in [None, Some(""), Some("x"), Some(&token[1..])] {
            assert_eq!(status(wrong, false), Some(StatusCode::UNAUTHORIZED), "{wrong:?}");
        }
        assert_ne!(Door::new(address, None).unwrap().token.unwrap(), token, "fresh each time");
        assert!(door.url(address).ends_with(&format!("/?token={token}")));

        let link = door.url_once(address);
        let once = link.split("?once=").nth(1).unwrap();
        assert!(!link.contains(&token) && door.redeem("").is_none() && door.redeem(&token).is_none());
        assert_eq!(door.redeem(once), Some(token.as_str()));
        assert_eq!(door.redeem(once), None, "it opens once");
        for wrong in ["short", "with spaces in it", &"x".repeat(200)] {
            assert!(Door::new(address, Some(wrong.into())).is_err());
        }
    }
}
