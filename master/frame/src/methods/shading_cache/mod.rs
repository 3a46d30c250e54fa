//! The Shading Cache of Tole, Pellacini, Walter and Greenberg (*Interactive Global Illumination in Dynamic Scenes*, 2002).
//!
//! **Idea.** Light is kept at the vertices of a mesh on the surfaces themselves, and interpolated. Geometry, textures and what
//! shines are exact in every picture; only light is coarse, and is made finer where a picture needs it. So moving the camera
//! asks nobody anything, and few samples go a long way: a wall has a few, the edge of a shadow many.
//!
//! ```text
//! camera ─► visibility ─► patch of each pixel ─► interpolated light × exact colour ─► picture
//!                              │
//!                              └─► priorities ─► hit and test, flood fill ─► vertices ─► workers
//!                                                          (new, old, or of divided patches)
//! ```
//!
//! * **Mesh** (`mesh`): a quad-tree on each side of each triangle, made when it is first seen. Of matt surfaces it keeps
//!   irradiance, of all others the radiance towards the eye.
//! * **Visibility** ([`crate::parts::raster`]): the master's own. The paper's display hardware drew patches; here the triangles
//!   are drawn and patches looked up, so that a picture costs the same however fine they are.
//! * **Selection** (`worth`, `select`): a patch is worth what its vertices differ by, in display codes, and its age if the eye or
//!   light has moved since. Pixels are drawn at random and taken by that probability, some whatever they are worth; what is
//!   around them and worth as much is taken as well.
//! * **Noise** (`noise`): vertices know how far their light sets are apart. What differs by no more is lit by more sets, not
//!   divided, and until then shown smoothed.
//! * **Hidden vertices** (`hidden`) are shown as those beside them that can be seen.
//! * **Seams** (`lit`): what lies beside finer patches is shown as divided like them.
//! * **Guesses** (`cells`): what was never lit looks like what is around it, by object, direction and place; so that triangles
//!   smaller than pixels need no sample each, which the paper's did.
//! * **From rest** (`seed`): the still picture becomes light at vertices.
//! * **Motion**: what has moved is where it is at once. Vertices that are found to be lit otherwise make their object age; if
//!   more of it is in sight than can be renewed in the clean-up time, its patches are joined.
//!
//! **Renderer.** Vertices are lit by the estimator of another method, all by the same light sets and the same random numbers,
//! and that method draws whatever does not move: at rest the picture is that method's to the bit, and files are drawn by it
//! alone.
//!
//! **Beyond the paper** (`--preset paper` switches it off): curvature instead of contrast; noise is told from both; what is right
//! is left to chance; small triangles are lit where they are seen, larger ones tested once in their middle; all is doubted
//! after an edit; glossy surfaces are kept without their colour; seams between patches of unequal size are closed.
//!
//! **Promise.** A picture is a function of inputs and of how many batches went into each picture, whoever answered.
//!
//! **Knobs** (`settings`). `--points` imposes a number of samples a picture, as slow renderers do. `--sets` trades noise for
//! detail. `--clean-up` trades detail for delay when light changes.
//!
//! **When it is bad.** Where triangles are smaller than pixels: most of their light is a guess. For mirrors and
//! glass, whose images are kept as if they were painted on them, and are coarse while the eye moves. Light and shadow leak
//! between vertices until patches are small enough.

mod asking;
mod cache;
mod cells;
mod hidden;
mod improve;
mod lit;
mod memory;
mod mesh;
mod noise;
mod seed;
mod select;
mod settings;
mod sight;
#[cfg(test)]
mod tests;
mod worth;

use protocol::answer::Fields;
use protocol::question::Quality;
use scenes::{Camera, Scene};

use super::at_once::{AtOnce, Tables};
use crate::front_end::{FrontEnd, Interactive, Knob, Layer, Method, NoCheckpoint, Preset, Settings, View};
use cache::Cache;

/// The method, over a renderer: see the module's documentation.
#[derive(Clone, Copy)]
pub struct ShadingCache {
    /// Draws whatever does not move.
    pub renderer: &'static dyn Method,
    /// The renderer's estimator, as its knobs say.
    pub quality: fn(&Settings) -> Quality,
    /// [`tables`] of the renderer, made once.
    pub tables: fn() -> &'static Tables,
}

/// What each pixel sees, is worth and was, while a picture is made; and what a patch takes with its share of vertices.
const BYTES_PER_PIXEL: u64 = 120;
const BYTES_PER_PATCH: u64 = 100;

/// What can be set and looked at with this cache over a renderer.
pub fn tables(renderer: &dyn Method) -> Tables {
    Tables::over(renderer, &settings::KNOBS, &settings::LAYERS)
}

impl Method for ShadingCache {
    fn name(&self) -> &'static str {
        "shading-cache"
    }

    fn about(&self) -> &'static str {
        "light at the vertices of patches, finer where pictures need it (Tole et al. 2002)"
    }

    fn knobs(&self) -> &'static [Knob] {
        &(self.tables)().knobs
    }

    fn presets(&self) -> &'static [Preset] {
        settings::PRESETS
    }

    fn layers(&self) -> &'static [Layer] {
        &(self.tables)().layers
    }

    fn check(&self, settings: &Settings) -> Result<(), String> {
        self.renderer.check(settings)
    }

    fn memory_bytes(&self, settings: &Settings, camera: &Camera, fields: Fields) -> u64 {
        let pixels = u64::from(camera.width) * u64::from(camera.height);
        // Patches are about as many as pixels, when all is as fine as can be seen.
        let own = pixels * (BYTES_PER_PIXEL + 4 * BYTES_PER_PATCH / 3);
        self.renderer.memory_bytes(settings, camera, fields) + own
    }

    fn begin(&self, settings: &Settings, view: &View) -> Box<dyn FrontEnd> {
        self.renderer.begin(settings, view)
    }

    fn resume(&self, settings: &Settings, view: &View, kept: &[u8]) -> Result<Box<dyn FrontEnd>, NoCheckpoint> {
        self.renderer.resume(settings, view, kept)
    }

    fn interactive(&self, settings: &Settings, first_ticket: u32) -> Box<dyn Interactive> {
        Box::new(AtOnce::new(Cache::new(self.quality, settings), self.renderer, settings, first_ticket))
    }

    fn samples_per_frame(&self) -> u32 {
        self.renderer.samples_per_frame()
    }

    fn is_filtered(&self, settings: &Settings) -> bool {
        self.renderer.is_filtered(settings)
    }

    fn expected_slope(&self, settings: &Settings) -> f64 {
        self.renderer.expected_slope(settings)
    }

    fn misses(&self, scene: &Scene) -> Option<String> {
        self.renderer.misses(scene)
    }
}
