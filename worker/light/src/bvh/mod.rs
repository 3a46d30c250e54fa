//! Rays against the scene: what is hit first, what stands between two points, and which points of a
//! tile a virtual light can see.
//!
//! Two levels: each mesh becomes a solid, an 8-wide tree over blocks of eight triangles
//! in object space; the world places instances of solids. A moved object costs the (small) upper
//! level only; a world of a single unmoved object has no upper level at all.
//!
//! # What is promised
//! * **One answer.** [`World::closest`], [`World::closest_from`], [`World::occluded`], [`World::shade_shaft`] and
//!   [`World::shade_along`] perform the same triangle test (`triangle.rs`), operation by operation, whatever the instruction set, the
//!   tree and the grouping of rays. `closest` breaks ties in t by the lowest (object, triangle).
//! * **Nothing slips between triangles** that share an edge.
//! * **No epsilon.** Segments are open: `0 < t < t_max`. Callers move points off their surface.
//! * **Both sides** of a triangle are hit; degenerate triangles are left out and counted.
//! * Where a surface is not ([`scenes::Coverage`]) there is no hit. Of a surface that is there in part, rays hit as much:
//!   chance decides by an address, that of ray and triangle (`solid.rs`), and so the same for all who ask.
//!
//! This room knows nothing of light: surfaces and materials are looked up by [`Hit`].

mod bounds;
mod build;
mod bundle;
mod interval;
mod lanes;
mod occlusion;
mod packet;
mod parallel;
mod ray;
mod shaft;
mod slabs;
mod solid;
mod targets;
mod tree;
mod triangle;
mod vector;
mod world;

#[cfg(test)]
mod tests;

pub use bounds::Aabb;
pub use packet::PacketScratch;
pub use shaft::ShaftScratch;
pub use targets::Targets;
pub use world::{Hit, LeftOut, Ray, World};
