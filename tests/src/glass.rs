//! Glass: rows 27 to 29.

use glam::Vec3;
use scenes::{Scene, Surface};

use crate::build::{Build, Fronts};
use crate::{Case, closed_form};

/// Pixels to a side.
const SIDE: u32 = 16;

fn glass(ior: f32, thin: bool) -> Surface {
    Surface::Dielectric { ior, transmittance: Vec3::ONE, thin }
}

/// Row 27: a lit room, empty, then with a ball of that index of refraction in it. With index 1 both
/// give the same picture.
pub fn ball_in_a_box(ior: f32) -> [Scene; 2] {
    [false, true].map(|with_ball| {
        let mut build = Build::new("ball in a box");
        let (wall, red, lamp) = (build.paint(0.6, 0.0), build.paint(0.2, 0.0), build.paint(0.0, 8.0));
        build.room(1.0, [red, wall, wall, wall, wall, wall]);
        build.quad(Vec3::Y * 0.99, Vec3::X * 0.3, Vec3::Z * 0.3, lamp);
        if with_ball {
            let ball = build.surface(glass(ior, false));
            build.sphere(Vec3::new(0.1, -0.3, 0.0), 0.5, 32, Fronts::Outwards, ball);
        }
        build.seen(Vec3::new(0.0, 0.0, 0.95), Vec3::new(0.0, -0.1, 0.0), 80.0, 32)
    })
}

/// Row 28: the eye is inside a block of glass of index 1.5 and looks at its side beyond the critical
/// angle of 41.8°, under 60°. Outside all is black; the block's far end is a lamp of radiance 1, and
/// all of it arrives.
pub fn light_caught_in_glass() -> Case {
    let mut build = Build::new("light caught in glass");
    let (side, lamp) = (build.surface(glass(1.5, false)), build.paint(0.0, 1.0));
    // A long block from x = −1 to 9; its end at x = 8, inside, faces the eye.
    build.quad(Vec3::new(4.0, -1.0, 0.0), Vec3::X * 5.0, Vec3::Z * 5.0, side);
    build.quad(Vec3::new(4.0, 1.0, 0.0), Vec3::Z * 5.0, Vec3::X * 5.0, side);
    build.quad(Vec3::X * 8.0, Vec3::Z * 5.0, Vec3::Y, lamp);
    // 60° from the normal: 30° above the side.
    let (sin, cos) = 30.0_f32.to_radians().sin_cos();
    Case {
        name: "total internal reflection".into(),
        row: 28,
        scene: build.seen(Vec3::ZERO, Vec3::new(cos, -sin, 0.0), 5.0, SIDE),
        radiance: 1.0,
        uniform: true,
        tolerance: 1e-6,
    }
}

/// Row 29: a lamp of radiance 1 seen straight through a pane of thin glass.
pub fn pane_before_a_lamp() -> Case {
    let reflected = closed_form::sheet(closed_form::fresnel(1.0, 1.5));
    pane("lamp through thin glass", -1.0, 1.0 - reflected)
}

/// Row 29: the same lamp behind the eye, seen in the pane.
pub fn lamp_in_a_pane() -> Case {
    pane("lamp in thin glass", 1.0, closed_form::sheet(closed_form::fresnel(1.0, 1.5)))
}

/// The eye looks along −z at a pane at z = 0; a lamp stands at distance 5, before (+1) or behind it.
fn pane(name: &str, side: f32, radiance: f64) -> Case {
    let mut build = Build::new("pane");
    let (pane, lamp) = (build.surface(glass(1.5, true)), build.paint(0.0, 1.0));
    build.quad(Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 2.0, pane);
    // Its front faces the pane.
    build.quad(Vec3::Z * (5.0 * side), Vec3::X * 20.0, Vec3::Y * (-20.0 * side), lamp);
    Case {
        name: name.into(),
        row: 29,
        scene: build.seen(Vec3::Z, Vec3::ZERO, 1.0, SIDE),
        radiance,
        uniform: true,
        tolerance: 1e-5,
    }
}
