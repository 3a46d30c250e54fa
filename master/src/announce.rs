//! Says on the local network where this master is, so that workers find it by their token alone.

use std::net::SocketAddr;

use mdns_sd::{IfKind, ServiceDaemon, ServiceInfo};
use protocol::discovery::{Notice, SERVICE};
use protocol::identity::Token;
use protocol::message::VERSION;

/// Announces until it is dropped.
pub struct Announcement {
    daemon: ServiceDaemon,
    name: String,
}

impl Announcement {
    /// A master with this token listens at this address. One that listens at this machine's own address alone is
    /// announced to this machine alone.
    ///
    /// # Errors
    /// In words: multicast DNS cannot be spoken here.
    pub fn begin(token: &Token, address: SocketAddr) -> Result<Self, String> {
        Self::try_begin(token, address).map_err(|error| error.to_string())
    }

    fn try_begin(token: &Token, address: SocketAddr) -> mdns_sd::Result<Self> {
        let daemon = ServiceDaemon::new()?;
        let ip = address.ip();
        if ip.is_loopback() {
            daemon.disable_interface(IfKind::All)?;
        }
        daemon.enable_interface(IfKind::LoopbackV4)?;
        let notice = Notice { version: VERSION, fingerprint: token.fingerprint };
        let text = notice.text();
        // A name of its own: several masters of a machine do not meet.
        let name: String = token.fingerprint[..4].iter().map(|byte| format!("{byte:02x}")).collect();
        let properties: Vec<(&str, &str)> = text.iter().map(|(key, value)| (*key, value.as_str())).collect();
        let host = format!("igi-{name}.local.");
        let ips = if ip.is_unspecified() { String::new() } else { ip.to_string() };
        let service = ServiceInfo::new(SERVICE, &format!("igi-{name}"), &host, &*ips, address.port(), &properties[..])?;
        let service = if ip.is_unspecified() { service.enable_addr_auto() } else { service };
        let name = service.get_fullname().to_owned();
        daemon.register(service)?;
        Ok(Self { daemon, name })
    }
}

impl Drop for Announcement {
    /// Takes it back: who has heard it forgets it.
    fn drop(&mut self) {
        if let Ok(done) = self.daemon.unregister(&self.name) {
            let _ = done.recv_timeout(std::time::Duration::from_millis(500));
        }
        let _ = self.daemon.shutdown();
    }
}
