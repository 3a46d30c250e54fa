//! Plain HTTP requests: one a connection, and none waits for ever.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};

/// What came: status line and headers in lower case, and the body.
pub type Answer = (String, Vec<u8>);

/// Sends a request, `what` being method and path. The answer ends where its `Content-Length` says, since not every
/// server closes a connection when asked to (chromedriver does not).
///
/// # Errors
/// The system's; or no whole answer in time.
pub fn request(address: SocketAddr, what: &str, headers: &str, body: &str, patience: Duration) -> io::Result<Answer> {
    let deadline = Instant::now() + patience;
    let mut stream = TcpStream::connect_timeout(&address, patience)?;
    let has_host = headers.to_lowercase().contains("host:");
    let host = if has_host { String::new() } else { format!("Host: {address}\r\n") };
    let length = body.len();
    let head = format!("{what} HTTP/1.1\r\n{host}{headers}Content-Length: {length}\r\nConnection: close\r\n\r\n");
    stream.set_write_timeout(Some(patience))?;
    stream.write_all((head + body).as_bytes())?;

    let (mut answer, mut part) = (Vec::new(), vec![0; 1 << 16]);
    loop {
        if let Some(whole) = whole(&answer, false) {
            return Ok(whole);
        }
        let left = deadline.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(io::Error::new(ErrorKind::TimedOut, format!("no answer in time to {what}")));
        }
        stream.set_read_timeout(Some(left))?;
        match stream.read(&mut part)? {
            0 => return whole(&answer, true).ok_or_else(|| ErrorKind::UnexpectedEof.into()),
            read => answer.extend(&part[..read]),
        }
    }
}

/// The answer, if it is all there.
fn whole(bytes: &[u8], closed: bool) -> Option<Answer> {
    let end = bytes.windows(4).position(|four| four == b"\r\n\r\n")?;
    let head = String::from_utf8_lossy(&bytes[..end]).to_lowercase();
    let length = head.lines().find_map(|line| line.strip_prefix("content-length:")?.trim().parse::<usize>().ok());
    let body = &bytes[end + 4..];
    match length {
        Some(length) => Some((head, body.get(..length)?.to_vec())),
        None => closed.then(|| (head, body.to_vec())),
    }
}
