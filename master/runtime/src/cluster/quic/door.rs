//! Who comes in: strangers are heard briefly, in little memory, and only a proof of the token opens.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::Sender;
use std::time::Duration;

use health::Guests;
use protocol::identity::{Channel, EXPORT_LABEL, Role, Token};
use protocol::message::{ALPN, Control, Hello, Kind, REASON_MAX, Refusal, Welcome, cut, decode, encode};
use protocol::transport::{CONFIRMED_WITHIN, FIRST_ROUND_TRIP, IDLE_MAX, KEEP_ALIVE, PACKETS_CONFIRMED_AT_ONCE};
use quinn::crypto::rustls::QuicServerConfig;
use quinn::{
    AckFrequencyConfig, Connection, Endpoint, IdleTimeout, Incoming, RecvStream, SendStream, ServerConfig,
    TransportConfig, VarInt,
};
use rustls::crypto::CryptoProvider;
use rustls::crypto::ring::{
    cipher_suite::{TLS13_AES_128_GCM_SHA256, TLS13_AES_256_GCM_SHA384, TLS13_CHACHA20_POLY1305_SHA256},
    default_provider,
};

use super::keys::{Keys, Opens};
use super::limits::{
    ANSWERS_MAX, CONNECTIONS_MAX, INCOMING_BUFFER, SEND_WINDOW, STRANGER_PATIENCE, STRANGER_WINDOW, STRANGERS_MAX,
    STREAM_WINDOW, WORKER_WINDOW,
};
use super::remote_worker::{ReadError, RemoteWorker, read};
use super::{Traffic, unix_time};
use crate::cluster::Note;
use crate::cluster::embedded::of_this_build;

pub(super) struct Door {
    endpoint: Endpoint,
    keys: Arc<Keys>,
    dispatcher: Sender<Note>,
    traffic: Arc<Traffic>,
    /// Number of the next worker; 0 is the embedded one.
    next: Arc<AtomicU64>,
}

/// TLS and transport of the listening side.
pub(super) fn server_config(keys: &Arc<Keys>) -> Result<ServerConfig, rustls::Error> {
    let provider = CryptoProvider {
        // AES-128 costs a third less than AES-256, half less than ChaCha, and is as safe here.
        cipher_suites: vec![TLS13_AES_128_GCM_SHA256, TLS13_AES_256_GCM_SHA384, TLS13_CHACHA20_POLY1305_SHA256],
        ..default_provider()
    };
    let mut tls = rustls::ServerConfig::builder_with_provider(Arc::new(provider))
        .with_protocol_versions(&[&rustls::version::TLS13])?
        .with_no_client_auth()
        .with_cert_resolver(Arc::clone(keys) as _);
    tls.alpn_protocols = vec![ALPN.to_vec()];
    let quic = QuicServerConfig::try_from(tls).map_err(|error| rustls::Error::General(error.to_string()))?;
    let mut config = ServerConfig::with_crypto(Arc::new(quic));
    let [of_one, of_all] = INCOMING_BUFFER;
    config.max_incoming(STRANGERS_MAX).incoming_buffer_size(of_one).incoming_buffer_size_total(of_all);
    config.transport_config(Arc::new(transport()));
    Ok(config)
}

fn transport() -> TransportConfig {
    let mut transport = TransportConfig::default();
    transport
        .stream_receive_window(VarInt::from_u32(STREAM_WINDOW))
        .receive_window(VarInt::from_u32(STRANGER_WINDOW))
        .send_window(SEND_WINDOW)
        .initial_rtt(FIRST_ROUND_TRIP)
        .max_idle_timeout(Some(IdleTimeout::from(VarInt::from_u32(IDLE_MAX.as_millis() as u32))))
        .keep_alive_interval(Some(KEEP_ALIVE))
        .send_fairness(false)
        .max_concurrent_bidi_streams(VarInt::from_u32(1))
        .max_concurrent_uni_streams(VarInt::from_u32(0))
        .ack_frequency_config(Some(confirmations()));
    transport
}

/// How often the other side confirms packets.
fn confirmations() -> AckFrequencyConfig {
    let mut often = AckFrequencyConfig::default();
    often.ack_eliciting_threshold(VarInt::from_u32(PACKETS_CONFIRMED_AT_ONCE)).max_ack_delay(Some(CONFIRMED_WITHIN));
    often
}

impl Door {
    pub(super) fn new(endpoint: Endpoint, keys: Arc<Keys>, dispatcher: Sender<Note>, traffic: Arc<Traffic>) -> Self {
        Self { endpoint, keys, dispatcher, traffic, next: Arc::new(AtomicU64::new(1)) }
    }

    /// Lets in who may come in, until the endpoint is closed.
    pub(super) async fn open(self) {
        let door = Arc::new(self);
        let mut strangers = Guests::new(STRANGERS_MAX);
        while let Some(incoming) = door.endpoint.accept().await {
            if door.endpoint.open_connections() >= CONNECTIONS_MAX {
                incoming.refuse();
                continue;
            }
            // Nobody has to go for who may not be where it says.
            if strangers.is_full() && incoming.may_retry() {
                drop(incoming.retry());
                continue;
            }
            let (from, door) = (incoming.remote_address().ip(), Arc::clone(&door));
            let stranger = tokio::spawn(async move {
                if let Some(worker) = door.greet(incoming).await {
                    // It is none any more.
                    tokio::spawn(worker.stay());
                }
            });
            strangers.seat(from, stranger.abort_handle());
        }
    }

    /// A worker, if the stranger is one.
    async fn greet(&self, incoming: Incoming) -> Option<RemoteWorker> {
        let address = incoming.remote_address();
        match tokio::time::timeout(STRANGER_PATIENCE, self.admit(incoming)).await {
            Ok(Ok(worker)) => Some(worker),
            Ok(Err(reason)) => self.turn_away(address, &reason),
            Err(_) => self.turn_away(address, "it said nothing in time"),
        }
    }

    fn turn_away(&self, address: std::net::SocketAddr, reason: &str) -> Option<RemoteWorker> {
        tracing::warn!("refused {address}: {reason}");
        let _ = self.dispatcher.send(Note::Refused);
        None
    }

    /// The worker, or what is wrong with it; it has been told then.
    async fn admit(&self, incoming: Incoming) -> Result<RemoteWorker, String> {
        let connection = incoming.await.map_err(|error| format!("no igi worker ({error})"))?;
        let (send, recv) = connection.accept_bi().await.map_err(|error| format!("it went away ({error})"))?;
        let mut streams = (send, recv);
        match self.examine(&connection, &mut streams).await {
            Ok((hello, token)) => {
                connection.set_receive_window(VarInt::from_u32(WORKER_WINDOW));
                connection.set_max_concurrent_uni_streams(VarInt::from_u32(ANSWERS_MAX));
                let number = self.next.fetch_add(1, Ordering::Relaxed);
                let (dispatcher, traffic) = (self.dispatcher.clone(), Arc::clone(&self.traffic));
                let (keys, token) = (Arc::clone(&self.keys), token.fingerprint);
                Ok(RemoteWorker { number, hello, keys, token, connection, streams, dispatcher, traffic })
            }
            Err(reason) => {
                let refusal = Refusal { reason: cut(&reason, REASON_MAX) };
                let _ = send_message(&mut streams.0, &refusal).await;
                let _ = streams.0.finish();
                // The message is lost if the connection is closed before they have arrived.
                let _ = tokio::time::timeout(Duration::from_secs(1), streams.0.stopped()).await;
                connection.close(VarInt::from_u32(1), b"refused");
                Err(reason)
            }
        }
    }

    async fn examine(
        &self,
        connection: &Connection,
        streams: &mut (SendStream, RecvStream),
    ) -> Result<(Hello, Token), String> {
        let (send, recv) = streams;
        let (header, body) = read(recv, |kind| kind == Kind::Hello, usize::MAX).await.map_err(|error| match error {
            ReadError::Wire(error) => error.to_string(),
            ReadError::Stream(reason) => format!("it hung up ({reason})"),
        })?;
        let hello: Hello = decode(header.kind, &body).map_err(|error| error.to_string())?;
        let mut channel = Channel::default();
        connection
            .export_keying_material(&mut channel, EXPORT_LABEL, b"")
            .map_err(|_| "TLS exports no keying material".to_owned())?;
        let token = match self.keys.open(&channel, &hello.proof, unix_time()) {
            Opens::Door(token) => token,
            Opens::Expired => return Err("the token has expired: the master has to be given a fresh one".into()),
            Opens::Nothing => return Err("wrong token: take the one that the master prints".into()),
        };
        let bits = of_this_build();
        if hello.bits != bits {
            let [theirs, ours] = [hello.bits, bits].map(|bits| crate::spoken::hex(&bits));
            return Err(format!(
                "it computes other bits ({theirs}) than this master ({ours}): install the same build on both sides"
            ));
        }
        send_message(send, &Welcome { proof: token.prove(Role::Master, &channel) }).await?;
        Ok((hello, token))
    }
}

async fn send_message<T: Control>(send: &mut SendStream, message: &T) -> Result<(), String> {
    let bytes = encode(message).map_err(|error| error.to_string())?;
    send.write_all(&bytes).await.map_err(|error| error.to_string())
}
