//! Unit vectors: octahedral, 2 × 12 bits, as differences to the pixel before.
//!
//! Axes are exact, everything else within 0.06° (Cigolle et al. 2014, "A Survey of Efficient
//! Representations for Independent Unit Vectors").
//!
//! Planes: low bytes of u, low bytes of v, high nibbles of both.

use glam::Vec3;

use super::{PackError, Reader, planes_mut, unzigzag, zigzag};

/// Codes 0 … 4094 stand for −1 … 1, so that 0 has one of its own; 4095 means: no normal.
const ZERO: i32 = 2047;
const NONE: i32 = 4095;
const BITS: u32 = 12;

pub(super) fn write(normals: &[Vec3], out: &mut Vec<u8>) {
    let [low_u, low_v, high] = planes_mut(out, normals.len());
    let mut last = [ZERO; 2];
    for (i, normal) in normals.iter().enumerate() {
        let code = encode(*normal);
        let [u, v] = [0, 1].map(|axis| zigzag(wrap(code[axis] - last[axis])));
        low_u[i] = u as u8;
        low_v[i] = v as u8;
        high[i] = ((u >> 8) << 4 | v >> 8) as u8;
        last = code;
    }
}

pub(super) fn read(from: &mut Reader, len: usize) -> Result<Vec<Vec3>, PackError> {
    let [low_u, low_v, high] = from.planes(len)?;
    let mut last = [ZERO; 2];
    let mut normal = decode(last);
    let next = |((u, v), high): ((&u8, &u8), &u8)| {
        if (*u, *v, *high) != (0, 0, 0) {
            let differences = [u32::from(*u) | u32::from(high >> 4) << 8, u32::from(*v) | u32::from(high & 15) << 8];
            last = [0, 1].map(|axis| (last[axis] + unzigzag(differences[axis])) & ((1 << BITS) - 1));
            normal = decode(last);
        }
        normal
    };
    Ok(low_u.iter().zip(low_v).zip(high).map(next).collect())
}

/// The difference of two codes, modulo 2^12, nearest to 0.
fn wrap(difference: i32) -> i32 {
    (difference << (32 - BITS)) >> (32 - BITS)
}

fn encode(normal: Vec3) -> [i32; 2] {
    let sum = normal.x.abs() + normal.y.abs() + normal.z.abs();
    if !(sum > 0.0 && sum.is_finite()) {
        return [NONE; 2];
    }
    let (x, y) = (normal.x / sum, normal.y / sum);
    let (u, v) = if normal.z >= 0.0 { (x, y) } else { fold(x, y) };
    // To the nearest: truncation after an offset that keeps the number positive.
    [u, v].map(|w| (w * ZERO as f32 + (ZERO as f32 + 0.5)) as i32)
}

fn decode([u, v]: [i32; 2]) -> Vec3 {
    if u == NONE || v == NONE {
        return Vec3::ZERO;
    }
    let [x, y] = [u, v].map(|code| (code - ZERO) as f32 / ZERO as f32);
    let z = 1.0 - x.abs() - y.abs();
    let (x, y) = if z >= 0.0 { (x, y) } else { fold(x, y) };
    Vec3::new(x, y, z).normalize()
}

/// Mirrors the square's corners to its middle and back: the lower half of the octahedron.
fn fold(x: f32, y: f32) -> (f32, f32) {
    ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y))
}
