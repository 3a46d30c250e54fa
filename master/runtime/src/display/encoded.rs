//! Pictures as viewers get them: for screens, and encoded for browsers.

use std::sync::OnceLock;

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

/// How frames are shown.
#[derive(Clone, Debug, PartialEq)]
pub struct DisplaySettings {
    /// Which layer.
    pub layer: Layer,
    /// Exposure and curve.
    pub tone: Tone,
    /// Still pictures are shown denoised as soon as they can be.
    pub denoise: bool,
}

/// A frame on its way to viewers.
pub(super) struct Shown {
    pub(super) frame: Frame,
    /// The last input that it shows.
    pub(super) input: Option<InputStamp>,
    /// Its picture is what a denoiser made of the frame's.
    pub(super) is_denoised: bool,
}

/// Exposure and curve, on this processor or on another.
pub trait ToneMapper: Send {
    /// As [`Tone::develop`].
    fn tone_map(&mut self, tone: &Tone, picture: &Picture) -> Image8;
}

/// On this processor.
pub struct CpuToneMapper;

impl ToneMapper for CpuToneMapper {
    fn tone_map(&mut self, tone: &Tone, picture: &Picture) -> Image8 {
        tone.develop(picture)
    }
}

/// A frame, tone-mapped for screens; its encoding for browsers is made on demand.
#[derive(Debug)]
pub struct EncodedFrame {
    /// What viewers are sent with it.
    pub header: FrameHeader,
    /// For screens.
    pub image: Image8,
    /// As in [`Frame`]; `None` if the frame was shown with other settings before.
    pub since: Option<Moment>,
    message: OnceLock<Result<Vec<u8>, String>>,
}

/// What viewers are sent with a picture, JSON.
#[derive(Clone, Debug, Serialize)]
pub struct FrameHeader {
    /// Counts the pictures that were shown, from 1 on.
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
    /// It is a moving picture.
    pub moving: bool,
    /// As in [`Frame`].
    pub frames: u32,
    /// As in [`Frame`].
    pub known: f32,
    /// As in [`Frame`].
    pub finished: bool,
    /// What is shown.
    pub layer: &'static str,
    /// It has been denoised.
    pub denoised: bool,
    /// What the colours mean, if they are not the picture's own.
    pub legend: Option<Legend>,
    /// From where, and how large a still picture is.
    pub camera: Camera,
    /// The last input that the picture shows; `None` before the first.
    #[serde(rename = "beside")]
    pub input: Option<InputStamp>,
}

/// A still picture is sent without loss once it has had time to sharpen.
const LOSSLESS_FRAMES: u32 = 9;
/// Quality of JPEG, 1..=100, while something moves or of what an input leads to, and before a still picture is sent without loss.
const MOVING_QUALITY: u8 = 82;
const STILL_QUALITY: u8 = 92;

const PNG: &str = "image/png";
const JPEG: &str = "image/jpeg";

impl EncodedFrame {
    /// Tone-maps a frame, whose [`Frame::since`] it takes.
    pub(super) fn new(
        number: u64,
        shown: &mut Shown,
        settings: &DisplaySettings,
        tone_mapper: &mut dyn ToneMapper,
    ) -> Self {
        let Shown { frame, input, is_denoised } = shown;
        let (mut image, legend) = paint::paint(&settings.layer, &frame.picture, &settings.tone, tone_mapper);
        if settings.layer.marks {
            paint::marks(&mut image, &frame.marks);
        }
        let moving = frame.moving.is_some();
        let is_settled = !moving && frame.known == 1.0 && (frame.frames >= LOSSLESS_FRAMES || frame.finished);
        let lossless = is_settled || !paint::is_light(&frame.layer);
        let header = FrameHeader {
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
            layer: settings.layer.name,
            denoised: *is_denoised,
            legend,
            camera: frame.camera,
            input: *input,
        };
        Self { header, image, since: frame.since.take(), message: OnceLock::new() }
    }

    /// As browsers receive it: `header length u32 (little endian), header (JSON), file`. Made at the first call, which
    /// takes milliseconds.
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
            // Somebody waits to see what has come of a slider: sharper pictures follow.
            _ if self.header.moving || self.since.is_some() => encode_jpeg(&self.image, MOVING_QUALITY)?,
            _ => encode_jpeg(&self.image, STILL_QUALITY)?,
        };
        let header = serde_json::to_vec(&self.header)?;
        let mut message = (header.len() as u32).to_le_bytes().to_vec();
        message.extend(header);
        message.extend(bytes);
        Ok(message)
    }
}

/// A mix of lamps as viewers are sent it while a slider moves.
///
/// # Errors
/// As of [`EncodedFrame::message`].
pub fn encode_mix(image: &Image8) -> anyhow::Result<Vec<u8>> {
    encode_jpeg(image, MOVING_QUALITY)
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
