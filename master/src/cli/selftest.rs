//! Flags of `selftest`.

use clap::Args;

use super::parse;

/// `selftest`.
#[derive(Debug, Args)]
pub struct SelftestArgs {
    /// Cases to run, by name. [default: all quick ones]
    #[arg(value_name = "NAME")]
    pub names: Vec<String>,
    /// Run the slow cases too, and know everything twice as exactly.
    #[arg(long)]
    pub long: bool,
    /// Only for this estimator (or `machinery`: codecs, schedules, sums); may be given several times.
    #[arg(long, value_name = "METHOD", value_parser = parse::method)]
    pub method: Vec<cases::Method>,
    /// Say what cases there are.
    #[arg(long)]
    pub list: bool,
    /// Threads; they change no result. [default: one a core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Write one JSON object a finding, and one with the sums at the end.
    #[arg(long)]
    pub json: bool,
}

pub(super) const EXAMPLES: &str = "\
Each finding is a number beside what it should be: right if it differs by less
than the tolerance and four standard errors, and if these are small enough to
mean something. Estimators that are biased by design have to give the wrong
value that theory predicts. `known` is what is wrong and written down. The exit
code is 0 if nothing is WRONG, UNCLEAR (too noisy) or MENDED (listed as known,
and right).

Examples:
  igi-master selftest --list
  igi-master selftest furnace-corner --method igi-paper
  igi-master selftest --long --json > selftest.jsonl";
