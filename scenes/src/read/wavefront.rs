//! OBJ and MTL together: groups of faces become objects, names become materials.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

use super::error::{Notes, Tally};
use super::find::find;
use super::mesh::{Added, Bounds, MeshBuilder, Vertex};
use super::mtl::{self, Mtl};
use super::obj::{self, Corner, Group, NONE, Obj};
use super::surface::{Layout, Surfaces};
use super::textures::Textures;
use super::{Draft, ReadError, limits};
use crate::{Material, Mesh, Object, Scene};

/// Up to so many `o` names become objects of their own, so that a designer can move each chair.
/// Beyond, names are mostly an exporter's (a screw each), and hundreds of objects that overlap
/// slow every ray: those that nobody said would move are merged into one.
const OBJECTS_APART_MAX: usize = 64;

/// Reads an OBJ file and the MTL files it names. Objects in `movable` are never merged.
pub(super) fn read(path: &Path, movable: &BTreeSet<String>, notes: &mut Notes) -> Result<Draft, ReadError> {
    let obj = obj::parse(path, limits::read_bytes(path)?, notes)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let library = Library::read(path, folder, &obj, notes);
    let mut textures = Textures::default();
    let surfaces = Surfaces::new(folder, &mut textures, notes);
    let materials = Materials::resolve(path, &obj, &library, surfaces);

    let centre = bounds(&obj).centre();
    let mut scene = Scene { centre, materials: materials.list, textures: textures.list, ..Scene::default() };
    let mut tallies = Tallies::default();
    let objects = objects(&obj, movable, path, notes);
    let of = |members: &[usize]| {
        let groups: Vec<_> = members.iter().map(|&i| (&obj.groups[i], materials.of_group[i])).collect();
        mesh(&obj, &groups, &scene, &materials.layouts)
    };
    let meshes: Vec<_> = objects.par_iter().map(|(_, members)| of(members)).collect();
    drop(obj);
    for ((name, _), (mesh, left_out)) in objects.into_iter().zip(meshes) {
        tallies.append(left_out);
        if !mesh.triangles.is_empty() {
            scene.objects.push(Object::fixed(name, scene.meshes.len() as u32));
            scene.meshes.push(mesh.into());
        }
    }
    tallies.report(path, notes);
    Ok(Draft { scene, camera: None, sky_is_said: false })
}

/// Materials by name.
#[derive(Default)]
struct Library(BTreeMap<String, Mtl>);

impl Library {
    /// What the files say that the OBJ names; if there is none, what the one beside it says that is called like it.
    fn read(path: &Path, folder: &Path, obj: &Obj, notes: &mut Notes) -> Self {
        let mut library = Self::default();
        let mut found = false;
        for (written, line) in &obj.libraries {
            for name in library_names(folder, written) {
                match find(&[folder], &name) {
                    Some(file) => {
                        found = true;
                        library.add(&file, notes);
                    }
                    None => {
                        let message = format!("material file `{name}` does not exist; its materials are grey");
                        notes.line(path, *line, message);
                    }
                }
            }
        }
        let are_named = obj.groups.iter().any(|group| group.material.is_some());
        let namesake = path.with_extension("mtl");
        let namesake = namesake.file_name().unwrap_or_default().to_string_lossy();
        if let Some(file) = find(&[folder], &namesake).filter(|_| are_named && !found) {
            notes.file(path, format!("names no material file that exists: `{namesake}` beside it is used"));
            library.add(&file, notes);
        }
        library
    }

    fn add(&mut self, file: &Path, notes: &mut Notes) {
        match limits::read_bytes(file) {
            Ok(bytes) => {
                for material in mtl::parse(file, &bytes, notes) {
                    if let Some(bare) = without_comment(&material.name) {
                        self.0.entry(bare.to_owned()).or_insert_with(|| material.clone());
                    }
                    self.0.insert(material.name.clone(), material);
                }
            }
            Err(error) => notes.file(file, format!("its materials are grey: {error}")),
        }
    }

    /// By the whole name, or without what may be a comment.
    fn get(&self, name: &str) -> Option<&Mtl> {
        self.0.get(name).or_else(|| self.0.get(without_comment(name)?))
    }
}

/// `red` of `red # the wall`.
fn without_comment(name: &str) -> Option<&str> {
    name.split_once(" # ").map(|(name, _)| name.trim_ascii_end())
}

/// One name or several, each of which may have blanks in it, plain or behind `\`: the longest that is a file's; where none
/// is, what ends in `.mtl`, or a word.
fn library_names(folder: &Path, written: &str) -> Vec<String> {
    let whole = written.trim_matches('"').to_owned();
    if find(&[folder], &whole).is_some() {
        return vec![whole];
    }
    let words: Vec<&str> = written.split_ascii_whitespace().take_while(|name| !name.starts_with('#')).collect();
    let mut rest = &words[..];
    let mut names = Vec::new();
    while !rest.is_empty() {
        let name = |count: usize| rest[..count].join(" ").replace("\\ ", " ");
        let longest = rest.len().min(NAME_WORDS_MAX);
        let is_end = |word: &&str| word.len() > 4 && word.to_ascii_lowercase().ends_with(".mtl");
        // Looking is slow: names of several words end in one with a dot.
        let mut likely = (1..=longest).rev().filter(|&count| count == 1 || rest[count - 1].contains('.'));
        let existing = likely.find(|&count| find(&[folder], &name(count)).is_some());
        let count = existing.or_else(|| Some(1 + rest[..longest].iter().position(is_end)?)).unwrap_or(1);
        names.push(name(count));
        rest = &rest[count..];
    }
    names
}

/// A name of a material file has so many words at most.
const NAME_WORDS_MAX: usize = 16;

/// The scene's materials, and which of them each group of the file has.
struct Materials {
    list: Vec<Material>,
    /// How the textures of each lie, by set of texture coordinates.
    layouts: Vec<Vec<Layout>>,
    of_group: Vec<u32>,
}

impl Materials {
    /// One material for each name in use, in order of first use; grey where nothing is known.
    fn resolve(path: &Path, obj: &Obj, library: &Library, mut surfaces: Surfaces) -> Self {
        let mut known: BTreeMap<Option<&str>, u32> = BTreeMap::new();
        let mut materials = Self { list: Vec::new(), layouts: Vec::new(), of_group: Vec::new() };
        for group in &obj.groups {
            let name = group.material.as_deref();
            let index = match known.get(&name) {
                Some(&index) => index,
                None => {
                    let mtl = definition(path, group, library, !obj.colours.is_empty(), surfaces.notes);
                    let (material, layouts) = surfaces.material(&mtl);
                    materials.layouts.push(layouts);
                    materials.list.push(material);
                    (materials.list.len() - 1) as u32
                }
            };
            known.insert(name, index);
            materials.of_group.push(index);
        }
        surfaces.report();
        materials
    }
}

/// What the library says of a group's material; if nothing, an empty definition and a note.
fn definition(path: &Path, group: &Group, library: &Library, coloured: bool, notes: &mut Notes) -> Mtl {
    let name = group.material.as_deref().unwrap_or_default();
    if let Some(mtl) = library.get(name) {
        return mtl.clone();
    }
    let look = if coloured { "white under the colours of its vertices" } else { "grey" };
    let message = match name {
        "" => format!("faces without usemtl: their material is {look}"),
        name => format!("material `{name}` is defined nowhere: it is {look}"),
    };
    notes.line(path, group.line, message);
    let kd = coloured.then_some(Vec3::ONE);
    Mtl { name: name.into(), file: path.into(), line: group.line, kd, ..Mtl::default() }
}

/// Box around every vertex that a face uses.
fn bounds(obj: &Obj) -> Bounds {
    let mut bounds = Bounds::default();
    for triangle in obj.groups.iter().flat_map(|group| &group.triangles) {
        for corner in triangle.corners {
            bounds.add(obj.positions[corner.position as usize]);
        }
    }
    bounds
}

/// Names of objects, each with its groups.
fn objects(obj: &Obj, movable: &BTreeSet<String>, path: &Path, notes: &mut Notes) -> Vec<(String, Vec<usize>)> {
    let groups_of = |object: usize| (0..obj.groups.len()).filter(move |&i| obj.groups[i].object == object);
    if obj.objects.len() <= OBJECTS_APART_MAX {
        return obj.objects.iter().enumerate().map(|(i, name)| (name.clone(), groups_of(i).collect())).collect();
    }
    let (apart, merged): (Vec<usize>, Vec<usize>) =
        (0..obj.objects.len()).partition(|&object| movable.contains(&obj.objects[object]));
    let message = format!(
        "{} objects were merged into one; name those that shall move under \"movable\" in a scene.json",
        merged.len()
    );
    notes.file(path, message);
    let is_merged: BTreeSet<usize> = merged.into_iter().collect();
    let statics = (0..obj.groups.len()).filter(|&i| is_merged.contains(&obj.groups[i].object)).collect();
    let mut objects = vec![("static".to_owned(), statics)];
    objects.extend(apart.into_iter().map(|object| (obj.objects[object].clone(), groups_of(object).collect())));
    objects
}

/// What was left out or repaired on the way into meshes.
#[derive(Default)]
struct Tallies {
    degenerate: Tally,
    not_finite: Tally,
    no_uvs: Tally,
    repaired: Tally,
}

impl Tallies {
    fn append(&mut self, later: Self) {
        self.degenerate.append(later.degenerate);
        self.not_finite.append(later.not_finite);
        self.no_uvs.append(later.no_uvs);
        self.repaired.append(later.repaired);
    }

    fn report(&self, path: &Path, notes: &mut Notes) {
        self.degenerate.report(notes, path, "triangles without area were dropped");
        self.not_finite.report(notes, path, "triangles with a vertex that is no finite number were dropped");
        self.no_uvs.report(notes, path, "triangles of textured materials have no texture coordinates: 0 0 is used");
        self.repaired.report(notes, path, "normals or texture coordinates were no usable numbers: replaced");
    }
}

/// The triangles of some groups, each with its material, and what was left out.
fn mesh(obj: &Obj, groups: &[(&Group, u32)], scene: &Scene, layouts: &[Vec<Layout>]) -> (Mesh, Tallies) {
    let (mut builder, mut tallies) = (MeshBuilder::default(), Tallies::default());
    for &(group, material) in groups {
        let lie = &layouts[material as usize];
        let look = &scene.materials[material as usize];
        // Emissive faces are flat, unless their light is a texture's: lamps are, the lights on a machine are not.
        let flat = !look.emission.is_black() && look.emission.texture.is_none();
        let relief = look.relief.map(|relief| usize::from(scene.textures[relief.texture as usize].look_up.set));
        builder.use_sets(lie.len());
        // Vertices are shared among materials whose textures lie alike.
        let alike = layouts.iter().position(|other| other == lie).unwrap_or_default();
        for triangle in &group.triangles {
            tallies.no_uvs.add_if(!lie.is_empty() && triangle.corners[0].uv == NONE, triangle.line);
            let corners = triangle.corners.map(|corner| {
                let used = Corner {
                    uv: if lie.is_empty() { NONE } else { corner.uv },
                    normal: if flat { NONE } else { corner.normal },
                    ..corner
                };
                ((used, alike), vertex(obj, used, scene.centre, lie))
            });
            let before = builder.repaired;
            match builder.triangle(corners, material, relief) {
                Added::Yes => tallies.repaired.add_if(builder.repaired > before, triangle.line),
                Added::Degenerate => tallies.degenerate.add(triangle.line),
                Added::NotFinite => tallies.not_finite.add(triangle.line),
            }
        }
    }
    (builder.finish(), tallies)
}

fn vertex(obj: &Obj, corner: Corner, centre: DVec3, layouts: &[Layout]) -> Vertex {
    let uv = if corner.uv == NONE { Vec2::ZERO } else { obj.uvs[corner.uv as usize] };
    let mut vertex = Vertex {
        position: (obj.positions[corner.position as usize] - centre).as_vec3(),
        normal: if corner.normal == NONE { Vec3::ZERO } else { obj.normals[corner.normal as usize] },
        ..Vertex::default()
    };
    for (set, layout) in vertex.uvs.iter_mut().zip(layouts) {
        *set = uv * layout.scale + layout.offset;
    }
    if let Some(colour) = obj.colours.get(corner.position as usize) {
        vertex.colour = *colour;
    }
    vertex
}
