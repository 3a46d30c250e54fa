//! A scene in parts, each known by the SHA-256 of its bytes.
//!
//! Every mesh and every texture is a part of its own; all the rest (camera, objects, materials,
//! lights, environment) is one, the *layout*. The *manifest*, a part too, lists the others. Its
//! hash names the world. Two scenes that share a mesh share its part, so whoever keeps parts
//! fetches only what is new.
//!
//! ```text
//! manifest := "igiS" , mesh count u32 , texture count u32 , layout hash , mesh hashes , texture hashes
//! layout   := "igiL" , bincode
//! mesh     := "igiM" , counts of positions, normals, uvs, further sets of uvs, tangents, colours, triangles, materials
//!             (8 × u32) , arrays
//! texture  := "igiT" , width u32 , height u32 , storage u8 , look-up u8 , name length u16 , name , texels
//! ```
//! Arrays are little endian and copied as a whole. Bytes are hostile until [`join`] has checked
//! the scene that they make: nothing is allocated that the bytes at hand do not fill.

use std::sync::Arc;

use bincode::Options;
use bytemuck::{AnyBitPattern, NoUninit};
use glam::{DVec3, Vec2, Vec3, Vec4};
use scenes::{Camera, Environment, Light, LookUp, Material, Mesh, Object, Pixels, SETS_MAX, Scene, Texture, Wrap};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::message::{BLOB_MAX, bincode_options};

#[cfg(target_endian = "big")]
compile_error!("scene parts are copied as little-endian arrays");

/// A SHA-256.
pub type Hash = [u8; 32];

/// The list of a scene's parts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Manifest {
    /// All but meshes and textures.
    pub layout: Hash,
    /// In the scene's order; equal meshes share a hash.
    pub meshes: Vec<Hash>,
    /// In the scene's order; equal textures share a hash.
    pub textures: Vec<Hash>,
}

/// The bytes of a part.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Blob {
    /// Their SHA-256.
    pub hash: Hash,
    /// At most [`BLOB_MAX`].
    pub bytes: Vec<u8>,
}

/// Parts that make no scene.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PartError {
    /// The bytes of a part are not what they should be.
    #[error("a scene part ({0}) is broken: {1}")]
    Broken(&'static str, &'static str),
    /// The scene is too big for the wire.
    #[error("{0} is too big to be sent to workers: {1} bytes, at most {BLOB_MAX} are allowed")]
    TooBig(String, usize),
    /// A part that the manifest lists is not there.
    #[error("scene part {0} is missing")]
    Absent(String),
    /// The parts fit, but not together.
    #[error(transparent)]
    Unsound(#[from] scenes::Unsound),
}

/// The hash of a part.
pub fn hash(bytes: &[u8]) -> Hash {
    Sha256::digest(bytes).into()
}

/// The first digits of a hash, for people.
pub fn short(hash: &Hash) -> String {
    hash[..6].iter().map(|byte| format!("{byte:02x}")).collect()
}

impl Manifest {
    /// Every part once, the manifest itself not among them: the layout, meshes, textures.
    pub fn parts(&self) -> Vec<Hash> {
        let mut seen = std::collections::BTreeSet::new();
        let all = std::iter::once(&self.layout).chain(&self.meshes).chain(&self.textures);
        all.filter(|hash| seen.insert(**hash)).copied().collect()
    }

    /// The manifest as a part.
    pub fn blob(&self) -> Blob {
        let mut bytes = MANIFEST.to_vec();
        put_count(&mut bytes, self.meshes.len());
        put_count(&mut bytes, self.textures.len());
        bytes.extend(self.layout);
        bytes.extend(self.meshes.iter().chain(&self.textures).flatten());
        sealed(bytes)
    }

    /// Reads a manifest.
    ///
    /// # Errors
    /// [`PartError::Broken`] for other bytes.
    pub fn parse(bytes: &[u8]) -> Result<Self, PartError> {
        let mut from = Reader::new(bytes, MANIFEST, "manifest")?;
        let (meshes, textures) = (from.count()?, from.count()?);
        let layout = from.array(1)?[0];
        let manifest = Self { layout, meshes: from.array(meshes)?, textures: from.array(textures)? };
        from.end()?;
        Ok(manifest)
    }
}

/// Takes a scene apart: its manifest, and every part once (the manifest's own blob not among them).
///
/// # Errors
/// [`PartError::TooBig`] for a part beyond [`BLOB_MAX`].
pub fn split(scene: &Scene) -> Result<(Manifest, Vec<Blob>), PartError> {
    let layout = layout_blob(scene)?;
    let meshes = scene.meshes.iter().enumerate().map(|(i, mesh)| mesh_blob(i, mesh)).collect::<Result<Vec<_>, _>>()?;
    let textures = scene.textures.iter().map(|texture| texture_blob(texture)).collect::<Result<Vec<_>, _>>()?;
    let hashes = |blobs: &[Blob]| blobs.iter().map(|blob| blob.hash).collect();
    let manifest = Manifest { layout: layout.hash, meshes: hashes(&meshes), textures: hashes(&textures) };
    let mut blobs: Vec<Blob> = std::iter::once(layout).chain(meshes).chain(textures).collect();
    let mut seen = std::collections::BTreeSet::new();
    blobs.retain(|blob| seen.insert(blob.hash));
    Ok((manifest, blobs))
}

/// Puts a scene together and proves it sound. `part` finds the bytes of a part by its hash; they
/// are trusted to have that hash, and in nothing else.
///
/// # Errors
/// [`PartError`] if a part is absent or broken, or if the scene is not sound.
pub fn join<B: AsRef<[u8]>>(manifest: &Manifest, mut part: impl FnMut(&Hash) -> Option<B>) -> Result<Scene, PartError> {
    let mut find = |hash: &Hash| part(hash).ok_or_else(|| PartError::Absent(short(hash)));
    let layout = parse_layout(find(&manifest.layout)?.as_ref())?;
    let mut meshes = Vec::new();
    for hash in &manifest.meshes {
        meshes.push(Arc::new(parse_mesh(find(hash)?.as_ref())?));
    }
    let mut textures = Vec::new();
    for hash in &manifest.textures {
        textures.push(Arc::new(parse_texture(find(hash)?.as_ref())?));
    }
    let Layout { name, centre, camera, objects, materials, multiple_scattering, lights, environment, time } = layout;
    let mut scene = Scene {
        name,
        centre,
        camera,
        meshes,
        objects,
        materials,
        textures,
        multiple_scattering,
        lights,
        environment,
        time,
        ..Scene::default()
    };
    scene.check()?;
    scene.pose(time);
    Ok(scene)
}

const MANIFEST: &[u8; 4] = b"igiS";
const LAYOUT: &[u8; 4] = b"igiL";
const MESH: &[u8; 4] = b"igiM";
const TEXTURE: &[u8; 4] = b"igiT";

/// The small things of a scene: the fields of [`Scene`] that are not split further.
#[derive(Serialize, Deserialize)]
struct Layout {
    name: String,
    centre: DVec3,
    camera: Camera,
    objects: Vec<Object>,
    materials: Vec<Material>,
    multiple_scattering: bool,
    lights: Vec<Light>,
    environment: Environment,
    time: f64,
}

fn layout_blob(scene: &Scene) -> Result<Blob, PartError> {
    let layout = Layout {
        name: scene.name.clone(),
        centre: scene.centre,
        camera: scene.camera,
        objects: scene.objects.clone(),
        materials: scene.materials.clone(),
        multiple_scattering: scene.multiple_scattering,
        lights: scene.lights.clone(),
        environment: scene.environment,
        time: scene.time,
    };
    let too_big = |bytes| PartError::TooBig("the list of objects and materials".into(), bytes);
    let mut bytes = LAYOUT.to_vec();
    bincode_options((BLOB_MAX - bytes.len()) as u64)
        .serialize_into(&mut bytes, &layout)
        .map_err(|_| too_big(BLOB_MAX + 1))?;
    Ok(sealed(bytes))
}

fn parse_layout(bytes: &[u8]) -> Result<Layout, PartError> {
    let from = Reader::new(bytes, LAYOUT, "layout")?;
    // Everything in a layout takes at least a byte of it: its length bounds what is allocated.
    let length = from.bytes.len() as u64;
    bincode_options(length).deserialize(from.bytes).map_err(|_| PartError::Broken("layout", "not a layout"))
}

fn mesh_blob(index: usize, mesh: &Mesh) -> Result<Blob, PartError> {
    let Mesh { positions, normals, uvs, more_uvs, tangents, colours, triangles, materials, found: _ } = mesh;
    let a_vertex = |bytes: usize, count: usize| bytes * count;
    let length = a_vertex(12, positions.len() + normals.len() + triangles.len())
        + a_vertex(8, uvs.len() + more_uvs.iter().map(Vec::len).sum::<usize>() + colours.len())
        + a_vertex(16, tangents.len())
        + a_vertex(4, materials.len());
    if length > BLOB_MAX - MESH_HEAD {
        return Err(PartError::TooBig(format!("mesh {index}"), length));
    }
    let mut bytes = Vec::with_capacity(MESH_HEAD + length);
    bytes.extend(MESH);
    let counts = [positions.len(), normals.len(), uvs.len(), more_uvs.len(), tangents.len(), colours.len()];
    for count in counts.into_iter().chain([triangles.len(), materials.len()]) {
        put_count(&mut bytes, count);
    }
    put(&mut bytes, positions);
    put(&mut bytes, normals);
    put(&mut bytes, uvs);
    more_uvs.iter().for_each(|uvs| put(&mut bytes, uvs));
    put(&mut bytes, tangents);
    put(&mut bytes, colours);
    put(&mut bytes, triangles);
    put(&mut bytes, materials);
    Ok(sealed(bytes))
}

/// Bytes of a mesh before its arrays.
const MESH_HEAD: usize = 36;

fn parse_mesh(bytes: &[u8]) -> Result<Mesh, PartError> {
    let mut from = Reader::new(bytes, MESH, "mesh")?;
    let [positions, normals, uvs, sets] = [from.count()?, from.count()?, from.count()?, from.count()?];
    let [tangents, colours, triangles, materials] = [from.count()?, from.count()?, from.count()?, from.count()?];
    if sets >= SETS_MAX {
        return Err(from.broken("it has too many sets of texture coordinates"));
    }
    let mesh = Mesh {
        positions: from.array::<Vec3>(positions)?,
        normals: from.array::<Vec3>(normals)?,
        uvs: from.array::<Vec2>(uvs)?,
        more_uvs: (0..sets).map(|_| from.array::<Vec2>(positions)).collect::<Result<_, _>>()?,
        tangents: from.array::<Vec4>(tangents)?,
        colours: from.array::<[u16; 4]>(colours)?,
        triangles: from.array::<[u32; 3]>(triangles)?,
        materials: from.array::<u32>(materials)?,
        ..Mesh::default()
    };
    from.end()?;
    Ok(mesh)
}

const SRGB8: u8 = 0;
const LINEAR8: u8 = 1;
const FLOAT: u8 = 2;

fn texture_blob(texture: &Texture) -> Result<Blob, PartError> {
    let name = crate::message::cut(&texture.name, usize::from(u16::MAX));
    let (storage, texels): (u8, &[u8]) = match &texture.pixels {
        Pixels::Srgb8(texels) => (SRGB8, bytemuck::cast_slice(texels)),
        Pixels::Linear8(texels) => (LINEAR8, bytemuck::cast_slice(texels)),
        Pixels::Float(texels) => (FLOAT, bytemuck::cast_slice(texels)),
    };
    let length = 16 + name.len() + texels.len();
    if length > BLOB_MAX {
        return Err(PartError::TooBig(format!("texture {name}"), length));
    }
    let mut bytes = Vec::with_capacity(length);
    bytes.extend(TEXTURE);
    bytes.extend(texture.width.to_le_bytes());
    bytes.extend(texture.height.to_le_bytes());
    bytes.extend([storage, look_up_byte(texture.look_up)]);
    bytes.extend((name.len() as u16).to_le_bytes());
    bytes.extend(name.as_bytes());
    bytes.extend(texels);
    Ok(sealed(bytes))
}

fn parse_texture(bytes: &[u8]) -> Result<Texture, PartError> {
    let mut from = Reader::new(bytes, TEXTURE, "texture")?;
    let (width, height) = (from.count()?, from.count()?);
    let [storage, look_up, name_low, name_high] = from.array::<[u8; 4]>(1)?[0];
    let name = from.array::<u8>(usize::from(u16::from_le_bytes([name_low, name_high])))?;
    let name = String::from_utf8(name).map_err(|_| from.broken("its name is not UTF-8"))?;
    let texels = width.checked_mul(height).ok_or_else(|| from.broken("it is too large"))?;
    let pixels = match storage {
        SRGB8 => Pixels::Srgb8(from.array(texels)?),
        LINEAR8 => Pixels::Linear8(from.array(texels)?),
        FLOAT => Pixels::Float(from.array(texels)?),
        _ => return Err(from.broken("an unknown texel storage")),
    };
    let look_up = look_up_of(look_up).ok_or_else(|| from.broken("an unknown wrap mode"))?;
    from.end()?;
    Ok(Texture { name, width: width as u32, height: height as u32, pixels, look_up })
}

/// From the lowest bit: two for what is beyond the edges across, two for up, one for the nearest texel, three for the set.
fn look_up_byte(look_up: LookUp) -> u8 {
    let wrap = |wrap| match wrap {
        Wrap::Repeat => 0,
        Wrap::Clamp => 1,
        Wrap::Mirror => 2,
    };
    wrap(look_up.across) | wrap(look_up.up) << 2 | u8::from(look_up.nearest) << 4 | look_up.set << 5
}

fn look_up_of(byte: u8) -> Option<LookUp> {
    let wrap = |bits: u8| match bits & 3 {
        0 => Some(Wrap::Repeat),
        1 => Some(Wrap::Clamp),
        2 => Some(Wrap::Mirror),
        _ => None,
    };
    Some(LookUp { across: wrap(byte)?, up: wrap(byte >> 2)?, nearest: byte & 16 != 0, set: byte >> 5 })
}

fn sealed(bytes: Vec<u8>) -> Blob {
    Blob { hash: hash(&bytes), bytes }
}

/// Counts fit `u32` because what they count fits a blob.
fn put_count(bytes: &mut Vec<u8>, count: usize) {
    bytes.extend((count as u32).to_le_bytes());
}

fn put<T: NoUninit>(bytes: &mut Vec<u8>, array: &[T]) {
    bytes.extend_from_slice(bytemuck::cast_slice(array));
}

struct Reader<'a> {
    bytes: &'a [u8],
    what: &'static str,
}

impl<'a> Reader<'a> {
    fn new(bytes: &'a [u8], tag: &[u8; 4], what: &'static str) -> Result<Self, PartError> {
        match bytes.split_first_chunk::<4>() {
            Some((found, bytes)) if found == tag => Ok(Self { bytes, what }),
            _ => Err(PartError::Broken(what, "it is something else")),
        }
    }

    fn broken(&self, why: &'static str) -> PartError {
        PartError::Broken(self.what, why)
    }

    fn count(&mut self) -> Result<usize, PartError> {
        Ok(self.array::<u32>(1)?[0] as usize)
    }

    /// Copies `count` values, wherever they are aligned; allocates only what the bytes can fill.
    fn array<T: AnyBitPattern + NoUninit>(&mut self, count: usize) -> Result<Vec<T>, PartError> {
        let length = count.checked_mul(size_of::<T>()).ok_or_else(|| self.broken("it ends early"))?;
        let (taken, rest) = self.bytes.split_at_checked(length).ok_or_else(|| self.broken("it ends early"))?;
        self.bytes = rest;
        Ok(bytemuck::pod_collect_to_vec(taken))
    }

    fn end(&self) -> Result<(), PartError> {
        if self.bytes.is_empty() { Ok(()) } else { Err(self.broken("it goes on after its end")) }
    }
}

#[cfg(test)]
mod tests;
