//! What a worker tells those who look after it: `--metrics` answers Prometheus and health checks.
//!
//! It overhears what the engine says to the master and the master to the engine; nothing else has to keep books.

use std::net::SocketAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use health::{Page, Report, Server};
use protocol::answer::Cost;
use protocol::message::{ToMaster, ToWorker};
use quinn::Connection;

use crate::engine::Output;

/// The books of one worker; clones share them.
#[derive(Clone, Debug)]
pub struct Pulse(Arc<Mutex<Books>>);

#[derive(Clone, Debug)]
struct Books {
    phase: Phase,
    /// When the loop last went round.
    beat: Instant,
    connections: u64,
    answers: u64,
    cost: Cost,
    /// The present connection, and bytes sent and received over earlier ones.
    connection: Option<Connection>,
    bytes: [u64; 2],
}

/// What a worker is doing.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Phase {
    /// It has no master; why.
    Seeking(String),
    /// It has a master, and nothing to do.
    Joined,
    /// It has some parts of the scene, of so many.
    Fetching(u32, u32),
    /// It has the scene, and builds what answers need.
    Building,
    /// It answers.
    Ready,
    /// It finishes what it has begun.
    Leaving,
}

/// The loop goes round this often …
const BEAT: Duration = Duration::from_secs(1);
/// … and hangs if it has not for so long.
const HANGS_AFTER: Duration = Duration::from_secs(60);

impl Default for Pulse {
    fn default() -> Self {
        let phase = Phase::Seeking("it has just begun".into());
        let (connections, answers, cost, connection, bytes) = (0, 0, Cost::default(), None, [0; 2]);
        Self(Arc::new(Mutex::new(Books { phase, beat: Instant::now(), connections, answers, cost, connection, bytes })))
    }
}

impl Pulse {
    /// Answers at an address until the server is dropped.
    ///
    /// # Errors
    /// In words: it cannot be listened at.
    pub(crate) fn serve(&self, address: SocketAddr) -> Result<Server, String> {
        let pulse = self.clone();
        Server::start(address, move || pulse.books().report(Instant::now()))
    }

    /// Beats as long as the runtime does its work; never returns.
    pub(crate) async fn keep_beating(self) {
        loop {
            self.books().beat = Instant::now();
            tokio::time::sleep(BEAT).await;
        }
    }

    /// A master has let us in.
    pub(crate) fn joined(&self, connection: &Connection) {
        let mut books = self.books();
        books.phase = Phase::Joined;
        books.connections += 1;
        books.connection = Some(connection.clone());
    }

    /// There is no master (any more); why.
    pub(crate) fn left(&self, reason: &str) {
        let mut books = self.books();
        books.phase = Phase::Seeking(reason.to_owned());
        books.bytes = books.all_bytes();
        books.connection = None;
    }

    /// The master has said something.
    pub(crate) fn received(&self, message: &ToWorker) {
        if let ToWorker::World { .. } = message {
            self.books().turn(Phase::Building);
        }
    }

    /// The engine says something.
    pub(crate) fn sent(&self, output: &Output) {
        let mut books = self.books();
        match output {
            Output::Send(ToMaster::Progress { have, of }) if have < of => books.turn(Phase::Fetching(*have, *of)),
            Output::Send(ToMaster::Progress { .. }) => books.turn(Phase::Building),
            Output::Send(ToMaster::Ready { .. }) => books.turn(Phase::Ready),
            Output::Send(ToMaster::Leaving { .. }) => books.phase = Phase::Leaving,
            Output::Send(_) | Output::Stop(_) => {}
            Output::Answer(_, work) => {
                books.answers += 1;
                books.cost += work.cost;
            }
        }
    }

    fn books(&self) -> MutexGuard<'_, Books> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Books {
    /// Who is leaving does not become ready again.
    fn turn(&mut self, phase: Phase) {
        if self.phase != Phase::Leaving {
            self.phase = phase;
        }
    }

    fn all_bytes(&self) -> [u64; 2] {
        let [sent, received] = self.bytes;
        let now = self.connection.as_ref().map(Connection::stats).unwrap_or_default();
        [sent + now.udp_tx.bytes, received + now.udp_rx.bytes]
    }

    fn report(&self, now: Instant) -> Report {
        let since = now.saturating_duration_since(self.beat);
        let alive =
            if since < HANGS_AFTER { Ok(()) } else { Err(format!("no sign of life for {} s", since.as_secs())) };
        let ready = match &self.phase {
            Phase::Seeking(reason) => Err(format!("no master: {reason}")),
            Phase::Joined => Err("the master has not told a scene yet".into()),
            Phase::Fetching(have, of) => {
                Err(format!("fetching the scene: {:.0} %", f64::from(*have) * 100.0 / f64::from((*of).max(1))))
            }
            Phase::Building => Err("building the scene".into()),
            Phase::Ready => Ok("it answers".into()),
            Phase::Leaving => Err("it is leaving".into()),
        };
        Report { page: self.page(), alive, ready }
    }

    fn page(&self) -> Page {
        let mut page = Page::default();
        let state = self.phase.word();
        let states = PHASES.map(|word| (word, f64::from(u8::from(word == state))));
        page.gauges("igi_worker_state", "1 for what this worker is doing.", "state", states);
        page.counter("igi_worker_connections_total", "Times a master has let it in.", self.connections as f64);
        page.counter("igi_worker_tiles_total", "Tiles answered.", self.answers as f64);
        let help = "Thread time of the answers.";
        page.counters("igi_worker_work_seconds_total", help, "stage", self.cost.seconds_by_stage());
        let rays = self.cost.rays_by_kind().map(|(kind, rays)| (kind, rays as f64));
        page.counters("igi_worker_rays_total", "Rays of the answers.", "kind", rays);
        let [sent, received] = self.all_bytes();
        let bytes = [("sent", sent as f64), ("received", received as f64)];
        page.counters("igi_worker_bytes_total", "Bytes to and from masters.", "direction", bytes);
        page
    }
}

impl Phase {
    fn word(&self) -> &'static str {
        match self {
            Self::Seeking(_) => "seeking",
            Self::Joined => "joined",
            Self::Fetching(..) => "fetching",
            Self::Building => "building",
            Self::Ready => "ready",
            Self::Leaving => "leaving",
        }
    }
}

/// Words of all phases.
const PHASES: [&str; 6] = ["seeking", "joined", "fetching", "building", "ready", "leaving"];

#[cfg(test)]
mod tests {
    use protocol::question::WorldState;
    use protocol::schedule::QuestionId;

    use super::*;
    use crate::engine::Output::{Answer, Send};
    use crate::pool::Work;

    #[test]
    fn readiness_follows_what_is_said() {
        let pulse = Pulse::default();
        let ready = || pulse.books().report(Instant::now()).ready;
        assert!(ready().unwrap_err().contains("no master"));
        let state = WorldState::default();
        pulse.received(&ToWorker::World { state, changes: Vec::new() });
        assert_eq!(ready(), Err("building the scene".into()));
        pulse.sent(&Send(ToMaster::Progress { have: 43, of: 100 }));
        assert_eq!(ready(), Err("fetching the scene: 43 %".into()));
        pulse.sent(&Send(ToMaster::Progress { have: 100, of: 100 }));
        assert_eq!(ready(), Err("building the scene".into()));
        pulse.sent(&Send(ToMaster::Ready { state }));
        assert_eq!(ready(), Ok("it answers".into()));
        // Another scene begins it all again.
        pulse.received(&ToWorker::World { state, changes: Vec::new() });
        assert!(ready().is_err());
        pulse.sent(&Send(ToMaster::Leaving { started: Vec::new() }));
        pulse.sent(&Send(ToMaster::Ready { state }));
        assert_eq!(ready(), Err("it is leaving".into()));
        pulse.left("gone");
        assert_eq!(ready(), Err("no master: gone".into()));
    }

    #[test]
    fn answers_are_counted() {
        let pulse = Pulse::default();
        let cost = Cost { eye_rays: 3, ..Cost::default() };
        pulse.sent(&Answer(QuestionId(1), Work { bytes: vec![1], cost }));
        pulse.sent(&Answer(QuestionId(2), Work { bytes: vec![1], cost }));
        let page = pulse.books().page();
        for line in [
            "igi_worker_tiles_total 2",
            "igi_worker_rays_total{kind=\"eye\"} 6",
            "igi_worker_state{state=\"seeking\"} 1",
            "igi_worker_state{state=\"ready\"} 0",
        ] {
            assert!(page.text().lines().any(|said| said == line), "{line} is not in\n{}", page.text());
        }
    }

    #[test]
    fn every_phase_has_its_word() {
        let all = [Phase::Seeking(String::new()), Phase::Joined, Phase::Fetching(0, 1), Phase::Building, Phase::Ready];
        assert!(all.iter().all(|phase| PHASES.contains(&phase.word())));
    }
}
