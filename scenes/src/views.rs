//! Saved views: from where people looked, under a name, with a small picture, and how lamps were.

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use crate::{Camera, Change, Rgb, Scene, Shiner};

/// A view that people have saved.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SavedView {
    /// For people; may be empty.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// As in [`Camera`].
    pub origin: Vec3,
    /// As in [`Camera`].
    pub target: Vec3,
    /// As in [`Camera`].
    pub up: Vec3,
    /// As in [`Camera`].
    pub fov_y_deg: f32,
    /// As in [`Camera`].
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub two_point: bool,
    /// As in [`Camera`].
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub cut: bool,
    /// A JPEG as a `data:` address, some dozens of pixels wide.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub picture: Option<String>,
    /// How lamps are when people go there; empty: as they happen to be.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lamps: Vec<LampState>,
}

/// How all lamps are, under a name: people go from one to the other while they look.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Preset {
    /// For people; may be empty.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// All of them.
    pub lamps: Vec<LampState>,
}

/// How strongly a lamp shines.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LampState {
    /// By its number, which counts if what has it is called so.
    pub lamp: Shiner,
    /// Its name: of the light, the material, or the object that has its own.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub of: String,
    /// As [`Scene::power`].
    pub power: Rgb,
}

/// Longest name of a view, bytes.
pub const NAME_MAX: usize = 100;
/// Longest picture of a view, bytes.
pub const PICTURE_MAX: usize = 8 << 10;
/// Most lamps of a view.
pub const LAMPS_MAX: usize = 4096;
/// What the picture of a view begins with.
const JPEG: &str = "data:image/jpeg;base64,";

impl SavedView {
    /// From there, at a size in pixels.
    ///
    /// # Errors
    /// In words, why nobody can look from there.
    pub fn camera(&self, [width, height]: [u32; 2]) -> Result<Camera, String> {
        let Self { origin, target, up, fov_y_deg, two_point, cut, .. } = *self;
        let camera = Camera { origin, target, up, fov_y_deg, width, height, two_point, cut };
        camera.check().map(|()| camera)
    }

    /// Whether it can be kept and shown.
    ///
    /// # Errors
    /// In words, what is wrong with it.
    pub fn check(&self) -> Result<(), String> {
        self.camera([4, 3])?;
        let demand = |ok: bool, what: &str| if ok { Ok(()) } else { Err(what.to_owned()) };
        check_name(&self.name)?;
        if let Some(picture) = &self.picture {
            let is_base64 = |byte: u8| byte.is_ascii_alphanumeric() || b"+/=".contains(&byte);
            let bytes = picture.strip_prefix(JPEG).map(|rest| rest.bytes().all(is_base64));
            demand(bytes == Some(true), "the picture is no JPEG in a data: address")?;
            demand(picture.len() <= PICTURE_MAX, "the picture is too large")?;
        }
        check_lamps(&self.lamps)
    }

    /// The same in a scene whose origin is elsewhere by so much.
    #[must_use]
    pub fn moved(self, by: DVec3) -> Self {
        let moved = |place: Vec3| (place.as_dvec3() + by).as_vec3();
        Self { origin: moved(self.origin), target: moved(self.target), ..self }
    }

    /// The changes to a scene that light it as it was lit, in any order; lamps that are not there are left out.
    pub fn relit(&self, scene: &Scene) -> Vec<Change> {
        let found = self.lamps.iter().filter_map(|state| Some((state.find(scene)?, state.power)));
        let other = found.filter(|(lamp, power)| scene.power(*lamp) != Some(*power));
        other.filter_map(|(lamp, power)| scene.powered(lamp, power)).collect()
    }
}

impl Preset {
    /// Whether it can be kept and shown.
    ///
    /// # Errors
    /// In words, what is wrong with it.
    pub fn check(&self) -> Result<(), String> {
        check_name(&self.name)?;
        check_lamps(&self.lamps)
    }
}

fn check_name(name: &str) -> Result<(), String> {
    let demand = |ok: bool, what: &str| if ok { Ok(()) } else { Err(what.to_owned()) };
    demand(name.len() <= NAME_MAX, "the name is too long")?;
    demand(!name.chars().any(char::is_control), "the name has characters that cannot be shown")
}

fn check_lamps(lamps: &[LampState]) -> Result<(), String> {
    let demand = |ok: bool, what: &str| if ok { Ok(()) } else { Err(what.to_owned()) };
    demand(lamps.len() <= LAMPS_MAX, "there are too many lamps")?;
    let is_power = |power: Rgb| power.is_finite() && power.min_element() >= 0.0;
    demand(lamps.iter().all(|lamp| is_power(lamp.power)), "a lamp's power is none")
}

impl LampState {
    /// How all lamps of a scene are; `shines` says of what gives nothing whether it counts as one.
    pub fn all(scene: &Scene, shines: impl Fn(Shiner) -> bool) -> Vec<Self> {
        let state = |lamp: Shiner| {
            let power = scene.power(lamp).filter(|power| *power != Rgb::ZERO || shines(lamp))?;
            Some(Self { lamp, of: name(scene, lamp).to_owned(), power })
        };
        scene.shiners().into_iter().filter_map(state).take(LAMPS_MAX).collect()
    }

    /// The lamp of its number, if it has its name; else the only one of its kind that has it.
    fn find(&self, scene: &Scene) -> Option<Shiner> {
        let is_it = |lamp: Shiner| scene.power(lamp).is_some() && name(scene, lamp) == self.of;
        if is_it(self.lamp) {
            return Some(self.lamp);
        }
        let is_alike =
            |lamp: &Shiner| std::mem::discriminant(lamp) == std::mem::discriminant(&self.lamp) && is_it(*lamp);
        let mut alike = scene.shiners().into_iter().filter(|_| !self.of.is_empty()).filter(is_alike);
        alike.next().filter(|_| alike.next().is_none())
    }
}

fn name(scene: &Scene, lamp: Shiner) -> &str {
    let name = match lamp {
        Shiner::Light(number) => scene.light_names.get(number as usize),
        Shiner::Material(number) => scene.materials.get(number as usize).map(|material| &material.name),
        Shiner::Own { object, .. } => scene.objects.get(object as usize).map(|object| &object.name),
        Shiner::Sky => None,
    };
    name.map_or("", String::as_str)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Light;

    fn scene(lamps: &[(&str, f32)]) -> Scene {
        let light = |(_, power): &(&str, f32)| Light::Point { position: Vec3::ZERO, intensity: Vec3::splat(*power) };
        Scene {
            lights: lamps.iter().map(light).collect(),
            light_names: lamps.iter().map(|(name, _)| (*name).to_owned()).collect(),
            ..Scene::default()
        }
    }

    fn view() -> SavedView {
        SavedView { origin: Vec3::Z, up: Vec3::Y, fov_y_deg: 45.0, ..SavedView::default() }
    }

    #[test]
    fn lamps_are_as_they_were_under_other_numbers_too() {
        let before = scene(&[("left", 1.0), ("right", 2.0), ("off", 0.0)]);
        let view = SavedView { lamps: LampState::all(&before, |_| false), ..view() };
        assert_eq!(view.lamps.len(), 2, "what is off and never shone is no lamp");
        let powers = |mut scene: Scene| {
            view.relit(&scene).iter().for_each(|change| change.apply(&mut scene).unwrap());
            scene.lights.iter().map(|light| light.power().x).collect::<Vec<_>>()
        };
        assert_eq!(view.relit(&before), []);
        assert_eq!(powers(scene(&[("left", 0.0), ("right", 2.0)])), [1.0, 2.0]);
        assert_eq!(powers(scene(&[("right", 0.0), ("left", 0.0), ("new", 5.0)])), [2.0, 1.0, 5.0]);
        assert_eq!(
            powers(scene(&[("a", 7.0), ("right", 7.0), ("right", 7.0)])),
            [7.0, 2.0, 7.0],
            "the one of its number"
        );
        let text = serde_json::to_string(&view).unwrap();
        assert_eq!(serde_json::from_str::<SavedView>(&text).unwrap(), view, "{text}");
    }

    #[test]
    fn what_cannot_be_kept_or_shown_is_refused() {
        let picture = |text: &str| SavedView { picture: Some(text.into()), ..view() };
        assert_eq!(picture("data:image/jpeg;base64,/9j+A==").check(), Ok(()));
        let dark = LampState { lamp: Shiner::Sky, of: String::new(), power: Vec3::splat(-1.0) };
        for wrong in [
            picture("https://example.org/a.jpg"),
            picture("data:image/jpeg;base64,\"><script>"),
            picture(&format!("data:image/jpeg;base64,{}", "A".repeat(PICTURE_MAX))),
            SavedView { name: "a\nb".into(), ..view() },
            SavedView { name: "a".repeat(NAME_MAX + 1), ..view() },
            SavedView { target: Vec3::Z, ..view() },
            SavedView { lamps: vec![dark], ..view() },
        ] {
            assert!(wrong.check().is_err(), "{wrong:?}");
        }
    }
}
