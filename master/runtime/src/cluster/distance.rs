//! Workers of this process as if they were far away: to measure what distance costs without a network.

use std::io;
use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use protocol::message::ToWorker;
use protocol::parts::Hash;

use super::{Known, Link};

/// A way on which everything takes so much longer, and stays in order. `arrive` is called by a thread of its own, until all
/// clones of what puts in are gone.
pub(super) fn way<T: Send + 'static>(
    takes: Duration,
    mut arrive: impl FnMut(T) + Send + 'static,
) -> io::Result<impl Fn(T) + Clone + Send + 'static> {
    let (put, arrivals) = channel::<(Instant, T)>();
    let carry = move || {
        for (due, what) in arrivals {
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
            arrive(what);
        }
    };
    std::thread::Builder::new().name("distance".into()).spawn(carry)?;
    Ok(move |what| drop(put.send((Instant::now() + takes, what))))
}

/// What goes to a worker.
enum Word {
    Said(ToWorker),
    Offered(Arc<Known>),
}

/// The same worker, far away.
pub(super) struct Distant(Box<dyn Fn(Word) + Send>);

impl Distant {
    /// It takes so long to get there.
    pub(super) fn new(takes: Duration, mut link: Box<dyn Link>) -> io::Result<Self> {
        let arrive = move |word| match word {
            // Embedded workers take everything.
            Word::Said(message) => drop(link.send(message)),
            Word::Offered(known) => link.offer(&known),
        };
        Ok(Self(Box::new(way(takes, arrive)?)))
    }
}

impl Link for Distant {
    fn send(&mut self, message: ToWorker) -> Result<(), String> {
        (self.0)(Word::Said(message));
        Ok(())
    }

    fn offer(&mut self, known: &Arc<Known>) {
        (self.0)(Word::Offered(Arc::clone(known)));
    }

    fn want(&mut self, _: Vec<Hash>) -> Result<(), String> {
        Ok(())
    }
}
