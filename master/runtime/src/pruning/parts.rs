//! Every stage, record, field, kernel and pass: whether a scene needs it, why, and what it saves to leave it out.
//!
//! Savings are counted, not guessed: how often something would be done, or how many bytes it would take. How much
//! time that is depends on the machine; `igi-master bench --pruning` measures it.

use frame::Filter;
use frame::parts::Film;
use protocol::answer::Fields;
use protocol::question::{Bound, Quality};
use scenes::Needs;

/// Something that is done or kept for a scene, or left out.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// One of [`KINDS`].
    pub kind: &'static str,
    /// For people and programs.
    pub name: &'static str,
    /// It is done or kept.
    pub used: bool,
    /// Why, or why not.
    pub why: String,
    /// What is saved because it is left out; empty if it is used.
    pub saves: Vec<Saving>,
}

/// An amount of work or memory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Saving {
    /// How much.
    pub amount: u64,
    /// Of what, each time.
    pub unit: &'static str,
}

/// In the order in which light passes them.
pub const KINDS: [&str; 5] = ["stages", "records", "fields", "kernels", "passes"];

impl Part {
    fn new(
        kind: &'static str,
        name: &'static str,
        used: bool,
        why: impl Into<String>,
        saves: &[(u64, &'static str)],
    ) -> Self {
        let saved = saves.iter().filter(|(amount, _)| *amount > 0 && !used);
        let saves = saved.map(|(amount, unit)| Saving { amount: *amount, unit }).collect();
        Self { kind, name, used, why: why.into(), saves }
    }
}

/// All parts. Leaving one out changes no pixel, only time and memory.
pub fn parts(needs: &Needs, quality: &Quality, filter: &Filter) -> Vec<Part> {
    let mut parts = stages(needs, quality);
    parts.extend(records(needs, quality));
    parts.extend(fields(needs, quality));
    parts.extend(kernels(needs));
    parts.extend(passes(needs, quality, filter));
    parts
}

fn stages(needs: &Needs, quality: &Quality) -> Vec<Part> {
    let stage = |name, used, why: String, saves: &[_]| Part::new("stages", name, used, why, saves);
    let lit = is_lit(needs);
    let shadow_rays = u64::from(quality.light_samples) + u64::from(quality.vpls);
    let bounded = quality.bias_compensation && quality.bound != Bound::None;
    vec![
        stage("eye paths", true, "always".into(), &[]),
        stage("specular chains", needs.specular() || needs.sharp > 0, specular(needs), &[]),
        stage(
            "virtual lights",
            lit,
            if lit { lights(needs) } else { nothing_lit(needs) },
            &[(shadow_rays, "shadow rays a pixel")],
        ),
        stage(
            "caustic photons",
            has_photons(needs, quality),
            match (needs.caustics(), has_photons(needs, quality)) {
                (true, true) => format!("light meets {}", specular(needs)),
                (true, false) if quality.indirect_caustics => "--photons 0: rays alone look for caustics".into(),
                (true, false) => "--photons 0: caustics are missing from the picture".into(),
                (false, _) if !needs.specular() && needs.sharp == 0 => "no mirror and no glass".into(),
                (false, _) => nothing_lit(needs),
            },
            &[(quality.photons.into(), "photon paths a light set"), (1, "look-up in the photon grid an end point")],
        ),
        stage(
            "compensation rays",
            bounded && lit,
            match (lit, quality.bias_compensation, quality.bound) {
                (false, ..) => nothing_lit(needs),
                (_, _, Bound::None) => "virtual lights are not bounded".into(),
                (_, false, _) => "--no-bias-compensation: corners are too dark for ever".into(),
                _ => "virtual lights are bounded, what that cuts off is traced".into(),
            },
            &[(1, "ray an end point, and what follows from it")],
        ),
        stage(
            "rays through glass",
            quality.indirect_caustics && needs.caustics(),
            match (needs.caustics(), quality.indirect_caustics) {
                (false, _) if lit => "no mirror and no glass".into(),
                (false, _) => nothing_lit(needs),
                (_, false) => {
                    "--direct-caustics-only: photons alone bring caustics; light off surfaces through glass is missing"
                        .into()
                }
                _ => "light off surfaces and large lamps passes mirrors and glass".into(),
            },
            &[(1, "test against what is specular an end point")],
        ),
    ]
}

fn records(needs: &Needs, quality: &Quality) -> Vec<Part> {
    let record = |name, used, why: String, saves: &[_]| Part::new("records", name, used, why, saves);
    vec![
        record(
            "light importance",
            quality.importance && needs.light(),
            match (needs.light(), quality.importance) {
                (false, _) => "nothing shines".into(),
                (_, false) => "--no-importance: lights are kept whether or not the camera sees what they bring".into(),
                _ => format!("{} emitters are weighed by what the camera sees", emitters(needs)),
            },
            &[(64, "eye paths a view"), (512, "pilot lights and light paths a view")],
        ),
        record(
            "environment map",
            needs.environment_image,
            yes_no(needs.environment_image, "an image surrounds the scene", "no image surrounds the scene"),
            &[(4, "bytes a texel of its sampling table")],
        ),
        record(
            "photon grid",
            has_photons(needs, quality),
            yes_no(has_photons(needs, quality), "caustics exist", "no photons"),
            &[(quality.photons.into(), "photons in memory a light set, at most")],
        ),
        record("upper tree", needs.instances(), count(needs.objects, "object", "objects"), &[(1, "tree node a ray")]),
        record(
            "coverage",
            needs.coverage > 0,
            count(
                needs.coverage,
                "material with holes or half transparent",
                "materials with holes or half transparent",
            ),
            &[(needs.triangles, "entries, one a triangle")],
        ),
    ]
}

fn fields(needs: &Needs, quality: &Quality) -> Vec<Part> {
    let field = |name, used, why: String, saves: &[_]| Part::new("fields", name, used, why, saves);
    let fields = Fields::of(needs);
    let film = |fields| Film::bytes_per_pixel(quality.replicates, fields);
    let with_emitted = film(Fields { emitted: true, ..fields }) - film(fields);
    let with_surface = film(Fields { surface: true, ..fields }) - film(fields);
    vec![
        field(
            "emitted",
            fields.emitted,
            yes_no(fields.emitted, "lamps or reflections can be seen", "nothing that can be seen shines by itself"),
            &[(1, "byte a tile on the wire (as black)"), (with_emitted, "bytes a pixel of the master's memory")],
        ),
        field(
            "surface",
            fields.surface,
            if fields.surface { "reflectance, irradiance, normal, distance".into() } else { nothing_lit(needs) },
            &[(5, "bytes a pixel on the wire, at least"), (with_surface, "bytes a pixel of the master's memory")],
        ),
    ]
}

fn kernels(needs: &Needs) -> Vec<Part> {
    let kernel = |name, used, why: String, saves: &[_]| Part::new("kernels", name, used, why, saves);
    let counted = |name, number, one, many, saves: &[_]| kernel(name, number > 0, count(number, one, many), saves);
    let delta = needs.bare_lights();
    vec![
        counted("emitter hits", needs.emissive_triangles, "emissive triangle", "emissive triangles", &[]),
        counted("point-like lights", delta, "light without surface", "lights without surface", &[]),
        counted(
            "glossy lobes",
            needs.glossy,
            "glossy material",
            "glossy materials",
            &[(1, "evaluation by direction for each shadow ray that arrives")],
        ),
        counted(
            "sheen",
            needs.sheen,
            "material with sheen",
            "materials with sheen",
            &[(1, "lobe for each evaluation by direction")],
        ),
        counted(
            "coats",
            needs.coated,
            "coated material",
            "coated materials",
            &[(1, "lobe for each evaluation by direction")],
        ),
        counted(
            "texture look-ups",
            needs.textured,
            "textured material",
            "textured materials",
            &[(24, "bytes of texture coordinates read a hit, where meshes have them")],
        ),
        kernel(
            "shading normals",
            needs.smooth_normals,
            yes_no(needs.smooth_normals, "some mesh is smooth", "all faces are flat"),
            &[(36, "bytes of normals read a hit")],
        ),
        counted(
            "relief",
            needs.relief,
            "material with a normal map",
            "materials with normal maps",
            &[(72, "bytes of tangents and texture coordinates read a hit")],
        ),
        kernel(
            "vertex colours",
            needs.vertex_colours,
            yes_no(needs.vertex_colours, "some mesh has colours at its vertices", "no mesh has any"),
            &[(24, "bytes of colours read a hit")],
        ),
        counted(
            "object transforms",
            needs.moved_objects,
            "object elsewhere than modelled",
            "objects elsewhere than modelled",
            &[(48, "bytes of a transform looked at a hit")],
        ),
        counted(
            "coverage",
            needs.coverage,
            "material with holes or half transparent",
            "materials with holes or half transparent",
            &[(1, "look at what is there a triangle hit")],
        ),
        kernel("environment", needs.environment, yes_no(needs.environment, "it shines", "it is black"), &[]),
        counted("animation", needs.animated, "moving object", "moving objects", &[]),
    ]
}

fn passes(needs: &Needs, quality: &Quality, filter: &Filter) -> Vec<Part> {
    let pass = |name, used, why: &str, saves: &[_]| Part::new("passes", name, used, why, saves);
    let surface = Fields::of(needs).surface;
    let [n, m] = filter.window.map(u64::from);
    let sums = u64::from(quality.replicates) * 3 * size_of::<f32>() as u64;
    vec![
        pass(
            "discontinuity buffer",
            surface && filter.edges.is_some(),
            match (surface, filter.edges.is_some()) {
                (true, true) => "something diffuse is lit; it fades as samples accumulate",
                (true, false) => "--filter off",
                (false, _) => "nothing diffuse is lit",
            },
            &[(n * m, "neighbours looked at a pixel shown")],
        ),
        pass(
            "error estimate",
            quality.replicates > 1,
            if quality.replicates > 1 { "replicates take turns" } else { "--replicates 1" },
            &[(2 * sums, "bytes a pixel of the master's memory, of two replicates")],
        ),
    ]
}

fn is_lit(needs: &Needs) -> bool {
    needs.light() && needs.diffuse > 0
}

fn has_photons(needs: &Needs, quality: &Quality) -> bool {
    needs.caustics() && quality.photons > 0
}

fn nothing_lit(needs: &Needs) -> String {
    if needs.light() { "nothing is diffuse" } else { "nothing shines" }.into()
}

fn yes_no(yes: bool, if_yes: &str, if_no: &str) -> String {
    if yes { if_yes } else { if_no }.into()
}

fn count(count: u32, one: &str, more: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { more })
}

fn specular(needs: &Needs) -> String {
    let mut kinds = vec![
        count(needs.mirrors, "mirror material", "mirror materials"),
        count(needs.glass, "glass material", "glass materials"),
    ];
    if needs.sharp > 0 {
        kinds.push(count(needs.sharp, "sharply glossy material", "sharply glossy materials"));
    }
    kinds.join(", ")
}

fn emitters(needs: &Needs) -> u32 {
    needs.emissive_triangles + needs.bare_lights() + needs.suns + u32::from(needs.environment)
}

fn lights(needs: &Needs) -> String {
    let kinds = [
        (needs.emissive_triangles, "emissive triangles"),
        (needs.point_lights, "point lights"),
        (needs.spot_lights, "spot lights"),
        (needs.luminaires, "luminaires"),
        (needs.directional_lights, "directional lights"),
        (needs.suns, "suns with a disc"),
        (u32::from(needs.environment), "environment"),
    ];
    let there = kinds.iter().filter(|(count, _)| *count > 0).map(|(count, kind)| format!("{count} {kind}"));
    there.collect::<Vec<_>>().join(", ")
}
