//! The Shading Cache proper: a quad-tree of patches on each side of each triangle, made when it is first seen, with light at
//! its vertices.
//!
//! ```text
//!        2                 A patch is divided at the middles of its edges. Patch 3, in the middle, is upside down:
//!       / \                its corners are the middles of the edges opposite to the corners of the whole.
//!      / 2 \
//!    20-----12             A vertex belongs to all patches that meet there: those of one triangle, and those of
//!    / \ 3 / \             neighbours that go on smoothly, being flat together or of one interpolated normal.
//!   / 0 \ / 1 \
//!  0----01-----1
//! ```
//!
//! Corners of triangles often lie within other things, and are black: the strips of a blind end in its rail. Triangles of which
//! little is seen are lit at a *spot* that was seen, one vertex for all of it.
//!
//! Vertices on the border of a triangle are lit a little inside of it ([`INSET`]): in the very corner of a room, light would
//! come from both sides of its walls, or from none.

use std::collections::{BTreeMap, HashMap};

use foldhash::fast::FixedState;
use glam::Vec3;
use scenes::{Mesh, Scene, SurfacePoint};

/// No patch, or no vertex.
pub(super) const NONE: u32 = u32::MAX;
/// Of a vertex that was never asked about.
pub(super) const NEVER: u32 = u32::MAX;
/// How far inside of its triangle a vertex on the border is lit, as a share of the way to the middle.
const INSET: f32 = 1.0 / 1024.0;
/// Divisions at most: by then a triangle of a metre has patches of a quarter of a millimetre.
pub(super) const LEVELS_MAX: u8 = 12;
/// Barycentric coordinates are whole numbers of this part of one.
const STEPS: u16 = 1 << LEVELS_MAX;

/// A triangle of a quad-tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch {
    pub vertices: [u32; 3],
    /// What it is a quarter of; [`NONE`]: a triangle.
    parent: u32,
    pub root: u32,
    /// The last tick that it was seen in, as a leaf, and its place among what was seen then.
    pub seen: u32,
    pub slot: u32,
    /// Barycentric coordinates of its first corner, in [`STEPS`].
    origin: [u16; 2],
    pub level: u8,
    /// Its second and third corner lie before the first, not after it.
    is_upside_down: bool,
}

/// Light at a place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vertex {
    /// Where it lies: barycentric coordinates in a triangle, in [`STEPS`].
    root: u32,
    uv: [u16; 2],
    /// Of matt surfaces irradiance, of others radiance towards where the eye was, as it is shown; a guess as long as there
    /// are no samples.
    pub light: Vec3,
    /// The same by its own samples.
    pub mean: Vec3,
    /// How far these are apart: sum over light sets of squared differences from the mean, of the sum of channels.
    pub spread: f32,
    /// That is known, or guessed.
    pub has_light: bool,
    /// By the first light sets alone; no number: nobody has told.
    pub first: Vec3,
    /// Light sets in the mean.
    pub samples: u8,
    /// Somebody was asked about it and has not answered yet.
    pub is_asked: bool,
    /// The state of the world that it was last asked about; [`NEVER`].
    pub revision: u32,
    /// When that was.
    pub tick: u32,
    /// Tells it from others that had its number before.
    pub serial: u32,
    /// Its place among what the last tick looked at, if it is there.
    pub slot: u32,
    /// Patches that have it as a corner.
    users: u32,
    /// Where it was made: between two others, or nowhere.
    between: [u32; 2],
}

/// One side of a triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Root {
    /// What the file keeps apart.
    pub object: u32,
    pub triangle: u32,
    pub back: bool,
    /// What it is made of: index into [`Scene::materials`].
    pub material: u32,
    pub patch: u32,
    /// A vertex where it was seen; [`NONE`] as long as there is none.
    pub spot: u32,
}

/// Vertices of a mesh that are one: what lies on both sides of an edge goes on smoothly.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Corner {
    object: u32,
    vertex: u32,
    material: u32,
    back: bool,
    /// Of flat triangles, their normal in 1/127; 0 where normals are interpolated.
    normal: [i8; 3],
}

/// A place in a leaf.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Leaf {
    pub patch: u32,
    /// Of the leaf's second and third corner.
    pub weights: [f32; 2],
}

impl Leaf {
    pub const NONE: Self = Self { patch: NONE, weights: [0.0; 2] };
}

/// Which quarter of a patch a place lies in, and where in it.
#[inline]
pub(super) fn quarter([u, v]: [f32; 2]) -> (u32, [f32; 2]) {
    let rest = 1.0 - u - v;
    if rest > 0.5 {
        (0, [2.0 * u, 2.0 * v])
    } else if u > 0.5 {
        (1, [2.0 * u - 1.0, 2.0 * v])
    } else if v > 0.5 {
        (2, [2.0 * u, 2.0 * v - 1.0])
    } else {
        (3, [1.0 - 2.0 * u, 1.0 - 2.0 * v])
    }
}

/// See the module's documentation.
#[derive(Clone, Debug, Default)]
pub(super) struct PatchMesh {
    pub patches: Vec<Patch>,
    /// Of each patch, the first of four; [`NONE`]: it is a leaf. They are apart because they are walked through pixel by pixel.
    children: Vec<u32>,
    pub vertices: Vec<Vertex>,
    pub roots: Vec<Root>,
    /// By object, then by triangle and side: its root and one, or 0.
    by_triangle: BTreeMap<u32, Vec<u32>>,
    corners: BTreeMap<Corner, u32>,
    /// By the ends of the edge; nobody goes through them in any order.
    middles: HashMap<[u32; 2], u32, FixedState>,
    /// First of four that are free; vertices that are.
    free_patches: Vec<u32>,
    free_vertices: Vec<u32>,
    next_serial: u32,
}

impl PatchMesh {
    /// Patches that there are.
    pub fn patch_count(&self) -> usize {
        self.patches.len() - 4 * self.free_patches.len()
    }

    /// Bytes that all of it takes: patches, vertices, and what finds them.
    pub fn bytes(&self) -> usize {
        let patches = self.patches.len() * (size_of::<Patch>() + size_of::<u32>());
        let vertices = self.vertices.len() * size_of::<Vertex>();
        // A byte for each place tells whether it is taken, and at most seven of eight are.
        let middles = self.middles.capacity() * 8 / 7 * (size_of::<([u32; 2], u32)>() + 1);
        // As many places of a node are free as taken at worst.
        let corners = 2 * self.corners.len() * size_of::<(Corner, u32)>();
        let roots = self.roots.len() * size_of::<Root>();
        let triangles: usize = self.by_triangle.values().map(|of| of.len() * size_of::<u32>()).sum();
        let free = (self.free_patches.len() + self.free_vertices.len()) * size_of::<u32>();
        patches + vertices + middles + corners + roots + triangles + free
    }

    /// Where a vertex is lit.
    pub fn at(&self, vertex: u32) -> SurfacePoint {
        let Vertex { root, uv, .. } = self.vertices[vertex as usize];
        let Root { object, triangle, back, .. } = self.roots[root as usize];
        let uv = inset(uv.map(|along| f32::from(along) / f32::from(STEPS)));
        SurfacePoint { object, triangle, uv, back, turned: false }
    }

    /// What a vertex lies on.
    #[inline]
    pub fn material_of(&self, vertex: &Vertex) -> u32 {
        self.roots[vertex.root as usize].material
    }

    /// The first of a patch's four quarters; [`NONE`]: it is a leaf.
    #[inline]
    pub fn children(&self, patch: u32) -> u32 {
        self.children[patch as usize]
    }

    /// The root on one side of a triangle, as far as there is one.
    pub fn root(&self, [object, triangle]: [u32; 2], back: bool) -> Option<u32> {
        let roots = self.by_triangle.get(&object)?;
        roots.get(2 * triangle as usize + usize::from(back))?.checked_sub(1)
    }

    /// The same; it is made if there is none.
    pub fn make_root(&mut self, scene: &Scene, [object, triangle]: [u32; 2], back: bool, tick: u32) -> u32 {
        if let Some(root) = self.root([object, triangle], back) {
            return root;
        }
        let mesh = &*scene.meshes[scene.objects[object as usize].mesh as usize];
        let material = mesh.materials[triangle as usize];
        let normal = flat_normal(mesh, triangle as usize);
        let (root, patch) = (self.roots.len() as u32, self.patches.len() as u32);
        let vertices = [0, 1, 2].map(|corner| {
            let vertex = mesh.triangles[triangle as usize][corner];
            let key = Corner { object, vertex, material, back, normal };
            if let Some(vertex) = self.corners.get(&key) {
                return *vertex;
            }
            let uv = [[0, 0], [STEPS, 0], [0, STEPS]][corner];
            let vertex = self.add_vertex(root, uv);
            self.corners.insert(key, vertex);
            vertex
        });
        let material = scene.material_of(scene.holder(object, triangle), triangle as usize);
        self.roots.push(Root { object, triangle, back, material, patch, spot: NONE });
        let (origin, is_upside_down) = ([0; 2], false);
        let whole = Patch { vertices, parent: NONE, root, seen: tick, slot: NONE, origin, level: 0, is_upside_down };
        self.patches.push(whole);
        self.children.push(NONE);
        vertices.iter().for_each(|vertex| self.vertices[*vertex as usize].users += 1);
        let roots = self.by_triangle.entry(object).or_default();
        let slot = 2 * triangle as usize + usize::from(back);
        if roots.len() <= slot {
            roots.resize(2 * mesh.triangles.len().max(triangle as usize + 1), 0);
        }
        roots[slot] = root + 1;
        root
    }

    /// Objects have got or lost materials of their own.
    pub fn made_anew(&mut self, scene: &Scene) {
        for Root { object, triangle, material, .. } in &mut self.roots {
            *material = scene.material_of(scene.holder(*object, *triangle), *triangle as usize);
        }
    }

    /// Makes the vertex at which a root of which little is seen is lit: where it was seen for the first time, by its
    /// barycentric coordinates.
    pub fn make_spot(&mut self, root: u32, [u, v]: [f32; 2]) {
        debug_assert_eq!(self.roots[root as usize].spot, NONE);
        // Casts saturate.
        let [u, v] = [u, v].map(|along| ((along * f32::from(STEPS)) as u16).min(STEPS));
        let spot = self.add_vertex(root, [u, v.min(STEPS - u)]);
        self.vertices[spot as usize].users = 1;
        self.roots[root as usize].spot = spot;
    }

    /// The leaf at a place of a root.
    #[inline]
    pub fn find(&self, root: u32, mut weights: [f32; 2]) -> Leaf {
        let mut patch = self.roots[root as usize].patch;
        loop {
            let children = self.children[patch as usize];
            if children == NONE {
                return Leaf { patch, weights };
            }
            let child;
            (child, weights) = quarter(weights);
            patch = children + child;
        }
    }

    /// The vertex in the middle of an edge, if what lies on either side is divided there.
    #[inline]
    pub fn middle_of(&self, a: u32, b: u32) -> Option<u32> {
        self.middles.get(&[a.min(b), a.max(b)]).copied()
    }

    /// Divides a leaf; false if it is as small as they get, or no leaf.
    pub fn split(&mut self, patch: u32, tick: u32) -> bool {
        let whole = self.patches[patch as usize];
        if self.children[patch as usize] != NONE || whole.level >= LEVELS_MAX {
            return false;
        }
        let [a, b, c] = whole.vertices;
        let Patch { origin: [u, v], level, root, is_upside_down, .. } = whole;
        let size = STEPS >> (level + 1);
        let half = |along: u16| if is_upside_down { along - size } else { along + size };
        let ab = self.middle([a, b], root, [half(u), v]);
        let bc = self.middle([b, c], root, [half(u), half(v)]);
        let ca = self.middle([c, a], root, [u, half(v)]);
        let child = |vertices, origin, is_upside_down| {
            let level = level + 1;
            Patch { vertices, parent: patch, root, seen: tick, slot: NONE, origin, level, is_upside_down }
        };
        let four = [
            child([a, ab, ca], [u, v], is_upside_down),
            child([ab, b, bc], [half(u), v], is_upside_down),
            child([ca, bc, c], [u, half(v)], is_upside_down),
            child([bc, ca, ab], [half(u), half(v)], !is_upside_down),
        ];
        for vertex in four.iter().flat_map(|child| child.vertices) {
            self.vertices[vertex as usize].users += 1;
        }
        let first = match self.free_patches.pop() {
            Some(first) => {
                self.patches[first as usize..first as usize + 4].copy_from_slice(&four);
                first
            }
            None => {
                self.patches.extend(four);
                self.children.extend([NONE; 4]);
                self.patches.len() as u32 - 4
            }
        };
        self.children[patch as usize] = first;
        true
    }

    /// Takes a patch's children away, and theirs.
    pub fn merge(&mut self, patch: u32) {
        let first = std::mem::replace(&mut self.children[patch as usize], NONE);
        if first == NONE {
            return;
        }
        for child in first..first + 4 {
            self.merge(child);
            for vertex in self.patches[child as usize].vertices {
                self.leave(vertex);
            }
        }
        self.free_patches.push(first);
    }

    /// The middles of the edges of what a patch is a quarter of, each with the ends of its edge; `None`: it is no quarter.
    pub fn middles_above(&self, patch: u32) -> Option<[[u32; 3]; 3]> {
        let parent = self.patches[patch as usize].parent;
        let [a, b, c] = self.patches.get(parent as usize)?.vertices;
        let [bc, ca, ab] = self.patches[self.children(parent) as usize + 3].vertices;
        Some([[ab, a, b], [bc, b, c], [ca, c, a]])
    }

    /// Takes `levels` levels of leaves away below a patch; returns how many levels are left.
    pub fn lower(&mut self, patch: u32, levels: u32) -> u32 {
        let first = self.children(patch);
        if first == NONE {
            return 0;
        }
        // Counted before anything goes.
        let height = 1 + (first..first + 4).map(|child| self.height(child)).max().unwrap_or(0);
        if height <= levels {
            self.merge(patch);
            return 0;
        }
        1 + (first..first + 4).map(|child| self.lower(child, levels)).max().unwrap_or(0)
    }

    fn height(&self, patch: u32) -> u32 {
        match self.children(patch) {
            NONE => 0,
            first => 1 + (first..first + 4).map(|child| self.height(child)).max().unwrap_or(0),
        }
    }

    /// Takes the children away of which none was seen since a tick, below a patch; returns when something of it was seen last.
    pub fn trim(&mut self, patch: u32, since: u32) -> u32 {
        let (first, seen) = (self.children(patch), self.patches[patch as usize].seen);
        if first == NONE {
            return seen;
        }
        let last = (first..first + 4).map(|child| self.trim(child, since)).max().unwrap_or(seen);
        if last < since {
            self.merge(patch);
            self.patches[patch as usize].seen = last;
        }
        last
    }

    /// Numbers of the patches below a patch, it included, those below before those above.
    #[cfg(test)]
    pub fn below(&self, patch: u32, visit: &mut impl FnMut(u32)) {
        let first = self.children(patch);
        if first != NONE {
            (first..first + 4).for_each(|child| self.below(child, visit));
        }
        visit(patch);
    }

    fn middle(&mut self, [a, b]: [u32; 2], root: u32, uv: [u16; 2]) -> u32 {
        let key = [a.min(b), a.max(b)];
        if let Some(vertex) = self.middles.get(&key) {
            return *vertex;
        }
        let vertex = self.add_vertex(root, uv);
        self.middles.insert(key, vertex);
        let [a, b] = [a, b].map(|end| self.vertices[end as usize]);
        let new = &mut self.vertices[vertex as usize];
        (new.between, new.light, new.has_light) = (key, (a.light + b.light) * 0.5, a.has_light && b.has_light);
        vertex
    }

    fn add_vertex(&mut self, root: u32, uv: [u16; 2]) -> u32 {
        let serial = self.next_serial;
        self.next_serial = serial.wrapping_add(1);
        let vertex = Vertex {
            root,
            uv,
            light: Vec3::ZERO,
            mean: Vec3::ZERO,
            spread: 0.0,
            has_light: false,
            first: Vec3::NAN,
            samples: 0,
            is_asked: false,
            revision: NEVER,
            tick: 0,
            serial,
            slot: NONE,
            users: 0,
            between: [NONE; 2],
        };
        match self.free_vertices.pop() {
            Some(number) => {
                self.vertices[number as usize] = vertex;
                number
            }
            None => {
                self.vertices.push(vertex);
                self.vertices.len() as u32 - 1
            }
        }
    }

    /// A patch needs a vertex no more.
    fn leave(&mut self, number: u32) {
        let vertex = &mut self.vertices[number as usize];
        vertex.users -= 1;
        if vertex.users == 0 {
            vertex.serial = NEVER;
            let between = vertex.between;
            self.middles.remove(&between);
            self.free_vertices.push(number);
        }
    }

    /// Every patch has its vertices, every vertex as many users as it counts, and nothing is both there and free.
    #[cfg(test)]
    pub fn check(&self) {
        let mut users = vec![0; self.vertices.len()];
        let (mut count, mut spots) = (0, 0);
        for root in &self.roots {
            if root.spot != NONE {
                (users[root.spot as usize], spots) = (1, spots + 1);
            }
            self.below(root.patch, &mut |patch| {
                count += 1;
                self.patches[patch as usize].vertices.iter().for_each(|vertex| users[*vertex as usize] += 1);
            });
        }
        assert_eq!(count, self.patch_count());
        for (number, vertex) in self.vertices.iter().enumerate() {
            assert_eq!(users[number], vertex.users, "vertex {number}");
            assert_eq!(vertex.users == 0, self.free_vertices.contains(&(number as u32)), "vertex {number}");
        }
        assert_eq!(self.middles.len() + self.corners.len() + spots, self.vertices.len() - self.free_vertices.len());
    }
}

/// Barycentric coordinates of where a vertex is lit.
fn inset([u, v]: [f32; 2]) -> [f32; 2] {
    if u > 0.0 && v > 0.0 && u + v < 1.0 {
        return [u, v];
    }
    [u, v].map(|along| along * (1.0 - INSET) + INSET / 3.0)
}

/// The normal of a triangle whose vertices are not shared with others that are not flat with it; 0 where it is shaded as
/// part of a smooth surface.
fn flat_normal(mesh: &Mesh, triangle: usize) -> [i8; 3] {
    let corners = mesh.triangles[triangle].map(|vertex| vertex as usize);
    let is_smooth = corners.iter().all(|vertex| mesh.normals.get(*vertex).is_some_and(|normal| *normal != Vec3::ZERO));
    if is_smooth {
        return [0; 3];
    }
    let [a, b, c] = corners.map(|vertex| mesh.positions[vertex]);
    let size = (b - a).abs().max_element().max((c - a).abs().max_element());
    let normal = ((b - a) / size).cross((c - a) / size).normalize_or_zero();
    normal.to_array().map(|along| (along * 127.0).round() as i8)
}
