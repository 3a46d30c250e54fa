//! Says on the local network where this master is, so that workers find it by their token alone.

use std::collections::{BTreeMap, BTreeSet};
use std::net::SocketAddr;

use mdns_sd::{IfKind, ServiceDaemon, ServiceInfo};
use protocol::discovery::{Notice, SERVICE};
use protocol::identity::{Fingerprint, Token};
use protocol::message::VERSION;

/// Announces until it is dropped.
pub struct Announcement {
    daemon: ServiceDaemon,
    address: SocketAddr,
    /// By fingerprint, the full names under which we are announced: one for each token, or who has an old one would
    /// not find us.
    names: BTreeMap<Fingerprint, String>,
}

impl Announcement {
    /// A master with these tokens listens at this address. One that listens at this machine's own address alone is
    /// announced to this machine alone.
    ///
    /// # Errors
    /// In words: multicast DNS cannot be spoken here.
    pub fn begin(tokens: &[Token], address: SocketAddr) -> Result<Self, String> {
        let announcement = Self::try_begin(address).map_err(|error| error.to_string())?;
        announcement.with(tokens)
    }

    /// The same for other tokens.
    ///
    /// # Errors
    /// As [`Self::begin`].
    pub fn with(mut self, tokens: &[Token]) -> Result<Self, String> {
        let valid: BTreeSet<_> = tokens.iter().map(|token| token.fingerprint).collect();
        let gone: Vec<_> = self.names.keys().filter(|known| !valid.contains(*known)).copied().collect();
        let gone: Vec<_> = gone.iter().filter_map(|gone| self.names.remove(gone)).collect();
        gone.iter().for_each(|name| self.take_back(name));
        for fingerprint in valid {
            if !self.names.contains_key(&fingerprint) {
                let name = self.announce(fingerprint).map_err(|error| error.to_string())?;
                self.names.insert(fingerprint, name);
            }
        }
        Ok(self)
    }

    fn try_begin(address: SocketAddr) -> mdns_sd::Result<Self> {
        let daemon = ServiceDaemon::new()?;
        let ip = address.ip();
        if ip.is_loopback() {
            daemon.disable_interface(IfKind::All)?;
        }
        daemon.enable_interface(IfKind::LoopbackV4)?;
        Ok(Self { daemon, address, names: BTreeMap::new() })
    }

    fn announce(&self, fingerprint: Fingerprint) -> mdns_sd::Result<String> {
        let (address, ip) = (self.address, self.address.ip());
        let notice = Notice { version: VERSION, fingerprint };
        let text = notice.text();
        // A name of its own: several masters of a machine do not meet.
        let name: String = fingerprint[..4].iter().map(|byte| format!("{byte:02x}")).collect();
        let properties: Vec<(&str, &str)> = text.iter().map(|(key, value)| (*key, value.as_str())).collect();
        let host = format!("igi-{name}.local.");
        let ips = if ip.is_unspecified() { String::new() } else { ip.to_string() };
        let service = ServiceInfo::new(SERVICE, &format!("igi-{name}"), &host, &*ips, address.port(), &properties[..])?;
        let service = if ip.is_unspecified() { service.enable_addr_auto() } else { service };
        let name = service.get_fullname().to_owned();
        self.daemon.register(service)?;
        Ok(name)
    }

    fn take_back(&self, name: &str) {
        if let Ok(done) = self.daemon.unregister(name) {
            let _ = done.recv_timeout(std::time::Duration::from_millis(500));
        }
    }
}

impl Drop for Announcement {
    /// Takes it back: who has heard it forgets it.
    fn drop(&mut self) {
        self.names.values().for_each(|name| self.take_back(name));
        let _ = self.daemon.shutdown();
    }
}
