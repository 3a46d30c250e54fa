//! Discomfort glare of a view: UGR by CIE 117, from rays to the lamps and the indirect illuminance at the eye.

use frame::measure::{Measured, Patch, patches, ugr};
use protocol::answer::{Body, Seen};
use protocol::question::{Ask, Asked, Lit, Part, Question, Ray, Rays, Ticket, points_per_question};
use scenes::photometry::photometric;
use scenes::{Light, Scene, Surface, SurfacePoint};
use serde_json::{Value, json};

use super::asking::{Asking, MICROS_EACH, address, quality, settled};
use super::spoken;
use runtime::cluster::Cluster;
use runtime::console::Console;
use runtime::failure::Failure;
use runtime::interrupt::Interrupt;

/// The eye's point is asked about so often at once: its light paths differ, its light set is the same.
const AT_ONCE: usize = 16;

/// What was found.
pub(crate) struct Glare {
    /// UGR; `None` if no lamp is seen, or nothing is behind it.
    ugr: Option<Measured>,
    /// Background luminance, cd/m².
    background: Measured,
    /// Steradians of lamps that are seen, and their mean luminance, cd/m².
    seen: f64,
    luminance: f64,
    /// Lamps that have no surface, and so no luminance.
    without_surface: usize,
}

impl Glare {
    /// Asks what the eye sees of the lamps, and how bright its surroundings are at `eye`; `None` if somebody wants it to end
    /// before anything is known.
    pub(super) fn find(
        asking: &Asking,
        scene: &Scene,
        eye: SurfacePoint,
        (cluster, interrupt, console): (&mut Cluster, &Interrupt, &mut Console),
    ) -> Result<Option<Self>, Failure> {
        let patches = patches(scene);
        let Some(answers) = settled(rays(asking, scene, &patches), cluster, interrupt, console)? else {
            return Ok(None);
        };
        let looks = answers.into_iter().filter_map(Body::seen).flat_map(looks);
        let seen: Vec<(Patch, f64)> = patches
            .iter()
            .zip(looks)
            .filter(|(patch, (hit, _))| hit.is_some_and(|hit| is_patch(&hit, patch) || lets_through(scene, &hit)))
            .map(|(patch, (_, luminance))| (*patch, luminance))
            .collect();
        let tally = asking.ask(&[eye; AT_ONCE], &Part::Indirect, cluster, interrupt, console)?.tally;
        let figures = tally.figures().filter(|_| tally.rounds() > 0);
        Ok(figures.map(|figures| Self::of(&seen, figures.average, without_surface(scene))))
    }

    /// Of patches with their luminances, and the indirect illuminance at the eye, lx.
    fn of(seen: &[(Patch, f64)], illuminance: Measured, without_surface: usize) -> Self {
        let Measured { value, within } = illuminance;
        let background = Measured { value: value / std::f64::consts::PI, within: within / std::f64::consts::PI };
        let rated = ugr(background.value, seen.iter().copied()).map(|ugr| {
            // To first order, of the logarithm.
            Measured { value: ugr, within: 8.0 / std::f64::consts::LN_10 * within / value }
        });
        let solid_angle: f64 = seen.iter().map(|(patch, _)| patch.solid_angle).sum();
        let all: f64 = seen.iter().map(|(patch, luminance)| patch.solid_angle * luminance).sum();
        let luminance = if solid_angle > 0.0 { all / solid_angle } else { 0.0 };
        Self { ugr: rated, background, seen: solid_angle, luminance, without_surface }
    }

    /// In words: the rating, and what it is of.
    pub(super) fn said(&self) -> [String; 2] {
        let rating = match self.ugr {
            Some(Measured { value, within }) => format!("UGR {value:.1} ± {within:.1}"),
            None => "no UGR: no lamp that glows is seen, or nothing around it is lit".to_owned(),
        };
        let mut of = format!(
            "by CIE 117: background luminance {}, lamps of {:.4} sr and {:.0} cd/m² on average",
            spoken(self.background, " cd/m²"),
            self.seen,
            self.luminance
        );
        if self.without_surface > 0 {
            of += &format!("; {} lamps without a surface are not in it", self.without_surface);
        }
        [rating, of]
    }

    /// For programs.
    pub(super) fn json(&self) -> Value {
        let figure = |Measured { value, within }: Measured| json!({ "value": value, "within": within });
        json!({
            "ugr": self.ugr.map(figure),
            "background": figure(self.background),
            "solid_angle": self.seen,
            "luminance": self.luminance,
            "lamps_without_surface": self.without_surface,
        })
    }
}

/// A ray to the middle of each patch.
fn rays(asking: &Asking, scene: &Scene, patches: &[Patch]) -> Vec<Asked> {
    let world = asking.world;
    let lit = Lit { set: 0, frame: 0, seed: asking.seed, quality: quality() };
    let through: Vec<Ray> =
        (0..).zip(patches).map(|(number, patch)| Ray { address: address(number, 0), aim: Some(patch.at) }).collect();
    let ask = |(slot, through): (usize, &[Ray])| {
        let rays = Rays { camera: scene.camera, view: None, through: through.to_vec(), lit };
        Asked::new(Ticket { batch: 0, slot: slot as u32 }, Question { world, ask: Ask::Rays(rays) })
    };
    through.chunks(points_per_question(MICROS_EACH)).enumerate().map(ask).collect()
}

/// What each ray meets, and the luminance of what shines there, cd/m²: without what it reflects.
fn looks(seen: Seen) -> Vec<(Option<SurfacePoint>, f64)> {
    let Seen { pixels, hits } = seen;
    hits.into_iter().zip(pixels.emitted).map(|(hit, radiance)| (hit, f64::from(photometric(radiance)))).collect()
}

fn is_patch(hit: &SurfacePoint, patch: &Patch) -> bool {
    (hit.object, hit.triangle, hit.uv) == (patch.at.object, patch.at.triangle, patch.at.uv)
}

/// Glass and paper before a lamp: what is seen through them counts.
fn lets_through(scene: &Scene, hit: &SurfacePoint) -> bool {
    let Ok(object) = scene.find_point(hit) else { return false };
    let material = &scene.materials[scene.material_of(object, hit.triangle as usize) as usize];
    matches!(material.surface, Surface::Dielectric(_) | Surface::Glazed { .. } | Surface::Translucent { .. })
}

fn without_surface(scene: &Scene) -> usize {
    scene.lights.iter().filter(|light| !matches!(light, Light::Directional { .. })).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rating_is_said_with_what_it_is_of_and_its_error() {
        let patch = Patch { at: SurfacePoint::default(), solid_angle: 0.02, index: 2.0 };
        let illuminance = Measured { value: 40.0 * std::f64::consts::PI, within: std::f64::consts::PI };
        let glare = Glare::of(&[(patch, 10_000.0)], illuminance, 3);
        let expected = 8.0 * (0.25_f64 / 40.0 * 1e8 * 0.02 / 4.0).log10();
        let Measured { value, within } = glare.ugr.unwrap();
        assert!((value - expected).abs() < 1e-9, "{value}, not {expected}");
        // A background 1 cd/m² brighter.
        let brighter = 8.0 * (41.0_f64 / 40.0).log10();
        assert!((within - brighter).abs() < 0.02 * brighter, "{within}, not {brighter}");
        let [rating, of] = glare.said();
        assert_eq!(rating, format!("UGR {expected:.1} ± 0.1"));
        assert!(of.contains("lamps of 0.0200 sr and 10000 cd/m²") && of.contains("3 lamps without a surface"), "{of}");
        assert!(Glare::of(&[], illuminance, 0).said()[0].contains("no UGR"));
    }
}
