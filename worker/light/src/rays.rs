//! What single rays meet: the pixel that each would make, and the point that it meets first.
//!
//! A ray with the address of a pixel is followed and lit by what paints tiles ([`Painter`]), from the same numbers. A ray
//! with an aim goes through the very point: if it gets there, it goes on as if it had hit just that.

use glam::Vec3;
use protocol::answer::{Answer, Body, Cost, CostStage, Pixels, Seen};
use protocol::question::{BLOCK, Lit, Point, Rays, WorldState};
use scenes::{Camera, SurfacePoint};

use crate::answer::{Eye, Painter, Path, Scratch, Watch, Work, edge_in, edges_seen, light_set};
use crate::bvh::{Hit, Ray};
use crate::cache::LightSetCache;
use crate::eye;
use crate::prepared::Prepared;
use crate::surface::Surfel;

/// Answers about rays.
pub(crate) fn answer(
    prepared: &Prepared,
    cache: &LightSetCache,
    world: WorldState,
    asked: &Rays,
    clock: &dyn Fn() -> u64,
) -> Answer {
    let lens = asked.camera.lens();
    let mut view = View::open(prepared, cache, world, asked.view.as_ref(), &asked.lit, asked.through.len(), clock);
    let edges = edges_seen(prepared, cache, world, &asked.camera, &asked.lit);
    let edges = edges.as_ref().and_then(|edges| edges.get());
    view.paint(lens.origin(), |painter, scratch, number, cost| {
        let block = &asked.through[number..(number + BLOCK).min(asked.through.len())];
        let aims: Vec<Option<Aim>> =
            block.iter().map(|ray| Some(Aim::at(prepared, lens.origin(), ray.aim.as_ref()?))).collect();
        let mut start = |(slot, (ray, aim)): (usize, (&protocol::question::Ray, &Option<Aim>))| {
            let path = Path::of(&asked.lit, &ray.address);
            // What is looked for at a point is that point's alone.
            let (direction, edge) = match aim {
                Some(aim) => (aim.direction, None),
                None => (
                    eye::ray(&lens, ray.address.pixel, &path.eye, path.index).direction,
                    edge_in(prepared, edges, ray.address.pixel, scratch, cost),
                ),
            };
            Eye { slot, direction, path, edge }
        };
        let eyes: Vec<Eye> = (number..).zip(block.iter().zip(&aims)).map(&mut start).collect();
        painter.trace(&lens, &eyes, scratch);
        for (aim, hit) in aims.iter().zip(&mut scratch.hits) {
            if let Some(aim) = aim
                && hit.is_some_and(|hit| aim.is_met_by(prepared, &hit))
            {
                *hit = Some(aim.hit);
            }
        }
        eyes
    })
}

/// Answers what an eye would see at points.
pub(crate) fn towards(
    prepared: &Prepared,
    cache: &LightSetCache,
    world: WorldState,
    (view, lit): (Option<&Camera>, &Lit),
    (eye, points): (Vec3, &[Point]),
    clock: &dyn Fn() -> u64,
) -> Answer {
    let mut view = View::open(prepared, cache, world, view, lit, points.len(), clock);
    view.paint(eye, |_, scratch, number, _| {
        let block = &points[number..(number + BLOCK).min(points.len())];
        let aims: Vec<Aim> = block.iter().map(|point| Aim::at(prepared, eye, &point.at)).collect();
        scratch.hits.clear();
        scratch.hits.extend(aims.iter().map(|aim| Some(aim.hit)));
        let start = |(slot, (point, aim)): (usize, (&Point, &Aim))| Eye {
            slot,
            direction: aim.direction,
            path: Path::of(lit, &point.address),
            edge: None,
        };
        (number..).zip(block.iter().zip(&aims)).map(start).collect()
    })
}

/// A point as an eye looks at it.
struct Aim {
    /// Unit.
    direction: Vec3,
    /// What a ray in this direction would ideally hit.
    hit: Hit,
    at: Surfel,
}

impl Aim {
    fn at(prepared: &Prepared, eye: Vec3, point: &SurfacePoint) -> Self {
        let object = prepared.scene.find_point(point).expect("questions are checked before they are answered") as u32;
        let at = prepared.surfel_on(object, point);
        let offset = at.position - eye;
        // From the point itself, straight into the surface.
        let direction = offset.normalize_or(-at.geometric);
        let [u, v] = point.uv;
        Self { direction, hit: Hit { t: offset.length(), u, v, object, triangle: point.triangle }, at }
    }

    /// Whether a hit of that ray is the point, up to rounding. Beside an edge it may lie on the next triangle.
    fn is_met_by(&self, prepared: &Prepared, hit: &Hit) -> bool {
        let is_same_triangle = hit.triangle == self.hit.triangle;
        let apart = (hit.t - self.hit.t).abs() * self.at.geometric.dot(self.direction).abs();
        prepared.scene.whole_of(hit.object) == prepared.scene.whole_of(self.hit.object)
            && (is_same_triangle || apart <= 4.0 * self.at.epsilon)
    }
}

/// The answer about what is seen, as it grows.
struct View<'a> {
    prepared: &'a Prepared,
    lit: &'a Lit,
    set: std::sync::Arc<std::sync::OnceLock<crate::walk::LightSet>>,
    work: Work,
    watch: Watch<'a>,
}

impl<'a> View<'a> {
    fn open(
        prepared: &'a Prepared,
        cache: &LightSetCache,
        world: WorldState,
        view: Option<&Camera>,
        lit: &'a Lit,
        len: usize,
        clock: &'a dyn Fn() -> u64,
    ) -> Self {
        let mut watch = Watch::start(clock);
        let mut work = Work { pixels: Pixels::black(len), cost: Cost::default() };
        let set = light_set(prepared, cache, world, view, lit, &mut work.cost);
        watch.stop(&mut work.cost, CostStage::LightSets);
        Self { prepared, lit, set, work, watch }
    }

    /// Paints block by block: `trace` begins the eye paths of the block from a number on, and finds what they meet first.
    fn paint(
        &mut self,
        origin: Vec3,
        mut trace: impl FnMut(&Painter, &mut Scratch, usize, &mut Cost) -> Vec<Eye>,
    ) -> Answer {
        let mut hits = Vec::with_capacity(self.work.pixels.len());
        if let Some(set) = self.set.get() {
            let painter = Painter::new(self.prepared, set, &self.lit.quality, origin);
            let mut scratch = Scratch::default();
            for number in (0..self.work.pixels.len()).step_by(BLOCK) {
                let eyes = trace(&painter, &mut scratch, number, &mut self.work.cost);
                let name = |(eye, hit): (&Eye, &Option<Hit>)| {
                    let ray = Ray { origin, direction: eye.direction, t_max: f32::INFINITY };
                    hit.map(|hit| self.prepared.surfel(&ray, &hit).named(&self.prepared.scene, &hit))
                };
                hits.extend(eyes.iter().zip(&scratch.hits).map(name));
                painter.paint(&eyes, &mut scratch, &mut self.work, &mut self.watch);
            }
        }
        let pixels = std::mem::take(&mut self.work.pixels);
        Answer { body: Body::Seen(Seen { pixels, hits }), cost: self.work.cost }
    }
}
