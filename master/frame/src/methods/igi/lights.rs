//! Where the virtual lights of what is being drawn lie, for people who want to see them.

use protocol::answer::{Body, LightPoint};
use protocol::question::{Ask, Asked, Lights, Lit, Question, Ticket};
use scenes::Camera;
use scenes::camera::Lens;

use super::Setup;
use crate::front_end::Mark;

/// All virtual lights of the first frame of something, as they come in, set by set.
pub(super) struct Collection {
    /// [`Ticket::batch`] of its questions.
    batch: u32,
    /// By set.
    found: Vec<Option<Vec<LightPoint>>>,
}

impl Collection {
    /// Nothing yet, and what is to be asked for it.
    pub fn new(batch: u32, setup: &Setup) -> (Self, Vec<Asked>) {
        let Setup { world, camera, seed, quality, .. } = *setup;
        let lights = |set: u16| Lights { camera, lit: Lit { set, frame: 0, seed, quality } };
        let ask = |set: u16| {
            let ticket = Ticket { batch, slot: set.into() };
            Asked::new(ticket, Question { world, ask: Ask::Lights(lights(set)) })
        };
        let questions: Vec<_> = (0..quality.sets()).map(ask).collect();
        (Self { batch, found: vec![None; questions.len()] }, questions)
    }

    /// It was asked for, and has not come.
    pub fn waits_for(&self, ticket: Ticket) -> bool {
        ticket.batch == self.batch && self.found.get(ticket.slot as usize).is_some_and(Option::is_none)
    }

    /// Takes an answer, or that there will be none; whether it was asked for and had not come.
    pub fn take(&mut self, ticket: Ticket, body: Option<Body>) -> bool {
        let waits = self.waits_for(ticket);
        if waits {
            self.found[ticket.slot as usize] = Some(body.and_then(Body::lights).unwrap_or_default());
        }
        waits
    }

    /// All of them, once all have come.
    pub fn whole(&self) -> Option<Vec<LightPoint>> {
        let sets = self.found.iter().map(Option::as_deref).collect::<Option<Vec<_>>>()?;
        Some(sets.concat())
    }
}

/// Beyond what a pixel shows by so much, a light is hidden: it lies a little off its surface, and pixels are wide.
const BEHIND: f32 = 1.02;

/// Lights as they are seen; `distance` tells how far a pixel looks, 0 where it meets nothing.
pub(super) fn marks(lights: &[LightPoint], camera: &Camera, distance: impl Fn(u32, u32) -> Option<f32>) -> Vec<Mark> {
    let lens: Lens = camera.lens();
    let strongest = lights.iter().map(|light| light.strength.max_element()).fold(0.0, f32::max);
    let mark = |light: &LightPoint| {
        let (x, y, far) = lens.project(light.position)?;
        let (width, height) = (camera.width as f32, camera.height as f32);
        let inside = (0.0..width).contains(&x) && (0.0..height).contains(&y);
        let hidden = || distance(x as u32, y as u32).is_some_and(|near| near > 0.0 && far > near * BEHIND);
        let strength = light.strength.max_element() / strongest.max(f32::MIN_POSITIVE);
        inside.then(|| Mark { x: x / width, y: y / height, strength, depth: light.depth, hidden: hidden() })
    };
    lights.iter().filter_map(mark).collect()
}
