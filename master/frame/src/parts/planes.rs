//! Structure-of-arrays working memory for filters.

use rayon::prelude::*;

/// Several planes of `f32` of one size. The planes of a row lie next to each other, so that rows
/// can be filled in parallel and a filter's inner loop runs along contiguous memory.
pub(super) struct Planes<const N: usize> {
    width: usize,
    data: Vec<f32>,
}

impl<const N: usize> Planes<N> {
    /// Fills all rows in parallel: `fill` gets the number of a row and its planes, all 0.
    pub fn fill(width: usize, height: usize, fill: impl Fn(usize, [&mut [f32]; N]) + Sync) -> Self {
        let mut data = vec![0.0; width * height * N];
        data.par_chunks_mut(width * N).enumerate().for_each(|(y, row)| {
            let mut planes = row.chunks_mut(width);
            fill(y, std::array::from_fn(|_| planes.next().unwrap_or_default()));
        });
        Self { width, data }
    }

    /// The planes of a row.
    pub fn row(&self, y: usize) -> [&[f32]; N] {
        let row = &self.data[y * self.width * N..(y + 1) * self.width * N];
        std::array::from_fn(|plane| &row[plane * self.width..(plane + 1) * self.width])
    }
}
