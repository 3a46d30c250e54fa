//! Format 2 of recordings, read as what it means in the format of [`super`].
//!
//! There was one method, IGI, whose settings were those of workers' questions and of the filter; moving pictures named
//! the scale of their sides. Edits differ, too. What moves by itself was put to a place, where it stayed until the next change of time: by
//! `Transform`, or by `Poses`, which took a change of time back. Holes in a material were its `alpha`. Besides, the digest
//! of the world was made otherwise, so that it says nothing about a scene that is read by this program.

use std::path::PathBuf;

use frame::methods::igi;
use frame::{Filter, Method};
use protocol::question::Quality;
use scenes::{Camera, Change, Coverage, Material, Offset, Scene, Transform};
use serde::Deserialize;

use super::What;
use crate::methods::Named;

/// The number of this format.
pub(super) const VERSION: u32 = 2;

#[derive(Deserialize)]
struct Begun {
    scene: PathBuf,
    time: f64,
    seed: u64,
    quality: Quality,
    filter: FilterForm,
    steady: bool,
    camera: Camera,
}

#[derive(Deserialize)]
struct Line {
    t: f64,
    #[serde(flatten)]
    what: Event,
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Event {
    Look(Camera),
    Edit(Vec<Edit>),
    Turn { quality: Quality, filter: FilterForm },
    Moving { scale: f32 },
}

#[derive(Deserialize)]
enum Edit {
    Poses(Vec<(u32, Transform)>),
    Material {
        material: u32,
        value: Painted,
    },
    #[serde(untagged)]
    Other(Change),
}

#[derive(Deserialize)]
struct Painted {
    #[serde(flatten)]
    material: Material,
    alpha: Option<Holes>,
}

#[derive(Deserialize)]
struct Holes {
    texture: u32,
    channel: u8,
    threshold: f32,
}

/// A [`Filter`] with its window.
#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
enum FilterForm {
    Off,
    Plane([u8; 2]),
    Paper([u8; 2]),
}

/// What IGI's knobs were.
fn method(quality: &Quality, filter: FilterForm, steady: Option<bool>) -> Named {
    let filter = match filter {
        FilterForm::Off => Filter::OFF,
        FilterForm::Plane(window) => Filter::plane(window),
        FilterForm::Paper(window) => Filter::paper(window),
    };
    let values = igi::values(quality, &filter, steady.unwrap_or_default()).into_iter();
    // A turn of other knobs left this one as it was.
    let values = values.filter(|(name, _)| *name != "steady" || steady.is_some());
    Named { name: igi::IGI.name().into(), settings: values.map(|(name, value)| (name.into(), value)).collect() }
}

/// The first line.
pub(super) fn begun(text: &str) -> serde_json::Result<super::Begun> {
    let Begun { scene, time, seed, quality, filter, steady, camera } = serde_json::from_str(text)?;
    let igi_session = super::VERSION;
    let method = method(&quality, filter, Some(steady));
    Ok(super::Begun { igi_session, scene, time, seed, world: None, method, camera })
}

/// Every other line. Edits still have to be [`put_in_place`].
pub(super) fn line(text: &str) -> serde_json::Result<super::Line> {
    let Line { t, what } = serde_json::from_str(text)?;
    let what = match what {
        Event::Look(camera) => What::Look(camera),
        Event::Edit(edits) => What::Edit(edits.into_iter().flat_map(changes).collect()),
        Event::Turn { quality, filter } => What::Turn(method(&quality, filter, None)),
        // How many lights there were followed from it.
        Event::Moving { scale } => What::Shown { batches: 1, effort: scale * scale, still: 0 },
    };
    Ok(super::Line { t, what })
}

fn changes(edit: Edit) -> Vec<Change> {
    match edit {
        Edit::Poses(poses) => {
            let put = |(object, scene_from_object)| Change::Transform { object, scene_from_object };
            poses.into_iter().map(put).collect()
        }
        Edit::Material { material, value: Painted { material: mut value, alpha } } => {
            value.coverage = alpha.map(|holes| Coverage::mask(holes.texture, holes.channel, holes.threshold));
            vec![Change::Material { material, value }]
        }
        Edit::Other(change) => vec![change],
    }
}

/// Rewrites the edits of what moves by itself in `scene`, which must be as it was when the recording began: each is put
/// where it was put, and back onto its way by the next change of time.
pub(super) fn put_in_place(lines: &mut [super::Line], scene: &Scene) {
    let mut scene = scene.clone();
    // Those that a change of time has to put back.
    let mut placed = Vec::new();
    for line in lines {
        let What::Edit(edits) = &mut line.what else { continue };
        let mut rewritten = Vec::new();
        for change in edits.drain(..) {
            let from = rewritten.len();
            match change {
                Change::Transform { object, scene_from_object } => {
                    let motion = scene.objects.get(object as usize).and_then(|object| object.motion.as_ref());
                    placed.extend(motion.map(|_| object));
                    rewritten.push(Change::place(object, motion, scene.time, scene_from_object));
                }
                Change::Time(_) => {
                    let back = |object| Change::Offset { object, offset: Offset::default() };
                    rewritten.extend(placed.drain(..).map(back));
                    rewritten.push(change);
                }
                _ => rewritten.push(change),
            }
            for change in &rewritten[from..] {
                // What a scene cannot take is reported when the recording is played.
                let _ = change.apply(&mut scene);
            }
        }
        *edits = rewritten;
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use scenes::{Key, Mesh, Motion, Object};

    use super::*;

    /// Object 0 stands still, object 1 moves along x.
    fn scene() -> Scene {
        let keys = [0.0_f32, 8.0].map(|t| Key { time: t.into(), translate: Vec3::X * t, angle_deg: 0.0 }).to_vec();
        let motion = Motion { pivot: Vec3::ZERO, axis: Vec3::Y, keys, poses: Vec::new(), offset: Offset::default() };
        let mut objects: Vec<_> = (0..2).map(|i| Object::fixed(i.to_string(), 0)).collect();
        objects[1].motion = Some(motion);
        let mesh = Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            triangles: vec![[0, 1, 2]],
            materials: vec![0],
            ..Mesh::default()
        };
        let materials = vec![Material::diffuse("a", Vec3::ONE)];
        Scene { meshes: vec![mesh.into()], objects, materials, ..Scene::default() }
    }

    fn place(x: f32) -> serde_json::Value {
        serde_json::json!({ "linear": [1, 0, 0, 0, 1, 0, 0, 0, 1], "translation": [x, 0, 0] })
    }

    /// Where the two objects are after each of these edits.
    fn played(edits: &[serde_json::Value]) -> Vec<[f32; 2]> {
        let text = |edit| serde_json::json!({ "t": 0.5, "edit": [edit] }).to_string();
        let mut lines: Vec<_> = edits.iter().map(|edit| line(&text(edit)).unwrap()).collect();
        let mut scene = scene();
        put_in_place(&mut lines, &scene);
        let mut places = Vec::new();
        for line in lines {
            let What::Edit(changes) = line.what else { panic!("it is an edit") };
            changes.iter().for_each(|change| change.apply(&mut scene).unwrap());
            places.push([0, 1].map(|object: usize| scene.objects[object].scene_from_object.translation.x));
        }
        places
    }

    #[test]
    fn what_moves_is_where_it_was_put_until_the_time_changes() {
        let put =
            |object: u32, x| serde_json::json!({ "Transform": { "object": object, "scene_from_object": place(x) } });
        let time = |t: f32| serde_json::json!({ "Time": t });
        let poses = serde_json::json!({ "Poses": [[1, place(2.5)]] });
        let edits = [time(2.0), put(0, 9.0), put(1, 5.0), time(3.0), put(1, 7.0), poses, time(4.0), time(1.0)];
        let truth = [[0.0, 2.0], [9.0, 2.0], [9.0, 5.0], [9.0, 3.0], [9.0, 7.0], [9.0, 2.5], [9.0, 4.0], [9.0, 1.0]];
        assert_eq!(played(&edits), truth);
    }

    #[test]
    fn holes_stay_holes() {
        let mut painted = serde_json::to_value(Material::diffuse("fence", Vec3::ONE)).unwrap();
        let fields = painted.as_object_mut().unwrap();
        fields.remove("coverage");
        for (alpha, coverage) in [
            (serde_json::json!({ "texture": 2, "channel": 3, "threshold": 0.25 }), Some(Coverage::mask(2, 3, 0.25))),
            (serde_json::Value::Null, None),
        ] {
            painted["alpha"] = alpha;
            let text = serde_json::json!({ "t": 0, "edit": [{ "Material": { "material": 1, "value": painted } }] });
            let value = Material { coverage, ..Material::diffuse("fence", Vec3::ONE) };
            assert_eq!(
                line(&text.to_string()).unwrap().what,
                What::Edit(vec![Change::Material { material: 1, value }])
            );
        }
    }
}
