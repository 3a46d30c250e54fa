//! Checkpoints as bytes: what a picture is, what is known of it, and a digest of both.
//!
//! ```text
//! magic , SHA-256 of what is being drawn , contents , SHA-256 of all before
//! ```

use sha2::{Digest, Sha256};

use crate::front_end::NoCheckpoint;

const DIGEST: usize = 32;

/// Makes a checkpoint. `magic` tells method and format, `identity` is a text that only pictures have in common whose
/// samples may be added up.
pub fn seal(magic: &[u8], identity: &str, contents: &[u8]) -> Vec<u8> {
    let mut bytes = [magic, &Sha256::digest(identity), contents].concat();
    let digest = Sha256::digest(&bytes);
    bytes.extend(digest);
    bytes
}

/// The contents of a checkpoint of this picture.
///
/// # Errors
/// [`NoCheckpoint`]: the bytes are damaged, of another format, or of another picture.
pub fn open<'a>(magic: &[u8], identity: &str, bytes: &'a [u8]) -> Result<&'a [u8], NoCheckpoint> {
    let (sealed, digest) = bytes.split_last_chunk::<DIGEST>().ok_or(NoCheckpoint::Broken)?;
    if Sha256::digest(sealed)[..] != digest[..] {
        return Err(NoCheckpoint::Broken);
    }
    let rest = sealed.strip_prefix(magic).ok_or(NoCheckpoint::Broken)?;
    let (own, contents) = rest.split_first_chunk::<DIGEST>().ok_or(NoCheckpoint::Broken)?;
    if own[..] != Sha256::digest(identity)[..] {
        return Err(NoCheckpoint::Another);
    }
    Ok(contents)
}
