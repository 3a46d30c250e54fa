//! Flags of `scale`.

use std::path::PathBuf;

use clap::Args;

use super::{MethodArgs, Size, TalkArgs, parse};

/// `scale`.
#[derive(Debug, Args)]
pub struct ScaleArgs {
    /// Scene: a folder, scene.json, .obj, .gltf or .glb; or a luminaire's .ies or .ldt.
    pub scene: PathBuf,

    /// Numbers of clients to measure, increasing.
    #[arg(long, value_name = "N,N,…", value_delimiter = ',', default_values_t = [1, 2, 4, 8, 16],
        value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub clients: Vec<u16>,

    /// Hold every client to so much of a core. All clients together have to fit onto this machine, beside the master.
    #[arg(long, value_name = "CORES", default_value_t = 0.1, value_parser = share)]
    pub cpu_per_client: f64,

    /// Start no clients: wait for as many workers as the largest of --clients, on machines of their own, and measure with
    /// the first 1, 2, 4 … of them.
    #[arg(long, value_name = "ADDR:PORT", conflicts_with_all = ["cpu_per_client", "uneven"])]
    pub listen: Option<std::net::SocketAddr>,

    /// What they have to know to be let in; better in IGI_TOKEN or a file, because every user of the machine can read a
    /// command line. [default: a fresh one]
    #[arg(long, value_name = "TOKEN", env = "IGI_TOKEN", hide_env_values = true)]
    pub token: Option<String>,

    /// A file with what they have to know, which nobody else may read. It counts more than --token and IGI_TOKEN.
    #[arg(long, value_name = "FILE", requires = "listen")]
    pub token_file: Option<std::path::PathBuf>,

    /// Measure clients of unequal speeds as well, such as 1:2:4:8 (times --cpu-per-client).
    #[arg(long, value_name = "A:B:…", value_parser = ratio)]
    pub uneven: Option<Ratio>,

    /// Frames to time for each number of clients, after a warm-up; the same ones each time.
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u32).range(2..=10_000))]
    pub frames: u32,

    /// Size of the picture, pixels. [default: the scene's]
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,

    /// All randomness comes from this number.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,

    /// Simulate up to so many clients.
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub simulate: u32,

    /// Simulated network: bandwidth of the master's link, Mbit/s …
    #[arg(long, value_name = "MBIT", default_value_t = 1000.0, value_parser = parse::positive)]
    pub bandwidth: f64,

    /// … and time from the master to a client, milliseconds.
    #[arg(long, value_name = "MS", default_value_t = 0.2, value_parser = parse::positive)]
    pub delay: f64,

    /// Folder for index.html, scale.csv and the plots; it is made if it is not there.
    #[arg(short, long = "output", value_name = "DIR", default_value = "scale")]
    pub output: PathBuf,

    #[command(flatten)]
    pub(crate) method: MethodArgs,
    #[command(flatten)]
    pub(crate) talk: TalkArgs,
}

/// Relative speeds.
#[derive(Clone, Debug, PartialEq)]
pub struct Ratio(pub Vec<f64>);

fn share(text: &str) -> Result<f64, String> {
    let share = parse::positive(text)?;
    if (0.005..=1.0).contains(&share) { Ok(share) } else { Err("expected a share of a core from 0.005 to 1".into()) }
}

fn ratio(text: &str) -> Result<Ratio, String> {
    let parts: Vec<f64> = text.split(':').map(parse::positive).collect::<Result<_, _>>()?;
    match parts.len() {
        2..=256 if parts.iter().all(|part| (1.0..=1000.0).contains(part)) => Ok(Ratio(parts)),
        _ => Err("expected two or more numbers from 1 to 1000, such as 1:2:4:8".into()),
    }
}

pub(super) const EXAMPLES: &str = "\
Clients are igi-worker processes of this machine, over QUIC on its loopback,
each held to an equal share of a core by a control group (Linux, cgroup v1 or
v2; usually as root): so it emulates that many equal slow machines, and the page
says so. With --listen, clients are workers that join from other machines. From
what is measured with one client, a simulation with the same schedule goes on to
1000.

Examples:
  igi-master scale scenes/cornell -o scale/
  igi-master scale scenes/conference --clients 1,2,4,8,16 --cpu-per-client 0.08
  igi-master scale scenes/cornell --clients 1,16,64 --cpu-per-client 0.02
  igi-master scale scenes/cornell --clients 1 --uneven 1:2:4:8
  igi-master scale scenes/conference --listen 0.0.0.0:7464 --clients 1,2,4
      then start four workers as it says";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_and_shares_are_read_or_refused() {
        assert_eq!(ratio("1:2:4:8"), Ok(Ratio(vec![1.0, 2.0, 4.0, 8.0])));
        for wrong in ["", "1", "1:0", "1:-2", "1:x", "0.5:1", "1:1001"] {
            assert!(ratio(wrong).is_err(), "{wrong}");
        }
        assert_eq!(share("0.1"), Ok(0.1));
        for wrong in ["0", "1.5", "nan", "0.001"] {
            assert!(share(wrong).is_err(), "{wrong}");
        }
    }
}
