//! The tokens that are valid now, with the certificate of each; a running master can be given others.
//!
//! A worker asks for the certificate that its token pins by its name ([`protocol::identity::server_name`]); who asks for
//! another is shown that of the first token. What lets a worker in is its proof of one of the tokens. A token that is
//! taken out opens nothing any more, and who came in with it is told so and sent away.

use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard};

use protocol::identity::{Channel, Fingerprint, Proof, Role, Token, server_name};
use protocol::token_file::Entry;
use rustls::crypto::ring::sign::any_supported_type;
use rustls::server::{ClientHello, ResolvesServerCert};
use rustls::sign::CertifiedKey;
use tokio::sync::watch;

use super::key::Identity;

/// See the module's documentation. Never empty.
#[derive(Debug)]
pub(super) struct Keys {
    valid: RwLock<Vec<Key>>,
    /// Counts changes.
    changes: watch::Sender<u64>,
}

#[derive(Clone, Debug)]
struct Key {
    entry: Entry,
    certified: Arc<CertifiedKey>,
}

/// What a proof opens.
pub(super) enum Opens {
    /// It is of this token.
    Door(Token),
    /// It is of a token that has expired.
    Expired,
    /// It is of none that is valid.
    Nothing,
}

impl Keys {
    /// # Errors
    /// In words: a token is not one of this program's.
    pub(super) fn new(entries: Vec<Entry>) -> Result<Self, String> {
        let valid = entries.into_iter().map(Key::new).collect::<Result<Vec<_>, _>>()?;
        if valid.is_empty() {
            return Err("there is no token".into());
        }
        Ok(Self { valid: RwLock::new(valid), changes: watch::Sender::new(0) })
    }

    /// The token for new workers.
    pub(super) fn first(&self) -> Token {
        self.valid()[0].entry.token.clone()
    }

    /// All that are valid, the one for new workers first.
    pub(super) fn tokens(&self) -> Vec<Token> {
        self.valid().iter().map(|key| key.entry.token.clone()).collect()
    }

    /// From now on, these are valid and no others.
    ///
    /// # Errors
    /// As [`Self::new`]; then nothing is changed.
    pub(super) fn replace(&self, entries: Vec<Entry>) -> Result<(), String> {
        let others = Self::new(entries)?.valid.into_inner().unwrap_or_else(PoisonError::into_inner);
        self.change(|valid| *valid = others);
        Ok(())
    }

    /// Takes out what is revoked by now, seconds since the beginning of 1970; the first stays.
    pub(super) fn tidy(&self, now: u64) {
        let is_due = |key: &Key| key.entry.until.is_some_and(|until| until <= now);
        if self.valid().iter().skip(1).any(is_due) {
            let mut number = 0;
            self.change(|valid| {
                valid.retain(|key| {
                    number += 1;
                    number == 1 || !is_due(key)
                });
            });
        }
    }

    /// What a worker's proof opens, at a moment as above. Takes the same time for every wrong proof.
    pub(super) fn open(&self, channel: &Channel, proof: &Proof, now: u64) -> Opens {
        let mut opens = Opens::Nothing;
        for Key { entry: Entry { token, .. }, .. } in self.valid().iter() {
            if token.verify(Role::Worker, channel, proof) {
                // Only who has the token learns that it has expired.
                opens = if token.is_expired(now) { Opens::Expired } else { Opens::Door(token.clone()) };
            }
        }
        opens
    }

    /// Waits until a token is valid no more.
    pub(super) async fn revoked(&self, token: Fingerprint) {
        let mut changes = self.changes.subscribe();
        // The sender is our own: there is no end but this.
        let _ = changes.wait_for(|_| !self.valid().iter().any(|key| key.entry.token.fingerprint == token)).await;
    }

    fn valid(&self) -> RwLockReadGuard<'_, Vec<Key>> {
        self.valid.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, change: impl FnOnce(&mut Vec<Key>)) {
        change(&mut self.valid.write().unwrap_or_else(PoisonError::into_inner));
        self.changes.send_modify(|changes| *changes += 1);
    }
}

impl Key {
    fn new(entry: Entry) -> Result<Self, String> {
        let Identity { certificate, key, .. } = Identity::new(entry.token.clone())?;
        let key = any_supported_type(&key).map_err(|error| format!("TLS does not take the key: {error}"))?;
        Ok(Self { entry, certified: Arc::new(CertifiedKey::new(vec![certificate], key)) })
    }
}

impl ResolvesServerCert for Keys {
    fn resolve(&self, hello: ClientHello<'_>) -> Option<Arc<CertifiedKey>> {
        let valid = self.valid();
        let named = |key: &&Key| hello.server_name() == Some(&*server_name(&key.entry.token.fingerprint));
        valid.iter().find(named).or(valid.first()).map(|key| Arc::clone(&key.certified))
    }
}
