//! Light sets that were made before: they make a worker fast, never right.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use protocol::question::{Quality, WorldState};

use crate::walk::LightSet;

/// Everything that a light set depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetKey {
    /// The world it lights.
    pub world: WorldState,
    /// The master's seed.
    pub seed: u64,
    /// Which randomisation.
    pub randomisation: u32,
    /// Block of the sequence.
    pub block: u32,
    /// Round, which decides the photon radius.
    pub round: u32,
    /// Knobs.
    pub quality: Quality,
}

/// A bounded cache of light sets, shared by threads. Two threads that want the same set make it once:
/// the second waits.
#[derive(Debug, Default)]
pub struct Shelf {
    /// Least recently used first.
    sets: Mutex<Vec<(SetKey, Arc<OnceLock<LightSet>>)>>,
}

/// Enough for the sets of two frames at 5×5 interleaving; a set is some hundred kilobytes at most.
pub const SHELF_SETS_MAX: usize = 64;

impl Shelf {
    /// The set with this key, made by `make` if it is not there. The cost of making falls to whoever
    /// made it: the second value says whether that was this call.
    pub fn get(&self, key: &SetKey, make: impl FnOnce() -> LightSet) -> (Arc<OnceLock<LightSet>>, bool) {
        let slot = {
            let mut sets = self.sets.lock().unwrap_or_else(PoisonError::into_inner);
            let slot = match sets.iter().position(|(k, _)| k == key) {
                Some(i) => sets.remove(i).1,
                None => Arc::default(),
            };
            if sets.len() >= SHELF_SETS_MAX {
                sets.remove(0);
            }
            sets.push((*key, Arc::clone(&slot)));
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
