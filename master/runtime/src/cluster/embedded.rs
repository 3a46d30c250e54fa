//! Workers in this process. The only file of the master that knows what a worker is made of.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::mpsc::Sender;
use std::time::Duration;

use protocol::identity::Token;
use protocol::message::ToWorker;
use protocol::parts::Hash;
use protocol::question::Question;
use protocol::schedule::{HELD_PER_THREAD, WorkerId};
pub use worker::bits::of_this_build;
use worker::embedded::Embedded;
use worker::engine::Output;
use worker::network::NetworkError;
use worker::network::stand_in;
pub use worker::network::stand_in::Canned;
pub use worker::renderer::{Light, Renderer};

use super::distance::{Distant, way};
use crate::cluster::{Known, Ledger, Link, Note, Report};

/// Questions that an embedded worker holds for each of its threads: the way is short.
const DEPTH: u16 = 2;

/// Threads of it if nobody says how many: one a core.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// How it works.
pub struct How {
    /// So many threads.
    pub threads: usize,
    /// They give way to whoever draws pictures for people.
    pub give_way: bool,
    /// As if it were so far away, there and back.
    pub far: Duration,
}

/// Starts a worker, and reports to the dispatcher that it has joined.
pub fn start<C: Renderer>(
    renderer: C,
    How { threads, give_way, far }: How,
    id: WorkerId,
    dispatcher: &Sender<Note>,
) -> std::io::Result<()> {
    let reports = dispatcher.clone();
    // The dispatcher is gone only when all is over.
    let arrive = move |note| drop(reports.send(note));
    let report: Box<dyn Fn(Note) + Send> =
        if far.is_zero() { Box::new(arrive) } else { Box::new(way(far / 2, arrive)?) };
    let ledger = Ledger::default();
    let asked = ledger.clone();
    let out = move |output| {
        let said = match output {
            Output::Send(message) => Report::Received { message, _room: None },
            Output::Answer(id, work) => {
                let bytes = work.bytes.len() as u64;
                Report::Answered {
                    id,
                    cost: work.cost,
                    content: Box::new(asked.content(id, Ok(work.bytes))),
                    bytes,
                    as_it_came: Vec::new(),
                    round_trip: far,
                    _room: None,
                }
            }
            Output::Stop(reason) => Report::Left(reason),
        };
        report(Note::Report(id, said));
    };
    let start = move || {
        if give_way && let Err(error) = worker::load_policy::give_way() {
            tracing::warn!("workers of this process run at its own priority: {error}");
        }
        Embedded::start(renderer, threads, out)
    };
    // Threads have the priority of those that start them.
    let starter = std::thread::Builder::new().name("starter".into()).spawn(start)?;
    let worker = starter.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
    let link: Box<dyn Link> = Box::new(Near { worker, ledger });
    let (link, depth) = match far.is_zero() {
        true => (link, DEPTH),
        false => (Box::new(Distant::new(far / 2, link)?) as Box<dyn Link>, HELD_PER_THREAD),
    };
    let threads = u16::try_from(threads).unwrap_or(u16::MAX);
    let name = "this process".into();
    let joined = Report::Joined { name, threads, depth, address: None, is_trusted: true, link };
    let _ = dispatcher.send(Note::Report(id, joined));
    Ok(())
}

/// Joins a listening cluster as somebody who has all answers already ([`mod@worker::network::stand_in`]), until it says good-bye.
///
/// # Errors
/// In words: it is not let in, or the connection is lost.
pub async fn stand_in(
    master: SocketAddr,
    token: Token,
    threads: usize,
    answers: impl Fn(&Question) -> Option<Canned>,
) -> Result<(), String> {
    let options = worker::network::Options {
        master: Some(master.to_string()),
        token,
        token_file: None,
        threads,
        cache: None,
        name: "canned".into(),
        once: true,
        metrics: None,
    };
    stand_in::stand_in(&options, answers).await.map_err(|error: NetworkError| error.to_string())
}

struct Near<C: Renderer> {
    worker: Embedded<C>,
    ledger: Ledger,
}

impl<C: Renderer> Link for Near<C> {
    fn send(&mut self, message: ToWorker) -> Result<(), String> {
        self.ledger.note(&message);
        self.worker.send(message);
        Ok(())
    }

    fn offer(&mut self, known: &Arc<Known>) {
        self.ledger.turn_to(known);
        self.worker.give(known.state.world, Arc::clone(&known.scene));
    }

    fn want(&mut self, _: Vec<Hash>) -> Result<(), String> {
        Ok(())
    }
}
