//! The native window as a person uses it: `igi-master view` on a virtual screen, driven by a mouse and a keyboard.
//!
//! The first test needs Xvfb and xdotool, and runs if IGI_TEST_WINDOW=1:
//! `IGI_TEST_WINDOW=1 cargo test -p master --features window --test window`; IGI_KEEP_SCREENS=DIR keeps what it saw.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde_json::Value;

const SPHERES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell_spheres");
const PATIENCE: Duration = Duration::from_secs(40);

/// A process; killed when dropped.
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A virtual screen, whose memory is a file.
struct Screen {
    _server: Process,
    display: String,
    memory: PathBuf,
}

/// What is on the screen.
struct Seen {
    width: usize,
    pixels: Vec<[u8; 3]>,
}

impl Screen {
    fn start(folder: &Path) -> Self {
        let mut command = Command::new("Xvfb");
        command.args(["-displayfd", "1", "-screen", "0", "1280x800x24", "-nolisten", "tcp", "-fbdir"]).arg(folder);
        let mut server = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("Xvfb is installed");
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut number).unwrap();
        let display = format!(":{}", number.trim());
        Self { _server: Process(server), display, memory: folder.join("Xvfb_screen0") }
    }

    /// What is on it: a file in XWD format, version 7, 32 bits a pixel, blue first.
    fn look(&self) -> Seen {
        let bytes = fs::read(&self.memory).expect("the screen's memory");
        let word = |index: usize| u32::from_be_bytes(bytes[4 * index..][..4].try_into().unwrap()) as usize;
        let (header, width, height, bits, line, colours) = (word(0), word(4), word(5), word(11), word(12), word(19));
        assert_eq!((word(1), bits), (7, 32));
        let data = &bytes[header + 12 * colours..];
        let pixel = |x: usize, y: usize| {
            let at = y * line + 4 * x;
            [data[at + 2], data[at + 1], data[at]]
        };
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect();
        Seen { width, pixels }
    }

    /// Moves the mouse, presses its buttons and keys, as xdotool words them.
    fn xdotool(&self, words: &[&str]) {
        let status = Command::new("xdotool").args(words).env("DISPLAY", &self.display).status();
        assert!(status.expect("xdotool is installed").success(), "{words:?}");
    }

    fn keep(&self, name: &str) {
        let Some(folder) = std::env::var_os("IGI_KEEP_SCREENS") else { return };
        let Seen { width, pixels } = self.look();
        let height = pixels.len() / width;
        let path = Path::new(&folder).join(name);
        image::save_buffer(path, pixels.as_flattened(), width as u32, height as u32, image::ColorType::Rgb8).unwrap();
    }
}

/// Where the picture is looked at: away from the panel and from words over the picture, points of the screen.
const SPOTS: [[usize; 2]; 48] = {
    let mut spots = [[0; 2]; 48];
    let mut index = 0;
    while index < 48 {
        spots[index] = [100 + 90 * (index % 8), 80 + 100 * (index / 8)];
        index += 1;
    }
    spots
};

impl Seen {
    /// Mean over a small block: the picture is smoothed differently here and there.
    fn at(&self, [x, y]: [usize; 2]) -> [f32; 3] {
        let block = (0..49).map(|i| self.pixels[(y + i / 7 - 3) * self.width + x + i % 7 - 3]);
        block.fold([0.0; 3], |sum, pixel| std::array::from_fn(|c| sum[c] + f32::from(pixel[c]) / 49.0))
    }

    fn spots(&self) -> Vec<[f32; 3]> {
        SPOTS.iter().map(|spot| self.at(*spot)).collect()
    }
}

fn difference(a: &[[f32; 3]], b: &[[f32; 3]]) -> f32 {
    let channels = a.as_flattened().iter().zip(b.as_flattened());
    channels.map(|(a, b)| (a - b).abs()).sum::<f32>() / (3 * a.len()) as f32
}

fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) {
    let began = Instant::now();
    while !is_so() {
        assert!(began.elapsed() < PATIENCE, "waited in vain until {what}");
        std::thread::sleep(Duration::from_millis(100));
    }
}

fn master(folder: &Path, scene: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_igi-master"));
    for variable in ["IGI_WORKERS", "IGI_LISTEN", "IGI_TOKEN", "IGI_HTTP", "RUST_LOG", "DISPLAY", "WAYLAND_DISPLAY"] {
        command.env_remove(variable);
    }
    command.arg("view").arg(scene).args(["--size", "356x304", "--http", "127.0.0.1:0", "--json"]).current_dir(folder);
    // What it keeps of its user.
    command.env("XDG_STATE_HOME", folder);
    command
}

/// A window on a screen of its own.
struct Opened {
    process: Process,
    screen: Screen,
    address: String,
    session: PathBuf,
}

impl Opened {
    fn start(folder: &Path, scene: &Path) -> Self {
        let screen = Screen::start(folder);
        let session = folder.join("session");
        let mut command = master(folder, scene);
        // Where there is Vulkan, even by a program, shaders are in the way of the picture as well.
        command
            .args(["--gpu", "software", "--record"])
            .arg(&session)
            .env("DISPLAY", &screen.display)
            .stdout(Stdio::piped());
        let mut process = Process(command.spawn().unwrap());
        let mut lines = BufReader::new(process.0.stdout.take().unwrap()).lines();
        let address = lines.by_ref().map_while(Result::ok).find_map(|line| {
            let event: Value = serde_json::from_str(&line).ok()?;
            (event["event"] == "serving").then(|| event["address"].as_str().unwrap().to_string())
        });
        let address = address.expect("it says where it serves");
        std::thread::spawn(move || lines.map_while(Result::ok).for_each(drop));
        let opened = Self { process, screen, address, session };
        // The picture is that which browsers are given, beside a panel 290 points wide.
        wait_until("the window shows the picture", || {
            let seen = opened.screen.look().spots();
            let is_bright = seen.as_flattened().iter().sum::<f32>() > 30.0 * (3 * seen.len()) as f32;
            is_bright && saved(&opened.address, VIEW).is_some_and(|saved| difference(&saved, &seen) < 9.0)
        });
        // It has time to sharpen, so that noise is no difference.
        std::thread::sleep(Duration::from_secs(5));
        // There is no window manager that would do it.
        opened.screen.xdotool(&["search", "--sync", "--name", "igi", "windowfocus", "--sync"]);
        opened
    }

    fn recorded(&self, kind: &str) -> Vec<Value> {
        recorded(&self.session, kind)
    }

    /// Presses at a place, moves on in steps, lets go.
    fn drag(&self, [x, y]: [usize; 2], [dx, dy]: [i32; 2]) {
        self.screen.xdotool(&["mousemove", &x.to_string(), &y.to_string(), "mousedown", "1"]);
        for _ in 0..8 {
            self.screen.xdotool(&["mousemove_relative", "--", &(dx / 8).to_string(), &(dy / 8).to_string()]);
            std::thread::sleep(Duration::from_millis(30));
        }
        self.screen.xdotool(&["mouseup", "1"]);
    }

    fn click(&self, [x, y]: [usize; 2]) {
        self.screen.xdotool(&["mousemove", &x.to_string(), &y.to_string(), "click", "1"]);
    }

    /// Closes it by a key.
    fn close(mut self) {
        self.screen.xdotool(&["key", "ctrl+q"]);
        let mut status = None;
        wait_until("the program ends", || {
            status = self.process.0.try_wait().unwrap();
            status.is_some()
        });
        assert_eq!(status.unwrap().code(), Some(0));
    }
}

/// The button by which the window gives the controls away.
const HAND_OVER: [usize; 2] = [238, 29];
/// Size of the window's picture.
const VIEW: [usize; 2] = [890, 760];
/// Width of the panel beside it.
const PANEL: usize = 290;

/// One window at a time: software that draws two, and renders for both, is too slow for hands that wait for nothing.
static ONE: Mutex<()> = Mutex::new(());

/// Whether the tests of windows are to run.
fn is_wanted() -> bool {
    let wanted = std::env::var_os("IGI_TEST_WINDOW").is_some();
    if !wanted {
        eprintln!("skipped: IGI_TEST_WINDOW=1 runs it, where Xvfb and xdotool are installed");
    }
    wanted
}

/// The picture that browsers are given, at the same spots of a view this large.
fn saved(address: &str, view: [usize; 2]) -> Option<Vec<[f32; 3]>> {
    let mut stream = TcpStream::connect(address).ok()?;
    write!(stream, "GET /picture.png HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n").ok()?;
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).ok()?;
    let body = answer.windows(4).position(|end| end == b"\r\n\r\n")? + 4;
    let picture = image::load_from_memory(&answer[body..]).ok()?.to_rgb8();
    let scale = [picture.width() as f32 / view[0] as f32, picture.height() as f32 / view[1] as f32];
    let at = |[x, y]: [usize; 2]| {
        let [x, y] = [x as f32 * scale[0], y as f32 * scale[1]].map(|v| v as u32);
        picture.get_pixel(x, y).0.map(f32::from)
    };
    Some(SPOTS.map(at).to_vec())
}

/// What was recorded of people's doings, of one kind.
fn recorded(path: &Path, kind: &str) -> Vec<Value> {
    let text = fs::read_to_string(path).unwrap_or_default();
    let lines = text.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    lines.filter_map(|line| line.get(kind).cloned()).collect()
}

#[test]
fn a_window_shows_the_picture_and_obeys_mouse_and_keys() {
    if !is_wanted() {
        return;
    }
    let _alone = ONE.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    let window = Opened::start(folder.path(), Path::new(SPHERES));
    let screen = &window.screen;
    screen.keep("picture.png");
    let first = screen.look();

    // A drag turns the camera.
    screen.xdotool(&["mousemove", "300", "300", "mousedown", "1"]);
    for _ in 0..12 {
        screen.xdotool(&["mousemove_relative", "--", "6", "3"]);
        std::thread::sleep(Duration::from_millis(30));
    }
    screen.xdotool(&["mouseup", "1"]);
    let seen = || screen.look().spots();
    wait_until("the camera turns", || {
        let looks = window.recorded("look");
        looks.len() > 1 && looks.first().map(|look| &look["origin"]) != looks.last().map(|look| &look["origin"])
    });
    wait_until("that is seen", || difference(&first.spots(), &seen()) > 12.0);
    screen.keep("turned.png");

    // R goes back, and what is drawn is as before.
    screen.xdotool(&["key", "r"]);
    wait_until("the first view is back", || difference(&first.spots(), &seen()) < 6.0);

    // A click selects; its middle is dragged; the object moves, and Ctrl Z takes that back.
    screen.xdotool(&["mousemove", "500", "250", "click", "1"]);
    let amber = |seen: &Seen| {
        let ambers = seen.pixels.iter().enumerate().filter(|(i, p)| i % seen.width < VIEW[0] && **p == [255, 180, 84]);
        ambers.count()
    };
    wait_until("the selection's box is drawn", || amber(&screen.look()) > 200);
    screen.keep("selected.png");
    // The box of this object is the whole room: its middle is the picture's, nearly.
    let middle = middle_of_ring(&screen.look(), VIEW);
    screen.xdotool(&["mousemove", &middle[0].to_string(), &middle[1].to_string(), "mousedown", "1"]);
    for _ in 0..8 {
        screen.xdotool(&["mousemove_relative", "--", "5", "0"]);
        std::thread::sleep(Duration::from_millis(30));
    }
    screen.xdotool(&["mouseup", "1"]);
    wait_until("the object moves", || window.recorded("edit").len() > 1);
    let edits = window.recorded("edit").len();
    wait_until("that is seen", || difference(&first.spots(), &seen()) > 6.0);
    screen.keep("moved.png");
    screen.xdotool(&["key", "ctrl+z"]);
    wait_until("the move is taken back", || window.recorded("edit").len() > edits);
    screen.xdotool(&["key", "Escape"]);
    wait_until("all is as before", || difference(&first.spots(), &seen()) < 6.0);

    // Brighter by keys; without panel, the picture has the whole window.
    screen.xdotool(&["key", "bracketright", "key", "bracketright", "key", "bracketright"]);
    let mean = |seen: &Seen| seen.spots().as_flattened().iter().sum::<f32>();
    wait_until("the picture is brighter", || mean(&screen.look()) > 1.08 * mean(&first));
    // The picture keeps its size and comes to the middle: its right edge lies where the panel was.
    let shift = PANEL / 2;
    let edge = screen.look().at([VIEW[0] - 15, 380]);
    let is_shifted = || difference(&[edge], &[screen.look().at([VIEW[0] - 15 + shift, 380])]) < 12.0;
    assert!(!is_shifted(), "the panel is there");
    screen.xdotool(&["key", "p"]);
    wait_until("the panel is gone", is_shifted);
    screen.keep("wide.png");

    window.close();
}

/// A room with a box that moves by itself, and a lamp without surface.
fn moving_room(folder: &Path) {
    let obj = "mtllib scene.mtl
o room
v -2 0 -2\nv 2 0 -2\nv 2 3 -2\nv -2 3 -2\nv -2 0 3\nv 2 0 3\nv 2 3 3\nv -2 3 3
usemtl white
f 1 5 6 2\nf 1 2 3 4\nf 4 3 7 8\nf 1 4 8 5\nf 2 6 7 3
v -1.5 0.01 -1.5\nv -1.2 0.01 -1.5\nv -1.2 0.01 -1.2\nv -1.5 0.01 -1.2
v -1.5 0.7 -1.5\nv -1.2 0.7 -1.5\nv -1.2 0.7 -1.2\nv -1.5 0.7 -1.2
usemtl red
f 9 10 11 12\nf 13 16 15 14\nf 9 13 14 10\nf 10 14 15 11\nf 11 15 16 12\nf 12 16 13 9
o box
v -0.3 0.01 -0.3\nv 0.3 0.01 -0.3\nv 0.3 0.01 0.3\nv -0.3 0.01 0.3
v -0.3 0.8 -0.3\nv 0.3 0.8 -0.3\nv 0.3 0.8 0.3\nv -0.3 0.8 0.3
usemtl blue
f 17 18 19 20\nf 21 24 23 22\nf 17 21 22 18\nf 18 22 23 19\nf 19 23 24 20\nf 20 24 21 17
";
    let mtl = "newmtl white\nillum 1\nKd 0.75 0.75 0.75\nnewmtl red\nillum 1\nKd 0.7 0.1 0.1\nnewmtl blue\nillum 1\nKd 0.2 0.3 0.7\n";
    let json = r#"{ "name": "room", "obj": "scene.obj",
        "camera": { "origin": [0, 1.5, 5.6], "target": [0, 1.3, 0], "up": [0, 1, 0], "fov_y_deg": 45, "width": 320, "height": 240 },
        "lights": [{ "type": "point", "position": [0, 2.3, 0.5], "intensity": [2.6, 2.4, 2.1] }], "background": [0.2, 0.2, 0.2],
        "animation": [{ "object": "box", "keyframes": [{ "t": 0 }, { "t": 4, "translate": [1.2, 0, 0] }] }] }"#;
    for (name, text) in [("scene.obj", obj), ("scene.mtl", mtl), ("scene.json", json)] {
        fs::write(folder.join(name), text).unwrap();
    }
}

/// A viewer that is no window: a WebSocket by hand.
struct Other(TcpStream);

impl Other {
    fn join(address: &str) -> Self {
        let mut stream = TcpStream::connect(address).unwrap();
        let key = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13";
        write!(
            stream,
            "GET /socket HTTP/1.1\r\nHost: {address}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n{key}\r\n\r\n"
        )
        .unwrap();
        let mut read = stream.try_clone().unwrap();
        // It looks at nothing, but nobody may wait for it.
        std::thread::spawn(move || std::io::copy(&mut read, &mut std::io::sink()));
        std::thread::sleep(Duration::from_millis(300));
        Self(stream)
    }

    /// A short text, masked by zeros.
    fn say(&mut self, words: &str) {
        let head = [0x81, 0x80 | words.len() as u8, 0, 0, 0, 0];
        self.0.write_all(&[&head[..], words.as_bytes()].concat()).unwrap();
    }

    fn look_from(&mut self, x: f64) {
        let rest = r#""target":[0,1.3,0],"up":[0,1,0],"fov_y_deg":45"#;
        self.say(&format!(r#"{{"say":"look","origin":[{x},1.5,5.6],{rest}}}"#));
    }
}

#[test]
fn pieces_lamps_time_views_and_controls_are_in_the_windows_hands() {
    if !is_wanted() {
        return;
    }
    let _alone = ONE.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    moving_room(folder.path());
    let window = Opened::start(folder.path(), folder.path());
    let screen = &window.screen;
    screen.keep("room.png");

    // A drag that begins on a lamp's marker turns the view as anywhere else; a click selects the lamp, which is then
    // taken by its handle, where the camera sees it.
    let looks = window.recorded("look").len();
    window.drag([445, 202], [64, 24]);
    wait_until("the camera turns", || window.recorded("look").len() > looks);
    screen.xdotool(&["key", "r"]);
    std::thread::sleep(Duration::from_secs(2));
    window.click([445, 202]);
    std::thread::sleep(Duration::from_millis(600));
    window.drag([445, 202], [64, 24]);
    wait_until("the lamp moves", || window.recorded("edit").iter().any(|edit| edit[0]["Light"].is_object()));
    screen.keep("lamp.png");
    screen.xdotool(&["key", "ctrl+z", "key", "Escape"]);

    // A click takes the red block out of the room that it is a piece of; with Shift, the room itself.
    let red = |seen: &Seen| {
        let spots = (0..VIEW[1]).flat_map(|y| (0..VIEW[0]).map(move |x| [x, y]));
        let is_red = |[x, y]: &[usize; 2]| {
            let [red, green, blue] = seen.pixels[y * seen.width + x].map(i32::from);
            red > 60 && red > 2 * green && red > 2 * blue
        };
        let all: Vec<_> = spots.filter(is_red).collect();
        assert!(all.len() > 100, "{} red points", all.len());
        all[all.len() / 2]
    };
    let block = red(&screen.look());
    window.click(block);
    std::thread::sleep(Duration::from_millis(600));
    screen.keep("piece.png");
    let middle = middle_of_ring(&screen.look(), VIEW);
    window.drag(middle, [120, 0]);
    wait_until("the block moves", || window.recorded("edit").iter().any(|edit| edit[0]["PieceTransform"].is_object()));
    std::thread::sleep(Duration::from_secs(2));
    screen.keep("piece_moved.png");
    let now = red(&screen.look());
    assert!(now[0] > block[0] + 80, "{block:?} {now:?}");
    // Keys move it on.
    let edits = window.recorded("edit").len();
    screen.xdotool(&["key", "alt+Right"]);
    wait_until("the block goes a step", || window.recorded("edit").len() > edits);
    screen.xdotool(&["key", "ctrl+z"]);
    screen.xdotool(&["keydown", "Shift_L"]);
    window.click([700, 150]);
    screen.xdotool(&["keyup", "Shift_L"]);
    std::thread::sleep(Duration::from_millis(600));
    screen.keep("whole.png");
    screen.xdotool(&["key", "ctrl+z", "key", "Escape"]);

    // Time goes by, by the slider and by itself.
    let times = || window.recorded("edit").iter().filter_map(|edit| edit[0]["Time"].as_f64()).collect::<Vec<_>>();
    screen.keep("nothing_selected.png");
    window.drag([953, 279], [48, 0]);
    wait_until("time is another", || times().last().is_some_and(|time| *time > 0.5));
    screen.keep("time.png");
    let before = times().len();
    window.click([918, 279]);
    wait_until("time goes by itself", || times().len() > before + 3);
    window.click([918, 279]);

    // A view is saved, left, and gone back to; and it is kept.
    let looks = || window.recorded("look").last().map(|look| look["origin"].clone());
    window.click([946, 329]);
    let kept = || std::fs::read_dir(folder.path().join("igi/sessions")).into_iter().flatten().flatten();
    wait_until("the view is kept", || kept().any(|slot| slot.path().join("session.json").is_file()));
    let home = looks();
    screen.xdotool(&["keydown", "d", "sleep", "0.4", "keyup", "d"]);
    wait_until("somebody walks", || looks() != home);
    window.click([908, 329]);
    wait_until("the view is gone back to", || looks().is_some_and(|origin| origin[0] == 0.0));
    screen.keep("views.png");

    // Pictures are saved where the program was started; keys are explained.
    window.click([919, 436]);
    wait_until("a picture is saved", || image::open(folder.path().join("room-1.png")).is_ok());
    screen.xdotool(&["key", "F1"]);
    std::thread::sleep(Duration::from_millis(600));
    screen.keep("keys.png");
    screen.xdotool(&["key", "F1"]);

    // Somebody else asks for the controls, and is given them.
    let mut other = Other::join(&window.address);
    let is_obeyed = |from: f64| looks().is_some_and(|origin| origin[0] == from);
    other.look_from(0.75);
    other.say(r#"{"say":"take"}"#);
    std::thread::sleep(Duration::from_millis(800));
    screen.keep("asked.png");
    assert!(!is_obeyed(0.75), "somebody without the controls is obeyed");
    window.click(HAND_OVER);
    wait_until("somebody else has the controls", || {
        other.look_from(0.25);
        is_obeyed(0.25)
    });
    std::thread::sleep(Duration::from_millis(800));
    screen.keep("handed_over.png");
    let before = window.recorded("look").len();
    window.drag([445, 420], [64, 24]);
    std::thread::sleep(Duration::from_millis(800));
    assert_eq!(window.recorded("look").len(), before, "the window goes on without the controls");

    window.close();
}

/// The middle of the ring around the selection's pivot: where a white disc with the ring's colour on both sides lies.
fn middle_of_ring(seen: &Seen, view: [usize; 2]) -> [usize; 2] {
    let is_disc = |x: usize, y: usize| seen.pixels[y * seen.width + x].iter().all(|channel| *channel > 205);
    let around = |x: usize, y: usize| (0..8).all(|i| is_disc(x + i % 3 - 1, y + i / 3 - 1));
    let is_arm = |x: usize, y: usize, colour: [u8; 3]| seen.pixels[y * seen.width + x] == colour;
    for y in 100..view[1] - 100 {
        for x in 100..view[0] - 100 {
            // The green arm goes up from it, the red one to the right.
            let up = (20..70).filter(|d| is_arm(x, y - d, [123, 216, 143])).count();
            if around(x, y) && up > 30 && (20..60).any(|d| is_arm(x + d, y, [255, 107, 107])) {
                return [x, y];
            }
        }
    }
    panic!("no grips are drawn");
}

#[test]
fn without_a_display_there_is_a_browser_and_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = master(folder.path(), Path::new(SPHERES));
    // No browser is to open while tests run.
    command.env("PATH", "").stdout(Stdio::null()).stderr(Stdio::piped());
    let mut process = Process(command.spawn().unwrap());
    let lines = BufReader::new(process.0.stderr.take().unwrap()).lines().map_while(Result::ok);
    let mut said = String::new();
    for line in lines {
        said += &line;
        if said.contains("no browser could be started") {
            break;
        }
    }
    assert!(said.contains("no window:") && said.contains("DISPLAY") && said.contains("http://127.0.0.1:"), "{said}");
    assert!(process.0.try_wait().unwrap().is_none(), "it goes on serving");
}
