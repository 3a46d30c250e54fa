//! The stretches of an OBJ file put together: whose faces they are, and the triangles that these are cut into.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use glam::DVec3;
use rayon::prelude::*;

use super::super::error::Notes;
use super::super::limits::TRIANGLES_MAX;
use super::super::smoothing::Smoothing;
use super::super::vertex_colours::VertexColours;
use super::super::{ReadError, polygon};
use super::statements::{Faces, Statements, Tallies, To, Turn};
use super::{Corner, Group, NONE, Obj, Triangle};

/// Faces in a row that have all in common.
struct Run {
    faces: Range<usize>,
    /// Index into [`Obj::groups`].
    group: usize,
    /// Smoothing group; 0 is none.
    smoothing: u32,
}

/// The faces of a stretch, in runs.
type Part = (Faces, Vec<Run>);

/// What the stretches of the file `path` say together.
pub(super) fn assemble(path: &Path, stretches: Vec<Statements>, notes: &mut Notes) -> Result<Obj, ReadError> {
    let mut obj = Obj::default();
    let mut state = State::default();
    let (mut colours, mut tallies) = (VertexColours::default(), Tallies::default());
    let mut parts: Vec<Part> = Vec::with_capacity(stretches.len());
    for mut stretch in stretches {
        obj.positions.append(&mut stretch.positions);
        obj.normals.append(&mut stretch.normals);
        obj.uvs.append(&mut stretch.uvs);
        obj.libraries.append(&mut stretch.libraries);
        colours.append(stretch.colours);
        tallies.append(stretch.tallies);
        let runs = state.runs(&stretch.faces, stretch.turns, &mut obj);
        parts.push((stretch.faces, runs));
    }
    refuse_too_many(path, &parts)?;
    smooth(&mut obj, &mut parts);
    // A few at a time, so that faces and triangles are not all there at once.
    let mut parts = parts.into_iter().peekable();
    while parts.peek().is_some() {
        let some: Vec<Part> = parts.by_ref().take(4 * rayon::current_num_threads()).collect();
        let cut: Vec<_> = some.into_par_iter().map(|part| triangles(&obj, &part)).collect();
        for (runs, left_out) in cut {
            for (group, mut triangles) in runs {
                obj.groups[group].triangles.append(&mut triangles);
            }
            tallies.append(left_out);
        }
    }
    tallies.report(path, notes);
    obj.colours = colours.finish(obj.positions.len());
    Ok(obj)
}

/// What the statements so far have set.
#[derive(Default)]
struct State {
    smoothing: u32,
    object: Option<String>,
    material: Option<String>,
    /// Where the current object and material keep their triangles, once there is one.
    group: Option<usize>,
    known_groups: BTreeMap<(usize, Option<String>), usize>,
    known_objects: BTreeMap<String, usize>,
}

impl State {
    fn runs(&mut self, faces: &Faces, turns: Vec<Turn>, obj: &mut Obj) -> Vec<Run> {
        let mut runs = Vec::new();
        let mut first = 0;
        for Turn { face, to } in turns {
            self.run(first..face, faces, obj, &mut runs);
            first = face;
            match to {
                To::Smoothing(smoothing) => self.smoothing = smoothing,
                To::Object(object) => (self.object, self.group) = (object, None),
                To::Material(material) => (self.material, self.group) = (material, None),
            }
        }
        self.run(first..faces.list.len(), faces, obj, &mut runs);
        runs
    }

    fn run(&mut self, range: Range<usize>, faces: &Faces, obj: &mut Obj, runs: &mut Vec<Run>) {
        if !range.is_empty() {
            let group = self.group(faces.list[range.start].0, obj);
            runs.push(Run { faces: range, group, smoothing: self.smoothing });
        }
    }

    /// Where the current object and material keep their triangles.
    fn group(&mut self, line: u32, obj: &mut Obj) -> usize {
        if let Some(group) = self.group {
            return group;
        }
        let name = self.object.clone().unwrap_or_else(|| "default".into());
        let object = *self.known_objects.entry(name.clone()).or_insert_with(|| {
            obj.objects.push(name);
            obj.objects.len() - 1
        });
        let material = self.material.clone();
        let group = *self.known_groups.entry((object, material.clone())).or_insert_with(|| {
            obj.groups.push(Group { object, material, line, triangles: Vec::new() });
            obj.groups.len() - 1
        });
        self.group = Some(group);
        group
    }
}

/// A face with n corners is n − 2 triangles.
fn refuse_too_many(path: &Path, parts: &[Part]) -> Result<(), ReadError> {
    let mut total = 0;
    for (faces, _) in parts {
        total += faces.corners.len() - 2 * faces.list.len();
        if total > TRIANGLES_MAX {
            let line = faces.list.last().map_or(0, |(line, _)| *line);
            return Err(ReadError::line(path, line, format!("more than {TRIANGLES_MAX} triangles")));
        }
    }
    Ok(())
}

/// Gives the corners of smoothing groups' faces normals, where the file gives none.
fn smooth(obj: &mut Obj, parts: &mut [Part]) {
    let lacking = |(faces, runs): &Part| -> Vec<(Range<usize>, u32)> {
        let smoothed = runs.iter().filter(|run| run.smoothing > 0);
        let ranges = smoothed.flat_map(|run| run.faces.clone().map(|face| (faces.range(face), run.smoothing)));
        ranges.filter(|(range, _)| faces.corners[range.start].normal == NONE).collect()
    };
    let lacking: Vec<_> = parts.iter().map(lacking).collect();
    let mut smoothing = Smoothing::default();
    for ((faces, _), lacking) in parts.iter().zip(&lacking) {
        for (range, group) in lacking {
            let corners = &faces.corners[range.clone()];
            let there = |corner: &Corner| obj.positions.get(corner.position as usize).copied();
            if let Some(points) = corners.iter().map(there).collect::<Option<Vec<DVec3>>>() {
                smoothing.add(*group, corners.iter().map(|corner| corner.position), &points);
            }
        }
    }
    for ((faces, _), lacking) in parts.iter_mut().zip(lacking) {
        for (range, group) in lacking {
            for corner in &mut faces.corners[range] {
                if let Some(normal) = smoothing.normal(group, corner.position, &mut obj.normals) {
                    corner.normal = normal;
                }
            }
        }
    }
}

/// Checks indices, which may point ahead, and cuts faces into triangles, by group; and what was left out.
fn triangles(obj: &Obj, (faces, runs): &Part) -> (Vec<(usize, Vec<Triangle>)>, Tallies) {
    let (mut corners, mut points, mut cuts) = (Vec::new(), Vec::new(), Vec::new());
    let mut tallies = Tallies::default();
    let mut of_run = |run: &Run| {
        let mut triangles = Vec::with_capacity(run.faces.len());
        for face in run.faces.clone() {
            let line = faces.list[face].0;
            corners.clear();
            corners.extend_from_slice(&faces.corners[faces.range(face)]);
            if let Some(corner) = corners.iter().find(|c| c.position as usize >= obj.positions.len()) {
                tallies.no_vertex.add_word(line, u64::from(corner.position) + 1);
                continue;
            }
            tallies.no_attribute.add_if(drop_beyond(&mut corners, obj), line);
            points.clear();
            points.extend(corners.iter().map(|corner| obj.positions[corner.position as usize]));
            cuts.clear();
            if polygon::triangulate(&points, &mut cuts).is_err() {
                tallies.too_large.add(line);
                continue;
            }
            triangles.extend(cuts.iter().map(|cut| Triangle { corners: cut.map(|i| corners[i]), line }));
        }
        (run.group, triangles)
    };
    let by_group = runs.iter().map(&mut of_run).collect();
    (by_group, tallies)
}

/// Takes an attribute from all corners if one of them names what does not exist. True if that was necessary.
fn drop_beyond(corners: &mut [Corner], obj: &Obj) -> bool {
    let beyond = |index: u32, count: usize| index != NONE && index as usize >= count;
    let no_uvs = corners.iter().any(|corner| beyond(corner.uv, obj.uvs.len()));
    let no_normals = corners.iter().any(|corner| beyond(corner.normal, obj.normals.len()));
    for corner in corners {
        corner.uv = if no_uvs { NONE } else { corner.uv };
        corner.normal = if no_normals { NONE } else { corner.normal };
    }
    no_uvs || no_normals
}

impl Tallies {
    fn append(&mut self, later: Self) {
        self.too_few_corners.append(later.too_few_corners);
        self.too_large.append(later.too_large);
        self.no_vertex.append(later.no_vertex);
        self.no_attribute.append(later.no_attribute);
        self.half_given.append(later.half_given);
        self.curves.append(later.curves);
        self.lines.append(later.lines);
        self.maps.append(later.maps);
        self.missing.append(later.missing);
        self.positions.append(later.positions);
        self.normals.append(later.normals);
        self.uvs.append(later.uvs);
    }

    fn report(&self, path: &Path, notes: &mut Notes) {
        for (tally, message) in [
            (&self.missing, "vertices, normals or texture coordinates lack numbers: 0 is used"),
            (&self.positions, "vertices are no finite numbers; faces that use them were dropped"),
            (&self.normals, "normals were no usable numbers: faces that use them are flat"),
            (&self.uvs, "texture coordinates are no finite numbers: 0 is used"),
            (&self.too_few_corners, "faces with fewer than three corners were skipped"),
            (&self.no_vertex, "faces have corners at no vertex of the file: skipped"),
            (&self.no_attribute, "faces name normals or texture coordinates that do not exist: they have none"),
            (&self.half_given, "faces give normals or texture coordinates at some corners only: flat"),
            (&self.too_large, "faces that are not convex have too many corners to cut: skipped; split them"),
            (&self.curves, "free-form curves or surfaces were skipped; only faces are drawn"),
            (&self.lines, "points and lines are not drawn; only faces are"),
            (&self.maps, "textures given by usemap are not drawn; name them in the material, as map_Kd"),
        ] {
            tally.report(notes, path, message);
        }
    }
}
