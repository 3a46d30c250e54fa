//! Where a master is: named on the command line, or found on the local network by its token.

use std::collections::BTreeSet;
use std::net::{IpAddr, SocketAddr};

use mdns_sd::{IfKind, ServiceDaemon, ServiceEvent};
use protocol::discovery::{Notice, SERVICE};
use protocol::identity::Fingerprint;
use protocol::message::VERSION;

use super::NetworkError;
use super::limits::{ADDRESSES_MAX, MORE_NOTICES, NAME_PATIENCE, NOTICE_PATIENCE};

/// Addresses that a name stands for.
pub(super) async fn look_up(name: &str) -> Result<Vec<SocketAddr>, NetworkError> {
    let lost = |reason: String| NetworkError::Lost(format!("cannot find {name}: {reason}"));
    let found = tokio::time::timeout(NAME_PATIENCE, tokio::net::lookup_host(name))
        .await
        .map_err(|_| lost("no name server answers".into()))?
        .map_err(|error| lost(error.to_string()))?;
    let addresses: Vec<_> = found.take(ADDRESSES_MAX).collect();
    if addresses.is_empty() {
        return Err(NetworkError::Lost(format!("{name} has no address")));
    }
    Ok(addresses)
}

/// Addresses of the master that a token is for, as it announces them.
pub(super) async fn discover(master: Fingerprint) -> Result<Vec<SocketAddr>, NetworkError> {
    let broken = |error: mdns_sd::Error| NetworkError::Lost(format!("cannot look for masters: {error}"));
    let daemon = ServiceDaemon::new().map_err(broken)?;
    // A master may be on this very machine, which may have no network.
    let _ = daemon.enable_interface(IfKind::LoopbackV4);
    let events = daemon.browse(SERVICE).map_err(broken)?;
    let mut notices = Notices::default();
    let mut deadline = tokio::time::Instant::now() + NOTICE_PATIENCE;
    while let Ok(Ok(event)) = tokio::time::timeout_at(deadline, events.recv_async()).await {
        let ServiceEvent::ServiceResolved(service) = event else { continue };
        let notice = Notice::parse(|key| service.get_property_val_str(key));
        let addresses = service.get_addresses().iter().map(|ip| SocketAddr::new(ip.to_ip_addr(), service.get_port()));
        if notices.note(notice, master, addresses) {
            deadline = deadline.min(tokio::time::Instant::now() + MORE_NOTICES);
        }
    }
    let _ = daemon.shutdown();
    notices.verdict()
}

/// What masters announce.
#[derive(Debug, Default)]
struct Notices {
    /// Of ours.
    addresses: Vec<SocketAddr>,
    /// Others, by fingerprint.
    others: BTreeSet<Fingerprint>,
    /// Ours speaks this version.
    other_version: Option<u16>,
}

impl Notices {
    /// Whether it is the one that we look for.
    fn note(
        &mut self,
        notice: Option<Notice>,
        master: Fingerprint,
        addresses: impl Iterator<Item = SocketAddr>,
    ) -> bool {
        match notice {
            Some(notice) if notice.fingerprint != master => {
                // Whoever announces thousands fills no memory.
                if self.others.len() < ADDRESSES_MAX {
                    self.others.insert(notice.fingerprint);
                }
                false
            }
            Some(notice) if notice.version != VERSION => {
                self.other_version = Some(notice.version);
                false
            }
            Some(_) => {
                let new: Vec<_> = addresses.filter(|address| !self.addresses.contains(address)).collect();
                self.addresses.extend(new);
                self.addresses.sort_by_key(|address| rank(address.ip()));
                self.addresses.truncate(ADDRESSES_MAX);
                !self.addresses.is_empty()
            }
            None => false,
        }
    }

    fn verdict(self) -> Result<Vec<SocketAddr>, NetworkError> {
        if !self.addresses.is_empty() {
            return Ok(self.addresses);
        }
        if let Some(theirs) = self.other_version {
            // Not for good: a notice is nobody's word.
            return Err(NetworkError::Lost(format!(
                "the master of this token speaks version {theirs} of the igi protocol, this program version {VERSION}: \
                 install the same version on both sides"
            )));
        }
        let others = match self.others.len() {
            0 => "none announces itself here".to_owned(),
            n => format!("{n} announce themselves here, and the token is for none of them"),
        };
        Err(NetworkError::Lost(format!("no master found ({others}); --master HOST:PORT names one")))
    }
}

/// The nearest first; link-local IPv6 last, whose scope is not known here.
fn rank(ip: IpAddr) -> u8 {
    match ip {
        IpAddr::V4(ip) if ip.is_loopback() => 0,
        IpAddr::V4(_) => 1,
        IpAddr::V6(ip) if ip.is_unicast_link_local() => 3,
        IpAddr::V6(_) => 2,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OURS: Fingerprint = [1; 16];

    fn address(text: &str) -> SocketAddr {
        text.parse().unwrap()
    }

    #[test]
    fn the_nearest_address_of_our_master_is_first() {
        let mut notices = Notices::default();
        let stranger = Notice { version: VERSION, fingerprint: [2; 16] };
        let ours = Notice { version: VERSION, fingerprint: OURS };
        assert!(!notices.note(None, OURS, [address("10.0.0.9:1")].into_iter()));
        assert!(!notices.note(Some(stranger), OURS, [address("10.0.0.9:1")].into_iter()));
        assert!(!notices.note(Some(ours), OURS, [].into_iter()), "without an address it is of no use");
        assert!(notices.note(Some(ours), OURS, [address("[fe80::1]:7"), address("10.0.0.1:7")].into_iter()));
        assert!(notices.note(Some(ours), OURS, [address("10.0.0.1:7"), address("127.0.0.1:7")].into_iter()));
        let found = notices.verdict().unwrap();
        assert_eq!(found, ["127.0.0.1:7", "10.0.0.1:7", "[fe80::1]:7"].map(address));
    }

    #[test]
    fn finding_nothing_is_said_in_words() {
        let said = |notices: Notices| notices.verdict().unwrap_err().to_string();
        assert!(said(Notices::default()).contains("none announces itself"));
        let mut notices = Notices::default();
        for number in 0..200 {
            notices.note(Some(Notice { version: VERSION, fingerprint: [number; 16] }), [255; 16], [].into_iter());
        }
        assert_eq!(notices.others.len(), ADDRESSES_MAX);
        assert!(said(notices).contains("for none of them"));
        let mut notices = Notices::default();
        notices.note(
            Some(Notice { version: VERSION + 1, fingerprint: OURS }),
            OURS,
            [address("10.0.0.1:7")].into_iter(),
        );
        let verdict = notices.verdict().unwrap_err();
        assert!(matches!(verdict, NetworkError::Lost(_)), "whoever announces nonsense sends nobody home");
        assert!(verdict.to_string().contains("install the same version"));
    }
}
