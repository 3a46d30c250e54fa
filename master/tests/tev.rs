//! Pictures as tev receives them: a receiver that knows of the protocol what tev's README and sources say, and nothing
//! of our sender.

use std::io::{self, Read};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use frame::Picture;
use glam::Vec3;
use runtime::files::read_picture;

const CORNELL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell");

/// What a tev shows, and how it came there.
#[derive(Default)]
struct Shown {
    name: String,
    picture: Picture,
    created: u32,
    updated: u32,
}

/// The fields of a packet, in turn.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        let (taken, rest) = self.0.split_first_chunk().expect("the packet goes on");
        self.0 = rest;
        *taken
    }

    fn int(&mut self) -> i32 {
        i32::from_le_bytes(self.bytes())
    }

    fn text(&mut self) -> String {
        let end = self.0.iter().position(|byte| *byte == 0).expect("a text ends");
        let text = String::from_utf8(self.0[..end].to_vec()).expect("a text");
        self.0 = &self.0[end + 1..];
        text
    }

    fn channels(&mut self) {
        assert_eq!(self.int(), 3);
        assert_eq!([self.text(), self.text(), self.text()], ["R", "G", "B"]);
    }
}

impl Shown {
    /// Takes a packet without its length.
    fn take(&mut self, packet: &[u8]) {
        let mut fields = Fields(packet);
        let ([operation], [focus]) = (fields.bytes(), fields.bytes());
        let name = fields.text();
        match operation {
            // CreateImage
            4 => {
                assert_eq!(focus, u8::from(self.created == 0), "it comes to the front once");
                let (width, height) = (fields.int() as u32, fields.int() as u32);
                fields.channels();
                (self.name, self.picture, self.created) = (name, Picture::black(width, height), self.created + 1);
            }
            // UpdateImageV3
            6 => {
                assert_eq!((focus, &name), (0, &self.name));
                fields.channels();
                let [x, y, width, height] = [0; 4].map(|_| fields.int() as usize);
                let [offsets, strides] = [0; 2].map(|_| [0; 3].map(|_| i64::from_le_bytes(fields.bytes()) as usize));
                let data: Vec<f32> =
                    fields.0.chunks(4).map(|four| f32::from_le_bytes(four.try_into().unwrap())).collect();
                fields.0 = &[];
                let last = (0..3).map(|c| offsets[c] + (width * height - 1) * strides[c]).max().unwrap();
                assert_eq!(data.len(), last + 1);
                for pixel in 0..width * height {
                    let colour = Vec3::from_array([0, 1, 2].map(|c| data[offsets[c] + pixel * strides[c]]));
                    let at = (y + pixel / width) * self.picture.width as usize + x + pixel % width;
                    self.picture.pixels[at] = colour;
                }
                self.updated += 1;
            }
            other => panic!("operation {other}"),
        }
        assert!(fields.0.is_empty(), "nothing follows");
    }

    /// Everything that a sender says until it goes.
    fn watch(mut stream: TcpStream) -> Self {
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        let mut shown = Self::default();
        let mut length = [0; 4];
        while let Ok(()) = stream.read_exact(&mut length) {
            let mut packet = vec![0; u32::from_le_bytes(length) as usize - 4];
            stream.read_exact(&mut packet).expect("packets are whole");
            shown.take(&packet);
        }
        shown
    }
}

/// Draws with a tev at this address; how long it took.
fn render(folder: &Path, tev: &str, size: &str) -> io::Result<Duration> {
    let began = Instant::now();
    let mut command = Command::new(env!("CARGO_BIN_EXE_igi-master"));
    command.args(["render", CORNELL, "--size", size, "--frames", "3", "--quiet", "-o", "a.exr", "--tev", tev]);
    let status = command.args(["--workers", "embedded:1"]).current_dir(folder).status()?;
    assert!(status.success());
    Ok(began.elapsed())
}

#[test]
fn what_tev_shows_in_the_end_is_the_picture_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let tev = std::thread::spawn(move || Shown::watch(listener.accept().unwrap().0));
    render(folder.path(), &address, "100x70").unwrap();
    let shown = tev.join().unwrap();
    assert_eq!((shown.name.as_str(), shown.created), ("cornell", 1));
    assert!(shown.updated >= 4, "all four tiles came");
    assert_eq!(shown.picture, read_picture(&folder.path().join("a.exr")).unwrap());
}

#[test]
fn a_tev_that_is_not_there_or_does_not_listen_holds_nothing_up() {
    let folder = tempfile::tempdir().unwrap();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let deaf = listener.local_addr().unwrap().to_string();
    let nobody = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    for tev in [deaf, nobody] {
        let took = render(folder.path(), &tev, "96x72").unwrap();
        assert!(took < Duration::from_secs(20), "{took:?}");
    }
}
