//! The scene as viewers need it: everything that can be edited, and boxes around objects and pieces.

use frame::live::edits;
use frame::live::pick;
use glam::Vec3;
use scenes::photometry::LUMENS_PER_WATT;
use scenes::solid::solid_angle;
use scenes::{Change, Environment, Light, Material, Scene, Transform};
use serde::{Deserialize, Serialize};

/// A scene, as far as viewers need it. Each list ends after [`LISTED_MAX`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SceneInfo {
    /// As in [`Scene::name`].
    pub name: String,
    /// How many there are.
    pub triangles: usize,
    /// What the file keeps apart; their places in this list are the numbers that [`Change`] knows them by.
    pub objects: Vec<ObjectInfo>,
    /// Pieces of objects that have been lifted. A viewer adds those that it is sent later.
    pub pieces: Vec<PieceInfo>,
    /// As in [`Scene::materials`], those of the file.
    pub materials: Vec<Material>,
    /// As in [`Scene::lights`].
    pub lights: Vec<Light>,
    /// Their names in the file; absent or empty where it gives none.
    pub light_names: Vec<String>,
    /// As in [`Scene::environment`].
    pub environment: Environment,
    /// Names of the textures.
    pub textures: Vec<String>,
    /// Those of them that luminaires have.
    pub solids: Vec<SolidInfo>,
    /// First and last key of what moves by itself, seconds; `None` if nothing does.
    pub time: Option<[f64; 2]>,
    /// What the numbers of its files are on the light meter, in words.
    pub unit: String,
}

/// An object, as far as viewers need it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ObjectInfo {
    /// As in the file; may be empty.
    pub name: String,
    /// Scene space from object space.
    pub place: Transform,
    /// It is drawn.
    pub visible: bool,
    /// It moves by itself.
    pub moves: bool,
    /// Least and greatest corner of its box, object space; `None` if it is empty.
    #[serde(rename = "box")]
    pub bounds: Option<[Vec3; 2]>,
    /// Its first few different materials, by number, whatever it has of its own instead.
    pub materials: Vec<u32>,
    /// What it has of its own, by what that is instead of.
    pub own: Vec<(u32, Material)>,
}

/// A photometric solid, as far as viewers need it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SolidInfo {
    /// Its number: index into [`Scene::textures`].
    pub texture: u32,
    /// The file that it is from.
    pub name: String,
    /// Lumens of a luminaire that has it, for each candela of its largest intensity.
    pub steradians: f64,
}

/// A piece of an object, as far as viewers need it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PieceInfo {
    /// Number of the object.
    pub object: u32,
    /// Which of its pieces.
    pub piece: u32,
    /// Where it has been moved, in the object's own space.
    pub place: Transform,
    /// It is drawn.
    pub visible: bool,
    /// Least and greatest corner of its box where it was modelled, object space.
    #[serde(rename = "box")]
    pub bounds: Option<[Vec3; 2]>,
    /// Its first few different materials, by number, whatever it has of its own instead.
    pub materials: Vec<u32>,
    /// What it has of its own, by what that is instead of.
    pub own: Vec<(u32, Material)>,
}

/// Longest list that viewers are sent; what comes after can still be picked.
const LISTED_MAX: usize = 4096;
/// Most materials that are listed of an object.
const MATERIALS_LISTED: usize = 64;

impl SceneInfo {
    /// Of a scene as it is.
    pub fn of(scene: &Scene) -> Self {
        let lifted = scene.objects.iter().filter_map(|object| object.lifted.as_ref()).take(LISTED_MAX);
        let times = scene.objects.iter().filter_map(|object| object.motion.as_ref()).flat_map(scenes::Motion::times);
        let span = times.fold(None, |span: Option<[f64; 2]>, t| {
            let [from, to] = span.unwrap_or([t; 2]);
            Some([from.min(t), to.max(t)])
        });
        let wholes = 0..scene.wholes().min(LISTED_MAX) as u32;
        Self {
            name: scene.name.clone(),
            triangles: scene.triangle_count(),
            objects: wholes.map(|number| ObjectInfo::of(scene, number)).collect(),
            pieces: lifted.map(|lifted| PieceInfo::of(scene, lifted.of, lifted.piece)).collect(),
            materials: first(&scene.materials[..scene.shared_materials()]),
            lights: first(&scene.lights),
            light_names: first(&scene.light_names),
            environment: scene.environment,
            textures: scene.textures.iter().take(LISTED_MAX).map(|texture| texture.name.clone()).collect(),
            solids: SolidInfo::all(scene),
            time: span,
            unit: unit(scene),
        }
    }
}

fn unit(scene: &Scene) -> String {
    if scene.lights_are_photometric {
        return "as in the file: lights in cd and lx".into();
    }
    format!("1 W/m² in the files is {LUMENS_PER_WATT} lx")
}

fn first<T: Clone>(all: &[T]) -> Vec<T> {
    all.iter().take(LISTED_MAX).cloned().collect()
}

/// The first few different ones.
fn listed(mut materials: Vec<u32>) -> Vec<u32> {
    materials.sort_unstable();
    materials.dedup();
    materials.truncate(MATERIALS_LISTED);
    materials
}

/// What an object has of its own.
fn own(scene: &Scene, object: usize) -> Vec<(u32, Material)> {
    let own = scene.objects[object].own.iter().take(MATERIALS_LISTED);
    own.map(|own| (own.instead_of, scene.materials[own.material as usize].clone())).collect()
}

impl SolidInfo {
    /// Those that lamps have, and all that were brought along may: ascending, each once.
    fn all(scene: &Scene) -> Vec<Self> {
        let mut used: Vec<u32> = scene
            .lights
            .iter()
            .filter_map(|light| match light {
                Light::Luminaire { solid, .. } => Some(*solid),
                _ => None,
            })
            .collect();
        used.sort_unstable();
        used.dedup();
        used.truncate(LISTED_MAX);
        let of = |texture: u32| {
            let solid = &scene.textures[texture as usize];
            Self { texture, name: solid.name.clone(), steradians: solid_angle(solid) }
        };
        used.into_iter().map(of).collect()
    }

    /// Of the solid that a change brings along.
    pub fn of_change(change: &Change) -> Option<Self> {
        let Change::Solid { texture, value } = change else { return None };
        Some(Self { texture: *texture, name: value.name.clone(), steradians: solid_angle(&value.texture()) })
    }
}

impl ObjectInfo {
    /// Of an object, which must exist.
    fn of(scene: &Scene, number: u32) -> Self {
        let object = &scene.objects[number as usize];
        Self {
            name: object.name.clone(),
            place: object.scene_from_object,
            visible: object.visible,
            moves: object.motion.is_some(),
            bounds: pick::bounds(scene, number),
            materials: listed(scene.meshes[object.mesh as usize].materials.clone()),
            own: own(scene, number as usize),
        }
    }
}

impl PieceInfo {
    /// Of a piece of an object, which must exist.
    pub fn of(scene: &Scene, object: u32, piece: u32) -> Self {
        let lifted = scene.piece(object, piece);
        let mesh = &scene.meshes[scene.objects[object as usize].mesh as usize];
        let triangles = mesh.pieces();
        let materials = triangles.triangles(piece).iter().map(|triangle| mesh.materials[*triangle as usize]);
        Self {
            object,
            piece,
            place: lifted.whole_from_piece,
            visible: lifted.visible,
            bounds: pick::bounds_of_piece(scene, object, piece),
            materials: listed(materials.collect()),
            own: scene.find_lifted(object, piece).map_or_else(|_| Vec::new(), |place| own(scene, place)),
        }
    }
}

/// The pieces that some changes are about; the scene must be able to take the changes.
pub(super) fn pieces(scene: &Scene, changes: &[Change]) -> Vec<PieceInfo> {
    let mut named: Vec<_> = changes
        .iter()
        .filter_map(|change| match change {
            Change::PieceTransform { object, piece, .. }
            | Change::PieceVisible { object, piece, .. }
            | Change::OwnMaterial { object, piece: Some(piece), .. } => Some((*object, *piece)),
            _ => None,
        })
        .collect();
    named.sort_unstable();
    named.dedup();
    named.into_iter().map(|(object, piece)| PieceInfo::of(scene, object, piece)).collect()
}

/// Where changes put what moves by itself, when they and those that wait have been made: viewers do not know the keys.
pub(super) fn poses(scene: &Scene, waiting: &[Change], changes: &[Change]) -> Vec<(u32, Transform)> {
    let all = [waiting, changes].concat();
    let (time, is_later) = (edits::time(scene, &all), changes.iter().any(|change| matches!(change, Change::Time(_))));
    let is_put =
        |number: u32| changes.iter().any(|change| matches!(change, Change::Offset { object, .. } if *object == number));
    let moved = (0..).zip(&scene.objects).take(LISTED_MAX).filter(|(_, object)| object.motion.is_some());
    let moved = moved.map(|(number, _)| number).filter(|number| is_later || is_put(*number));
    moved.filter_map(|number| Some((number, edits::motion(scene, &all, number)?.at(time)))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_a_time_and_an_offset_put_what_moves_is_sent() {
        let key = |time: f64| scenes::Key { time, translate: Vec3::splat(time as f32), angle_deg: 0.0 };
        let (keys, offset) = (vec![key(0.0), key(4.0)], scenes::Offset::default());
        let motion = scenes::Motion { pivot: Vec3::ZERO, axis: Vec3::Y, keys, poses: Vec::new(), offset };
        let mut objects = vec![scenes::Object::fixed("a", 0), scenes::Object::fixed("b", 0)];
        objects[1].motion = Some(motion);
        let scene = Scene { objects, ..Scene::default() };
        let at = |place: Vec3| vec![(1, Transform { translation: place, ..Transform::IDENTITY })];
        let time = [Change::Time(2.0)];
        let hide = [Change::Visible { object: 0, visible: false }];
        let put = [Change::Offset { object: 1, offset: scenes::Offset { shift: Vec3::X, ..offset } }];
        assert_eq!(poses(&scene, &[], &time), at(Vec3::splat(2.0)));
        assert_eq!(poses(&scene, &time, &put), at(Vec3::new(3.0, 2.0, 2.0)));
        assert_eq!(poses(&scene, &time, &hide), []);
    }
}
