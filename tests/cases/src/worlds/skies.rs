//! Floors and walls under the sky: rows 17, 53 and 55.

use std::f64::consts::PI;

use glam::Vec3;
use scenes::{Environment, LookUp, Pixels, Surface, Texture};

use super::build::Build;
use super::emitters::{FLOOR, above_floor};
use crate::case::Exact;
use crate::closed_form;

/// The sky's radiance by direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sky {
    /// 1 everywhere.
    Uniform,
    /// The CIE's overcast sky, `(1 + 2 sin γ)/3` at elevation γ, 1 at the zenith.
    Overcast,
}

/// Row 17: a floor under the open sky.
pub fn open_floor(sky: Sky) -> Exact {
    under(sky, above_floor(Build::new("open floor"), format!("floor, {sky:?} sky"), open_irradiance(sky), 2e-3))
}

/// Row 17: a wall beside which the sky begins at the horizon; the ground is black.
pub fn open_wall(sky: Sky) -> Exact {
    let mut build = Build::new("open wall");
    let (wall, ground) = (build.paint(FLOOR, 0.0), build.paint(0.0, 0.0));
    build.quad(Vec3::ZERO, Vec3::X * 0.02, Vec3::Y * 0.02, wall);
    build.quad(Vec3::NEG_Y * 0.02, Vec3::Z * 1000.0, Vec3::X * 1000.0, ground);
    let irradiance = match sky {
        Sky::Uniform => PI / 2.0,
        Sky::Overcast => 0.396_177 * 7.0 * PI / 9.0,
    };
    let scene = build.seen(Vec3::new(0.005, 0.005, 0.01), Vec3::ZERO, 0.05, 4);
    let radiance = f64::from(FLOOR) / PI * irradiance;
    under(sky, Exact { name: format!("wall, {sky:?} sky"), scene, radiance, tolerance: 2e-3 })
}

/// Row 17: a black room with a hole of 1 × 1 in its roof, 3 above the floor point.
pub fn roof_opening() -> Exact {
    let mut build = Build::new("roof opening");
    let black = build.paint(0.0, 0.0);
    build.holed_ceiling(3.0, 2.0, 0.5, black);
    for (side, u) in [(Vec3::X, Vec3::Z), (Vec3::NEG_X, Vec3::Z), (Vec3::Z, Vec3::X), (Vec3::NEG_Z, Vec3::X)] {
        build.quad(side * 2.0 + Vec3::Y, u * 2.0, Vec3::Y * 2.0, black);
    }
    let irradiance = 4.0 * PI * closed_form::corner_rectangle(0.5, 0.5, 3.0);
    under(Sky::Uniform, above_floor(build, "floor under a roof opening".into(), irradiance, 2e-3))
}

/// A dim sky with a sun of one texel.
#[derive(Clone, Copy, Debug)]
pub struct Sun {
    /// Of the picture, texels.
    pub size: [u32; 2],
    /// Column and row of the sun.
    pub at: [u32; 2],
}

impl Sun {
    const BRIGHT: f32 = 60_000.0;
    const DIM: f32 = 0.5;

    fn texture(self) -> Texture {
        let [width, height] = self.size;
        let place = (0..height).flat_map(|row| (0..width).map(move |column| [column, row]));
        let pixels = place.map(|place| [if place == self.at { Self::BRIGHT } else { Self::DIM }; 3]);
        Texture { name: "sun".into(), width, height, pixels: Pixels::Float(pixels.collect()), look_up: LookUp::REPEAT }
    }

    /// Of a floor: interpolation leaves the mean over a circle of latitude that of texels, linear between the middles of
    /// rows and the same beyond the first and last.
    fn irradiance(self) -> f64 {
        let [width, height] = self.size.map(f64::from);
        let (bright, dim) = (f64::from(Self::BRIGHT), f64::from(Self::DIM));
        let row = |row: f64| if row == f64::from(self.at[1]) { dim + (bright - dim) / width } else { dim };
        const STEPS: u32 = 1_000_000;
        let part = |i: u32| {
            let colatitude = (f64::from(i) + 0.5) / f64::from(STEPS) * PI / 2.0;
            let y = (colatitude / PI * height - 0.5).clamp(0.0, height - 1.0);
            let mean = row(y.floor()) + (row(y.ceil()) - row(y.floor())) * y.fract();
            mean * colatitude.sin() * colatitude.cos()
        };
        (0..STEPS).map(part).sum::<f64>() * 2.0 * PI * PI / 2.0 / f64::from(STEPS)
    }

    fn shines_on(self, mut exact: Exact) -> Exact {
        exact.scene.textures.push(self.texture().into());
        exact.scene.environment = Environment::Image { texture: 0, scale: Vec3::ONE, turn: 0.0 };
        exact.radiance = f64::from(FLOOR) / PI * self.irradiance();
        exact.name = format!("{}, {self:?}", exact.name);
        exact
    }
}

/// Row 55: a floor under a sky with a sun.
pub fn sun_on_a_floor(sun: Sun) -> Exact {
    sun.shines_on(above_floor(Build::new("open floor"), "floor".into(), 1.0, 2e-3))
}

/// Row 55: the floor of row 53 under a sky with a sun, most of whose light comes over mirrors.
pub fn sun_in_a_well(sun: Sun) -> Exact {
    sun.shines_on(mirror_well(Sky::Uniform))
}

/// Row 53: a floor at the bottom of a shaft of perfect mirrors, which is as bright as if these were not there.
pub fn mirror_well(sky: Sky) -> Exact {
    let mut build = Build::new("mirror well");
    let (mirror, floor) = (build.surface(Surface::Mirror { reflectance: Vec3::ONE }), build.paint(FLOOR, 0.0));
    for (side, u) in [(Vec3::X, Vec3::Z), (Vec3::NEG_X, Vec3::Z), (Vec3::Z, Vec3::X), (Vec3::NEG_Z, Vec3::X)] {
        build.quad(side + Vec3::Y, u, Vec3::Y, mirror);
    }
    build.quad(Vec3::ZERO, Vec3::Z, Vec3::X, floor);
    let scene = build.seen(Vec3::new(0.1, 1.0, 0.2), Vec3::new(0.1, 0.0, 0.2), 40.0, 16);
    let radiance = f64::from(FLOOR) / PI * open_irradiance(sky);
    under(sky, Exact { name: format!("well of mirrors, {sky:?} sky"), scene, radiance, tolerance: 5e-3 })
}

/// Of a floor under the open sky.
fn open_irradiance(sky: Sky) -> f64 {
    match sky {
        Sky::Uniform => PI,
        Sky::Overcast => 7.0 * PI / 9.0,
    }
}

/// Elevations that the overcast sky's picture has.
const ROWS: u32 = 512;

fn under(sky: Sky, mut exact: Exact) -> Exact {
    exact.scene.environment = match sky {
        Sky::Uniform => Environment::Constant(Vec3::ONE),
        Sky::Overcast => {
            let texel = |row: u32| {
                let elevation = PI / 2.0 - (f64::from(row) + 0.5) / f64::from(ROWS) * PI;
                // Below the horizon, where nothing here looks, it goes on so that no edge is blurred.
                [((1.0 + 2.0 * elevation.sin().max(0.0)) / 3.0) as f32; 3]
            };
            let pixels = Pixels::Float((0..ROWS).flat_map(|row| [texel(row); 4]).collect());
            let (name, look_up) = ("overcast".into(), LookUp::REPEAT);
            exact.scene.textures.push(Texture { name, width: 4, height: ROWS, pixels, look_up }.into());
            Environment::Image { texture: (exact.scene.textures.len() - 1) as u32, scale: Vec3::ONE, turn: 0.0 }
        }
    };
    exact
}
