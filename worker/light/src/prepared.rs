//! A scene made ready for questions: ray structure, lights, aims, and what can be left out.

use std::sync::Arc;

use glam::Vec3;
use protocol::question::{Quality, Scramble};
use scenes::change::Refused;
use scenes::{Change, Needs, Scene};

use crate::bvh::{Ray, World};
use crate::emitter::Emitters;
use crate::sample::{Sequence, Stage};
use crate::targets::Targets;
use crate::vpl::{Shape, Vpl};
use crate::walk::LightPath;

/// All that a worker computes once per world and revision; shared by its threads.
pub struct Prepared {
    /// The scene itself.
    pub scene: Arc<Scene>,
    /// What it uses.
    pub needs: Needs,
    /// Finds what rays hit.
    pub world: World,
    /// What shines.
    pub emitters: Emitters,
    /// Where caustics come from; empty unless needed.
    pub targets: Targets,
    /// Diagonal of the bounding box of all visible objects; the unit of bounds and photon radii.
    pub diameter: f32,
    pilot: Pilot,
}

/// How many light paths make the asked number of virtual lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WalkPlan {
    /// Paths per set, at least 1.
    pub paths: u32,
    /// Probability that a vertex becomes a virtual light, in (0, 1].
    pub acceptance: f32,
}

/// Virtual lights per path, measured once.
#[derive(Clone, Debug, Default)]
struct Pilot {
    /// Mean number of VPLs of each depth 1, 2, … per path; the last entry holds all deeper ones.
    by_depth: Vec<f32>,
}

const PILOT_PATHS: u32 = 512;
const PILOT_DEPTHS: usize = 64;
/// Bounds the pilot in stiff scenes, where one path leaves thousands of lights.
const PILOT_VPLS: u32 = 50_000;

impl Prepared {
    /// Builds everything from scratch.
    pub fn new(scene: impl Into<Arc<Scene>>) -> Self {
        let scene = scene.into();
        let world = World::build(&scene);
        Self::around(scene, world)
    }

    /// Applies an edit: rebuilds what depends on it and nothing else.
    ///
    /// # Errors
    /// [`Refused`] if the scene has no such thing; then nothing has changed.
    pub fn apply(&mut self, change: &Change) -> Result<(), Refused> {
        let mut scene = std::mem::take(&mut self.scene);
        let outcome = change.apply(Arc::make_mut(&mut scene));
        self.scene = scene;
        outcome?;
        match change {
            Change::Camera(_) => {}
            Change::Transform { .. } | Change::Visible { .. } | Change::Time(_) => {
                self.world.rebuild_top(&self.scene);
                self.refresh();
            }
            Change::Material { .. } => {
                // Whether a triangle has holes is part of the ray structure.
                let alpha_before = self.needs.alpha;
                if alpha_before > 0 || Needs::of(&self.scene).alpha > 0 {
                    self.world = World::build(&self.scene);
                }
                self.refresh();
            }
            Change::Light { .. } => self.refresh(),
        }
        Ok(())
    }

    fn around(scene: Arc<Scene>, world: World) -> Self {
        let mut prepared = Self {
            scene,
            needs: Needs::default(),
            world,
            emitters: Emitters::default(),
            targets: Targets::default(),
            diameter: 0.0,
            pilot: Pilot::default(),
        };
        prepared.refresh();
        prepared
    }

    /// Recomputes all that follows from scene and ray structure.
    fn refresh(&mut self) {
        self.needs = Needs::of(&self.scene);
        let bounds = self.world.bounds();
        let (centre, diameter) = if self.needs.triangles > 0 {
            ((bounds.min + bounds.max) * 0.5, (bounds.max - bounds.min).length())
        } else {
            (Vec3::ZERO, 1.0)
        };
        self.diameter = if diameter > 0.0 { diameter } else { 1.0 };
        self.emitters = Emitters::new(&self.scene, centre, self.diameter * 0.5);
        self.targets = if self.needs.light() { Targets::new(&self.scene) } else { Targets::default() };
        self.pilot = Pilot::default();
        if self.needs.diffuse > 0 && !self.emitters.is_empty() {
            self.pilot = self.fly();
        }
    }

    /// Number of paths, and which share of their vertices to keep, for about `quality.vpls` lights.
    ///
    /// Powers of two are preferred, since blocks of so many quasi-random points are nets; and at least
    /// a quarter as many paths as lights, so that in a white room not all lights lie on one path.
    pub fn walk_plan(&self, quality: &Quality) -> WalkPlan {
        let wanted = f32::from(quality.vpls.max(1));
        let per_path = self.pilot.mean(quality.max_length).max(1e-3);
        let paths = (wanted / per_path).clamp((wanted / 4.0).max(1.0), 16.0 * wanted);
        let paths = libm::exp2f(libm::roundf(libm::log2f(paths))).max(1.0);
        WalkPlan { paths: paths as u32, acceptance: (wanted / (paths * per_path)).min(1.0) }
    }

    /// Whether a point off its surface sees a virtual light. The same arithmetic as the shafts'.
    pub fn sees(&self, vpl: &Vpl, place: Vec3) -> bool {
        match vpl.shape {
            Shape::Distant => {
                !self.world.occluded_along(&Ray { origin: place, direction: vpl.normal, t_max: f32::INFINITY })
            }
            _ => !self.world.occluded(vpl.position, place),
        }
    }

    fn fly(&self) -> Pilot {
        let sequence = Sequence::new(0, Stage::Pilot, [0; 3], Scramble::Owen);
        let mut counts = vec![0_u32; PILOT_DEPTHS];
        let (mut paths, mut vpls) = (0, 0);
        while paths < PILOT_PATHS && vpls < PILOT_VPLS {
            let mut path = LightPath::start(self, &sequence, paths);
            while let Some(vpl) = path.next_vpl(self, None) {
                counts[(usize::from(vpl.depth) - 1).min(PILOT_DEPTHS - 1)] += 1;
                vpls += 1;
            }
            paths += 1;
        }
        Pilot { by_depth: counts.iter().map(|c| *c as f32 / paths as f32).collect() }
    }
}

impl Pilot {
    fn mean(&self, max_length: Option<u8>) -> f32 {
        let depths = max_length.map_or(PILOT_DEPTHS, usize::from).min(self.by_depth.len());
        self.by_depth[..depths].iter().sum()
    }
}
