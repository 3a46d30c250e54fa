//! `igi-master token`: what master and workers have to share, made before either runs, or while they do.

use std::path::Path;

use anyhow::{anyhow, ensure};
use protocol::identity::{NoToken, Token};
use protocol::token_file::{Entry, TOKENS_MAX, rotated, write};

use crate::cli::TokenArgs;
use runtime::cluster::quic;
use runtime::console::print;
use runtime::failure::{Failure, Success};
use runtime::files::write_secret;

/// Prints a fresh token, and puts it into a file if that is wanted; or the workers' half of one that there is.
///
/// # Errors
/// The system has no random numbers, the token would live too long, or the file cannot be read or written.
pub fn token(args: &TokenArgs) -> Result<Success, Failure> {
    if let Some(file) = &args.for_workers {
        let whole = given(file.as_deref()).map_err(Failure::Usage)?;
        print(&format!("{}\n", whole.for_workers()));
        return Ok(Success::Done);
    }
    let token = quic::fresh_token(args.lifetime).map_err(|error| Failure::Failed(anyhow!(error)))?;
    if let Some(file) = &args.add {
        add(file, token.clone()).map_err(Failure::Failed)?;
        print(&format!("{}\n", token.for_workers()));
        return Ok(Success::Done);
    }
    if let Some(file) = &args.rotate {
        let until = args.grace.map(|grace| quic::unix_time() + grace.as_secs());
        rotate(file, token.clone(), until).map_err(Failure::Failed)?;
    }
    print(&format!("{token}\n"));
    Ok(Success::Done)
}

/// The first token of a file, or that of the environment.
fn given(file: Option<&Path>) -> Result<Token, String> {
    match file {
        Some(file) => Ok(quic::rotation::read(file)?.remove(0).token),
        None => {
            let text = std::env::var("IGI_TOKEN").map_err(|_| "--for-workers wants a FILE, or a token in IGI_TOKEN")?;
            text.parse().map_err(|error: NoToken| error.to_string())
        }
    }
}

/// The file is replaced as a whole, for its owner's eyes only.
fn rotate(file: &Path, token: Token, until: Option<u64>) -> anyhow::Result<()> {
    let text = write(&rotated(token, entries(file)?, until, quic::unix_time()));
    write_secret(file, text.as_bytes())
}

/// As [`rotate`], but the others stay as they are, and before it.
fn add(file: &Path, token: Token) -> anyhow::Result<()> {
    let mut entries = entries(file)?;
    ensure!(entries.len() < TOKENS_MAX, "{}: has {TOKENS_MAX} tokens, which is the most", file.display());
    entries.push(Entry { token, until: None });
    write_secret(file, write(&entries).as_bytes())
}

/// What is in a file; nothing, if there is none.
fn entries(file: &Path) -> anyhow::Result<Vec<Entry>> {
    if file.exists() { quic::rotation::read(file).map_err(|error| anyhow!(error)) } else { Ok(Vec::new()) }
}
