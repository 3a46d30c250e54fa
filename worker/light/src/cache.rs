//! Light sets that were made before: they make a worker fast, never right.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use protocol::question::{Quality, WorldState};
use scenes::Camera;

use crate::edges::Edges;
use crate::importance::Importance;
use crate::walk::LightSet;

/// Everything that importance depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewKey {
    /// The world that is seen.
    pub world: WorldState,
    /// From where; `None` if importance is off.
    pub camera: Option<Camera>,
    /// Knobs.
    pub quality: Quality,
}

/// Everything that it depends on where things end that shine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgesKey {
    /// The world that is seen.
    pub world: WorldState,
    /// From where.
    pub camera: Camera,
}

/// Everything that a light set depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetKey {
    /// World, view and knobs.
    pub view: ViewKey,
    /// The master's seed.
    pub seed: u64,
    /// Which replicate.
    pub replicate: u32,
    /// Block of the sequence.
    pub block: u32,
    /// Round, which decides the photon radius.
    pub round: u32,
}

/// A worker's bounded memory, shared by its threads.
#[derive(Default)]
pub struct LightSetCache {
    /// What cameras see.
    pub views: Cache<ViewKey, Importance>,
    /// Where they see lamps end.
    pub edges: Cache<EdgesKey, Edges>,
    /// Light sets.
    pub sets: Cache<SetKey, LightSet>,
}

/// Things by key, at most [`CACHE_MAX`]. Two threads that want the same thing make it once: the
/// second waits.
pub struct Cache<K, V> {
    /// Least recently used first.
    slots: Mutex<Vec<(K, Arc<OnceLock<V>>)>>,
}

/// Enough for questions about 16 frames, each with a set of its own, of eight rectangles at a time; a set is some hundred
/// kilobytes at most.
pub const CACHE_MAX: usize = 128;

impl<K, V> Default for Cache<K, V> {
    fn default() -> Self {
        Self { slots: Mutex::default() }
    }
}

impl<K: PartialEq + Clone, V> Cache<K, V> {
    /// The thing with this key, made by `make` if it is not there; and whether this call made it.
    pub fn get(&self, key: &K, make: impl FnOnce() -> V) -> (Arc<OnceLock<V>>, bool) {
        let slot = {
            let mut slots = self.slots.lock().unwrap_or_else(PoisonError::into_inner);
            let slot = match slots.iter().position(|(k, _)| k == key) {
                Some(i) => slots.remove(i).1,
                None => Arc::default(),
            };
            if slots.len() >= CACHE_MAX {
                slots.remove(0);
            }
            slots.push((key.clone(), Arc::clone(&slot)));
            slot
        };
        let mut made = false;
        slot.get_or_init(|| {
            made = true;
            make()
        });
        (slot, made)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cache_makes_once_and_forgets_the_oldest() {
        let cache = Cache::default();
        assert!(cache.get(&0, || 'a').1);
        assert!(!cache.get(&0, || 'b').1);
        for key in 1..=CACHE_MAX {
            cache.get(&key, || 'c');
        }
        assert!(cache.get(&0, || 'd').1, "0 was used least recently");
        assert_eq!(cache.get(&0, || 'e').0.get(), Some(&'d'));
    }
}
