//! Reads the file of tokens again while the master runs.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use protocol::token_file::{self, BYTES_MAX, Entry};

use super::keys::Keys;
use super::unix_time;

/// The file is looked at this often.
const BETWEEN_LOOKS: Duration = Duration::from_secs(1);

/// The tokens in a file.
///
/// # Errors
/// In words: it cannot be read, or is none.
pub fn read(file: &Path) -> Result<Vec<Entry>, String> {
    let wrong = |reason: String| format!("cannot use the token file {}: {reason}", file.display());
    let text = secrets::file::read(file, BYTES_MAX).map_err(wrong)?;
    token_file::parse(&text).map_err(wrong)
}

/// Follows the file for ever. One that is gone or broken changes nothing, and is complained of once.
pub(super) async fn follow(file: Arc<Path>, keys: Arc<Keys>) {
    let mut last = Ok(Vec::new());
    loop {
        let path = Arc::clone(&file);
        let Ok(found) = tokio::task::spawn_blocking(move || read(&path)).await else { return };
        if found != last {
            let outcome = found.clone().and_then(|entries| keys.replace(entries));
            match outcome {
                Ok(()) if last.as_ref().is_ok_and(Vec::is_empty) => {}
                Ok(()) => tracing::warn!("tokens have changed: {} valid now", keys.tokens().len()),
                Err(reason) => tracing::warn!("{reason}; the tokens stay as they are"),
            }
            last = found;
        }
        keys.tidy(unix_time());
        tokio::time::sleep(BETWEEN_LOOKS).await;
    }
}
