//! A worker in the master's own process: same manners, no network, no copy of the scene.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

use protocol::message::ToWorker;
use protocol::parts::{Blob, Hash};
use scenes::Scene;

use crate::engine::{Engine, Inbox, Input, Output, Packing, Store};
use crate::renderer::Renderer;

/// A worker on threads of this process; it stops when this is dropped.
pub struct Embedded<C: Renderer> {
    inbox: Inbox<C::World>,
    given: Arc<Given>,
    thread: Option<JoinHandle<()>>,
}

impl<C: Renderer> Embedded<C> {
    /// Starts a worker with so many threads; `out` is called on its thread with what it says.
    ///
    /// # Errors
    /// The system has no more threads.
    pub fn start(renderer: C, threads: usize, out: impl FnMut(Output) + Send + 'static) -> std::io::Result<Self> {
        let given = Arc::new(Given::default());
        let store = Arc::clone(&given);
        let engine = Engine::new(renderer, store, threads, Packing::Quantised)?;
        let inbox = engine.inbox();
        let thread = std::thread::Builder::new().name("worker".into()).spawn(move || engine.run(out))?;
        Ok(Self { inbox, given, thread: Some(thread) })
    }

    /// Tells the worker something. It must have been given the scenes of the worlds it hears of.
    pub fn send(&self, message: ToWorker) {
        self.inbox.put(Input::Received(message));
    }

    /// Gives it the scene (at revision 0) of a world; earlier ones are forgotten.
    pub fn give(&self, world: Hash, scene: Arc<Scene>) {
        let mut scenes = self.given.0.lock().unwrap_or_else(PoisonError::into_inner);
        scenes.clear();
        scenes.insert(world, scene);
    }
}

impl<C: Renderer> Drop for Embedded<C> {
    fn drop(&mut self) {
        self.inbox.put(Input::Abandon);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Scenes that are simply there.
#[derive(Default)]
struct Given(Mutex<BTreeMap<Hash, Arc<Scene>>>);

impl Store for Given {
    fn look(&self, _: &Hash) -> (Vec<Hash>, u32) {
        (Vec::new(), 1)
    }

    fn put(&self, _: Blob) -> Result<(), String> {
        Ok(())
    }

    fn scene(&self, world: &Hash) -> Result<Arc<Scene>, String> {
        let scenes = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        scenes.get(world).cloned().ok_or_else(|| "the scene was replaced by another".into())
    }
}
