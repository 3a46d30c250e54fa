//! How a worker is started for this master: the line to copy, and where its token is.
//!
//! A token that somebody has given us is never shown. One that was made for this run is shown to whoever sits at this
//! terminal, and is kept in a file for its owner's eyes only, so that logs and programs need nothing but its name.

use std::io::IsTerminal;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};

use protocol::identity::Token;
use serde_json::json;

use crate::cluster::Cluster;
use crate::console::Console;
use crate::files::write_secret;

/// Where the token came from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Origin {
    /// It is in a file of the user's.
    File(PathBuf),
    /// It was in the environment.
    Environment,
    /// It was made for this run.
    Fresh,
}

/// Open until it is dropped.
#[derive(Debug)]
pub struct Invitation {
    /// Where the token of this run is kept, if it is one.
    kept: Option<(PathBuf, Token)>,
}

impl Invitation {
    /// Says how a worker is started, if the cluster listens: there, or where it should be looked for.
    pub fn extend(origin: &Origin, there: Option<&str>, cluster: &Cluster, console: &Console) -> Option<Self> {
        // Who joins cannot take the master's place.
        let (master, token) = (cluster.reachable()?, cluster.token()?.for_workers());
        let port = master.port();
        let master = there.map_or_else(|| master.to_string(), str::to_owned);
        let kept = if *origin == Origin::Fresh { keep(&token, port) } else { None };
        let file = match origin {
            Origin::File(file) => std::path::absolute(file).ok(),
            Origin::Environment | Origin::Fresh => kept.clone(),
        };
        let told = line(&master, origin, file.as_deref(), &token);
        let shown = if *origin == Origin::Fresh && std::io::stderr().is_terminal() {
            line(&master, origin, None, &token)
        } else {
            told.clone()
        };
        console.line(&format!("to start a worker: {shown}{}", remark(origin, &shown)));
        let file = file.map(|file| file.display().to_string());
        console.emit("listening", json!({ "join": told, "master": master, "token_file": file }));
        Some(Self { kept: kept.map(|file| (file, token)) })
    }
}

impl Drop for Invitation {
    fn drop(&mut self) {
        let Some((file, token)) = self.kept.take() else { return };
        // Another master may have taken its place.
        if std::fs::read_to_string(&file).is_ok_and(|text| text.trim() == token.to_string()) {
            let _ = std::fs::remove_file(&file);
        }
    }
}

/// The command that starts a worker.
fn line(master: &str, origin: &Origin, file: Option<&Path>, token: &Token) -> String {
    match (file, origin) {
        (Some(file), _) => format!("igi-worker --master {master} --token-file {}", quoted(file)),
        (None, Origin::Fresh) => format!("IGI_TOKEN={token} igi-worker --master {master}"),
        (None, Origin::File(_) | Origin::Environment) => format!("igi-worker --master {master}"),
    }
}

/// What else there is to know about it.
fn remark(origin: &Origin, line: &str) -> &'static str {
    match origin {
        Origin::Environment => {
            "   (with IGI_TOKEN in its environment: the workers' half, by `igi-master token --for-workers`)"
        }
        Origin::Fresh if line.contains("--token-file") => "   (on other machines, with a copy of that file)",
        Origin::File(_) => {
            "   (on other machines, with a file of the workers' half, by `igi-master token --for-workers FILE`)"
        }
        Origin::Fresh => "",
    }
}

/// A word of a shell.
fn quoted(path: &Path) -> String {
    let text = path.display().to_string();
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "/._-+:@%".contains(c);
    if text.chars().all(is_plain) { text } else { format!("'{}'", text.replace('\'', "'\\''")) }
}

/// Keeps the token of the master at this port in a file; `None` if there is no place for it.
fn keep(token: &Token, port: u16) -> Option<PathBuf> {
    let text = format!("{token}\n");
    homes(|name| std::env::var_os(name).map(PathBuf::from)).into_iter().find_map(|home| {
        let folder = home.join("igi");
        std::fs::DirBuilder::new().recursive(true).mode(0o700).create(&folder).ok()?;
        let file = folder.join(format!("{port}.token"));
        write_secret(&file, text.as_bytes()).ok()?;
        Some(file)
    })
}

/// Where programs may keep what belongs to this user alone (XDG base directories), the shortest-lived first.
fn homes(variable: impl Fn(&str) -> Option<PathBuf>) -> Vec<PathBuf> {
    let state = variable("XDG_STATE_HOME").or_else(|| Some(variable("HOME")?.join(".local/state")));
    let homes = [variable("XDG_RUNTIME_DIR"), state];
    homes.into_iter().flatten().filter(|home| home.is_absolute()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_that_were_given_are_not_in_the_line_and_paths_are_words() {
        let token = Token { fingerprint: [1; 16], secret: [2; 16], expires: None, own: None };
        let master = "10.0.0.1:7464";
        let file = Path::new("/home/me/a token's file");
        let of = |origin, file| line(master, &origin, file, &token);
        assert_eq!(of(Origin::Environment, None), "igi-worker --master 10.0.0.1:7464");
        assert_eq!(
            of(Origin::File(file.into()), Some(file)),
            r"igi-worker --master 10.0.0.1:7464 --token-file '/home/me/a token'\''s file'"
        );
        let fresh = of(Origin::Fresh, None);
        assert_eq!(fresh, format!("IGI_TOKEN={token} igi-worker --master 10.0.0.1:7464"));
        assert_eq!(
            of(Origin::Fresh, Some(Path::new("/run/t"))),
            "igi-worker --master 10.0.0.1:7464 --token-file /run/t"
        );
    }

    #[test]
    fn places_for_secrets_are_those_of_the_user() {
        let homes = |set: &[(&str, &str)]| {
            let find = |name: &str| set.iter().find(|(known, _)| *known == name).map(|(_, value)| PathBuf::from(value));
            homes(find).iter().map(|home| home.display().to_string()).collect::<Vec<_>>()
        };
        assert_eq!(homes(&[("HOME", "/h"), ("XDG_RUNTIME_DIR", "/r")]), ["/r", "/h/.local/state"]);
        assert_eq!(homes(&[("HOME", "/h"), ("XDG_STATE_HOME", "/s")]), ["/s"]);
        assert!(homes(&[("XDG_RUNTIME_DIR", "relative")]).is_empty());
    }
}
