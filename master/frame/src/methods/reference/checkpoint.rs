//! What is drawn so far as bytes, so that another process can go on with it.
//!
//! ```text
//! frames u32 , sums and sums of squares of each pixel (six f64)                    (little endian)
//! ```
//! sealed by [`crate::parts::checkpoint`].

use glam::DVec3;
use protocol::answer::Moments;

use super::{FRAMES_MAX, Reference, ReferenceSetup, ReferenceState};
use crate::front_end::NoCheckpoint;
use crate::parts::checkpoint;

const MAGIC: &[u8] = b"igi reference checkpoint 1\n";

impl Reference {
    /// All that is needed to go on.
    pub fn checkpoint(&self) -> Vec<u8> {
        let ReferenceState { frames, moments: Moments { sum, squares } } = &self.state;
        let mut bytes = frames.to_le_bytes().to_vec();
        for value in sum.iter().zip(squares).flat_map(|(sum, squares)| [*sum, *squares]).flat_map(|v| v.to_array()) {
            bytes.extend(value.to_le_bytes());
        }
        checkpoint::seal(MAGIC, &self.setup.identity(), &bytes)
    }

    /// Goes on where a checkpoint was made.
    ///
    /// # Errors
    /// [`NoCheckpoint`]: it is not one, or not of this picture.
    pub fn from_checkpoint(setup: ReferenceSetup, bytes: &[u8]) -> Result<Self, NoCheckpoint> {
        let contents = checkpoint::open(MAGIC, &setup.identity(), bytes)?;
        let (frames, rest) = contents.split_first_chunk().ok_or(NoCheckpoint::Broken)?;
        let frames = u32::from_le_bytes(*frames);
        let (values, rest) = rest.as_chunks::<8>();
        let pixels = setup.camera.width as usize * setup.camera.height as usize;
        if values.len() != 6 * pixels || !rest.is_empty() || frames > FRAMES_MAX {
            return Err(NoCheckpoint::Broken);
        }
        let mut vectors = values.as_chunks::<3>().0.iter().map(|v| DVec3::from_array(v.map(f64::from_le_bytes)));
        let mut moments = Moments::zero(pixels);
        for (sum, squares) in moments.sum.iter_mut().zip(&mut moments.squares) {
            *sum = vectors.next().unwrap_or_default();
            *squares = vectors.next().unwrap_or_default();
        }
        Ok(Self::resume(setup, ReferenceState { frames, moments }))
    }
}

impl ReferenceSetup {
    /// Recognises pictures whose samples may be added up.
    fn identity(&self) -> String {
        let Self { world, camera, seed, max_bounces } = self;
        // Another version may trace otherwise. Debug writes floats so that they can be told apart to the last bit.
        let program = env!("CARGO_PKG_VERSION");
        format!("{program} {world:?} {camera:?} {seed} {max_bounces:?}")
    }
}
