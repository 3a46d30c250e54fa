//! EXT_meshopt_compression: numbers of vertices, and indices, as meshoptimizer packs them (the extension's appendices A and
//! B). No crate that is kept up decodes them without a C++ compiler.

use std::ops::Range;

/// What a buffer view's bytes are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mode {
    Attributes,
    Triangles,
    Indices,
}

/// What is done to unpacked numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Filter {
    None,
    Octahedral,
    Quaternion,
    Exponential,
}

/// `count` elements of `stride` bytes; `None` if the bytes are no such thing.
pub(super) fn decode(bytes: &[u8], count: usize, stride: usize, mode: Mode, filter: Filter) -> Option<Vec<u8>> {
    let indices = |indices: Vec<u32>| match stride {
        2 => indices.iter().flat_map(|index| (*index as u16).to_le_bytes()).collect(),
        _ => indices.iter().flat_map(|index| index.to_le_bytes()).collect(),
    };
    match mode {
        Mode::Attributes => {
            let mut unpacked = attributes(bytes, count, stride)?;
            undo(&mut unpacked, stride, filter)?;
            Some(unpacked)
        }
        _ if stride != 2 && stride != 4 => None,
        Mode::Triangles => triangles(bytes, count).map(indices),
        Mode::Indices => sequence(bytes, count).map(indices),
    }
}

/// Bytes that are read one after another.
struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    fn byte(&mut self) -> Option<u8> {
        self.at += 1;
        self.bytes.get(self.at - 1).copied()
    }

    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let taken = self.bytes.get(self.at..self.at.checked_add(count)?)?;
        self.at += count;
        Some(taken)
    }

    /// Seven bits a byte, the lowest first.
    fn number(&mut self) -> Option<u32> {
        let mut number = 0;
        for shift in (0..35).step_by(7) {
            let byte = self.byte()?;
            number |= u32::from(byte & 127).wrapping_shl(shift);
            if byte < 128 {
                break;
            }
        }
        Some(number)
    }
}

/// What is stored as 0, 1, 2, 3 … is 0, −1, 1, −2 …
fn signed(stored: u32) -> u32 {
    (stored >> 1) ^ (stored & 1).wrapping_neg()
}

/// Elements in a group of one mode.
const GROUP: usize = 16;

fn attributes(bytes: &[u8], count: usize, stride: usize) -> Option<Vec<u8>> {
    if stride == 0 || stride > 256 || !stride.is_multiple_of(4) {
        return None;
    }
    let tail = stride.max(32);
    let body = bytes.len().checked_sub(tail)?;
    let mut reader = Reader { bytes: &bytes[..body], at: 0 };
    if reader.byte()? != 0xa0 {
        return None;
    }
    let mut last = bytes[bytes.len() - stride..].to_vec();
    // A byte of the file stands for no more than a group's sixteen of one column, times its four in a header.
    if count.checked_mul(stride)? > bytes.len().checked_mul(64)? {
        return None;
    }
    let mut unpacked = vec![0; count * stride];
    let most = ((8192 / stride) & !(GROUP - 1)).min(256);
    for first in (0..count).step_by(most) {
        let block = first..(first + most).min(count);
        for (column, last) in last.iter_mut().enumerate() {
            column_of(&mut reader, &mut unpacked, block.clone(), (column, stride), last)?;
        }
    }
    Some(unpacked)
}

/// One byte of each element of a block, as differences to the one before.
fn column_of(
    reader: &mut Reader,
    unpacked: &mut [u8],
    block: Range<usize>,
    (column, stride): (usize, usize),
    last: &mut u8,
) -> Option<()> {
    let groups = block.len().div_ceil(GROUP);
    let modes = reader.take(groups.div_ceil(4))?;
    for group in 0..groups {
        let mode = modes[group / 4] >> (group % 4 * 2) & 3;
        let deltas = group_of(reader, mode)?;
        let start = block.start + group * GROUP;
        for (element, delta) in (start..block.end.min(start + GROUP)).zip(deltas) {
            *last = last.wrapping_add((delta >> 1) ^ (delta & 1).wrapping_neg());
            unpacked[element * stride + column] = *last;
        }
    }
    Some(())
}

fn group_of(reader: &mut Reader, mode: u8) -> Option<[u8; GROUP]> {
    let mut deltas = [0; GROUP];
    let bits = match mode {
        0 => return Some(deltas),
        1 => 2,
        2 => 4,
        _ => return reader.take(GROUP)?.try_into().ok(),
    };
    let packed = reader.take(GROUP * bits / 8)?;
    let most = (1 << bits) - 1;
    for (i, delta) in deltas.iter_mut().enumerate() {
        let at = i * bits;
        let value = packed[at / 8] >> (8 - bits - at % 8) & most;
        *delta = if value == most { reader.byte()? } else { value };
    }
    Some(deltas)
}

/// Rings of what came last.
#[derive(Default)]
struct Recent {
    edges: [[u32; 2]; 16],
    vertices: [u32; 16],
    edge: usize,
    vertex: usize,
    next: u32,
    last: u32,
}

impl Recent {
    fn edge(&self, back: u8) -> [u32; 2] {
        self.edges[self.edge.wrapping_sub(usize::from(back)) & 15]
    }

    fn vertex(&self, back: u8) -> u32 {
        self.vertices[self.vertex.wrapping_sub(usize::from(back)) & 15]
    }

    fn new_vertex(&mut self) -> u32 {
        self.next = self.next.wrapping_add(1);
        self.next.wrapping_sub(1)
    }

    fn far_vertex(&mut self, reader: &mut Reader) -> Option<u32> {
        self.last = self.last.wrapping_add(signed(reader.number()?));
        Some(self.last)
    }

    fn push(&mut self, vertex: u32, is_new: bool) {
        self.vertices[self.vertex & 15] = vertex;
        self.vertex += usize::from(is_new);
    }

    fn push_edges(&mut self, edges: &[[u32; 2]]) {
        for edge in edges {
            self.edges[self.edge & 15] = *edge;
            self.edge += 1;
        }
    }
}

fn triangles(bytes: &[u8], count: usize) -> Option<Vec<u32>> {
    let codes = bytes.get(1..1 + count / 3)?;
    if !count.is_multiple_of(3) || bytes[0] != 0xe1 {
        return None;
    }
    let body = bytes.len().checked_sub(16).filter(|body| *body > codes.len())?;
    let table = &bytes[body..];
    let mut reader = Reader { bytes: &bytes[..body], at: 1 + codes.len() };
    let mut recent = Recent { edges: [[u32::MAX; 2]; 16], vertices: [u32::MAX; 16], ..Recent::default() };
    let mut indices = Vec::with_capacity(count);
    for &code in codes {
        if code < 0xf0 {
            let ([a, b], third) = (recent.edge((code >> 4) + 1), code & 15);
            let (c, is_new) = match third {
                0 => (recent.new_vertex(), true),
                1..13 => (recent.vertex(third + 1), false),
                15 => (recent.far_vertex(&mut reader)?, true),
                // 13 and 14: the one before, or behind, the last far one.
                _ => {
                    recent.last = if third == 13 { recent.last.wrapping_sub(1) } else { recent.last.wrapping_add(1) };
                    (recent.last, true)
                }
            };
            indices.extend([a, b, c]);
            recent.push(c, is_new);
            recent.push_edges(&[[c, b], [a, c]]);
            continue;
        }
        let in_table = code < 0xfe;
        let rest = if in_table { table[usize::from(code & 15)] } else { reader.byte()? };
        let (first_far, second, third) = (code == 0xff, rest >> 4, rest & 15);
        if !in_table && rest == 0 {
            recent.next = 0;
        }
        let a = if first_far { 0 } else { recent.new_vertex() };
        let near = |recent: &mut Recent, which: u8| match which {
            0 => recent.new_vertex(),
            which => recent.vertex(which),
        };
        let (b, c) = (near(&mut recent, second), near(&mut recent, third));
        let mut far = |is_far: bool, known: u32| if is_far { recent.far_vertex(&mut reader) } else { Some(known) };
        let (a, b, c) = (far(first_far, a)?, far(!in_table && second == 15, b)?, far(!in_table && third == 15, c)?);
        indices.extend([a, b, c]);
        recent.push(a, true);
        recent.push(b, second == 0 || (!in_table && second == 15));
        recent.push(c, third == 0 || (!in_table && third == 15));
        recent.push_edges(&[[b, a], [c, b], [a, c]]);
    }
    Some(indices)
}

fn sequence(bytes: &[u8], count: usize) -> Option<Vec<u32>> {
    let body = bytes.len().checked_sub(4)?;
    let mut reader = Reader { bytes: &bytes[..body], at: 0 };
    if reader.byte()? != 0xd1 || count > bytes.len() {
        return None;
    }
    let mut last = [0_u32; 2];
    let mut next = || {
        let number = reader.number()?;
        let last = &mut last[(number & 1) as usize];
        *last = last.wrapping_add(signed(number >> 1));
        Some(*last)
    };
    (0..count).map(|_| next()).collect()
}

/// Turns filtered numbers into what they mean; `None` if a filter does not go with the stride.
fn undo(bytes: &mut [u8], stride: usize, filter: Filter) -> Option<()> {
    let nearest = |value: f32| value.round() as i32;
    let i16_at = |element: &[u8], k: usize| i16::from_le_bytes([element[2 * k], element[2 * k + 1]]);
    match (filter, stride) {
        (Filter::None, _) => {}
        (Filter::Octahedral, 4) => bytes.chunks_exact_mut(4).for_each(|element| {
            let [x, y, one] = [0, 1, 2].map(|k| f32::from(element[k] as i8));
            let unfolded = unfold([x, y, one], 127.0).map(nearest);
            (0..3).for_each(|k| element[k] = unfolded[k] as i8 as u8);
        }),
        (Filter::Octahedral, 8) => bytes.chunks_exact_mut(8).for_each(|element| {
            let numbers = [0, 1, 2].map(|k| f32::from(i16_at(element, k)));
            let unfolded = unfold(numbers, 32767.0).map(nearest);
            (0..3).for_each(|k| element[2 * k..2 * k + 2].copy_from_slice(&(unfolded[k] as i16).to_le_bytes()));
        }),
        (Filter::Quaternion, 8) => bytes.chunks_exact_mut(8).for_each(|element| {
            let last = i16_at(element, 3);
            let scale = std::f32::consts::FRAC_1_SQRT_2 / f32::from(last | 3);
            let [x, y, z] = [0, 1, 2].map(|k| f32::from(i16_at(element, k)) * scale);
            let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
            let largest = (last & 3) as usize;
            for (step, part) in [w, x, y, z].into_iter().enumerate() {
                let k = (largest + step) & 3;
                element[2 * k..2 * k + 2].copy_from_slice(&(nearest(part * 32767.0) as i16).to_le_bytes());
            }
        }),
        (Filter::Exponential, stride) if stride % 4 == 0 => bytes.chunks_exact_mut(4).for_each(|element| {
            let stored = i32::from_le_bytes([element[0], element[1], element[2], element[3]]);
            let (mantissa, exponent) = (stored << 8 >> 8, stored >> 24);
            let value = libm::ldexpf(mantissa as f32, exponent);
            element.copy_from_slice(&value.to_le_bytes());
        }),
        _ => return None,
    }
    Some(())
}

/// A unit vector, times `most`, of its octahedral form.
fn unfold([x, y, one]: [f32; 3], most: f32) -> [f32; 3] {
    let z = one - x.abs() - y.abs();
    let fold = z.min(0.0);
    let (x, y) = (x + if x >= 0.0 { fold } else { -fold }, y + if y >= 0.0 { fold } else { -fold });
    let length = (x * x + y * y + z * z).sqrt();
    if length > 0.0 { [x, y, z].map(|part| part * most / length) } else { [0.0, 0.0, most] }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From meshoptimizer's own tests.
    const TRIANGLES: [u8; 24] = [
        0xe1, 0xf0, 0x10, 0xfe, 0x1f, 0x3d, 0x00, 0x0a, 0x00, 0x76, 0x87, 0x56, 0x67, 0x78, 0xa9, 0x86, 0x65, 0x89,
        0x68, 0x98, 0x01, 0x69, 0x00, 0x00,
    ];
    const SEQUENCE: [u8; 13] = [0xd1, 0x00, 0x04, 0xcd, 0x01, 0x04, 0x07, 0x98, 0x1f, 0x00, 0x00, 0x00, 0x00];
    /// Four vertices: three 16-bit numbers of a place, two bytes of a normal, two 16-bit numbers of texture coordinates.
    const ATTRIBUTES: [u8; 85] = [
        0xa0, 0x01, 0x3f, 0x00, 0x00, 0x00, 0x58, 0x57, 0x58, 0x01, 0x26, 0x00, 0x00, 0x00, 0x01, 0x0c, 0x00, 0x00,
        0x00, 0x58, 0x01, 0x08, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x01, 0x3f, 0x00, 0x00, 0x00, 0x17, 0x18,
        0x17, 0x01, 0x26, 0x00, 0x00, 0x00, 0x01, 0x0c, 0x00, 0x00, 0x00, 0x17, 0x01, 0x08, 0x00, 0x00, 0x00, 0x00,
        0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
        0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
    ];

    #[test]
    fn what_meshoptimizer_packs_is_unpacked() {
        assert_eq!(triangles(&TRIANGLES, 15).unwrap(), [0, 1, 2, 2, 1, 3, 0, 1, 2, 2, 1, 5, 2, 1, 4]);
        assert_eq!(sequence(&SEQUENCE, 6).unwrap(), [0, 1, 51, 2, 49, 1000]);
        let unpacked = attributes(&ATTRIBUTES, 4, 12).unwrap();
        let numbers: Vec<u16> = unpacked.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect();
        let expected = [[0, 0, 0, 0, 0, 0], [300, 0, 0, 0, 500, 0], [0, 300, 0, 0, 0, 500], [300, 300, 0, 0, 500, 500]];
        assert_eq!(numbers, expected.as_flattened());
    }

    #[test]
    fn filters_give_unit_vectors_and_powers() {
        let mut normal = [0, 0, 127, 7];
        undo(&mut normal, 4, Filter::Octahedral).unwrap();
        assert_eq!(normal, [0, 0, 127, 7]);
        let mut below = [127_i8 as u8, 0, 127, 0];
        undo(&mut below, 4, Filter::Octahedral).unwrap();
        assert_eq!(below, [127, 0, 0, 0]);
        let mut half = (0xff_00_00_03_u32).to_le_bytes();
        undo(&mut half, 4, Filter::Exponential).unwrap();
        assert_eq!(f32::from_le_bytes(half), 1.5);
        // The largest part is left out: here the first.
        let mut none: [u8; 8] = [0, 0, 0, 0, 0, 0, 0xfc, 0x7f];
        undo(&mut none, 8, Filter::Quaternion).unwrap();
        assert_eq!(none, [0xff, 0x7f, 0, 0, 0, 0, 0, 0]);
    }

    #[test]
    fn broken_bytes_are_refused() {
        for length in 0..TRIANGLES.len() {
            assert!(triangles(&TRIANGLES[..length], 15).is_none_or(|indices| indices.len() == 15));
        }
        for length in 0..ATTRIBUTES.len() {
            let _ = attributes(&ATTRIBUTES[..length], 4, 12);
        }
        assert_eq!(attributes(&ATTRIBUTES, usize::MAX, 12), None);
        assert_eq!(decode(&SEQUENCE, 6, 3, Mode::Indices, Filter::None), None);
    }
}
