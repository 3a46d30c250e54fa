//! `igi-master` with a method more, which is all in this file: one colour, brighter with every frame. Whatever the program
//! does with methods it does with this one.

use std::process::ExitCode;

use frame::front_end::{
    Absorbed, Answered, FrontEnd, GivenUp, Interactive, Knob, Layer, Literal, Open, Panel, Plane, Settings, Slider,
    Values, View,
};
use frame::methods::afresh::Afresh;
use frame::parts::{Batches, Slot};
use frame::{Method, Picture};
use glam::Vec3;
use protocol::answer::Fields;
use protocol::question::{Ask, Asked, Question, Rect, Samples, Ticket};
use scenes::{Camera, Change};

fn main() -> ExitCode {
    const METHODS: &[&dyn Method] = &[&frame::methods::igi::IGI, &frame::methods::reference::REFERENCE, &TOY];
    master::main_with(METHODS)
}

/// The method.
const TOY: Toy = Toy;

struct Toy;

const KNOBS: &[Knob] = &[Knob {
    name: "step",
    label: "Step",
    about: "How much brighter each frame is.",
    values: Values::Real { above: 0.0, most: 1.0 },
    unset: None,
    default: Literal::Real(0.125),
    panel: Panel::Slider(Slider { least: 0.125, most: 1.0, step: 0.125 }),
}];

impl Method for Toy {
    fn name(&self) -> &'static str {
        "toy"
    }

    fn about(&self) -> &'static str {
        "one colour, brighter with every frame"
    }

    fn knobs(&self) -> &'static [Knob] {
        KNOBS
    }

    fn layers(&self) -> &'static [Layer] {
        &[Layer::FINAL]
    }

    fn memory_bytes(&self, _: &Settings, camera: &Camera, _: Fields) -> u64 {
        u64::from(camera.width) * u64::from(camera.height) * size_of::<Vec3>() as u64
    }

    fn begin(&self, settings: &Settings, view: &View) -> Box<dyn FrontEnd> {
        Box::new(Counter {
            view: view.clone(),
            step: settings.real("step"),
            frames: Batches::default(),
            next: 0,
            limit: u32::MAX,
        })
    }

    fn interactive(&self, settings: &Settings, first_ticket: u32) -> Box<dyn Interactive> {
        Box::new(Afresh::new(&TOY, settings, first_ticket))
    }
}

/// Asks about one sample of one pixel a frame, and counts the answers.
struct Counter {
    view: View,
    step: f32,
    frames: Batches<()>,
    next: u32,
    limit: u32,
}

impl FrontEnd for Counter {
    fn look(&mut self, view: &View, _: &[Change]) -> Open {
        (self.view, self.next) = (view.clone(), 0);
        self.frames = Batches::new(self.frames.next_ticket(), 0);
        Open::Unwanted
    }

    fn ask(&mut self, room: usize) -> Vec<Asked> {
        let mut questions = Vec::new();
        while questions.len() < room && self.next < self.limit && self.next < self.frames() + 2 {
            let View { world, camera, seed, .. } = self.view;
            let rect = Rect { x: 0, y: 0, width: 1, height: 1 };
            let samples = Samples { camera, rect, first: self.next, count: 1, seed, max_bounces: Some(0) };
            self.frames.open(self.next, vec![Slot::Missing]);
            let question = Question { world, ask: Ask::Reference(samples) };
            questions.push(Asked::new(self.frames.ticket(self.next, 0), question));
            self.next += 1;
        }
        questions
    }

    fn ask_again(&mut self) {
        self.next = self.frames();
    }

    fn begin_again(&mut self) {
        self.next = 0;
        self.frames = Batches::new(self.frames.next_ticket(), 0);
    }

    fn absorb(&mut self, answered: Answered<'_>) -> Absorbed {
        let Some(place) = self.frames.find(answered.ticket) else { return Absorbed::Unwanted };
        self.frames.answer(place, ());
        let before = self.frames();
        while self.frames.take_complete().is_some() {}
        match self.frames() - before {
            0 => Absorbed::Kept,
            frames => Absorbed::Completed { frames },
        }
    }

    fn set_limit(&mut self, frames: u32) {
        self.limit = frames;
        self.frames.cut(frames);
    }

    fn finish(&mut self) {
        self.set_limit(self.limit.min(self.frames().max(1)));
    }

    fn is_finished(&self) -> bool {
        self.frames() >= self.limit
    }

    fn frame_progress(&self) -> f32 {
        self.frames.progress()
    }

    fn give_up(&mut self, ticket: Ticket) -> GivenUp {
        if self.frames.find(ticket).is_some() { GivenUp::Other } else { GivenUp::Unwanted }
    }

    fn show(&mut self, _: Plane) -> Picture {
        let Camera { width, height, .. } = self.view.camera;
        Picture::from_fn(width, height, |_, _| Vec3::splat(self.step * self.frames() as f32))
    }

    fn frames(&self) -> u32 {
        self.frames.taken()
    }
}
