//! What pixels see, found by rasterising: for each pixel's middle the object and triangle that lie nearest there, where in
//! the triangle, and how far away. It is how the master knows what is in sight without asking anybody.
//!
//! ```text
//! vertices ─► on the picture plane ─► facets ─► bands of rows ─► nearest facet and 1/z of each pixel
//! ```
//!
//! **Promise.** What a ray through the middle of the pixel meets first, but for pixels whose middle lies within about 1/256
//! of a pixel of an edge, and for surfaces nearer to each other than rounding can tell. Both sides of triangles are seen, as
//! rays see them; triangles of one edge leave no gap between them and share no pixel (top-left rule); of what is equally far,
//! the first of the scene is seen. The same bits on any number of threads.
//!
//! **Coverage.** Where a texture cuts holes, they are seen through. Of surfaces that are there in part, rays meet a share of
//! their own chance; here what is there by half or more is seen, and the rest is not.
//!
//! **Left out.** What lies behind glass and in mirrors; what is finer than pixels is met or missed as by a single ray.
//!
//! Vertices are snapped to 1/256 of a pixel, edges are whole numbers, and depths are planes in `f64`, so that nothing depends
//! on how the picture is cut up. A vertex cannot be put on the picture plane if it lies behind the eye, or so far aside that
//! whole numbers overflow: triangles with such a one are clipped. There is no near plane besides, unless the camera cuts
//! something away.

mod facet;
mod fill;
mod project;

#[cfg(test)]
mod tests;

use rayon::prelude::*;
use scenes::{Camera, Scene, SurfacePoint, Triangles};

use facet::{Facet, Portion, Setup};
use fill::{BAND_ROWS, Band};
use project::{OnPicture, Projection};

/// See the module's documentation. It may be drawn again and again, and keeps its memory.
#[derive(Clone, Debug, Default)]
pub struct Raster {
    width: usize,
    height: usize,
    /// Of the nearest surface of each pixel, along the middle of the view, over 1; 0 where there is none.
    inverse_depths: Vec<f32>,
    /// Which facet each pixel sees; [`NONE`]: none.
    facets_seen: Vec<u32>,
    facets: Vec<Facet>,
    vertices: Vec<OnPicture>,
    /// By band, the facets that reach into it.
    bins: Vec<Vec<u32>>,
}

/// What a pixel sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Index into [`Scene::objects`], of pieces that were lifted out as well.
    pub object: u32,
    /// Index into the triangles of its mesh.
    pub triangle: u32,
    /// Barycentric coordinates, as of a [`SurfacePoint`]: within the triangle.
    pub uv: [f32; 2],
    /// The clockwise side is seen.
    pub back: bool,
    /// Distance along the middle of the view.
    pub depth: f32,
}

/// No facet.
pub const NONE: u32 = u32::MAX;
/// Vertices or triangles that a thread takes at a time.
const CHUNK: usize = 4096;

impl Hit {
    /// Its name, which lasts when pieces are lifted.
    pub fn point(&self, scene: &Scene) -> SurfacePoint {
        let Self { object, triangle, uv, back, .. } = *self;
        SurfacePoint { object: scene.whole_of(object), triangle, uv, back, turned: false }
    }
}

impl Raster {
    /// Nothing in sight.
    pub fn new() -> Self {
        Self::default()
    }

    /// Finds what the pixels of a camera see of a scene.
    pub fn draw(&mut self, scene: &Scene, camera: &Camera) {
        let projection = Projection::of(camera);
        (self.width, self.height) = (camera.width as usize, camera.height as usize);
        let parts = self.project(scene, &projection);
        let setup = Setup { scene, projection: &projection, size: [camera.width as i32, camera.height as i32] };
        let vertices = &self.vertices;
        // In order of object and triangle: whichever of equals is met first is the first of the scene.
        self.facets.clear();
        self.facets.par_extend(parts.into_par_iter().flat_map_iter(|part| {
            let known = part.vertices.map(|first| &vertices[first..]);
            setup.facets(part.object, known, part.triangles)
        }));
        self.bin();
        self.fill(scene);
    }

    /// Puts the vertices of all that is in sight on the picture plane, and says which triangles there are, in portions.
    fn project(&mut self, scene: &Scene, projection: &Projection) -> Vec<Part> {
        let mut parts = Vec::new();
        let mut meshes = Vec::new();
        let mut count = 0;
        for (number, object) in scene.objects.iter().enumerate().filter(|(_, object)| object.visible) {
            let mesh = &*scene.meshes[object.mesh as usize];
            let triangles = scene.triangles(number);
            // Of a mesh that a piece has little of, only that is looked at.
            let first = match triangles {
                Triangles::Piece(_) => None,
                Triangles::All(_) | Triangles::Rest { .. } => Some(count),
            };
            if first.is_some() {
                meshes.push((object, mesh));
                count += mesh.positions.len();
            }
            let part = |triangles| Part { object: number as u32, vertices: first, triangles };
            match triangles {
                Triangles::All(all) => parts.extend(
                    all.clone().step_by(CHUNK).map(|start| part(Portion::Range(start..(start + CHUNK).min(all.end)))),
                ),
                some => {
                    let list: Vec<usize> = some.collect();
                    parts.extend(list.chunks(CHUNK).map(|chunk| part(Portion::List(chunk.to_vec()))));
                }
            }
        }
        self.vertices.clear();
        self.vertices.resize(count, OnPicture::default());
        let mut rest = &mut self.vertices[..];
        let mut jobs = Vec::new();
        for (object, mesh) in meshes {
            let (own, others) = rest.split_at_mut(mesh.positions.len());
            rest = others;
            let chunks = own.chunks_mut(CHUNK).zip(mesh.positions.chunks(CHUNK));
            jobs.extend(chunks.map(|(to, from)| (&object.scene_from_object, from, to)));
        }
        jobs.into_par_iter().for_each(|(place, from, to)| projection.project_all(place, from, to));
        parts
    }

    /// Sorts facets by the bands that they reach into.
    fn bin(&mut self) {
        let bands = self.height.div_ceil(BAND_ROWS);
        self.bins.truncate(bands);
        self.bins.iter_mut().for_each(Vec::clear);
        self.bins.resize(bands, Vec::new());
        for (number, facet) in (0..).zip(&self.facets) {
            let [first, last] = facet.rows.map(|row| row as usize / BAND_ROWS);
            self.bins[first..=last].iter_mut().for_each(|bin| bin.push(number));
        }
    }

    fn fill(&mut self, scene: &Scene) {
        let (width, pixels) = (self.width, self.width * self.height);
        self.inverse_depths.clear();
        self.inverse_depths.resize(pixels, 0.0);
        self.facets_seen.clear();
        self.facets_seen.resize(pixels, NONE);
        let facets = &self.facets;
        let size = (width * BAND_ROWS).max(1);
        let depths = self.inverse_depths.par_chunks_mut(size);
        let bands = depths.zip(self.facets_seen.par_chunks_mut(size)).zip(&self.bins).enumerate();
        bands.for_each(|(number, ((inverse_depths, seen), bin))| {
            let mut band = Band { first_row: number * BAND_ROWS, width, inverse_depths, seen };
            for facet in bin {
                band.fill(scene, *facet, &facets[*facet as usize]);
            }
        });
    }

    /// What a pixel sees, counted row by row; `None`: nothing, or there is no such pixel.
    pub fn hit(&self, pixel: usize) -> Option<Hit> {
        let facet = self.facets.get(*self.facets_seen.get(pixel)? as usize)?;
        let [x, y] = [pixel % self.width, pixel / self.width].map(|at| at as f64 + 0.5);
        let depth = 1.0 / self.inverse_depths[pixel];
        let Facet { object, triangle, back, .. } = *facet;
        Some(Hit { object, triangle, uv: facet.uv(x, y), back, depth })
    }

    /// Which facet each pixel sees, row by row: a number for [`Self::face`], or [`NONE`].
    pub fn facets_seen(&self) -> &[u32] {
        &self.facets_seen
    }

    /// What a facet is part of: index into [`Scene::objects`], triangle, and whether its clockwise side is seen.
    pub fn face(&self, facet: u32) -> (u32, u32, bool) {
        let Facet { object, triangle, back, .. } = self.facets[facet as usize];
        (object, triangle, back)
    }

    /// Pixels in a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// One over the depth of what each pixel sees, row by row; 0 where it sees nothing.
    pub fn inverse_depths(&self) -> &[f32] {
        &self.inverse_depths
    }

    /// Facets that touched the middle of a pixel, hidden or not: the work that there was.
    pub fn facet_count(&self) -> usize {
        self.facets.len()
    }
}

/// Some triangles of an object.
struct Part {
    object: u32,
    /// Where its mesh's vertices begin among those that are on the picture plane; `None`: they are not among them.
    vertices: Option<usize>,
    triangles: Portion,
}
