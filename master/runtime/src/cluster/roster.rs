//! Who works, in words and for programs: each worker's state, and why it is not well if it is not.

use std::collections::{BTreeMap, BTreeSet};

use protocol::message::Behind;
use protocol::schedule::WorkerState;
use serde_json::{Value, json};

use crate::cluster::{Status, WorkerInfo};

/// Remembers how the workers were, to tell what is new.
#[derive(Debug, Default)]
pub struct Roster(BTreeMap<u32, (WorkerState, Option<Behind>)>);

impl Roster {
    /// Workers whose state has changed since the last call, or who is behind them. Who has gone has an event of its own.
    pub fn news<'a>(&mut self, status: &'a Status) -> Vec<&'a WorkerInfo> {
        let there: BTreeSet<u32> = status.list.iter().map(|info| info.worker).collect();
        self.0.retain(|worker, _| there.contains(worker));
        let changed = |info: &&WorkerInfo| {
            let now = (info.state, info.behind);
            self.0.insert(info.worker, now) != Some(now)
        };
        status.list.iter().filter(changed).collect()
    }
}

/// All workers in one phrase: `2 workers on 5 threads, 1 fetching 43 %, 1 quarantined`.
pub fn summary(status: &Status) -> String {
    let plural = |count: usize, one: &str| format!("{count} {one}{}", if count == 1 { "" } else { "s" });
    let able = |info: &&WorkerInfo| matches!(info.state, WorkerState::Ready | WorkerState::Slow);
    let threads = status.list.iter().filter(able).map(|info| info.threads).sum();
    let mut line = format!("{} on {}", plural(status.ready, "worker"), plural(threads, "thread"));
    let behind: Vec<_> = status.list.iter().filter_map(|info| info.behind).collect();
    if !behind.is_empty() {
        let workers = behind.iter().map(|behind| behind.workers as usize).sum();
        line += &format!(" ({} with {} behind)", plural(behind.len(), "relay"), plural(workers, "worker"));
    }
    let mut others: BTreeMap<String, usize> = BTreeMap::new();
    for info in status.list.iter().filter(|info| info.state != WorkerState::Ready) {
        *others.entry(state(info)).or_default() += 1;
    }
    others.iter().for_each(|(state, count)| line += &format!(", {count} {state}"));
    // One worker in this process is as fast as it can be.
    if status.busy.is_the_limit() && status.list.iter().any(|info| info.address.is_some()) {
        line += "; this machine is the limit";
    }
    line
}

/// A worker's state, and how far it is.
pub fn state(info: &WorkerInfo) -> String {
    match (info.state, info.progress) {
        (WorkerState::Preparing, Some((have, of))) if have < of => {
            format!("fetching {:.0} %", f64::from(have) * 100.0 / f64::from(of))
        }
        (state, _) => word(state).to_owned(),
    }
}

/// One word a state, the same everywhere.
pub fn word(state: WorkerState) -> &'static str {
    match state {
        WorkerState::Idle => "connected",
        WorkerState::Preparing => "building",
        WorkerState::Ready => "ready",
        WorkerState::Slow => "slow",
        WorkerState::Quarantined => "quarantined",
        WorkerState::Leaving => "leaving",
    }
}

/// All that is known of a worker, for programs.
pub fn json(info: &WorkerInfo) -> Value {
    json!({
        "worker": info.worker,
        "name": info.name,
        "address": info.address.map(|address| address.to_string()),
        "state": word(info.state),
        "reason": info.reason,
        "fetched": info.progress.map(|(have, of)| f64::from(have) / f64::from(of.max(1))),
        "threads": info.threads,
        "workers_behind": info.behind.map(|behind| behind.workers),
        "relays_deep": info.behind.map_or(0, |behind| behind.depth),
        "in_flight": info.in_flight,
        "answered": info.answered,
        "confirmed": info.confirmed,
        "turnaround_ms": info.turnaround.as_secs_f64() * 1e3,
        "lease_ms": info.lease.as_secs_f64() * 1e3,
    })
}

#[cfg(test)]
pub(crate) mod tests {
    use std::time::Duration;

    use super::*;

    /// A worker in this state.
    pub(crate) fn info(worker: u32, state: WorkerState, progress: Option<(u32, u32)>) -> WorkerInfo {
        WorkerInfo {
            worker,
            name: "lab".into(),
            address: None,
            state,
            reason: None,
            progress,
            threads: 2,
            behind: None,
            places: 6,
            in_flight: 0,
            answered: 0,
            confirmed: 0,
            thread_time: Duration::ZERO,
            turnaround: Duration::ZERO,
            round_trip: Duration::ZERO,
            lease: Duration::ZERO,
            answer_bytes: 0,
        }
    }

    #[test]
    fn everybody_is_mentioned_once() {
        let list = vec![
            info(1, WorkerState::Ready, None),
            info(2, WorkerState::Slow, None),
            info(3, WorkerState::Preparing, Some((43, 100))),
            info(4, WorkerState::Preparing, None),
            info(5, WorkerState::Quarantined, None),
        ];
        let status = Status { workers: 5, ready: 2, list, ..Status::default() };
        assert_eq!(summary(&status), "2 workers on 4 threads, 1 building, 1 fetching 43 %, 1 quarantined, 1 slow");
    }

    #[test]
    fn only_changes_are_news() {
        let status = |state| Status { list: vec![info(1, state, None)], ..Status::default() };
        let mut roster = Roster::default();
        assert_eq!(roster.news(&status(WorkerState::Ready)).len(), 1);
        assert_eq!(roster.news(&status(WorkerState::Ready)).len(), 0);
        assert_eq!(roster.news(&status(WorkerState::Quarantined)).len(), 1);
        assert_eq!(roster.news(&Status::default()).len(), 0);
        assert_eq!(roster.news(&status(WorkerState::Quarantined)).len(), 1);
    }
}
