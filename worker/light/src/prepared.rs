//! A scene made ready for questions: ray structure, lights, aims, and what can be left out.

use std::sync::{Arc, OnceLock};

use glam::Vec3;
use scenes::change::Refused;
use scenes::{Change, Keep, Needs, Rgb, Scene, SurfacePoint};

use crate::bvh::{Hit, Ray, World};
use crate::emitter::Emitters;
use crate::mirrors::Mirrors;
use crate::pilot;
use crate::points::Groups;
use crate::reference;
use crate::surface::{Around, Detail, Surfel};
use crate::targets::{Ball, Targets};
use crate::through_glass::Glass;
use crate::vpl::{Shape, Vpl};

/// Surfaces that are looked behind for glass that another lies in, at most.
const LAYERS_MAX: usize = 256;

/// All that a worker computes once per world and revision; shared by its threads.
pub struct Prepared {
    /// The scene itself.
    pub scene: Arc<Scene>,
    /// What it uses; or everything, where nothing is left out.
    pub needs: Needs,
    keep: Keep,
    /// Finds what rays hit.
    pub world: World,
    /// What shines.
    pub emitters: Emitters,
    /// Which emitters are judged together ([`pilot::classes`]).
    pub emitter_classes: Vec<u32>,
    /// Where caustics come from; empty unless needed.
    pub targets: Targets,
    /// What light samples are looked for through.
    pub glass: Glass,
    /// What light samples are seen in by lobes.
    pub mirrors: Mirrors,
    /// All clear glass, to send light paths through.
    pub panes: Targets,
    /// Encloses all visible objects: the bounding box's ball.
    pub ball: Ball,
    /// Made when first a reference is asked for.
    reference_emitters: OnceLock<reference::Emitters>,
    /// Made when first a question names groups.
    groups: OnceLock<Groups>,
}

impl Prepared {
    /// Builds everything from scratch, and leaves out what the scene does not need.
    pub fn new(scene: impl Into<Arc<Scene>>) -> Self {
        Self::keeping(scene, Keep::Needed)
    }

    /// As [`Self::new`]; with [`Keep::All`] every stage runs, which takes longer and changes no bit of any answer.
    pub fn keeping(scene: impl Into<Arc<Scene>>, keep: Keep) -> Self {
        let scene = scene.into();
        let mut prepared = Self {
            world: World::keeping(&scene, keep),
            scene,
            needs: Needs::default(),
            keep,
            emitters: Emitters::default(),
            emitter_classes: Vec::new(),
            targets: Targets::default(),
            glass: Glass::default(),
            mirrors: Mirrors::default(),
            panes: Targets::default(),
            ball: Ball::default(),
            reference_emitters: OnceLock::new(),
            groups: OnceLock::new(),
        };
        prepared.refresh();
        prepared
    }

    /// Applies an edit: rebuilds what depends on it and nothing else.
    ///
    /// # Errors
    /// [`Refused`] if the scene has no such thing; then nothing has changed.
    pub fn apply(&mut self, change: &Change) -> Result<(), Refused> {
        let coverage = |scene: &Scene| match change {
            Change::Material { material, .. } => scene.materials.get(*material as usize).and_then(|m| m.coverage),
            Change::OwnMaterial { object, piece, material, .. } => {
                let own = |piece| scene.own_material(*object, piece, *material);
                let shared = || scene.materials.get(*material as usize);
                own(*piece).or_else(|| own(None)).or_else(shared).and_then(|material| material.coverage)
            }
            _ => None,
        };
        let coverage_before = coverage(&self.scene);
        let mut scene = std::mem::take(&mut self.scene);
        let outcome = change.apply(Arc::make_mut(&mut scene));
        self.scene = scene;
        outcome?;
        match change {
            // A solid that no lamp has yet.
            Change::Camera(_) | Change::Solid { .. } => {}
            Change::Transform { .. }
            | Change::Visible { .. }
            | Change::Offset { .. }
            | Change::Time(_)
            | Change::PieceTransform { .. }
            | Change::PieceVisible { .. } => {
                self.world.rebuild_top(&self.scene);
                self.refresh();
            }
            Change::Material { material, .. } => {
                // What is there is all that the ray structure knows of materials.
                if coverage(&self.scene) != coverage_before {
                    self.world.rebuild_with(&self.scene, *material);
                }
                self.refresh();
            }
            Change::OwnMaterial { object, .. } => {
                match coverage(&self.scene) == coverage_before {
                    true => self.world.rebuild_top(&self.scene),
                    false => self.world.rebuild_object(&self.scene, *object),
                }
                self.refresh();
            }
            Change::Light { .. } | Change::Lamp { .. } | Change::Environment(_) => self.refresh(),
        }
        Ok(())
    }

    /// Bytes of what is made of the scene before the first question: ray structure and tables.
    pub fn bytes(&self) -> usize {
        let classes = size_of_val(&self.emitter_classes[..]);
        let balls = size_of_val(self.targets.balls()) + size_of_val(self.panes.balls());
        self.world.bytes() + self.emitters.bytes() + classes + balls
    }

    /// What shines, as the path tracer sees it.
    pub fn reference_emitters(&self) -> &reference::Emitters {
        self.reference_emitters.get_or_init(|| reference::Emitters::new(&self.scene))
    }

    /// Stages that turn out to have nothing to do may be skipped.
    pub fn may_skip(&self) -> bool {
        self.keep == Keep::Needed
    }

    /// The surface at a hit, in as much detail as the scene needs.
    pub fn surfel(&self, ray: &Ray, hit: &Hit) -> Surfel {
        let at = Surfel::at(&self.scene, ray, hit, self.detail());
        if !self.needs.nesting() {
            return at;
        }
        Surfel { around: self.around(&at), ..at }
    }

    /// What glass a surface lies in: a ray that leaves it by its outside first meets each solid that it lies in from within.
    /// So it depends on the place alone, and whoever comes there, by whichever way, finds the same.
    fn around(&self, at: &Surfel) -> Around {
        let minded = |at: &Surfel| self.scene.materials[at.material as usize].surface.glass().filter(|g| g.is_nested());
        let Some(own) = minded(at) else { return Around::default() };
        let outwards = if at.front { at.geometric } else { -at.geometric };
        let (mut met, mut best) = (vec![at.material], None);
        let mut origin = at.off(outwards);
        for _ in 0..LAYERS_MAX {
            let ray = Ray { origin, direction: outwards, t_max: f32::INFINITY };
            let Some(hit) = self.world.closest(&ray) else { break };
            let other = Surfel::at(&self.scene, &ray, &hit, self.detail());
            origin = other.off(outwards);
            let Some(glass) = minded(&other).filter(|_| !met.contains(&other.material)) else { continue };
            met.push(other.material);
            let rank = (glass.priority, u32::MAX - other.material);
            if !other.front && best.is_none_or(|(most, _)| rank > most) {
                best = Some((rank, glass));
            }
        }
        let Some((rank, glass)) = best else { return Around::default() };
        let outranks = rank > (own.priority, u32::MAX - at.material);
        Around { ior: glass.ior, absorption: glass.absorption, outranks }
    }

    /// The surface at a point which `object` has now, likewise.
    pub fn surfel_on(&self, object: u32, point: &SurfacePoint) -> Surfel {
        Surfel::on(&self.scene, object, point, self.detail())
    }

    fn detail(&self) -> Detail {
        let needs = &self.needs;
        Detail {
            uvs: needs.textured > 0,
            relief: needs.relief > 0,
            colours: needs.vertex_colours,
            places: needs.moved_objects > 0,
            chances: needs.glazed > 0,
        }
    }

    /// What absorbs light on the way from a surface in some direction, or on the way to it from there ([`Surfel::medium`]).
    pub fn medium(&self, at: &Surfel, towards: Vec3) -> Option<Rgb> {
        if self.needs.absorbing > 0 { at.medium(&self.scene, towards) } else { None }
    }

    /// What is left of light after a way of some length, which begins in a medium and comes to a surface (Beer & Lambert).
    /// Where only one end lies in glass, so does all of the way: things that stand in glass have no glass about them of
    /// their own.
    pub fn left(&self, begins: Option<Rgb>, at: &Surfel, incoming: Vec3, length: f32) -> Rgb {
        if self.needs.absorbing == 0 {
            return Vec3::ONE;
        }
        match (begins, at.medium(&self.scene, -incoming)) {
            (None, None) => Vec3::ONE,
            (Some(medium), None) | (None, Some(medium)) => beyond(medium, length),
            // The same from either end, even where two kinds of glass meet.
            (Some(one), Some(other)) => beyond((one + other) * 0.5, length),
        }
    }

    /// What shines, by groups.
    pub fn groups(&self) -> &Groups {
        self.groups.get_or_init(|| Groups::new(&self.scene, &self.emitters))
    }

    /// Recomputes all that follows from scene and ray structure.
    fn refresh(&mut self) {
        self.needs = Needs::kept(&self.scene, self.keep);
        let bounds = self.world.bounds();
        let (centre, diameter) = if self.needs.triangles > 0 {
            ((bounds.min + bounds.max) * 0.5, (bounds.max - bounds.min).length())
        } else {
            (Vec3::ZERO, 1.0)
        };
        self.ball = Ball { centre, radius: if diameter > 0.0 { diameter * 0.5 } else { 0.5 } };
        self.emitters = Emitters::new(&self.scene);
        self.emitter_classes = pilot::classes(&self.emitters);
        self.reference_emitters = OnceLock::new();
        self.groups = OnceLock::new();
        self.glass = Glass::new(&self.scene, &self.needs, &self.emitters);
        self.mirrors = Mirrors::new(&self.scene, self.needs.sharp > 0 && self.needs.mirrors > 0);
        self.panes = if self.needs.glass > 0 { Targets::of_clear_glass(&self.scene) } else { Targets::default() };
        self.targets = if self.needs.light() { Targets::new(&self.scene) } else { Targets::default() };
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
}

/// What of light is left after a way of some length in a medium.
pub fn beyond(medium: Rgb, length: f32) -> Rgb {
    Vec3::from_array((medium * -length).to_array().map(libm::expf))
}
