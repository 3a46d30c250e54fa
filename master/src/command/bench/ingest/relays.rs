//! Relays between the master that is measured and its crowd: this program, as processes of their own.

use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::process::{Child, Command, Stdio};

use anyhow::Context;
use protocol::identity::Token;

use runtime::threads::Threads;

/// What their time is called.
pub(super) const RELAYS: &str = "relays";

/// They end when this is dropped.
pub(super) struct Relays(Vec<(Child, SocketAddr)>);

impl Relays {
    /// Starts so many for a master.
    pub(super) fn start(count: u16, master: SocketAddr, token: &Token) -> anyhow::Result<Self> {
        let mut relays = Self(Vec::new());
        let program = std::env::current_exe().context("this program has no name")?;
        for _ in 0..count {
            let here = free_port().context("there is no free port")?;
            let mut relay = Command::new(&program);
            relay.args(["relay", "--master", &master.to_string(), "--listen", &here.to_string()]);
            relay.args(["--check-share", "0", "--once", "--quiet"]).env("IGI_TOKEN", token.to_string());
            relay.stdin(Stdio::null()).stdout(Stdio::null());
            relays.0.push((relay.spawn().context("a relay cannot be started")?, here));
        }
        Ok(relays)
    }

    /// Where workers join them.
    pub(super) fn addresses(&self) -> Vec<SocketAddr> {
        self.0.iter().map(|(_, here)| *here).collect()
    }

    /// Their time, beside that of others.
    pub(super) fn and(&self, threads: Threads) -> Threads {
        self.0.iter().fold(threads, |threads, (relay, _)| threads.and(relay.id(), RELAYS))
    }
}

impl Drop for Relays {
    fn drop(&mut self) {
        for (relay, _) in &mut self.0 {
            let _ = relay.kill();
            let _ = relay.wait();
        }
    }
}

/// One that was free a moment ago.
fn free_port() -> std::io::Result<SocketAddr> {
    UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?.local_addr()
}
