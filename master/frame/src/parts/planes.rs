//! Structure-of-arrays working memory for filters.

use rayon::prelude::*;

/// Several planes of `f32` of one size. The planes of a row lie next to each other, so that rows
/// can be filled in parallel, and inner loops run along contiguous memory. Every row has [`MARGIN`]
/// more columns at either side, so that neighbours can be looked at without asking whether there
/// are any; its width is rounded up to whole blocks of [`LANES`].
#[derive(Clone, Debug, Default)]
pub(super) struct Planes<const N: usize> {
    stride: usize,
    data: Vec<f32>,
}

/// Pixels that are filtered at a time.
pub(super) const LANES: usize = 8;
/// Columns beyond each edge of the picture; as far as a window of 16 reaches.
pub(super) const MARGIN: usize = 8;

impl<const N: usize> Planes<N> {
    /// Fills all rows in parallel: `fill` gets the number of a row and its planes, margins included,
    /// with whatever was in them before. Memory is only asked for if the picture has grown.
    pub fn fill(&mut self, width: usize, height: usize, fill: impl Fn(usize, [&mut [f32]; N]) + Sync) {
        let stride = MARGIN + width.next_multiple_of(LANES) + MARGIN;
        self.stride = stride;
        self.data.resize(stride * N * height, 0.0);
        self.data.par_chunks_mut(stride * N).enumerate().for_each(|(y, row)| {
            let mut planes = row.chunks_mut(stride);
            fill(y, std::array::from_fn(|_| planes.next().unwrap_or_default()));
        });
    }

    /// The planes of a row, margins included: column x is at [`MARGIN`]` + x`.
    pub fn row(&self, y: usize) -> [&[f32]; N] {
        let row = &self.data[y * self.stride * N..(y + 1) * self.stride * N];
        std::array::from_fn(|plane| &row[plane * self.stride..(plane + 1) * self.stride])
    }
}

/// A block of pixels that are filtered at once.
pub(super) type Block = [f32; LANES];

/// The block that begins at index `at` of a plane's row.
#[inline(always)]
pub(super) fn block(plane: &[f32], at: usize) -> Block {
    let mut block = [0.0; LANES];
    block.copy_from_slice(&plane[at..at + LANES]);
    block
}
