//! Clients as processes of this machine.

use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};

use super::quota::{Quota, cpu_seconds};
use runtime::cluster::Cluster;

/// Some `igi-worker` processes with one thread each. Whoever is still there is ended when this is dropped.
pub struct Clients(Vec<Client>);

struct Client {
    process: Child,
    /// None: it may take all it can get.
    quota: Option<Quota>,
}

/// How long clients have to end by themselves after the master's good-bye.
const FAREWELL: Duration = Duration::from_secs(2);

impl Clients {
    /// Starts a client for each share of a core, which joins the cluster at full speed: it is held to its share from
    /// [`Self::hold`] on, so that building the scene takes no longer than it has to.
    ///
    /// # Errors
    /// The program is not there, or there can be no quotas.
    pub fn start(shares: &[f64], cluster: &Cluster) -> anyhow::Result<Self> {
        Self::with(shares.iter().map(|share| Quota::new(*share).map(Some)), cluster)
    }

    /// Starts one that joins the cluster, and is held to nothing.
    ///
    /// # Errors
    /// The program is not there.
    pub fn one(cluster: &Cluster) -> anyhow::Result<Self> {
        Self::with(std::iter::once(Ok(None)), cluster)
    }

    fn with(quotas: impl Iterator<Item = anyhow::Result<Option<Quota>>>, cluster: &Cluster) -> anyhow::Result<Self> {
        let program = program()?;
        let (Some(address), Some(token)) = (cluster.address(), cluster.token()) else {
            bail!("the cluster does not listen")
        };
        let mut clients = Self(Vec::new());
        for (number, quota) in quotas.enumerate() {
            let quota = quota?;
            let process = Command::new(&program)
                .args(["--master", &address.to_string(), "--threads", "1", "--once", "--quiet"])
                .args(["--name", &format!("client {number}")])
                .env("IGI_TOKEN", token.to_string())
                .env_remove("IGI_CACHE")
                .env_remove("IGI_THREADS")
                .stdin(Stdio::null())
                .stdout(Stdio::null())
                .spawn()
                .with_context(|| format!("{}: cannot be started", program.display()))?;
            clients.0.push(Client { process, quota });
        }
        Ok(clients)
    }

    /// Holds all to their shares.
    ///
    /// # Errors
    /// One of them is gone.
    pub fn hold(&self) -> anyhow::Result<()> {
        self.0.iter().try_for_each(|client| match &client.quota {
            Some(quota) => quota.hold(client.process.id()),
            None => Ok(()),
        })
    }

    /// Processor time that all have used so far, seconds.
    pub fn cpu_seconds(&self) -> f64 {
        self.0.iter().filter_map(|client| cpu_seconds(client.process.id())).sum()
    }

    /// Somebody has ended who should not have.
    pub fn lost(&mut self) -> usize {
        self.0.iter_mut().filter_map(|client| client.process.try_wait().ok().flatten()).count()
    }
}

impl Drop for Clients {
    fn drop(&mut self) {
        let deadline = Instant::now() + FAREWELL;
        while self.lost() < self.0.len() && Instant::now() < deadline {
            std::thread::sleep(Duration::from_millis(10));
        }
        for client in &mut self.0 {
            let _ = client.process.kill();
            let _ = client.process.wait();
        }
    }
}

/// `igi-worker`, beside this program.
fn program() -> anyhow::Result<PathBuf> {
    let own = std::env::current_exe().context("this program does not know where it is")?;
    let name = format!("igi-worker{}", std::env::consts::EXE_SUFFIX);
    let beside = own.with_file_name(name);
    if !beside.is_file() {
        bail!("{}: not found; build it beside this program (cargo build --release --bins)", beside.display());
    }
    Ok(beside)
}
