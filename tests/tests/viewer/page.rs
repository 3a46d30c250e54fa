//! The viewer's page in a window, as a person uses it: what is on the screen, and hands that drag.

use std::path::Path;
use std::time::{Duration, Instant};

use serde_json::Value;

use super::webdriver::{Driver, PATIENCE, Window};

/// The page.
pub struct Page(Window);

/// Between two looks at the page.
const BETWEEN_LOOKS: Duration = Duration::from_millis(40);
/// A picture that has stayed for so long is the last.
const QUIET: Duration = Duration::from_millis(300);

impl Page {
    /// Opens an address in a new window.
    pub fn open(driver: &Driver, [width, height]: [u32; 2], phone: bool, url: &str) -> Self {
        let window = driver.window(width, height, phone);
        window.go(url);
        Self(window)
    }

    /// The same, but the page hears nothing before `window.release()`.
    pub fn open_deaf(driver: &Driver, [width, height]: [u32; 2], url: &str) -> Self {
        let window = driver.window(width, height, false);
        window.before_all_else(
            "window.WebSocket = class extends WebSocket {
               set onmessage(hear) {
                 const kept = [];
                 let free = false;
                 super.onmessage = (e) => free ? hear(e) : kept.push(e);
                 window.release = () => { free = true; kept.forEach(hear); };
               }
             };",
        );
        window.go(url);
        Self(window)
    }

    /// The value of an expression.
    pub fn get(&self, expression: &str) -> Value {
        self.0.run(&format!("return {expression}"))
    }

    /// Changes the window's size, and how many pixels of the screen a point of it has.
    pub fn reshape(&self, size: [u32; 2], ratio: f64) {
        self.0.reshape(size, ratio);
    }

    /// Runs a script.
    pub fn run(&self, script: &str) {
        self.0.run(script);
    }

    /// Waits until an expression is true.
    pub fn until(&self, expression: &str) {
        let began = Instant::now();
        while self.get(&format!("!!({expression})")) != true {
            let now =
                "JSON.stringify({ ...window.igi?.header, curtain: document.getElementById('curtain')?.className })";
            assert!(began.elapsed() < PATIENCE, "it never becomes true: {expression}; {}", self.get(now));
            std::thread::sleep(BETWEEN_LOOKS);
        }
    }

    /// Waits for the last picture, and until no other follows.
    pub fn at_rest(&self) {
        loop {
            self.until("window.igi?.header?.finished && document.getElementById('curtain').className === 'up'");
            let last = self.number();
            std::thread::sleep(QUIET);
            if self.number() == last {
                return;
            }
        }
    }

    /// Does something, and waits for the last picture that it leads to.
    pub fn after(&self, what: impl FnOnce()) {
        let before = self.get("window.igi.header.revision");
        what();
        self.until(&format!("window.igi.header.revision > {before}"));
        self.at_rest();
    }

    fn number(&self) -> Value {
        self.get("window.igi.header.number")
    }

    /// All pixels of the picture, in brief.
    pub fn fingerprint(&self) -> Value {
        self.0.run(
            "const c = document.getElementById('picture'); const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
             let h = 2166136261; for (const b of d) h = Math.imul(h ^ b, 16777619); return h >>> 0;",
        )
    }

    /// The largest difference between what is on the screen and the PNG that can be saved, of 255.
    pub fn difference_to_png(&self) -> Value {
        self.0.run_and_wait(
            "const done = arguments[arguments.length - 1];
             (async () => {
               const png = await createImageBitmap(await (await fetch('/picture.png')).blob());
               const shown = document.getElementById('picture');
               if (png.width !== shown.width || png.height !== shown.height) return done(`${png.width}×${png.height}, not ${shown.width}×${shown.height}`);
               const other = new OffscreenCanvas(png.width, png.height).getContext('2d');
               other.drawImage(png, 0, 0);
               const a = other.getImageData(0, 0, png.width, png.height).data;
               const b = shown.getContext('2d').getImageData(0, 0, png.width, png.height).data;
               done(a.reduce((most, v, i) => Math.max(most, Math.abs(v - b[i])), 0));
             })().catch((error) => done(String(error)));",
        )
    }

    /// Where in the window a place of the picture is, 0..=1 from its top left corner.
    pub fn on_picture(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        pair(&self.0.run(&format!(
            "const c = document.getElementById('picture'), r = c.getBoundingClientRect();
             const s = Math.min(r.width / c.width, r.height / c.height);
             return [r.x + (r.width - c.width * s) / 2 + {x} * c.width * s, r.y + (r.height - c.height * s) / 2 + {y} * c.height * s];"
        )))
    }

    /// Where in the window the middle of an object is seen.
    pub fn place_of(&self, object: &str) -> [f64; 2] {
        let place = self.0.run_and_wait(&format!(
            "const done = arguments[arguments.length - 1];
             (async () => {{
               const {{ lens, apply, middle }} = await import('/assets/vector.js');
               const object = window.igi.scene.objects.find((o) => o.name === '{object}');
               const seen = lens(window.igi.header.camera).project(apply(object.place, middle(...object.box)));
               const c = document.getElementById('picture'), r = c.getBoundingClientRect();
               const s = Math.min(r.width / c.width, r.height / c.height);
               done([r.x + (r.width - c.width * s) / 2 + seen.x * c.width * s, r.y + (r.height - c.height * s) / 2 + seen.y * c.height * s]);
             }})().catch((error) => done(String(error)));"
        ));
        pair(&place)
    }

    /// Where the middle of an element is.
    pub fn middle_of(&self, selector: &str) -> [f64; 2] {
        pair(&self.0.run(&format!(
            "const r = document.querySelector('{selector}').getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2];"
        )))
    }

    /// Where an object stands, in the 32 bits that the master keeps of it.
    pub fn translation(&self, object: &str) -> Value {
        let place = format!("window.igi.scene.objects.find((o) => o.name === '{object}').place");
        self.get(&format!("{place}.translation.map(Math.fround)"))
    }

    /// Presses, moves by so many pixels, lets go; `pointer` is `mouse` or `touch`.
    pub fn drag(&self, pointer: &str, [x, y]: [f64; 2], [dx, dy]: [f64; 2]) {
        let step = |i: u32| [x + dx * f64::from(i) / 8.0, y + dy * f64::from(i) / 8.0];
        self.0.drag(pointer, &(0..=8).map(step).collect::<Vec<_>>());
    }

    /// Clicks.
    pub fn click(&self, place: [f64; 2]) {
        self.0.drag("mouse", &[place]);
    }

    /// The pixels of the screen that the page has for the picture.
    pub fn screen(&self) -> Value {
        self.get("['width', 'height'].map((side) => Math.round(document.getElementById('stage').getBoundingClientRect()[side] * devicePixelRatio))")
    }

    /// Turns the wheel over a place by so many pixels.
    pub fn wheel(&self, place: [f64; 2], by: i64) {
        self.0.wheel(place, by);
    }

    /// Strikes the last key while the others are held.
    pub fn keys(&self, keys: &[&str]) {
        self.0.keys(keys);
    }

    /// Moves the mouse there.
    pub fn hover(&self, place: [f64; 2]) {
        self.0.hover(place);
    }

    /// What becomes of a promise.
    pub fn run_and_wait(&self, promise: &str) -> Value {
        let script = format!(
            "const done = arguments[arguments.length - 1]; ({promise}).then(done, (error) => done(String(error)));"
        );
        self.0.run_and_wait(&script)
    }

    /// Whether the browser has found nothing wrong.
    pub fn assert_content(&self) {
        assert_eq!(self.0.complaints(), Vec::<String>::new());
    }

    /// What can be seen, into the folder IGI_SCREENSHOTS, if there is one.
    pub fn photograph(&self, name: &str) {
        let Some(folder) = std::env::var_os("IGI_SCREENSHOTS") else { return };
        std::fs::write(Path::new(&folder).join(format!("{name}.png")), self.0.photograph())
            .expect("the folder can be written to");
    }
}

fn pair(value: &Value) -> [f64; 2] {
    [0, 1].map(|i| value[i].as_f64().unwrap_or_else(|| panic!("no place: {value}")))
}
