//! Where workers of other processes join: a QUIC endpoint and, for each connection, a few tasks.
//!
//! [`key`] makes token, key and certificate; [`keys`] knows which are valid, [`rotation`] when they change; [`door`] lets in who proves to have the token;
//! [`remote_worker`] carries messages, scene parts and answers of those who are in; [`resets`] tells workers of a master that was
//! killed to come again. Nothing is decided here about questions: that is the dispatcher's business.
//!
//! Limits against strangers and workers are named in [`limits`], those of messages in [`protocol::message`].

mod door;
#[cfg(test)]
mod floods;
mod key;
mod keys;
mod limits;
mod remote_worker;
mod resets;
pub mod rotation;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use protocol::identity::{Expiry, NoToken, Token};
use protocol::message::ANSWER_MAX;
use protocol::token_file::Entry;
use protocol::transport::SOCKET_BUFFER;
use quinn::{Connection, Endpoint, EndpointConfig, TokioRuntime, VarInt};
use tokio::runtime::Runtime;

use crate::cluster::{ClusterError, ClusterOptions, Note};
use keys::Keys;
use limits::{BETWEEN_RESETS, FAREWELL_ALL, THREADS};
use resets::Resets;

/// The place where workers join. It closes when this is dropped.
pub struct Network {
    endpoint: Endpoint,
    address: SocketAddr,
    keys: Arc<Keys>,
    traffic: Arc<Traffic>,
    /// `None` only while being dropped.
    runtime: Option<Runtime>,
}

impl Network {
    /// Listens, and reports to the dispatcher who joins and what they say.
    pub fn listen(
        address: SocketAddr,
        options: &ClusterOptions,
        dispatcher: Sender<Note>,
    ) -> Result<Self, ClusterError> {
        let alone = |token| vec![Entry { token, until: None }];
        let entries = match (&options.token_file, &options.token) {
            (Some(file), _) => rotation::read(file).map_err(ClusterError::Network)?,
            (None, Some(text)) => {
                alone(text.parse().map_err(|error: NoToken| ClusterError::Network(error.to_string()))?)
            }
            (None, None) => alone(fresh_token(options.token_lifetime).map_err(ClusterError::Network)?),
        };
        let keys = Arc::new(Keys::new(entries).map_err(ClusterError::Network)?);
        if keys.first().is_expired(unix_time()) {
            return Err(ClusterError::Network(
                "the token has expired: nobody could join; start without it, or make one with `igi-master token`"
                    .into(),
            ));
        }
        let cannot_listen = |error: std::io::Error| {
            ClusterError::Network(format!("cannot listen on {address}: {error}; choose another address or port"))
        };
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(threads(super::embedded::cores()))
            .thread_name("network")
            .enable_all()
            .build()?;
        let socket = socket(address).map_err(cannot_listen)?;
        let config = door::server_config(&keys).map_err(|error| ClusterError::Network(error.to_string()))?;
        let address = socket.local_addr().map_err(cannot_listen)?;
        let endpoint = {
            let _inside = runtime.enter();
            Endpoint::new(endpoint_config(&keys, address.port()), Some(config), socket, Arc::new(TokioRuntime))
                .map_err(cannot_listen)?
        };
        let traffic = Arc::new(Traffic { hands_on: options.hand_on, ..Traffic::default() });
        let door = door::Door::new(endpoint.clone(), Arc::clone(&keys), dispatcher, Arc::clone(&traffic));
        runtime.spawn(door.open());
        if let Some(file) = &options.token_file {
            runtime.spawn(rotation::follow(file.as_path().into(), Arc::clone(&keys)));
        }
        Ok(Self { endpoint, address, keys, traffic, runtime: Some(runtime) })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The token for new workers.
    pub fn token(&self) -> Token {
        self.keys.first()
    }

    /// All that are valid, whenever it is called.
    pub fn tokens(&self) -> impl Fn() -> Vec<Token> + Send + use<> {
        let keys = Arc::clone(&self.keys);
        move || keys.tokens()
    }

    /// Bytes that go over it.
    pub fn traffic(&self) -> Arc<Traffic> {
        Arc::clone(&self.traffic)
    }

    /// Where workers of other machines find it.
    pub fn reachable(&self) -> SocketAddr {
        match self.address.ip() {
            ip if ip.is_unspecified() => SocketAddr::new(reachable_address(ip), self.address.port()),
            _ => self.address,
        }
    }
}

impl Drop for Network {
    fn drop(&mut self) {
        let Some(runtime) = self.runtime.take() else { return };
        // Links say good-bye and close by themselves; who does not listen is cut off.
        runtime.block_on(async {
            let _ = tokio::time::timeout(FAREWELL_ALL, self.traffic.wait_until_nobody_is_there()).await;
            self.endpoint.close(VarInt::from_u32(0), b"the master has finished");
            let _ = tokio::time::timeout(FAREWELL_ALL, self.endpoint.wait_idle()).await;
        });
        // The port is free when we return: tasks that hold it are gone.
        runtime.shutdown_timeout(FAREWELL_ALL);
    }
}

/// Threads of the network of a master with so many cores.
pub fn threads(cores: usize) -> usize {
    cores.clamp(*THREADS.start(), *THREADS.end())
}

/// The token of a master that has not begun yet; it expires after its lifetime, if it has one.
///
/// # Errors
/// The system has no random numbers, or it would expire after the year 2106.
pub fn fresh_token(lifetime: Option<Duration>) -> Result<Token, String> {
    let moment = |lifetime: Duration| {
        let moment = unix_time().checked_add(lifetime.as_secs()).and_then(|moment| u32::try_from(moment).ok());
        moment.and_then(Expiry::new).ok_or_else(|| "a token cannot live that long".to_owned())
    };
    key::Identity::fresh(lifetime.map(moment).transpose()?).map(|identity| identity.token)
}

/// Random bits of the system.
///
/// # Errors
/// It has none.
pub fn random() -> Result<u64, ClusterError> {
    let secret = key::fresh_secret().map_err(ClusterError::Network)?;
    let (low, _) = secret.split_at(8);
    Ok(low.iter().fold(0, |number, byte| number << 8 | u64::from(*byte)))
}

/// Whether a token still lets workers in; text that is none will be complained of by whoever needs it.
pub fn is_current(token: &str) -> bool {
    !token.parse().is_ok_and(|token: Token| token.is_expired(unix_time()))
}

/// Seconds since the beginning of 1970 (UTC).
pub fn unix_time() -> u64 {
    std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).map_or(0, |time| time.as_secs())
}

/// So that a master that is started again at this port knows the connections of the one before.
fn endpoint_config(keys: &Arc<Keys>, port: u16) -> EndpointConfig {
    let resets = Resets::new(Arc::clone(keys), port);
    let mut config = EndpointConfig::new(Arc::new(resets.clone()));
    config.cid_generator(move || Box::new(resets.clone())).min_reset_interval(BETWEEN_RESETS);
    config
}

fn socket(address: SocketAddr) -> std::io::Result<UdpSocket> {
    let socket = socket2::Socket::new(
        socket2::Domain::for_address(address),
        socket2::Type::DGRAM,
        Some(socket2::Protocol::UDP),
    )?;
    // The system may allow less: then there are only more packets to send again.
    let _ = socket.set_recv_buffer_size(SOCKET_BUFFER);
    let _ = socket.set_send_buffer_size(SOCKET_BUFFER);
    if address.is_ipv6() {
        // [::] takes IPv4 as well.
        let _ = socket.set_only_v6(false);
    }
    socket.bind(&address.into())?;
    Ok(socket.into())
}

/// The address that this machine has towards others; no packet is sent to find out.
pub fn reachable_address(listening: IpAddr) -> IpAddr {
    let towards = |from: IpAddr, to: SocketAddr| -> std::io::Result<IpAddr> {
        let socket = UdpSocket::bind(SocketAddr::new(from, 0))?;
        socket.connect(to)?;
        Ok(socket.local_addr()?.ip())
    };
    // Documentation prefixes: never used, but routed like any other.
    let v4 = || towards(Ipv4Addr::UNSPECIFIED.into(), (Ipv4Addr::new(192, 0, 2, 1), 9).into());
    let v6 = || towards(Ipv6Addr::UNSPECIFIED.into(), (Ipv6Addr::new(0x2001, 0xdb8, 0, 0, 0, 0, 0, 1), 9).into());
    let found = if listening.is_ipv6() { v4().or_else(|_| v6()) } else { v4() };
    found.unwrap_or(Ipv4Addr::LOCALHOST.into())
}

/// What goes over the network, and who is there.
#[derive(Debug, Default)]
pub struct Traffic {
    present: Mutex<BTreeMap<u64, Connection>>,
    /// Of those that have gone.
    sent: AtomicU64,
    received: AtomicU64,
    /// The longest packed answer that was asked for, bytes.
    longest_answer: AtomicUsize,
    /// Answers are kept as they came.
    hands_on: bool,
}

impl Traffic {
    /// Packed answers may have so many bytes.
    pub fn expect(&self, bytes: usize) {
        self.longest_answer.fetch_max(bytes.min(ANSWER_MAX), Ordering::Relaxed);
    }

    /// The longest packed answer that was asked for, bytes.
    fn packed_limit(&self) -> usize {
        self.longest_answer.load(Ordering::Relaxed)
    }

    /// Bytes sent and received, all that UDP carries.
    pub fn bytes(&self) -> (u64, u64) {
        let gone = (self.sent.load(Ordering::Relaxed), self.received.load(Ordering::Relaxed));
        self.present()
            .values()
            .map(Connection::stats)
            .fold(gone, |(sent, received), stats| (sent + stats.udp_tx.bytes, received + stats.udp_rx.bytes))
    }

    fn enter(&self, id: u64, connection: &Connection) {
        self.present().insert(id, connection.clone());
    }

    fn leave(&self, id: u64) {
        if let Some(connection) = self.present().remove(&id) {
            let stats = connection.stats();
            self.sent.fetch_add(stats.udp_tx.bytes, Ordering::Relaxed);
            self.received.fetch_add(stats.udp_rx.bytes, Ordering::Relaxed);
        }
    }

    fn present(&self) -> MutexGuard<'_, BTreeMap<u64, Connection>> {
        self.present.lock().unwrap_or_else(PoisonError::into_inner)
    }

    async fn wait_until_nobody_is_there(&self) {
        while !self.present().is_empty() {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    }
}
