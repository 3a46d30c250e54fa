//! Sliders for what things are made of, and for lamps.

use eframe::egui::{Align, ComboBox, Label, Layout, Response, Slider, Ui, vec2};
use glam::Vec3;
use scenes::{Coat, Colour, Dielectric, Gloss, Light, Material, Scalar, Sheen, Specular, Surface};

/// A material's controls; whether it was changed. `off`: the colour of its glow while that is off.
pub(super) fn material(ui: &mut Ui, material: &mut Material, off: Vec3) -> bool {
    let mut changed = surface(ui, &mut material.surface);
    let most = material.emission.value.max_element();
    let hue = if most > 0.0 { material.emission.value / most } else { off };
    let (mut power, mut glow) = (most, hue);
    changed |= row(ui, "Glow", |ui| {
        // 0 is off; from a hundredth on, equal steps are equal factors.
        let range = 0.0..=(10.0 * most).max(100.0);
        ui.add(Slider::new(&mut power, range).logarithmic(true).smallest_positive(0.01).max_decimals(2))
    });
    if most > 0.0 {
        changed |= colour(ui, "Glow colour", &mut glow);
    }
    if changed {
        material.emission.value = glow * power;
    }
    changed
}

fn surface(ui: &mut Ui, surface: &mut Surface) -> bool {
    let before = kind(surface);
    let mut chosen = before;
    ui.horizontal(|ui| {
        label(ui, "Surface");
        ComboBox::from_id_salt("surface").selected_text(KINDS[before]).show_ui(ui, |ui| {
            for (index, name) in KINDS.iter().enumerate() {
                ui.selectable_value(&mut chosen, index, *name);
            }
        });
    });
    if chosen != before {
        *surface = of_kind(chosen, albedo(surface));
        return true;
    }
    match surface {
        Surface::Diffuse { albedo } => colour(ui, "Colour", &mut albedo.value),
        Surface::Mirror { reflectance } => colour(ui, "Colour", reflectance),
        Surface::Dielectric(it) => glass(ui, it),
        Surface::Glazed { amount, glass: it, base, .. } => {
            let glazed = row(ui, "Glass", |ui| ui.add(Slider::new(&mut amount.value, 0.0..=1.0)));
            let coloured = colour(ui, "Colour", &mut base.value);
            glass(ui, it) | glazed | coloured
        }
        Surface::Translucent { albedo, transmittance } => {
            let coloured = colour(ui, "Colour", &mut albedo.value);
            colour(ui, "Let through", &mut transmittance.value) | coloured
        }
        Surface::Glossy(Gloss { base, roughness, metalness, specular, sheen, coat, .. }) => {
            let coloured = colour(ui, "Colour", &mut base.value);
            let rough = row(ui, "Roughness", |ui| ui.add(Slider::new(&mut roughness.value, 0.0..=1.0)));
            let metal = row(ui, "Metalness", |ui| ui.add(Slider::new(&mut metalness.value, 0.0..=1.0)));
            let shiny = row(ui, "Highlight", |ui| ui.add(Slider::new(&mut specular.amount.value, 0.0..=1.0)));
            let tinted = colour(ui, "Highlight colour", &mut specular.colour.value);
            let soft = velvet(ui, sheen);
            lacquer(ui, coat) | soft | metal | coloured | rough | shiny | tinted
        }
    }
}

fn velvet(ui: &mut Ui, sheen: &mut Option<Sheen>) -> bool {
    let plain = Sheen { colour: Colour::plain(Vec3::ZERO), roughness: Scalar::plain(0.5) };
    let of = sheen.unwrap_or(plain);
    let most = of.colour.value.max_element();
    let mut strength = most;
    let changed = row(ui, "Sheen", |ui| ui.add(Slider::new(&mut strength, 0.0..=1.0)));
    if changed {
        let hue = if most > 0.0 { of.colour.value / most } else { Vec3::ONE };
        let colour = Colour { value: hue * strength, ..of.colour };
        *sheen = (strength > 0.0).then_some(Sheen { colour, ..of });
    }
    let Some(sheen) = sheen else { return changed };
    let tinted = colour(ui, "Sheen colour", &mut sheen.colour.value);
    let rough = row(ui, "Sheen's roughness", |ui| ui.add(Slider::new(&mut sheen.roughness.value, 0.0..=1.0)));
    changed | tinted | rough
}

fn lacquer(ui: &mut Ui, coat: &mut Option<Coat>) -> bool {
    let mut amount = coat.map_or(0.0, |coat| coat.amount.value);
    let coated = row(ui, "Lacquer", |ui| ui.add(Slider::new(&mut amount, 0.0..=1.0)));
    if coated {
        let plain = Coat { amount: Scalar::plain(0.0), roughness: Scalar::plain(0.0) };
        let of = coat.unwrap_or(plain);
        *coat = (amount > 0.0).then_some(Coat { amount: Scalar { value: amount, ..of.amount }, ..of });
    }
    let Some(coat) = coat else { return coated };
    row(ui, "Lacquer's roughness", |ui| ui.add(Slider::new(&mut coat.roughness.value, 0.0..=1.0))) | coated
}

fn glass(ui: &mut Ui, glass: &mut Dielectric) -> bool {
    let bent = row(ui, "Refraction", |ui| ui.add(Slider::new(&mut glass.ior, 1.0..=2.5)));
    let rough = row(ui, "Roughness", |ui| ui.add(Slider::new(&mut glass.roughness.value, 0.0..=1.0)));
    colour(ui, "Tint", &mut glass.transmittance.value) | bent | rough
}

const KINDS: [&str; 6] = ["Matte", "Glossy", "Mirror", "Glass", "Half glass", "Paper"];

fn kind(surface: &Surface) -> usize {
    match surface {
        Surface::Diffuse { .. } => 0,
        Surface::Glossy(_) => 1,
        Surface::Mirror { .. } => 2,
        Surface::Dielectric(_) => 3,
        Surface::Glazed { .. } => 4,
        Surface::Translucent { .. } => 5,
    }
}

fn of_kind(kind: usize, albedo: Colour) -> Surface {
    let scalar = |value| Scalar { value, texture: None };
    match kind {
        0 => Surface::Diffuse { albedo },
        1 => Surface::Glossy(Gloss::new(albedo, scalar(0.35), scalar(0.0))),
        2 => Surface::Mirror { reflectance: Vec3::splat(0.9) },
        3 => Surface::Dielectric(Dielectric::clear(1.5, false)),
        4 => Surface::Glazed {
            amount: scalar(0.5),
            glass: Dielectric::clear(1.5, true),
            base: albedo,
            metalness: scalar(0.0),
            f0: 0.04,
            specular: Specular::WHOLE,
        },
        _ => {
            let half = Colour { value: albedo.value * 0.5, ..albedo };
            Surface::Translucent { albedo: half, transmittance: half }
        }
    }
}

fn albedo(surface: &Surface) -> Colour {
    match surface {
        Surface::Diffuse { albedo } => *albedo,
        Surface::Glossy(Gloss { base, .. }) | Surface::Glazed { base, .. } => *base,
        Surface::Translucent { albedo, .. } => *albedo,
        Surface::Mirror { .. } | Surface::Dielectric(_) => Colour { value: Vec3::splat(0.7), texture: None },
    }
}

/// A lamp's controls; whether it was changed. `up`: the upright, unit length, that its direction is turned about. `off`:
/// its colour while it is off, which may be chosen as well.
pub(super) fn light(ui: &mut Ui, light: &mut Light, up: Vec3, off: &mut Vec3) -> bool {
    let field = match light {
        Light::Point { intensity, .. } | Light::Spot { intensity, .. } | Light::Luminaire { intensity, .. } => {
            intensity
        }
        Light::Directional { irradiance, .. } => irradiance,
    };
    let most = field.max_element();
    let (mut power, mut hue) = (most, if most > 0.0 { *field / most } else { *off });
    let range = 0.0..=(30.0 * most).max(1000.0);
    let mut changed = row(ui, "Power", |ui| {
        ui.add(Slider::new(&mut power, range).logarithmic(true).smallest_positive(1e-3).max_decimals(3))
    });
    let coloured = colour(ui, "Colour", &mut hue);
    if coloured && most == 0.0 {
        *off = hue;
    } else {
        changed |= coloured;
    }
    if changed {
        *field = hue * power;
    }
    if let Light::Spot { direction, .. } | Light::Luminaire { direction, .. } | Light::Directional { direction, .. } =
        light
    {
        let [mut about, mut above] = angles(*direction, up);
        let mut aimed = row(ui, "Turn", |ui| ui.add(Slider::new(&mut about, -180.0..=180.0).suffix("°")));
        aimed |= row(ui, "Tilt", |ui| ui.add(Slider::new(&mut above, -90.0..=90.0).suffix("°")));
        if aimed {
            *direction = self::direction([about, above], up);
        }
        changed |= aimed;
    }
    if let Light::Spot { cos_inner, cos_outer, .. } = light {
        let (mut inner, mut outer) = (cos_inner.acos().to_degrees(), cos_outer.acos().to_degrees());
        let mut turned = row(ui, "Cone", |ui| ui.add(Slider::new(&mut outer, 2.0..=89.0).suffix("°")));
        turned |= row(ui, "Sharp", |ui| ui.add(Slider::new(&mut inner, 1.0..=88.0).suffix("°")));
        if turned {
            // The inner cone lies within the outer.
            inner = inner.min(0.95 * outer);
            (*cos_inner, *cos_outer) = (inner.to_radians().cos(), outer.to_radians().cos());
        }
        changed |= turned;
    }
    changed
}

/// Two axes that lie flat: across, and away from it.
fn flat(up: Vec3) -> [Vec3; 2] {
    let across = up.cross(if up.z.abs() < 0.9 { Vec3::Z } else { Vec3::X }).normalize_or(Vec3::X);
    [across, up.cross(across)]
}

/// A unit direction's angles: about the upright, and above the horizon; degrees.
fn angles(direction: Vec3, up: Vec3) -> [f32; 2] {
    let [across, away] = flat(up);
    let about = direction.dot(away).atan2(direction.dot(across));
    [about, direction.dot(up).clamp(-1.0, 1.0).asin()].map(f32::to_degrees)
}

/// The unit direction of such angles; never quite upright, where the first would be forgotten.
fn direction([about, above]: [f32; 2], up: Vec3) -> Vec3 {
    let [across, away] = flat(up);
    let (about, above) = (about.to_radians(), above.clamp(-89.9, 89.9).to_radians());
    (up * above.sin() + (across * about.cos() + away * about.sin()) * above.cos()).normalize_or(-up)
}

/// A linear colour, each channel 0..=1.
fn colour(ui: &mut Ui, label: &str, value: &mut Vec3) -> bool {
    let mut shown = value.clamp(Vec3::ZERO, Vec3::ONE).to_array();
    let changed = row(ui, label, |ui| ui.color_edit_button_rgb(&mut shown));
    if changed {
        *value = Vec3::from_array(shown).clamp(Vec3::ZERO, Vec3::ONE);
    }
    changed
}

/// A labelled control; whether it was changed.
pub(super) fn row(ui: &mut Ui, name: &str, control: impl FnOnce(&mut Ui) -> Response) -> bool {
    ui.horizontal(|ui| {
        label(ui, name);
        control(ui).changed()
    })
    .inner
}

/// A name before a control; all are equally wide.
pub(super) fn label(ui: &mut Ui, name: &str) {
    let size = vec2(LABEL, ui.spacing().interact_size.y);
    ui.allocate_ui_with_layout(size, Layout::left_to_right(Align::Center), |ui| {
        ui.set_min_size(size);
        ui.add(Label::new(name).truncate());
    });
}

/// Width of labels, points.
const LABEL: f32 = 76.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lamps_are_aimed_by_angles_that_are_kept() {
        for up in [Vec3::Y, Vec3::Z] {
            for wanted in [[-170.0, -60.0], [30.0, 0.0], [120.0, 85.0]] {
                let [about, above] = angles(direction(wanted, up), up);
                assert!((about - wanted[0]).abs() < 0.01 && (above - wanted[1]).abs() < 0.01, "{about} {above}");
            }
            // Straight down, it is still known where it was turned.
            let down = direction([30.0, -90.0], up);
            assert!(down.dot(up) < -0.999 && (angles(down, up)[0] - 30.0).abs() < 0.1, "{down}");
        }
    }

    #[test]
    fn another_surface_keeps_the_colour() {
        let red = Colour { value: Vec3::X, texture: Some(1) };
        for index in 0..KINDS.len() {
            assert_eq!(kind(&of_kind(index, red)), index);
        }
        assert_eq!(albedo(&of_kind(1, albedo(&of_kind(0, red)))), red);
    }
}
