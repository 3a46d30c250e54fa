//! The display process as a state machine: answers go in, a camera goes in, a picture and the next requests come out.
//!
//! One *tick* is one shown picture. What is known after it is a function of what went in, in order: there is no clock, and
//! no answer goes in but with the whole batch that it belongs to.

use std::collections::BTreeSet;
use std::sync::Arc;

use glam::Vec3;
use scenes::{Camera, Change, Scene, SurfacePoint};

use super::guide::Guide;
use super::lamps::Lamps;
use super::memory::Memory;
use super::naming::{Pose, moved, name};
use super::places::FAR;
use super::point::{Hint, Light, Origin};
use super::points::{AGE_UNIT, Id, Points};
use super::project::{NONE, PointImage};
use super::reconstruct::Reconstruction;
use super::relight::{Learnt, Relight};
use super::sampling::{ahead, dither, priorities, unoccupied};
use super::settings::{Ages, Changes, Holes, Options};
use super::taking::{hint, is_made_anew};
use crate::Picture;
use crate::front_end::View;
use crate::parts::reproject::{Shown, fill_from_around};

/// A ray that is wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Request {
    pub pixel: [u32; 2],
    /// The point that the pixel shows: what comes takes its place.
    pub point: Option<Id>,
    /// The ray goes exactly there.
    pub aim: Option<SurfacePoint>,
    /// Of the predicted camera, not of the present one.
    pub predicted: bool,
    /// The same random numbers as before; else new ones.
    pub repeats: Option<Origin>,
}

/// What a tick wants to know.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Requests {
    pub rays: Vec<Request>,
    /// The camera that predicted ones are of.
    pub predicted: Option<Camera>,
}

/// See the module's documentation.
#[derive(Clone, Debug)]
pub(super) struct Cache {
    pub(super) options: Options,
    pub(super) points: Points,
    pub(super) image: PointImage,
    pub(super) camera: Camera,
    /// The camera of the tick before.
    before: Option<Camera>,
    priorities: Vec<u32>,
    /// Pixels that the last tick requested.
    requested: Vec<u32>,
    /// Requests that error diffusion was short of.
    short: usize,
    /// Objects that the last look moved.
    pub(super) moving: BTreeSet<u32>,
    /// What the last edit of lamps has changed, and the state of the world after it.
    pub(super) relight: Relight,
    pub(super) relit: u32,
    /// What samples have told of it since.
    pub(super) learnt: Learnt,
    /// Samples since then.
    pub(super) since_relit: usize,
    guide: Guide,
    reconstruction: Reconstruction,
    /// The last picture.
    last: Option<Shown>,
    memory: Memory,
}

/// What a mean of a still picture counts as after an edit: of lamps and materials, and of anything else.
const DOUBTED_LIGHTS: u8 = 0;
const DOUBTED: u8 = 2;
/// So much older are points whose material was edited.
const EDIT_AGES: u16 = 128 << 8;
/// Steps of a picture, as table 1 of 1999 has them; its request of samples in three.
pub(super) const UPDATE: &str = "update render cache";
const INITIALISE: &str = "initialize buffers";
const PROJECT: &str = "point projection";
const CULL: &str = "depth cull";
const PRIORITIES: &str = "priorities";
const PREDICT: &str = "prediction (2002)";
const CHOOSE: &str = "sampling choice";

impl Cache {
    /// Nothing known, for pictures of this camera's size.
    pub fn new(options: Options, camera: &Camera) -> Self {
        Self {
            options,
            points: Points::new(capacity(&options, camera)),
            image: PointImage::default(),
            camera: *camera,
            before: None,
            priorities: Vec::new(),
            requested: Vec::new(),
            short: 0,
            moving: BTreeSet::new(),
            relight: Relight::default(),
            relit: 0,
            learnt: Learnt::default(),
            since_relit: 0,
            guide: Guide::default(),
            reconstruction: Reconstruction::default(),
            last: None,
            memory: Memory::default(),
        }
    }

    /// Other settings from now on; what is known stays.
    pub fn set(&mut self, options: Options) {
        self.options = options;
        self.fit(&self.camera.clone());
    }

    /// Points that there is room for.
    pub fn slots(&self) -> usize {
        self.points.len()
    }

    /// No point is known.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The last picture.
    pub fn shown(&self) -> Option<&Shown> {
        self.last.as_ref()
    }

    /// As many slots as pictures of this size want.
    pub(super) fn fit(&mut self, camera: &Camera) {
        let capacity = capacity(&self.options, camera);
        if !self.points.fits(capacity) {
            self.points = self.points.resized(capacity);
            self.image = PointImage::default();
        }
    }

    /// The scene was edited, in which objects stood so: points go where their objects go, and vanish with them.
    /// `is_relit`: lamps are others, and [`Self::relight`] is about to say what that does to matt points.
    pub fn edited(&mut self, scene: &Scene, changes: &[Change], poses: &[Pose], is_relit: bool) {
        self.moving.clear();
        for change in changes {
            name(&mut self.points, (&self.image, &self.camera.lens()), poses, scene, change);
            self.moving.extend(moved(scene, change));
        }
        let is_doubted = |light: &Light| !(is_relit && light.is_matt());
        if changes.iter().any(Change::is_of_light) {
            self.points.doubt(DOUBTED_LIGHTS, is_doubted);
        } else if !changes.is_empty() {
            self.points.doubt(DOUBTED, is_doubted);
        }
        if !self.moving.is_empty() {
            let moving = &self.moving;
            self.points.carry(|name| moving.contains(&name.object), |name| scene.place(name).ok());
        }
        let is_of_material = |change: &&Change| matches!(change, Change::Material { .. } | Change::OwnMaterial { .. });
        let materials: Vec<&Change> = changes.iter().filter(is_of_material).collect();
        if !materials.is_empty() {
            let is_edited = |name: &SurfacePoint| materials.iter().any(|change| is_made_anew(scene, name, change));
            let steps = if self.options.changes == Changes::Repeated { EDIT_AGES } else { 0 };
            self.points.reconsider(|name| is_edited(name).then(|| hint(scene, name)), steps);
        }
    }

    /// Lamps were edited: light is known anew, as far as that can be told.
    pub fn relight(&mut self, view: &View, was: &Lamps, is: &Lamps) {
        let revision = view.world.revision;
        self.relight = Relight::between(was, is, &view.scene, &self.relight);
        (self.relit, self.since_relit) = (revision, 0);
        self.learnt.fade(&self.relight);
        let relight = &self.relight;
        self.points.relight(|place, _, sampled| {
            let foretold = relight.foretell(sampled.light.irradiance, place, sampled.light.normal);
            sampled.light.irradiance = foretold.irradiance;
            sampled.count = foretold.count(sampled.count);
            sampled.revision = revision;
        });
    }

    /// Points that have no sample since lamps were edited are brought in line with those that have.
    pub(super) fn learn(&mut self) {
        if self.since_relit > self.points.len() {
            // What is seen was sampled anew by now.
            return self.learnt.clear();
        }
        let (correction, relit) = (self.learnt.learn(), self.relit);
        self.points.relight(|place, last, sampled| {
            if last.is_none_or(|last| last.revision < relit) {
                sampled.light.irradiance *= correction.ratio(place, sampled.light.normal);
            }
        });
    }

    /// The next picture is from here: finds what it shows, and what should be asked about. `done` hears of the steps, as
    /// [`crate::front_end::Steps`].
    pub fn tick(
        &mut self,
        camera: &Camera,
        budget: usize,
        revision: u32,
        done: &mut dyn FnMut(Option<&'static str>),
    ) -> Requests {
        self.fit(camera);
        done(None);
        if self.options.ages == Ages::Frames {
            self.points.age_by_frame(&self.moving);
            done(Some(UPDATE));
        }
        let is_resized = [camera.width, camera.height] != [self.camera.width, self.camera.height];
        let before = std::mem::replace(&mut self.camera, *camera);
        self.before = (!is_resized).then_some(before);
        self.image.clear([camera.width, camera.height]);
        done(Some(INITIALISE));
        self.image.project(&mut self.points, camera);
        done(Some(PROJECT));
        self.cull();
        done(Some(CULL));
        priorities(&self.points, &self.image, &mut self.priorities);
        done(Some(PRIORITIES));
        let mut requests = Requests::default();
        if let Some(before) = self.before.filter(|before| self.options.predict > 0 && before != camera) {
            let then = ahead(&before, camera, self.options.predict);
            let is_view = then.check().is_ok();
            let cells = if is_view { unoccupied(&self.points, &then, budget / 2) } else { Vec::new() };
            let ray = |pixel| Request { pixel, point: None, aim: None, predicted: true, repeats: None };
            requests.rays.extend(cells.into_iter().map(ray));
            requests.predicted = (!requests.rays.is_empty()).then_some(then);
            done(Some(PREDICT));
        }
        let wanted = budget - requests.rays.len() + self.short;
        let size = [self.image.width, self.image.height];
        let mut chosen = dither(&self.priorities, size, wanted.min(self.priorities.len()));
        if budget > 0 && chosen.pixels.is_empty() && requests.rays.is_empty() {
            // Of few samples and pixels all may get lost at the edges; but something is asked, or nothing is ever known.
            let most = (0..).zip(&self.priorities).max_by_key(|(pixel, worth)| (**worth, std::cmp::Reverse(*pixel)));
            chosen.pixels.extend(most.map(|(pixel, _): (u32, _)| pixel));
        }
        self.short = wanted.saturating_sub(chosen.pixels.len()).min(budget / 8);
        for pixel in &chosen.pixels {
            requests.rays.push(self.request(*pixel, revision));
        }
        self.requested = chosen.pixels;
        done(Some(CHOOSE));
        requests
    }

    pub(super) fn cull(&mut self) {
        if let Some(share) = self.options.cull {
            self.image.cull(&mut self.points, share);
        }
    }

    fn request(&self, pixel: u32, revision: u32) -> Request {
        let width = self.image.width as u32;
        let at = [pixel % width, pixel / width];
        let slot = self.image.slots[pixel as usize];
        if slot == NONE {
            return Request { pixel: at, point: None, aim: None, predicted: false, repeats: None };
        }
        let (name, last) = (self.points.name(slot), self.points.last(slot));
        let is_matt = self.points.sampled(slot).hint == Hint::Matt;
        // Of what was foretold it is known that it has changed.
        let is_old = |origin: &Origin| {
            let is_foretold = origin.revision < self.relit && self.points.light(slot).is_matt();
            origin.revision != revision && is_matt && name.is_some() && !is_foretold
        };
        let repeats = last.map(|(_, origin)| origin).filter(is_old);
        let repeats = repeats.filter(|_| self.options.changes == Changes::Repeated);
        Request { pixel: at, point: Some(self.points.id(slot)), aim: name, predicted: false, repeats }
    }

    /// The picture of the last tick, and the share of its pixels that show a point.
    pub fn picture(&mut self, scene: &Scene) -> (&Shown, f32) {
        let camera = self.camera;
        let made = &mut self.reconstruction;
        made.pixels = self.memory.take();
        let is_guided = self.options.guide && self.options.filling.surfaces;
        if is_guided {
            self.guide.look(scene, &camera);
        }
        let exact = if is_guided { &self.guide.exact[..] } else { &[] };
        made.make(&self.points, &self.image, exact, self.options.filling);
        let mut pixels = std::mem::take(&mut made.pixels);
        let last = self.last.as_ref().filter(|last| last.picture.pixels.len() == pixels.len());
        if let (Holes::Previous, Some(last)) = (self.options.holes, last) {
            for (pixel, known) in made.known.iter_mut().enumerate().filter(|(_, known)| !**known) {
                (pixels[pixel], *known) = (last.picture.pixels[pixel], true);
            }
        }
        if self.options.holes != Holes::Black {
            fill_from_around([camera.width, camera.height], &mut pixels, &mut made.known);
        }
        let picture = Arc::new(Picture { width: camera.width, height: camera.height, pixels });
        self.memory.keep(&picture);
        let Shown { mut distance, mut age, .. } = self.last.take().unwrap_or_default();
        distance.clear();
        distance.extend(self.image.depths.iter().map(|depth| if *depth == FAR { 0.0 } else { *depth }));
        age.resize(distance.len(), 1.0);
        (self.last.insert(Shown { camera, picture, distance, age }), self.image.share_known())
    }

    /// The points that pixels show, black where there is none; what a sample of each pixel is worth, 0..=255; which pixels
    /// were requested (white).
    pub fn planes(&self) -> [Picture; 3] {
        let picture = |value: &dyn Fn(usize) -> Vec3| {
            let (width, height) = (self.image.width as u32, self.image.height as u32);
            Picture { width, height, pixels: (0..self.image.slots.len()).map(value).collect() }
        };
        let point = |pixel: usize| match self.image.slots[pixel] {
            NONE => Vec3::ZERO,
            slot => self.points.light(slot).radiance(),
        };
        let worth =
            |pixel: usize| Vec3::splat(self.priorities.get(pixel).map_or(0.0, |worth| *worth as f32 / AGE_UNIT as f32));
        let mut requested = picture(&|_| Vec3::ZERO);
        for pixel in &self.requested {
            if let Some(pixel) = requested.pixels.get_mut(*pixel as usize) {
                *pixel = Vec3::ONE;
            }
        }
        [picture(&point), picture(&worth), requested]
    }
}

/// Slots of a cache for pictures of this size.
pub(super) fn capacity(options: &Options, camera: &Camera) -> usize {
    let pixels = f64::from(camera.width) * f64::from(camera.height);
    ((pixels * f64::from(options.size)) as usize).max(1)
}
