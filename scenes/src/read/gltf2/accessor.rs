//! Numbers out of buffers, with every bound checked.

use glam::DMat4;
use gltf_json::accessor::{ComponentType, GenericComponentType, IndexComponentType, Type};
use gltf_json::buffer::View;
use gltf_json::validation::Checked;
use gltf_json::{Accessor, Index};

use super::super::ReadError;
use super::super::limits::TRIANGLES_MAX;
use super::file::File;

/// Most elements of one accessor: as many as corners of triangles.
const ELEMENTS_MAX: usize = 3 * TRIANGLES_MAX;

/// Most elements of a sparse accessor that starts from zeros: no bytes of the file stand behind them.
const ZEROS_MAX: usize = 1 << 24;

/// Equally spaced elements within a buffer; all of them are there.
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
    size: usize,
}

impl<'a> Elements<'a> {
    fn get(&self, i: usize) -> &'a [u8] {
        &self.bytes[i * self.stride..][..self.size]
    }
}

impl File {
    /// Vectors of N numbers; integers are normalised if the accessor says so.
    pub fn vectors<const N: usize>(&self, index: Index<Accessor>, field: &str) -> Result<Vec<[f32; N]>, ReadError> {
        let mut vectors = Vec::new();
        let normalised = self.get(&self.root.accessors, index, || field.into())?.normalized;
        self.elements(index, field, N, |i, component, bytes| {
            let size = component.size();
            let vector = std::array::from_fn(|k| number(component, normalised, &bytes[k * size..]));
            store(&mut vectors, i, vector);
        })?;
        Ok(vectors)
    }

    /// All numbers of all elements, whatever their type.
    pub fn numbers(&self, index: Index<Accessor>, field: &str) -> Result<Vec<f32>, ReadError> {
        let accessor = self.get(&self.root.accessors, index, || field.into())?;
        match accessor.type_ {
            Checked::Valid(Type::Scalar) => Ok(self.vectors::<1>(index, field)?.into_flattened()),
            Checked::Valid(Type::Vec3) => Ok(self.vectors::<3>(index, field)?.into_flattened()),
            _ => Ok(self.vectors::<4>(index, field)?.into_flattened()),
        }
    }

    /// Matrices, in columns.
    pub fn matrices(&self, index: Index<Accessor>, field: &str) -> Result<Vec<DMat4>, ReadError> {
        let matrices = self.vectors::<16>(index, field)?;
        let sound = matrices.iter().flatten().all(|number| number.is_finite());
        let wide = |matrix: [f32; 16]| DMat4::from_cols_array(&matrix.map(f64::from));
        if sound {
            Ok(matrices.into_iter().map(wide).collect())
        } else {
            Err(self.refuse(field, "holds what is no number"))
        }
    }

    /// Colours of three or four numbers; the alpha of three is 1.
    pub fn colours(&self, index: Index<Accessor>, field: &str) -> Result<Vec<[f32; 4]>, ReadError> {
        let accessor = self.get(&self.root.accessors, index, || field.into())?;
        if accessor.type_ == Checked::Valid(Type::Vec3) {
            let colours = self.vectors::<3>(index, field)?;
            return Ok(colours.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect());
        }
        self.vectors(index, field)
    }

    /// Vertex indices.
    pub fn indices(&self, index: Index<Accessor>, field: &str) -> Result<Vec<u32>, ReadError> {
        let mut indices = Vec::new();
        let accessor = self.get(&self.root.accessors, index, || field.into())?;
        if !matches!(
            accessor.component_type,
            Checked::Valid(GenericComponentType(ComponentType::U8 | ComponentType::U16 | ComponentType::U32))
        ) {
            return Err(self.refuse(field, "indices must be unsigned integers"));
        }
        self.elements(index, field, 1, |i, component, bytes| store(&mut indices, i, integer(component, bytes)))?;
        Ok(indices)
    }

    /// Hands out the bytes of each element in order, then those that a sparse accessor replaces.
    fn elements(
        &self,
        index: Index<Accessor>,
        field: &str,
        components: usize,
        mut take: impl FnMut(usize, ComponentType, &[u8]),
    ) -> Result<(), ReadError> {
        let accessor = self.get(&self.root.accessors, index, || field.into())?;
        let place = || format!("{field} (accessors[{}])", index.value());
        let (Checked::Valid(GenericComponentType(component)), Checked::Valid(kind)) =
            (accessor.component_type, accessor.type_)
        else {
            return Err(self.refuse(&place(), "has an unknown component type or type"));
        };
        if multiplicity(kind) != Some(components) {
            return Err(self.refuse(&place(), format!("has type {kind:?}; {components} numbers each are expected")));
        }
        let count = usize::try_from(accessor.count.0).unwrap_or(usize::MAX);
        if count > ELEMENTS_MAX {
            return Err(self.refuse(&place(), format!("has {count} elements; {ELEMENTS_MAX} is the most")));
        }
        let size = components * component.size();
        match accessor.buffer_view {
            Some(view) => {
                let offset = accessor.byte_offset.unwrap_or_default().0;
                let elements = self.slice(view, offset, count, size, &place)?;
                (0..count).for_each(|i| take(i, component, elements.get(i)));
            }
            None if accessor.sparse.is_some() && count <= ZEROS_MAX => {
                let zero = vec![0; size];
                (0..count).for_each(|i| take(i, component, &zero));
            }
            None => return Err(self.refuse(&place(), "has no bufferView, or too many elements for one without")),
        }
        let Some(sparse) = &accessor.sparse else { return Ok(()) };
        let Checked::Valid(IndexComponentType(index_type)) = sparse.indices.component_type else {
            return Err(self.refuse(&place(), "has sparse indices of an unknown type"));
        };
        let replaced = usize::try_from(sparse.count.0).unwrap_or(usize::MAX);
        let at = &sparse.indices;
        let places = self.slice(at.buffer_view, at.byte_offset.0, replaced, index_type.size(), &place)?;
        let values = self.slice(sparse.values.buffer_view, sparse.values.byte_offset.0, replaced, size, &place)?;
        for i in 0..replaced {
            let target = integer(index_type, places.get(i)) as usize;
            if target >= count {
                return Err(self.refuse(&place(), format!("has a sparse index {target} beyond its {count} elements")));
            }
            take(target, component, values.get(i));
        }
        Ok(())
    }

    /// The bytes of a buffer view.
    pub fn view(&self, view: Index<View>, field: &str) -> Result<&[u8], ReadError> {
        let place = || field.to_owned();
        let length = self.get(&self.root.buffer_views, view, place)?.byte_length.0;
        let elements = self.slice(view, 0, 1, usize::try_from(length).unwrap_or(usize::MAX), &place)?;
        Ok(elements.get(0))
    }

    fn slice(
        &self,
        view: Index<View>,
        offset: u64,
        count: usize,
        size: usize,
        place: &dyn Fn() -> String,
    ) -> Result<Elements<'_>, ReadError> {
        let number = view.value();
        let view = self.get(&self.root.buffer_views, view, place)?;
        let bytes = self.get_buffer(view, place)?;
        // Some exporters write 0 for "closely packed".
        let stride = view.byte_stride.map(|stride| stride.0).filter(|stride| *stride > 0).unwrap_or(size);
        if stride < size && count > 1 {
            return Err(
                self.refuse(&place(), format!("bufferViews[{number}] has a stride of {stride}, less than {size}"))
            );
        }
        let end = (count as u64)
            .checked_sub(1)
            .map_or(Some(0), |steps| steps.checked_mul(stride as u64)?.checked_add(size as u64));
        let end = end.and_then(|end| end.checked_add(offset));
        if end.is_none_or(|end| end > bytes.len() as u64) {
            let message = format!("needs {count} elements of {size} bytes, more than bufferViews[{number}] holds");
            return Err(self.refuse(&place(), message));
        }
        Ok(Elements { bytes: bytes.get(offset as usize..).unwrap_or_default(), stride, size })
    }

    fn get_buffer(&self, view: &View, place: &dyn Fn() -> String) -> Result<&[u8], ReadError> {
        let buffer = self.buffers.get(view.buffer.value());
        let start = view.byte_offset.unwrap_or_default().0;
        let bytes = buffer.and_then(|buffer| {
            let end = start.checked_add(view.byte_length.0)?;
            buffer.get(usize::try_from(start).ok()?..usize::try_from(end).ok()?)
        });
        bytes.ok_or_else(|| self.refuse(&place(), format!("its bufferView leaves buffers[{}]", view.buffer.value())))
    }
}

/// Elements come in order; a sparse one comes again.
fn store<T>(list: &mut Vec<T>, i: usize, value: T) {
    match list.get_mut(i) {
        Some(slot) => *slot = value,
        None => list.push(value),
    }
}

pub(super) fn multiplicity(kind: Type) -> Option<usize> {
    match kind {
        Type::Scalar => Some(1),
        Type::Vec2 => Some(2),
        Type::Vec3 => Some(3),
        Type::Vec4 => Some(4),
        // Of floats: no column of them is padded.
        Type::Mat4 => Some(16),
        Type::Mat2 | Type::Mat3 => None,
    }
}

/// As the specification's section "Animations" defines normalised integers.
fn number(component: ComponentType, normalised: bool, bytes: &[u8]) -> f32 {
    let (value, most) = match component {
        ComponentType::F32 => return f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
        ComponentType::I8 => (f32::from(bytes[0] as i8), 127.0),
        ComponentType::U8 => (f32::from(bytes[0]), 255.0),
        ComponentType::I16 => (f32::from(i16::from_le_bytes([bytes[0], bytes[1]])), 32767.0),
        ComponentType::U16 => (f32::from(u16::from_le_bytes([bytes[0], bytes[1]])), 65535.0),
        ComponentType::U32 => (integer(component, bytes) as f32, 4_294_967_295.0),
    };
    if normalised { (value / most).max(-1.0) } else { value }
}

fn integer(component: ComponentType, bytes: &[u8]) -> u32 {
    match component.size() {
        1 => u32::from(bytes[0]),
        2 => u32::from(u16::from_le_bytes([bytes[0], bytes[1]])),
        _ => u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
    }
}
