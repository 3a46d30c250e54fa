//! A worker's machine: a network namespace with one cable to the master's, whose quality can be set, and a share of a
//! core.

use std::io::Write;
use std::net::SocketAddr;
use std::process::{Command, Stdio};
use std::time::Duration;

use master::command::scale::quota::Quota;
use tests::programs::Process;

use super::delay::Delay;

/// Removed with everything in it when dropped.
pub struct Place {
    namespace: String,
    /// The cable's ends: here, and there.
    ends: [String; 2],
    delay: Delay,
    token: String,
    worker: Option<Process>,
    /// Held to this, and to a tenth of it when it is slow.
    shares: [Quota; 2],
}

/// Cores that a worker has. Three workers, the master and the lines between them fit on two.
pub const SHARE: f64 = 0.3;

impl Place {
    /// A machine of this number, with a worker that runs.
    pub fn new(number: u8, master: SocketAddr, token: &str) -> Self {
        let id = std::process::id() % 100_000;
        let namespace = format!("igi{id}-{number}");
        let ends = ["n", "f"].map(|end| format!("igi{id}{end}{number}"));
        let (near, far) = (format!("10.77.{number}.1"), format!("10.77.{number}.2"));
        ip(&format!("netns add {namespace}"));
        ip(&format!("link add {} type veth peer name {} netns {namespace}", ends[0], ends[1]));
        ip(&format!("addr add {near}/30 dev {}", ends[0]));
        ip(&format!("link set {} up", ends[0]));
        ip(&format!("-n {namespace} addr add {far}/30 dev {}", ends[1]));
        ip(&format!("-n {namespace} link set lo up"));
        ip(&format!("-n {namespace} link set {} up", ends[1]));
        let delay = Delay::new(&near, SocketAddr::new([127, 0, 0, 1].into(), master.port()));
        let shares = [SHARE, SHARE / 10.0].map(|share| Quota::new(share).expect("control groups can be made"));
        let mut place = Self { namespace, ends, delay, token: token.to_owned(), worker: None, shares };
        place.start();
        place
    }

    /// Starts a worker, if none runs.
    pub fn start(&mut self) {
        if self.worker.is_none() {
            let master = self.delay.address.to_string();
            let arguments = ["--master", &master, "--threads", "1", "--name", &self.namespace];
            self.worker = Some(Process::worker_within(&self.namespace, &self.token, &arguments));
            self.set_slow(false);
        }
    }

    /// kill -9.
    pub fn kill(&mut self) {
        self.worker = None;
    }

    /// SIGTERM; how it ended.
    pub fn leave(&mut self) -> Option<i32> {
        self.signal("-TERM");
        let mut worker = self.worker.take().expect("a worker runs");
        worker.0.wait().expect("a child can be waited for").code()
    }

    pub fn signal(&self, signal: &str) {
        self.worker.as_ref().expect("a worker runs").signal(signal);
    }

    /// A tenth of its share of a core, or all of it.
    pub fn set_slow(&self, slow: bool) {
        let worker = self.worker.as_ref().expect("a worker runs");
        self.shares[usize::from(slow)].hold(worker.0.id()).expect("it is our child");
    }

    /// Pulls the plug, or puts it in.
    pub fn set_cable(&self, plugged: bool) {
        ip(&format!("-n {} link set {} {}", self.namespace, self.ends[1], if plugged { "up" } else { "down" }));
    }

    /// Each way.
    pub fn set_delay(&self, delay: Duration) {
        self.delay.set(delay);
    }

    /// So many packets of a hundred are lost, each way.
    pub fn set_loss(&self, percent: u8) {
        let _ = within(&self.namespace, "nft", &["delete", "table", "inet", "igi"]);
        if percent == 0 {
            return;
        }
        let drop = format!("numgen random mod 100 < {percent} drop");
        let chain = |hook: &str| {
            format!("chain {hook} {{ type filter hook {hook} priority 0; policy accept; udp dport > 0 {drop}; }}\n")
        };
        let rules = format!("table inet igi {{ {} {} }}\n", chain("input"), chain("output"));
        let mut nft = Command::new("ip");
        nft.args(["netns", "exec", &self.namespace, "nft", "-f", "-"]).stdin(Stdio::piped());
        let mut nft = nft.spawn().expect("ip runs");
        nft.stdin.take().expect("it is piped").write_all(rules.as_bytes()).expect("nft reads");
        assert!(nft.wait().expect("a child can be waited for").success(), "nft refuses: {rules}");
    }

    /// So many kilobits a second, each way; nothing: as many as there are.
    pub fn set_rate(&self, kilobits: Option<u32>) {
        let near = ["qdisc", "del", "dev", &self.ends[0], "root"];
        let far = ["qdisc", "del", "dev", &self.ends[1], "root"];
        let _ = Command::new("tc").args(near).stderr(Stdio::null()).status();
        let _ = within(&self.namespace, "tc", &far);
        let Some(kilobits) = kilobits else { return };
        let rate = format!("{kilobits}kbit");
        let filter = |dev: &str| format!("qdisc add dev {dev} root tbf rate {rate} burst 16kb latency 400ms");
        let near = filter(&self.ends[0]);
        let set = Command::new("tc").args(near.split(' ')).status().expect("tc runs");
        let far = filter(&self.ends[1]);
        assert!(set.success() && within(&self.namespace, "tc", &far.split(' ').collect::<Vec<_>>()), "tc refuses");
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.worker = None;
        let _ = Command::new("ip").args(["netns", "del", &self.namespace]).status();
    }
}

fn within(namespace: &str, program: &str, arguments: &[&str]) -> bool {
    let mut command = Command::new("ip");
    command.args(["netns", "exec", namespace, program]).args(arguments).stderr(Stdio::null());
    command.status().expect("ip runs").success()
}

fn ip(arguments: &str) {
    let done = Command::new("ip").args(arguments.split(' ')).status().expect("ip runs");
    assert!(done.success(), "ip {arguments}");
}
