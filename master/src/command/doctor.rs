//! `igi-master doctor HOST…`: could these machines work for this one? Asks `igi-worker doctor` of each over ssh, one after
//! the other so that each has the network to itself, and puts what they say into one table.
//!
//! What is measured is what would be used: a real connection to a master that listens here for as long as it takes,
//! and real scene parts.

use std::io::Write;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::{Context, anyhow};
use protocol::message::VERSION;
use scenes::{LookUp, Pixels, Scene, Texture};
use serde_json::{Value, json};

use crate::cli::DoctorArgs;
use runtime::cluster::{Cluster, ClusterOptions};
use runtime::console::print;
use runtime::failure::{Failure, Success};

/// What a machine said, and what we noticed.
#[derive(Clone, Debug)]
struct Examined {
    host: String,
    /// The JSON of `igi-worker doctor`, or why there is none.
    said: Result<Value, String>,
    /// Its clock less ours, and how well that is known, seconds.
    skew: Option<[f64; 2]>,
}

/// A side of the texture that is sent to measure the connection, pixels: 32 MiB in all.
const TEXTURE_SIDES: [u32; 2] = [4096, 2048];
/// Tokens for a doctor need not live long.
const TOKEN_LIFETIME: Duration = Duration::from_secs(3600);
/// Longest wait for a machine.
const PATIENCE: Duration = Duration::from_secs(60);
/// Clocks may differ by so much, seconds: log lines are still in order, tokens expire as meant.
const SKEW_MAX: f64 = 5.0;

/// Examines all machines, and says how they are.
///
/// # Errors
/// One of them is not well, or this machine cannot listen.
pub fn doctor(args: &DoctorArgs) -> Result<Success, Failure> {
    let options =
        ClusterOptions { listen: Some(args.listen), token_lifetime: Some(TOKEN_LIFETIME), ..ClusterOptions::default() };
    let mut cluster = Cluster::start(options).context("this machine cannot take workers in")?;
    cluster.publish(Arc::new(burden())).context("nothing can be sent to workers")?;
    let reachable = cluster.reachable().ok_or_else(|| anyhow!("it does not listen"))?;
    let master = args.master.clone().unwrap_or_else(|| reachable.to_string());
    let token = cluster.token().map(|token| token.for_workers().to_string()).unwrap_or_default();
    if !args.json {
        eprintln!("igi-master {}, protocol {VERSION}, listens at UDP {master} meanwhile", env!("CARGO_PKG_VERSION"));
    }
    let mut all = Vec::new();
    for host in &args.hosts {
        let examined = examine(host, &master, &token);
        if args.json {
            print(&format!("{}\n", examined.json()));
        } else {
            eprintln!("{host}: {}", examined.verdict());
        }
        all.push(examined);
    }
    if !args.json {
        print(&table(&all));
    }
    match all.iter().filter(|examined| !examined.is_well()).count() {
        0 => Ok(Success::Done),
        ill => Err(Failure::Failed(anyhow!("{ill} of {} machines are not well", all.len()))),
    }
}

/// A scene whose sending takes time.
fn burden() -> Scene {
    let [width, height] = TEXTURE_SIDES;
    let texels = vec![[127; 4]; (width * height) as usize];
    let texture =
        Texture { name: "burden".into(), width, height, pixels: Pixels::Linear8(texels), look_up: LookUp::REPEAT };
    Scene { textures: vec![texture.into()], ..Scene::default() }
}

fn examine(host: &str, master: &str, token: &str) -> Examined {
    let (ours, begun) = (unix_time(), Instant::now());
    let said = ask(host, master, token);
    let took = begun.elapsed().as_secs_f64();
    let theirs = said.as_ref().ok().and_then(|said| said["time"].as_f64());
    // It looked at its clock at some time in between.
    let skew = theirs.map(|theirs| [theirs - (ours + took / 2.0), took / 2.0]);
    Examined { host: host.to_owned(), said, skew }
}

/// What `igi-worker doctor` says there. The token goes over standard input: no process list shows it.
fn ask(host: &str, master: &str, token: &str) -> Result<Value, String> {
    let setting = |name: &str, usual: &str| std::env::var(name).unwrap_or_else(|_| usual.to_owned());
    let ssh = setting("IGI_SSH", "ssh -o BatchMode=yes -o ConnectTimeout=10");
    let worker = setting("IGI_WORKER", "igi-worker");
    let mut words = ssh.split_whitespace();
    let program = words.next().ok_or("IGI_SSH is empty")?;
    let mut command = Command::new(program);
    command.args(words).arg(host).arg(format!("{worker} doctor --json --master {master} --token-file /dev/stdin"));
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().map_err(|error| format!("{program} cannot be started: {error}"))?;
    if let Some(mut stdin) = child.stdin.take() {
        // Who does not want it says why.
        let _ = writeln!(stdin, "{token}");
    }
    let deadline = Instant::now() + PATIENCE;
    while child.try_wait().map_err(|error| error.to_string())?.is_none() {
        if Instant::now() > deadline {
            let _ = child.kill();
            return Err(format!("it said nothing for {} s", PATIENCE.as_secs()));
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    let output = child.wait_with_output().map_err(|error| error.to_string())?;
    // It ends with 1 if something is amiss, and says what.
    serde_json::from_slice(&output.stdout).map_err(|_| {
        let complaint = String::from_utf8_lossy(&output.stderr);
        let last = complaint.trim().lines().last().unwrap_or("it says nothing").to_owned();
        format!("igi-worker could not be asked: {last}")
    })
}

fn unix_time() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |time| time.as_secs_f64())
}

impl Examined {
    /// What is amiss, for people.
    fn troubles(&self) -> Vec<String> {
        let said = match &self.said {
            Ok(said) => said,
            Err(reason) => return vec![reason.clone()],
        };
        let mut troubles = Vec::new();
        if said["protocol"] != json!(VERSION) {
            troubles.push(format!("it speaks version {} of the protocol, not {VERSION}", said["protocol"]));
        }
        if let Some([skew, doubt]) = self.skew.filter(|[skew, doubt]| skew.abs() > SKEW_MAX + doubt) {
            troubles.push(format!("its clock is {skew:+.0} s off (known to {doubt:.1} s)"));
        }
        let theirs = said["troubles"].as_array().map(Vec::as_slice).unwrap_or_default();
        troubles.extend(theirs.iter().filter_map(Value::as_str).map(str::to_owned));
        troubles
    }

    fn is_well(&self) -> bool {
        self.troubles().is_empty()
    }

    fn verdict(&self) -> String {
        let troubles = self.troubles();
        if troubles.is_empty() { "well".into() } else { troubles.join("; ") }
    }

    fn json(&self) -> Value {
        json!({
            "host": self.host, "said": self.said.as_ref().ok(), "clock_skew": self.skew.map(|[skew, _]| skew),
            "clock_skew_known_to": self.skew.map(|[_, doubt]| doubt),
            "troubles": self.troubles(),
        })
    }
}

/// One line a machine.
fn table(all: &[Examined]) -> String {
    let mut rows =
        vec![["machine", "version", "threads", "free GB", "packet", "ms", "MB/s", "clock s", ""].map(str::to_owned)];
    for examined in all {
        let said = examined.said.as_ref().ok();
        let number = |pick: &dyn Fn(&Value) -> Option<f64>, scale: f64, digits: usize| {
            said.and_then(pick).map_or("–".to_owned(), |value| format!("{:.digits$}", value / scale))
        };
        rows.push([
            examined.host.clone(),
            said.and_then(|said| said["version"].as_str()).unwrap_or("–").to_owned(),
            number(&|said| said["threads"].as_f64(), 1.0, 0),
            number(&|said| said["memory_free"].as_f64(), 1e9, 1),
            number(&|said| said["connection"]["mtu"].as_f64(), 1.0, 0),
            number(&|said| said["connection"]["round_trip_ms"].as_f64(), 1.0, 2),
            number(&|said| said["connection"]["bytes_per_second"].as_f64(), 1e6, 0),
            examined.skew.map_or("–".to_owned(), |[skew, doubt]| format!("{skew:+.1}±{doubt:.1}")),
            if examined.is_well() { "well" } else { "see above" }.to_owned(),
        ]);
    }
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..rows[0].len()).map(width).collect();
    let line = |row: &[String; 9]| {
        let cells = row.iter().zip(&widths).map(|(cell, width)| format!("{cell:<width$}"));
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned() + "\n"
    };
    rows.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn examined(said: Result<Value, String>, skew: f64) -> Examined {
        Examined { host: "lab1".into(), said, skew: Some([skew, 0.5]) }
    }

    #[test]
    fn what_is_amiss_is_gathered() {
        let well = json!({
            "version": "0.1.0", "protocol": VERSION, "threads": 8, "memory_free": 4e9, "troubles": [],
            "connection": { "mtu": 1452, "round_trip_ms": 0.4, "bytes_per_second": 112e6 },
        });
        assert!(examined(Ok(well.clone()), 5.2).is_well(), "the clock is not known that well");
        let table = table(&[examined(Ok(well.clone()), 0.1), examined(Err("no route".into()), 0.0)]);
        let lines: Vec<_> = table.lines().collect();
        assert!(lines[1].starts_with("lab1") && lines[1].contains("112") && lines[1].ends_with("well"), "{table}");
        assert!(lines[2].contains('–') && lines[2].ends_with("see above"), "{table}");

        assert!(examined(Ok(well.clone()), -60.0).verdict().contains("-60 s off"));
        let mut older = well;
        older["protocol"] = json!(1);
        older["troubles"] = json!(["no memory"]);
        let verdict = examined(Ok(older), 0.0).verdict();
        assert!(verdict.contains("version 1") && verdict.contains("no memory"), "{verdict}");
        assert_eq!(examined(Err("no route".into()), 0.0).troubles(), ["no route"]);
    }
}
