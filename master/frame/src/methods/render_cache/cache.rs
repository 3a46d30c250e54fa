//! The display process as a state machine: answers go in, a camera goes in, a picture and the next requests come out.
//!
//! One *tick* is one shown picture. What is known after it is a function of what went in, in order: there is no clock, and
//! no answer goes in but with the whole batch that it belongs to.

use std::collections::BTreeSet;
use std::f32::consts::PI;

use glam::Vec3;
use protocol::answer::Seen;
use scenes::camera::Lens;
use scenes::{Camera, Change, Scene, Surface, SurfacePoint};

use super::naming::{Pose, moved, name};
use super::points::{AGE_UNIT, Hint, Id, Known, Light, Origin, Place, Points};
use super::project::{FAR, NONE, PointImage};
use super::reconstruct::reconstruct;
use super::sampling::{ahead, dither, priorities, unoccupied};
use super::settings::{Ages, Changes, Holes, Options};
use crate::Picture;
use crate::parts::reproject::{Fresh, Shown, Steady};

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

/// See the module's documentation.
#[derive(Clone, Debug)]
pub(super) struct Cache {
    options: Options,
    points: Points,
    image: PointImage,
    camera: Camera,
    /// The camera of the tick before.
    before: Option<Camera>,
    priorities: Vec<u32>,
    /// Pixels that the last tick requested.
    requested: Vec<u32>,
    /// Requests that error diffusion was short of.
    short: usize,
    /// Objects that the last look moved.
    moving: BTreeSet<u32>,
    /// The last picture.
    last: Option<Shown>,
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
/// What a mean of a still picture counts as after an edit: of lamps and materials, and of anything else.
const DOUBTED_LIGHTS: u8 = 0;
const DOUBTED: u8 = 2;
/// So much older are points whose material was edited.
const EDIT_AGES: u16 = 128 << 8;
/// Most samples that a mean of view-dependent light is made of.
const HISTORY_SPECULAR: u8 = 2;
/// Below this roughness gloss depends visibly on where the eye is.
const SHARP_GLOSS: f32 = 0.5;
/// A point of a still picture is the one that a ray hits if it lies within so many pixels.
const SAME_PIXELS: f32 = 2.0;

/// Steps of a picture, as table 1 of 1999 has them; its request of samples in three.
pub(super) const UPDATE: &str = "update render cache";
const INITIALISE: &str = "initialize buffers";
const PROJECT: &str = "point projection";
const CULL: &str = "depth cull";
pub(super) const INTERPOLATE: &str = "interpolation";
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
            last: None,
        }
    }

    /// Other settings from now on; what is known stays.
    pub fn set(&mut self, options: Options) {
        self.options = options;
        self.fit(&self.camera.clone());
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
    fn fit(&mut self, camera: &Camera) {
        let capacity = capacity(&self.options, camera);
        if Points::new(0).len().max(capacity.next_multiple_of(super::points::GROUP)) != self.points.len() {
            self.points = self.points.resized(capacity);
            self.image = PointImage::default();
        }
    }

    /// The scene was edited, in which objects stood so: points go where their objects go, and vanish with them.
    pub fn edited(&mut self, scene: &Scene, changes: &[Change], poses: &[Pose]) {
        self.moving.clear();
        let mut materials = BTreeSet::new();
        for change in changes {
            if let Change::Material { material, .. } = change {
                materials.insert(*material);
            }
            name(&mut self.points, (&self.image, &self.camera.lens()), poses, scene, change);
            self.moving.extend(moved(scene, change));
        }
        let changes_lights = |change: &Change| matches!(change, Change::Light { .. } | Change::Material { .. });
        if changes.iter().any(changes_lights) {
            self.points.doubt(DOUBTED_LIGHTS);
        } else if !changes.is_empty() {
            self.points.doubt(DOUBTED);
        }
        if !self.moving.is_empty() {
            let moving = &self.moving;
            self.points.carry(|name| moving.contains(&name.object), |name| scene.place(name).ok());
        }
        if !materials.is_empty() && self.options.changes == Changes::Repeated {
            for slot in 0..self.points.len() as u32 {
                let name = self.points.known(slot).name;
                if name.is_some_and(|name| material_of(scene, &name).is_some_and(|number| materials.contains(&number)))
                {
                    self.points.age_early(slot, EDIT_AGES);
                }
            }
        }
    }

    /// Takes over a still picture: a point for each pixel, but where one with as many samples is there already.
    pub fn seed(&mut self, still: &Still) {
        self.fit(&still.camera);
        let size = [still.camera.width, still.camera.height];
        let lens = still.camera.lens();
        self.image.clear(size);
        self.image.project(&mut self.points, &lens);
        self.cull();
        let count = still.samples.clamp(1, u32::from(self.options.history)) as u8;
        for pixel in 0..still.radiance.pixels.len() {
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
            let known = Known { name: None, light, count, revision: still.revision, hint: Hint::Matt, last: None };
            match self.image.slots[pixel] {
                NONE => {
                    self.points.insert(place, known);
                }
                slot if self.points.known(slot).count >= count && self.options.history > 1 => self.points.renew(slot),
                slot => self.points.put(slot, place, known),
            }
        }
        // What is edited next is found in this picture.
        self.camera = still.camera;
        self.image.clear(size);
        self.image.project(&mut self.points, &lens);
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
        }
    }

    fn take(&mut self, scene: &Scene, request: &Request, origin: Origin, lens: &Lens, (seen, index): (&Seen, usize)) {
        let Some(hit) = seen.hits.get(index) else { return };
        let pixels = &seen.pixels;
        let value = |plane: &[Vec3]| plane.get(index).copied().unwrap_or_default();
        let light = Light {
            emitted: value(&pixels.emitted),
            reflectance: value(&pixels.reflectance),
            irradiance: value(&pixels.irradiance),
            normal: value(&pixels.normal),
        };
        let place = match hit {
            Some(name) => match scene.place(name) {
                Ok(place) => Place::Near(place),
                Err(_) => return,
            },
            None => Place::Far(lens.direction(request.pixel[0] as f32 + 0.5, request.pixel[1] as f32 + 0.5)),
        };
        let hint = hit.map_or(Hint::Matt, |name| hint(scene, &name));
        let new = Known {
            name: *hit,
            light,
            count: 1,
            revision: origin.revision,
            hint,
            last: Some((light.radiance(), origin)),
        };
        let Some(id) = request.point.filter(|id| self.points.has(*id)) else {
            self.points.insert(place, new);
            return;
        };
        let old = *self.points.known(id.slot);
        let is_same = match (request.aim, old.name) {
            (Some(aim), _) => *hit == Some(aim),
            (None, None) => self.is_near(lens, id.slot, place),
            (None, Some(_)) => false,
        };
        if let (Some(_), true, Some((last, was))) = (request.repeats, is_same, old.last) {
            // The same random numbers: whatever differs has changed.
            if is_alike(last, light.radiance(), REPEATED) {
                return self.points.confirm(id.slot, (last, Origin { revision: origin.revision, ..was }));
            }
            return self.change(id.slot, place, new);
        }
        let noise = CHANGED + NOISES * self.options.noise;
        let has_changed = match self.options.changes {
            Changes::Ignored => false,
            Changes::Colours => !is_alike(old.light.radiance(), light.radiance(), noise),
            // Within one state of the world, samples of a point differ by noise alone.
            Changes::Repeated => false,
        };
        if has_changed {
            return self.change(id.slot, place, new);
        }
        let most = if hint == Hint::Specular { HISTORY_SPECULAR } else { u8::MAX }.min(self.options.history);
        if !is_same || most <= 1 {
            return self.points.put(id.slot, place, new);
        }
        let count = old.count.saturating_add(1).min(most);
        let mean = |old: Vec3, new: Vec3| old + (new - old) / f32::from(count);
        let light = Light {
            emitted: mean(old.light.emitted, light.emitted),
            irradiance: mean(old.light.irradiance, light.irradiance),
            ..light
        };
        self.points.put(id.slot, place, Known { light, count, ..new });
    }

    /// A point of a still picture is where a ray has hit, up to the size of a pixel.
    fn is_near(&self, lens: &Lens, slot: u32, place: Place) -> bool {
        match (self.points.places()[slot as usize], place) {
            (Some(Place::Near(old)), Place::Near(new)) => {
                old.distance(new) <= SAME_PIXELS * lens.pixel() * lens.origin().distance(new)
            }
            (Some(Place::Far(_)), Place::Far(_)) => true,
            _ => false,
        }
    }

    /// The light of a point has changed, and so perhaps that of points around it.
    fn change(&mut self, slot: u32, place: Place, new: Known) {
        if let Some(pixel) = self.points.pixel(slot) {
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
        self.points.put(slot, place, new);
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
        self.image.project(&mut self.points, &camera.lens());
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

    fn cull(&mut self) {
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
        let known = self.points.known(slot);
        let is_old = |origin: &Origin| origin.revision != revision && known.hint == Hint::Matt && known.name.is_some();
        let last = known.last.map(|(_, origin)| origin);
        let repeats = last.filter(|origin| self.options.changes == Changes::Repeated && is_old(origin));
        Request { pixel: at, point: Some(self.points.id(slot)), aim: known.name, predicted: false, repeats }
    }

    /// The picture of the last tick, and the share of its pixels that show a point.
    pub fn picture(&mut self) -> (&Shown, f32) {
        let camera = self.camera;
        let made = reconstruct(&self.points, &self.image, self.options.filling);
        let (width, height) = (camera.width, camera.height);
        let (mut pixels, mut known) = (made.pixels, made.known);
        let last = self.last.as_ref().filter(|last| last.picture.pixels.len() == pixels.len());
        if let (Holes::Previous, Some(last)) = (self.options.holes, last) {
            for (pixel, known) in known.iter_mut().enumerate().filter(|(_, known)| !**known) {
                (pixels[pixel], *known) = (last.picture.pixels[pixel], true);
            }
        }
        let distance = self.image.depths.iter().map(|depth| if *depth == FAR { 0.0 } else { *depth }).collect();
        let picture = Picture { width, height, pixels };
        if self.options.holes == Holes::Black {
            known.fill(true);
        }
        let shown = Fresh { camera, picture, distance, known }.after(None, Steady::Off);
        (self.last.insert(shown), self.image.share_known())
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
            slot => self.points.known(slot).light.radiance(),
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
    let luminance = |colour: Vec3| colour.dot(LUMINANCE);
    let mean = 0.5 * (luminance(a) + luminance(b));
    luminance((a - b).abs()) <= share * mean
}

/// Rec. 709.
const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

fn material_of(scene: &Scene, name: &SurfacePoint) -> Option<u32> {
    let object = scene.objects.get(name.object as usize)?;
    scene.meshes[object.mesh as usize].materials.get(name.triangle as usize).copied()
}

/// What the renderer tells of a point.
fn hint(scene: &Scene, name: &SurfacePoint) -> Hint {
    let material = material_of(scene, name).map(|number| &scene.materials[number as usize].surface);
    match material {
        Some(Surface::Mirror { .. } | Surface::Dielectric(_) | Surface::Glazed { .. }) => Hint::Specular,
        Some(Surface::Glossy { roughness, .. }) if roughness.value < SHARP_GLOSS => Hint::Specular,
        _ => Hint::Matt,
    }
}
