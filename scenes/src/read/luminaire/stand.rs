//! A file of photometric data that is opened as a scene: the luminaire hung up over a floor and before a wall, as people look
//! at luminaires.
//!
//! Axes as everywhere, in metres: y up, the wall behind. Reflectances are those that tables of utilisation are made for.

use std::path::Path;

use glam::Vec3;

use super::Entry;
use crate::read::error::Notes;
use crate::read::json::Reader;
use crate::read::{Draft, ReadError};
use crate::{Camera, Material, Mesh, Object, Scene};

/// How high it hangs, and how far the wall is behind it.
const HEIGHT: f64 = 2.7;
const FROM_WALL: f32 = 1.0;
/// Width of wall and floor, how far the floor reaches, and how high the wall is, or the ceiling.
const WIDTH: f32 = 8.0;
const DEPTH: f32 = 8.0;
const TOP: f32 = 3.5;
const OF_FLOOR: f32 = 0.2;
const OF_WALL: f32 = 0.5;
const OF_CEILING: f32 = 0.7;
/// A luminaire that sends more than this share of its light upwards hangs below a ceiling.
const UPWARDS: f64 = 0.05;

/// Reads the file and builds the stand.
pub(in crate::read) fn read(path: &Path, notes: &mut Notes) -> Result<Draft, ReadError> {
    let photometry = super::read(path, notes)?;
    let has_ceiling = photometry.web.share_beyond(90.0) > UPWARDS;
    let mut scene = Scene::default();
    let (left, right, behind, ahead) = (-WIDTH / 2.0, WIDTH / 2.0, -FROM_WALL, DEPTH - FROM_WALL);
    // Counter-clockwise as seen from within.
    let corners = |points: [[f32; 3]; 4]| points.map(Vec3::from);
    let floor = [[left, 0.0, behind], [left, 0.0, ahead], [right, 0.0, ahead], [right, 0.0, behind]];
    let wall = [[left, 0.0, behind], [right, 0.0, behind], [right, TOP, behind], [left, TOP, behind]];
    let ceiling = [[left, TOP, behind], [right, TOP, behind], [right, TOP, ahead], [left, TOP, ahead]];
    add(&mut scene, "floor", OF_FLOOR, corners(floor));
    add(&mut scene, "wall", OF_WALL, corners(wall));
    if has_ceiling {
        add(&mut scene, "ceiling", OF_CEILING, corners(ceiling));
    }

    let name = |part: Option<&std::ffi::OsStr>| part.unwrap_or_default().to_string_lossy().into_owned();
    let entry = Entry {
        profile: name(path.file_name()),
        position: [0.0, HEIGHT, 0.0],
        direction: None,
        target: None,
        side: None,
        turn_deg: 0.0,
        lumens: None,
        dimming: 1.0,
    };
    let folder = path.parent().unwrap_or(Path::new(""));
    let light = Reader { path, folder, notes }.hang("lights[0]", path, photometry, &entry, None, &mut scene)?;
    scene.lights.push(light);
    scene.light_names.push(name(path.file_stem()));
    scene.lights_are_photometric = true;
    let ceiling = if has_ceiling { format!(", under a ceiling at {TOP} m") } else { String::new() };
    notes.file(
        path,
        format!(
            "a luminaire alone: hung {HEIGHT} m above a floor, {FROM_WALL} m before a wall{ceiling}; a scene.json hangs it \
             anywhere"
        ),
    );
    let camera = Camera {
        origin: Vec3::new(2.2, 1.6, 5.5),
        target: Vec3::new(0.0, 1.5, behind),
        up: Vec3::Y,
        fov_y_deg: 38.0,
        ..Camera::default()
    };
    Ok(Draft { scene, camera: Some(camera), sky_is_said: true })
}

/// A grey rectangle.
fn add(scene: &mut Scene, name: &str, reflectance: f32, corners: [Vec3; 4]) {
    let number = scene.materials.len() as u32;
    scene.materials.push(Material::diffuse(name, Vec3::splat(reflectance)));
    let mesh = Mesh {
        positions: corners.to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        materials: vec![number; 2],
        ..Mesh::default()
    };
    scene.objects.push(Object::fixed(name, scene.meshes.len() as u32));
    scene.meshes.push(mesh.into());
}
