//! What a film says so far, as an answer would say it: adding that changes no mean.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;
use protocol::answer::{Means, Pixels};
use protocol::question::Grid;

use crate::Picture;
use crate::front_end::Plane;
use crate::parts::Film;

/// The means of a film.
pub(super) struct Before {
    radiance: Picture,
    reflectance: Picture,
    irradiance: Picture,
    normal: Picture,
    distance: Picture,
}

impl Before {
    pub(super) fn of(film: &Film) -> Self {
        Self {
            radiance: film.plane(Plane::Raw),
            reflectance: film.plane(Plane::Albedo),
            irradiance: film.plane(Plane::Irradiance),
            normal: film.plane(Plane::Normal),
            distance: film.plane(Plane::Distance),
        }
    }

    /// Black before the first frame.
    pub(super) fn pixels(&self, grid: Grid) -> Pixels {
        let mut pixels = Pixels::black(grid.len());
        for (at, [x, y]) in grid.pixels().enumerate() {
            let value = |picture: &Picture| picture.pixels[y as usize * picture.width as usize + x as usize];
            let (reflectance, irradiance) = (value(&self.reflectance), value(&self.irradiance));
            let reflected = reflectance * irradiance * FRAC_1_PI;
            pixels.reflectance[at] = reflectance;
            pixels.irradiance[at] = irradiance;
            // Rounding may leave a little less than nothing.
            pixels.emitted[at] = (value(&self.radiance) - reflected).max(Vec3::ZERO);
            pixels.normal[at] = value(&self.normal);
            pixels.distance[at] = value(&self.distance).x;
        }
        pixels
    }

    /// The same as a mean.
    pub(super) fn means(&self, grid: Grid) -> Means {
        let pixels = self.pixels(grid);
        let surfaces = pixels.reflectance.iter().zip(&pixels.irradiance);
        let reflected = surfaces.map(|(reflectance, irradiance)| reflectance * irradiance * FRAC_1_PI).collect();
        Means { emitted: pixels.emitted, reflected }
    }
}
