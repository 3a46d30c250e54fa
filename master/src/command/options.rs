//! What is typed, as it is meant: flags that several commands share, as options of the rooms below.

use std::path::{Path, PathBuf};
use std::time::Duration;

use frame::tone::Exposure;
use scenes::{Keep, Scene};

use crate::cli::{ClusterArgs, TalkArgs, WaitArgs};
use runtime::cluster::ClusterOptions;
use runtime::cluster::embedded::cores;
use runtime::console::ConsoleOptions;
use runtime::reception::ReceptionOptions;
use runtime::reception::invitation::Origin;

/// How much is said.
pub(crate) fn console(talk: TalkArgs) -> ConsoleOptions {
    ConsoleOptions { quiet: talk.quiet, json: talk.json }
}

/// Who does the work.
pub(crate) fn cluster(args: &ClusterArgs) -> ClusterOptions {
    let embedded = match args.workers {
        Some(workers) => Some(workers.embedded.unwrap_or_else(cores)),
        None if args.listen.is_some() => None,
        None => Some(cores()),
    };
    let (token, token_file) = (args.token.clone(), args.token_file.clone());
    let (listen, token_lifetime) = (args.listen, args.token_lifetime);
    let check_share = args.check_share;
    let keep = Keep::Needed;
    let (give_way, hand_on) = (false, false);
    let far = Duration::ZERO;
    ClusterOptions { embedded, give_way, far, listen, token, token_file, token_lifetime, keep, check_share, hand_on }
}

/// What those are told who could come.
pub(crate) fn reception(args: &ClusterArgs) -> ReceptionOptions {
    ReceptionOptions {
        origin: origin(args.token_file.as_deref(), args.token.as_deref()),
        advertise: args.advertise.clone(),
        announce: !args.no_announce,
        metrics: args.metrics,
    }
}

/// Where a token comes from; a file counts more than the environment.
pub(crate) fn origin(file: Option<&Path>, token: Option<&str>) -> Origin {
    match (file, token) {
        (Some(file), _) => Origin::File(PathBuf::from(file)),
        (None, Some(_)) => Origin::Environment,
        (None, None) => Origin::Fresh,
    }
}

/// The exposure where `chosen` is `None`: a scene in units of its own is made to be shown at 0, candela and lux may be any.
pub(crate) fn exposure(chosen: Option<Exposure>, scene: &Scene) -> Exposure {
    let usual = if scene.lights_are_photometric { Exposure::Auto } else { Exposure::Fixed(0.0) };
    chosen.unwrap_or(usual)
}

/// How long is waited for the first worker, or the next; `None`: for ever.
pub(crate) fn wait(wait: &WaitArgs) -> Option<Duration> {
    wait.wait.map(duration)
}

/// Seconds, as the command line has them; what no [`Duration`] can hold is the longest.
pub(crate) fn duration(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX)
}
