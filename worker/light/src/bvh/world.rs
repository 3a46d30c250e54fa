//! The upper level: instances of solids, and the questions one can ask.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::Arc;

use glam::Vec3;
use scenes::{Keep, Mesh, Object, Scene, Transform};

use super::bounds::Aabb;
use super::build;
use super::lanes::{Isa, Lanes, Machine, on_machine};
use super::packet::{self, PacketScratch};
use super::parallel;
use super::ray::{Probe, Spot, Visit, walk};
use super::shaft::{self, ShaftScratch};
use super::slabs::Slabs;
use super::solid::{Gaps, Solid};
use super::targets::{CLUSTER, Targets};
use super::tree::Node;

/// Points `origin + t · direction` with `0 < t < t_max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts.
    pub origin: Vec3,
    /// Of any length but zero: t counts in units of it.
    pub direction: Vec3,
    /// Where it ends; may be infinite.
    pub t_max: f32,
}

/// Where a ray meets a triangle `p0 p1 p2`: at `(1 − u − v) p0 + u p1 + v p2`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Along the ray, in units of its direction.
    pub t: f32,
    /// Barycentric coordinate of `p1`.
    pub u: f32,
    /// Barycentric coordinate of `p2`.
    pub v: f32,
    /// Index into [`Scene::objects`].
    pub object: u32,
    /// Index into [`scenes::Mesh::triangles`].
    pub triangle: u32,
}

/// The geometry of a scene, ready for rays. Clones share the solids.
#[derive(Clone)]
pub struct World {
    /// By mesh; built when first an object that is visible needs it.
    solids: Vec<Option<Arc<Solid>>>,
    /// What is left of objects that pieces were lifted out of, and those that have other gaps than their mesh, by object.
    rests: BTreeMap<u32, Rest>,
    /// Pieces that were lifted, by their whole and piece.
    pieces: BTreeMap<(u32, u32), Arc<Solid>>,
    instances: Vec<Instance>,
    /// Over the instances; not used if there is only one.
    top: Vec<Node>,
    bounds: Aabb,
    left_out: LeftOut,
    keep: Keep,
    machine: Machine,
}

/// What was left out because no ray can sensibly meet it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LeftOut {
    /// Triangles of meshes in use that are degenerate, not finite, or farther than 2⁴⁰ from the origin.
    pub triangles: u64,
    /// Visible objects whose transform is not finite or cannot be inverted.
    pub objects: u32,
}

/// The solid of a mesh without some of its pieces.
#[derive(Clone)]
struct Rest {
    solid: Arc<Solid>,
    /// Ascending.
    gone: Vec<u32>,
}

/// A solid at a place.
#[derive(Clone)]
pub(super) struct Instance {
    pub object: u32,
    pub solid: Arc<Solid>,
    /// `None` where object space is scene space.
    pub object_from_scene: Option<Transform>,
    /// In scene space.
    pub bounds: Aabb,
}

impl World {
    /// Builds what the visible objects need.
    pub fn build(scene: &Scene) -> Self {
        Self::keeping(scene, Keep::Needed)
    }

    /// As [`Self::build`]; with [`Keep::All`] also what they do not need: an upper level over a single object,
    /// and a look for gaps where there are none.
    pub fn keeping(scene: &Scene, keep: Keep) -> Self {
        let mut world = Self {
            solids: vec![None; scene.meshes.len()],
            rests: BTreeMap::new(),
            pieces: BTreeMap::new(),
            instances: Vec::new(),
            top: Vec::new(),
            bounds: Aabb::EMPTY,
            left_out: LeftOut::default(),
            keep,
            machine: Machine::detect(),
        };
        world.rebuild_top(scene);
        world
    }

    /// Follows changed transforms, visibilities and liftings: solids are kept. Where a piece is lifted out of an object, the
    /// object's tree keeps its shape and is fitted to what is left, and only the piece gets a tree of its own. The scene
    /// must be the one this world was built for, but for those (changed meshes need a new world, changed coverage
    /// [`Self::rebuild_with`]).
    pub fn rebuild_top(&mut self, scene: &Scene) {
        // They hold on to solids that may have to change.
        self.instances.clear();
        self.lift(scene);
        self.build_missing(scene);
        let visible = (0..).zip(&scene.objects).filter(|(_, object)| object.visible);
        let placed: Vec<_> = visible
            .filter_map(|(number, object)| Some((number, object, self.solid(number, object)?)))
            .filter(|(_, _, solid)| !solid.bounds.is_empty())
            .map(|(number, object, solid)| Instance::place(number, object, solid))
            .collect();
        self.left_out.objects = placed.iter().filter(|instance| instance.is_none()).count() as u32;
        self.instances = placed.into_iter().flatten().collect();
        let meshes = self.solids.iter().flatten().chain(self.rests.values().map(|rest| &rest.solid));
        self.left_out.triangles = meshes.map(|solid| u64::from(solid.dropped)).sum();
        let boxes: Vec<_> = self.instances.iter().map(|instance| instance.bounds).collect();
        self.top = build::tree(&boxes, 1).with_things_as_leaves();
        self.bounds = boxes.iter().fold(Aabb::EMPTY, |all, one| all.union(*one));
    }

    /// Follows a material whose coverage has changed: solids without it are kept.
    pub fn rebuild_with(&mut self, scene: &Scene, material: u32) {
        let has_it = |mesh: u32| scene.meshes[mesh as usize].materials.contains(&material);
        for (mesh, solid) in (0..).zip(&mut self.solids).filter(|(_, solid)| solid.is_some()) {
            if has_it(mesh) {
                *solid = None;
            }
        }
        self.rests.retain(|object, _| !has_it(scene.objects[*object as usize].mesh));
        self.pieces.retain(|(object, _), _| !has_it(scene.objects[*object as usize].mesh));
        self.rebuild_top(scene);
    }

    /// Follows a material of an object's own, or of a piece of it, whose coverage has changed: only that object's solids are
    /// built anew.
    pub fn rebuild_object(&mut self, scene: &Scene, object: u32) {
        self.rests.remove(&object);
        self.pieces.retain(|(whole, _), _| *whole != object);
        self.rebuild_top(scene);
    }

    /// A box around everything, in scene space.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// What no ray will meet.
    pub fn left_out(&self) -> LeftOut {
        self.left_out
    }

    /// The nearest hit; of several at the same t, the one of lowest (object, triangle).
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        if !ray.is_finite() {
            return None;
        }
        on_machine!(self.machine, closest, (world: &World = self, ray: &Ray = ray) -> Option<Hit>)
    }

    /// The nearest hits of endless rays from one origin, the same as [`Self::closest`] of each, to the
    /// bit. Best are whole 128 neighbouring pixels in order of 4×4 blocks.
    ///
    /// # Panics
    /// If there are fewer `hits` than `directions`.
    pub fn closest_from(
        &self,
        origin: Vec3,
        directions: &[Vec3],
        scratch: &mut PacketScratch,
        hits: &mut [Option<Hit>],
    ) {
        let rays = |direction: &Vec3| Ray { origin, direction: *direction, t_max: f32::INFINITY };
        for (directions, hits) in directions.chunks(CLUSTER).zip(hits.chunks_mut(CLUSTER)) {
            let hits = &mut hits[..directions.len()];
            if !directions.iter().all(|direction| rays(direction).is_finite()) {
                hits.iter_mut().zip(directions).for_each(|(hit, direction)| *hit = self.closest(&rays(direction)));
                continue;
            }
            on_machine!(self.machine, packet::closest, (
                world: &World = self,
                origin: Vec3 = origin,
                directions: &[Vec3] = directions,
                scratch: &mut PacketScratch = scratch,
                hits: &mut [Option<Hit>] = hits,
            ) -> ());
        }
    }

    /// Whether anything stands strictly between two points.
    pub fn occluded(&self, from: Vec3, to: Vec3) -> bool {
        self.occluded_along(&Ray { origin: from, direction: to - from, t_max: 1.0 })
    }

    /// Whether a ray meets anything.
    pub fn occluded_along(&self, ray: &Ray) -> bool {
        ray.is_finite() && on_machine!(self.machine, occluded, (world: &World = self, ray: &Ray = ray) -> bool)
    }

    /// Which targets can see the apex: bit i mod 64 of `visible[i / 64]` is set iff target i does, in
    /// the order given to [`Targets::new`]; the same as `!occluded(apex, target)`, to the bit.
    ///
    /// # Panics
    /// If `visible` has fewer bits than there are targets.
    pub fn shade_shaft(&self, apex: Vec3, targets: &Targets, scratch: &mut ShaftScratch, visible: &mut [u64]) {
        self.shade(apex, targets, None, scratch, visible);
    }

    /// Like [`Self::shade_shaft`] for the targets whose bit is set in `wanted`; the others count as hidden.
    ///
    /// # Panics
    /// If `wanted` or `visible` have fewer bits than there are targets.
    pub fn shade_wanted(
        &self,
        apex: Vec3,
        targets: &Targets,
        wanted: &[u64],
        scratch: &mut ShaftScratch,
        visible: &mut [u64],
    ) {
        self.shade(apex, targets, Some(wanted), scratch, visible);
    }

    /// Which targets see out along a direction: bit i mod 64 of `visible[i / 64]` is set iff target i is wanted and an
    /// endless ray from it meets nothing; the same as [`Self::occluded_along`] of each, to the bit.
    ///
    /// # Panics
    /// If `wanted` or `visible` have fewer bits than there are targets.
    pub fn shade_along(
        &self,
        direction: Vec3,
        targets: &Targets,
        wanted: &[u64],
        scratch: &mut ShaftScratch,
        visible: &mut [u64],
    ) {
        visible.fill(0);
        let mut singly = |number: usize| {
            let ray = Ray { origin: targets.points()[number], direction, t_max: f32::INFINITY };
            let sees = wanted[number / 64] >> (number % 64) & 1 == 1 && !self.occluded_along(&ray);
            visible[number / 64] |= u64::from(sees) << (number % 64);
        };
        if !direction.is_finite() {
            (0..targets.len()).for_each(singly);
            return;
        }
        targets.odd.iter().for_each(|&number| singly(number as usize));
        on_machine!(self.machine, parallel::shade, (
            world: &World = self,
            direction: Vec3 = direction,
            targets: &Targets = targets,
            wanted: &[u64] = wanted,
            scratch: &mut ShaftScratch = scratch,
            visible: &mut [u64] = visible,
        ) -> ())
    }

    fn shade(
        &self,
        apex: Vec3,
        targets: &Targets,
        wanted: Option<&[u64]>,
        scratch: &mut ShaftScratch,
        visible: &mut [u64],
    ) {
        visible.fill(0);
        let mut singly = |number: usize| {
            let asked = wanted.is_none_or(|bits| bits[number / 64] >> (number % 64) & 1 == 1);
            let sees = asked && !self.occluded(apex, targets.points()[number]);
            visible[number / 64] |= u64::from(sees) << (number % 64);
        };
        if !apex.abs().cmplt(Vec3::splat(Targets::FAR)).all() {
            (0..targets.len()).for_each(singly);
            return;
        }
        targets.odd.iter().for_each(|&number| singly(number as usize));
        on_machine!(self.machine, shaft::shade, (
            world: &World = self,
            apex: Vec3 = apex,
            targets: &Targets = targets,
            wanted: Option<&[u64]> = wanted,
            scratch: &mut ShaftScratch = scratch,
            visible: &mut [u64] = visible,
        ) -> ())
    }

    /// Bytes that the trees, their triangles, objects and gaps take; textures aside.
    pub fn bytes(&self) -> usize {
        let rests = self.rests.values().map(|rest| &rest.solid);
        let solids = self.solids.iter().flatten().chain(rests).chain(self.pieces.values());
        let upper = if self.is_flat() { 0 } else { size_of_val(&self.instances[..]) + size_of_val(&self.top[..]) };
        upper + solids.map(|solid| solid.bytes()).sum::<usize>()
    }

    /// There is no upper level to walk.
    #[inline(always)]
    pub(super) fn is_flat(&self) -> bool {
        self.instances.len() == 1 && self.keep == Keep::Needed
    }

    pub(super) fn top(&self) -> &[Node] {
        &self.top
    }

    pub(super) fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// The same world on a machine that can do less: for tests.
    #[cfg(test)]
    pub(super) fn on(mut self, machine: Machine) -> Self {
        self.machine = machine;
        self
    }

    /// The solid of an object, if it has been built.
    fn solid(&self, number: u32, object: &Object) -> Option<&Arc<Solid>> {
        match &object.lifted {
            Some(lifted) => self.pieces.get(&(lifted.of, lifted.piece)),
            None => match self.rests.get(&number) {
                Some(rest) => Some(&rest.solid),
                None => self.solids.get(object.mesh as usize)?.as_ref(),
            },
        }
    }

    /// Takes lifted pieces out of the solids of their objects, and puts back those that are at rest again.
    fn lift(&mut self, scene: &Scene) {
        let mut gone: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for lifted in scene.objects.iter().filter_map(|object| object.lifted.as_ref()) {
            gone.entry(lifted.of).or_default().push(lifted.piece);
        }
        for (number, whole) in (0..).zip(&scene.objects[..scene.wholes()]) {
            if has_own_gaps(scene, whole) {
                gone.entry(number).or_default();
            }
        }
        self.pieces.retain(|(object, piece), _| scene.find_lifted(*object, *piece).is_ok());
        for object in self.rests.keys().copied().filter(|object| !gone.contains_key(object)).collect::<Vec<_>>() {
            let Some(mut rest) = self.rests.remove(&object) else { continue };
            let mesh = scene.objects[object as usize].mesh;
            if let Some(slot @ None) = self.solids.get_mut(mesh as usize) {
                rest.change(&scene.meshes[mesh as usize], Vec::new());
                *slot = Some(rest.solid);
            }
        }
        for (number, gone) in gone {
            let object = &scene.objects[number as usize];
            if !object.visible && !self.rests.contains_key(&number) {
                continue;
            }
            let known = self.rests.remove(&number);
            let is_new = known.is_none();
            let Some(mut rest) = known.or_else(|| self.whole(scene, object.mesh, number)) else { continue };
            rest.change(&scene.meshes[object.mesh as usize], gone);
            if is_new && has_own_gaps(scene, object) {
                Arc::make_mut(&mut rest.solid).gaps = self.own_gaps(scene, number);
            }
            self.rests.insert(number, rest);
        }
    }

    /// The solid of a mesh to take pieces out of: the one that is there, if no other object needs it.
    fn whole(&mut self, scene: &Scene, mesh: u32, object: u32) -> Option<Rest> {
        let is_needed = |(number, other): (u32, &Object)| {
            let is_whole = other.lifted.is_none() && !self.rests.contains_key(&number);
            number != object && other.visible && other.mesh == mesh && is_whole
        };
        let is_shared = (0..).zip(&scene.objects).any(is_needed);
        self.build_solid(scene, mesh);
        let slot = self.solids.get_mut(mesh as usize)?;
        let solid = if is_shared { slot.clone() } else { slot.take() };
        Some(Rest { solid: solid?, gone: Vec::new() })
    }

    fn build_missing(&mut self, scene: &Scene) {
        for (number, object) in (0..).zip(&scene.objects).filter(|(_, object)| object.visible) {
            match &object.lifted {
                None if self.rests.contains_key(&number) => {}
                None => self.build_solid(scene, object.mesh),
                Some(lifted) => {
                    let key = (lifted.of, lifted.piece);
                    if !self.pieces.contains_key(&key) {
                        let mesh = &scene.meshes[object.mesh as usize];
                        let triangles = mesh.pieces().triangles(lifted.piece).iter().copied();
                        let whole = &scene.objects[lifted.of as usize];
                        let gaps = match has_own_gaps(scene, object) || has_own_gaps(scene, whole) {
                            true => self.own_gaps(scene, number),
                            false => self.gaps(scene, object.mesh),
                        };
                        self.pieces.insert(key, Arc::new(Solid::build(mesh, triangles, gaps)));
                    }
                }
            }
        }
    }

    fn build_solid(&mut self, scene: &Scene, mesh: u32) {
        if let Some(None) = self.solids.get(mesh as usize) {
            let gaps = self.gaps(scene, mesh);
            let all = &scene.meshes[mesh as usize];
            let solid = Solid::build(all, 0..all.triangles.len() as u32, gaps);
            self.solids[mesh as usize] = Some(Arc::new(solid));
        }
    }

    /// Where a mesh is not wholly there: as some solid of it knows already, or looked for.
    fn gaps(&self, scene: &Scene, mesh: u32) -> Option<Arc<Gaps>> {
        let whole = self.solids.get(mesh as usize).and_then(Option::as_ref);
        let is_of_it = |object: &Object| object.mesh == mesh && !has_own_gaps(scene, object);
        let mut rests = self.rests.iter().filter(|(object, _)| is_of_it(&scene.objects[**object as usize]));
        let rest = || rests.next().map(|(_, rest)| &rest.solid);
        match whole.or_else(rest) {
            Some(solid) => solid.gaps.clone(),
            None => Gaps::find(&scene.meshes[mesh as usize], scene, self.keep, |material| material),
        }
    }

    /// Where an object is not wholly there, by what it has of its own.
    fn own_gaps(&self, scene: &Scene, object: u32) -> Option<Arc<Gaps>> {
        let mesh = &scene.meshes[scene.objects[object as usize].mesh as usize];
        Gaps::find(mesh, scene, self.keep, |material| scene.made_of(object as usize, material))
    }

    /// Visits the instances whose boxes a ray meets, as leaves.
    #[inline(always)]
    fn visit_instances<F: Lanes, V: Visit<F>>(
        &self,
        proof: F::Proof,
        ray: &Ray,
        mut visit: V,
    ) -> ControlFlow<V::Break> {
        let mut limit = ray.t_max;
        if self.is_flat() {
            return visit.leaf(proof, 0, &mut limit);
        }
        let slabs = Slabs::new(ray.origin, ray.direction, ray.t_max, self.bounds.reach());
        walk::<F, V>(proof, &self.top, &slabs, limit, visit)
    }
}

/// Something that an object has of its own covers it otherwise than what it is instead of.
fn has_own_gaps(scene: &Scene, object: &Object) -> bool {
    let coverage = |material: u32| scene.materials[material as usize].coverage;
    object.own.iter().any(|own| coverage(own.instead_of) != coverage(own.material))
}

/// [`World::closest`].
#[inline(always)]
fn closest<I: Isa>(isa: I, world: &World, ray: &Ray) -> Option<Hit> {
    let mut nearest = Nearest { world, ray, best: None };
    let _ = world.visit_instances::<I::Eight, _>(isa.eight(), ray, &mut nearest);
    nearest.best
}

/// [`World::occluded_along`].
#[inline(always)]
fn occluded<I: Isa>(isa: I, world: &World, ray: &Ray) -> bool {
    world.visit_instances::<I::Eight, _>(isa.eight(), ray, &mut Any { world, ray }).is_break()
}

/// Finds the closest hit; leaves are instances.
struct Nearest<'a> {
    world: &'a World,
    ray: &'a Ray,
    best: Option<Hit>,
}

impl<F: Lanes> Visit<F> for &mut Nearest<'_> {
    type Break = ();
    const SORTED: bool = true;

    #[inline(always)]
    fn leaf(&mut self, proof: F::Proof, leaf: u32, limit: &mut f32) -> ControlFlow<()> {
        let instance = &self.world.instances[leaf as usize];
        let spot = instance.probe(self.ray).closest::<F>(proof, &instance.solid, *limit);
        if let Some(Spot { t, u, v, triangle }) = spot {
            let hit = Hit { t, u, v, object: instance.object, triangle };
            if self.best.is_none_or(|old| (t, hit.object, triangle) < (old.t, old.object, old.triangle)) {
                (self.best, *limit) = (Some(hit), t);
            }
        }
        ControlFlow::Continue(())
    }
}

/// Finds whether there is a hit; leaves are instances.
struct Any<'a> {
    world: &'a World,
    ray: &'a Ray,
}

impl<F: Lanes> Visit<F> for &mut Any<'_> {
    type Break = ();
    const SORTED: bool = false;

    #[inline(always)]
    fn leaf(&mut self, proof: F::Proof, leaf: u32, _: &mut f32) -> ControlFlow<()> {
        let instance = &self.world.instances[leaf as usize];
        match instance.probe(self.ray).any::<F>(proof, &instance.solid) {
            Some(_) => ControlFlow::Break(()),
            None => ControlFlow::Continue(()),
        }
    }
}

impl Rest {
    /// From now on, these pieces are not in it, and all others are.
    fn change(&mut self, mesh: &Mesh, gone: Vec<u32>) {
        if self.gone == gone {
            return;
        }
        let pieces = mesh.pieces();
        let is_in = |list: &[u32], piece: u32| list.binary_search(&piece).is_ok();
        let before = std::mem::take(&mut self.gone);
        let now = |triangle: u32| {
            let piece = pieces.of_triangle(triangle as usize);
            let is_gone = is_in(&gone, piece);
            (is_gone != is_in(&before, piece)).then_some(!is_gone)
        };
        Arc::make_mut(&mut self.solid).take_out(mesh, now);
        self.gone = gone;
    }
}

impl Ray {
    /// Other rays hit nothing. Without this, a NaN would fail no box test and walk every tree.
    #[inline(always)]
    fn is_finite(&self) -> bool {
        let [o, d] = [self.origin, self.direction];
        ((o.x + o.y + o.z) + (d.x + d.y + d.z)).is_finite()
    }
}

impl Instance {
    /// `None` if the object's transform is of no use.
    fn place(number: u32, object: &Object, solid: &Arc<Solid>) -> Option<Self> {
        let place = &object.scene_from_object;
        if place.is_identity() {
            return Some(Self {
                object: number,
                solid: Arc::clone(solid),
                object_from_scene: None,
                bounds: solid.bounds,
            });
        }
        let inverse = place.inverse();
        let sound = [place, &inverse].iter().all(|t| t.linear.is_finite() && t.translation.is_finite());
        let bounds = Aabb::of(solid.bounds.corners().map(|corner| place.point(corner)));
        // Rays are tested in object space; this box must only not be too small.
        let stretch = place.linear.to_cols_array().into_iter().fold(0.0, |most, x: f32| most + x.abs());
        let reach = solid.bounds.reach() * stretch + place.translation.abs().max_element();
        let bounds = bounds.grown(reach * ROUNDING);
        (sound && !bounds.is_empty()).then(|| Self {
            object: number,
            solid: Arc::clone(solid),
            object_from_scene: Some(inverse),
            bounds,
        })
    }

    #[inline(always)]
    fn probe(&self, ray: &Ray) -> Probe {
        let (origin, direction) = match &self.object_from_scene {
            None => (ray.origin, ray.direction),
            Some(place) => (place.point(ray.origin), place.vector(ray.direction)),
        };
        Probe::new(self.object, origin, direction, ray.t_max, self.solid.bounds.reach())
    }
}

/// How much boxes of placed solids grow, relative to their coordinates.
const ROUNDING: f32 = 1.0 / (1 << 16) as f32;
