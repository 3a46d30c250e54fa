//! What a mesh has at a place of one of its triangles: texture coordinates, colours, and what textures say there.

use crate::{Coverage, Mesh, Rgb, Scene, texture};
use glam::{Vec2, Vec4};

/// A place on a triangle of a mesh.
#[derive(Clone, Copy, Debug)]
pub struct Place<'a> {
    /// The mesh.
    pub mesh: &'a Mesh,
    /// Index into its triangles.
    pub triangle: usize,
    /// Of the three corners; their sum is 1.
    pub weights: [f32; 3],
}

impl Place<'_> {
    /// Texture coordinates of a set.
    pub fn uv(&self, set: u8) -> Vec2 {
        let [a, b, c] = self.mesh.corner_uvs(self.triangle, set);
        a * self.weights[0] + b * self.weights[1] + c * self.weights[2]
    }

    /// Colour of the vertices and its alpha; `None` if they have none.
    pub fn vertex_colour(&self) -> Option<Vec4> {
        if self.mesh.colours.is_empty() {
            return None;
        }
        let [a, b, c] = self.mesh.corner_colours(self.triangle);
        Some(a * self.weights[0] + b * self.weights[1] + c * self.weights[2])
    }

    /// Colour of a texture; white without one.
    pub fn colour(&self, scene: &Scene, texture: Option<u32>) -> Rgb {
        texture.map_or(Rgb::ONE, |index| {
            let texture = &scene.textures[index as usize];
            texture::colour(texture, self.uv(texture.look_up.set))
        })
    }

    /// A channel of a texture; 1 without one.
    pub fn channel(&self, scene: &Scene, texture: Option<(u32, u8)>) -> f32 {
        texture.map_or(1.0, |(index, channel)| {
            let texture = &scene.textures[index as usize];
            texture::channel(texture, self.uv(texture.look_up.set), channel)
        })
    }

    /// How much of the surface is there, 0..1.
    pub fn present(&self, scene: &Scene, coverage: &Coverage) -> f32 {
        let alpha = self.vertex_colour().map_or(1.0, |colour| colour.w);
        coverage.of(self.channel(scene, coverage.amount.texture) * alpha)
    }
}
