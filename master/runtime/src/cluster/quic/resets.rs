//! Connections of a master that was killed: the same master, started again, tells their workers at once that it knows
//! nothing of them any more, instead of letting them wait until the silence is too long.
//!
//! QUIC's stateless reset (RFC 9000, section 10.3): with every id of a connection, the worker is given a proof that only
//! its master can make. Packets with an id that nobody knows are answered with the proof that belongs to it. Ids and proofs
//! are functions of a token's secret ([`Token::connection_mark`], [`Token::reset_proof`]), those of the token for new
//! workers at that time, so that another master with the same secret, at the same port, can make them again; as long as
//! the token is valid, other tokens may have come before it. Packets with ids that no valid token has made are not
//! answered at all.

use std::sync::Arc;
use std::time::Duration;

use protocol::identity::Token;
use quinn::crypto::{CryptoError, HmacKey};
use quinn::{ConnectionId, ConnectionIdGenerator};
use quinn_proto::InvalidCid;
use rustls::crypto::ring;

use super::keys::Keys;

/// Random bytes of an id …
const RANDOM_LEN: usize = 4;
/// … before those by which it is known again.
const MARK_LEN: usize = 4;

/// See the module's documentation.
#[derive(Clone)]
pub(super) struct Resets {
    keys: Arc<Keys>,
    port: u16,
}

impl Resets {
    pub(super) fn new(keys: Arc<Keys>, port: u16) -> Self {
        Self { keys, port }
    }

    /// The token that an id was made with.
    fn token_of(&self, id: &[u8]) -> Option<Token> {
        let (random, mark) = id.split_at_checked(RANDOM_LEN)?;
        self.keys.tokens().into_iter().find(|token| token.connection_mark(self.port, random)[..MARK_LEN] == *mark)
    }
}

impl ConnectionIdGenerator for Resets {
    fn generate_cid(&mut self) -> ConnectionId {
        let mut id = [0; RANDOM_LEN + MARK_LEN];
        // Ids need only be different; without random numbers, there would be no TLS either.
        let _ = ring::default_provider().secure_random.fill(&mut id[..RANDOM_LEN]);
        let mark = self.keys.first().connection_mark(self.port, &id[..RANDOM_LEN]);
        id[RANDOM_LEN..].copy_from_slice(&mark[..MARK_LEN]);
        ConnectionId::new(&id)
    }

    fn validate(&self, id: &ConnectionId) -> Result<(), InvalidCid> {
        self.token_of(id).map(drop).ok_or(InvalidCid)
    }

    fn cid_len(&self) -> usize {
        RANDOM_LEN + MARK_LEN
    }

    fn cid_lifetime(&self) -> Option<Duration> {
        None
    }
}

impl HmacKey for Resets {
    fn sign(&self, id: &[u8], proof: &mut [u8]) {
        let token = self.token_of(id).unwrap_or_else(|| self.keys.first());
        proof.copy_from_slice(&token.reset_proof(self.port, id));
    }

    fn signature_len(&self) -> usize {
        size_of::<protocol::identity::Proof>()
    }

    /// Workers compare proofs with those that they were given; nobody asks us.
    fn verify(&self, _: &[u8], _: &[u8]) -> Result<(), CryptoError> {
        Err(CryptoError)
    }
}

#[cfg(test)]
mod tests {
    use protocol::token_file::Entry;

    use super::super::fresh_token;
    use super::*;

    fn resets(tokens: &[&Token], port: u16) -> Resets {
        let entries = tokens.iter().map(|token| Entry { token: (*token).clone(), until: None }).collect();
        Resets::new(Arc::new(Keys::new(entries).unwrap()), port)
    }

    fn proof(resets: &Resets, id: &ConnectionId) -> Vec<u8> {
        let mut proof = vec![0; resets.signature_len()];
        resets.sign(id, &mut proof);
        proof
    }

    #[test]
    fn the_same_master_knows_its_connections_again_and_others_do_not() {
        let [token, other] = [fresh_token(None).unwrap(), fresh_token(None).unwrap()];
        let mut first = resets(&[&token], 7464);
        let id = first.generate_cid();
        let told = proof(&first, &id);
        // Started again, and started again after its token was rotated, with a grace for the old one.
        for again in [resets(&[&token], 7464), resets(&[&other, &token], 7464)] {
            assert!(again.validate(&id).is_ok());
            assert_eq!(proof(&again, &id), told);
        }
        for stranger in [resets(&[&other], 7464), resets(&[&token], 7465)] {
            assert!(stranger.validate(&id).is_err());
            assert_ne!(proof(&stranger, &id), told);
        }
        assert_ne!(first.generate_cid(), id);
        assert!(first.validate(&ConnectionId::new(&[7; 3])).is_err(), "shorter than any id of ours");
    }
}
