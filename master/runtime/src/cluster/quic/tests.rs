//! Strangers and liars at the door, while the others go on.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, Instant};

use protocol::identity::{Channel, EXPORT_LABEL, Role, Token};
use protocol::message::{
    ALPN, Answered, Control, Header, Hello, Kind, Refusal, ToMaster, ToWorker, VERSION, Welcome, decode, encode,
};
use protocol::schedule::{QuestionId, WorkerState};
use protocol::token_file::Entry;
use quinn::crypto::rustls::QuicClientConfig;
use quinn::{ClientConfig, Connection, Endpoint, RecvStream, SendStream, TokioRuntime, TransportConfig};
use rustls::client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier};
use rustls::crypto::ring;
use rustls::pki_types::{CertificateDer, ServerName, UnixTime};
use rustls::{DigitallySignedStruct, SignatureScheme};

use super::keys::Keys;
use super::remote_worker::{ReadError, read};
use super::{door, endpoint_config, fresh_token, socket};
use crate::cluster::embedded::of_this_build;
use crate::cluster::tests::{self as fakes, PATIENCE, embedded_and_listening};
use crate::cluster::{Cluster, ClusterOptions, Event, Status, WorkerInfo};

/// Trusts everybody: what a stranger would do.
#[derive(Debug)]
struct Naive;

impl ServerCertVerifier for Naive {
    fn verify_server_cert(
        &self,
        _: &CertificateDer<'_>,
        _: &[CertificateDer<'_>],
        _: &ServerName<'_>,
        _: &[u8],
        _: UnixTime,
    ) -> Result<ServerCertVerified, rustls::Error> {
        Ok(ServerCertVerified::assertion())
    }

    fn verify_tls12_signature(
        &self,
        _: &[u8],
        _: &CertificateDer<'_>,
        _: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, rustls::Error> {
        Ok(HandshakeSignatureValid::assertion())
    }

    fn verify_tls13_signature(
        &self,
        _: &[u8],
        _: &CertificateDer<'_>,
        _: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, rustls::Error> {
        Ok(HandshakeSignatureValid::assertion())
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        ring::default_provider().signature_verification_algorithms.supported_schemes()
    }
}

/// A peer of our own making. The endpoint must outlive the connection.
pub(super) struct Peer {
    _endpoint: Endpoint,
    pub(super) connection: Connection,
    pub(super) send: SendStream,
    recv: RecvStream,
}

/// Trusts every master.
pub(super) fn client_config(protocol: &[u8]) -> ClientConfig {
    let mut tls = rustls::ClientConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_protocol_versions(&[&rustls::version::TLS13])
        .unwrap()
        .dangerous()
        .with_custom_certificate_verifier(Arc::new(Naive))
        .with_no_client_auth();
    tls.alpn_protocols = vec![protocol.to_vec()];
    ClientConfig::new(Arc::new(QuicClientConfig::try_from(tls).unwrap()))
}

async fn connect(cluster: &Cluster, protocol: &[u8]) -> Result<Peer, String> {
    connect_to(cluster.address().unwrap(), protocol).await
}

pub(super) async fn connect_to(address: SocketAddr, protocol: &[u8]) -> Result<Peer, String> {
    let endpoint = Endpoint::client("127.0.0.1:0".parse().unwrap()).unwrap();
    let connecting = endpoint.connect_with(client_config(protocol), address, "igi").unwrap();
    let connection = connecting.await.map_err(|error| error.to_string())?;
    let (send, recv) = connection.open_bi().await.map_err(|error| error.to_string())?;
    Ok(Peer { _endpoint: endpoint, connection, send, recv })
}

impl Peer {
    pub(super) async fn send<T: Control>(&mut self, message: &T) {
        self.send.write_all(&encode(message).unwrap()).await.unwrap();
    }

    pub(super) async fn recv<T: Control>(&mut self) -> T {
        match read(&mut self.recv, |_| true, usize::MAX).await {
            Ok((header, body)) => decode(header.kind, &body).unwrap(),
            Err(ReadError::Wire(error)) => panic!("{error}"),
            Err(ReadError::Stream(reason)) => panic!("{reason}"),
        }
    }

    /// Joins as a worker that has the token.
    pub(super) async fn prove(&mut self, token: &Token) {
        let mut channel = Channel::default();
        self.connection.export_keying_material(&mut channel, EXPORT_LABEL, b"").unwrap();
        let proof = token.prove(Role::Worker, &channel);
        self.send(&Hello { proof, threads: 2, name: "liar".into(), bits: of_this_build() }).await;
        let welcome: Welcome = self.recv().await;
        assert!(token.verify(Role::Master, &channel, &welcome.proof));
    }

    async fn answer(&self, bytes: &[u8]) {
        let Ok(mut stream) = self.connection.open_uni().await else { return };
        let _ = stream.write_all(bytes).await;
        let _ = stream.finish();
    }
}

pub(super) fn token(cluster: &Cluster) -> Token {
    cluster.token().unwrap()
}

fn run<T>(story: impl Future<Output = T>) -> T {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    runtime.block_on(async { tokio::time::timeout(PATIENCE, story).await.expect("the story ends in time") })
}

pub(super) fn wait_for(cluster: &Cluster, enough: impl Fn(&Status) -> bool) {
    let mut patience = 500;
    while !enough(&cluster.status()) {
        patience -= 1;
        assert!(patience > 0, "{:?}", cluster.status());
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// What the master tells a stranger who begins with these bytes.
fn refusal_of(first_words: &[u8]) -> String {
    let cluster = embedded_and_listening();
    let refusal: Refusal = run(async {
        let mut stranger = connect(&cluster, ALPN).await.unwrap();
        stranger.send.write_all(first_words).await.unwrap();
        stranger.recv().await
    });
    wait_for(&cluster, |status| status.refused == 1);
    assert_eq!(cluster.status().workers, 1, "only the embedded worker is in");
    refusal.reason
}

#[test]
fn another_version_is_refused_in_words() {
    let mut bytes = encode(&Hello { proof: [0; 32], threads: 1, name: String::new(), bits: [0; 8] }).unwrap();
    bytes[4..6].copy_from_slice(&(VERSION + 1).to_le_bytes());
    let reason = refusal_of(&bytes);
    assert!(reason.contains(&format!("version {}", VERSION + 1)), "{reason}");
}

#[test]
fn a_wrong_proof_is_refused_in_words() {
    let hello = Hello { proof: [0; 32], threads: 1, name: "worker".into(), bits: [0; 8] };
    assert!(refusal_of(&encode(&hello).unwrap()).contains("wrong token"));
}

/// Its answers would be right, and not those of the others.
#[test]
fn a_build_that_computes_other_bits_is_refused_in_words() {
    let cluster = embedded_and_listening();
    let token = token(&cluster);
    let refusal: Refusal = run(async {
        let mut other = connect(&cluster, ALPN).await.unwrap();
        let mut channel = Channel::default();
        other.connection.export_keying_material(&mut channel, EXPORT_LABEL, b"").unwrap();
        let bits = of_this_build().map(|byte| !byte);
        let hello = Hello { proof: token.prove(Role::Worker, &channel), threads: 1, name: "other".into(), bits };
        other.send(&hello).await;
        other.recv().await
    });
    assert!(refusal.reason.contains("other bits") && refusal.reason.contains("same build"), "{}", refusal.reason);
    wait_for(&cluster, |status| status.refused == 1);
    assert_eq!(cluster.status().workers, 1);
}

#[test]
fn an_expired_token_lets_nobody_in_and_sends_nobody_away() {
    let lifetime = Duration::from_secs(2);
    let mut cluster = fakes::listening_for(lifetime);
    let (address, token) = (cluster.address().unwrap(), token(&cluster));
    let _early = run(async {
        let mut early = connect(&cluster, ALPN).await.unwrap();
        early.prove(&token).await;
        early
    });
    std::thread::sleep(lifetime + Duration::from_millis(100));
    let refusal: Refusal = run(async {
        let mut late = connect(&cluster, ALPN).await.unwrap();
        let mut channel = Channel::default();
        late.connection.export_keying_material(&mut channel, EXPORT_LABEL, b"").unwrap();
        let proof = token.prove(Role::Worker, &channel);
        late.send(&Hello { proof, threads: 1, name: "late".into(), bits: of_this_build() }).await;
        late.recv().await
    });
    assert!(refusal.reason.contains("expired"), "{}", refusal.reason);
    wait_for(&cluster, |status| status.refused == 1 && status.workers == 2);
    // Nor does it bring a master back.
    cluster.cancel_all();
    drop(cluster);
    let options = ClusterOptions { listen: Some(address), token: Some(token.to_string()), ..ClusterOptions::default() };
    let error = Cluster::start(options).err().unwrap().to_string();
    assert!(error.contains("expired"), "{error}");
}

/// A master's place at an address, which nobody closes: its end is that of its runtime. The connection is kept there.
fn place(address: SocketAddr, tokens: &[&Token]) -> std::io::Result<(SocketAddr, tokio::runtime::Runtime)> {
    let entries = tokens.iter().map(|token| Entry { token: (*token).clone(), until: None }).collect();
    let keys = Arc::new(Keys::new(entries).unwrap());
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build()?;
    let socket = socket(address)?;
    let address = socket.local_addr()?;
    let mut config = door::server_config(&keys).unwrap();
    config.transport_config(patient());
    let _inside = runtime.enter();
    let endpoint = Endpoint::new(endpoint_config(&keys, address.port()), Some(config), socket, Arc::new(TokioRuntime))?;
    runtime.spawn(async move {
        let _connection = endpoint.accept().await.unwrap().await;
        std::future::pending::<()>().await;
    });
    drop(_inside);
    Ok((address, runtime))
}

/// Silence never ends a connection.
fn patient() -> Arc<TransportConfig> {
    let mut transport = TransportConfig::default();
    transport.max_idle_timeout(None).keep_alive_interval(Some(Duration::from_millis(50)));
    Arc::new(transport)
}

#[test]
fn a_master_that_was_killed_and_started_again_tells_its_workers() {
    let [token, newer] = [fresh_token(None).unwrap(), fresh_token(None).unwrap()];
    // With the same token, or with another one and a grace for the old one.
    for again in [vec![&token], vec![&newer, &token]] {
        let (address, first) = place("127.0.0.1:0".parse().unwrap(), &[&token]).unwrap();
        run(async {
            let worker = Endpoint::client("127.0.0.1:0".parse().unwrap()).unwrap();
            let mut config = client_config(ALPN);
            config.transport_config(patient());
            let connection = worker.connect_with(config, address, "igi").unwrap().await.unwrap();
            first.shutdown_background();
            let _second = loop {
                // On a thread of its own: where the port is not free yet, a runtime is dropped, which must not happen here.
                let tried = std::thread::scope(|scope| scope.spawn(|| place(address, &again)).join().unwrap());
                match tried {
                    Ok((_, runtime)) => break std::mem::ManuallyDrop::new(runtime),
                    Err(_) => tokio::time::sleep(Duration::from_millis(10)).await,
                }
            };
            assert_eq!(connection.closed().await, quinn::ConnectionError::Reset);
        });
    }
}

#[test]
fn garbage_is_refused_in_words() {
    assert!(refusal_of(b"GET / HTTP/1.1\r\n\r\n").contains("no igi peer"));
    assert!(refusal_of(&Header { kind: Kind::Answer, length: 8 }.bytes()).contains("no place here"));
    assert!(refusal_of(&Header { kind: Kind::Hello, length: 1 << 30 }.bytes()).contains("at most"));
    let broken = [&Header { kind: Kind::Hello, length: 3 }.bytes()[..], &[9; 3]].concat();
    assert!(refusal_of(&broken).contains("broken"));
}

#[test]
fn other_protocols_do_not_get_that_far() {
    let cluster = embedded_and_listening();
    assert!(run(connect(&cluster, b"h3")).is_err());
    wait_for(&cluster, |status| status.refused == 1);
}

#[test]
fn a_stranger_cannot_send_answers_and_a_silent_one_is_shown_the_door() {
    let cluster = embedded_and_listening();
    run(async {
        let stranger = connect(&cluster, ALPN).await.unwrap();
        let stream = tokio::time::timeout(Duration::from_millis(300), stranger.connection.open_uni()).await;
        assert!(stream.is_err(), "a stream was granted before the proof");
        stranger.connection.closed().await;
    });
    wait_for(&cluster, |status| status.refused == 1);
}

/// A worker with the token that lies: it claims to be ready and answers with what `lie` makes of a
/// question's number. The embedded worker answers everything; the liar is sent away or asked nothing any more:
/// returns why.
fn liar(lie: impl Fn(QuestionId) -> Vec<u8>) -> String {
    let mut cluster = embedded_and_listening();
    let world = cluster.publish(fakes::scene()).unwrap();
    let token = token(&cluster);
    let mut peer = {
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        let mut peer = runtime.block_on(connect(&cluster, ALPN)).unwrap();
        runtime.block_on(async {
            peer.prove(&token).await;
            let ToWorker::World { state, .. } = peer.recv().await else { panic!("the first message is the world") };
            assert_eq!(state, world);
            peer.send(&ToMaster::Ready { state }).await;
        });
        (peer, runtime)
    };
    wait_for(&cluster, |status| status.ready == 2);
    cluster.ask(fakes::questions(world, 0));
    peer.1.block_on(async {
        // Until it is asked nothing any more.
        loop {
            let message = read(&mut peer.0.recv, |_| true, usize::MAX);
            let Ok(Ok((header, body))) = tokio::time::timeout(Duration::from_secs(1), message).await else { break };
            match decode(header.kind, &body) {
                Ok(ToWorker::Ask { id, .. }) => peer.0.answer(&lie(id)).await,
                Ok(ToWorker::Goodbye { .. }) => break,
                _ => {}
            }
        }
    });
    let (mut answered, mut left, begun) = (0, None, Instant::now());
    while answered < 90 || left.is_none() {
        match cluster.next(Duration::from_millis(50)) {
            Some(Event::Answered { worker, .. }) => {
                assert_eq!(worker, 0, "the liar's answer was taken");
                answered += 1;
            }
            Some(Event::Unanswered { reason, .. }) => panic!("{reason}"),
            Some(Event::WorkerLeft { reason, .. }) => left = Some(reason),
            _ => assert!(begun.elapsed() < PATIENCE, "nothing happens"),
        }
        let quarantined = |info: &&WorkerInfo| info.state == WorkerState::Quarantined;
        left = left.or(cluster.status().list.iter().find(quarantined).and_then(|info| info.reason.clone()));
    }
    left.unwrap()
}

#[test]
fn broken_pixels_are_not_taken_and_their_sender_is_put_into_quarantine() {
    let reason = liar(|id| Answered { id, cost: Default::default(), squeezed: vec![0, 0, 0, 0, 1] }.encode());
    assert!(reason.contains("again and again"), "{reason}");
}

#[test]
fn nonsense_instead_of_an_answer_ends_the_connection() {
    let reason = liar(|_| b"this is not an answer at all".to_vec());
    assert!(reason.contains("nonsense"), "{reason}");
}

#[test]
fn an_answer_longer_than_any_that_was_asked_for_ends_the_connection() {
    let reason = liar(|_| Header { kind: Kind::Answer, length: 1 << 24 }.bytes().to_vec());
    assert!(reason.contains("at most"), "{reason}");
}
