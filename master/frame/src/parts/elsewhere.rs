//! The filter, computed elsewhere: what a graphics processor needs for it, in numbers without structure.

use rayon::prelude::*;
use scenes::Camera;

use super::discontinuity::{GUIDED, Window};
use super::fade::noise_at_most;
use super::planes::{MARGIN, Planes};
use super::{Edges, Film, Filter};
use crate::Picture;

/// Smooths pictures for people's eyes, where the processor is not the fastest. The oracle is [`super::smoothed`].
pub trait Smoother: Send + Sync {
    /// The smoothed picture; `None` if it cannot.
    fn smooth(&self, guide: &Guide) -> Option<Picture>;
}

/// All that the filter knows of a picture.
pub struct Guide {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    rows: Planes<f32, GUIDED>,
    /// How surfaces are told apart.
    pub edges: Edges,
    /// Offsets along a row, with their weights.
    pub columns: Vec<(i32, f32)>,
    /// Offsets down a column, with their weights.
    pub rows_of_window: Vec<(i32, f32)>,
    /// Share of each half of the film in all frames.
    pub shares: [f32; 2],
    /// The filter fades where it does harm (see `fade.rs`); else the irradiance of all frames is in the first half's
    /// place.
    pub judged: bool,
    /// By how much noise may exceed what the halves tell of it.
    pub noise_at_most: f32,
}

impl Guide {
    /// Planes of a row, one after the other: radiance (3), reflectance (3), normal (3; no number where there is no
    /// surface), distance (0 there), irradiance/π of the first and of the second half (3 each), position (3), tolerance.
    pub const PLANES: usize = GUIDED;
    /// Columns of a plane before the picture's first.
    pub const MARGIN: usize = MARGIN;

    /// What there is to smooth; `None` if the filter is off, or has nothing to do.
    pub(super) fn of(film: &Film, camera: &Camera, filter: &Filter, judged: bool) -> Option<Self> {
        let edges = filter.edges.filter(|_| film.has_surface())?;
        let window = Window::new(film, camera, filter.window, edges);
        let (width, height) = (film.tiling().width, film.tiling().height);
        let mut rows = Planes::new(width as usize + 2 * MARGIN, height as usize);
        let bands = rows.bands(1, height as usize);
        bands.into_par_iter().enumerate().for_each(|(y, mut band)| window.read(y, judged, band.row_mut(0)));
        let [columns, rows_of_window] = window.taps();
        let noise_at_most = noise_at_most(window.frames_in_half());
        Some(Self {
            width,
            height,
            rows,
            edges,
            columns,
            rows_of_window,
            shares: window.shares(),
            judged,
            noise_at_most,
        })
    }

    /// All values: row by row, in each plane by plane, each from its margin to its margin.
    pub fn values(&self) -> &[f32] {
        self.rows.values()
    }

    /// Values from one plane to the next.
    pub fn stride(&self) -> usize {
        self.width as usize + 2 * MARGIN
    }
}
