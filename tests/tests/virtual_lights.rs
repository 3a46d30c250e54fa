//! Where virtual lights are said to lie is where they are.

use std::path::Path;

use light::{LightSetCache, Prepared};
use protocol::question::{Ask, Lit, Quality, Question, Rect, Tile};
use scenes::Surface;

#[test]
fn the_lights_of_a_set_are_those_that_its_tiles_are_lit_by() {
    let scene = scenes::read::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/cornell")).unwrap().scene;
    let (camera, quality) = (scene.camera, Quality { importance: false, ..Quality::default() });
    let (prepared, cache) = (Prepared::new(scene), LightSetCache::default());
    let answer = |ask| light::answer(&prepared, &cache, &Question { world: Default::default(), ask }, &|| 0);
    let rect = Rect { x: 96, y: 96, width: 48, height: 48 };
    let (mut on_lamps, mut bounced) = (0.0, 0);
    for set in 0..quality.sets() {
        let tile = Tile { camera, rect, lit: Lit { set, frame: 0, seed: 3, quality } };
        assert!(answer(Ask::Tile(tile.clone())).cost.light_rays > 0);
        let told = answer(Ask::Lights(tile.lights()));
        assert_eq!(told.cost.light_rays, 0, "set {set} was not the one in the cache");
        let lights = told.body.lights().expect("lights are answered by lights");
        let bounds = prepared.world.bounds();
        for light in &lights {
            let slack = bounds.diagonal() * 1e-3;
            assert!(light.position.cmpge(bounds.min - slack).all() && light.position.cmple(bounds.max + slack).all());
            assert!((light.normal.length() - 1.0).abs() < 1e-4 && light.strength.min_element() >= 0.0);
        }
        on_lamps += lights.iter().filter(|light| light.depth == 0).map(|light| light.strength.y).sum::<f32>();
        bounced += lights.iter().filter(|light| light.depth > 0).count();
    }
    // Those on lamps share the lamps' radiance times area between them.
    let scene = &prepared.scene;
    let emitted = |(mesh, triangle): (usize, usize)| {
        let mesh = &scene.meshes[mesh];
        let [a, b, c] = mesh.triangles[triangle].map(|corner| mesh.positions[corner as usize]);
        let material = &scene.materials[mesh.materials[triangle] as usize];
        assert!(matches!(material.surface, Surface::Diffuse { .. }), "the box is diffuse throughout");
        material.emission.value.y * (b - a).cross(c - a).length() * 0.5
    };
    let all = scene.meshes.iter().enumerate().flat_map(|(mesh, m)| (0..m.triangles.len()).map(move |t| (mesh, t)));
    let expected: f32 = all.map(emitted).sum();
    let mean = on_lamps / f32::from(quality.sets());
    assert!((mean / expected - 1.0).abs() < 0.02, "{mean} where {expected} is emitted");
    assert!(bounced > 9 * 4, "{bounced} lights on walls");
}
