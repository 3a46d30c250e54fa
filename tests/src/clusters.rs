//! Clusters of this process, with workers that are processes of their own.

use std::time::{Duration, Instant};

use master::cluster::{Cluster, Status};

use crate::programs::PATIENCE;

/// Lets a cluster go on until its status is as it should be.
///
/// # Panics
/// If that takes longer than [`PATIENCE`].
pub fn wait_for(cluster: &mut Cluster, what: &str, enough: impl Fn(&Status) -> bool) -> Status {
    let deadline = Instant::now() + PATIENCE;
    loop {
        let status = cluster.status();
        if enough(&status) {
            return status;
        }
        assert!(Instant::now() < deadline, "waited in vain for {what}: {status:?}");
        cluster.next(Duration::from_millis(10));
    }
}
