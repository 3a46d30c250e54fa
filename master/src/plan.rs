//! `igi-master plan`: what a scene uses, and what is left out for it.

use protocol::answer::Fields;
use protocol::question::{Bound, Quality};
use scenes::Needs;
use serde_json::{Value, json};

use crate::cli::PlanArgs;
use crate::failure::{Failure, Success};
use crate::narrator::print;

/// Prints the plan.
///
/// # Errors
/// [`Failure::Scene`] if the scene cannot be read.
pub fn plan(args: &PlanArgs) -> Result<Success, Failure> {
    let loaded = scenes::read::load(&args.scene)?;
    let needs = Needs::of(&loaded.scene);
    let parts = parts(&needs, &args.knobs.quality());
    if args.json {
        print(&format!("{}\n", as_json(&needs, &parts)));
        return Ok(Success::Done);
    }
    for note in &loaded.notes {
        eprintln!("{note}");
    }
    let mut text = format!("{}\n{} objects, {} triangles\n", args.scene.display(), needs.objects, needs.triangles);
    for kind in ["stage", "record", "field", "kernel"] {
        text += &format!("\n{kind}s\n");
        for part in parts.iter().filter(|part| part.kind == kind) {
            text += &format!("  {}  {:<22} {}\n", if part.used { "yes" } else { "  -" }, part.name, part.why);
        }
    }
    print(&text);
    Ok(Success::Done)
}

/// Something that is done or kept for a scene, or left out.
struct Part {
    kind: &'static str,
    name: &'static str,
    used: bool,
    why: String,
}

/// All parts. Leaving one out changes no pixel, only time.
fn parts(needs: &Needs, quality: &Quality) -> Vec<Part> {
    let fields = Fields::of(needs);
    let diffuse_light = needs.light() && needs.diffuse > 0;
    let caustics = needs.caustics() && quality.photons > 0;
    let delta = needs.point_lights + needs.spot_lights + needs.directional_lights;
    let finite = needs.emissive_triangles > 0 || needs.environment;
    let remainder = quality.remainder && quality.bound != Bound::None && diffuse_light;
    let many = |count: u32, one: &str, more: &str| format!("{count} {}", if count == 1 { one } else { more });
    let part = |kind, name, used, why: String| Part { kind, name, used, why };
    let nothing_lit = || if needs.light() { "nothing is diffuse" } else { "nothing shines" }.to_string();
    let specular = format!(
        "{}, {}",
        many(needs.mirrors, "mirror material", "mirror materials"),
        many(needs.glass, "glass material", "glass materials")
    );
    vec![
        part("stage", "eye paths", true, "always".into()),
        part("stage", "specular chains", needs.specular(), specular.clone()),
        part("stage", "virtual lights", diffuse_light, if diffuse_light { lights(needs) } else { nothing_lit() }),
        part(
            "stage",
            "caustic photons",
            caustics,
            match (needs.caustics(), caustics) {
                (true, true) => format!("light meets {specular}"),
                (true, false) => "--photons 0: caustics are missing from the picture".into(),
                (false, _) if !needs.specular() => "no mirror and no glass".into(),
                (false, _) => nothing_lit(),
            },
        ),
        part(
            "stage",
            "remainder rays",
            remainder,
            match (diffuse_light, quality.remainder, quality.bound) {
                (false, ..) => nothing_lit(),
                (_, _, Bound::None) => "virtual lights are not bounded".into(),
                (_, false, _) => "--no-remainder: corners are too dark for ever".into(),
                _ => "virtual lights are bounded, what that cuts off is traced".into(),
            },
        ),
        part(
            "stage",
            "discontinuity buffer",
            fields.surface,
            if fields.surface { "something diffuse is lit".into() } else { nothing_lit() },
        ),
        part(
            "record",
            "light importance",
            quality.importance && needs.light(),
            match (needs.light(), quality.importance) {
                (false, _) => "nothing shines".into(),
                (_, false) => "--no-importance: lights are kept whether or not the camera sees what they bring".into(),
                _ => format!("{} emitters are weighed by what the camera sees", emitters(needs)),
            },
        ),
        part(
            "record",
            "environment map",
            needs.environment_image,
            if needs.environment_image { "an image surrounds the scene" } else { "no image surrounds the scene" }
                .into(),
        ),
        part("record", "photon grid", caustics, if caustics { "caustics exist" } else { "no caustics" }.into()),
        part("record", "two-level tree", needs.instances(), many(needs.objects, "object", "objects")),
        part(
            "record",
            "texture coordinates",
            needs.textured > 0,
            many(needs.textured, "textured material", "textured materials"),
        ),
        part(
            "record",
            "shading normals",
            needs.smooth_normals,
            if needs.smooth_normals { "some mesh is smooth" } else { "all faces are flat" }.into(),
        ),
        part(
            "field",
            "emitted",
            fields.emitted,
            if fields.emitted {
                "lamps or reflections can be seen"
            } else {
                "nothing that can be seen shines by itself"
            }
            .into(),
        ),
        part("field", "surface", fields.surface, "reflectance, irradiance, normal, distance".into()),
        part(
            "kernel",
            "emitter hits",
            finite,
            many(needs.emissive_triangles, "emissive triangle", "emissive triangles"),
        ),
        part("kernel", "point-like lights", delta > 0, many(delta, "light without surface", "lights without surface")),
        part("kernel", "glossy lobes", needs.glossy > 0, many(needs.glossy, "glossy material", "glossy materials")),
        part(
            "kernel",
            "texture look-ups",
            needs.textured > 0,
            many(needs.textured, "textured material", "textured materials"),
        ),
        part(
            "kernel",
            "alpha cut-outs",
            needs.alpha > 0,
            many(needs.alpha, "material with holes", "materials with holes"),
        ),
        part(
            "kernel",
            "environment",
            needs.environment,
            if needs.environment { "it shines" } else { "it is black" }.into(),
        ),
    ]
}

fn emitters(needs: &Needs) -> u32 {
    needs.emissive_triangles
        + needs.point_lights
        + needs.spot_lights
        + needs.directional_lights
        + u32::from(needs.environment)
}

fn lights(needs: &Needs) -> String {
    let kinds = [
        (needs.emissive_triangles, "emissive triangles"),
        (needs.point_lights, "point lights"),
        (needs.spot_lights, "spot lights"),
        (needs.directional_lights, "directional lights"),
        (u32::from(needs.environment), "environment"),
    ];
    let there = kinds.iter().filter(|(count, _)| *count > 0).map(|(count, kind)| format!("{count} {kind}"));
    there.collect::<Vec<_>>().join(", ")
}

fn as_json(needs: &Needs, parts: &[Part]) -> Value {
    let parts: Vec<Value> = parts
        .iter()
        .map(|part| json!({ "kind": part.kind, "name": part.name, "used": part.used, "why": part.why }))
        .collect();
    json!({ "needs": needs, "parts": parts })
}
