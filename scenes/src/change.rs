//! What was edited: small, ordered changes that lead from one revision of a scene to the next.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::{Camera, Environment, Light, Material, Motion, Offset, Scene, Solid, Transform, Unsound};

/// One edit. Applying the same changes in the same order gives the same scene everywhere.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Change {
    /// Look from elsewhere.
    Camera(Camera),
    /// Put an object somewhere that does not move by itself.
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
    /// Put an object that moves by itself elsewhere than its keys do: see [`Motion::offset_to`].
    Offset {
        /// Index into [`Scene::objects`].
        object: u32,
        /// Instead of the one it has.
        offset: Offset,
    },
    /// Put a piece of an object somewhere; it is lifted out of the object, or back where it was a part of it again.
    PieceTransform {
        /// Index into [`Scene::objects`], of an object that the file keeps apart.
        object: u32,
        /// Which of its mesh's [`crate::Pieces`].
        piece: u32,
        /// Its new place; must be invertible. The identity: where it was modelled.
        whole_from_piece: Transform,
    },
    /// Show or hide a piece of an object.
    PieceVisible {
        /// As above.
        object: u32,
        /// As above.
        piece: u32,
        /// Whether it takes part.
        visible: bool,
    },
    /// Put a lamp where there is none or another, or take one away. The other lights keep their numbers.
    Lamp {
        /// Index into [`Scene::lights`], which grows as far as need be; below [`LIGHTS_MAX`].
        light: u32,
        /// `None`: there is none.
        value: Option<Lamp>,
    },
    /// Have another light from beyond all objects: dimmed, coloured.
    Environment(Environment),
    /// Make an object, or a piece of one, of something that others have not, or again of what its mesh says. What a piece has
    /// of its own counts before what its whole has.
    OwnMaterial {
        /// Index into [`Scene::objects`], of an object that the file keeps apart.
        object: u32,
        /// Which of its mesh's [`crate::Pieces`]; `None`: all of it.
        piece: Option<u32>,
        /// Instead of this material of its mesh: index into [`Scene::materials`], of one of the file's.
        material: u32,
        /// `None`: none of its own.
        value: Option<Material>,
    },
    /// Bring a photometric solid along, for lamps to have. It stays: lamps that have it come and go.
    Solid {
        /// The next free index into [`Scene::textures`], or that of the same one.
        texture: u32,
        /// What it is.
        value: Arc<Solid>,
    },
}

/// A light by its name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lamp {
    /// For people; may be empty.
    pub name: String,
    /// What it gives.
    pub light: Light,
}

/// So many lights a scene may have once some are added to those of its file.
pub const LIGHTS_MAX: u32 = 4096;

/// What a change is about, by its number in the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum About {
    /// Index into [`Scene::objects`].
    Object(u32),
    /// Index into [`Scene::materials`].
    Material(u32),
    /// Index into [`Scene::lights`].
    Light(u32),
}

impl About {
    /// The number alone.
    pub fn number(self) -> u32 {
        let (Self::Object(number) | Self::Material(number) | Self::Light(number)) = self;
        number
    }

    /// Another thing of its kind.
    #[must_use]
    pub fn of_number(self, number: u32) -> Self {
        match self {
            Self::Object(_) => Self::Object(number),
            Self::Material(_) => Self::Material(number),
            Self::Light(_) => Self::Light(number),
        }
    }

    /// How many of its kind an edit of the scene can be about.
    pub fn count(self, scene: &Scene) -> u32 {
        let count = match self {
            Self::Object(_) => scene.wholes(),
            Self::Material(_) => scene.shared_materials(),
            Self::Light(_) => scene.lights.len(),
        };
        count as u32
    }

    /// What the scene's file calls it, empty if nothing; `None` if there is no such thing.
    pub fn name(self, scene: &Scene) -> Option<&str> {
        match self {
            Self::Object(number) => scene.objects.get(number as usize).map(|object| object.name.as_str()),
            Self::Material(number) => scene.materials.get(number as usize).map(|material| material.name.as_str()),
            Self::Light(number) => {
                scene.lights.get(number as usize)?;
                Some(scene.light_names.get(number as usize).map_or("", String::as_str))
            }
        }
    }
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
        self.check(scene)?;
        match self {
            Self::Camera(camera) => scene.camera = *camera,
            Self::Transform { object, scene_from_object } => {
                scene.objects[*object as usize].scene_from_object = *scene_from_object;
            }
            Self::Visible { object, visible } => scene.objects[*object as usize].visible = *visible,
            Self::Light { light, value } => scene.lights[*light as usize] = value.clone(),
            Self::Material { material, value } => scene.materials[*material as usize] = value.clone(),
            Self::Time(time) => scene.pose(*time),
            Self::Offset { object, offset } => {
                let object = &mut scene.objects[*object as usize];
                if let Some(motion) = &mut object.motion {
                    motion.offset = *offset;
                    object.scene_from_object = motion.at(scene.time);
                }
            }
            Self::PieceTransform { object, piece, whole_from_piece } => {
                scene.with_piece(*object, *piece, |lifted| lifted.whole_from_piece = *whole_from_piece);
            }
            Self::PieceVisible { object, piece, visible } => {
                scene.with_piece(*object, *piece, |lifted| lifted.visible = *visible);
            }
            Self::Lamp { light, value } => scene.put_lamp(*light as usize, value.clone()),
            Self::Environment(environment) => scene.environment = *environment,
            Self::OwnMaterial { object, piece, material, value } => {
                scene.put_own(*object, *piece, *material, value.clone());
            }
            Self::Solid { texture, value } => {
                if *texture as usize == scene.textures.len() {
                    scene.textures.push(value.texture().into());
                }
            }
        }
        if let Self::Transform { .. } | Self::Visible { .. } | Self::Offset { .. } = self {
            scene.carry_lifted();
        }
        Ok(())
    }

    /// Whether the scene can take the change. No other change makes a difference to that, numbers near the limits of
    /// `f32` aside, [`Self::Light`] of a lamp that [`Self::Lamp`] adds or takes away, and lamps whose solid
    /// [`Self::Solid`] brings.
    ///
    /// # Errors
    /// [`Refused`] names what is out of range.
    pub fn check(&self, scene: &Scene) -> Result<(), Refused> {
        let there_is = |count: usize, index: u32, what: &str| match (index as usize) < count {
            true => Ok(()),
            false => Err(Refused(format!("there is no {what} {index}, only {count}"))),
        };
        match self {
            Self::Camera(camera) => camera.check().map_err(|what| Refused(format!("camera: {what}")))?,
            Self::Transform { object, scene_from_object } => {
                there_is(scene.wholes(), *object, "object")?;
                if scene.objects[*object as usize].motion.is_some() {
                    return Err(Refused(format!("object {object} moves by itself: it takes an offset")));
                }
                scene_from_object.check("scene_from_object")?;
            }
            Self::Visible { object, .. } => there_is(scene.wholes(), *object, "object")?,
            Self::Light { light, value } => {
                there_is(scene.lights.len(), *light, "light")?;
                value.check("light", &scene.textures)?;
            }
            Self::Material { material, value } => {
                there_is(scene.shared_materials(), *material, "material")?;
                value.check("material", scene.textures.len())?;
            }
            Self::Time(time) if time.is_finite() => {
                for motion in scene.objects.iter().filter_map(|object| object.motion.as_ref()) {
                    motion.at(*time).check("the pose at that time")?;
                }
            }
            Self::Time(_) => return Err(Refused("the time is no finite number".into())),
            Self::Offset { object, offset } => {
                there_is(scene.wholes(), *object, "object")?;
                let Some(motion) = &scene.objects[*object as usize].motion else {
                    return Err(Refused(format!("object {object} does not move by itself")));
                };
                offset.own.check("offset.own")?;
                Motion { offset: *offset, ..motion.clone() }.at(scene.time).check("the pose with that offset")?;
            }
            Self::PieceTransform { object, piece, whole_from_piece } => {
                scene.check_piece(*object, *piece)?;
                whole_from_piece.check("whole_from_piece")?;
            }
            Self::PieceVisible { object, piece, .. } => scene.check_piece(*object, *piece)?,
            Self::Lamp { light, value } => {
                let most = scene.lights.len().max(LIGHTS_MAX as usize);
                if *light as usize >= most {
                    return Err(Refused(format!("lamp {light}: a scene has at most {most}")));
                }
                if let Some(Lamp { light, .. }) = value {
                    light.check("lamp", &scene.textures)?;
                    if light.is_absent() {
                        return Err(Refused("lamp: it is none".into()));
                    }
                }
            }
            Self::Environment(environment) => environment.check(&scene.textures)?,
            Self::OwnMaterial { object, piece, material, value } => {
                match piece {
                    Some(piece) => scene.check_piece(*object, *piece)?,
                    None => there_is(scene.wholes(), *object, "object")?,
                }
                if !scene.has_material(*object, *piece, *material) {
                    return Err(Refused(format!("object {object}: nothing of it is made of material {material}")));
                }
                if let Some(value) = value {
                    value.check("material", scene.textures.len())?;
                }
            }
            Self::Solid { texture, value } => {
                value.check().map_err(|what| Refused(format!("a photometric solid: {what}")))?;
                let known = scene.textures.get(*texture as usize);
                if known.is_some_and(|known| **known != value.texture()) || *texture as usize > scene.textures.len() {
                    return Err(Refused(format!("texture {texture} is not where a solid can be put")));
                }
            }
        }
        Ok(())
    }

    /// Light may be otherwise everywhere: of a lamp, the sky, or a material, which may shine.
    pub fn is_of_light(&self) -> bool {
        matches!(
            self,
            Self::Light { .. }
                | Self::Lamp { .. }
                | Self::Environment(_)
                | Self::Material { .. }
                | Self::OwnMaterial { .. }
        )
    }

    /// What it is about; `None` for what there is only one of.
    pub fn about(&self) -> Option<About> {
        match self {
            Self::Transform { object, .. }
            | Self::Offset { object, .. }
            | Self::Visible { object, .. }
            | Self::PieceTransform { object, .. }
            | Self::PieceVisible { object, .. }
            | Self::OwnMaterial { object, .. } => Some(About::Object(*object)),
            Self::Material { material, .. } => Some(About::Material(*material)),
            Self::Light { light, .. } | Self::Lamp { light, value: None } => Some(About::Light(*light)),
            // It says all there is to say of the lamp.
            Self::Lamp { value: Some(_), .. }
            | Self::Environment(_)
            | Self::Camera(_)
            | Self::Time(_)
            | Self::Solid { .. } => None,
        }
    }

    /// The same change of another thing of its kind.
    #[must_use]
    pub fn of_number(&self, number: u32) -> Self {
        let mut change = self.clone();
        match &mut change {
            Self::Transform { object, .. }
            | Self::Offset { object, .. }
            | Self::Visible { object, .. }
            | Self::PieceTransform { object, .. }
            | Self::PieceVisible { object, .. }
            | Self::OwnMaterial { object, .. } => *object = number,
            Self::Material { material, .. } => *material = number,
            Self::Light { light, .. } | Self::Lamp { light, .. } => *light = number,
            Self::Environment(_) | Self::Camera(_) | Self::Time(_) | Self::Solid { .. } => {}
        }
        change
    }

    /// The photometric solid that a lamp of it has: index into [`Scene::textures`].
    pub fn solid_mut(&mut self) -> Option<&mut u32> {
        match self {
            Self::Light { value: Light::Luminaire { solid, .. }, .. }
            | Self::Lamp { value: Some(Lamp { light: Light::Luminaire { solid, .. }, .. }), .. } => Some(solid),
            Self::Solid { texture, .. } => Some(texture),
            _ => None,
        }
    }

    /// The same in a scene whose file has so many textures, where it had others when the change was made: what was brought along
    /// stands behind those of the file.
    #[must_use]
    pub fn behind_textures(mut self, was: usize, is: usize) -> Self {
        if let Some(solid) = self.solid_mut()
            && *solid as usize >= was
        {
            *solid = (*solid as usize - was + is) as u32;
        }
        self
    }

    /// All that the earlier change sets is set by this one too: the earlier can be forgotten.
    pub fn supersedes(&self, earlier: &Self) -> bool {
        match (self, earlier) {
            (Self::Camera(_), Self::Camera(_))
            | (Self::Time(_), Self::Time(_))
            | (Self::Environment(_), Self::Environment(_)) => true,
            (Self::Transform { object: a, .. }, Self::Transform { object: b, .. })
            | (Self::Offset { object: a, .. }, Self::Offset { object: b, .. })
            | (Self::Visible { object: a, .. }, Self::Visible { object: b, .. })
            | (Self::Light { light: a, .. }, Self::Light { light: b, .. })
            | (Self::Lamp { light: a, .. }, Self::Lamp { light: b, .. } | Self::Light { light: b, .. })
            | (Self::Material { material: a, .. }, Self::Material { material: b, .. })
            | (Self::Solid { texture: a, .. }, Self::Solid { texture: b, .. }) => a == b,
            (Self::PieceTransform { object: a, piece: p, .. }, Self::PieceTransform { object: b, piece: q, .. })
            | (Self::PieceVisible { object: a, piece: p, .. }, Self::PieceVisible { object: b, piece: q, .. }) => {
                (a, p) == (b, q)
            }
            (
                Self::OwnMaterial { object: a, piece: p, material: m, .. },
                Self::OwnMaterial { object: b, piece: q, material: n, .. },
            ) => (a, p, m) == (b, q, n),
            _ => false,
        }
    }

    /// The change that puts an object to a place. If it moves by itself, it is there at that time, and goes on from there.
    pub fn place(object: u32, motion: Option<&Motion>, time: f64, place: Transform) -> Self {
        match motion {
            Some(motion) => Self::Offset { object, offset: motion.offset_to(time, &place) },
            None => Self::Transform { object, scene_from_object: place },
        }
    }

    /// The change that takes this one back, asked **before** it is applied; `None` if the scene cannot take it.
    pub fn undo(&self, scene: &Scene) -> Option<Self> {
        let object_at = |object: u32| scene.objects.get(object as usize);
        Some(match self {
            Self::Camera(_) => Self::Camera(scene.camera),
            Self::Transform { object, .. } => {
                Self::Transform { object: *object, scene_from_object: object_at(*object)?.scene_from_object }
            }
            Self::Offset { object, .. } => {
                Self::Offset { object: *object, offset: object_at(*object)?.motion.as_ref()?.offset }
            }
            Self::Visible { object, .. } => Self::Visible { object: *object, visible: object_at(*object)?.visible },
            Self::Light { light, .. } => {
                Self::Light { light: *light, value: scene.lights.get(*light as usize)?.clone() }
            }
            Self::Material { material, .. } => {
                Self::Material { material: *material, value: scene.materials.get(*material as usize)?.clone() }
            }
            Self::Time(_) => Self::Time(scene.time),
            Self::Lamp { light, .. } => Self::Lamp { light: *light, value: scene.lamp(*light) },
            Self::Environment(_) => Self::Environment(scene.environment),
            Self::PieceTransform { object, piece, .. } => {
                scene.check_piece(*object, *piece).ok()?;
                let whole_from_piece = scene.piece(*object, *piece).whole_from_piece;
                Self::PieceTransform { object: *object, piece: *piece, whole_from_piece }
            }
            Self::PieceVisible { object, piece, .. } => {
                scene.check_piece(*object, *piece).ok()?;
                let visible = scene.piece(*object, *piece).visible;
                Self::PieceVisible { object: *object, piece: *piece, visible }
            }
            Self::OwnMaterial { object, piece, material, .. } => {
                let value = scene.own_material(*object, *piece, *material).cloned();
                Self::OwnMaterial { object: *object, piece: *piece, material: *material, value }
            }
            // It stays.
            Self::Solid { .. } => self.clone(),
        })
    }
}

impl Scene {
    /// A light by its name; `None` if there is none of that number.
    pub fn lamp(&self, light: u32) -> Option<Lamp> {
        let found = self.lights.get(light as usize).filter(|light| !light.is_absent())?.clone();
        Some(Lamp { name: self.light_names.get(light as usize).cloned().unwrap_or_default(), light: found })
    }

    /// What stands there follows from the lamps that there are, in whatever order they came.
    fn put_lamp(&mut self, number: usize, lamp: Option<Lamp>) {
        if self.lights.len() <= number {
            self.lights.resize(number + 1, Light::ABSENT);
        }
        let (name, light) = lamp.map_or((String::new(), Light::ABSENT), |Lamp { name, light }| (name, light));
        self.lights[number] = light;
        if self.light_names.len() <= number && !name.is_empty() {
            self.light_names.resize(number + 1, String::new());
        }
        if let Some(known) = self.light_names.get_mut(number) {
            *known = name;
        }
        let last = self.lights.iter().rposition(|light| !light.is_absent());
        self.lights.truncate(last.map_or(0, |last| last + 1));
        self.light_names.truncate(self.lights.len());
    }
}
