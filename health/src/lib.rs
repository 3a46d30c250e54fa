//! What a process tells those who look after it: `/metrics` for Prometheus, `/healthz` and `/readyz` for whatever
//! starts, stops and feeds it.
//!
//! [`page`] writes Prometheus' text, [`answer`](mod@answer) decides what a request gets; both are pure. [`server`] is
//! the socket, [`ask`](mod@ask) the other side of it, [`guests`] who may wait at a port, also at others'. This room has never heard of light, workers or masters.

pub mod answer;
pub mod ask;
pub mod guests;
pub mod histogram;
pub mod page;
pub mod server;

pub use answer::Report;
pub use guests::Guests;
pub use histogram::Histogram;
pub use page::Page;
pub use server::Server;

use std::net::{IpAddr, Ipv4Addr, SocketAddr};

/// Where to be asked, as people write it: `[ADDR:]PORT`, this machine only if there is no address.
///
/// # Errors
/// What it should look like.
pub fn address(text: &str) -> Result<SocketAddr, String> {
    let here = || text.parse().ok().map(|port| SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), port));
    text.parse().ok().or_else(here).ok_or_else(|| "wants [ADDR:]PORT, such as 9464 or 0.0.0.0:9464".to_owned())
}

/// Where to be asked if nobody says otherwise.
pub const ADDRESS: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 9464);

#[cfg(test)]
mod tests {
    use super::address;

    #[test]
    fn a_port_alone_is_of_this_machine() {
        assert_eq!(address("9464").unwrap().to_string(), "127.0.0.1:9464");
        assert_eq!(address("0.0.0.0:9464").unwrap().to_string(), "0.0.0.0:9464");
        assert_eq!(address("[::1]:1").unwrap().to_string(), "[::1]:1");
        for wrong in ["", "x", "70000", "1.2.3.4", ":1"] {
            assert!(address(wrong).is_err(), "{wrong}");
        }
    }
}
