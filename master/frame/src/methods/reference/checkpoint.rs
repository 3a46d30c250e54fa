//! What is drawn so far as bytes, so that another process can go on with it.
//!
//! ```text
//! "igi reference checkpoint 1\n" , SHA-256 of what is being drawn , frames u32 , sums and sums of squares of each pixel
//! (six f64) , SHA-256 of all before                                                              (little endian)
//! ```

use glam::DVec3;
use protocol::answer::Moments;
use sha2::{Digest, Sha256};

use super::{Reference, ReferenceSetup, ReferenceState};
use crate::front_end::NoCheckpoint;

const MAGIC: &[u8] = b"igi reference checkpoint 1\n";
const DIGEST: usize = 32;

impl Reference {
    /// All that is needed to go on.
    pub fn checkpoint(&self) -> Vec<u8> {
        let ReferenceState { frames, moments: Moments { sum, squares } } = &self.state;
        let mut bytes = [MAGIC, &self.setup.identity(), &frames.to_le_bytes()].concat();
        for value in sum.iter().zip(squares).flat_map(|(sum, squares)| [*sum, *squares]).flat_map(|v| v.to_array()) {
            bytes.extend(value.to_le_bytes());
        }
        let digest = Sha256::digest(&bytes);
        bytes.extend(digest);
        bytes
    }

    /// Goes on where a checkpoint was made.
    ///
    /// # Errors
    /// [`NoCheckpoint`]: it is not one, or not of this picture.
    pub fn from_checkpoint(setup: ReferenceSetup, bytes: &[u8]) -> Result<Self, NoCheckpoint> {
        let (content, digest) = bytes.split_last_chunk::<DIGEST>().ok_or(NoCheckpoint::Broken)?;
        if Sha256::digest(content)[..] != digest[..] {
            return Err(NoCheckpoint::Broken);
        }
        let rest = content.strip_prefix(MAGIC).ok_or(NoCheckpoint::Broken)?;
        let (identity, rest) = rest.split_first_chunk::<DIGEST>().ok_or(NoCheckpoint::Broken)?;
        if *identity != setup.identity() {
            return Err(NoCheckpoint::Another);
        }
        let (frames, rest) = rest.split_first_chunk().ok_or(NoCheckpoint::Broken)?;
        let (values, rest) = rest.as_chunks::<8>();
        let pixels = setup.camera.width as usize * setup.camera.height as usize;
        if values.len() != 6 * pixels || !rest.is_empty() {
            return Err(NoCheckpoint::Broken);
        }
        let mut vectors = values.as_chunks::<3>().0.iter().map(|v| DVec3::from_array(v.map(f64::from_le_bytes)));
        let mut moments = Moments::zero(pixels);
        for (sum, squares) in moments.sum.iter_mut().zip(&mut moments.squares) {
            *sum = vectors.next().unwrap_or_default();
            *squares = vectors.next().unwrap_or_default();
        }
        Ok(Self::resume(setup, ReferenceState { frames: u32::from_le_bytes(*frames), moments }))
    }
}

impl ReferenceSetup {
    /// Recognises pictures whose samples may be added up.
    fn identity(&self) -> [u8; DIGEST] {
        let Self { world, camera, seed, max_bounces } = self;
        // Another version may trace otherwise. Debug writes floats so that they can be told apart to the last bit.
        let program = env!("CARGO_PKG_VERSION");
        Sha256::digest(format!("{program} {world:?} {camera:?} {seed} {max_bounces:?}")).into()
    }
}
