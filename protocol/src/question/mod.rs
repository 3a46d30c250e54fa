//! What a master may ask. A question carries all it needs: nothing is implied, so anyone who has
//! the world it names gives the same answer, bit for bit.

mod frames;
mod points;

use std::fmt;
use std::sync::Arc;

use scenes::Camera;
use serde::{Deserialize, Serialize};

pub use frames::{FRAMES_MAX, Frames};
pub use points::{
    Address, BLOCK, GROUPS_MAX, PAIRS_MAX, POINTS_MAX, Part, Point, Points, QUESTION_MICROS, Ray, Rays, Unfit,
    points_per_question,
};

/// Most photons that a light set may have.
pub const PHOTONS_MAX: u32 = 1 << 24;

/// A question about light in one state of one world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Question {
    /// Which world.
    pub world: WorldState,
    /// What about it.
    pub ask: Ask,
}

/// The number by which whoever asked a question knows its answer: which of the batches it asks, and which question of
/// the batch. It never leaves the master, and changes no answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Ticket {
    /// Number of the batch, never used again by the same front end.
    pub batch: u32,
    /// Number of the question within the batch.
    pub slot: u32,
}

/// A question on its way through the master: shared by all who hold it, never copied.
#[derive(Clone, Debug, PartialEq)]
pub struct Asked {
    /// Comes back with the answer.
    pub ticket: Ticket,
    /// What is asked.
    pub question: Arc<Question>,
}

impl Asked {
    /// A question and the number to give back with its answer.
    pub fn new(ticket: Ticket, question: Question) -> Self {
        Self { ticket, question: Arc::new(question) }
    }
}

/// A world by content, and how often it has been edited since.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct WorldState {
    /// SHA-256 of the scene's manifest.
    pub world: [u8; 32],
    /// Number of changes applied to it.
    pub revision: u32,
}

/// The kinds of question.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Ask {
    /// The interleaved pixels of one light set within a rectangle.
    Tile(Tile),
    /// The same in several frames, added up.
    Frames(Frames),
    /// Path-traced samples of all pixels of a rectangle.
    Reference(Samples),
    /// Where the virtual lights of a set lie, for people who want to see them.
    Lights(Lights),
    /// What single rays meet.
    Rays(Rays),
    /// The light at single points of surfaces.
    Points(Points),
}

impl Ask {
    /// Number of pixels, rays or points that the answer is about.
    pub fn len(&self) -> usize {
        match self {
            Self::Tile(tile) | Self::Frames(Frames { tile, .. }) => tile.grid().len(),
            Self::Reference(samples) => samples.rect.len(),
            Self::Lights(_) => 0,
            Self::Rays(rays) => rays.through.len(),
            Self::Points(points) => points.at.len(),
        }
    }

    /// The tile, in its first frame, if it is about one.
    pub fn tile(&self) -> Option<&Tile> {
        match self {
            Self::Tile(tile) | Self::Frames(Frames { tile, .. }) => Some(tile),
            Self::Reference(_) | Self::Lights(_) | Self::Rays(_) | Self::Points(_) => None,
        }
    }

    /// Number of frames that it is about.
    pub fn frames(&self) -> u32 {
        if let Self::Frames(Frames { count, .. }) = self { u32::from(*count) } else { 1 }
    }

    /// It is about no pixel.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// For people.
impl fmt::Display for Ask {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tile(Tile { rect, lit, .. }) => write!(f, "{rect} ({lit})"),
            Self::Frames(Frames { tile: Tile { rect, lit, .. }, count }) => {
                write!(f, "{rect} ({lit}, and {count} frames from there)")
            }
            Self::Reference(samples) => write!(f, "{} (samples from {} on)", samples.rect, samples.first),
            Self::Lights(Lights { lit, .. }) => write!(f, "the virtual lights of {lit}"),
            Self::Rays(Rays { through, lit, .. }) => write!(f, "{} rays ({lit})", through.len()),
            Self::Points(Points { at, lit, .. }) => write!(f, "{} points ({lit})", at.len()),
        }
    }
}

/// The pixels of `rect` that light set `set` serves in `frame` (IGI-5, IGI-6).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tile {
    /// Camera and picture size.
    pub camera: Camera,
    /// Part of the picture.
    pub rect: Rect,
    /// By which light; eye paths take their numbers from the same frame.
    pub lit: Lit,
}

/// A light set: the one that its tiles are lit by.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lights {
    /// Camera and picture size: lights are chosen by what they bring to it.
    pub camera: Camera,
    /// Which.
    pub lit: Lit,
}

/// By which light something is lit: one light set, the same for all pixels, rays or points of a question.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lit {
    /// Light set id k, `0 ≤ k < n·m`.
    pub set: u16,
    /// Number of the frame since accumulation began.
    pub frame: u32,
    /// All randomness is a pure function of this seed, the numbers above, and where in the picture it is used.
    pub seed: u64,
    /// How much work, and which estimator.
    pub quality: Quality,
}

/// For people.
impl fmt::Display for Lit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "light set {} of frame {}", self.set, self.frame)
    }
}

/// Samples `first .. first + count` of every pixel of `rect`, each the radiance along one path from
/// the eye, scattered until roulette ends it. A sample is a pure function of seed, pixel and number, so
/// any partition of pixels and numbers into questions gives the same samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Samples {
    /// Camera and picture size.
    pub camera: Camera,
    /// Part of the picture.
    pub rect: Rect,
    /// Number of the first sample.
    pub first: u32,
    /// How many samples a pixel; at least 1.
    pub count: u32,
    /// Different seeds give independent samples.
    pub seed: u64,
    /// Most reflections and refractions on a path: 0 shows emitters only, 1 adds direct light; `None` ends
    /// paths by roulette alone (no bias).
    pub max_bounces: Option<u32>,
}

/// A rectangle of pixels; `x`, `y` is its top left corner.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Rect {
    /// First column.
    pub x: u32,
    /// First row.
    pub y: u32,
    /// Columns; at least 1.
    pub width: u32,
    /// Rows; at least 1.
    pub height: u32,
}

impl Rect {
    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// There is no pixel in it.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Picture coordinates of all pixels, row by row.
    pub fn pixels(self) -> impl Iterator<Item = [u32; 2]> {
        (0..self.height).flat_map(move |row| (0..self.width).map(move |column| [self.x + column, self.y + row]))
    }
}

/// For people.
impl fmt::Display for Rect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { x, y, width, height } = self;
        write!(f, "the {width}x{height} pixels at {x},{y}")
    }
}

/// The knobs of the estimator: how much work, and what is left out. Presets:
/// [`Quality::default`] and [`Quality::paper`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// The n×m block of pixels that share no light set. More: better filtered pictures, more
    /// preprocessing. 1..=16 each.
    pub interleave: [u8; 2],
    /// Points on lights per set. More: softer and less noisy direct shadows; time grows in proportion.
    #[serde(alias = "lights")]
    pub light_samples: u16,
    /// Virtual point lights per set, about (the number of light paths is chosen so that this many
    /// are expected). More: smoother indirect light; time grows in proportion.
    pub vpls: u16,
    /// Most caustic photons shot per set, where a scene can have caustics; fewer where they are of little use. None: rays alone look for caustics, where
    /// [`Self::indirect_caustics`] are looked for.
    pub photons: u32,
    /// How a single virtual light is kept from burning out its surroundings.
    pub bound: Bound,
    /// Trace the ray that estimates what the bound cut off: no bias, a little more time (B1).
    #[serde(alias = "remainder")]
    pub bias_compensation: bool,
    /// Keep lights by what they bring to what the camera sees (B2): far fewer are wasted behind walls, for
    /// a few milliseconds of preprocessing per view.
    pub importance: bool,
    /// Longest light path, in vertices after the light: `None` ends paths by roulette alone (no bias).
    pub max_length: Option<u8>,
    /// Rays look for light off surfaces that then passes glass or mirrors (B6), and share that of emitters with photons:
    /// no missing light. Off: only light that comes straight from an emitter makes caustics, all by photons, as in the paper.
    pub indirect_caustics: bool,
    /// Radius of photon density estimation in the first frame, as a fraction of the extent of light.
    pub photon_radius: f32,
    /// Photon radius shrinks with the frame number, so that blur vanishes in the limit (B7).
    pub shrink_radius: bool,
    /// Randomisation of the Sobol' sequence.
    pub scramble: Scramble,
    /// What changes from frame to frame.
    pub motion: Motion,
    /// Independent replicates that take turns, for the error estimate; 1..=16.
    #[serde(alias = "randomisations")]
    pub replicates: u8,
    /// Illuminance is asked for: what the eye meets first counts as matt and white, whatever it is made of, so that its
    /// irradiance is what falls on it.
    #[serde(default)]
    pub illuminance: bool,
}

/// The gate g on each virtual light's contribution `f·V·G·g`, 0 ≤ g ≤ 1 (B1).
/// `distance` is a fraction of the extent of light: how far apart the places are that light comes from which matters to
/// what the camera sees, or to anything where none looks. In a closed room that is about its diagonal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Bound {
    /// g = 1: unbiased but spotted.
    None,
    /// The paper's: distances are clipped to a minimum, g = min(1, d²/d_min²).
    Clip {
        /// d_min over the extent of light.
        distance: f32,
    },
    /// Bound the geometry term: g = min(1, b/G), b = 1/d_min². Biases a subset of what clipping does.
    Geometry {
        /// d_min over the extent of light.
        distance: f32,
    },
    /// Smooth gate on squared distance between 0.8 m² and 1.2 m² (Instant Caching, IC-2).
    Smooth {
        /// m over the extent of light.
        distance: f32,
    },
}

/// How the Sobol' sequence is randomised (B8).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Scramble {
    /// Hashed Owen scrambling.
    Owen,
    /// XOR with a random word a dimension: the paper's.
    Xor,
}

/// What changes from frame to frame (B8, B5).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Motion {
    /// Nothing moves: pixels meet set after set, the sequence goes on.
    Still,
    /// Something moves: every frame uses the sets of frame 0, so that light does not flicker.
    Moving,
    /// The paper's: a fresh scramble each frame.
    Fresh,
}

impl Quality {
    /// The paper's settings (3×3 interleaving, 22 shadow rays, 500 photons, path length 4, XOR).
    pub fn paper() -> Self {
        Self {
            interleave: [3, 3],
            light_samples: 4,
            vpls: 18,
            photons: 500,
            bound: Bound::Clip { distance: 1.0 / 50.0 },
            bias_compensation: false,
            importance: false,
            max_length: Some(4),
            indirect_caustics: false,
            photon_radius: 1.0 / 100.0,
            shrink_radius: false,
            scramble: Scramble::Xor,
            motion: Motion::Fresh,
            replicates: 2,
            illuminance: false,
        }
    }

    /// Whether light sets of them can be made, in bounded memory.
    ///
    /// # Errors
    /// In words, what is out of range.
    pub fn check(&self) -> Result<(), &'static str> {
        let counts = |n: u8| (1..=16).contains(&n);
        let bound = match self.bound {
            Bound::None => 0.0,
            Bound::Clip { distance } | Bound::Geometry { distance } | Bound::Smooth { distance } => distance,
        };
        let rules = [
            (self.interleave.into_iter().all(counts), "an interleaving outside 1 … 16"),
            (counts(self.replicates), "a number of replicates outside 1 … 16"),
            (self.photons <= PHOTONS_MAX, "more than 16 million photons a set"),
            (self.photon_radius > 0.0 && self.photon_radius.is_finite(), "a photon radius that is not positive"),
            (self.max_length != Some(0), "light paths of length 0"),
            (bound >= 0.0 && bound.is_finite(), "a bound that is negative or not finite"),
        ];
        rules.into_iter().find(|(is_kept, _)| !is_kept).map_or(Ok(()), |(_, broken)| Err(broken))
    }

    /// Number of light sets, n·m.
    pub fn sets(&self) -> u16 {
        u16::from(self.interleave[0]) * u16::from(self.interleave[1])
    }

    /// Which light set a pixel uses in a frame (IGI-5, with the rotation of B8 when still).
    pub fn set_of(&self, x: u32, y: u32, frame: u32) -> u16 {
        let [n, m] = self.interleave.map(u32::from);
        let home = x % n + n * (y % m);
        ((home + self.rotation(frame)) % (n * m)) as u16
    }

    /// The pixel residue (x mod n, y mod m) that a set serves in a frame: inverse of [`Self::set_of`].
    pub fn residue_of(&self, set: u16, frame: u32) -> [u32; 2] {
        let [n, m] = self.interleave.map(u32::from);
        let home = (u32::from(set) + n * m - self.rotation(frame)) % (n * m);
        [home % n, home / n]
    }

    /// Which of the independent [`Self::replicates`] of the Sobol' sequence a frame uses: they take
    /// turns round by round, a round being the n·m frames in which a still pixel meets every set once.
    /// Estimates of different replicates are independent, so that their spread measures the error.
    pub fn replicate_of(&self, frame: u32) -> u8 {
        let count = u32::from(self.replicates.max(1));
        let turn = match self.motion {
            Motion::Still => frame / u32::from(self.sets()) % count,
            Motion::Fresh => frame % count,
            Motion::Moving => 0,
        };
        turn as u8
    }

    fn rotation(&self, frame: u32) -> u32 {
        match self.motion {
            Motion::Still => frame % u32::from(self.sets()),
            Motion::Moving | Motion::Fresh => 0,
        }
    }
}

impl Default for Quality {
    /// Converges to the true solution, and looks right from the first frame.
    fn default() -> Self {
        Self {
            interleave: [3, 3],
            light_samples: 8,
            vpls: 24,
            photons: 2000,
            bound: Bound::Geometry { distance: 1.0 / 10.0 },
            bias_compensation: true,
            importance: true,
            max_length: None,
            indirect_caustics: true,
            photon_radius: 1.0 / 150.0,
            shrink_radius: true,
            scramble: Scramble::Owen,
            motion: Motion::Still,
            replicates: 4,
            illuminance: false,
        }
    }
}

impl Tile {
    /// The light set that it is lit by.
    pub fn lights(&self) -> Lights {
        Lights { camera: self.camera, lit: self.lit }
    }

    /// The columns and rows of the picture that this tile asks for: `x = columns.start, + step, …`.
    pub fn grid(&self) -> Grid {
        let Lit { set, frame, quality, .. } = &self.lit;
        let [n, m] = quality.interleave.map(u32::from);
        let [i, j] = quality.residue_of(*set, *frame);
        let along = |start: u32, length: u32, step: u32, residue: u32| {
            let first = start + (residue + step - start % step) % step;
            (first, (start + length).saturating_sub(first).div_ceil(step))
        };
        let (x, columns) = along(self.rect.x, self.rect.width, n, i);
        let (y, rows) = along(self.rect.y, self.rect.height, m, j);
        Grid { x, y, step_x: n, step_y: m, columns, rows }
    }
}

/// A regular lattice of pixels; row by row, as answers list them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    /// First column of the picture.
    pub x: u32,
    /// First row of the picture.
    pub y: u32,
    /// Distance between columns, pixels.
    pub step_x: u32,
    /// Distance between rows, pixels.
    pub step_y: u32,
    /// How many columns; may be 0.
    pub columns: u32,
    /// How many rows; may be 0.
    pub rows: u32,
}

impl Grid {
    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.columns as usize * self.rows as usize
    }

    /// No pixel of the rectangle belongs to the set.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Picture coordinates of all pixels, row by row.
    pub fn pixels(self) -> impl Iterator<Item = [u32; 2]> {
        (0..self.rows).flat_map(move |row| {
            (0..self.columns).map(move |column| [self.x + column * self.step_x, self.y + row * self.step_y])
        })
    }
}
