//! `igi-master health`: how another master is.

use anyhow::anyhow;

use crate::cli::HealthArgs;
use runtime::console::print;
use runtime::failure::{Failure, Success};

/// Asks another master how it is.
///
/// # Errors
/// It is not well, or nobody answers.
pub fn health(args: &HealthArgs) -> Result<Success, Failure> {
    let words = health::ask::check(args.address, true).map_err(|reason| Failure::Failed(anyhow!(reason)))?;
    print(&format!("{words}\n"));
    Ok(Success::Done)
}
