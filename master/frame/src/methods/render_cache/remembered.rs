//! The cache as a memory: answers go in, pictures and questions come out.

use protocol::answer::Body;
use protocol::question::{Asked, Quality, Ticket};
use scenes::{Camera, Change};

use super::asking::{Asking, Batch};
use super::cache::{Cache, UPDATE};
use super::lamps::Lamps;
use super::naming::{Pose, poses};
use super::points::Points;
use super::settings::{Options, POINTS, PRIORITY, REQUESTS};
use super::taking::Still;
use crate::Picture;
use crate::front_end::{Effort, Held, Plane, Settings, View};
use crate::methods::at_once::{Memory, for_any_eye};
use crate::parts::reproject::Shown;

/// What a cache knows, or that there is none yet, because nobody knows the size of pictures.
pub(super) struct Remembered {
    quality: fn(&Settings) -> Quality,
    settings: Settings,
    options: Options,
    cache: Option<Cache>,
    /// How its objects stand.
    poses: Vec<Pose>,
    /// What shines in it; nothing, if nobody needs to know.
    lamps: Option<Lamps>,
    /// Batches so far.
    number: u32,
}

/// Work of an eye path, in units of a light's.
const EYE_WORK: f64 = 10.0;

impl Remembered {
    /// Nothing, to be lit by the renderer that these settings are of.
    pub fn new(quality: fn(&Settings) -> Quality, settings: &Settings) -> Self {
        let (settings, options) = (settings.clone(), Options::of(settings));
        Self { quality, settings, options, cache: None, poses: Vec::new(), lamps: None, number: 0 }
    }

    fn cache(&mut self, camera: &Camera) -> &mut Cache {
        self.cache.get_or_insert_with(|| Cache::new(self.options, camera))
    }
}

impl Memory for Remembered {
    type Batch = Batch;

    const UPDATE: &'static str = UPDATE;

    fn turn(&mut self, settings: &Settings) {
        (self.settings, self.options) = (settings.clone(), Options::of(settings));
        if let Some(cache) = &mut self.cache {
            cache.set(self.options);
        }
    }

    fn is_empty(&self) -> bool {
        self.cache.as_ref().is_none_or(Cache::is_empty)
    }

    fn reset(&mut self) {
        self.cache = None;
    }

    fn move_to(&mut self, view: &View, changes: &[Change], is_edited: bool) {
        let is_known = self.options.relight && !is_edited && self.lamps.is_some();
        let lamps = (self.options.relight && !is_known).then(|| Lamps::of(&view.scene));
        if let Some(cache) = &mut self.cache {
            let lamps = self.lamps.as_ref().zip(lamps.as_ref());
            let relit = lamps.filter(|(was, is)| was != is);
            cache.edited(&view.scene, changes, &self.poses, relit.is_some());
            if let Some((was, is)) = relit {
                cache.relight(view, was, is);
            }
        }
        self.lamps = lamps.or(self.lamps.take()).filter(|_| self.options.relight);
        if is_edited || self.poses.is_empty() {
            self.poses = poses(&view.scene);
        }
    }

    fn begin_with(&mut self, view: &View, still: &mut dyn FnMut(Plane) -> Picture, frames: u32) {
        let still = Still {
            camera: view.camera,
            shown: still(Plane::Final),
            radiance: still(Plane::Raw),
            reflectance: still(Plane::Albedo),
            irradiance: still(Plane::Irradiance),
            normal: still(Plane::Normal),
            distance: still(Plane::Distance),
            samples: frames,
            revision: view.world.revision,
        };
        self.cache(&view.camera).seed(&still);
    }

    fn absorb(&mut self, view: &View, batch: &Batch, answers: &[Option<Body>]) {
        let Some(cache) = &mut self.cache else { return };
        let answers = batch.parts.iter().zip(answers).filter_map(|(part, body)| match body {
            Some(Body::Seen(seen)) if seen.hits.len() == part.requests.len() => {
                Some((&part.requests[..], &part.origins[..], &part.camera, seen))
            }
            _ => None,
        });
        cache.absorb(&view.scene, answers);
    }

    fn forget(&mut self, _: &Batch) {}

    fn tick(&mut self, view: &View, samples: usize, done: &mut dyn FnMut(Option<&'static str>)) -> Option<Batch> {
        let View { world, camera, seed, .. } = *view;
        let requests = self.cache(&camera).tick(&camera, samples, world.revision, done);
        if requests.rays.is_empty() {
            return None;
        }
        let quality = for_any_eye(&(self.quality)(&self.settings));
        let asking = Asking { world, camera, seed, quality, number: self.number };
        self.number = self.number.wrapping_add(1);
        Some(asking.batch(&requests))
    }

    fn questions(batch: &Batch, ticket: &dyn Fn(usize) -> Ticket) -> Vec<Asked> {
        let parts = batch.parts.iter().enumerate();
        parts.map(|(slot, part)| Asked::new(ticket(slot), part.question.clone())).collect()
    }

    fn picture(&mut self, view: &View) -> (&Shown, f32) {
        self.cache(&view.camera).picture(&view.scene)
    }

    fn shown(&self) -> Option<&Shown> {
        self.cache.as_ref()?.shown()
    }

    fn plane(&self, plane: Plane) -> Option<Picture> {
        let name = match plane {
            Plane::Own(name @ (POINTS | PRIORITY | REQUESTS)) => name,
            _ => return None,
        };
        let [points, priority, requested] = self.cache.as_ref()?.planes();
        Some(match name {
            POINTS => points,
            PRIORITY => priority,
            _ => requested,
        })
    }

    fn samples(&self, camera: &Camera, Effort(share): Effort) -> usize {
        let pixels = f64::from(camera.width) * f64::from(camera.height);
        let wanted = self.options.budget.map_or((pixels * f64::from(share)).round(), f64::from);
        wanted.clamp(1.0, pixels.max(1.0)) as usize
    }

    fn work(&self, samples: usize) -> f64 {
        let quality = (self.quality)(&self.settings);
        samples as f64 * (EYE_WORK + f64::from(quality.light_samples) + f64::from(quality.vpls))
    }

    fn held(&self) -> Held {
        let count = self.cache.as_ref().map_or(0, Cache::slots);
        Held { of: "point", count, bytes: count * Points::BYTES }
    }
}
