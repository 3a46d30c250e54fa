//! What is drawn so far as bytes, so that another process can go on with it.
//!
//! ```text
//! dropped u64 , gaps u32 , their rectangles u32 … , the film's sums , the cross-check's                (little endian)
//! ```
//! sealed by [`crate::parts::checkpoint`].
//!
//! Frames in flight are not kept: they are asked again, and give the same bits. Frames that are in are not
//! asked again, so no replicate counts twice.

use protocol::question::Quality;

use super::{Cursor, Igi, Setup};
use crate::front_end::{FrontEnd, NoCheckpoint};
use crate::parts::{Batches, checkpoint};

const MAGIC: &[u8] = b"igi checkpoint 2\n";
/// Of when all frames, up to so many, said what tells surfaces apart.
const MAGIC_BEFORE: &[u8] = b"igi checkpoint 1\n";
const GUIDE_FRAMES_BEFORE: u32 = 4096;

impl Igi {
    /// All that is needed to go on.
    pub fn checkpoint(&self) -> Vec<u8> {
        let mut bytes = self.dropped.to_le_bytes().to_vec();
        bytes.extend((self.given_up.len() as u32).to_le_bytes());
        self.given_up.iter().for_each(|rect| bytes.extend((*rect as u32).to_le_bytes()));
        self.film.write(&mut bytes);
        self.check.iter().for_each(|check| check.write(&mut bytes));
        checkpoint::seal(MAGIC, &self.setup.identity(), &bytes)
    }

    /// Goes on where a checkpoint was made.
    ///
    /// # Errors
    /// [`NoCheckpoint`]: it is not one, or not of this picture.
    pub fn resume(setup: Setup, bytes: &[u8]) -> Result<Self, NoCheckpoint> {
        let identity = setup.identity();
        let is_old = bytes.starts_with(MAGIC_BEFORE);
        let contents = checkpoint::open(if is_old { MAGIC_BEFORE } else { MAGIC }, &identity, bytes)?;
        let mut igi = Self::new(setup);
        igi.restore(contents).ok_or(NoCheckpoint::Broken)?;
        if is_old {
            igi.film.rescale_guides(GUIDE_FRAMES_BEFORE);
        }
        Ok(igi)
    }

    fn restore(&mut self, mut bytes: &[u8]) -> Option<()> {
        let (dropped, rest) = bytes.split_first_chunk()?;
        let (gaps, rest) = rest.split_first_chunk()?;
        (self.dropped, bytes) = (u64::from_le_bytes(*dropped), rest);
        for _ in 0..u32::from_le_bytes(*gaps) {
            let (rect, rest) = bytes.split_first_chunk()?;
            self.given_up.insert(u32::from_le_bytes(*rect) as usize);
            bytes = rest;
        }
        self.film.read(&mut bytes)?;
        // Checkpoints of before know nothing of it: it begins anew.
        if let Some(check) = self.check.as_mut().filter(|_| !bytes.is_empty()) {
            check.read(&mut bytes)?;
        }
        self.frames = Batches::new(0, self.frames());
        self.next = Cursor { frame: self.frames(), ..Cursor::default() };
        bytes.is_empty().then_some(())
    }
}

impl Setup {
    /// Recognises pictures whose frames have the same bits. The filter does not matter: it changes no sum.
    fn identity(&self) -> String {
        let Self { world, camera, quality, fields, seed, filter: _ } = self;
        // Another version may estimate otherwise: its frames must not be added to ours.
        let program = env!("CARGO_PKG_VERSION");
        // Debug writes floats so that they can be told apart to the last bit.
        let quality = identity_of(quality);
        format!("{program} {world:?} {camera:?} {quality} {fields:?} {seed}")
    }
}

/// The settings as text. A checkpoint holds only its hash, so a field that is renamed keeps here the name that it had when
/// checkpoints were first written: else none of before could be gone on with.
fn identity_of(quality: &Quality) -> String {
    let Quality { interleave, light_samples, vpls, photons, bound, bias_compensation, importance, .. } = quality;
    let Quality { max_length, indirect_caustics, photon_radius, shrink_radius, scramble, motion, replicates, .. } =
        quality;
    let illuminance = if quality.illuminance { ", illuminance" } else { "" };
    format!(
        "Quality {{ interleave: {interleave:?}, lights: {light_samples}, vpls: {vpls}, photons: {photons}, \
         bound: {bound:?}, remainder: {bias_compensation}, importance: {importance}, max_length: {max_length:?}, \
         indirect_caustics: {indirect_caustics}, photon_radius: {photon_radius:?}, shrink_radius: {shrink_radius}, \
         scramble: {scramble:?}, motion: {motion:?}, randomisations: {replicates}{illuminance} }}"
    )
}
