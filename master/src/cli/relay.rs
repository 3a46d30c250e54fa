//! Flags of `relay`.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args;

use super::{TalkArgs, parse};

/// `relay`.
#[derive(Debug, Args)]
pub struct RelayArgs {
    /// Whom to work for: a master, or another relay.
    #[arg(long, value_name = "HOST:PORT", env = "IGI_MASTER", value_parser = parse::place)]
    pub master: String,

    /// Where workers join, and other relays.
    #[arg(long, value_name = "ADDR:PORT", env = "IGI_LISTEN", default_value = "0.0.0.0:7464")]
    pub listen: SocketAddr,

    /// The master's own token, the whole of it (`igi1-`, `igi2-`): to its workers, a relay is the master. Better in IGI_TOKEN or a
    /// file: every user of the machine can read a command line, until this program has taken the token off it.
    #[arg(long, value_name = "TOKEN", env = "IGI_TOKEN", hide_env_values = true)]
    pub token: Option<String>,

    /// A file with it, which nobody else may read; it counts more than --token and IGI_TOKEN, and is read again as the master's
    /// is.
    #[arg(long, value_name = "FILE")]
    pub token_file: Option<PathBuf>,

    /// This share of the answers of its workers is asked of another of them as well and compared, as a master's --check-share
    /// does. Who computes wrongly is asked no more; if that has given answers, the master is told, and what is drawn begins
    /// again. 0: only the master checks, and finds no worker but the whole relay.
    #[arg(long, value_name = "SHARE", env = "IGI_CHECK_SHARE", default_value = "0.01", value_parser = parse::share)]
    pub check_share: f64,

    /// Keep scenes in this folder, as a worker does.
    #[arg(long, value_name = "DIR", env = "IGI_CACHE")]
    pub cache: Option<PathBuf>,

    /// What the master calls this relay. [default: the machine's name]
    #[arg(long, value_name = "NAME", env = "IGI_NAME")]
    pub name: Option<String>,

    /// Go when the master has finished. [default: wait for it to start again]
    #[arg(long)]
    pub once: bool,

    /// The address in the printed line that starts a worker. [default: found out]
    #[arg(long, value_name = "HOST:PORT", env = "IGI_ADVERTISE", value_parser = parse::place)]
    pub advertise: Option<String>,

    /// Answer /metrics (Prometheus), /healthz and /readyz here; a port alone answers to this machine only.
    #[arg(long, value_name = "[ADDR:]PORT", env = "IGI_METRICS", value_parser = health::address)]
    pub metrics: Option<SocketAddr>,

    #[command(flatten)]
    pub(crate) talk: TalkArgs,
}

pub(super) const EXAMPLES: &str = "\
Examples:
  igi-master relay --master 10.0.0.1:7464 --token-file token      on one machine of a second network
  igi-worker --master 10.1.0.1:7464 --token-file workers-half     on its others: the relay is their master

When a relay is worth it, and what it costs: docs/deployment.md.";
