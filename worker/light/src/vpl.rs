//! Virtual point lights: where light left an emitter or a diffuse surface (IGI-2).

use std::f32::consts::PI;

use glam::Vec3;
use protocol::question::Bound;
use scenes::Rgb;

use crate::glossy::Glossy;
use crate::luminaire::Luminaire;

/// A point that stands for light arriving from its surroundings.
#[derive(Clone, Debug, PartialEq)]
pub struct Vpl {
    /// Already off its surface; for [`Shape::Distant`] unused.
    pub position: Vec3,
    /// Unit geometric normal on the lit side; for [`Shape::Distant`] towards the light.
    pub normal: Vec3,
    /// W·sr⁻¹ along the normal (radiance × area); for [`Shape::Distant`] irradiance, W·m⁻².
    pub strength: Rgb,
    /// How it shines.
    pub shape: Shape,
    /// Number of surface vertices on its light path, itself included; 0 on lights.
    pub depth: u16,
    /// Which of the scene's sources its light comes from ([`crate::emitter::Emitters::len`] counts them).
    pub source: u32,
    /// Of a point on an emitter or the sky, the density with which chance chose it: per unit area of one side, or sr⁻¹.
    /// `None` on lights without surface, which no ray can meet, and on surfaces.
    pub density: Option<f32>,
}

/// How a virtual light shines.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// `strength · cosθ` on one side: emitters and diffuse surfaces. The only gated kind, since it
    /// stands for an area that other rays can meet.
    Surface,
    /// Like `Surface`, but scattered by a glossy material: `strength` is flux here, the material
    /// says where it goes.
    Glossy {
        /// The material.
        material: Glossy,
        /// Unit direction back to where the light came from.
        from: Vec3,
        /// Unit shading normal on the lit side.
        shading: Vec3,
    },
    /// The same in all directions.
    Point,
    /// Within a cone.
    Spot {
        /// Unit.
        axis: Vec3,
        /// cos where the fall-off begins.
        cos_inner: f32,
        /// cos where it ends.
        cos_outer: f32,
    },
    /// As a photometric web says: `strength` is where that is 1.
    Luminaire(Luminaire),
    /// Parallel rays from `normal`.
    Distant,
}

/// A gate in scene units: `G' = G·g` (B1).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Gate {
    /// g = 1.
    #[default]
    Open,
    /// G' = cos cos / max(d², d_min²).
    Clip {
        /// d_min².
        least: f32,
    },
    /// G' = min(G, b).
    Bound {
        /// b = 1/d_min², length⁻².
        most: f32,
    },
    /// G' = G · smoothstep(0.8 m², 1.2 m², d²).
    Smooth {
        /// m².
        middle: f32,
    },
}

/// The gates on emitters and on virtual lights proper.
///
/// A point on an emitter stands for a small, bright area that is sampled densely; one on a wall for a
/// large, dim one. So emitters are gated [`EMITTERS_CLOSER`] times closer: their compensation would be a rare
/// ray that meets something very bright. (Any gate is exact with compensation, B1.)
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gates {
    /// For lights of depth 0.
    pub emitters: Gate,
    /// For all others.
    pub surfaces: Gate,
}

/// How much closer emitters are gated, but for the paper's clipping, which treats all alike.
pub const EMITTERS_CLOSER: f32 = 8.0;

impl Gates {
    /// The gates of a bound where light has the given extent ([`crate::importance::Importance::extent`]).
    pub fn new(bound: Bound, extent: f32) -> Self {
        let surfaces = Gate::new(bound, extent);
        let emitters = match bound {
            Bound::None | Bound::Clip { .. } => surfaces,
            Bound::Geometry { .. } | Bound::Smooth { .. } => Gate::new(bound, extent / EMITTERS_CLOSER),
        };
        Self { emitters, surfaces }
    }

    /// The gate on a virtual light.
    pub fn of(&self, vpl: &Vpl) -> Gate {
        if vpl.depth == 0 { self.emitters } else { self.surfaces }
    }

    /// The distance beyond which neither cuts anything off.
    pub fn reach(&self, cos: f32) -> f32 {
        self.emitters.reach(cos).max(self.surfaces.reach(cos))
    }

    /// Nothing is ever cut off.
    pub fn are_open(&self) -> bool {
        self.emitters == Gate::Open && self.surfaces == Gate::Open
    }
}

impl Gate {
    /// The gate of a bound where light has the given extent.
    pub fn new(bound: Bound, extent: f32) -> Self {
        let square = |fraction: f32| (fraction * extent) * (fraction * extent);
        match bound {
            Bound::None => Self::Open,
            Bound::Clip { distance } => Self::Clip { least: square(distance) },
            Bound::Geometry { distance } => Self::Bound { most: 1.0 / square(distance) },
            Bound::Smooth { distance } => Self::Smooth { middle: square(distance) },
        }
    }

    /// The gated geometry term; `cosines` is the product cosθ_x cosθ_y ≥ 0, `d2` > 0.
    #[inline(always)]
    pub fn geometry(self, cosines: f32, d2: f32) -> f32 {
        match self {
            Self::Open => cosines / d2,
            Self::Clip { least } => cosines / d2.max(least),
            Self::Bound { most } => (cosines / d2).min(most),
            Self::Smooth { middle } => cosines / d2 * step(middle, d2),
        }
    }

    /// 1 − g, for the compensation; 0 beyond [`Self::reach`].
    pub fn compensation(self, cosines: f32, d2: f32) -> f32 {
        match self {
            Self::Open => 0.0,
            Self::Clip { least } => 1.0 - (d2 / least).min(1.0),
            Self::Bound { most } => 1.0 - (most * d2 / cosines).min(1.0),
            Self::Smooth { middle } => 1.0 - step(middle, d2),
        }
    }

    /// The distance beyond which g = 1 for all surfaces met at cosine `cos` here.
    pub fn reach(self, cos: f32) -> f32 {
        match self {
            Self::Open => 0.0,
            Self::Clip { least } => least.sqrt(),
            Self::Bound { most } => (cos / most).sqrt(),
            Self::Smooth { middle } => (1.2 * middle).sqrt(),
        }
    }
}

/// IC-2's smoothstep on squared distance.
#[inline(always)]
fn step(middle: f32, d2: f32) -> f32 {
    let u = ((d2 - 0.8 * middle) / (0.4 * middle)).clamp(0.0, 1.0);
    u * u * (3.0 - 2.0 * u)
}

impl Vpl {
    /// A light without surface (point, spot, directional): only virtual lights and photons find it, never a ray.
    pub fn is_bodiless(&self) -> bool {
        self.depth == 0 && self.density.is_none()
    }

    /// It shines from afar, in parallel rays.
    pub fn is_distant(&self) -> bool {
        self.shape == Shape::Distant
    }

    /// Unit direction towards it from a place; none if it is there.
    pub fn towards(&self, at: Vec3) -> Vec3 {
        if self.shape == Shape::Distant { self.normal } else { (self.position - at).normalize_or_zero() }
    }

    /// Unoccluded irradiance at a point with a unit shading normal: `strength · cosθ_y · cosθ_x / d²`,
    /// gated; and the unit direction towards the light.
    pub fn irradiance(&self, at: Vec3, normal: Vec3, gate: Gate) -> (Rgb, Vec3) {
        if self.shape == Shape::Distant {
            return (self.strength * normal.dot(self.normal).max(0.0), self.normal);
        }
        let offset = self.position - at;
        let d2 = offset.length_squared();
        if d2 <= tiny(at, self.position) {
            return (Vec3::ZERO, normal);
        }
        let to_light = offset / d2.sqrt();
        let cos_x = normal.dot(to_light).max(0.0);
        let irradiance = match &self.shape {
            Shape::Distant => Vec3::ZERO,
            Shape::Surface => {
                let cos_y = (-self.normal.dot(to_light)).max(0.0);
                self.strength * gate.geometry(cos_x * cos_y, d2)
            }
            Shape::Glossy { material, from, shading } => {
                let cos_y = (-self.normal.dot(to_light)).max(0.0);
                let f = scattered(material, *shading, -to_light, *from);
                self.strength * f * gate.geometry(cos_x * cos_y, d2)
            }
            Shape::Point => self.strength * (cos_x / d2),
            Shape::Spot { axis, cos_inner, cos_outer } => {
                self.strength * (spot(*cos_inner, *cos_outer, -axis.dot(to_light)) * cos_x / d2)
            }
            Shape::Luminaire(_) if cos_x == 0.0 => Vec3::ZERO,
            Shape::Luminaire(lamp) => self.strength * (lamp.relative(-to_light) * cos_x / d2),
        };
        (irradiance, to_light)
    }

    /// Intensity in a direction away from the light, W·sr⁻¹.
    pub fn intensity(&self, direction: Vec3) -> Rgb {
        match &self.shape {
            Shape::Surface => self.strength * self.normal.dot(direction).max(0.0),
            Shape::Glossy { material, from, shading } => {
                self.strength * scattered(material, *shading, direction, *from) * self.normal.dot(direction).max(0.0)
            }
            Shape::Point => self.strength,
            Shape::Spot { axis, cos_inner, cos_outer } => {
                self.strength * spot(*cos_inner, *cos_outer, axis.dot(direction))
            }
            Shape::Luminaire(lamp) => self.strength * lamp.relative(direction),
            Shape::Distant => Vec3::ZERO,
        }
    }

    /// Flux it emits in all, W (the lobe of a glossy one aside).
    pub fn flux(&self) -> Rgb {
        match &self.shape {
            Shape::Surface => self.strength * PI,
            Shape::Glossy { .. } => self.strength,
            Shape::Point => self.strength * (4.0 * PI),
            // ∫ of the squared ramp over the cone
            Shape::Spot { cos_inner, cos_outer, .. } => {
                self.strength * (2.0 * PI * ((1.0 - cos_inner) + (cos_inner - cos_outer) / 3.0))
            }
            Shape::Luminaire(lamp) => self.strength * lamp.solid_angle(),
            Shape::Distant => Vec3::ZERO,
        }
    }
}

/// The part of a glossy BSDF that virtual lights carry: the base, and the lobe if it is rough.
pub fn scattered(material: &Glossy, n: Vec3, to: Vec3, from: Vec3) -> Rgb {
    let (cos_o, cos_i) = (n.dot(to), n.dot(from));
    if cos_o <= 0.0 || cos_i <= 0.0 {
        return Vec3::ZERO;
    }
    let base = material.base(cos_o, cos_i);
    if material.is_sharp() { base } else { base + material.lobe(n, to, from) }
}

/// KHR_lights_punctual's ramp, squared.
fn spot(cos_inner: f32, cos_outer: f32, cos: f32) -> f32 {
    let t = ((cos - cos_outer) / (cos_inner - cos_outer).max(1e-6)).clamp(0.0, 1.0);
    t * t
}

/// How far apart rounding may carry what is one point: 8 units in the last place of the largest coordinate.
#[inline(always)]
pub fn blur(at: Vec3) -> f32 {
    at.abs().max_element() * (8.0 * f32::EPSILON)
}

/// Squared distance below which two points are one: the greater [`blur`] of the two.
#[inline(always)]
pub fn tiny(a: Vec3, b: Vec3) -> f32 {
    let reach = blur(a).max(blur(b));
    reach * reach
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gate_and_compensation_make_one() {
        for bound in [
            Bound::Clip { distance: 0.1 },
            Bound::Geometry { distance: 0.1 },
            Bound::Smooth { distance: 0.1 },
            Bound::None,
        ] {
            let gate = Gate::new(bound, 10.0);
            for cosines in [0.01_f32, 0.3, 1.0] {
                for d in [0.01_f32, 0.5, 0.95, 1.05, 3.0] {
                    let (d2, g) = (d * d, cosines / (d * d));
                    let sum = gate.geometry(cosines, d2) / g + gate.compensation(cosines, d2);
                    assert!((sum - 1.0).abs() < 1e-5, "{bound:?} cos² {cosines} d {d}: {sum}");
                    if d > gate.reach(1.0) {
                        assert!(gate.compensation(cosines, d2).abs() < 1e-5);
                    }
                }
            }
        }
    }

    #[test]
    fn a_light_on_the_point_gives_nothing_and_no_nan() {
        let vpl = Vpl {
            position: Vec3::ONE,
            normal: Vec3::Z,
            strength: Vec3::ONE,
            shape: Shape::Surface,
            depth: 0,
            source: 0,
            density: None,
        };
        for d in [0.0_f32, 1e-7, 1e-6, 1e-4] {
            let (e, _) = vpl.irradiance(Vec3::ONE + Vec3::new(0.0, 0.0, d), -Vec3::Z, Gate::Open);
            assert!(e.is_finite() && e.min_element() >= 0.0);
        }
    }
}
