//! Scenes with known answers, built in code.
//!
//! Each builder returns a [`Case`]: a scene, and the radiance that its camera must see, in closed
//! form, with the tolerance that tessellation and single precision leave. Rows are those of the
//! table in [`rows`]. Furnaces alone prove little (any direction returns the same value, so wrong
//! ray distributions pass), hence lamps, plates, concentric spheres and glass beside them.
//!
//! This crate knows how light *ends up*, from formulas; it has never heard how a renderer gets there.

pub mod build;
pub mod closed_form;
pub mod furnaces;
pub mod glass;
pub mod lamps;
pub mod programs;
pub mod stress;

use scenes::Scene;

/// A scene and what its camera sees. All channels are alike.
#[derive(Clone, Debug)]
pub struct Case {
    /// For messages.
    pub name: String,
    /// Row of the table in [`rows`].
    pub row: u8,
    /// What to render.
    pub scene: Scene,
    /// Mean radiance over the picture.
    pub radiance: f64,
    /// Every pixel has it, not only their mean.
    pub uniform: bool,
    /// Relative error that is not a renderer's fault.
    pub tolerance: f64,
}

impl Case {
    /// What a measured mean is off by, relative to what it should be.
    pub fn error(&self, measured: f64) -> f64 {
        (measured - self.radiance).abs() / self.radiance.abs().max(f64::MIN_POSITIVE)
    }
}

/// Which builder answers which row of the table of stiff and extreme cases.
///
/// | row | builder |
/// |---|---|
/// | 1, 8 | [`furnaces::furnace_cube`], [`furnaces::furnace_sphere`], [`furnaces::furnace_corner`] |
/// | 2 | [`furnaces::white_ball`] |
/// | 3 | [`furnaces::lit_sphere`] |
/// | 4, 5, 37 | [`furnaces::integrating_sphere`], [`closed_form::bounded_sphere`] |
/// | 6 | [`furnaces::concentric_spheres`] |
/// | 7 | [`furnaces::mirror_shaft`] |
/// | 9 | [`lamps::cie_cube`], [`lamps::cie_cube_direct`] |
/// | 10 | [`lamps::point_above_floor`] |
/// | 11 | [`lamps::rectangle_above_floor`] |
/// | 12 | [`lamps::polygon_above_floor`] |
/// | 13 | [`lamps::disc_above_floor`], [`lamps::ball_above_floor`] |
/// | 14, 15 | [`lamps::wall_beside_floor`], [`closed_form::KEPT_BY_BOUND`] |
/// | 16 | [`lamps::cube_faces`] |
/// | 20 | [`stress::touching_corner`] |
/// | 23 | [`stress::scaled`] |
/// | 25 | [`stress::obj_with_broken_triangles`], [`stress::needles`] |
/// | 26 | [`stress::doubled`] |
/// | 27 | [`glass::ball_in_a_box`] |
/// | 28 | [`closed_form::fresnel`], [`glass::light_caught_in_glass`] |
/// | 29 | [`glass::pane_before_a_lamp`], [`glass::lamp_in_a_pane`] |
/// | 31 | [`stress::dark_room`] |
/// | 35 | [`stress::PICTURE_SIZES`] |
pub mod rows {}
