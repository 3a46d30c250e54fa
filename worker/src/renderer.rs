//! What a worker can do, apart from knowing when: build worlds and answer questions about them.

use std::sync::Arc;

use protocol::answer::{Answer, Fields};
use protocol::question::{Question, Unfit};
use scenes::change::Refused;
use scenes::{Change, Keep, Scene};

/// The skill behind the shell. [`Light`] is the real one; tests have simpler ones.
pub trait Renderer: Send + Sync + 'static {
    /// A scene made ready for questions; shared by all threads.
    type World: Send + Sync + 'static;

    /// Makes a scene ready. May take long.
    fn build(&self, scene: Arc<Scene>) -> Self::World;

    /// Leads a world to its next revision.
    ///
    /// # Errors
    /// [`Refused`] if the scene has no such thing; the world is of no use then.
    fn edit(&self, world: &mut Self::World, change: &Change) -> Result<(), Refused>;

    /// What answers about this world can contain.
    fn fields(&self, world: &Self::World) -> Fields;

    /// Looks whether the world has what a question asks about.
    ///
    /// # Errors
    /// What it does not have: then nobody can answer.
    fn check(&self, world: &Self::World, question: &Question) -> Result<(), Unfit>;

    /// Answers what passes [`Self::check`]; `clock` gives microseconds, and nothing else may depend on it.
    fn answer(&self, world: &Self::World, question: &Question, clock: &dyn Fn() -> u64) -> Answer;
}

/// How light really moves.
#[derive(Clone, Copy, Debug, Default)]
pub struct Light {
    /// What becomes of stages that a scene has no work for; answers are the same to the bit.
    pub keep: Keep,
}

/// A prepared scene and the light sets made in it.
pub struct LightWorld {
    prepared: light::Prepared,
    cache: light::LightSetCache,
}

impl LightWorld {
    /// Bytes of what is made of the scene before the first question.
    pub fn bytes(&self) -> usize {
        self.prepared.bytes()
    }
}

impl Renderer for Light {
    type World = LightWorld;

    fn build(&self, scene: Arc<Scene>) -> LightWorld {
        LightWorld { prepared: light::Prepared::keeping(scene, self.keep), cache: light::LightSetCache::default() }
    }

    fn edit(&self, world: &mut LightWorld, change: &Change) -> Result<(), Refused> {
        world.prepared.apply(change)
    }

    fn fields(&self, world: &LightWorld) -> Fields {
        Fields::of(&world.prepared.needs)
    }

    fn check(&self, world: &LightWorld, question: &Question) -> Result<(), Unfit> {
        light::check(&world.prepared, question)
    }

    fn answer(&self, world: &LightWorld, question: &Question, clock: &dyn Fn() -> u64) -> Answer {
        light::answer(&world.prepared, &world.cache, question, clock)
    }
}
