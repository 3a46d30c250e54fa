//! Wavefront OBJ text, read by many threads at once: cut where lines end ([`stretch`]), read statement by statement
//! ([`statements`]), and put together in the order of the file ([`assemble`]). What is read does not depend on the cuts.
//!
//! The general parsers (tobj among them) lose what is needed here: faces with and without normals
//! within one group come out misaligned or with a neighbour's normal, `g` overwrites the name that
//! `o` gave, broken lines have no number, and some inputs panic. Reading the nine statements that
//! matter takes fewer lines than working around that.
//!
//! Understood: `v` (with `w` or colours behind it, or ZBrush's `#MRGB`), `vt`, `vn`, `f` with any number of corners and
//! negative indices, `s`, `o`, `g`, `usemtl`, `mtllib`, `\` at the end of a line, comments behind numbers, any encoding.
//! Skipped: points, lines.
//! Counted and skipped: curves and surfaces, faces of vertices that do not exist.
//! Counted and replaced: numbers that are missing or none, texture coordinates and normals that do not exist.

mod assemble;
mod statements;
mod stretch;

use std::path::Path;

use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

use self::statements::Statements;
use super::error::Notes;
use super::{ReadError, text};

/// What an OBJ file says, in file space.
#[derive(Debug, Default)]
pub(super) struct Obj {
    pub positions: Vec<DVec3>,
    pub normals: Vec<Vec3>,
    pub uvs: Vec<Vec2>,
    /// Linear, as [`crate::Mesh::colours`]: one a position, or none.
    pub colours: Vec<[u16; 4]>,
    /// In order of first appearance.
    pub groups: Vec<Group>,
    /// `mtllib` file names as written, each with its line.
    pub libraries: Vec<(String, u32)>,
    /// `o` (or, in a file without `o`, `g`) names in order of first appearance.
    pub objects: Vec<String>,
}

/// All triangles of one object that are of one material.
#[derive(Debug)]
pub(super) struct Group {
    /// Index into [`Obj::objects`].
    pub object: usize,
    /// Name given by `usemtl`, if any, and the line where it is first used.
    pub material: Option<String>,
    /// First line of the group's faces.
    pub line: u32,
    /// Indices are in range.
    pub triangles: Vec<Triangle>,
}

/// Three corners; all of them have normals or none, and likewise texture coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    pub corners: [Corner; 3],
    /// Where the face stands in the file.
    pub line: u32,
}

/// Zero-based indices into the arrays of [`Obj`]; [`NONE`] for an attribute that is not given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Corner {
    pub position: u32,
    pub uv: u32,
    pub normal: u32,
}

/// No such attribute.
pub(super) const NONE: u32 = u32::MAX;

/// Parses what the file `path` holds, and lets go of it as soon as its text is not needed any more.
pub(super) fn parse(path: &Path, bytes: Vec<u8>, notes: &mut Notes) -> Result<Obj, ReadError> {
    let statements = read(&text::decode(&bytes), stretch::BYTES);
    drop(bytes);
    assemble::assemble(path, statements, notes)
}

/// The statements of stretches of about so many bytes, in order.
fn read(text: &str, bytes: usize) -> Vec<Statements> {
    let (stretches, all) = stretch::cut(text, bytes);
    // In files that never say `o`, `g` names the objects.
    let object_word = if all.objects > 0 { "o" } else { "g" };
    stretches.par_iter().map(|stretch| Statements::read(stretch, object_word)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Everything that reaches across lines: indices that count back and point ahead, states that last, names that come
    /// again, lines that go on, colours, tallies.
    const TEXT: &str = "mtllib a.mtl\n#MRGB ff102030ff405060\nv 0 0 0 1 0 0\nv 1 0 0\nv 1 1 0 0 1 0\nvn 0 0 1\nvt 0 0\n\
        o one\nusemtl red\ns 1\nf 1 2 3\nf -3/-1/-1 -2/-1/-1 \\\n -1/-1/-1\nv 0 1 0\nf -4 -2 -1\nusemtl blue\n\
        f 1 3 9\nf 1 2\nv nan 0 0\nf 1 2 5 3\no two\nf 1 2 99\ns off\nf 4 3 2 1\nusemtl red\no one\n# v 1 2 3\n\
        f 1//7 2//1 3//1\nvt 1 nan\nv 2\ncurv 1\nf 1/2 2/2 3\nv 9 9 9\nf 0 1 2\nv 5 5 5\nf -1 -2 -3\n";

    fn parsed(bytes: usize) -> (String, String) {
        let mut notes = Notes::default();
        let obj = assemble::assemble(Path::new("a.obj"), read(TEXT, bytes), &mut notes).unwrap();
        (format!("{obj:?}"), format!("{notes:?}"))
    }

    #[test]
    fn what_is_read_does_not_depend_on_where_the_text_is_cut() {
        let whole = parsed(usize::MAX);
        assert!(whole.0.contains("two") && whole.1.contains("3 faces have corners at no vertex"), "{whole:?}");
        for bytes in [1, 7, 20, 64, 200] {
            assert_eq!(parsed(bytes), whole, "{bytes}");
        }
    }
}
