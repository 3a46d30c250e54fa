//! The worker's loop: [`Serve`] decides, this carries out.
//!
//! One thread owns everything; threads and builders report to it through its [`Inbox`]. A build or
//! an edit runs on a thread of its own, so that the master is heard meanwhile. An edit changes the
//! world in place, once no thread uses it: a big scene is never there twice.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};

use protocol::message::{ToMaster, ToWorker};
use protocol::parts::{Blob, Hash};
use protocol::question::WorldState;
use protocol::schedule::QuestionId;
use protocol::serve::{Action, Event, Serve};
use scenes::{Change, Scene};

use crate::pool::{Fault, Job, Pool, panic_text};
pub use crate::pool::{Packing, Work};
use crate::renderer::Renderer;

/// What the engine hears from outside.
#[derive(Debug)]
pub enum Input {
    /// The master says something.
    Received(ToWorker),
    /// A part of a scene has arrived; its hash is right.
    Arrived(Blob),
    /// Finish what is begun, and go; why.
    Drain(String),
    /// The connection is gone: stop at once.
    Abandon,
}

/// What the engine says to outside.
#[derive(Debug)]
pub enum Output {
    /// Tell the master.
    Send(ToMaster),
    /// Send an answer.
    Answer(QuestionId, Work),
    /// All is said: end the connection.
    Stop(String),
}

/// Who answers for a connection to a master: an [`Engine`], or somebody who asks others.
pub trait Hands: Send + Sync {
    /// A master has let us in. `out` takes what is said to it, and returns when there is room for it; it is to be let go of
    /// on [`Input::Abandon`].
    ///
    /// # Errors
    /// The system has no more threads.
    fn begin(&self, out: Box<dyn FnMut(Output) + Send>) -> std::io::Result<Begun>;
}

/// Who has begun to answer.
pub struct Begun {
    /// Hears what the master says.
    pub ear: Box<dyn Fn(Input) + Send + Sync>,
    /// Waits until it has ended, after [`Input::Abandon`].
    pub join: Box<dyn FnOnce() + Send>,
}

/// Where scenes come from.
pub trait Store: Send + Sync + 'static {
    /// Which parts of a world are missing (its manifest, if it is that), and how many parts it has.
    fn look(&self, world: &Hash) -> (Vec<Hash>, u32);

    /// Keeps a part.
    ///
    /// # Errors
    /// Why it cannot be kept.
    fn put(&self, part: Blob) -> Result<(), String>;

    /// The scene of a world nothing of which is missing.
    ///
    /// # Errors
    /// What is wrong with its parts.
    fn scene(&self, world: &Hash) -> Result<Arc<Scene>, String>;
}

/// The engine's ear. Clones share it.
pub struct Inbox<W>(Sender<Message<W>>);

impl<W> Clone for Inbox<W> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<W> Inbox<W> {
    /// Tells the engine something; nothing happens if it has stopped.
    pub fn put(&self, input: Input) {
        let _ = self.0.send(Message::Input(input));
    }
}

enum Message<W> {
    Input(Input),
    Done(QuestionId, Result<Work, Fault>),
    Built(WorldState, Result<W, String>),
}

/// A worker without its ways in and out.
pub struct Engine<C: Renderer> {
    renderer: Arc<C>,
    store: Arc<dyn Store>,
    serve: Serve,
    pool: Pool<C::World>,
    messages: Receiver<Message<C::World>>,
    inbox: Inbox<C::World>,
    /// The world that was built last.
    world: Option<Arc<C::World>>,
    /// The world that was asked for last; others that come to an end are dropped.
    wanted: Option<WorldState>,
    /// An edit that waits for threads to let go of the world.
    edit: Option<(WorldState, Vec<Change>)>,
    /// Questions that threads work on.
    busy: usize,
    /// What a thread has just brought, until [`Serve`] has said whether anybody wants it.
    fresh: Option<Work>,
}

impl<C: Renderer> Engine<C> {
    /// Starts so many threads.
    ///
    /// # Errors
    /// The system has no more threads.
    pub fn new(renderer: C, store: Arc<dyn Store>, threads: usize, packing: Packing) -> std::io::Result<Self> {
        let renderer = Arc::new(renderer);
        let (sender, messages) = channel();
        let inbox = Inbox(sender);
        let report = inbox.0.clone();
        let done = move |id, outcome| drop(report.send(Message::Done(id, outcome)));
        let pool = Pool::start(&renderer, threads.max(1), packing, done)?;
        let serve = Serve::new(threads);
        let (world, wanted, edit) = (None, None, None);
        Ok(Self { renderer, store, serve, pool, messages, inbox, world, wanted, edit, busy: 0, fresh: None })
    }

    /// Where to put what the engine should hear.
    pub fn inbox(&self) -> Inbox<C::World> {
        self.inbox.clone()
    }

    /// Works until told to stop, by either side.
    pub fn run(mut self, mut out: impl FnMut(Output)) {
        while let Ok(message) = self.messages.recv() {
            let event = match message {
                Message::Input(Input::Received(message)) => Event::Received(message),
                Message::Input(Input::Drain(reason)) => Event::Drain(reason),
                Message::Input(Input::Abandon) => return,
                Message::Input(Input::Arrived(part)) => {
                    let hash = part.hash;
                    match self.store.put(part) {
                        Ok(()) => Event::Stored(hash),
                        Err(reason) => return out(Output::Stop(reason)),
                    }
                }
                Message::Done(id, outcome) => self.put_down(id, outcome),
                Message::Built(state, outcome) => match self.keep(state, outcome) {
                    Some(event) => event,
                    None => continue,
                },
            };
            for action in self.serve.handle(event) {
                if let Action::Stop(reason) = action {
                    return out(Output::Stop(reason));
                }
                self.carry_out(action, &mut out);
            }
            self.edit_if_idle();
        }
    }

    fn carry_out(&mut self, action: Action, out: &mut impl FnMut(Output)) {
        match action {
            Action::Send(message) => out(Output::Send(message)),
            Action::Stop(reason) => out(Output::Stop(reason)),
            Action::Answer(id) => out(Output::Answer(id, self.fresh.take().unwrap_or_default())),
            Action::Start(id, question) => match &self.world {
                Some(world) => {
                    self.busy += 1;
                    self.pool.take(Job { id, question, world: Arc::clone(world) });
                }
                None => drop(self.inbox.0.send(Message::Done(id, Err(Fault::Failed("there is no world".into()))))),
            },
            Action::Recall(ids) => {
                for id in ids.into_iter().filter(|id| self.pool.give_back(*id)).collect::<Vec<_>>() {
                    let event = self.put_down(id, Err(Fault::Failed("recalled".into())));
                    for action in self.serve.handle(event) {
                        self.carry_out(action, out);
                    }
                }
            }
            Action::Look(world) => {
                let (missing, of) = self.store.look(&world);
                for action in self.serve.handle(Event::Looked { world, missing, of }) {
                    self.carry_out(action, out);
                }
            }
            Action::Build { state, changes } => {
                self.wanted = Some(state);
                (self.world, self.edit) = (None, None);
                self.build(state, changes);
            }
            Action::Edit { to, changes, .. } => {
                self.wanted = Some(to);
                self.edit = Some((to, changes));
            }
        }
    }

    fn put_down(&mut self, id: QuestionId, outcome: Result<Work, Fault>) -> Event {
        self.busy = self.busy.saturating_sub(1);
        match outcome {
            Ok(work) => {
                self.fresh = Some(work);
                Event::Finished(id)
            }
            Err(Fault::Failed(reason)) => Event::ThreadFailed { id, reason },
            Err(Fault::Refused(reason)) => Event::ThreadRefused { id, reason },
        }
    }

    /// `None` if the world has been overtaken by another.
    fn keep(&mut self, state: WorldState, outcome: Result<C::World, String>) -> Option<Event> {
        if self.wanted != Some(state) {
            return None;
        }
        Some(match outcome {
            Ok(world) => {
                self.world = Some(Arc::new(world));
                Event::Built(state)
            }
            Err(reason) => Event::BuildFailed { state, reason },
        })
    }

    fn build(&self, state: WorldState, changes: Vec<Change>) {
        let (renderer, store) = (Arc::clone(&self.renderer), Arc::clone(&self.store));
        self.apart(state, move || {
            let mut scene = store.scene(&state.world)?;
            if !changes.is_empty() {
                let edited = Arc::make_mut(&mut scene);
                for change in changes {
                    change.apply(edited).map_err(|refused| refused.to_string())?;
                }
                scene.check().map_err(|unsound| unsound.to_string())?;
            }
            Ok(renderer.build(scene))
        });
    }

    fn edit_if_idle(&mut self) {
        if self.busy > 0 || self.edit.is_none() || self.world.is_none() {
            return;
        }
        let (Some((state, changes)), Some(world)) = (self.edit.take(), self.world.take()) else { return };
        let renderer = Arc::clone(&self.renderer);
        self.apart(state, move || {
            let mut world = Arc::into_inner(world).ok_or("a thread still uses the world")?;
            for change in changes {
                renderer.edit(&mut world, &change).map_err(|refused| refused.to_string())?;
            }
            Ok(world)
        });
    }

    /// Builds on a thread of its own.
    fn apart(&self, state: WorldState, build: impl FnOnce() -> Result<C::World, String> + Send + 'static) {
        let report = self.inbox.0.clone();
        let work = move || {
            let outcome = catch_unwind(AssertUnwindSafe(build)).unwrap_or_else(|panic| Err(panic_text(&*panic)));
            let _ = report.send(Message::Built(state, outcome));
        };
        if let Err(error) = std::thread::Builder::new().name("builder".into()).spawn(work) {
            let _ = self.inbox.0.send(Message::Built(state, Err(error.to_string())));
        }
    }
}
