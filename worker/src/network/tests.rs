//! Masters that are not what they should be.

use std::net::SocketAddr;
use std::sync::Arc;

use protocol::identity::{Channel, EXPORT_LABEL, Role, fingerprint};
use protocol::message::{
    ALPN, Control, Hello, Refusal, ToMaster, ToWorker, VERSION, Welcome, decode, encode, encode_blob_header,
};
use protocol::parts::hash;
use protocol::question::WorldState;
use quinn::crypto::rustls::QuicServerConfig;
use quinn::{Connection, ServerConfig};
use rustls::crypto::ring;
use rustls::pki_types::PrivateKeyDer;

use super::*;

/// A master that answers the first hello with what `reply` makes of the connection, and returns good-byes.
fn master(reply: impl Fn(&Connection) -> Vec<u8> + Send + 'static) -> (SocketAddr, Token) {
    let certified = rcgen::generate_simple_self_signed(vec!["igi".to_owned()]).unwrap();
    let certificate = certified.cert.der().clone();
    let token = Token { fingerprint: fingerprint(&certificate), secret: [5; 16], expires: None, own: None };
    let key = PrivateKeyDer::try_from(certified.signing_key.serialize_der()).unwrap();
    let mut tls = rustls::ServerConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_protocol_versions(&[&rustls::version::TLS13])
        .unwrap()
        .with_no_client_auth()
        .with_single_cert(vec![certificate], key)
        .unwrap();
    tls.alpn_protocols = vec![ALPN.to_vec()];
    let config = ServerConfig::with_crypto(Arc::new(QuicServerConfig::try_from(tls).unwrap()));
    let endpoint = Endpoint::server(config, "127.0.0.1:0".parse().unwrap()).unwrap();
    let address = endpoint.local_addr().unwrap();
    tokio::spawn(async move {
        while let Some(incoming) = endpoint.accept().await {
            let Ok(connection) = incoming.await else { continue };
            let Ok((mut send, mut recv)) = connection.accept_bi().await else { continue };
            let _ = recv.read(&mut [0; 4096]).await;
            let _ = send.write_all(&reply(&connection)).await;
            while let Ok((header, body)) = session::read(&mut recv).await {
                if let Ok(ToMaster::Goodbye { reason }) = decode(header.kind, &body) {
                    let _ = send.write_all(&bytes(&ToWorker::Goodbye { reason })).await;
                }
            }
        }
    });
    (address, token)
}

async fn outcome(address: SocketAddr, token: Token) -> Result<(), NetworkError> {
    let master = Some(address.to_string());
    let (cache, name) = (None, "test".into());
    let options = Options { master, token, token_file: None, threads: 1, cache, name, once: true, metrics: None };
    let (_sign, stop) = watch::channel(StopSign::Work);
    tokio::time::timeout(Duration::from_secs(20), work(&options, stop)).await.expect("it does not try for ever")
}

async fn refusal_after(reply: impl Fn(&Connection) -> Vec<u8> + Send + 'static) -> String {
    let (address, token) = master(reply);
    match outcome(address, token).await {
        Err(NetworkError::Refused(reason)) => reason,
        other => panic!("{other:?}"),
    }
}

fn bytes<T: Control>(message: &T) -> Vec<u8> {
    encode(message).unwrap()
}

#[tokio::test]
async fn a_master_of_another_version_is_told_from_its_first_word() {
    let reason = refusal_after(|_| {
        let mut newer = bytes(&Refusal { reason: "you are old".into() });
        newer[4..6].copy_from_slice(&(VERSION + 1).to_le_bytes());
        newer
    });
    let reason = reason.await;
    assert!(reason.contains(&format!("version {}", VERSION + 1)) && reason.contains("install"), "{reason}");
}

#[tokio::test]
async fn the_masters_reason_is_passed_on() {
    let reason = refusal_after(|_| bytes(&Refusal { reason: "the house is full".into() })).await;
    assert!(reason.contains("the house is full"), "{reason}");
}

#[tokio::test]
async fn a_master_that_talks_nonsense_is_left() {
    assert!(refusal_after(|_| b"220 mail.example.org ESMTP\r\n".to_vec()).await.contains("no igi peer"));
    let question = Hello { proof: [0; 32], threads: 1, name: String::new(), bits: [0; 8] };
    assert!(refusal_after(move |_| bytes(&question)).await.contains("no place here"));
}

#[tokio::test]
async fn a_master_without_the_secret_is_left() {
    let guess = |connection: &Connection| {
        let mut channel = Channel::default();
        connection.export_keying_material(&mut channel, EXPORT_LABEL, b"").unwrap();
        let other = Token { fingerprint: [0; 16], secret: [6; 16], expires: None, own: None };
        bytes(&Welcome { proof: other.prove(Role::Master, &channel) })
    };
    assert!(refusal_after(guess).await.contains("secret"));
}

#[tokio::test]
async fn another_certificate_is_refused_before_anything_is_said() {
    let (address, token) = master(|_| Vec::new());
    let other = Token { fingerprint: [1; 16], ..token };
    let Err(NetworkError::Refused(reason)) = outcome(address, other).await else { panic!("it was let in") };
    assert!(reason.contains("not the master that this token is for"), "{reason}");
}

/// The first words of a master that has the secret.
fn welcome(connection: &Connection, token: &Token) -> Vec<u8> {
    let mut channel = Channel::default();
    connection.export_keying_material(&mut channel, EXPORT_LABEL, b"").unwrap();
    bytes(&Welcome { proof: token.prove(Role::Master, &channel) })
}

#[tokio::test]
async fn a_scene_that_cannot_be_built_is_no_good_end() {
    const RUBBISH: &[u8] = b"this is no list of parts";
    let (address, token) = master(|connection| {
        let world = hash(RUBBISH);
        let stranger = Token { fingerprint: [0; 16], secret: [5; 16], expires: None, own: None };
        let mut message = welcome(connection, &stranger);
        message.extend(bytes(&ToWorker::World { state: WorldState { world, revision: 0 }, changes: Vec::new() }));
        let connection = connection.clone();
        tokio::spawn(async move {
            let mut stream = connection.open_uni().await.unwrap();
            stream.write_all(&encode_blob_header(&world, RUBBISH.len())).await.unwrap();
            stream.write_all(RUBBISH).await.unwrap();
            stream.finish().unwrap();
            let _ = stream.stopped().await;
        });
        message
    });
    match outcome(address, token).await {
        Err(NetworkError::Broken(reason)) => assert!(reason.contains("cannot build the scene"), "{reason}"),
        other => panic!("it says that all is well, or that the master is to blame: {other:?}"),
    }
}

#[tokio::test]
async fn whoever_only_announces_itself_as_the_master_is_passed_by() {
    let (impostor, _) = master(|_| Vec::new());
    let (address, token) = master(|_| Vec::new());
    let nowhere = "127.0.0.1:0".parse().unwrap();
    let (master, cache, name) = (None, None, "test".into());
    let found = Options { master, token, token_file: None, threads: 1, cache, name, once: true, metrics: None };
    let connection = session::reach(&found, &[nowhere, impostor, address]).await.expect("the last is the right one");
    assert_eq!(connection.remote_address(), address);
    let lost = session::reach(&found, &[impostor]).await.unwrap_err();
    assert!(matches!(&lost, NetworkError::Lost(reason) if reason.contains(&impostor.to_string())), "{lost}");
    let named = Options { master: Some(impostor.to_string()), ..found };
    assert!(matches!(session::reach(&named, &[impostor]).await, Err(NetworkError::Refused(_))));
}
