//! The network of a story: connections whose directions are slow, clogged, or cut.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use protocol::message::{ToWorker, encode};
use protocol::parts::Hash;
use protocol::schedule::{Moment, WorkerId};
use runtime::cluster::Known;
use runtime::cluster::dispatcher::Link;

/// After this long without a word from the other side, a connection is lost, microseconds (as over QUIC).
pub const IDLE: u64 = 10_000_000;
/// Once in a while a packet has to be sent again, and takes up to so long, microseconds.
pub const RESENT_MAX: u64 = 300_000;
/// There and back.
pub const ROUND_TRIP_MAX: u64 = 2 * RESENT_MAX;

/// What travels.
#[derive(Clone, Debug)]
pub enum Parcel {
    /// A whole message of the conversation, which is ordered.
    Words(Vec<u8>),
    /// An answer, on a stream of its own.
    Answer(Vec<u8>),
    /// A part of a scene, on a stream of its own.
    Blob(Hash, Arc<[u8]>),
    /// The other side has closed the connection.
    Closed,
}

/// One direction of a connection.
#[derive(Clone, Copy, Debug, Default)]
pub struct Way {
    /// Nothing arrives before.
    pub clogged_until: Moment,
    /// When the last ordered parcel arrives.
    last: Moment,
    /// How long a parcel usually takes, microseconds: what a transport knows of the way.
    pub usual: u64,
}

impl Way {
    /// When a parcel arrives that is sent now and takes so long.
    pub fn arrival(&mut self, now: Moment, delay: u64, ordered: bool) -> Moment {
        let arrival = Moment(now.0 + delay).max(self.clogged_until);
        self.usual = (self.usual * 7 + arrival.0 - now.0) / 8;
        if !ordered {
            return arrival;
        }
        self.last = self.last.max(arrival);
        self.last
    }
}

/// What the dispatcher has said to workers and has not been sent yet.
#[derive(Clone, Default)]
pub struct Outbox(Arc<Mutex<Vec<(WorkerId, Parcel)>>>);

impl Outbox {
    pub fn put(&self, worker: WorkerId, parcel: Parcel) {
        self.0.lock().unwrap().push((worker, parcel));
    }

    pub fn take(&self) -> Vec<(WorkerId, Parcel)> {
        std::mem::take(&mut self.0.lock().unwrap())
    }
}

/// The dispatcher's end of a connection.
pub struct Far {
    pub worker: WorkerId,
    pub outbox: Outbox,
    pub parts: Arc<BTreeMap<Hash, Arc<[u8]>>>,
}

impl Link for Far {
    fn send(&mut self, message: ToWorker) -> Result<(), String> {
        self.outbox.put(self.worker, Parcel::Words(encode(&message).expect("words fit into messages")));
        Ok(())
    }

    fn offer(&mut self, known: &Arc<Known>) {
        self.parts = Arc::clone(&known.parts);
    }

    fn want(&mut self, parts: Vec<Hash>) -> Result<(), String> {
        for hash in parts {
            if let Some(part) = self.parts.get(&hash) {
                self.outbox.put(self.worker, Parcel::Blob(hash, Arc::clone(part)));
            }
        }
        Ok(())
    }
}

impl Drop for Far {
    fn drop(&mut self) {
        self.outbox.put(self.worker, Parcel::Closed);
    }
}
