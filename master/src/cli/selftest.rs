//! Flags of `selftest`.

use clap::Args;

use super::parse;

/// `selftest`.
#[derive(Debug, Args)]
pub struct SelftestArgs {
    /// Rows to run, by the name of their case. [default: all quick ones]
    #[arg(value_name = "NAME")]
    pub names: Vec<String>,
    /// Know everything to half a per cent.
    #[arg(long)]
    pub thorough: bool,
    /// Run the slow cases too, and know everything to a quarter of a per cent.
    #[arg(long, conflicts_with = "thorough")]
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
On two cores with AVX2, all quick rows take less than two minutes, with
--thorough a quarter of an hour, with --long hours. Which row it is at, and how
long the rest takes, is said on standard error. Ctrl-C ends the table there,
says that it is not whole, and gives exit code 130.

Each finding is a number beside what it should be: right if it differs by less
than the tolerance and four standard errors, and if these are small enough to
mean something: one per cent (two where a row would take long, eight in the
noisiest), with --thorough a half, with --long a quarter. A bias of twice as
much cannot pass. `within` says for each finding how far from expected it can be
at most. Estimators that are biased by design have to give the wrong value that
theory predicts. `known` is what is wrong and written down. The exit code is 0
if nothing is WRONG, UNCLEAR (too noisy) or MENDED (listed as known, and right).

Examples:
  igi-master selftest --list
  igi-master selftest furnace-corner --method igi-paper
  igi-master selftest mirror-shaft sky --thorough
  igi-master selftest --long --json > selftest.jsonl";
