//! The world as workers come to know it: a scene, and the edits since.

use std::collections::BTreeMap;
use std::sync::Arc;

use protocol::answer::Fields;
use protocol::digest::Key;
use protocol::message::{ToWorker, encode};
use protocol::parts::{Hash, Manifest, PartError, split};
use protocol::question::WorldState;
use scenes::change::Refused;
use scenes::{Change, Keep, Needs, Scene};

/// All that a worker needs to build the current revision.
#[derive(Clone, Debug)]
pub struct Known {
    /// Which.
    pub state: WorldState,
    /// At revision 0.
    pub(crate) scene: Arc<Scene>,
    /// Every part of it with its manifest; empty if nobody can ask for them.
    pub parts: Arc<BTreeMap<Hash, Arc<[u8]>>>,
    /// What leads from revision 0 to this one.
    pub(crate) changes: Vec<Change>,
    /// The revision before, and what leads from it to this one.
    pub(crate) last_edit: Option<(WorldState, Vec<Change>)>,
    /// What answers can contain.
    pub(crate) fields: Fields,
    /// By which two of them are told apart, if any are; workers do not know it.
    pub(crate) key: Option<Key>,
}

/// The world as the master edits it.
#[derive(Clone, Debug)]
pub(crate) struct World {
    pub(crate) known: Arc<Known>,
    /// At the current revision.
    now: Arc<Scene>,
    /// Workers of other processes will ask for its parts.
    for_others: bool,
    keep: Keep,
    /// The parts of the scene at revision 0.
    manifest: Manifest,
}

/// A scene as it came from another master.
#[derive(Debug)]
pub struct Told {
    /// At revision 0.
    pub scene: Arc<Scene>,
    /// Every part of it, and its manifest.
    pub parts: BTreeMap<Hash, Arc<[u8]>>,
    /// Its manifest.
    pub manifest: Manifest,
    /// What leads to the state that it is told with.
    pub changes: Vec<Change>,
}

impl World {
    /// What another master has told.
    pub(crate) fn told(state: WorldState, told: Told, keep: Keep, key: Option<Key>) -> Result<Self, Refused> {
        let Told { scene, parts, manifest, changes } = told;
        let mut now = Arc::clone(&scene);
        if !changes.is_empty() {
            let edited = Arc::make_mut(&mut now);
            changes.iter().try_for_each(|change| change.apply(edited))?;
            edited.check().map_err(|unsound| Refused(unsound.to_string()))?;
        }
        let fields = Fields::of(&Needs::kept(&now, keep));
        let known = Known { state, scene, parts: Arc::new(parts), changes, last_edit: None, fields, key };
        Ok(Self { known: Arc::new(known), now, for_others: true, keep, manifest })
    }

    pub(crate) fn new(scene: Arc<Scene>, for_others: bool, keep: Keep, key: Option<Key>) -> Result<Self, PartError> {
        let (manifest, blobs) = split(&scene)?;
        let list = manifest.blob();
        let state = WorldState { world: list.hash, revision: 0 };
        let mut parts = BTreeMap::new();
        if for_others {
            parts.extend(blobs.into_iter().chain([list]).map(|blob| (blob.hash, blob.bytes.into())));
        }
        let known = Known {
            state,
            scene: Arc::clone(&scene),
            parts: Arc::new(parts),
            changes: Vec::new(),
            last_edit: None,
            fields: Fields::of(&Needs::kept(&scene, keep)),
            key,
        };
        Ok(Self { known: Arc::new(known), now: scene, for_others, keep, manifest })
    }

    /// The scene at the current revision.
    pub(crate) fn scene(&self) -> &Scene {
        &self.now
    }

    /// The same, shared.
    pub(crate) fn shared_scene(&self) -> Arc<Scene> {
        Arc::clone(&self.now)
    }

    /// The parts of the scene at revision 0.
    pub(crate) fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Turns to the next revision; whether it is an edit of the one before, or a new world of the same
    /// content. The scene is edited in place: what does not change is neither copied nor looked at. `revision`: that is what it
    /// is to be.
    pub(crate) fn edit(&mut self, changes: Vec<Change>, revision: Option<u32>) -> Result<bool, Refused> {
        // A sound scene and a change that it can take make a sound scene.
        // Lamps may have a solid that another of them brings along.
        match changes.iter().any(|change| matches!(change, Change::Solid { .. })) {
            true => {
                let mut tried = Scene::clone(&self.now);
                changes.iter().try_for_each(|change| change.apply(&mut tried))?;
            }
            false => changes.iter().try_for_each(|change| change.check(&self.now))?,
        }
        let scene = Arc::make_mut(&mut self.now);
        changes.iter().try_for_each(|change| change.apply(scene))?;

        let known = Arc::make_mut(&mut self.known);
        let before = known.state;
        known.state.revision = revision.unwrap_or(before.revision + 1);
        for change in &changes {
            known.changes.retain(|earlier| !change.supersedes(earlier));
            known.changes.push(change.clone());
        }
        known.last_edit = Some((before, changes));
        known.fields = Fields::of(&Needs::kept(&self.now, self.keep));
        if known.fit_messages() {
            return Ok(true);
        }
        // Many things were edited: a new start costs less than to tell it all to everyone who joins.
        let key = self.known.key;
        *self = Self::new(Arc::clone(&self.now), self.for_others, self.keep, key)
            .map_err(|error| Refused(error.to_string()))?;
        Ok(false)
    }
}

impl Known {
    /// What a worker is told that knows nothing.
    pub(crate) fn introduction(&self) -> ToWorker {
        ToWorker::World { state: self.state, changes: self.changes.clone() }
    }

    /// What a worker is told that knows the revision before.
    pub(crate) fn news(&self) -> Option<ToWorker> {
        let (from, changes) = self.last_edit.clone()?;
        Some(ToWorker::Changes { from, revision: self.state.revision, changes })
    }

    fn fit_messages(&self) -> bool {
        encode(&self.introduction()).is_ok() && self.news().is_none_or(|news| encode(&news).is_ok())
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use scenes::{Light, Material};

    use super::*;

    fn scene() -> Arc<Scene> {
        let light = Light::Point { position: Vec3::ZERO, intensity: Vec3::ONE };
        Arc::new(Scene { lights: vec![light; 300], ..Scene::default() })
    }

    fn brighter(light: u32, by: f32) -> Change {
        Change::Light { light, value: Light::Point { position: Vec3::Y, intensity: Vec3::splat(by) } }
    }

    #[test]
    fn the_edits_that_count_lead_to_the_same_scene() {
        let mut world = World::new(scene(), true, Keep::Needed, None).unwrap();
        for step in 0..200 {
            world.edit(vec![brighter(step % 7, step as f32), Change::Time(f64::from(step))], None).unwrap();
        }
        assert_eq!(world.known.state.revision, 200);
        assert_eq!(world.known.changes.len(), 8);
        let mut again = (*world.known.scene).clone();
        world.known.changes.iter().for_each(|change| change.apply(&mut again).unwrap());
        assert_eq!(again, *world.now);
    }

    #[test]
    fn an_edit_out_of_range_is_refused() {
        let mut world = World::new(scene(), true, Keep::Needed, None).unwrap();
        assert!(world.edit(vec![brighter(1, 2.0), brighter(300, 1.0)], None).is_err());
        assert!(world.edit(vec![brighter(0, f32::NAN)], None).is_err());
        assert_eq!((world.known.state.revision, world.scene()), (0, &*scene()), "nothing was changed");
    }

    #[test]
    fn a_lamp_comes_together_with_its_solid_and_a_large_solid_begins_a_new_world() {
        let bring = |texture: u32, planes: u32| {
            let relative = vec![1.0; planes as usize * 361];
            Change::Solid { texture, value: scenes::Solid { name: "a.ies".into(), planes, relative }.into() }
        };
        let hung = |solid: u32| Change::Light {
            light: solid,
            value: Light::Luminaire {
                position: Vec3::ZERO,
                direction: Vec3::NEG_Y,
                side: Vec3::X,
                intensity: Vec3::ONE,
                solid,
            },
        };
        let mut world = World::new(scene(), true, Keep::Needed, None).unwrap();
        assert!(world.edit(vec![hung(0)], None).is_err(), "there is no such solid");
        assert!(world.edit(vec![bring(0, 1), hung(0)], None).unwrap());
        assert!(world.edit(vec![bring(1, 1), hung(2)], None).is_err());
        assert_eq!(world.scene().textures.len(), 1, "nothing was changed");
        // It goes as a part of the scene, not in a message.
        let before = world.known.state.world;
        assert!(!world.edit(vec![bring(1, 720), hung(1)], None).unwrap());
        assert_ne!(world.known.state.world, before);
        assert_eq!((world.known.changes.len(), world.scene().textures.len()), (0, 2));
        world.scene().check().unwrap();
    }

    #[test]
    fn very_many_edits_begin_a_new_world() {
        let mut scene = scene();
        let long_name = "x".repeat(4096);
        Arc::make_mut(&mut scene).materials = vec![Material::diffuse("short", Vec3::ONE); 100];
        let mut world = World::new(scene, true, Keep::Needed, None).unwrap();
        let before = world.known.state.world;
        let mut new_worlds = 0;
        for material in 0..100 {
            let value = Material::diffuse(long_name.clone(), Vec3::ONE);
            let is_edit = world.edit(vec![Change::Material { material, value }], None).unwrap();
            assert!(world.known.fit_messages());
            new_worlds += u32::from(!is_edit);
        }
        assert_eq!(new_worlds, 1);
        assert_ne!(world.known.state.world, before);
        assert!(world.known.parts.contains_key(&world.known.state.world));
    }
}
