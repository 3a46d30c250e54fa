//! How much a scene may be. Files beyond these bounds are refused in words before memory is spent.

use std::fs;
use std::path::Path;

use super::ReadError;

/// Largest file of any kind, bytes.
pub(super) const FILE_BYTES_MAX: u64 = 4 << 30;
/// Largest texture, texels to a side: 16384² texels are 1 GiB, or 3 GiB where they are floats.
pub(super) const TEXTURE_SIDE_MAX: u32 = 16384;
/// Most texture memory of a scene, bytes.
pub(super) const TEXTURE_BYTES_MAX: u64 = 8 << 30;
/// Most triangles of a scene, instances not counted.
pub(super) const TRIANGLES_MAX: usize = 1 << 28;
/// Most objects of a scene.
pub(super) const OBJECTS_MAX: usize = 1 << 20;
/// Most corners of one face that is not convex: triangulating it takes the square of this.
pub(super) const CONCAVE_CORNERS_MAX: usize = 1024;
/// Longest side of a picture, pixels.
pub(super) const PICTURE_SIDE_MAX: u32 = 65536;
/// Most angles of one kind in a file of photometric data …
pub(super) const ANGLES_MAX: usize = 4096;
/// … most intensities …
pub(super) const INTENSITIES_MAX: usize = 1 << 20;
/// … and largest such file, bytes.
pub(super) const PHOTOMETRY_BYTES_MAX: usize = 32 << 20;

/// The whole file, or a message that names it.
pub(super) fn read_bytes(path: &Path) -> Result<Vec<u8>, ReadError> {
    let io = |source: std::io::Error| match source.kind() {
        std::io::ErrorKind::NotFound => ReadError::Missing(path.into()),
        _ => ReadError::Io { path: path.into(), source },
    };
    let meta = fs::metadata(path).map_err(io)?;
    if meta.is_dir() {
        return Err(ReadError::file(path, "is a folder where a file is expected"));
    }
    if meta.len() > FILE_BYTES_MAX {
        let gib = FILE_BYTES_MAX >> 30;
        return Err(ReadError::file(path, format!("has {} bytes; {gib} GiB is the most a file may have", meta.len())));
    }
    fs::read(path).map_err(io)
}
