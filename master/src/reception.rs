//! What is told to those who could come: how to start a worker, where the master is, how it is.

use serde_json::json;
use vitals::Server;

use crate::announce::Announcement;
use crate::cli::HandsArgs;
use crate::cluster::Cluster;
use crate::narrator::Narrator;
use crate::pulse;

/// Open until it is dropped.
pub struct Reception {
    _vitals: Option<Server>,
    _announcement: Option<Announcement>,
}

impl Reception {
    /// Says and does what the command line wants said and done.
    ///
    /// # Errors
    /// The address of `--metrics` cannot be listened at.
    pub fn open(hands: &HandsArgs, cluster: &Cluster, narrator: &Narrator) -> anyhow::Result<Self> {
        if let Some(line) = cluster.join_line() {
            narrator.say(&format!("to start a worker: {line}"));
            narrator.emit("listening", json!({ "join": line }));
        }
        let place = cluster.token().zip(cluster.address()).filter(|_| !hands.no_announce);
        let announcement = place.and_then(|(token, address)| match Announcement::begin(token, address) {
            Ok(announcement) => Some(announcement),
            Err(reason) => {
                // Workers that are told where we are do not need it.
                tracing::warn!("this master cannot be found by DNS-SD: {reason}");
                None
            }
        });
        Ok(Self { _vitals: pulse::watch(hands, cluster, narrator)?, _announcement: announcement })
    }
}
