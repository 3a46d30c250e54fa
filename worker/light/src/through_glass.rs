//! Light samples through panes and lamp glasses: what the points on lights of a set ([`crate::walk`]) bring where only
//! glass stands between.
//!
//! # A third way to find the same light
//! Photons and gather rays share what emitters send through specular surfaces ([`crate::caustics`]). Neither aims: a
//! lamp in its bulb, or a sky behind a window, is found by chance. But most glass that people build lets light pass
//! nearly straight: panes, bulbs, tubes, covers ([`Glass`]). So a point that does not see a light sample because of glass alone looks
//! in its direction all the same: a ray is sent there and *refracted*, and what it meets behind the last surface counts,
//! sample or not. It need not be an approximation of anything: a light sample is a direction drawn with a known
//! density, as good as any other.
//!
//! Of paths that pass glass and are never reflected, the three ways share each by the balance heuristic: photons by the
//! densities told there; light samples by the density of the direction ω that they give to a point x,
//! `n p(y) d²/cosθ_y` per solid angle for emitters and `n p(ω)` for the sky, where y is what lies straight ahead
//! behind glass. A cosine-distributed ray has `cosθ_x/π`; so there are `λ = π n p(ω) / cosθ_x` light samples for each ray.
//! If something else lies straight ahead, or behind other glass, λ = 0, and the other two find the path.
//!
//! Thin panes ([`scenes::Dielectric::thin`]) do not bend light at all. Through these, and no other glass, lights
//! without surface are found as well: all of such light is light samples' (λ = ∞).
//!
//! Frosted glass is not looked through. What is glass in part lets the line pass by that part, and the others by chance: what
//! each way counts depends on the path alone, so that the mean is the same.

use glam::Vec3;
use protocol::answer::Cost;
use scenes::{Needs, Rgb, Scene};

use crate::bvh::{Hit, Ray};
use crate::caustics::{self, Sharing, Ways};
use crate::chain;
use crate::emitter::Emitters;
use crate::prepared::Prepared;
use crate::surface::{Bounce, Carries, Scatter, Surfel};
use crate::vpl::{Gate, Shape, Vpl};
use crate::walk::LightSet;

/// At most so many light samples are looked for through glass from one point, as each costs a dozen rays …
const SAMPLES_MAX: usize = 2;
/// … and one, where all lie in about one direction: two would see the same. Where their mean direction is shorter than 1 by no
/// more than this, they do: those on an edge of a cone of 0.1 rad are 0.005 short.
const SCATTER_OF_ONE: f32 = 0.005;

/// Light that arrives through glass.
#[derive(Clone, Copy, Debug)]
pub struct Arriving {
    /// Unit direction that it comes from.
    pub from: Vec3,
    /// W·m⁻².
    pub irradiance: Rgb,
    /// From a light that no ray can meet.
    pub bodiless: bool,
}

/// What a straight line meets behind glass.
struct Ahead {
    /// The first glass.
    entry: Surfel,
    /// What passes all glass on the way, each crossing as if light went on straight; exact if all is thin. 1 if nobody asks.
    passes: Rgb,
    /// All glass on the way is thin.
    thin: bool,
    /// The first thing that is not glass; `None` where the line ends or leaves the scene.
    opaque: Option<(Hit, Surfel)>,
}

/// The glass that light samples are looked for through: thin panes, and what encases a lamp.
///
/// A solid that stands between throws light sideways, and its caustic is found in other ways: to look through it from
/// everywhere costs more than it finds.
#[derive(Clone, Debug, Default)]
pub struct Glass {
    /// There are thin panes.
    thin: bool,
    /// Object and triangle of emitters within the box around all solid glass, in order.
    encased: Vec<[u32; 2]>,
}

impl Glass {
    /// Looks for it; nothing where there is no glass.
    pub fn new(scene: &Scene, needs: &Needs, emitters: &Emitters) -> Self {
        let mut glass = Self::default();
        if needs.glass == 0 {
            return glass;
        }
        let mut solid: Option<[Vec3; 2]> = None;
        for (number, _) in scene.objects.iter().enumerate().filter(|(_, object)| object.visible) {
            for triangle in scene.triangles(number) {
                match scene.materials[scene.material_of(number, triangle) as usize].surface.glass() {
                    Some(pane) if pane.thin => glass.thin |= pane.may_be_clear(),
                    Some(wall) if wall.may_be_clear() => {
                        for corner in corners(scene, [number as u32, triangle as u32]) {
                            let [low, high] = solid.unwrap_or([corner; 2]);
                            solid = Some([low.min(corner), high.max(corner)]);
                        }
                    }
                    _ => {}
                }
            }
        }
        if let Some([low, high]) = solid {
            let is_within = |emitter: &[u32; 2]| {
                let middle = corners(scene, *emitter).iter().sum::<Vec3>() / 3.0;
                middle.cmpge(low).all() && middle.cmple(high).all()
            };
            let triangles = (0..emitters.len() as u32).filter_map(|source| emitters.triangle(source));
            glass.encased = triangles.filter(is_within).collect();
        }
        glass
    }

    /// Whether what is seen of an emitter, or of one that is no triangle, counts through glass of this kind.
    fn counts(&self, thin: bool, emitter: Option<[u32; 2]>) -> bool {
        thin || emitter.is_some_and(|emitter| self.encased.binary_search(&emitter).is_ok())
    }
}

fn corners(scene: &Scene, [object, triangle]: [u32; 2]) -> [Vec3; 3] {
    let object = &scene.objects[object as usize];
    let mesh = &scene.meshes[object.mesh as usize];
    mesh.triangles[triangle as usize].map(|vertex| object.scene_from_object.point(mesh.positions[vertex as usize]))
}

/// Whether light samples can be found through glass.
pub fn is_needed(prepared: &Prepared, sharing: Sharing) -> bool {
    sharing.samples() > 0.0 && (prepared.glass.thin || !prepared.glass.encased.is_empty())
}

/// What the light samples of a set bring to a surface through glass: all that may, or some of them, chosen by what they
/// would bring through open air. `u` in 0..1 chooses.
pub fn gather(
    prepared: &Prepared,
    set: &LightSet,
    x: &Surfel,
    u: impl FnOnce() -> f32,
    cost: &mut Cost,
    mut add: impl FnMut(Arriving),
) {
    let mut mean = Vec3::ZERO;
    let candidate = |vpl| {
        let (unhidden, from) = aim(prepared, vpl, x)?;
        let share = unhidden.max_element();
        mean += from * share;
        (share > 0.0).then_some((vpl, share))
    };
    let emitters = set.vpls.iter().take_while(|vpl| vpl.depth == 0);
    let candidates: Vec<(&Vpl, f32)> = emitters.filter_map(candidate).collect();
    let total: f32 = candidates.iter().map(|(_, share)| share).sum();
    let wanted = if mean.length() > (1.0 - SCATTER_OF_ONE) * total { 1 } else { SAMPLES_MAX };
    let mut arrive = |vpl: &Vpl, weight: f32| {
        if let Some(light) = arrive(prepared, set.ways(), vpl, x, cost) {
            add(Arriving { irradiance: light.irradiance * weight, ..light });
        }
    };
    if candidates.len() <= wanted {
        candidates.iter().for_each(|(vpl, _)| arrive(vpl, 1.0));
        return;
    }
    // Systematic: evenly spread over the lights, which keeps the strata of their sequence.
    let step = total / wanted as f32;
    let (mut next, mut sum) = (u() * step, 0.0);
    for (vpl, share) in candidates {
        sum += share;
        let mut weight = 0.0;
        while next < sum {
            weight += step / share;
            next += step;
        }
        if weight > 0.0 {
            arrive(vpl, weight);
        }
    }
}

/// What one light sample brings to a surface through glass; `None` if nothing, or if there is no glass between.
pub fn arrive(prepared: &Prepared, ways: Ways, vpl: &Vpl, x: &Surfel, cost: &mut Cost) -> Option<Arriving> {
    let (unhidden, from) = aim(prepared, vpl, x)?;
    let scene = &prepared.scene;
    let end = end_of(vpl, x);
    let want = if vpl.is_bodiless() { Want::Passes } else { Want::Place };
    let ahead = look(prepared, x.off(from), from, end, want, cost)?;
    if vpl.is_bodiless() {
        let irradiance = unhidden * ahead.passes;
        return (ahead.thin && ahead.opaque.is_none()).then_some(Arriving { from, irradiance, bodiless: true });
    }
    // Its strength is radiance over density; of what is there in part, rays find as much.
    let radiance = match &ahead.opaque {
        Some((hit, y)) if prepared.emitters.triangle(vpl.source) == Some([hit.object, hit.triangle]) => {
            y.emission(scene) * y.coverage(scene)
        }
        None if vpl.shape == Shape::Distant => prepared.emitters.radiance_afar(scene, vpl.source, from),
        _ => return None,
    };
    if radiance == Vec3::ZERO {
        return None;
    }
    if !prepared.glass.counts(ahead.thin, prepared.emitters.triangle(vpl.source)) {
        return None;
    }
    let mut projected = unhidden.max_element() / radiance.max_element();
    if let (Shape::Distant, Some(own)) = (&vpl.shape, vpl.density) {
        // A sun stands in a sky that has samples in this direction as well.
        projected *= own / prepared.emitters.density_of_sky(scene, ways.samples, from).max(own);
    }
    let aimed = density(prepared, ways, &ahead, x, from) * ways.sharing.samples() / x.shading.dot(from);
    let before = ahead.entry.position.distance(x.position);
    let radiance = refracted(prepared, ways, (&ahead.entry, before), from, aimed, cost);
    let irradiance = radiance * projected;
    irradiance.is_finite().then_some(Arriving { from, irradiance, bodiless: false })
}

/// Light samples for each gather ray that leaves a surface in a direction, where they may be found through glass.
pub fn aimed(prepared: &Prepared, ways: Ways, x: &Surfel, direction: Vec3, cost: &mut Cost) -> f32 {
    let cos = x.shading.dot(direction);
    if !is_needed(prepared, ways.sharing) || cos <= 0.0 || x.geometric.dot(direction) <= 0.0 {
        return 0.0;
    }
    match look(prepared, x.off(direction), direction, f32::INFINITY, Want::Place, cost) {
        Some(ahead) => density(prepared, ways, &ahead, x, direction) * ways.sharing.samples() / cos,
        None => 0.0,
    }
}

/// What of a light sample passes to a place in a straight line through glass: for choosing lights by.
pub fn passes(prepared: &Prepared, vpl: &Vpl, place: Vec3, cost: &mut Cost) -> Rgb {
    let direction = match vpl.shape {
        Shape::Distant => vpl.normal,
        _ => (vpl.position - place).normalize_or_zero(),
    };
    if direction == Vec3::ZERO || prepared.targets.far_end(place, direction) <= 0.0 {
        return Vec3::ZERO;
    }
    if !prepared.glass.counts(prepared.glass.thin, prepared.emitters.triangle(vpl.source)) {
        return Vec3::ZERO;
    }
    let end = if vpl.shape == Shape::Distant { f32::INFINITY } else { (vpl.position - place).length() };
    match look(prepared, place, direction, end, Want::Passes, cost) {
        Some(Ahead { passes, opaque: None, .. }) => passes,
        _ => Vec3::ZERO,
    }
}

/// Irradiance of a light sample if nothing were between, and the direction that it comes from; `None` if it brings
/// nothing or no glass can be between.
fn aim(prepared: &Prepared, vpl: &Vpl, x: &Surfel) -> Option<(Rgb, Vec3)> {
    let (unhidden, from) = vpl.irradiance(x.position, x.shading, Gate::Open);
    let is_lit = unhidden != Vec3::ZERO
        && x.geometric.dot(from) > 0.0
        && prepared.glass.counts(prepared.glass.thin, prepared.emitters.triangle(vpl.source));
    (is_lit && prepared.targets.far_end(x.off(from), from) > 0.0).then_some((unhidden, from))
}

/// Where a line from x to a light sample ends, which is nowhere if what shines has a surface.
fn end_of(vpl: &Vpl, x: &Surfel) -> f32 {
    match vpl.shape {
        Shape::Point | Shape::Spot { .. } | Shape::Luminaire(_) => vpl.position.distance(x.position),
        Shape::Surface | Shape::Glossy { .. } | Shape::Distant => f32::INFINITY,
    }
}

/// What is wanted of a look ahead.
#[derive(Clone, Copy, PartialEq)]
enum Want {
    /// What is there.
    Place,
    /// Also how much light passes.
    Passes,
}

/// Looks straight ahead through glass; `None` if the first thing ahead is not glass.
fn look(
    prepared: &Prepared,
    mut origin: Vec3,
    direction: Vec3,
    mut end: f32,
    want: Want,
    cost: &mut Cost,
) -> Option<Ahead> {
    let mut found: Option<Ahead> = None;
    for _ in 0..chain::LONGEST {
        cost.shadow_rays += 1;
        let ray = Ray { origin, direction, t_max: end };
        let Some(hit) = prepared.world.closest(&ray) else { return found };
        let at = prepared.surfel(&ray, &hit);
        let (scatter, share) = at.straight(&prepared.scene);
        let Scatter::Glass { thin, .. } = scatter else {
            return found.map(|ahead| Ahead { opaque: Some((hit, at)), ..ahead });
        };
        let ahead = found.get_or_insert(Ahead { entry: at, passes: Vec3::ONE, thin: true, opaque: None });
        ahead.thin &= thin;
        if want == Want::Passes {
            let left = prepared.left(None, &at, direction, hit.t);
            ahead.passes *= passing(&scatter, &at, direction, Carries::Flux)?.weight * left * share;
        }
        origin = at.off(direction);
        end -= hit.t;
    }
    None
}

/// Density with which directions of light samples lead to what lies ahead, sr⁻¹, each set having one.
fn density(prepared: &Prepared, ways: Ways, ahead: &Ahead, x: &Surfel, direction: Vec3) -> f32 {
    let met = ahead.opaque.as_ref().map(|(hit, _)| [hit.object, hit.triangle]);
    if !prepared.glass.counts(ahead.thin, met) {
        return 0.0;
    }
    match &ahead.opaque {
        None => prepared.emitters.density_of_sky(&prepared.scene, ways.samples, direction),
        Some((_, y)) if y.emission(&prepared.scene) == Vec3::ZERO => 0.0,
        Some((hit, y)) => {
            let cos = -y.geometric.dot(direction);
            let area = prepared.emitters.density(&prepared.scene, ways.samples, hit.object, hit.triangle);
            area * y.position.distance_squared(x.position) / cos.max(f32::MIN_POSITIVE)
        }
    }
}

/// Radiance along a ray that passes glass, met from a direction, and is never reflected: the share of light samples in
/// it, of which there are `aimed` for each gather ray.
fn refracted(
    prepared: &Prepared,
    ways: Ways,
    (entry, before): (&Surfel, f32),
    mut direction: Vec3,
    aimed: f32,
    cost: &mut Cost,
) -> Rgb {
    let scene = &prepared.scene;
    let (mut shone, mut at) = (Vec3::ZERO, *entry);
    let mut throughput = prepared.left(None, &at, direction, before);
    for _ in 0..chain::LONGEST {
        let (scatter, share) = at.straight(scene);
        let Some(on) = passing(&scatter, &at, direction, Carries::Radiance) else { return shone };
        throughput *= on.weight * share;
        let medium = prepared.medium(&at, on.direction);
        direction = on.direction;
        cost.shadow_rays += 1;
        let ray = Ray { origin: on.origin, direction, t_max: f32::INFINITY };
        let Some(hit) = prepared.world.closest(&ray) else {
            for (radiance, density) in caustics::seen_afar(prepared, ways, &ray) {
                shone += throughput * radiance * ways.sharing.of_samples(density, aimed);
            }
            return shone;
        };
        at = prepared.surfel(&ray, &hit);
        throughput *= prepared.left(medium, &at, direction, hit.t);
        let radiance = at.emission(scene);
        if radiance != Vec3::ZERO {
            let share = ways.sharing.of_samples(caustics::density_at_emitter(prepared, ways, &ray, &hit, &at), aimed);
            shone += throughput * radiance * share;
        }
    }
    shone
}

/// The way through glass; `None` if it is none, or reflects all.
fn passing(scatter: &Scatter, at: &Surfel, incoming: Vec3, carries: Carries) -> Option<Bounce> {
    match scatter {
        Scatter::Glass { .. } => {
            scatter.branches(at, incoming, carries, [0.0; 2]).into_iter().flatten().find(|bounce| !bounce.reflected)
        }
        _ => None,
    }
}
