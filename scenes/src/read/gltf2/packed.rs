//! Geometry that is packed: EXT_meshopt_compression in buffer views, KHR_draco_mesh_compression in primitives.
//!
//! What is unpacked becomes further buffers, and views and accessors lead there: whoever reads them has never heard of it.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::panic::{AssertUnwindSafe, catch_unwind};

use draco_core::{DecodeLimits, DecoderBuffer, FaceIndex, Mesh, MeshDecoder};
use gltf_json::accessor::{ComponentType, GenericComponentType};
use gltf_json::buffer::View;
use gltf_json::mesh::Semantic;
use gltf_json::validation::{Checked, USize64};
use gltf_json::{Accessor, Index};
use serde_json::Value;

use super::super::ReadError;
use super::super::error::Notes;
use super::super::limits::{FILE_BYTES_MAX, TRIANGLES_MAX};
use super::accessor::multiplicity;
use super::file::File;
use super::meshopt::{Filter, Mode, decode};

/// Names of the extensions, once each by the group and by those who made it.
const MESHOPT: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];
const DRACO: &str = "KHR_draco_mesh_compression";

impl File {
    /// Unpacks all there is.
    pub fn unpack(&mut self, notes: &mut Notes) {
        for view in 0..self.root.buffer_views.len() {
            match self.unpacked_view(view) {
                Ok(None) => {}
                Ok(Some(bytes)) => {
                    let (buffer, byte_length) = (self.add(bytes), self.buffers.last().map_or(0, Vec::len));
                    let view = &mut self.root.buffer_views[view];
                    (view.buffer, view.byte_offset) = (buffer, None);
                    view.byte_length = USize64::from(byte_length);
                }
                Err(error) => self.leave_out(error, "what is in it is not drawn", notes),
            }
        }
        let primitives: Vec<[usize; 2]> = self
            .root
            .meshes
            .iter()
            .enumerate()
            .flat_map(|(mesh, it)| (0..it.primitives.len()).map(move |primitive| [mesh, primitive]))
            .collect();
        let mut known: BTreeMap<u64, Mesh> = BTreeMap::new();
        for [mesh, primitive] in primitives {
            if let Err(error) = self.unpack_primitive(mesh, primitive, &mut known) {
                self.leave_out(error, "not drawn", notes);
            }
        }
    }

    /// Such a buffer holds nothing: it stands for what views unpack.
    pub fn is_stand_in(&self, buffer: usize) -> bool {
        let extensions = self.root.buffers[buffer].extensions.as_ref();
        let is_fallback = |name: &&str| {
            extensions.and_then(|all| all.others.get(*name)).is_some_and(|it| it["fallback"].as_bool() == Some(true))
        };
        MESHOPT.iter().any(is_fallback)
    }

    fn add(&mut self, bytes: Vec<u8>) -> Index<gltf_json::Buffer> {
        self.buffers.push(bytes);
        Index::new((self.buffers.len() - 1) as u32)
    }

    fn unpacked_view(&self, number: usize) -> Result<Option<Vec<u8>>, ReadError> {
        let view: &View = &self.root.buffer_views[number];
        let extensions = view.extensions.as_ref();
        let found = MESHOPT.iter().find_map(|name| extensions?.others.get(*name).map(|it| (*name, it)));
        let Some((name, packed)) = found else { return Ok(None) };
        let field = format!("bufferViews[{number}].extensions.{name}");
        let whole = |key: &str| packed[key].as_u64().and_then(|value| usize::try_from(value).ok());
        let (Some(buffer), Some(length)) = (whole("buffer"), whole("byteLength")) else {
            return Err(self.refuse(&field, "lacks its buffer or byteLength"));
        };
        let (Some(count), Some(stride)) = (whole("count"), whole("byteStride")) else {
            return Err(self.refuse(&field, "lacks its count or byteStride"));
        };
        let start = whole("byteOffset").unwrap_or(0);
        let bytes = self.buffers.get(buffer).and_then(|bytes| bytes.get(start..start.checked_add(length)?));
        let bytes = bytes.ok_or_else(|| self.refuse(&field, format!("leaves buffers[{buffer}]")))?;
        let mode = match packed["mode"].as_str() {
            Some("ATTRIBUTES") => Mode::Attributes,
            Some("TRIANGLES") => Mode::Triangles,
            Some("INDICES") => Mode::Indices,
            _ => return Err(self.refuse(&field, "has an unknown mode")),
        };
        let filter = match packed["filter"].as_str() {
            None | Some("NONE") => Filter::None,
            Some("OCTAHEDRAL") => Filter::Octahedral,
            Some("QUATERNION") => Filter::Quaternion,
            Some("EXPONENTIAL") => Filter::Exponential,
            Some(filter) => return Err(self.refuse(&field, format!("has a filter that is not known here: {filter}"))),
        };
        if count.saturating_mul(stride) as u64 > FILE_BYTES_MAX {
            return Err(self.refuse(&field, "is too large"));
        }
        let unpacked = decode(bytes, count, stride, mode, filter);
        unpacked.map(Some).ok_or_else(|| self.refuse(&field, "cannot be unpacked: its bytes are broken"))
    }

    fn unpack_primitive(
        &mut self,
        mesh: usize,
        primitive: usize,
        known: &mut BTreeMap<u64, Mesh>,
    ) -> Result<(), ReadError> {
        let source = &self.root.meshes[mesh].primitives[primitive];
        let Some(packed) = source.extensions.as_ref().and_then(|all| all.others.get(DRACO)) else { return Ok(()) };
        let field = format!("meshes[{mesh}].primitives[{primitive}].extensions.{DRACO}");
        let view = packed["bufferView"].as_u64().ok_or_else(|| self.refuse(&field, "lacks its bufferView"))?;
        let ids: Vec<(Index<Accessor>, u32)> = source
            .attributes
            .iter()
            .filter_map(|(semantic, accessor)| {
                let Checked::Valid(semantic) = semantic else { return None };
                Some((*accessor, id(packed, semantic)?))
            })
            .collect();
        let indices = source.indices;
        let decoded = match known.entry(view) {
            Entry::Occupied(decoded) => &*decoded.into_mut(),
            Entry::Vacant(place) => {
                let bytes = self.view(Index::new(u32::try_from(view).unwrap_or(u32::MAX)), &field)?;
                &*place.insert(draco(bytes).map_err(|why| self.refuse(&field, why))?)
            }
        };
        let points = decoded.num_points();
        for (accessor, id) in ids {
            let place = format!("{field}: attribute {id}");
            let kind = match self.get(&self.root.accessors, accessor, || place.clone())?.type_ {
                Checked::Valid(kind) => kind,
                Checked::Invalid => continue,
            };
            let Some(attribute) = decoded.attribute_by_unique_id(id) else {
                return Err(self.refuse(&place, "is not in the packed bytes"));
            };
            let components = multiplicity(kind).unwrap_or(1);
            let most = self.normal_most(accessor);
            let numbers = attribute.read_f32s(points, components);
            let bytes = numbers.iter().flat_map(|number| (number / most).to_le_bytes()).collect();
            self.lead(accessor, bytes, ComponentType::F32, points);
        }
        if let Some(indices) = indices {
            let faces = (0..decoded.num_faces()).map(|face| decoded.face(FaceIndex(face as u32)));
            let bytes = faces.flatten().flat_map(|point| point.0.to_le_bytes()).collect();
            let count = 3 * decoded.num_faces();
            self.lead(indices, bytes, ComponentType::U32, count);
        }
        Ok(())
    }

    /// What an accessor's integers are divided by: 1, unless they are normalised.
    fn normal_most(&self, accessor: Index<Accessor>) -> f32 {
        let accessor = &self.root.accessors[accessor.value()];
        match accessor.component_type {
            Checked::Valid(GenericComponentType(kind)) if accessor.normalized => match kind {
                ComponentType::I8 => 127.0,
                ComponentType::U8 => 255.0,
                ComponentType::I16 => 32767.0,
                ComponentType::U16 => 65535.0,
                ComponentType::U32 | ComponentType::F32 => 1.0,
            },
            _ => 1.0,
        }
    }

    /// Makes an accessor lead to bytes of its own.
    fn lead(&mut self, accessor: Index<Accessor>, bytes: Vec<u8>, kind: ComponentType, count: usize) {
        let byte_length = USize64::from(bytes.len());
        let buffer = self.add(bytes);
        let (name, extensions, extras) = (None, None, Default::default());
        let view =
            View { buffer, byte_length, byte_offset: None, byte_stride: None, name, target: None, extensions, extras };
        self.root.buffer_views.push(view);
        let view = Index::new((self.root.buffer_views.len() - 1) as u32);
        let Some(accessor) = self.root.accessors.get_mut(accessor.value()) else { return };
        (accessor.buffer_view, accessor.byte_offset, accessor.sparse) = (Some(view), None, None);
        (accessor.component_type, accessor.normalized) = (Checked::Valid(GenericComponentType(kind)), false);
        accessor.count = USize64::from(count);
    }
}

/// The number that an attribute has in the packed bytes.
fn id(packed: &Value, semantic: &Semantic) -> Option<u32> {
    u32::try_from(packed["attributes"].get(semantic.to_string())?.as_u64()?).ok()
}

fn draco(bytes: &[u8]) -> Result<Mesh, String> {
    let limits = DecodeLimits::default().with_max_points(3 * TRIANGLES_MAX as u64);
    let decode = || {
        let mut buffer = DecoderBuffer::new(bytes).with_limits(limits);
        let mut mesh = Mesh::new();
        MeshDecoder::new().decode(&mut buffer, &mut mesh).map(|()| mesh)
    };
    // The crate means not to panic; a stranger's bytes may know better.
    match catch_unwind(AssertUnwindSafe(decode)) {
        Ok(Ok(mesh)) => Ok(mesh),
        Ok(Err(error)) => Err(format!("cannot be unpacked: {error}")),
        Err(_) => Err("cannot be unpacked".into()),
    }
}
