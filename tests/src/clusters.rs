//! Clusters of this process, with workers that are processes of their own, and a picture that they draw.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use frame::{Absorbed, Answered, FrontEnd, Igi, Plane, Setup};
use protocol::answer::Fields;
use protocol::question::{Quality, WorldState};
use runtime::cluster::{Cluster, Event, Status};
use scenes::{Needs, Scene};

use crate::programs::PATIENCE;

/// Lets a cluster go on until its status is as it should be.
///
/// # Panics
/// If that takes longer than [`PATIENCE`].
pub fn wait_for(cluster: &mut Cluster, what: &str, enough: impl Fn(&Status) -> bool) -> Status {
    let deadline = Instant::now() + PATIENCE;
    loop {
        let status = cluster.status();
        if enough(&status) {
            return status;
        }
        assert!(Instant::now() < deadline, "waited in vain for {what}: {status:?}");
        cluster.next(Duration::from_millis(10));
    }
}

/// A shipped scene.
///
/// # Panics
/// If it cannot be read.
pub fn scene(name: &str) -> Arc<Scene> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace").join("scenes").join(name);
    Arc::new(scenes::read::load(&folder).expect("the shipped scene is sound").scene)
}

/// A small picture of a scene with mirrors, glass and caustics, in many small tiles.
pub fn setup(scene: &Scene, world: WorldState) -> Setup {
    let mut camera = scene.camera;
    (camera.width, camera.height) = (128, 96);
    let quality = Quality { photons: 500, ..Quality::default() };
    let fields = Fields::of(&Needs::of(scene));
    Setup { world, camera, quality, fields, seed: 7, filter: frame::Filter::plane([3, 3]) }
}

/// Draws so many frames, doing something after every answer; the hash of the raw picture. It begins again when an answer turns out to
/// have been wrong.
///
/// # Panics
/// If that takes longer than [`PATIENCE`], or a question has no answer.
pub fn draw_as(cluster: &mut Cluster, setup: Setup, frames: u32, mut meanwhile: impl FnMut(u64, &Cluster)) -> [u8; 32] {
    let mut front = Igi::new(setup.clone());
    front.set_limit(frames);
    let (mut answers, begun) = (0, Instant::now());
    while !front.is_finished() {
        assert!(begun.elapsed() < PATIENCE, "{answers} answers and no end: {:?}", cluster.status());
        cluster.ask(front.ask(cluster.room().min(1024)));
        match cluster.next(Duration::from_millis(50)) {
            Some(Event::Answered { asked, body, cost, worker, .. }) => {
                let absorbed = front.absorb(Answered { ticket: asked.ticket, body, worker, cost: &cost });
                assert_ne!(absorbed, Absorbed::Unwanted, "an answer came twice");
                answers += 1;
                meanwhile(answers, cluster);
            }
            Some(Event::Unanswered { reason, .. }) => panic!("{reason}"),
            Some(Event::WorkerExposed { gave: true, .. }) => {
                cluster.cancel_all();
                front = Igi::new(setup.clone());
                front.set_limit(frames);
            }
            _ => {}
        }
    }
    front.show(Plane::Raw).sha256()
}
