//! Structure-of-arrays memory: what pixels have, plane by plane.

/// Several planes of one size. The planes of a row lie next to each other, so that inner loops run along
/// contiguous memory, and bands of rows can be worked on in parallel.
#[derive(Clone, Debug)]
pub(super) struct Planes<T, const N: usize> {
    width: usize,
    data: Vec<T>,
}

impl<T: Copy + Default, const N: usize> Planes<T, N> {
    /// Planes of zeros; without any pixel if a side is 0.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, data: vec![T::default(); width * N * height] }
    }

    /// No pixel at all.
    pub fn is_empty(&self) -> bool {
        self.data.is_empty()
    }

    /// All values, row by row, plane by plane in each.
    pub fn values(&self) -> &[T] {
        &self.data
    }

    /// All values, to be written.
    pub fn values_mut(&mut self) -> &mut [T] {
        &mut self.data
    }

    /// The planes of a row.
    #[inline(always)]
    pub fn row(&self, y: usize) -> [&[T]; N] {
        let row = &self.data[y * self.width * N..][..self.width * N];
        std::array::from_fn(|plane| &row[plane * self.width..][..self.width])
    }

    /// The planes of a row, to be written.
    #[inline(always)]
    pub fn row_mut(&mut self, y: usize) -> [&mut [T]; N] {
        split(&mut self.data[y * self.width * N..][..self.width * N], self.width)
    }

    /// `count` bands of `rows` rows each, the last of which may have fewer; empty ones if there are no pixels.
    pub fn bands(&mut self, rows: usize, count: usize) -> Vec<Band<'_, T, N>> {
        let width = self.width;
        let mut bands = Vec::with_capacity(count);
        bands.extend(self.data.chunks_mut((rows * width * N).max(1)).map(|data| Band { width, data }));
        bands.extend(Band::none(count - bands.len()));
        bands
    }
}

/// Some rows of planes.
pub(super) struct Band<'a, T, const N: usize> {
    width: usize,
    data: &'a mut [T],
}

impl<T, const N: usize> Band<'_, T, N> {
    /// So many of them without any pixel.
    pub fn none(count: usize) -> Vec<Self> {
        std::iter::repeat_with(|| Self { width: 0, data: &mut [] }).take(count).collect()
    }

    /// The planes of a row, counted from the band's first; empty ones if there are no pixels.
    pub fn row_mut(&mut self, y: usize) -> [&mut [T]; N] {
        split(&mut self.data[y * self.width * N..][..self.width * N], self.width)
    }
}

#[inline(always)]
fn split<T, const N: usize>(row: &mut [T], width: usize) -> [&mut [T]; N] {
    let mut rest = row;
    std::array::from_fn(|_| rest.split_off_mut(..width).unwrap_or_default())
}

/// The last few rows of a picture that is worked on from top to bottom: small enough to stay in the
/// processor's cache. Every row has [`MARGIN`] more columns at either side, so that neighbours can be looked at
/// without asking whether there are any; its width is rounded up to whole blocks of [`LANES`].
#[derive(Clone, Debug)]
pub(super) struct Rolling<const N: usize> {
    rows: Planes<f32, N>,
    kept: usize,
    next: usize,
}

/// Pixels that are filtered at a time: so many that loops over them stay loops, and become vectors. Eight were taken apart
/// into single numbers, which took three times as long.
pub(super) const LANES: usize = 64;
/// Columns beyond each edge of the picture; as far as a window of 16 reaches.
pub(super) const MARGIN: usize = 8;

impl<const N: usize> Rolling<N> {
    /// Room for the last `kept` rows of a picture so many columns wide; zeros, margins included.
    pub fn new(width: usize, kept: usize) -> Self {
        Self { rows: Planes::new(MARGIN + width.next_multiple_of(LANES) + MARGIN, kept), kept, next: 0 }
    }

    /// Begins anew; `y` is the next row.
    pub fn begin(&mut self, y: usize) {
        self.next = y;
    }

    /// The row that [`Self::push`] writes next.
    pub fn next(&self) -> usize {
        self.next
    }

    /// The next row, to be written: column x is at [`MARGIN`]` + x`. The oldest row is forgotten.
    #[inline(always)]
    pub fn push(&mut self) -> [&mut [f32]; N] {
        self.next += 1;
        self.rows.row_mut((self.next - 1) % self.kept)
    }

    /// One of the rows kept.
    #[inline(always)]
    pub fn row(&self, y: usize) -> Row<'_, N> {
        debug_assert!(y < self.next && y + self.kept >= self.next, "row {y} is not kept");
        let width = self.rows.width;
        Row { width, data: &self.rows.data[(y % self.kept) * width * N..][..width * N] }
    }
}

/// The planes of a row, margins included: column x is at [`MARGIN`]` + x`.
#[derive(Clone, Copy)]
pub(super) struct Row<'a, const N: usize> {
    width: usize,
    /// `N · width` values.
    data: &'a [f32],
}

impl<'a, const N: usize> Row<'a, N> {
    /// One of the planes.
    pub fn plane(self, plane: usize) -> &'a [f32] {
        &self.data[plane * self.width..][..self.width]
    }

    /// The block that begins at index `at`, in all planes.
    #[inline(always)]
    pub fn block(self, at: usize) -> RowBlock<'a, N> {
        assert!(at + LANES <= self.width && self.width * N == self.data.len());
        RowBlock { row: self, at }
    }
}

/// A block of pixels in all planes of a row: it lies within the row.
#[derive(Clone, Copy)]
pub(super) struct RowBlock<'a, const N: usize> {
    row: Row<'a, N>,
    at: usize,
}

impl<'a, const N: usize> RowBlock<'a, N> {
    /// The values in one plane.
    #[inline(always)]
    pub fn plane(self, plane: usize) -> &'a Block {
        assert!(plane < N);
        let begin = plane * self.row.width + self.at;
        // SAFETY: `at + LANES ≤ width` was checked when the block was made, and `plane < N` just now (at compile
        // time, mostly), so this ends at or before `N · width`, the length of the data; and so many numbers side by side
        // are an array of them. Checking each of a hundred blocks anew took a third of the filter's time.
        unsafe { &*self.row.data.as_ptr().add(begin).cast::<Block>() }
    }
}

/// A block of pixels that are filtered at once.
pub(super) type Block = [f32; LANES];

/// A block, value by value. Always inlined, so that it becomes vectors as wide as its caller's.
#[inline(always)]
pub(super) fn each(value: impl Fn(usize) -> f32) -> Block {
    let mut block = [0.0; LANES];
    for (i, slot) in block.iter_mut().enumerate() {
        *slot = value(i);
    }
    block
}
