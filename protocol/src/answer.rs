//! What a worker answers, before it is packed.

use glam::{DVec3, Vec3};
use scenes::{Absent, Rgb, Scene, SurfacePoint};

pub use crate::means::{Means, over_frames};

/// The answer to a question, with what it cost.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// What was asked for.
    pub body: Body,
    /// What it cost.
    pub cost: Cost,
}

/// What an answer says: each kind of [`crate::question::Ask`] has its own.
#[derive(Clone, Debug, PartialEq)]
pub enum Body {
    /// To a tile: one entry a pixel of its [`crate::question::Grid`], in its order.
    Pixels(Pixels),
    /// To a tile in several frames: one entry a pixel of its grid.
    Means(Means),
    /// To a question for reference samples: one entry a pixel of its rectangle, row by row.
    Moments(Moments),
    /// To a question for virtual lights: those that lie anywhere, in the order of their set.
    Lights(Vec<LightPoint>),
    /// To rays: one entry a ray, in the order of the question. To points that are seen by an eye: one a point.
    Seen(Seen),
    /// To points: [`crate::question::Part::irradiances`] of each, W·m⁻², point after point.
    Irradiance(Vec<Rgb>),
    /// To points and virtual lights.
    EachLight(EachLight),
}

/// Most virtual lights that one answer tells of.
pub const LIGHTS_MAX: usize = 1 << 14;

/// Where a virtual light lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightPoint {
    /// In the scene.
    pub position: Vec3,
    /// Unit normal of the surface it lies on; 0 where it lies on none.
    pub normal: Vec3,
    /// W·sr⁻¹ where it shines most (for one that a glossy material scatters: its flux, W).
    pub strength: Rgb,
    /// Surface vertices on its light path; 0 on emitters.
    pub depth: u16,
}

/// What rays meet.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Seen {
    /// What pixels these rays would make.
    pub pixels: Pixels,
    /// What each meets first; `None`: the sky. Of a ray with an aim it is the aim, to the bit, if the ray gets there.
    pub hits: Vec<Option<SurfacePoint>>,
}

/// What each virtual light of a range brings to each of some points, if it is not hidden.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EachLight {
    /// Virtual lights that the set has.
    pub of: u32,
    /// How many of them are told about: those that were asked for and exist.
    pub lights: u32,
    /// Unhidden irradiance, W·m⁻²: of the first point by each light, of the second …
    pub unhidden: Vec<Rgb>,
    /// Whether the point sees the light; false also where that brings nothing.
    pub visible: Vec<bool>,
}

/// Sums over the path-traced samples of each pixel. Never quantised: they are there to judge others by.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Moments {
    /// Σ L, radiance by channel.
    pub sum: Vec<DVec3>,
    /// Σ L², by channel.
    pub squares: Vec<DVec3>,
}

/// What the eye meets, pixel by pixel, as structure of arrays (IGI-7).
///
/// The radiance of a pixel is `emitted + reflectance · irradiance / π`. Everything in `emitted` is
/// shown as it is; only `irradiance` may be blurred between neighbours.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pixels {
    /// Radiance that must not be filtered: emitters seen directly, second branches, glossy lobes but those of rough metals.
    pub emitted: Vec<Rgb>,
    /// Product of all reflectances along the eye path, its end point's albedo included; 0 where the
    /// path ends on nothing diffuse. Of what lies under gloss, less what the gloss keeps from it.
    pub reflectance: Vec<Rgb>,
    /// Incident irradiance at the end point: lights, VPLs, caustics and what compensates the bias of bounds. Of a rough metal,
    /// weighed by direction as its lobe reflects it.
    pub irradiance: Vec<Rgb>,
    /// Unit normal at the end point, towards the eye, mirrored back through the mirrors on the way; 0
    /// where there is none.
    pub normal: Vec<Vec3>,
    /// Length of the eye path to the end point; 0 where there is none.
    pub distance: Vec<f32>,
}

/// Which parts of [`Pixels`] a scene can have at all; the others are 0 everywhere and stay home.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fields {
    /// [`Pixels::emitted`] can differ from 0.
    pub emitted: bool,
    /// Something can be seen and lit: the other four.
    pub surface: bool,
}

/// Counters, each declared beside what it counts; they add up over tiles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cost {
    /// Eye-path rays: primary, mirror and glass segments; all segments of a reference's paths.
    pub eye_rays: u64,
    /// Visibility tests between surface points and (virtual) lights.
    pub shadow_rays: u64,
    /// Light-path and photon-path segments, and the visibility tests that tell which virtual lights matter.
    pub light_rays: u64,
    /// Short rays that estimate what bounds cut off, and the shadow rays they ask for.
    pub compensation_rays: u64,
    /// Photon-map queries.
    pub photon_queries: u64,
    /// Samples that came out NaN or infinite and were dropped (should be 0).
    pub dropped: u64,
    /// Microseconds of a thread, by stage: see [`Cost::micros_of`] and [`Cost::spend`].
    pub micros: [u64; CostStage::ALL.len()],
}

/// What a worker's time is spent on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CostStage {
    /// Eye paths: what each pixel sees.
    Eye,
    /// Making light sets: walks from the lights.
    LightSets,
    /// Visibility of (virtual) lights.
    Shadows,
    /// Looking up photons.
    Photons,
    /// Rays for what bounds cut off.
    BiasCompensation,
    /// Packing and compressing the answer.
    Packing,
}

impl CostStage {
    /// All of them, in the order of [`Cost::micros`].
    pub const ALL: [Self; 6] =
        [Self::Eye, Self::LightSets, Self::Shadows, Self::Photons, Self::BiasCompensation, Self::Packing];

    /// For people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Eye => "eye",
            Self::LightSets => "light sets",
            Self::Shadows => "shadows",
            Self::Photons => "photons",
            Self::BiasCompensation => "bias compensation",
            Self::Packing => "packing",
        }
    }
}

impl Body {
    /// Number of pixels, rays or irradiances.
    pub fn len(&self) -> usize {
        match self {
            Self::Pixels(pixels) | Self::Seen(Seen { pixels, .. }) => pixels.len(),
            Self::Means(means) => means.len(),
            Self::Moments(moments) => moments.len(),
            Self::Irradiance(irradiance) => irradiance.len(),
            Self::Lights(_) => 0,
            Self::EachLight(each) => each.unhidden.len(),
        }
    }

    /// No pixel at all.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The pixels, if it answers a tile.
    pub fn pixels(self) -> Option<Pixels> {
        match self {
            Self::Pixels(pixels) => Some(pixels),
            _ => None,
        }
    }

    /// The means, if it answers a tile in several frames.
    pub fn means(self) -> Option<Means> {
        match self {
            Self::Means(means) => Some(means),
            _ => None,
        }
    }

    /// The sums, if it answers a question for reference samples.
    pub fn moments(self) -> Option<Moments> {
        match self {
            Self::Moments(moments) => Some(moments),
            _ => None,
        }
    }

    /// The lights, if it answers a question for them.
    pub fn lights(self) -> Option<Vec<LightPoint>> {
        match self {
            Self::Lights(lights) => Some(lights),
            _ => None,
        }
    }

    /// What rays met, if it answers rays, or points that are seen.
    pub fn seen(self) -> Option<Seen> {
        match self {
            Self::Seen(seen) => Some(seen),
            _ => None,
        }
    }

    /// The irradiances, if it answers a question for them.
    pub fn irradiance(self) -> Option<Vec<Rgb>> {
        match self {
            Self::Irradiance(irradiance) => Some(irradiance),
            _ => None,
        }
    }

    /// What each virtual light brings, if it answers a question for that.
    pub fn each_light(self) -> Option<EachLight> {
        match self {
            Self::EachLight(each) => Some(each),
            _ => None,
        }
    }

    /// Looks at an answer from elsewhere: all points that it names are in the scene, as far as edits leave it alone.
    ///
    /// # Errors
    /// [`Absent`] names the first that is not.
    pub fn check_in(&self, scene: &Scene) -> Result<(), Absent> {
        match self {
            Self::Seen(seen) => seen.hits.iter().flatten().try_for_each(|hit| scene.check_point(hit)),
            _ => Ok(()),
        }
    }
}

impl Moments {
    /// Room for `len` pixels without any sample.
    pub fn zero(len: usize) -> Self {
        Self { sum: vec![DVec3::ZERO; len], squares: vec![DVec3::ZERO; len] }
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.sum.len()
    }

    /// No pixel at all.
    pub fn is_empty(&self) -> bool {
        self.sum.is_empty()
    }
}

impl Pixels {
    /// Room for `len` pixels, all black.
    pub fn black(len: usize) -> Self {
        Self {
            emitted: vec![Vec3::ZERO; len],
            reflectance: vec![Vec3::ZERO; len],
            irradiance: vec![Vec3::ZERO; len],
            normal: vec![Vec3::ZERO; len],
            distance: vec![0.0; len],
        }
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.distance.len()
    }

    /// No pixel at all.
    pub fn is_empty(&self) -> bool {
        self.distance.is_empty()
    }

    /// Radiance of a pixel.
    pub fn radiance(&self, index: usize) -> Rgb {
        self.emitted[index] + self.reflectance[index] * self.irradiance[index] * std::f32::consts::FRAC_1_PI
    }
}

impl Fields {
    /// What the answer about a scene can contain.
    pub fn of(needs: &scenes::Needs) -> Self {
        let shines_visibly = needs.emissive_triangles > 0 || needs.environment;
        let branches = needs.glossy > 0 || needs.glass > 0;
        Self { emitted: shines_visibly || (branches && needs.light()), surface: needs.surfaces() && needs.light() }
    }
}

impl Cost {
    /// Microseconds of a thread spent on a stage.
    pub fn micros_of(&self, stage: CostStage) -> u64 {
        self.micros[stage as usize]
    }

    /// Adds time spent on a stage, microseconds.
    pub fn spend(&mut self, stage: CostStage, micros: u64) {
        self.micros[stage as usize] += micros;
    }

    /// Microseconds of a thread, all stages together.
    pub fn total_micros(&self) -> u64 {
        self.micros.iter().sum()
    }

    /// Name and microseconds of every stage.
    pub fn micros_by_stage(&self) -> [(&'static str, u64); CostStage::ALL.len()] {
        CostStage::ALL.map(|stage| (stage.name(), self.micros_of(stage)))
    }

    /// Name and seconds of every stage.
    pub fn seconds_by_stage(&self) -> [(&'static str, f64); CostStage::ALL.len()] {
        self.micros_by_stage().map(|(name, micros)| (name, micros as f64 / 1e6))
    }

    /// Rays, by kind.
    pub fn rays_by_kind(&self) -> [(&'static str, u64); 4] {
        [
            ("eye", self.eye_rays),
            ("shadow", self.shadow_rays),
            ("light", self.light_rays),
            ("compensation", self.compensation_rays),
        ]
    }

    /// Rays of all kinds.
    pub fn rays(&self) -> u64 {
        self.eye_rays + self.shadow_rays + self.light_rays + self.compensation_rays
    }
}

impl std::ops::AddAssign for Cost {
    fn add_assign(&mut self, other: Self) {
        self.eye_rays += other.eye_rays;
        self.shadow_rays += other.shadow_rays;
        self.light_rays += other.light_rays;
        self.compensation_rays += other.compensation_rays;
        self.photon_queries += other.photon_queries;
        self.dropped += other.dropped;
        for (mine, theirs) in self.micros.iter_mut().zip(other.micros) {
            *mine += theirs;
        }
    }
}
