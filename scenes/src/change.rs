//! What was edited: small, ordered changes that lead from one revision of a scene to the next.

use serde::{Deserialize, Serialize};

use crate::{Camera, Light, Material, Scene, Transform, Unsound};

/// One edit. Applying the same changes in the same order gives the same scene everywhere.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Change {
    /// Look from elsewhere.
    Camera(Camera),
    /// Put an object somewhere.
    Transform {
        /// Index into [`Scene::objects`].
        object: u32,
        /// Its new place; must be invertible.
        scene_from_object: Transform,
    },
    /// Show or hide an object.
    Visible {
        /// Index into [`Scene::objects`].
        object: u32,
        /// Whether it takes part.
        visible: bool,
    },
    /// Replace a light.
    Light {
        /// Index into [`Scene::lights`].
        light: u32,
        /// The new one.
        value: Light,
    },
    /// Replace a material.
    Material {
        /// Index into [`Scene::materials`].
        material: u32,
        /// The new one.
        value: Material,
    },
    /// Pose all moving objects.
    Time(f64),
}

/// A change that the scene cannot take: an index out of range, or numbers out of theirs.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("change refused: {0}")]
pub struct Refused(pub String);

impl From<Unsound> for Refused {
    fn from(unsound: Unsound) -> Self {
        Self(format!("{}: {}", unsound.place, unsound.what))
    }
}

impl Change {
    /// Applies the change, or refuses it and leaves the scene as it was. A sound scene stays sound.
    ///
    /// # Errors
    /// [`Refused`] names what is out of range.
    pub fn apply(&self, scene: &mut Scene) -> Result<(), Refused> {
        fn slot<'a, T>(items: &'a mut [T], index: u32, what: &str) -> Result<&'a mut T, Refused> {
            let count = items.len();
            items.get_mut(index as usize).ok_or_else(|| Refused(format!("there is no {what} {index}, only {count}")))
        }
        match self {
            Self::Camera(camera) => {
                camera.check().map_err(|what| Refused(format!("camera: {what}")))?;
                scene.camera = *camera;
            }
            Self::Transform { object, scene_from_object } => {
                let object = slot(&mut scene.objects, *object, "object")?;
                scene_from_object.check("scene_from_object")?;
                object.scene_from_object = *scene_from_object;
            }
            Self::Visible { object, visible } => slot(&mut scene.objects, *object, "object")?.visible = *visible,
            Self::Light { light, value } => {
                let light = slot(&mut scene.lights, *light, "light")?;
                value.check("light")?;
                *light = value.clone();
            }
            Self::Material { material, value } => {
                let material = slot(&mut scene.materials, *material, "material")?;
                value.check("material", scene.textures.len())?;
                *material = value.clone();
            }
            Self::Time(time) if time.is_finite() => scene.pose(*time),
            Self::Time(_) => return Err(Refused("the time is no finite number".into())),
        }
        Ok(())
    }
}
