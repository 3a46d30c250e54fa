//! A point of the cache: where it lies, what is known of its light, and how that came to be known.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;
use protocol::question::Address;
use scenes::SurfacePoint;

/// What a point's light is made of; its radiance is `emitted + reflectance · irradiance / π`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Light {
    /// Never smoothed.
    pub emitted: Vec3,
    pub reflectance: Vec3,
    pub irradiance: Vec3,
    /// Unit; zero where nothing matt is seen.
    pub normal: Vec3,
}

impl Light {
    /// Towards the eye, W·m⁻²·sr⁻¹.
    pub fn radiance(&self) -> Vec3 {
        self.emitted + self.reflectance * self.irradiance * FRAC_1_PI
    }

    /// Irradiance can be told apart from what is multiplied by it, and from what other surfaces have.
    pub fn is_matt(&self) -> bool {
        self.reflectance != Vec3::ZERO && self.normal != Vec3::ZERO
    }
}

/// Rec. 709.
pub(super) fn luminance(colour: Vec3) -> f32 {
    colour.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// Where a point lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Place {
    /// In the scene.
    Near(Vec3),
    /// Infinitely far, in this direction.
    Far(Vec3),
}

/// How fast a point gets out of date: the renderer's hint (section 4.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Hint {
    #[default]
    Matt,
    /// Its light depends on where the eye is.
    Specular,
}

impl Hint {
    /// Such points age so many times as fast.
    pub fn speed(self) -> u8 {
        match self {
            Self::Matt => 1,
            Self::Specular => 4,
        }
    }
}

/// What a sample was taken with, but for the state of the world: asked again, it is the same bits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Origin {
    pub address: Address,
    /// Light set and frame.
    pub set: u16,
    pub frame: u32,
    pub revision: u32,
}

/// What samples have told of a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(64))]
pub(super) struct Sampled {
    /// Their mean.
    pub light: Light,
    /// The state of the world that it is known to be of.
    pub revision: u32,
    /// How many there are in the mean; 0 if light has changed since.
    pub count: u8,
    pub hint: Hint,
}

/// All about a point but where it lies and how old it is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Known {
    /// `None`: of the sky, or of a still picture.
    pub name: Option<SurfacePoint>,
    pub sampled: Sampled,
    /// The last sample, and how it can be had again; `None`: it cannot.
    pub last: Option<(Vec3, Origin)>,
}

/// How a point is found again, and which of the points of its slot it is. A line of the processor's memory, as
/// [`Sampled`] is: they are touched here and there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(64))]
pub(super) struct Traced {
    /// As in [`Known`].
    pub name: Option<SurfacePoint>,
    /// As in [`Known`].
    pub last: Option<(Vec3, Origin)>,
    pub serial: u32,
}
