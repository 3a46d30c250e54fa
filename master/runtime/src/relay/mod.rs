//! A relay: to workers it is a master, to a master a worker. It hands on scene parts, questions and answers.
//!
//! [`hands`] is what it does, told by hand in tests; here is the thread that does it, and the way to the master above, on which
//! it has a worker's manners ([`protocol::serve`]). Below it is a [`Cluster`] as any master has: lost workers, wrong answers and
//! slow ones are its own business. What is above it need not know who answers, and no bit depends on it.

mod hands;
#[cfg(test)]
mod tests;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::time::{Duration, Instant};

use tokio::sync::watch;
use worker::engine::{Begun, Hands, Input, Output};
use worker::network::{Options, StopSign, read_token, store, work_with};

use crate::cluster::{Cluster, Waker};
use crate::console::Console;
use crate::interrupt::Interrupt;
use hands::{Relay, Word};

/// The master that a relay works for, and as whom.
#[derive(Clone, Debug)]
pub struct Above {
    /// `HOST:PORT`.
    pub master: String,
    /// The whole token.
    pub token: Option<String>,
    /// A file with it, which counts more.
    pub token_file: Option<PathBuf>,
    /// Where scene parts are kept; `None`: in memory.
    pub cache: Option<PathBuf>,
    /// What the master calls it; `None`: as the machine.
    pub name: Option<String>,
    /// It ends when the master says good-bye.
    pub once: bool,
}

impl Above {
    fn options(&self) -> Result<Options, String> {
        let token = match (&self.token_file, &self.token) {
            (Some(file), _) => read_token(file)?,
            (None, Some(token)) => token.parse().map_err(|error: protocol::identity::NoToken| error.to_string())?,
            (None, None) => return Err("a relay needs a token".into()),
        };
        Ok(Options {
            master: Some(self.master.clone()),
            token,
            token_file: self.token_file.clone(),
            // Until it says who is behind it.
            threads: 1,
            cache: self.cache.clone(),
            name: self.name.clone().unwrap_or_else(worker::settings::machine),
            once: self.once,
            metrics: None,
        })
    }
}

/// The way from the connections above to the thread that relays.
struct Ways {
    words: Sender<Word>,
    waker: Waker,
}

impl Ways {
    fn ear(&self) -> impl Fn(Word) + Send + Sync + use<> {
        let (words, waker) = (self.words.clone(), self.waker.clone());
        move |word| {
            // The thread is gone only when all is over.
            let _ = words.send(word);
            waker.wake();
        }
    }
}

impl Hands for Ways {
    fn begin(&self, out: Box<dyn FnMut(Output) + Send>) -> std::io::Result<Begun> {
        let ear = self.ear();
        ear(Word::Begun(out));
        // It hears of the end in its turn, and of what comes after that later.
        Ok(Begun { ear: Box::new(move |input: Input| ear(Word::Said(input))), join: Box::new(|| ()) })
    }
}

/// Who is behind it is looked at this often.
const BETWEEN_LOOKS: Duration = Duration::from_millis(50);

/// Relays until it is interrupted, the master does not want it, or, if that is wanted, the master has finished.
///
/// # Errors
/// In words: why it cannot relay.
pub fn run(above: Above, cluster: Cluster, interrupt: &Interrupt, console: &mut Console) -> Result<(), String> {
    let options = above.options()?;
    let store = Arc::new(store(above.cache.as_deref()).map_err(|error| error.to_string())?);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(|error| format!("cannot start: {error}"))?;
    let (words, heard) = channel();
    let ways = Ways { words, waker: cluster.waker() };
    let (sign, stop) = watch::channel(StopSign::Work);
    let asked = interrupt.clone();
    let upwards = move || {
        runtime.block_on(async {
            let _watched = tokio::spawn(async move {
                while !asked.asked() {
                    tokio::time::sleep(BETWEEN_LOOKS).await;
                }
                sign.send_replace(StopSign::Drain);
            });
            work_with(&options, &ways, stop).await.map_err(|error| error.to_string())
        })
    };
    let upwards = std::thread::Builder::new().name("upwards".into()).spawn(upwards);
    let upwards = upwards.map_err(|error| format!("cannot start a thread: {error}"))?;
    console.line(&format!("relaying for {}", above.master));
    turn(Relay::new(cluster, store), &heard, console);
    upwards.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

/// Does what comes from both sides in turn, until nobody is above any more.
fn turn(mut relay: Relay, heard: &Receiver<Word>, console: &mut Console) {
    let mut looked = Instant::now();
    loop {
        match heard.try_recv() {
            Ok(word) => {
                relay.hear(word);
                continue;
            }
            Err(TryRecvError::Disconnected) => return,
            Err(TryRecvError::Empty) => {}
        }
        if let Some(event) = relay.cluster().next(BETWEEN_LOOKS) {
            console.event(&event);
            relay.happened(event);
        }
        if looked.elapsed() >= BETWEEN_LOOKS {
            looked = Instant::now();
            let status = relay.cluster().status();
            relay.look(&status);
            console.workers(&status);
            relay.cluster().pulse().drawn(0, looked);
        }
    }
}
