//! The world as data: what there is, where it stands, what it is made of and what shines.
//!
//! This room has never heard of rays, workers or pictures. It knows files only in [`read`];
//! everything else is plain data, ordered, and the same on every machine.
//!
//! # Spaces and units
//! * **File space**: what the scene file says, read in `f64`.
//! * **Scene space**: file space minus [`Scene::centre`], in `f32`. All geometry here is in scene
//!   space, so that a scene a million metres from the origin keeps its millimetres.
//! * Lengths are in the scene's own unit. Radiance is W·m⁻²·sr⁻¹ per channel, intensity W·sr⁻¹,
//!   irradiance W·m⁻², in linear Rec. 709 primaries; [`photometry`] says what candela and lux that is.

pub mod camera;
pub mod change;
pub mod check;
pub mod daylight;
mod difference;
pub mod edited;
pub mod lift;
pub mod light;
pub mod light_groups;
pub mod model;
pub mod needs;
pub mod own;
pub mod photometry;
pub mod pieces;
mod place;
pub mod powers;
pub mod read;
pub mod relays;
pub mod solid;
pub mod surface_point;
pub mod texture;
pub mod views;

pub use camera::Camera;
pub use change::Change;
pub use check::Unsound;
pub use edited::Edited;
pub use lift::Triangles;
pub use light::Light;
pub use light_groups::{LightGroup, light_groups};
pub use model::{
    Coat, Colour, Coverage, Dielectric, Environment, Found, Gloss, Key, Lifted, LookUp, Material, Mesh, Motion,
    NormalMap, Object, Offset, Pixels, Posed, Rgb, SETS_MAX, Scalar, Scene, Sheen, Specular, Surface, Texture,
    Transform, Wrap,
};
pub use needs::{Keep, Needs};
pub use own::Own;
pub use pieces::Pieces;
pub use place::Place;
pub use powers::Shiner;
pub use relays::Relays;
pub use solid::Solid;
pub use surface_point::{Absent, SurfacePoint};
pub use views::{Preset, SavedView};
