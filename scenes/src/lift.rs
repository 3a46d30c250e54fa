//! Pieces that were lifted out of the objects they belong to.
//!
//! Which pieces are lifted follows from what was done to them, and from nothing else: a piece that stands where it was
//! modelled, is to be seen and is made of what its whole is made of, is a part of it again. So changes of different pieces may come in any
//! order, and what takes back all changes of a piece gives the scene of before.

use std::ops::Range;

use crate::change::Refused;
use crate::{Lifted, Object, Pieces, Scene, Transform};

impl Scene {
    /// How many objects the file keeps apart: the first ones. Only these have numbers that last; those of lifted pieces
    /// change when others are lifted.
    pub fn wholes(&self) -> usize {
        self.objects.partition_point(|object| object.lifted.is_none())
    }

    /// Index of a piece in [`Scene::objects`], or where it would be.
    ///
    /// # Errors
    /// It is not lifted.
    pub fn find_lifted(&self, of: u32, piece: u32) -> Result<usize, usize> {
        let wholes = self.wholes();
        let key = |object: &Object| object.lifted.as_ref().map(|lifted| (lifted.of, lifted.piece));
        let found = self.objects[wholes..].binary_search_by_key(&Some((of, piece)), key);
        found.map(|place| wholes + place).map_err(|place| wholes + place)
    }

    /// The pieces that were lifted out of an object, ascending.
    pub fn lifted_of(&self, object: u32) -> impl Iterator<Item = u32> + '_ {
        let lifted = self.objects[self.wholes()..].iter().filter_map(|object| object.lifted.as_ref());
        lifted.filter(move |lifted| lifted.of == object).map(|lifted| lifted.piece)
    }

    /// Which triangles of its mesh an object has, ascending: all, but for pieces that were lifted out.
    pub fn triangles(&self, object: usize) -> Triangles<'_> {
        let Object { mesh, lifted, .. } = &self.objects[object];
        let mesh = &self.meshes[*mesh as usize];
        if let Some(lifted) = lifted {
            return Triangles::Piece(mesh.pieces().triangles(lifted.piece).iter());
        }
        let gone: Vec<u32> = self.lifted_of(object as u32).collect();
        let all = 0..mesh.triangles.len();
        if gone.is_empty() { Triangles::All(all) } else { Triangles::Rest { all, pieces: mesh.pieces(), gone } }
    }

    /// How a piece stands.
    pub fn piece(&self, of: u32, piece: u32) -> Lifted {
        let at_rest = Lifted { of, piece, whole_from_piece: Transform::IDENTITY, visible: true };
        let found = self.find_lifted(of, piece).ok().and_then(|place| self.objects[place].lifted.clone());
        found.unwrap_or(at_rest)
    }

    /// Does something to a piece of an object that the file keeps apart; the piece must exist.
    pub(crate) fn with_piece(&mut self, of: u32, piece: u32, change: impl FnOnce(&mut Lifted)) {
        let mut lifted = self.piece(of, piece);
        change(&mut lifted);
        let found = self.find_lifted(of, piece);
        let has_own = found.is_ok_and(|place| !self.objects[place].own.is_empty());
        let is_at_rest = lifted.whole_from_piece.is_identity() && lifted.visible && !has_own;
        match (found, is_at_rest) {
            (Ok(place), true) => drop(self.objects.remove(place)),
            (Ok(place), false) => self.objects[place].lifted = Some(lifted),
            (Err(_), true) => {}
            (Err(place), false) => self.lift(place, lifted),
        }
        self.carry_lifted();
    }

    /// Puts a piece that is not lifted among those that are; `place` is where it belongs.
    pub(crate) fn lift(&mut self, place: usize, lifted: Lifted) {
        let Object { name, mesh, .. } = &self.objects[lifted.of as usize];
        let object = Object { lifted: Some(lifted), ..Object::fixed(name.clone(), *mesh) };
        self.objects.insert(place, object);
    }

    /// Puts all lifted pieces where they are, now that their wholes are elsewhere.
    pub fn carry_lifted(&mut self) {
        let wholes = self.wholes();
        let (wholes, pieces) = self.objects.split_at_mut(wholes);
        for object in pieces {
            let Some(lifted) = &object.lifted else { continue };
            let whole = &wholes[lifted.of as usize];
            object.scene_from_object = whole.scene_from_object.after(&lifted.whole_from_piece);
            object.visible = whole.visible && lifted.visible;
        }
    }

    /// Whether there is such a piece of an object that the file keeps apart.
    pub(crate) fn check_piece(&self, of: u32, piece: u32) -> Result<(), Refused> {
        let wholes = self.wholes();
        if of as usize >= wholes {
            return Err(Refused(format!("there is no object {of}, only {wholes}")));
        }
        let object = &self.objects[of as usize];
        if object.motion.as_ref().is_some_and(|motion| motion.poses.iter().any(|pose| pose.mesh.is_some())) {
            return Err(Refused(format!("object {of} changes shape as it moves: it has no pieces")));
        }
        let count = self.meshes[object.mesh as usize].pieces().count();
        if piece as usize >= count {
            return Err(Refused(format!("there is no piece {piece} of object {of}, only {count}")));
        }
        Ok(())
    }
}

/// The triangles of an object: see [`Scene::triangles`].
#[derive(Clone, Debug)]
pub enum Triangles<'a> {
    /// Nothing was lifted out of it.
    All(Range<usize>),
    /// It is a piece.
    Piece(std::slice::Iter<'a, u32>),
    /// What is left when some pieces (ascending) are gone.
    Rest {
        /// Not looked at yet.
        all: Range<usize>,
        /// Of the mesh.
        pieces: &'a Pieces,
        /// Which are not there.
        gone: Vec<u32>,
    },
}

impl Iterator for Triangles<'_> {
    type Item = usize;

    #[inline]
    fn next(&mut self) -> Option<usize> {
        match self {
            Self::All(all) => all.next(),
            Self::Piece(own) => own.next().map(|triangle| *triangle as usize),
            Self::Rest { all, pieces, gone } => {
                all.find(|triangle| gone.binary_search(&pieces.of_triangle(*triangle)).is_err())
            }
        }
    }
}
