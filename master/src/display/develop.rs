//! The darkroom: a thread that develops pictures, the newest first, each once for all viewers.

use std::sync::{Arc, Condvar, Mutex, OnceLock, PoisonError};

use anyhow::Context;
use frame::live::{Frame, Moment};
use frame::tone::{Image8, Tone};
use frame::{Layer, Picture};
use jpeg_encoder::{ColorType, Encoder, SamplingFactor};
use scenes::Camera;
use serde::Serialize;

use super::message::InputStamp;
use super::paint::{self, Legend};
use crate::files::encode_png;

/// A picture that has been developed.
#[derive(Debug)]
pub struct Print {
    /// What viewers are told beside it.
    pub header: Header,
    /// For screens.
    pub image: Image8,
    /// As in [`Frame`]; nothing if the frame has been developed before.
    pub since: Option<Moment>,
    message: OnceLock<Result<Vec<u8>, String>>,
}

/// What viewers are told beside a picture.
#[derive(Clone, Debug, Serialize)]
pub struct Header {
    /// [`Frame::number`], or one more for each time that a frame is developed otherwise.
    pub number: u64,
    /// As in [`Frame`].
    pub revision: u64,
    /// Revision of the world.
    pub world: u32,
    /// Of the file that browsers receive.
    pub kind: &'static str,
    /// Pixels drawn; fewer than the camera's while something moves.
    pub width: u32,
    /// Pixels drawn.
    pub height: u32,
    /// Something moves.
    pub moving: bool,
    /// As in [`Frame`].
    pub frames: u32,
    /// As in [`Frame`].
    pub known: f32,
    /// As in [`Frame`].
    pub finished: bool,
    /// What is shown.
    pub layer: &'static str,
    /// What the colours mean, if they are not the picture's own.
    pub legend: Option<Legend>,
    /// From where.
    pub camera: Camera,
    /// The last input that the picture shows; `None` before the first.
    #[serde(rename = "beside")]
    pub input: Option<InputStamp>,
}

impl Print {
    /// As browsers receive it: `header length u32 (little endian), header (JSON), file`. Made when it is first asked for,
    /// which takes milliseconds.
    ///
    /// # Errors
    /// In words: the picture cannot be encoded.
    pub fn message(&self) -> Result<&[u8], &str> {
        let message = self.message.get_or_init(|| self.encode().map_err(|error| format!("{error:#}")));
        message.as_deref().map_err(String::as_str)
    }

    fn encode(&self) -> anyhow::Result<Vec<u8>> {
        let bytes = match self.header.kind {
            PNG => encode_png(&self.image)?,
            _ => encode_jpeg(&self.image, if self.header.moving { MOVING_QUALITY } else { STILL_QUALITY })?,
        };
        let header = serde_json::to_vec(&self.header)?;
        let mut message = (header.len() as u32).to_le_bytes().to_vec();
        message.extend(header);
        message.extend(bytes);
        Ok(message)
    }
}

/// What viewers see of a frame, that is not the frame's.
#[derive(Clone, Debug, PartialEq)]
pub struct Manner {
    /// Which layer.
    pub layer: Layer,
    /// Exposure and curve.
    pub tone: Tone,
}

/// Exposure and curve, on this processor or on another.
pub trait Developer: Send {
    /// As [`Tone::develop`].
    fn develop(&mut self, tone: &Tone, picture: &Picture) -> Image8;
}

/// On this processor.
pub struct Here;

impl Developer for Here {
    fn develop(&mut self, tone: &Tone, picture: &Picture) -> Image8 {
        tone.develop(picture)
    }
}

/// Hands frames to the thread. Dropped, it ends the thread.
pub struct Darkroom {
    tray: Arc<Tray>,
}

#[derive(Default)]
struct Tray {
    waiting: Mutex<Waiting>,
    news: Condvar,
}

#[derive(Default)]
struct Waiting {
    frame: Option<(Frame, Option<InputStamp>)>,
    manner: Option<Manner>,
    closed: bool,
}

impl Darkroom {
    /// Starts the thread; `out` is called on it with every picture.
    ///
    /// # Errors
    /// The system has no more threads.
    pub fn start(
        manner: Manner,
        mut developer: Box<dyn Developer>,
        out: impl Fn(Print) + Send + 'static,
    ) -> std::io::Result<Self> {
        let tray = Arc::new(Tray::default());
        let darkroom = Self { tray: Arc::clone(&tray) };
        std::thread::Builder::new()
            .name("darkroom".into())
            .spawn(move || work(&tray, manner, &mut *developer, &out))?;
        Ok(darkroom)
    }

    /// A new frame, and the last input that it shows; one that is still waiting is never developed.
    pub fn frame(&self, mut frame: Frame, input: Option<InputStamp>) {
        self.put(|waiting| {
            let unseen = waiting.frame.take().and_then(|(unseen, _)| unseen.since);
            frame.since = unseen.or(frame.since);
            waiting.frame = Some((frame, input));
        });
    }

    /// The last frame, and all that follow, in another manner.
    pub fn manner(&self, manner: Manner) {
        self.put(|waiting| waiting.manner = Some(manner));
    }

    fn put(&self, put: impl FnOnce(&mut Waiting)) {
        put(&mut self.tray.waiting.lock().unwrap_or_else(PoisonError::into_inner));
        self.tray.news.notify_one();
    }
}

impl Drop for Darkroom {
    fn drop(&mut self) {
        self.put(|waiting| waiting.closed = true);
    }
}

fn work(tray: &Tray, mut manner: Manner, developer: &mut dyn Developer, out: &impl Fn(Print)) {
    let mut last: Option<(Frame, Option<InputStamp>)> = None;
    let mut number = 0;
    loop {
        let waiting = tray.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        let is_idle = |waiting: &mut Waiting| !waiting.closed && waiting.frame.is_none() && waiting.manner.is_none();
        let mut waiting = tray.news.wait_while(waiting, is_idle).unwrap_or_else(PoisonError::into_inner);
        if waiting.closed {
            return;
        }
        let Waiting { frame, manner: other, .. } = std::mem::take(&mut *waiting);
        drop(waiting);
        manner = other.unwrap_or(manner);
        last = frame.or(last);
        let Some((frame, input)) = last.as_mut().filter(|(frame, _)| frame.layer.plane == manner.layer.plane) else {
            continue;
        };
        number += 1;
        out(print(number, frame, *input, &manner, developer));
    }
}

/// A still picture is sent without loss once it has had time to sharpen.
const LOSSLESS_FRAMES: u32 = 9;
/// Quality of JPEG, 1..=100, while something moves, and before a still picture is sent without loss.
const MOVING_QUALITY: u8 = 82;
const STILL_QUALITY: u8 = 92;

const PNG: &str = "image/png";
const JPEG: &str = "image/jpeg";

fn print(
    number: u64,
    frame: &mut Frame,
    input: Option<InputStamp>,
    manner: &Manner,
    developer: &mut dyn Developer,
) -> Print {
    let (mut image, legend) = paint::paint(&manner.layer, &frame.picture, &manner.tone, developer);
    if manner.layer.marks {
        paint::marks(&mut image, &frame.marks);
    }
    let moving = frame.moving.is_some();
    let is_settled = !moving && frame.known == 1.0 && (frame.frames >= LOSSLESS_FRAMES || frame.finished);
    let lossless = is_settled || !paint::is_light(&frame.layer);
    let header = Header {
        number,
        revision: frame.revision,
        world: frame.world.revision,
        kind: if lossless { PNG } else { JPEG },
        width: image.width,
        height: image.height,
        moving,
        frames: frame.frames,
        known: frame.known,
        finished: frame.finished,
        layer: manner.layer.name,
        legend,
        camera: frame.camera,
        input,
    };
    Print { header, image, since: frame.since.take(), message: OnceLock::new() }
}

fn encode_jpeg(image: &Image8, quality: u8) -> anyhow::Result<Vec<u8>> {
    let too_large = "the picture is too large for JPEG";
    let (width, height) =
        (u16::try_from(image.width).context(too_large)?, u16::try_from(image.height).context(too_large)?);
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, quality);
    let sampling = if quality >= 90 { SamplingFactor::R_4_4_4 } else { SamplingFactor::R_4_2_0 };
    encoder.set_sampling_factor(sampling);
    encoder.encode(image.bytes(), width, height, ColorType::Rgb).context("the picture cannot be encoded as JPEG")?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;
    use std::time::Duration;

    use glam::Vec3;
    use protocol::question::WorldState;
    use serde_json::Value;

    use super::*;

    fn frame(frames: u32, moving: bool) -> Frame {
        let picture = Picture::from_fn(16, 8, |x, y| Vec3::new(x as f32 / 16.0, y as f32 / 8.0, 0.2));
        let (camera, world) = (Camera { width: 16, height: 8, ..Camera::default() }, WorldState::default());
        let (layer, marks, known, finished) = (Layer::FINAL, vec![], 1.0, false);
        let moving = moving.then_some(frame::front_end::Effort(1.0));
        let (number, revision, since, ended) = (1, 2, Some(Moment(7)), true);
        Frame {
            number,
            revision,
            world,
            camera,
            layer,
            marks,
            since,
            picture: picture.into(),
            moving,
            ended,
            frames,
            known,
            finished,
        }
    }

    fn split(print: &Print) -> (Value, image::RgbImage) {
        let message = print.message().unwrap();
        let length = u32::from_le_bytes(message[..4].try_into().unwrap()) as usize;
        let header = serde_json::from_slice(&message[4..4 + length]).unwrap();
        (header, image::load_from_memory(&message[4 + length..]).unwrap().to_rgb8())
    }

    #[test]
    fn moving_pictures_are_jpeg_and_settled_ones_without_loss() {
        let (sender, pictures) = channel();
        let manner = Manner { layer: Layer::FINAL, tone: Tone::PLAIN };
        let darkroom = Darkroom::start(manner.clone(), Box::new(Here), move |print| drop(sender.send(print))).unwrap();
        let show = |frame: Frame| {
            darkroom.frame(frame, None);
            pictures.recv_timeout(Duration::from_secs(60)).unwrap()
        };
        let exact = manner.tone.develop(&frame(1, true).picture);
        let (header, image) = split(&show(frame(1, true)));
        assert_eq!((header["kind"].as_str(), header["revision"].as_u64()), (Some("image/jpeg"), Some(2)));
        let worst = image.as_raw().iter().zip(exact.bytes()).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(worst.unwrap() < 60, "{worst:?}");
        let settled = show(frame(9, false));
        assert_eq!(settled.since, Some(Moment(7)));
        let (header, image) = split(&settled);
        assert_eq!((header["kind"].as_str(), image.as_raw().as_slice()), (Some("image/png"), exact.bytes()));

        // Another exposure: the same frame again, as another picture.
        let brighter = Tone { exposure: frame::tone::Exposure::Fixed(1.0), ..manner.tone };
        darkroom.manner(Manner { tone: brighter, ..manner });
        let again = pictures.recv_timeout(Duration::from_secs(60)).unwrap();
        assert_eq!((again.header.number, again.since), (3, None), "nobody has waited for it");
        assert_eq!(split(&again).1.as_raw().as_slice(), brighter.develop(&frame(9, false).picture).bytes());
    }
}
