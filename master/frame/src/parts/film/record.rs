//! A film as bytes, and back: for checkpoints. All sums are kept exactly.

use super::Film;

impl Film {
    /// Appends all sums, little endian.
    pub fn write(&self, out: &mut Vec<u8>) {
        let Self { tiling: _, radiance, halves, emitted, emits, repetitions, repeated, guides, guided: _ } = self;
        halves.iter().chain(repeated).for_each(|count| out.extend(count.to_le_bytes()));
        let doubles = radiance.iter().chain(emitted).flat_map(|planes| planes.values());
        doubles.for_each(|value| out.extend(value.to_le_bytes()));
        emits.iter().flatten().for_each(|emits| out.push(u8::from(*emits)));
        let singles = repetitions.iter().flat_map(|planes| planes.values()).chain(guides.values());
        singles.for_each(|value| out.extend(value.to_le_bytes()));
    }

    /// The sums that tell surfaces apart were made of so many frames, and there are more: from now on it is as if they were of as
    /// many as they should be.
    pub fn rescale_guides(&mut self, frames: u32) {
        let factor = self.frames().min(self.guided) as f32 / self.frames().min(frames).max(1) as f32;
        self.guides.values_mut().iter_mut().for_each(|sum| *sum *= factor);
    }

    /// Takes the sums of a film of the same size and kind from the front of `bytes`; `None` if there are too few, or
    /// they make no sense.
    pub fn read(&mut self, bytes: &mut &[u8]) -> Option<()> {
        let Self { tiling: _, radiance, halves, emitted, emits, repetitions, repeated, guides, guided: _ } = self;
        for count in halves.iter_mut().chain(repeated) {
            // Sums of counts, and many more frames, must still be numbers.
            *count = Some(u32::from_le_bytes(take(bytes)?)).filter(|count| *count <= FRAMES_MAX)?;
        }
        for value in radiance.iter_mut().chain(emitted).flat_map(|planes| planes.values_mut()) {
            *value = f64::from_le_bytes(take(bytes)?);
        }
        for emits in emits.iter_mut().flatten() {
            *emits = take::<1>(bytes)? != [0];
        }
        for value in repetitions.iter_mut().flat_map(|planes| planes.values_mut()).chain(guides.values_mut()) {
            *value = f32::from_le_bytes(take(bytes)?);
        }
        Some(())
    }
}

/// Frames that a half, or a replicate, may have: years of drawing.
const FRAMES_MAX: u32 = 1 << 28;

fn take<const N: usize>(bytes: &mut &[u8]) -> Option<[u8; N]> {
    let (first, rest) = bytes.split_first_chunk::<N>()?;
    *bytes = rest;
    Some(*first)
}
