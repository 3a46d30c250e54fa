//! References on disk: an EXR that any program shows, and that knows enough to be gone on with.
//!
//! Channels R, G, B are the mean, `variance.R` and so on its variance. The sums themselves are f64, which
//! the format lacks: their two halves are stored as 32-bit integers, `sum.R.high`, `sum.R.low`,
//! `squares.R.high` … . So a reference that was interrupted ends in the same bits as one that was not.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

use anyhow::{Context, bail, ensure};
use exr::prelude::*;
use frame::{FrontEnd, Plane, Reference, ReferenceState};
use glam::DVec3;
use protocol::answer::Moments;

use super::exr::{Metadata, attributes, channel, own_words};
use super::read::exr_bytes;

/// A reference as read from a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// What the file says of itself, without the prefix `igi:`.
    pub metadata: BTreeMap<String, String>,
    /// Where it stands.
    pub state: ReferenceState,
}

const CHANNELS: [&str; 3] = ["R", "G", "B"];

/// The bytes of a file that holds all that is known so far.
///
/// # Errors
/// If the picture is too large for the format.
pub fn encode_record(front: &mut Reference, metadata: &Metadata) -> anyhow::Result<Vec<u8>> {
    let (mean, variance) = (front.show(Plane::Raw), front.variance());
    let mut channels = Vec::new();
    for (index, name) in CHANNELS.into_iter().enumerate() {
        channels.push(channel(name.to_string(), &mean, index));
        channels.push(channel(format!("variance.{name}"), &variance, index));
    }
    let Moments { sum, squares } = &front.state().moments;
    for (kind, values) in [("sum", sum), ("squares", squares)] {
        for (index, name) in CHANNELS.into_iter().enumerate() {
            for (half, shift) in HALVES {
                let bits = values.iter().map(|value| (value[index].to_bits() >> shift) as u32).collect();
                channels.push(AnyChannel::new(format!("{kind}.{name}.{half}").as_str(), FlatSamples::U32(bits)));
            }
        }
    }
    let frames = [("frames", front.state().frames.to_string()), ("samples", front.samples().to_string())];
    let all: Metadata = frames.into_iter().chain(metadata.iter().cloned()).collect();
    let size = (mean.width as usize, mean.height as usize);
    let layer = Layer::new(size, attributes(&all), Encoding::SMALL_LOSSLESS, AnyChannels::sort(channels.into()));
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut bytes).context("the picture cannot be encoded as EXR")?;
    Ok(bytes.into_inner())
}

const HALVES: [(&str, u32); 2] = [("high", 32), ("low", 0)];

/// Reads what [`encode_record`] wrote.
///
/// # Errors
/// If the file is missing, broken, or another kind of picture.
pub fn read_record(path: &Path) -> anyhow::Result<Record> {
    let context = || format!("{}: cannot be read", path.display());
    let read = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer().all_attributes();
    let bytes = exr_bytes(path).with_context(context)?;
    let layer = read.from_buffered(Cursor::new(bytes)).with_context(context)?.layer_data;
    let metadata = own_words(&layer.attributes);
    let sums = |kind| sums(&layer.channel_data.list, kind, layer.size.area()).with_context(context);
    let Some(frames) = metadata.get("frames").and_then(|frames| frames.parse().ok()) else {
        bail!("{}: is no reference of igi: it does not say how many samples it has", path.display());
    };
    let moments = Moments { sum: sums("sum")?, squares: sums("squares")? };
    let (width, height) = (layer.size.width() as u32, layer.size.height() as u32);
    Ok(Record { width, height, metadata, state: ReferenceState { frames, moments } })
}

fn sums(channels: &[AnyChannel<FlatSamples>], kind: &str, len: usize) -> anyhow::Result<Vec<DVec3>> {
    let mut bits = vec![[0_u64; 3]; len];
    for (index, colour) in CHANNELS.into_iter().enumerate() {
        for (half, shift) in HALVES {
            let name = format!("{kind}.{colour}.{half}");
            let found = channels.iter().find(|channel| channel.name.eq(name.as_str()));
            let Some(FlatSamples::U32(halves)) = found.map(|channel| &channel.sample_data) else {
                bail!("it has no channel {name}, so it is no reference of igi that could be gone on with");
            };
            ensure!(halves.len() == len, "channel {name} is too short");
            bits.iter_mut().zip(halves).for_each(|(bits, half)| bits[index] |= u64::from(*half) << shift);
        }
    }
    let sums: Vec<_> = bits.into_iter().map(|bits| DVec3::from_array(bits.map(f64::from_bits))).collect();
    ensure!(sums.iter().all(|sum| sum.is_finite() && sum.min_element() >= 0.0), "its sums are not finite numbers");
    Ok(sums)
}

#[cfg(test)]
mod tests {
    use frame::{Picture, ReferenceSetup};
    use protocol::question::WorldState;
    use scenes::Camera;

    use super::*;
    use crate::files::read_picture;

    fn front() -> Reference {
        let camera = Camera { width: 3, height: 2, ..Camera::default() };
        let setup = ReferenceSetup { world: WorldState::default(), camera, seed: 0, max_bounces: None };
        let value = |i: usize| DVec3::new(i as f64 / 3.0, 1e-9, 1e12 + i as f64);
        let sum: Vec<_> = (0..6).map(value).collect();
        let squares = sum.iter().map(|sum| *sum * *sum * 0.7).collect();
        Reference::resume(setup, ReferenceState { frames: 2, moments: Moments { sum, squares } })
    }

    #[test]
    fn a_reference_comes_back_with_every_bit_and_is_a_picture_to_others() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ref.exr");
        let mut front = front();
        std::fs::write(&path, encode_record(&mut front, &vec![("seed", "42".to_string())]).unwrap()).unwrap();
        let record = read_record(&path).unwrap();
        assert_eq!(&record.state, front.state());
        assert_eq!((record.width, record.height, record.metadata["seed"].as_str()), (3, 2, "42"));
        assert_eq!(read_picture(&path).unwrap(), front.show(Plane::Raw));
    }

    #[test]
    fn other_pictures_are_no_references_and_say_so() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        std::fs::write(&path, super::super::encode_exr(&Picture::black(2, 2), &[], &[]).unwrap()).unwrap();
        assert!(read_record(&path).unwrap_err().to_string().contains("no reference of igi"));
        std::fs::write(&path, b"nonsense").unwrap();
        assert!(read_record(&path).is_err());
    }
}
