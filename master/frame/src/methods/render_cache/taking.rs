//! What the cache takes in: answers, and still pictures.

use std::f32::consts::PI;

use glam::Vec3;
use protocol::answer::Seen;
use scenes::camera::Lens;
use scenes::{Camera, Change, Gloss, Scene, Surface, SurfacePoint};

use super::cache::{Cache, Request};
use super::point::{Hint, Known, Light, Origin, Place, Sampled, luminance};
use super::points::Id;
use super::project::NONE;
use super::relight::Compared;
use super::settings::{Ages, Changes};
use crate::Picture;

/// A still picture, as far as points can be made of it.
pub(super) struct Still {
    pub camera: Camera,
    /// Radiance as people saw it, and unfiltered.
    pub shown: Picture,
    pub radiance: Picture,
    pub reflectance: Picture,
    pub irradiance: Picture,
    pub normal: Picture,
    pub distance: Picture,
    /// Samples a pixel.
    pub samples: u32,
    /// Of the world.
    pub revision: u32,
}

/// A resample tells of a change if its luminance differs from the old one by more than this share of their mean …
const CHANGED: f32 = 0.1;
/// … and so many times the noise that is expected of a sample.
const NOISES: f32 = 3.0;
/// With the same random numbers: what rounding may do.
const REPEATED: f32 = 2.0 / 256.0;
/// So much older are the points around a change, in pixels so far away.
const CHANGE_AGES: u16 = 64 << 8;
const CHANGE_REACH: usize = 2;
/// Most samples that a mean of view-dependent light is made of.
const HISTORY_SPECULAR: u8 = 2;
/// Below this roughness gloss depends visibly on where the eye is.
const SHARP_GLOSS: f32 = 0.5;
/// A point of a still picture is the one that a ray hits if it lies within so many pixels.
const SAME_PIXELS: f32 = 2.0;

impl Cache {
    /// Takes over a still picture: a point for each pixel, but where one with as many samples is there already.
    pub fn seed(&mut self, still: &Still) {
        self.fit(&still.camera);
        let size = [still.camera.width, still.camera.height];
        let lens = still.camera.lens();
        let pixels = still.radiance.pixels.len();
        // What is taken over into nothing is in the order of pixels.
        let is_first = self.points.is_empty();
        self.image.clear(size);
        self.image.project(&mut self.points, &still.camera);
        self.cull();
        let count = still.samples.clamp(1, u32::from(self.options.history)) as u8;
        for pixel in 0..pixels {
            let (x, y) = (pixel as u32 % size[0], pixel as u32 / size[0]);
            let direction = lens.direction(x as f32 + 0.5, y as f32 + 0.5);
            let place = match still.distance.pixels[pixel].x {
                distance if distance > 0.0 => Place::Near(lens.origin() + direction * distance),
                _ => Place::Far(direction),
            };
            let (reflectance, irradiance) = (still.reflectance.pixels[pixel], still.irradiance.pixels[pixel]);
            let mut light = Light { reflectance, irradiance, normal: still.normal.pixels[pixel], emitted: Vec3::ZERO };
            // Rounding may leave a little less than nothing.
            light.emitted = (still.radiance.pixels[pixel] - light.radiance()).max(Vec3::ZERO);
            light.irradiance = shown_irradiance(&light, still.shown.pixels[pixel]);
            light.normal = light.normal.normalize_or_zero();
            let sampled = Sampled { light, count, revision: still.revision, hint: Hint::Matt };
            let known = Known { sampled, ..Known::default() };
            match self.image.slots[pixel] {
                NONE if is_first => self.points.put(self.points.spread(pixel, pixels), place, known),
                NONE => {
                    self.points.insert(place, known);
                }
                slot if self.points.sampled(slot).count >= count && self.options.history > 1 => self.points.renew(slot),
                slot => self.points.put(slot, place, known),
            }
        }
        // What is edited next is found in this picture.
        self.camera = still.camera;
        self.image.clear(size);
        self.image.project(&mut self.points, &still.camera);
    }

    /// Takes in a batch that was answered. The ages of all that was known before go on by as many samples.
    pub fn absorb<'a>(
        &mut self,
        scene: &Scene,
        answers: impl IntoIterator<Item = (&'a [Request], &'a [Origin], &'a Camera, &'a Seen)> + Clone,
    ) {
        if self.options.ages == Ages::Samples {
            let samples = answers.clone().into_iter().map(|(requests, ..)| requests.len()).sum();
            self.points.age_by_samples(samples, &self.moving);
        }
        if self.options.evict {
            self.points.evict();
        }
        for (requests, origins, from, seen) in answers {
            let lens = from.lens();
            for (index, (request, origin)) in requests.iter().zip(origins).enumerate() {
                self.take(scene, request, *origin, &lens, (seen, index));
            }
            self.since_relit += requests.len();
        }
        if !self.learnt.is_empty() {
            self.learn();
        }
    }

    fn take(&mut self, scene: &Scene, request: &Request, origin: Origin, lens: &Lens, (seen, index): (&Seen, usize)) {
        let Some(hit) = seen.hits.get(index) else { return };
        let pixels = &seen.pixels;
        let value = |plane: &[Vec3]| plane.get(index).copied().unwrap_or_default();
        let mut light = Light {
            emitted: value(&pixels.emitted),
            reflectance: value(&pixels.reflectance),
            irradiance: value(&pixels.irradiance),
            normal: value(&pixels.normal),
        };
        let last = Some((light.radiance(), origin));
        let place = hit.map(|name| scene.place(&name));
        let mut revision = origin.revision;
        if let Some(Ok(place)) = place
            && revision < self.relit
            && light.is_matt()
        {
            // It was asked about before lamps were edited.
            light.irradiance = self.relight.foretell(light.irradiance, place, light.normal).irradiance;
            revision = self.relit;
        }
        let known = |hint: Hint| Known { name: *hit, sampled: Sampled { light, revision, count: 1, hint }, last };
        let id = request.point.filter(|id| self.points.has(*id));
        if let Some(id) = id.filter(|_| request.aim.is_some() && *hit == request.aim) {
            // It lies where it lay.
            self.compare(id.slot, &light);
            return self.take_again(id.slot, request, known(self.points.sampled(id.slot).hint));
        }
        let place = match place {
            Some(Ok(place)) => Place::Near(place),
            Some(Err(_)) => return,
            None => Place::Far(lens.direction(request.pixel[0] as f32 + 0.5, request.pixel[1] as f32 + 0.5)),
        };
        let new = known(hit.map_or(Hint::Matt, |name| hint(scene, &name)));
        let Some(Id { slot, .. }) = id else {
            self.points.insert_near(self.slot_beside(request), place, new);
            return;
        };
        let is_same = request.aim.is_none() && self.points.name(slot).is_none() && self.is_near(lens, slot, place);
        if is_same {
            self.compare(slot, &light);
        }
        if self.has_changed(slot, &new) {
            self.doubt_around(slot);
            self.points.put(slot, place, new);
        } else {
            let known = if is_same { self.mean_with(slot, new) } else { new };
            self.points.put(slot, place, known);
        }
    }

    /// A new sample of a point that has none since lamps were edited says how right what was foretold is.
    fn compare(&mut self, slot: u32, new: &Light) {
        let foretold = self.points.light(slot);
        let is_new = self.points.last(slot).is_some_and(|(_, origin)| origin.revision >= self.relit);
        let Some(Place::Near(at)) = self.points.place(slot) else { return };
        if self.relit > 0 && self.options.relight && !is_new && new.is_matt() && foretold.is_matt() {
            let (normal, foretold) = (foretold.normal, foretold.irradiance);
            self.learnt.add(Compared { at, normal, new: new.irradiance, foretold, weight: 1.0 });
        }
    }

    /// The slot of a point that is seen beside a pixel; where there is none, that which the pixel would have if all slots were
    /// in the order of the picture.
    fn slot_beside(&self, request: &Request) -> u32 {
        let [x, y] = request.pixel.map(|at| at as usize);
        let slots = &self.image.slots;
        let pixel = (y * self.image.width + x).min(slots.len().saturating_sub(1));
        let beside = slots.get(pixel.saturating_sub(1)..(pixel + 2).min(slots.len())).unwrap_or_default();
        let shown = beside.iter().find(|slot| **slot != NONE).filter(|_| !request.predicted);
        shown.copied().unwrap_or_else(|| self.points.spread(pixel, slots.len()))
    }

    /// A sample of the very point that is there.
    fn take_again(&mut self, slot: u32, request: &Request, new: Known) {
        if let (Some(_), Some((last, was)), Some((radiance, origin))) =
            (request.repeats, self.points.last(slot), new.last)
        {
            // The same random numbers: whatever differs has changed.
            if is_alike(last, radiance, REPEATED) {
                return self.points.confirm(slot, (last, Origin { revision: origin.revision, ..was }));
            }
            self.doubt_around(slot);
            return self.points.resample(slot, new);
        }
        if self.has_changed(slot, &new) {
            self.doubt_around(slot);
            return self.points.resample(slot, new);
        }
        self.points.resample(slot, self.mean_with(slot, new));
    }

    /// A sample differs from what was known by more than noise. Within one state of the world it does not, where changes are
    /// found by repetition.
    fn has_changed(&self, slot: u32, new: &Known) -> bool {
        let noise = CHANGED + NOISES * self.options.noise;
        let old = self.points.radiance(slot);
        self.options.changes == Changes::Colours && !is_alike(old, new.sampled.light.radiance(), noise)
    }

    /// What a point is known as with one more sample.
    fn mean_with(&self, slot: u32, new: Known) -> Known {
        let most =
            if new.sampled.hint == Hint::Specular { HISTORY_SPECULAR } else { u8::MAX }.min(self.options.history);
        if most <= 1 {
            return new;
        }
        let (old, light) = (self.points.sampled(slot), new.sampled.light);
        let count = old.count.saturating_add(1).min(most);
        let mean = |old: Vec3, new: Vec3| old + (new - old) / f32::from(count);
        let light = Light {
            emitted: mean(old.light.emitted, light.emitted),
            irradiance: mean(old.light.irradiance, light.irradiance),
            ..light
        };
        Known { sampled: Sampled { light, count, ..new.sampled }, ..new }
    }

    /// A point of a still picture is where a ray has hit, up to the size of a pixel.
    fn is_near(&self, lens: &Lens, slot: u32, place: Place) -> bool {
        match (self.points.place(slot), place) {
            (Some(Place::Near(old)), Place::Near(new)) => {
                old.distance(new) <= SAME_PIXELS * lens.pixel() * lens.origin().distance(new)
            }
            (Some(Place::Far(_)), Place::Far(_)) => true,
            _ => false,
        }
    }

    /// The light of a point has changed, and so perhaps that of points around it.
    fn doubt_around(&mut self, slot: u32) {
        let Some(pixel) = self.points.pixel(slot) else { return };
        let (width, height) = (self.image.width, self.image.height);
        let (x, y) = (pixel % width.max(1), pixel / width.max(1));
        for there_y in y.saturating_sub(CHANGE_REACH)..(y + CHANGE_REACH + 1).min(height) {
            for there_x in x.saturating_sub(CHANGE_REACH)..(x + CHANGE_REACH + 1).min(width) {
                let there = self.image.slots[there_y * width + there_x];
                if there != NONE && there != slot {
                    self.points.age_early(there, CHANGE_AGES);
                }
            }
        }
    }
}

/// The irradiance that makes a point as bright as it was shown: its neighbours are lit by other light sets, which the
/// renderer's filter has evened out.
fn shown_irradiance(light: &Light, shown: Vec3) -> Vec3 {
    let reflected = (shown - light.emitted).max(Vec3::ZERO);
    let by_channel = |channel: usize| match light.reflectance[channel] {
        reflectance if reflectance > DARK => reflected[channel] * PI / reflectance,
        _ => light.irradiance[channel],
    };
    Vec3::from_array([0, 1, 2].map(by_channel))
}

/// Of what reflects less, light tells nothing of the irradiance.
const DARK: f32 = 1e-3;

/// The same radiance, up to this share of their mean luminance.
fn is_alike(a: Vec3, b: Vec3, share: f32) -> bool {
    let mean = 0.5 * (luminance(a) + luminance(b));
    luminance((a - b).abs()) <= share * mean
}

/// What a point is made of.
fn material_of(scene: &Scene, name: &SurfacePoint) -> Option<u32> {
    let mesh = scene.objects.get(name.object as usize)?.mesh as usize;
    let is_there = (name.triangle as usize) < scene.meshes[mesh].triangles.len();
    is_there.then(|| scene.material_of(scene.holder(name.object, name.triangle), name.triangle as usize))
}

/// Whether a change was of what a point is made of.
pub(super) fn is_made_anew(scene: &Scene, name: &SurfacePoint, change: &Change) -> bool {
    match change {
        Change::Material { material, .. } => material_of(scene, name) == Some(*material),
        Change::OwnMaterial { object, piece, material, .. } => {
            let Some(whole) = scene.objects.get(name.object as usize) else { return false };
            let (mesh, triangle) = (&scene.meshes[whole.mesh as usize], name.triangle as usize);
            name.object == *object
                && mesh.materials.get(triangle) == Some(material)
                && piece.is_none_or(|piece| mesh.pieces().of_triangle(triangle) == piece)
        }
        _ => false,
    }
}

/// What the renderer tells of a point.
pub(super) fn hint(scene: &Scene, name: &SurfacePoint) -> Hint {
    let material = material_of(scene, name).map(|number| &scene.materials[number as usize].surface);
    match material {
        Some(Surface::Mirror { .. } | Surface::Dielectric(_) | Surface::Glazed { .. }) => Hint::Specular,
        Some(Surface::Glossy(Gloss { roughness, .. })) if roughness.value < SHARP_GLOSS => Hint::Specular,
        _ => Hint::Matt,
    }
}
