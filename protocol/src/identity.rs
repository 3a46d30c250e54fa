//! Who may join: a token in two halves, of which one is given from the master's screen to the worker's command line.
//!
//! A token holds the beginning of the SHA-256 of the master's certificate, so that the worker
//! knows its master, and a secret, so that the master knows its workers. The secret never crosses
//! the wire: each side proves that it has it by an HMAC over keying material exported from their
//! TLS session (RFC 5705). A proof is worth nothing in any other session.
//!
//! The master's *whole* token has a secret of its own. From that follow its key, so that a token outlives a restart
//! of the master, and the workers' secret; neither leads back to it. A *worker's half* has the workers' secret only: who has
//! it can join, and cannot be the master. Workers take a whole token as well.

use std::fmt;
use std::str::FromStr;

use hmac::{Hmac, Mac};
use sha2::{Digest, Sha256};

/// What a worker needs to know to join a master, or a master to be that master. A whole one is written `igi1-` and 55
/// letters and digits, a worker's half `igw1-` and as many; those that expire `igi2-` and `igw2-`, and 61.
#[derive(Clone, PartialEq, Eq)]
pub struct Token {
    /// Of the master's certificate, see [`fingerprint`].
    pub fingerprint: Fingerprint,
    /// What workers prove to have: 128 bits.
    pub secret: [u8; 16],
    /// Nobody is let in with it any more from then on, by the master's clock.
    pub expires: Option<Expiry>,
    /// The master's own 128 random bits, from which all else follows; not in a worker's half.
    pub own: Option<[u8; 16]>,
}

/// A moment, seconds since the beginning of 1970 (UTC); never 0.
pub type Expiry = std::num::NonZeroU32;

/// The first 128 bits of the SHA-256 of a certificate in DER.
pub type Fingerprint = [u8; 16];

/// Keying material exported from a TLS session, see [`EXPORT_LABEL`].
pub type Channel = [u8; 32];

/// The label under which both sides export keying material; the context is empty.
pub const EXPORT_LABEL: &[u8] = b"EXPORTER-igi-join";

/// An HMAC-SHA-256.
pub type Proof = [u8; 32];

/// Whose proof it is: the master's cannot be sent back as the worker's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The side that listens.
    Master,
    /// The side that connects.
    Worker,
}

/// Text that is no token.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoToken {
    /// Something else altogether.
    #[error("a token begins with `igw1-`, `igw2-`, `igi1-` or `igi2-`; copy it whole from what the master prints")]
    Prefix,
    /// A character went missing or came in.
    #[error(
        "after its first five characters, this token should have {wanted}, and has {found}; copy it whole from what the master prints"
    )]
    Length {
        /// Characters it should have.
        wanted: usize,
        /// Characters it has.
        found: usize,
    },
    /// A character is another.
    #[error("the token has a typing error (its check sum is wrong); copy it whole from what the master prints")]
    Checksum,
}

/// What whole tokens begin with, those that last and those that expire; then workers' halves.
const PREFIXES: [&str; 4] = ["igi1-", "igi2-", "igw1-", "igw2-"];
/// Fingerprint, secret, perhaps a moment, and two bytes of check sum.
const RAW_LEN: [usize; 4] = [16 + 16 + 2, 16 + 16 + 4 + 2, 16 + 16 + 2, 16 + 16 + 4 + 2];

/// Recognises a certificate.
pub fn fingerprint(certificate_der: &[u8]) -> Fingerprint {
    let mut fingerprint = [0; 16];
    fingerprint.copy_from_slice(&Sha256::digest(certificate_der)[..16]);
    fingerprint
}

/// The name by which a worker asks for the certificate that its token pins, so that a master may have several for a
/// while. It says what is announced to everybody anyway.
pub fn server_name(fingerprint: &Fingerprint) -> String {
    let digits: String = fingerprint.iter().map(|byte| format!("{byte:02x}")).collect();
    format!("igi-{digits}")
}

impl Token {
    /// The whole token of the master with this certificate and this secret of its own.
    pub fn whole(fingerprint: Fingerprint, own: [u8; 16], expires: Option<Expiry>) -> Self {
        let proof: Proof = mac_of(&own, b"igi secret of workers").finalize().into_bytes().into();
        let mut secret = [0; 16];
        secret.copy_from_slice(&proof[..16]);
        Self { fingerprint, secret, expires, own: Some(own) }
    }

    /// The half for workers: with it, nobody can be the master.
    pub fn for_workers(&self) -> Self {
        Self { own: None, ..self.clone() }
    }

    /// Proves to the other side of a TLS session that we have the token.
    pub fn prove(&self, role: Role, channel: &Channel) -> Proof {
        self.mac(role, channel).finalize().into_bytes().into()
    }

    /// Whether the other side, in its `role`, has the token. Takes the same time for every wrong proof.
    pub fn verify(&self, role: Role, channel: &Channel, proof: &Proof) -> bool {
        self.mac(role, channel).verify_slice(proof).is_ok()
    }

    fn mac(&self, role: Role, channel: &Channel) -> Hmac<Sha256> {
        let mut mac = mac_of(
            &self.secret,
            match role {
                Role::Master => b"igi master",
                Role::Worker => b"igi worker",
            },
        );
        mac.update(channel);
        mac
    }

    /// What a master at this port writes into the ids of its connections, beside random bytes: by it, the same master knows
    /// them again after it was killed and started again.
    pub fn connection_mark(&self, port: u16, random: &[u8]) -> Proof {
        self.of_port(b"igi connection id", port, random)
    }

    /// What only the master at this port can say of a connection: that it has forgotten it (a stateless reset, RFC 9000,
    /// section 10.3). The port is part of it, so that no other master of the same token can be made to say it.
    pub fn reset_proof(&self, port: u16, connection_id: &[u8]) -> Proof {
        self.of_port(b"igi stateless reset", port, connection_id)
    }

    fn of_port(&self, label: &[u8], port: u16, data: &[u8]) -> Proof {
        // No worker can say it in the master's name.
        let mut mac = mac_of(self.own.as_ref().unwrap_or(&self.secret), label);
        mac.update(&port.to_le_bytes());
        mac.update(data);
        mac.finalize().into_bytes().into()
    }

    /// The seed of the master's private key: whoever has its own secret can be the master again. The expiry is part of it: a
    /// token with another expiry is that of another master.
    pub fn key_seed(own: &[u8; 16], expires: Option<Expiry>) -> [u8; 32] {
        let mut mac = mac_of(own, b"igi master key");
        if let Some(expires) = expires {
            mac.update(&expires.get().to_le_bytes());
        }
        mac.finalize().into_bytes().into()
    }

    /// Whether nobody is let in with it any more, `now` seconds after the beginning of 1970.
    pub fn is_expired(&self, now: u64) -> bool {
        self.expires.is_some_and(|expires| u64::from(expires.get()) <= now)
    }

    /// All that is written down, but the check sum.
    fn raw(&self) -> Vec<u8> {
        let expires = self.expires.map(|expires| expires.get().to_le_bytes());
        let secret = self.own.as_ref().unwrap_or(&self.secret);
        [&self.fingerprint[..], secret, expires.as_ref().map_or(&[], |bytes| &bytes[..])].concat()
    }
}

impl fmt::Display for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut raw = self.raw();
        raw.extend(checksum(&raw));
        let kind = usize::from(self.expires.is_some()) + if self.own.is_some() { 0 } else { 2 };
        write!(f, "{}{}", PREFIXES[kind], base32(&raw))
    }
}

/// Logs show whom a token belongs to, never its secret.
impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Token({}…)", base32(&self.fingerprint[..5]))
    }
}

impl FromStr for Token {
    type Err = NoToken;

    fn from_str(text: &str) -> Result<Self, NoToken> {
        let text = text.trim().to_ascii_lowercase();
        let mut kinds = PREFIXES.iter().enumerate().zip(RAW_LEN);
        let (kind, body, length) = kinds
            .find_map(|((kind, prefix), length)| Some((kind, text.strip_prefix(prefix)?, length)))
            .ok_or(NoToken::Prefix)?;
        let wanted = text_len(length);
        if body.len() != wanted {
            return Err(NoToken::Length { wanted, found: body.chars().count() });
        }
        let raw = unbase32(body).filter(|raw| raw.len() == length).ok_or(NoToken::Checksum)?;
        let part = |from: usize| std::array::from_fn(|i| raw[from + i]);
        let moment = || u32::from_le_bytes(std::array::from_fn(|i| raw[32 + i]));
        let expires = if length == RAW_LEN[1] { Expiry::new(moment()) } else { None };
        let (fingerprint, secret) = (part(0), part(16));
        let token = match kind {
            0 | 1 => Self::whole(fingerprint, secret, expires),
            _ => Self { fingerprint, secret, expires, own: None },
        };
        if token.to_string() == text { Ok(token) } else { Err(NoToken::Checksum) }
    }
}

fn mac_of(secret: &[u8; 16], label: &[u8]) -> Hmac<Sha256> {
    let mut mac = Hmac::<Sha256>::new_from_slice(secret).expect("HMAC takes keys of any length");
    mac.update(label);
    mac
}

fn checksum(raw: &[u8]) -> [u8; 2] {
    let digest = Sha256::digest(raw);
    [digest[0], digest[1]]
}

/// Digits of so many bytes.
const fn text_len(raw: usize) -> usize {
    (raw * 8).div_ceil(5)
}

/// RFC 4648 in lower case without padding: no character looks like another, a double click marks all.
const ALPHABET: &[u8; 32] = b"abcdefghijklmnopqrstuvwxyz234567";

fn base32(bytes: &[u8]) -> String {
    let bit = |i: usize| bytes.get(i / 8).is_some_and(|byte| byte >> (7 - i % 8) & 1 == 1);
    let digit = |start: usize| (start..start + 5).fold(0, |digit, i| digit << 1 | usize::from(bit(i)));
    (0..bytes.len() * 8).step_by(5).map(|start| char::from(ALPHABET[digit(start)])).collect()
}

fn unbase32(text: &str) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    let (mut pending, mut bits) = (0_u32, 0);
    for character in text.bytes() {
        let digit = ALPHABET.iter().position(|known| *known == character)?;
        pending = pending << 5 | digit as u32;
        bits += 5;
        if bits >= 8 {
            bits -= 8;
            bytes.push((pending >> bits) as u8);
        }
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const TOKEN: Token = Token { fingerprint: [7; 16], secret: [9; 16], expires: None, own: None };

    proptest! {
        #[test]
        fn tokens_survive_being_written_down(fingerprint: [u8; 16], secret: [u8; 16], expires: u32, is_half: bool, at in 0..55_usize) {
            let whole = Token::whole(fingerprint, secret, Expiry::new(expires % 3));
            let token = if is_half { whole.for_workers() } else { whole };
            let text = token.to_string();
            prop_assert_eq!(text.len(), if token.expires.is_some() { 66 } else { 60 });
            prop_assert_eq!(text.starts_with("igw"), is_half);
            prop_assert_eq!(format!(" {}\n", text.to_uppercase()).parse(), Ok(token));

            let mut wrong = text.into_bytes();
            let place = 5 + at;
            wrong[place] = if wrong[place] == b'a' { b'b' } else { b'a' };
            prop_assert_eq!(String::from_utf8(wrong).unwrap().parse::<Token>(), Err(NoToken::Checksum));
        }

        #[test]
        fn no_text_panics(text: String) {
            let _ = text.parse::<Token>();
            for prefix in PREFIXES {
                let _ = format!("{prefix}{text}").parse::<Token>();
            }
        }
    }

    #[test]
    fn a_proof_holds_for_one_role_one_session_and_one_secret() {
        let (here, elsewhere) = ([1; 32], [2; 32]);
        let proof = TOKEN.prove(Role::Worker, &here);
        assert!(TOKEN.verify(Role::Worker, &here, &proof));
        assert!(!TOKEN.verify(Role::Master, &here, &proof));
        assert!(!TOKEN.verify(Role::Worker, &elsewhere, &proof));
        let other = Token { secret: [8; 16], ..TOKEN };
        assert!(!other.verify(Role::Worker, &here, &proof));
    }

    /// Who has it can prove to be a worker, and has nothing that the master's secret or key could be made of.
    #[test]
    fn a_workers_half_lets_in_and_is_no_master() {
        let whole = Token::whole([7; 16], [9; 16], None);
        let half: Token = whole.for_workers().to_string().parse().unwrap();
        assert!(whole.verify(Role::Worker, &[1; 32], &half.prove(Role::Worker, &[1; 32])));
        assert_eq!((half.own, half.fingerprint), (None, whole.fingerprint));
        assert_ne!(half.secret, [9; 16]);
        assert!(!half.to_string().contains(&base32(&[9; 16])[..20]));
        assert_ne!(half.reset_proof(7, b"id"), whole.reset_proof(7, b"id"));
    }

    #[test]
    fn wrong_texts_are_told_apart() {
        assert_eq!("hello".parse::<Token>(), Err(NoToken::Prefix));
        assert_eq!("igi1-abc".parse::<Token>(), Err(NoToken::Length { wanted: 55, found: 3 }));
        assert_eq!(format!("igi1-{}", "1".repeat(55)).parse::<Token>(), Err(NoToken::Checksum));
        // A moment of 0 is none: such a token would have two ways to be written.
        let raw = [0; 36];
        let zero = base32(&[&raw[..], &checksum(&raw)].concat());
        assert_eq!(format!("igi2-{zero}").parse::<Token>(), Err(NoToken::Checksum));
    }

    #[test]
    fn an_expiry_belongs_to_its_master() {
        let [soon, later] = [1000, 2000].map(Expiry::new);
        let token = Token { expires: soon, ..TOKEN };
        assert!(!token.is_expired(999) && token.is_expired(1000) && !TOKEN.is_expired(u64::MAX));
        let seeds = [None, soon, later].map(|expires| Token::key_seed(&TOKEN.secret, expires));
        assert!(
            seeds[0] != seeds[1] && seeds[1] != seeds[2],
            "who moves it has the token of a master that is not there"
        );
    }

    #[test]
    fn the_secret_is_not_logged() {
        assert!(!format!("{TOKEN:?}").contains(&base32(&TOKEN.secret)[..5]));
    }
}
