//! A scene that was edited, as a file keeps it: which file it stands on, and what was done to that. Each edit has the name
//! of what it is about, so that it finds it again when that file has changed since. `scenes/README.md` describes the format.

use std::collections::BTreeMap;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::change::{About, Lamp};
use crate::{Camera, Change, Environment, Gloss, Light, Material, Preset, SavedView, Scene, Surface};

/// What the file says. Reading it is [`crate::read`]'s.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Edited<E = SavedEdit> {
    /// The file it stands on, as seen from this file's folder; not itself an edited scene.
    pub scene: String,
    /// Where coordinates in this file have their origin, in that file's space: its [`Scene::centre`].
    #[serde(default, skip_serializing_if = "is_zero")]
    pub centre: DVec3,
    /// The moment of an animated scene, in its own unit of time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<f64>,
    /// From where it was looked at; `None`: as the file it stands on says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<Camera>,
    /// Saved views.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub views: Vec<SavedView>,
    /// How lamps are, under names.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub presets: Vec<Preset>,
    /// The names of the scene's textures by number, if an edit has any.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub textures: Vec<String>,
    /// In order.
    pub edits: Vec<E>,
    /// Fields that are not known here.
    #[serde(flatten)]
    pub unknown: BTreeMap<String, serde_json::Value>,
}

/// An edit, and what tells whether it still fits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedEdit {
    /// What the file calls the thing, or the lamp that another is put in place of; empty if it has no name, or is the only
    /// one of its kind.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub of: String,
    /// Of a piece: how many triangles the whole has. Another mesh falls into other pieces.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub triangles: Option<usize>,
    /// What was done. Numbers count if the thing of that number has the name; else the only one that has it is meant.
    pub change: Change,
}

impl Edited {
    /// What leads from a scene, as its file says, to another state of it. `now` may hold edits of camera and time; the last
    /// ones count. `stands_on` is the file, as seen from where this will lie.
    pub fn of(stands_on: String, base: &Scene, changes: Vec<Change>, camera: Camera, time: f64) -> Self {
        let mut uses_textures = false;
        let mut edits = Vec::new();
        for mut change in changes {
            if let Change::Camera(_) | Change::Time(_) = change {
                continue;
            }
            uses_textures |= !textures_of(&mut change).is_empty() || matches!(change, Change::Solid { .. });
            let of = match &change {
                Change::Lamp { light, value: Some(_) } => there(base, *light),
                change => change.about().and_then(|about| about.name(base)).unwrap_or_default().to_owned(),
            };
            edits.push(SavedEdit { of, triangles: triangles(&change, base), change });
        }
        let names = base.textures.iter().filter(|_| uses_textures).map(|texture| texture.name.clone());
        let moves = base.objects.iter().any(|object| object.motion.is_some());
        Self {
            scene: stands_on,
            centre: base.centre,
            time: moves.then_some(time),
            camera: Some(camera),
            views: Vec::new(),
            presets: Vec::new(),
            textures: names.collect(),
            edits,
            unknown: BTreeMap::new(),
        }
    }

    /// As the file holds it: JSON, an edit or a view a line.
    ///
    /// # Errors
    /// A number is none that JSON can hold.
    pub fn encode(&self) -> serde_json::Result<String> {
        let Self { scene, centre, time, camera, views, textures, edits, presets, unknown: _ } = self;
        let mut fields = vec![("scene", serde_json::to_string(scene)?)];
        if !is_zero(centre) {
            fields.push(("centre", serde_json::to_string(centre)?));
        }
        if let Some(time) = time {
            fields.push(("time", serde_json::to_string(time)?));
        }
        if let Some(camera) = camera {
            fields.push(("camera", serde_json::to_string(camera)?));
        }
        if !textures.is_empty() {
            fields.push(("textures", serde_json::to_string(textures)?));
        }
        if !views.is_empty() {
            fields.push(("views", lines(views)?));
        }
        if !presets.is_empty() {
            fields.push(("presets", lines(presets)?));
        }
        fields.push(("edits", lines(edits)?));
        let fields: Vec<_> = fields.into_iter().map(|(name, value)| format!("  \"{name}\": {value}")).collect();
        Ok(format!("{{\n{}\n}}\n", fields.join(",\n")))
    }
}

/// A list, an item a line.
fn lines(items: &[impl Serialize]) -> serde_json::Result<String> {
    let items = items.iter().map(serde_json::to_string).collect::<serde_json::Result<Vec<_>>>()?;
    Ok(format!("[\n    {}\n  ]", items.join(",\n    ")))
}

impl SavedEdit {
    /// The edit for a scene, wherever what it is about is there. `textures` are those of [`Edited::textures`], `moved` how far
    /// the scene's centre has gone since, that is [`Edited::centre`] less [`Scene::centre`].
    ///
    /// # Errors
    /// In words, why it fits no longer.
    pub fn fit(&self, scene: &Scene, textures: &[String], moved: DVec3) -> Result<Change, String> {
        let mut change = match self.change.about() {
            None => match &self.change {
                Change::Lamp { light, .. } if there(scene, *light) != self.of => {
                    return Err("the file has another lamp of that number now".into());
                }
                change => change.clone(),
            },
            Some(about) => {
                let is_it = |number: &u32| about.of_number(*number).name(scene) == Some(self.of.as_str());
                let mut alike = (0..about.count(scene)).filter(is_it);
                let number = match (is_it(&about.number()), alike.next(), alike.next()) {
                    (true, ..) => about.number(),
                    (false, Some(only), None) if !self.of.is_empty() => only,
                    (false, None, _) => return Err("there is no such thing any more".into()),
                    _ => return Err("there are several of that name, and none has its number".into()),
                };
                self.change.of_number(number)
            }
        };
        if let Change::OwnMaterial { material, value: Some(value), .. } = &mut change {
            renumber_material(material, &value.name, scene)?;
        }
        if triangles(&change, scene) != self.triangles {
            return Err("it has other triangles now, and so other pieces".into());
        }
        let is_brought_along = |texture: u32| texture as usize >= textures.len();
        if change.solid_mut().is_some_and(|solid| is_brought_along(*solid)) {
            change = change.behind_textures(textures.len(), scene.textures.len());
        } else {
            for texture in textures_of(&mut change) {
                renumber(texture, textures, scene)?;
            }
        }
        match &mut change {
            Change::Light {
                value: Light::Point { position, .. } | Light::Spot { position, .. } | Light::Luminaire { position, .. },
                ..
            }
            | Change::Lamp {
                value:
                    Some(Lamp {
                        light:
                            Light::Point { position, .. } | Light::Spot { position, .. } | Light::Luminaire { position, .. },
                        ..
                    }),
                ..
            } => {
                *position = (position.as_dvec3() + moved).as_vec3();
            }
            Change::Transform { .. } | Change::Offset { .. } | Change::PieceTransform { .. }
                if moved != DVec3::ZERO =>
            {
                return Err("the scene's middle is elsewhere now, and so would be its place".into());
            }
            _ => {}
        }
        Ok(change)
    }
}

/// Name of the lamp of a number; empty if there is none.
fn there(scene: &Scene, light: u32) -> String {
    scene.lamp(light).map(|lamp| lamp.name).unwrap_or_default()
}

/// Of a change to a piece: how many triangles the whole has.
fn triangles(change: &Change, scene: &Scene) -> Option<usize> {
    let (Change::PieceTransform { object, .. }
    | Change::PieceVisible { object, .. }
    | Change::OwnMaterial { object, piece: Some(_), .. }) = change
    else {
        return None;
    };
    let whole = scene.objects.get(*object as usize)?;
    Some(scene.meshes[whole.mesh as usize].triangles.len())
}

/// Finds a material by its name, which what is had instead of it has kept.
fn renumber_material(material: &mut u32, name: &str, scene: &Scene) -> Result<(), String> {
    let is_it = |number: &u32| About::Material(*number).name(scene) == Some(name);
    if !is_it(material) {
        let mut alike = (0..About::Material(0).count(scene)).filter(is_it);
        let only = alike.next().filter(|_| alike.next().is_none());
        *material = only.ok_or_else(|| format!("its material `{name}` is not there any more"))?;
    }
    Ok(())
}

/// Finds a texture by its name.
fn renumber(texture: &mut u32, names: &[String], scene: &Scene) -> Result<(), String> {
    let name = names.get(*texture as usize).ok_or_else(|| format!("`textures` does not name texture {texture}"))?;
    let is_it = |number: usize| scene.textures.get(number).is_some_and(|texture| texture.name == *name);
    if !is_it(*texture as usize) {
        let mut alike = (0..scene.textures.len()).filter(|number| is_it(*number));
        let only = alike.next().filter(|_| alike.next().is_none());
        *texture = only.ok_or_else(|| format!("its texture `{name}` is not there any more"))? as u32;
    }
    Ok(())
}

/// Every number of a texture that an edit has: a material's, and the photometric web of a luminaire.
fn textures_of(change: &mut Change) -> Vec<&mut u32> {
    match change {
        Change::Material { value, .. } | Change::OwnMaterial { value: Some(value), .. } => textures_mut(value),
        Change::Light { .. } | Change::Lamp { .. } => change.solid_mut().into_iter().collect(),
        Change::Environment(Environment::Image { texture, .. }) => vec![texture],
        _ => Vec::new(),
    }
}

/// Every number of a texture that a material has.
fn textures_mut(material: &mut Material) -> Vec<&mut u32> {
    let Material { surface, emission, coverage, relief, .. } = material;
    let (mut colours, mut scalars) = (vec![emission], Vec::new());
    match surface {
        Surface::Diffuse { albedo } => colours.push(albedo),
        Surface::Mirror { .. } => {}
        Surface::Dielectric(glass) => {
            colours.push(&mut glass.transmittance);
            scalars.push(&mut glass.roughness);
        }
        Surface::Glossy(Gloss { base, roughness, metalness, specular, sheen, coat, .. }) => {
            colours.extend([base, &mut specular.colour]);
            scalars.extend([roughness, metalness, &mut specular.amount]);
            if let Some(sheen) = sheen {
                colours.push(&mut sheen.colour);
                scalars.push(&mut sheen.roughness);
            }
            scalars.extend(coat.iter_mut().flat_map(|coat| [&mut coat.amount, &mut coat.roughness]));
        }
        Surface::Glazed { amount, glass, base, metalness, specular, .. } => {
            colours.extend([&mut glass.transmittance, base, &mut specular.colour]);
            scalars.extend([amount, &mut glass.roughness, metalness, &mut specular.amount]);
        }
        Surface::Translucent { albedo, transmittance } => colours.extend([albedo, transmittance]),
    }
    scalars.extend(coverage.iter_mut().map(|coverage| &mut coverage.amount));
    let of_colours = colours.into_iter().filter_map(|colour| colour.texture.as_mut());
    let of_scalars = scalars.into_iter().filter_map(|scalar| scalar.texture.as_mut().map(|(texture, _)| texture));
    of_colours.chain(of_scalars).chain(relief.as_mut().map(|relief| &mut relief.texture)).collect()
}

fn is_zero(place: &DVec3) -> bool {
    *place == DVec3::ZERO
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::Vec3;

    use super::*;
    use crate::{Colour, Object, Texture};

    fn texture(name: &str) -> Arc<Texture> {
        let (pixels, look_up) = (crate::Pixels::Linear8(vec![[255; 4]]), crate::LookUp::REPEAT);
        Arc::new(Texture { name: name.into(), width: 1, height: 1, pixels, look_up })
    }

    fn lamp(x: f32) -> Light {
        Light::Point { position: Vec3::X * x, intensity: Vec3::ONE }
    }

    fn scene(lamps: &[&str], textures: &[&str]) -> Scene {
        Scene {
            objects: vec![Object::fixed("room", 0)],
            meshes: vec![Arc::default()],
            materials: vec![Material::diffuse("wall", Vec3::ONE)],
            textures: textures.iter().copied().map(texture).collect(),
            lights: lamps.iter().map(|_| lamp(1.0)).collect(),
            light_names: lamps.iter().map(|name| (*name).to_owned()).collect(),
            ..Scene::default()
        }
    }

    #[test]
    fn an_edit_finds_the_lamp_of_its_name_when_the_file_lists_them_otherwise() {
        let base = scene(&["left", "right", ""], &[]);
        let edit = |light: u32| {
            let change = Change::Light { light, value: lamp(7.0) };
            Edited::of("a.obj".into(), &base, vec![change], base.camera, 0.0).edits.remove(0)
        };
        let fit = |edit: &SavedEdit, lamps: &[&str]| {
            edit.fit(&scene(lamps, &[]), &[], DVec3::ZERO).map(|change| change.about().unwrap().number())
        };
        assert_eq!(edit(1).of, "right");
        assert_eq!(fit(&edit(1), &["left", "right"]), Ok(1));
        assert_eq!(fit(&edit(1), &["right", "left", "up"]), Ok(0));
        assert!(fit(&edit(1), &["left"]).unwrap_err().contains("no such thing"));
        assert!(fit(&edit(1), &["right", "left", "right"]).unwrap_err().contains("several"));
        assert_eq!(fit(&edit(1), &["right", "right"]), Ok(1), "of two alike, the one of its number");
        assert_eq!(fit(&edit(2), &["a", "b", ""]), Ok(2));
        assert!(fit(&edit(2), &["a", "", "b"]).is_err(), "what has no name is not looked for elsewhere");
    }

    #[test]
    fn textures_are_found_by_name_and_places_where_the_centre_was() {
        let base = scene(&["left"], &["oak", "pine"]);
        let mut value = base.materials[0].clone();
        value.surface = Surface::Diffuse { albedo: Colour { value: Vec3::ONE, texture: Some(1) } };
        let changes = vec![Change::Material { material: 0, value }, Change::Light { light: 0, value: lamp(7.0) }];
        let edited = Edited::of("a.obj".into(), &base, changes, base.camera, 0.0);
        assert_eq!(edited.textures, ["oak", "pine"]);
        let fit = |textures: &[&str], moved| edited.edits[0].fit(&scene(&["left"], textures), &edited.textures, moved);
        let texture = |change: Change| match change {
            Change::Material { mut value, .. } => {
                textures_mut(&mut value).into_iter().map(|texture| *texture).collect()
            }
            _ => Vec::new(),
        };
        assert_eq!(fit(&["oak", "pine"], DVec3::ZERO).map(texture), Ok(vec![1]));
        assert_eq!(fit(&["pine"], DVec3::ZERO).map(texture), Ok(vec![0]));
        assert!(fit(&["oak"], DVec3::ZERO).unwrap_err().contains("`pine`"));
        let moved = edited.edits[1].fit(&base, &[], DVec3::new(1.0, 0.0, 0.0));
        assert_eq!(moved, Ok(Change::Light { light: 0, value: lamp(8.0) }));
    }

    #[test]
    fn a_material_of_its_own_finds_its_object_its_texture_and_what_it_is_instead_of() {
        let mut base = scene(&[], &["oak"]);
        base.materials.insert(0, Material::diffuse("floor", Vec3::ONE));
        let triangle = [Vec3::ZERO, Vec3::X, Vec3::Y].to_vec();
        let mesh = crate::Mesh {
            positions: triangle,
            triangles: vec![[0, 1, 2]],
            materials: vec![1],
            ..crate::Mesh::default()
        };
        base.meshes = vec![mesh.into()];
        let mut now = base.clone();
        let mut value = base.materials[1].clone();
        value.surface = Surface::Diffuse { albedo: Colour { value: Vec3::splat(0.5), texture: Some(0) } };
        Change::OwnMaterial { object: 0, piece: None, material: 1, value: Some(value) }.apply(&mut now).unwrap();
        let edited = Edited::of("a.obj".into(), &base, base.changes_to(&now), base.camera, 0.0);
        let read: Edited = serde_json::from_str(&edited.encode().unwrap()).unwrap();
        assert_eq!((read.textures.as_slice(), read.edits[0].of.as_str()), (&["oak".to_owned()][..], "room"));
        let fit = |scene: &Scene| read.edits[0].fit(scene, &read.textures, DVec3::ZERO);
        assert_eq!(fit(&base), Ok(base.changes_to(&now).remove(0)));
        let mut again = base.clone();
        again.materials.remove(0);
        again.objects.insert(0, Object::fixed("lawn", 0));
        assert!(matches!(fit(&again), Ok(Change::OwnMaterial { object: 1, material: 0, .. })));
        again.materials[0].name = "paper".into();
        assert!(fit(&again).unwrap_err().contains("`wall`"));
    }

    #[test]
    fn lamps_that_were_added_or_taken_away_and_a_dimmed_sky_are_found_again_in_any_order() {
        let base = Scene { environment: Environment::Constant(Vec3::ONE), ..scene(&["left", "right", "up"], &[]) };
        let new = |x: f32| Some(Lamp { name: "new".into(), light: lamp(x) });
        let edits = [
            Change::Lamp { light: 5, value: new(7.0) },
            Change::Lamp { light: 1, value: None },
            Change::Environment(Environment::Constant(Vec3::splat(0.5))),
            Change::Lamp { light: 2, value: None },
            Change::Lamp { light: 4, value: new(8.0) },
            Change::Lamp { light: 0, value: new(9.0) },
        ];
        let made = |edits: &[&Change]| {
            let mut scene = base.clone();
            edits.iter().for_each(|edit| edit.apply(&mut scene).unwrap());
            scene
        };
        let now = made(&edits.iter().collect::<Vec<_>>());
        assert_eq!(made(&edits.iter().rev().collect::<Vec<_>>()), now, "whatever came first");
        assert_eq!((now.lamp(0), now.lamp(1), now.lamp(4)), (new(9.0), None, new(8.0)));
        now.check().unwrap();

        let edited = Edited::of("a.obj".into(), &base, base.changes_to(&now), base.camera, 0.0);
        let read: Edited = serde_json::from_str(&edited.encode().unwrap()).unwrap();
        let again = |file: &Scene| {
            let mut scene = file.clone();
            for edit in &read.edits {
                edit.fit(file, &[], DVec3::ZERO)?.apply(&mut scene).map_err(|refused| refused.0)?;
            }
            Ok::<_, String>(scene)
        };
        assert_eq!(again(&base), Ok(now.clone()));
        let grown = scene(&["left", "right", "up", "a", "b"], &[]);
        assert!(again(&grown).unwrap_err().contains("another lamp"));

        // All of them taken back: as it was, to the last of what stood for lamps.
        let mut back = now.clone();
        now.changes_to(&base).iter().for_each(|change| change.apply(&mut back).unwrap());
        assert_eq!(back, base);
        for wrong in [Change::Lamp { light: 1 << 20, value: new(1.0) }, Change::Lamp { light: 1 << 20, value: None }] {
            assert!(wrong.check(&base).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn a_solid_that_was_brought_along_stands_behind_the_textures_of_the_file_however_many_it_has() {
        let base = scene(&["left", "right"], &["oak"]);
        let solid = |share: f32| crate::Solid { name: "spot.ies".into(), planes: 1, relative: vec![1.0, share] };
        let hung = |solid: u32| Light::Luminaire {
            position: Vec3::X,
            direction: Vec3::NEG_Y,
            side: Vec3::X,
            intensity: Vec3::ONE,
            solid,
        };
        let bring = |texture: u32, share: f32| Change::Solid { texture, value: solid(share).into() };
        let mut now = base.clone();
        let lamp = Change::Light { light: 1, value: hung(2) };
        assert!(lamp.check(&base).is_err(), "there is no such solid");
        for change in [bring(1, 0.25), bring(2, 0.5), bring(2, 0.5), lamp] {
            change.apply(&mut now).unwrap();
        }
        now.check().unwrap();
        for wrong in [bring(2, 0.25), bring(4, 0.5), bring(0, 0.5), bring(3, 2.0)] {
            assert!(wrong.check(&now).is_err(), "{wrong:?}");
        }
        let edited = Edited::of("a.obj".into(), &base, base.changes_to(&now), base.camera, 0.0);
        let read: Edited = serde_json::from_str(&edited.encode().unwrap()).unwrap();
        let again = |file: &Scene| {
            let mut scene = file.clone();
            for edit in &read.edits {
                edit.fit(file, &read.textures, DVec3::ZERO).unwrap().apply(&mut scene).unwrap();
            }
            scene
        };
        assert_eq!(again(&base), now);
        let grown = again(&scene(&["left", "right"], &["pine", "oak", "ash"]));
        assert_eq!((grown.lights[1].clone(), grown.textures.len()), (hung(4), 5));
        assert_eq!(*grown.textures[4], solid(0.5).texture());
        // Taken back, nothing is left that would be saved.
        Change::Light { light: 1, value: base.lights[1].clone() }.apply(&mut now).unwrap();
        assert_eq!(base.changes_to(&now), []);
    }

    #[test]
    fn what_is_written_is_read_again_to_the_bit() {
        let base = scene(&["left", "right"], &[]);
        let value = Light::Point { position: Vec3::new(0.1, 1.0 / 3.0, 1e-30), intensity: Vec3::splat(0.4) };
        let hide = Change::Visible { object: 0, visible: false };
        let changes = vec![Change::Light { light: 1, value }, hide];
        let mut edited = Edited::of("a \"b\".obj".into(), &base, changes, base.camera, 0.0);
        let lamps = crate::views::LampState::all(&base, |_| true);
        let view = SavedView { name: "north".into(), origin: Vec3::splat(0.1), lamps, ..SavedView::default() };
        edited.presets = vec![Preset { name: "evening".into(), lamps: view.lamps.clone() }];
        edited.views = vec![view; 2];
        let text = edited.encode().unwrap();
        assert_eq!(serde_json::from_str::<Edited>(&text).unwrap(), edited, "{text}");
        assert_eq!(text.lines().filter(|line| line.contains("change")).count(), 2, "an edit a line: {text}");
    }
}
