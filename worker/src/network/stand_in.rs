//! A stand-in for a worker: it joins as workers do, builds nothing, and gives answers that were made before. So a master can
//! be shown more workers than a machine could hold.

use std::sync::Arc;
use std::time::Duration;

use protocol::answer::{Cost, CostStage};
use protocol::message::{ToMaster, ToWorker, decode};
use protocol::question::{Question, WorldState};
use tokio::time::Instant;

use super::session::{ReadError, answer, connect, read, send_message};
use super::{NetworkError, Options};
use crate::pool::Work;

/// An answer that was made before.
#[derive(Clone, Debug)]
pub struct Canned {
    /// Output of [`protocol::pack::compress`].
    pub squeezed: Arc<[u8]>,
    /// How long a thread takes for it; with zero, no thread is ever busy.
    pub takes: Duration,
}

/// Joins a master and answers what `answers` has an answer to, until the master says good-bye. What is cancelled is answered
/// all the same: a thread that has begun with something would have gone on as well.
///
/// # Errors
/// [`NetworkError`] if it is not let in, or the connection is lost.
pub async fn stand_in(options: &Options, answers: impl Fn(&Question) -> Option<Canned>) -> Result<(), NetworkError> {
    let (connection, mut send, mut recv) = connect(options).await?;
    // When each thread has done what it was given.
    let mut free = vec![Instant::now(); options.threads.max(1)];
    loop {
        let (header, body) = read(&mut recv).await.map_err(|error| match error {
            ReadError::Wire(error) => NetworkError::Broken(format!("the master talks nonsense: {error}")),
            ReadError::Stream(reason) => NetworkError::Lost(format!("connection lost: {reason}")),
        })?;
        match decode(header.kind, &body).map_err(|error| NetworkError::Broken(error.to_string()))? {
            ToWorker::World { state, .. } => send_message(&mut send, &ToMaster::Ready { state }).await?,
            ToWorker::Changes { from, revision, .. } => {
                let state = WorldState { revision, ..from };
                send_message(&mut send, &ToMaster::Ready { state }).await?;
            }
            ToWorker::Ask { id, question } => match answers(&question) {
                Some(Canned { squeezed, takes }) => {
                    let mut due = Instant::now();
                    // Whoever has least to do takes it.
                    if let Some(thread) = free.iter_mut().min().filter(|_| !takes.is_zero()) {
                        due = due.max(*thread) + takes;
                        *thread = due;
                    }
                    let connection = connection.clone();
                    tokio::spawn(async move {
                        if !takes.is_zero() {
                            tokio::time::sleep_until(due).await;
                        }
                        let mut cost = Cost::default();
                        cost.spend(CostStage::Eye, takes.as_micros() as u64);
                        answer(&connection, id, Work { bytes: squeezed.to_vec(), cost }).await;
                    });
                }
                None => {
                    let reason = "a stand-in knows no answer to it".to_owned();
                    send_message(&mut send, &ToMaster::Failed { id, reason }).await?;
                }
            },
            ToWorker::Cancel { .. } => {}
            ToWorker::Goodbye { .. } => return Ok(()),
        }
    }
}
