//! The other side: asks a process how it is. For health checks in images that have no shell, and for tests.

use std::io::{Read, Write};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, TcpStream};
use std::time::Duration;

/// Longest wait for each step.
const PATIENCE: Duration = Duration::from_secs(5);
/// Longest answer that is read, bytes.
const ANSWER_MAX: u64 = 1 << 20;

/// How a process on this machine or another is, in its own words: `/readyz` if it should be `ready`, else `/healthz`.
///
/// # Errors
/// In words: it is not well, or nobody answers.
pub fn check(address: SocketAddr, ready: bool) -> Result<String, String> {
    // Who listens on all addresses is found at this machine's own.
    let address = match address.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => SocketAddr::new(Ipv4Addr::LOCALHOST.into(), address.port()),
        IpAddr::V6(ip) if ip.is_unspecified() => SocketAddr::new(Ipv6Addr::LOCALHOST.into(), address.port()),
        _ => address,
    };
    match ask(address, if ready { "/readyz" } else { "/healthz" }) {
        Ok((200, said)) => Ok(said.trim_end().to_owned()),
        Ok((_, said)) => Err(said.trim_end().to_owned()),
        Err(error) => Err(format!("nobody answers at {address}: {error}")),
    }
}

/// Status and body of a page.
///
/// # Errors
/// Nobody answers there, or with something that is no HTTP.
pub fn ask(address: SocketAddr, path: &str) -> std::io::Result<(u16, String)> {
    let mut server = TcpStream::connect_timeout(&address, PATIENCE)?;
    server.set_read_timeout(Some(PATIENCE))?;
    server.set_write_timeout(Some(PATIENCE))?;
    write!(server, "GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n")?;
    let mut answer = String::new();
    server.take(ANSWER_MAX).read_to_string(&mut answer)?;
    let no_http = || std::io::Error::other("it does not speak HTTP");
    let (head, body) = answer.split_once("\r\n\r\n").ok_or_else(no_http)?;
    let status = head.split(' ').nth(1).and_then(|status| status.parse().ok()).ok_or_else(no_http)?;
    Ok((status, body.to_owned()))
}
