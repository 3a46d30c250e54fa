//! Virtual lights: they are few and only looked at, so every number goes as it is.
//!
//! ```text
//! lights := count u32 , ( position 3 × f32 , normal 3 × f32 , strength 3 × f32 , depth u16 ) × count
//! ```

use glam::Vec3;

use super::{LIGHTS, PackError, Reader};
use crate::answer::{LIGHTS_MAX, LightPoint};

/// Bytes of one light.
const LIGHT: usize = 9 * size_of::<f32>() + size_of::<u16>();

/// The most bytes that [`write`] makes.
pub(super) const PACKED_MAX: usize = 1 + size_of::<u32>() + LIGHT * LIGHTS_MAX;

/// Leaves out lights with a number that is not finite or a negative strength, and counts them.
pub(super) fn drop_unsound(lights: &mut Vec<LightPoint>) -> u64 {
    let before = lights.len();
    lights.retain(is_sound);
    (before - lights.len()) as u64
}

fn is_sound(light: &LightPoint) -> bool {
    let LightPoint { position, normal, strength, .. } = light;
    [position, normal, strength].into_iter().all(|v| v.is_finite()) && strength.min_element() >= 0.0
}

/// Lays out the first [`LIGHTS_MAX`] lights.
pub(super) fn write(lights: &[LightPoint]) -> Vec<u8> {
    let lights = &lights[..lights.len().min(LIGHTS_MAX)];
    let mut out = vec![LIGHTS];
    out.extend((lights.len() as u32).to_le_bytes());
    for LightPoint { position, normal, strength, depth } in lights {
        let numbers = [position, normal, strength].into_iter().flat_map(|v| v.to_array());
        out.extend(numbers.flat_map(f32::to_le_bytes));
        out.extend(depth.to_le_bytes());
    }
    out
}

/// Reads what [`write`] wrote.
pub(super) fn read(from: &mut Reader) -> Result<Vec<LightPoint>, PackError> {
    if from.u8()? != LIGHTS {
        return Err(PackError::OtherFields);
    }
    let count = from.u32()? as usize;
    if count > LIGHTS_MAX {
        return Err(PackError::Invalid("more virtual lights than allowed"));
    }
    // All bytes are there before anything is made of them.
    let mut bytes = Reader { bytes: from.take(count * LIGHT)? };
    let mut light = || {
        let mut vector = || Ok(Vec3::new(bytes.f32()?, bytes.f32()?, bytes.f32()?));
        let (position, normal, strength) = (vector()?, vector()?, vector()?);
        let light = LightPoint { position, normal, strength, depth: bytes.array().map(u16::from_le_bytes)? };
        let sound = is_sound(&light);
        sound.then_some(light).ok_or(PackError::Invalid("a virtual light that is negative or not finite"))
    };
    (0..count).map(|_| light()).collect()
}
