//! The display thread: it tone-maps frames, the newest first, each once for all viewers.
//!
//! A still picture may come a second time, denoised, and late. From then on only denoised pictures of the same state are
//! shown, so that nothing flickers; whatever shows another state, or another layer, is shown at once, and what was denoised
//! before it never again.

use std::sync::{Arc, Condvar, Mutex, PoisonError};

use frame::live::Frame;

use super::encoded::{DisplaySettings, EncodedFrame, Shown, ToneMapper};
use super::message::InputStamp;

/// Hands frames to the thread. Dropped, it ends the thread.
pub struct DisplayThread {
    mailbox: Arc<Mailbox>,
}

#[derive(Default)]
struct Mailbox {
    contents: Mutex<Contents>,
    changed: Condvar,
}

#[derive(Default)]
struct Contents {
    frame: Option<Shown>,
    denoised: Option<Shown>,
    settings: Option<DisplaySettings>,
    closed: bool,
}

impl DisplayThread {
    /// Starts the thread; `out` is called on it with every picture.
    ///
    /// # Errors
    /// The system has no more threads.
    pub fn start(
        settings: DisplaySettings,
        mut tone_mapper: Box<dyn ToneMapper>,
        out: impl Fn(EncodedFrame) + Send + 'static,
    ) -> std::io::Result<Self> {
        let mailbox = Arc::new(Mailbox::default());
        let thread = Self { mailbox: Arc::clone(&mailbox) };
        std::thread::Builder::new()
            .name("display".into())
            .spawn(move || work(&mailbox, settings, &mut *tone_mapper, &out))?;
        Ok(thread)
    }

    /// Shows a new frame, and the last input that it shows; a frame that is still waiting is dropped.
    pub fn show(&self, mut frame: Frame, input: Option<InputStamp>) {
        self.put(|contents| {
            let unseen = contents.frame.take().and_then(|unseen| unseen.frame.since);
            frame.since = unseen.or(frame.since);
            contents.frame = Some(Shown { frame, input, is_denoised: false });
        });
    }

    /// Takes still frames that were shown, with another picture.
    pub fn denoised(&self) -> impl Fn(Frame, Option<InputStamp>) + Send + use<> {
        let mailbox = Arc::clone(&self.mailbox);
        move |frame, input| {
            let frame = Frame { since: None, ..frame };
            mailbox.put(|contents| contents.denoised = Some(Shown { frame, input, is_denoised: true }));
        }
    }

    /// Shows the last frame, and all that follow, with other settings.
    pub fn set(&self, settings: DisplaySettings) {
        self.put(|contents| contents.settings = Some(settings));
    }

    fn put(&self, put: impl FnOnce(&mut Contents)) {
        self.mailbox.put(put);
    }
}

impl Mailbox {
    fn put(&self, put: impl FnOnce(&mut Contents)) {
        put(&mut self.contents.lock().unwrap_or_else(PoisonError::into_inner));
        self.changed.notify_one();
    }
}

impl Drop for DisplayThread {
    fn drop(&mut self) {
        self.put(|contents| contents.closed = true);
    }
}

fn work(
    mailbox: &Mailbox,
    mut settings: DisplaySettings,
    tone_mapper: &mut dyn ToneMapper,
    out: &impl Fn(EncodedFrame),
) {
    let (mut last, mut denoised): (Option<Shown>, Option<Shown>) = (None, None);
    let mut number = 0;
    loop {
        let contents = mailbox.contents.lock().unwrap_or_else(PoisonError::into_inner);
        let is_empty = |contents: &mut Contents| {
            let Contents { frame, denoised, settings, closed } = contents;
            !*closed && frame.is_none() && denoised.is_none() && settings.is_none()
        };
        let mut contents = mailbox.changed.wait_while(contents, is_empty).unwrap_or_else(PoisonError::into_inner);
        if contents.closed {
            return;
        }
        let Contents { frame, denoised: late, settings: other, .. } = std::mem::take(&mut *contents);
        drop(contents);
        // In any case, what changes is shown; and a picture that takes the place of the one that is seen.
        let [is_turned, is_new, is_late] = [other.is_some(), frame.is_some(), late.is_some()];
        settings = other.unwrap_or(settings);
        last = frame.or(last);
        denoised = late.or(denoised).filter(|denoised| {
            settings.denoise && last.as_ref().is_some_and(|last| is_same_still(&last.frame, &denoised.frame))
        });
        let (shown, is_another) = match (&mut denoised, &mut last) {
            (Some(denoised), _) => (denoised, is_turned || is_late),
            (None, Some(last)) => (last, is_turned || is_new),
            (None, None) => continue,
        };
        if is_another && shown.frame.layer.plane == settings.layer.plane {
            number += 1;
            out(EncodedFrame::new(number, shown, &settings, tone_mapper));
        }
    }
}

/// Both are still pictures of one state, however far they have come.
fn is_same_still(one: &Frame, other: &Frame) -> bool {
    let state = |frame: &Frame| (frame.moving.is_none(), frame.revision, frame.world, frame.camera, frame.layer);
    one.moving.is_none() && state(one) == state(other)
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;
    use std::time::Duration;

    use frame::live::Moment;
    use frame::tone::Tone;
    use frame::{Layer, Picture};
    use glam::Vec3;
    use protocol::question::WorldState;
    use scenes::Camera;
    use serde_json::Value;

    use super::super::encoded::CpuToneMapper;
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

    fn split(encoded: &EncodedFrame) -> (Value, image::RgbImage) {
        let message = encoded.message().unwrap();
        let length = u32::from_le_bytes(message[..4].try_into().unwrap()) as usize;
        let header = serde_json::from_slice(&message[4..4 + length]).unwrap();
        (header, image::load_from_memory(&message[4 + length..]).unwrap().to_rgb8())
    }

    #[test]
    fn a_denoised_picture_stays_until_the_state_changes_and_comes_back_never() {
        let (sender, pictures) = channel();
        let settings = DisplaySettings { layer: Layer::FINAL, tone: Tone::PLAIN, denoise: true };
        let thread =
            DisplayThread::start(settings.clone(), Box::new(CpuToneMapper), move |encoded| drop(sender.send(encoded)))
                .unwrap();
        let denoised = thread.denoised();
        let next = || pictures.recv_timeout(Duration::from_secs(60)).unwrap().header;
        let of = |revision, frames, moving| Frame { revision, ..frame(frames, moving) };
        let seen = |header: crate::display::encoded::FrameHeader| (header.revision, header.frames, header.denoised);

        thread.show(of(1, 1, false), None);
        assert_eq!(seen(next()), (1, 1, false), "at first as it is");
        denoised(of(1, 1, false), None);
        assert_eq!(seen(next()), (1, 1, true));
        // More frames of the same state: nothing flickers back. Pictures come in order, so one would come before the next.
        for frames in [2, 3] {
            thread.show(of(1, frames, false), None);
        }
        denoised(of(1, 3, false), None);
        assert_eq!(seen(next()), (1, 3, true));

        // Another tone: the same picture again.
        let brighter = Tone { exposure: frame::tone::Exposure::Fixed(1.0), ..settings.tone };
        thread.set(DisplaySettings { tone: brighter, ..settings.clone() });
        assert_eq!(seen(next()), (1, 3, true));
        // Without: the last plain one; and with it again, nothing old comes back.
        thread.set(DisplaySettings { denoise: false, ..settings.clone() });
        assert_eq!(seen(next()), (1, 3, false));
        thread.set(settings);
        assert_eq!(seen(next()), (1, 3, false));
        denoised(of(1, 3, false), None);
        assert_eq!(seen(next()), (1, 3, true));

        // Something moves: at once, and what was denoised of the state before comes too late.
        thread.show(of(2, 1, true), None);
        assert_eq!(seen(next()), (2, 1, false));
        denoised(of(1, 4, false), None);
        thread.show(of(2, 1, false), None);
        assert_eq!(seen(next()), (2, 1, false));
        denoised(of(2, 1, false), None);
        assert_eq!(seen(next()), (2, 1, true));
    }

    #[test]
    fn moving_pictures_are_jpeg_and_settled_ones_without_loss() {
        let (sender, pictures) = channel();
        let settings = DisplaySettings { layer: Layer::FINAL, tone: Tone::PLAIN, denoise: false };
        let thread =
            DisplayThread::start(settings.clone(), Box::new(CpuToneMapper), move |encoded| drop(sender.send(encoded)))
                .unwrap();
        let show = |frame: Frame| {
            thread.show(frame, None);
            pictures.recv_timeout(Duration::from_secs(60)).unwrap()
        };
        let exact = settings.tone.develop(&frame(1, true).picture);
        let (header, image) = split(&show(frame(1, true)));
        assert_eq!((header["kind"].as_str(), header["revision"].as_u64()), (Some("image/jpeg"), Some(2)));
        let worst = image.as_raw().iter().zip(exact.bytes()).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(worst.unwrap() < 60, "{worst:?}");
        let settled = show(frame(9, false));
        assert_eq!(settled.since, Some(Moment(7)));
        let (header, image) = split(&settled);
        assert_eq!((header["kind"].as_str(), image.as_raw().as_slice()), (Some("image/png"), exact.bytes()));

        // Another exposure: the same frame again, as another picture.
        let brighter = Tone { exposure: frame::tone::Exposure::Fixed(1.0), ..settings.tone };
        thread.set(DisplaySettings { tone: brighter, ..settings });
        let again = pictures.recv_timeout(Duration::from_secs(60)).unwrap();
        assert_eq!((again.header.number, again.since), (3, None), "no input waits for it");
        assert_eq!(split(&again).1.as_raw().as_slice(), brighter.develop(&frame(9, false).picture).bytes());
    }
}
