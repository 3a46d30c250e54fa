//! The worker's side of TLS: the master is known by its certificate's fingerprint, and by nothing else.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use protocol::identity::{Fingerprint, fingerprint};
use protocol::message::ALPN;
use protocol::transport::{CONFIRMED_WITHIN, FIRST_ROUND_TRIP, IDLE_MAX, KEEP_ALIVE, PACKETS_CONFIRMED_AT_ONCE};
use quinn::crypto::rustls::QuicClientConfig;
use quinn::{AckFrequencyConfig, ClientConfig, IdleTimeout, TransportConfig, VarInt};
use rustls::client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier};
use rustls::crypto::ring::cipher_suite::{
    TLS13_AES_128_GCM_SHA256, TLS13_AES_256_GCM_SHA384, TLS13_CHACHA20_POLY1305_SHA256,
};
use rustls::crypto::{CryptoProvider, WebPkiSupportedAlgorithms, ring, verify_tls13_signature};
use rustls::pki_types::{CertificateDer, ServerName, UnixTime};
use rustls::{DigitallySignedStruct, SignatureScheme};

use super::limits::{MASTER_WINDOW, PARTS_IN_FLIGHT, SEND_WINDOW, STREAM_WINDOW};

/// Whether a certificate with the wrong fingerprint was met.
pub(super) type Stranger = Arc<AtomicBool>;

/// The settings of a connection to the master with this fingerprint.
pub(super) fn client_config(master: Fingerprint) -> Result<(ClientConfig, Stranger), rustls::Error> {
    let provider = Arc::new(CryptoProvider {
        // AES-128 costs a third less than AES-256, half less than ChaCha, and is as safe here.
        cipher_suites: vec![TLS13_AES_128_GCM_SHA256, TLS13_AES_256_GCM_SHA384, TLS13_CHACHA20_POLY1305_SHA256],
        ..ring::default_provider()
    });
    let stranger = Stranger::default();
    let pinned =
        Pinned { master, algorithms: provider.signature_verification_algorithms, stranger: Arc::clone(&stranger) };
    let mut tls = rustls::ClientConfig::builder_with_provider(provider)
        .with_protocol_versions(&[&rustls::version::TLS13])?
        .dangerous()
        .with_custom_certificate_verifier(Arc::new(pinned))
        .with_no_client_auth();
    tls.alpn_protocols = vec![ALPN.to_vec()];
    let quic = QuicClientConfig::try_from(tls).map_err(|error| rustls::Error::General(error.to_string()))?;
    let mut config = ClientConfig::new(Arc::new(quic));
    config.transport_config(Arc::new(transport()));
    Ok((config, stranger))
}

fn transport() -> TransportConfig {
    let mut transport = TransportConfig::default();
    transport
        .stream_receive_window(VarInt::from_u32(STREAM_WINDOW))
        .receive_window(VarInt::from_u32(MASTER_WINDOW))
        .send_window(SEND_WINDOW)
        .initial_rtt(FIRST_ROUND_TRIP)
        .max_idle_timeout(Some(IdleTimeout::from(VarInt::from_u32(IDLE_MAX.as_millis() as u32))))
        .keep_alive_interval(Some(KEEP_ALIVE))
        .send_fairness(false)
        .max_concurrent_bidi_streams(VarInt::from_u32(0))
        .max_concurrent_uni_streams(VarInt::from_u32(PARTS_IN_FLIGHT))
        .ack_frequency_config(Some(confirmations()));
    transport
}

/// How often the other side confirms packets.
fn confirmations() -> AckFrequencyConfig {
    let mut often = AckFrequencyConfig::default();
    often.ack_eliciting_threshold(VarInt::from_u32(PACKETS_CONFIRMED_AT_ONCE)).max_ack_delay(Some(CONFIRMED_WITHIN));
    often
}

/// Accepts one certificate. Names, dates and issuers mean nothing; the signature is checked all
/// the same, or anybody could show a copy of the certificate.
#[derive(Debug)]
struct Pinned {
    master: Fingerprint,
    algorithms: WebPkiSupportedAlgorithms,
    stranger: Stranger,
}

impl ServerCertVerifier for Pinned {
    fn verify_server_cert(
        &self,
        certificate: &CertificateDer<'_>,
        _: &[CertificateDer<'_>],
        _: &ServerName<'_>,
        _: &[u8],
        _: UnixTime,
    ) -> Result<ServerCertVerified, rustls::Error> {
        if fingerprint(certificate) == self.master {
            return Ok(ServerCertVerified::assertion());
        }
        self.stranger.store(true, Ordering::Relaxed);
        Err(rustls::Error::InvalidCertificate(rustls::CertificateError::ApplicationVerificationFailure))
    }

    fn verify_tls12_signature(
        &self,
        _: &[u8],
        _: &CertificateDer<'_>,
        _: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, rustls::Error> {
        Err(rustls::Error::General("QUIC has no TLS 1.2".into()))
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signature: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, rustls::Error> {
        verify_tls13_signature(message, certificate, signature, &self.algorithms)
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        self.algorithms.supported_schemes()
    }
}
