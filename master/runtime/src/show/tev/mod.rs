//! Pictures in tev, the viewer (<https://github.com/Tom94/tev>), as they sharpen.
//!
//! A thread of its own sends what has changed since the last time, tile by tile. Whoever draws hands pictures over and
//! never waits: only the newest is kept, and a tev that is slow, silent or gone costs nothing but the copy. A tev that is
//! started later is found, and told everything.

mod packet;

use std::io::{self, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use frame::Picture;
use glam::Vec3;

use packet::{Rect, create_image, update_image};

/// Where tev listens: a host and a port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TevAddress(String);

impl std::str::FromStr for TevAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (host, port) = text.rsplit_once(':').unwrap_or_default();
        let sound = !host.is_empty() && port.parse::<u16>().is_ok_and(|port| port > 0);
        sound.then(|| Self(text.into())).ok_or_else(|| "expected host:port, such as 127.0.0.1:14158".into())
    }
}

/// The way to a tev; dropped, the last picture is still sent, if that does not take long.
pub struct Tev {
    mailbox: Arc<Mailbox>,
    thread: Option<JoinHandle<()>>,
    next: Instant,
}

#[derive(Default)]
struct Mailbox {
    inside: Mutex<Inside>,
    news: Condvar,
}

#[derive(Default)]
struct Inside {
    waiting: Option<Picture>,
    /// A picture is being sent.
    busy: bool,
    closed: bool,
}

/// Pictures follow each other this fast at most.
const BETWEEN_PICTURES: Duration = Duration::from_millis(250);
/// Between two tries to reach a tev that is not there.
const BETWEEN_TRIES: Duration = Duration::from_secs(2);
/// Longest sleep of who has nothing to send.
const IDLE: Duration = Duration::from_secs(3600);
/// A tev that takes nothing for so long is gone.
const PATIENCE: Duration = Duration::from_secs(5);
/// Longest wait for the last picture to be taken.
const FAREWELL: Duration = Duration::from_secs(3);
/// Sides of what is compared and sent at once, pixels.
const TILE: u32 = 64;

impl Tev {
    /// Starts the thread. `name`: what tev lists the picture as.
    ///
    /// # Errors
    /// The system has no more threads.
    pub fn start(address: TevAddress, name: &str) -> io::Result<Self> {
        let mailbox = Arc::new(Mailbox::default());
        let (theirs, name) = (Arc::clone(&mailbox), name.to_owned());
        let work =
            move || work(&theirs, &mut Line { address, name, stream: None, sent: None, greeted: false, retry: None });
        let thread = Some(std::thread::Builder::new().name("tev".into()).spawn(work)?);
        Ok(Self { mailbox, thread, next: Instant::now() })
    }

    /// The last picture was a while ago, and has been sent: another would be welcome.
    pub fn is_due(&self) -> bool {
        let inside = self.mailbox.inside.lock().unwrap_or_else(PoisonError::into_inner);
        Instant::now() >= self.next && !inside.busy && inside.waiting.is_none()
    }

    /// Sends a picture in place of any that waits.
    pub fn show(&mut self, picture: Picture) {
        self.next = Instant::now() + BETWEEN_PICTURES;
        self.put(|inside| inside.waiting = Some(picture));
    }

    fn put(&self, put: impl FnOnce(&mut Inside)) {
        put(&mut self.mailbox.inside.lock().unwrap_or_else(PoisonError::into_inner));
        self.mailbox.news.notify_all();
    }
}

impl Drop for Tev {
    fn drop(&mut self) {
        self.put(|inside| inside.closed = true);
        let until = Instant::now() + FAREWELL;
        while let Some(thread) = &self.thread {
            if thread.is_finished() || Instant::now() >= until {
                return;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

fn work(mailbox: &Mailbox, line: &mut Line) {
    // The newest picture, if tev does not have it: it may be started when nothing moves any more.
    let mut unsent: Option<Picture> = None;
    loop {
        let inside = mailbox.inside.lock().unwrap_or_else(PoisonError::into_inner);
        let is_idle = |inside: &mut Inside| !inside.closed && inside.waiting.is_none();
        let patience = if unsent.is_some() { BETWEEN_TRIES } else { IDLE };
        let (mut inside, _) =
            mailbox.news.wait_timeout_while(inside, patience, is_idle).unwrap_or_else(PoisonError::into_inner);
        let picture = inside.waiting.take();
        if picture.is_none() && inside.closed {
            return;
        }
        let Some(picture) = picture.or_else(|| unsent.take()) else { continue };
        inside.busy = true;
        drop(inside);
        unsent = line.show(picture);
        mailbox.inside.lock().unwrap_or_else(PoisonError::into_inner).busy = false;
    }
}

/// The connection, and what tev knows.
struct Line {
    address: TevAddress,
    name: String,
    stream: Option<TcpStream>,
    /// What tev shows.
    sent: Option<Picture>,
    /// It has been brought to the front once; from then on people decide what they look at.
    greeted: bool,
    /// Not before this time.
    retry: Option<Instant>,
}

impl Line {
    /// Gives the picture back if it could not be sent.
    fn show(&mut self, picture: Picture) -> Option<Picture> {
        if self.retry.is_some_and(|at| Instant::now() < at) {
            return Some(picture);
        }
        if let Err(error) = self.send(&picture) {
            if self.retry.is_none() {
                tracing::warn!("tev at {}: {error}; trying again now and then", self.address.0);
            }
            (self.stream, self.sent, self.retry) = (None, None, Some(Instant::now() + BETWEEN_TRIES));
            return Some(picture);
        }
        (self.sent, self.retry) = (Some(picture), None);
        None
    }

    fn send(&mut self, picture: &Picture) -> io::Result<()> {
        let stream = match &mut self.stream {
            Some(stream) => stream,
            none => none.insert(connect(&self.address)?),
        };
        let known = self.sent.as_ref().filter(|sent| sent.same_size(picture));
        if known.is_none() {
            stream.write_all(&create_image(&self.name, [picture.width, picture.height], !self.greeted))?;
            self.greeted = true;
        }
        for rect in tiles(picture) {
            if known.is_none_or(|known| !rows(known, rect).eq(rows(picture, rect))) {
                let pixels = rows(picture, rect).map(|pixel| Vec3::from_array(pixel.map(f32::from_bits)));
                stream.write_all(&update_image(&self.name, rect, pixels))?;
            }
        }
        Ok(())
    }
}

fn connect(TevAddress(address): &TevAddress) -> io::Result<TcpStream> {
    let mut last = io::Error::new(io::ErrorKind::NotFound, "the host has no address");
    for address in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, PATIENCE) {
            Ok(stream) => {
                stream.set_write_timeout(Some(PATIENCE))?;
                return Ok(stream);
            }
            Err(error) => last = error,
        }
    }
    Err(last)
}

fn tiles(picture: &Picture) -> impl Iterator<Item = Rect> {
    let Picture { width, height, .. } = *picture;
    let from = |side: u32| (0..side).step_by(TILE as usize);
    from(height).flat_map(move |y| from(width).map(move |x| (x, y))).map(move |(x, y)| Rect {
        x,
        y,
        width: TILE.min(width - x),
        height: TILE.min(height - y),
    })
}

/// The pixels of a rectangle as bits: what is no number equals itself.
fn rows(picture: &Picture, rect: Rect) -> impl Iterator<Item = [u32; 3]> {
    let row = move |y: u32| {
        let first = (y as usize * picture.width as usize) + rect.x as usize;
        &picture.pixels[first..first + rect.width as usize]
    };
    (rect.y..rect.y + rect.height).flat_map(row).map(|pixel| pixel.to_array().map(f32::to_bits))
}

#[cfg(test)]
mod tests {
    use std::io::Read;
    use std::net::TcpListener;

    use super::*;

    fn listen() -> (TcpListener, TevAddress) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        (listener, address.parse().unwrap())
    }

    /// The operations of the packets that come until the sender has nothing more to say for a while.
    fn operations(stream: &mut TcpStream) -> Vec<u8> {
        stream.set_read_timeout(Some(Duration::from_millis(400))).unwrap();
        let mut operations = Vec::new();
        let mut head = [0; 5];
        while stream.read_exact(&mut head).is_ok() {
            operations.push(head[4]);
            let length = u32::from_le_bytes(head[..4].try_into().unwrap()) as usize;
            stream.read_exact(&mut vec![0; length - 5]).unwrap();
        }
        operations
    }

    #[test]
    fn only_tiles_that_changed_are_sent_and_a_new_tev_is_told_everything() {
        let (listener, address) = listen();
        let mut tev = Tev::start(address, "a").unwrap();
        let mut picture = Picture::black(130, 70);
        tev.show(picture.clone());
        let (mut stream, _) = listener.accept().unwrap();
        assert_eq!(operations(&mut stream), [4, 6, 6, 6, 6, 6, 6]);
        picture.pixels[0] = Vec3::splat(f32::NAN);
        for expected in [&[6][..], &[]] {
            tev.show(picture.clone());
            assert_eq!(operations(&mut stream), expected, "one tile, then none");
        }

        drop(stream);
        // The system may take a packet or two before it notices.
        let mut value = 0.0;
        listener.set_nonblocking(true).unwrap();
        let began = Instant::now();
        let mut again = loop {
            assert!(began.elapsed() < Duration::from_secs(30), "it never comes again");
            value += 1.0;
            picture.pixels.fill(Vec3::splat(value));
            tev.show(picture.clone());
            std::thread::sleep(Duration::from_millis(50));
            if let Ok((stream, _)) = listener.accept() {
                break stream;
            }
        };
        again.set_nonblocking(false).unwrap();
        assert_eq!(operations(&mut again)[..7], [4, 6, 6, 6, 6, 6, 6]);
    }

    #[test]
    fn a_tev_that_is_started_when_all_is_at_rest_is_shown_the_picture() {
        // Nobody listens there yet.
        let (listener, address) = listen();
        let place = listener.local_addr().unwrap();
        drop(listener);
        let mut tev = Tev::start(address, "a").unwrap();
        tev.show(Picture::black(100, 70));
        std::thread::sleep(Duration::from_millis(300));
        let listener = TcpListener::bind(place).unwrap();
        let (mut stream, _) = listener.accept().unwrap();
        assert_eq!(operations(&mut stream)[..2], [4, 6]);
    }

    #[test]
    fn a_tev_that_takes_nothing_stops_nobody() {
        let (_listener, address) = listen();
        let mut tev = Tev::start(address, "a").unwrap();
        let began = Instant::now();
        for value in 0..20 {
            tev.show(Picture { width: 1024, height: 1024, pixels: vec![Vec3::splat(value as f32); 1 << 20] });
        }
        assert!(!tev.is_due());
        drop(tev);
        assert!(began.elapsed() < FAREWELL + Duration::from_secs(3), "{:?}", began.elapsed());
    }

    #[test]
    fn addresses_have_a_host_and_a_port() {
        for right in ["127.0.0.1:14158", "localhost:1", "[::1]:14158"] {
            assert!(right.parse::<TevAddress>().is_ok(), "{right}");
        }
        for wrong in ["", "localhost", ":14158", "host:", "host:0", "host:99999", "host:tev"] {
            assert!(wrong.parse::<TevAddress>().is_err(), "{wrong}");
        }
    }
}
