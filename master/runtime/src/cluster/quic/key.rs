//! The master's token, and the key and certificate that belong to it.
//!
//! Key and certificate are functions of the master's own secret, so that a master that is started again
//! with the same token is the same master to its workers. Workers need only their half of the token, which does not have it.

use protocol::identity::{Expiry, Token, fingerprint};
use rcgen::{CertificateParams, DistinguishedName, DnType, KeyPair, PKCS_ED25519, SerialNumber, date_time_ymd};
use rustls::crypto::ring;
use rustls::pki_types::{CertificateDer, PrivateKeyDer, PrivatePkcs8KeyDer};

/// Who the master is.
pub(super) struct Identity {
    pub(super) token: Token,
    pub(super) certificate: CertificateDer<'static>,
    pub(super) key: PrivateKeyDer<'static>,
}

impl Identity {
    /// A new master, whose token expires if it is to.
    pub(super) fn fresh(expires: Option<Expiry>) -> Result<Self, String> {
        Self::of(fresh_secret()?, expires)
    }

    /// The master that a token is for.
    pub(super) fn new(token: Token) -> Result<Self, String> {
        let Some(secret) = token.own else {
            return Err(
                "this is the workers' half of a token: a master needs the whole, which begins with `igi`; make one \
                        with `igi-master token`"
                    .into(),
            );
        };
        let own = Self::of(secret, token.expires)?;
        if own.token == token {
            return Ok(own);
        }
        Err("the token was made by another version of this program: start once without a token, and take the one that is \
             printed"
            .into())
    }

    fn of(secret: [u8; 16], expires: Option<Expiry>) -> Result<Self, String> {
        let seed = Token::key_seed(&secret, expires);
        let (certificate, key) = certify(&seed).map_err(|error| format!("cannot make a certificate: {error}"))?;
        let token = Token::whole(fingerprint(&certificate), secret, expires);
        Ok(Self { token, certificate, key })
    }
}

/// Random bits of the system.
pub(super) fn fresh_secret() -> Result<[u8; 16], String> {
    let mut secret = [0; 16];
    let random = ring::default_provider().secure_random;
    random.fill(&mut secret).map_err(|_| "the system has no random numbers")?;
    Ok(secret)
}

/// An Ed25519 key and its self-signed certificate: the same bytes for the same seed.
fn certify(seed: &[u8; 32]) -> Result<(CertificateDer<'static>, PrivateKeyDer<'static>), rcgen::Error> {
    let pkcs8 = PrivatePkcs8KeyDer::from([&PKCS8_ED25519[..], seed].concat());
    let key = KeyPair::from_pkcs8_der_and_sign_algo(&pkcs8, &PKCS_ED25519)?;
    let mut params = CertificateParams::new(vec!["igi".to_owned()])?;
    params.distinguished_name = DistinguishedName::new();
    params.distinguished_name.push(DnType::CommonName, "igi master");
    params.serial_number = Some(SerialNumber::from(1));
    // Workers look at the fingerprint alone; dates are there because a certificate has dates.
    (params.not_before, params.not_after) = (date_time_ymd(2000, 1, 1), date_time_ymd(4000, 1, 1));
    let certificate = params.self_signed(&key)?;
    Ok((certificate.der().clone(), PrivateKeyDer::Pkcs8(pkcs8)))
}

/// What stands before the 32 bytes of an Ed25519 seed in PKCS#8 (RFC 8410, section 7).
const PKCS8_ED25519: [u8; 16] = [0x30, 0x2e, 2, 1, 0, 0x30, 5, 6, 3, 0x2b, 0x65, 0x70, 4, 0x22, 4, 0x20];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_brings_the_same_master_back() {
        let first = Identity::fresh(None).unwrap();
        let again = Identity::new(first.token.clone()).unwrap();
        assert_eq!(first.certificate, again.certificate);
        assert_eq!(first.token, again.token);
        assert_ne!(first.token, Identity::fresh(None).unwrap().token);
    }

    #[test]
    fn a_token_whose_expiry_was_moved_is_refused() {
        let token = Identity::fresh(Expiry::new(1000)).unwrap().token;
        assert!(Identity::new(token.clone()).is_ok());
        for expires in [None, Expiry::new(2000)] {
            assert!(Identity::new(Token { expires, ..token.clone() }).is_err());
        }
    }

    #[test]
    fn a_token_of_another_certificate_is_refused() {
        let token = Token::whole([0; 16], [1; 16], None);
        assert!(Identity::new(token).is_err());
    }
}
