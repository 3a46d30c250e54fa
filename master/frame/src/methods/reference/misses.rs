//! What the path tracer cannot find, in words.

use scenes::relays::Beyond;
use scenes::{Needs, Relays, Scene};

/// Light of lamps without surface that solid glass or curved mirrors relay; `None` if there is none.
pub(super) fn misses(scene: &Scene) -> Option<String> {
    let needs = Needs::of(scene);
    let beyond = Relays::of(scene, &needs).beyond;
    (beyond.any() && needs.bare_lights() > 0).then(|| {
        format!(
            "the light of {} by way of {}: no path finds it, and the noise says nothing of it",
            lamps(&needs),
            relays(&beyond)
        )
    })
}

fn lamps(needs: &Needs) -> String {
    let kinds = [
        (needs.point_lights, "point light"),
        (needs.spot_lights, "spot light"),
        (needs.luminaires, "luminaire"),
        (needs.directional_lights, "directional light"),
    ];
    let several = |count: u32| if count == 1 { "" } else { "s" };
    let named = kinds.iter().filter(|(count, _)| *count > 0);
    listed(named.map(|(count, name)| format!("{count} {name}{}", several(*count))))
}

fn relays(beyond: &Beyond) -> String {
    let kinds = [
        (beyond.glass > 0, "solid glass"),
        (beyond.curved > 0, "curved mirrors or panes"),
        (beyond.planes, "mirrors or panes in many planes"),
    ];
    listed(kinds.iter().filter(|(is_there, _)| *is_there).map(|(_, name)| (*name).to_string()))
}

fn listed(words: impl Iterator<Item = String>) -> String {
    words.collect::<Vec<_>>().join(" and ")
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::Vec3;
    use scenes::{Dielectric, Light, Material, Mesh, Object, Surface};

    use super::*;

    /// A triangle of some surface under a sun and two point lights.
    fn scene(surface: Surface) -> Scene {
        let mesh = Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Z],
            triangles: vec![[0, 1, 2]],
            materials: vec![0],
            ..Mesh::default()
        };
        let point = Light::Point { position: Vec3::Y, intensity: Vec3::ONE };
        let sun = Light::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::ONE, diameter_deg: 0.0 };
        Scene {
            meshes: vec![Arc::new(mesh)],
            objects: vec![Object::fixed("triangle", 0)],
            materials: vec![Material { surface, ..Material::diffuse("any", Vec3::ONE) }],
            lights: vec![point.clone(), sun, point],
            ..Scene::default()
        }
    }

    fn glass(thin: bool) -> Surface {
        Surface::Dielectric(Dielectric::clear(1.5, thin))
    }

    #[test]
    fn only_what_no_path_finds_is_missing() {
        let said = misses(&scene(glass(false))).unwrap();
        assert!(
            said.starts_with("the light of 2 point lights and 1 directional light by way of solid glass:"),
            "{said}"
        );
        for found in [glass(true), Surface::Mirror { reflectance: Vec3::ONE }] {
            assert_eq!(misses(&scene(found)), None);
        }
        let mut lit_by_others = scene(glass(false));
        lit_by_others.lights.clear();
        assert_eq!(misses(&lit_by_others), None);
    }
}
