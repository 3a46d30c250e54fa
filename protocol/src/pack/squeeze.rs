//! LZ4 for the way over the network, with a declared and bounded raw length.
//!
//! ```text
//! squeezed := raw length u32 , kind u8 (0 raw, 1 LZ4 block) , bytes
//! ```

use super::PackError;

const HEADER: usize = 5;
const RAW: u8 = 0;
const LZ4: u8 = 1;

/// Compresses a block of less than 4 GiB; sends it raw where it does not shrink.
pub fn compress(raw: &[u8]) -> Vec<u8> {
    let mut out = vec![0; HEADER + lz4_flex::block::get_maximum_output_size(raw.len())];
    out[..4].copy_from_slice(&(raw.len() as u32).to_le_bytes());
    match lz4_flex::block::compress_into(raw, &mut out[HEADER..]) {
        Ok(length) if length < raw.len() => {
            out[4] = LZ4;
            out.truncate(HEADER + length);
        }
        _ => {
            out[4] = RAW;
            out.truncate(HEADER);
            out.extend_from_slice(raw);
        }
    }
    out
}

/// Undoes [`compress`].
///
/// # Errors
/// [`PackError`] for anything else, and before anything is allocated if more than `limit` bytes are declared.
pub fn decompress(squeezed: &[u8], limit: usize) -> Result<Vec<u8>, PackError> {
    let Some((header, body)) = squeezed.split_first_chunk::<HEADER>() else {
        return Err(PackError::Cut { needed: HEADER, got: squeezed.len() });
    };
    let [a, b, c, d, kind] = *header;
    let claimed = u32::from_le_bytes([a, b, c, d]) as usize;
    if claimed > limit {
        return Err(PackError::TooLong { claimed, limit });
    }
    match kind {
        RAW if body.len() == claimed => Ok(body.to_vec()),
        LZ4 => {
            // LZ4 gains at most 255:1. A short block cannot make us reserve much.
            if claimed / 255 > body.len() {
                return Err(PackError::Broken);
            }
            let mut raw = vec![0; claimed];
            match lz4_flex::block::decompress_into(body, &mut raw) {
                Ok(length) if length == claimed => Ok(raw),
                _ => Err(PackError::Broken),
            }
        }
        _ => Err(PackError::Broken),
    }
}
