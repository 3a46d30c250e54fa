//! `igi-master relay`: between a master and workers.

use anyhow::{Context, anyhow};

use crate::cli::RelayArgs;
use crate::command::options;
use runtime::cluster::{Cluster, ClusterOptions};
use runtime::console::Console;
use runtime::failure::{Failure, Success};
use runtime::interrupt::Interrupt;
use runtime::reception::{Reception, ReceptionOptions};
use runtime::relay::{self, Above};

/// Takes in workers and works for a master with them, until Ctrl-C or until the master refuses it.
///
/// # Errors
/// [`Failure`] if there is no whole token, an address cannot be listened at, or the master does not want it.
pub fn relay(args: &RelayArgs) -> Result<Success, Failure> {
    let mut console = Console::new(options::console(args.talk));
    if args.token.is_none() && args.token_file.is_none() {
        return Err(Failure::Usage("a relay needs its master's own token, as IGI_TOKEN or --token-file".into()));
    }
    let above = Above {
        master: args.master.clone(),
        token: args.token.clone(),
        token_file: args.token_file.clone(),
        cache: args.cache.clone(),
        name: args.name.clone(),
        once: args.once,
    };
    let interrupt = Interrupt::listen_saying("finishing what is begun", "stopped at once");
    let cluster = Cluster::start(ClusterOptions {
        listen: Some(args.listen),
        token: args.token.clone(),
        token_file: args.token_file.clone(),
        check_share: args.check_share,
        hand_on: true,
        ..ClusterOptions::default()
    });
    let cluster = cluster.context("workers cannot be taken in")?;
    let reception = ReceptionOptions {
        origin: options::origin(args.token_file.as_deref(), args.token.as_deref()),
        advertise: args.advertise.clone(),
        // Workers that look for the master of this token should find the master.
        announce: false,
        metrics: args.metrics,
    };
    let _reception = Reception::open(&reception, &cluster, &console)?;
    relay::run(above, cluster, &interrupt, &mut console).map_err(|reason| Failure::Failed(anyhow!(reason)))?;
    Ok(if interrupt.asked() { Success::Interrupted } else { Success::Done })
}
