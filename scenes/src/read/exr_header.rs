//! What an EXR claims of itself, checked before memory is spent on it.

use exr::meta::MetaData;

/// Bytes that a byte of the file can stand for: the best that deflate does, the tightest of the format's lossless kinds.
const SQUEEZED_MAX: u64 = 1032;

/// Checks the sizes that an EXR's header claims: sides, and that the file can hold so many pixels.
///
/// # Errors
/// In words: it is no EXR, its picture has no pixels, more than `side_max` to a side, or more than the file can hold.
pub fn check_exr(bytes: &[u8], side_max: u32) -> Result<(), String> {
    let meta = MetaData::read_from_buffered(bytes, false).map_err(|error| error.to_string())?;
    for header in &meta.headers {
        let [width, height] = [header.layer_size.0, header.layer_size.1].map(|side| side as u64);
        if width == 0 || height == 0 {
            return Err("it has no pixels".into());
        }
        if width.max(height) > u64::from(side_max) {
            return Err(format!("it is larger than {side_max} pixels to a side; shrink it"));
        }
        let claimed = width.saturating_mul(height).saturating_mul(header.channels.bytes_per_pixel as u64);
        if claimed > (bytes.len() as u64).saturating_mul(SQUEEZED_MAX) {
            return Err(format!("it claims {width}x{height} pixels, which its {} bytes cannot hold", bytes.len()));
        }
    }
    Ok(())
}
