//! `igi-master token`: what master and workers have to share, made before either runs.

use anyhow::anyhow;

use crate::cli::TokenArgs;
use crate::failure::{Failure, Success};
use crate::narrator::print;
use crate::network;

/// Prints a fresh token.
///
/// # Errors
/// The system has no random numbers, or the token would live too long.
pub fn token(args: &TokenArgs) -> Result<Success, Failure> {
    let token = network::fresh_token(args.lifetime).map_err(|error| Failure::Failed(anyhow!(error)))?;
    print(&format!("{token}\n"));
    Ok(Success::Done)
}
