//! `igi-master token`: what master and workers have to share, made before either runs, or while they do.

use std::path::Path;

use anyhow::anyhow;
use protocol::identity::Token;
use protocol::token_file::{rotated, write};

use crate::cli::TokenArgs;
use crate::cluster::quic;
use crate::console::print;
use crate::failure::{Failure, Success};
use crate::files::write_secret;

/// Prints a fresh token, and puts it into a file if that is wanted.
///
/// # Errors
/// The system has no random numbers, the token would live too long, or the file cannot be read or written.
pub fn token(args: &TokenArgs) -> Result<Success, Failure> {
    let token = quic::fresh_token(args.lifetime).map_err(|error| Failure::Failed(anyhow!(error)))?;
    if let Some(file) = &args.rotate {
        let until = args.grace.map(|grace| quic::unix_time() + grace.as_secs());
        rotate(file, token.clone(), until).map_err(Failure::Failed)?;
    }
    print(&format!("{token}\n"));
    Ok(Success::Done)
}

/// The file is replaced as a whole, for its owner's eyes only.
fn rotate(file: &Path, token: Token, until: Option<u64>) -> anyhow::Result<()> {
    let before = if file.exists() { quic::rotation::read(file).map_err(|error| anyhow!(error))? } else { Vec::new() };
    let text = write(&rotated(token, before, until, quic::unix_time()));
    write_secret(file, text.as_bytes())
}
