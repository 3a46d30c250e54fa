//! `igi-worker doctor`: could this machine work, and how is the connection to its master? One screen, or one JSON object.
//!
//! [`Facts::here`] and [`crate::network::visit`] look; what is told of it, and what is amiss, is decided by functions
//! without IO.

use std::fmt::Write;
use std::net::UdpSocket;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use protocol::message::VERSION;
use serde_json::{Value, json};

use crate::network::visit::Visit;
use crate::settings::{cores, machine};

/// What is known of this machine.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facts {
    /// What the master will call it.
    pub name: String,
    /// Questions it would answer at a time.
    pub threads: usize,
    /// Vector instructions that the renderer uses.
    pub vectors: Vec<&'static str>,
    /// Runnable programs, mean over the last minute.
    pub load: Option<f64>,
    /// Memory, and how much of it is free, bytes.
    pub memory: Option<[u64; 2]>,
    /// Buffer of a UDP socket that asks for [`BUFFER_WANTED`], bytes.
    pub udp_buffer: Option<usize>,
    /// Since the beginning of 1970 (UTC).
    pub time: Duration,
}

/// What connections ask for, bytes.
const BUFFER_WANTED: usize = protocol::transport::SOCKET_BUFFER;
/// Below this, bursts of answers lose packets, bytes.
const BUFFER_ENOUGH: usize = 1 << 20;
/// Small scenes need this much, bytes.
const MEMORY_ENOUGH: u64 = 512 << 20;
/// Packets below this pass a tunnel, or a broken path.
const MTU_USUAL: u16 = 1400;
/// A connection slower than this holds up interactive pictures, bytes a second.
const BANDWIDTH_ENOUGH: f64 = 5e6;

/// Fewer bytes tell more about the processor than about the network.
const BYTES_TO_TELL: usize = 4 << 20;

impl Facts {
    /// Looks around.
    pub fn here() -> Self {
        let (name, threads) = (machine(), cores());
        let read = |path| std::fs::read_to_string(path).ok();
        let load = read("/proc/loadavg").and_then(|text| text.split(' ').next()?.parse().ok());
        let memory = read("/proc/meminfo").and_then(|text| memory(&text));
        let time = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self { name, threads, vectors: vectors(), load, memory, udp_buffer: udp_buffer().ok(), time }
    }

    /// Everything amiss with the machine and the connection, for people.
    pub fn troubles(&self, visit: &Result<Visit, String>) -> Vec<String> {
        let mut troubles = Vec::new();
        if let Some([_, free]) = self.memory.filter(|[_, free]| *free < MEMORY_ENOUGH) {
            troubles.push(format!("only {} of memory are free", bytes(free as f64)));
        }
        if let Some(given) = self.udp_buffer.filter(|given| *given < BUFFER_ENOUGH) {
            troubles.push(format!(
                "UDP sockets get buffers of {} only, so that bursts lose packets: sysctl -w net.core.rmem_max={BUFFER_WANTED} \
                 net.core.wmem_max={BUFFER_WANTED}",
                bytes(given as f64)
            ));
        }
        if let Some(load) = self.load.filter(|load| *load > 0.5 * self.threads as f64) {
            troubles.push(format!("others use this machine (load {load:.1}): consider --nice"));
        }
        match visit {
            Err(reason) => troubles.push(reason.clone()),
            Ok(visit) => {
                if visit.mtu < MTU_USUAL {
                    troubles.push(format!("packets of more than {} bytes do not arrive", visit.mtu));
                }
                if let Some(rate) = visit.rate().filter(|rate| *rate < BANDWIDTH_ENOUGH) {
                    troubles.push(format!("the connection is slow: {} a second", bytes(rate)));
                }
            }
        }
        troubles
    }

    /// One screen.
    pub fn screen(&self, visit: &Result<Visit, String>) -> String {
        let mut screen = String::new();
        let mut line = |what: &str, said: String| {
            let _ = writeln!(screen, "{what:<12} {said}");
        };
        line("igi-worker", format!("{}, protocol {VERSION}", env!("CARGO_PKG_VERSION")));
        let vectors = if self.vectors.is_empty() { "portable".to_owned() } else { self.vectors.join(", ") };
        line("machine", format!("{}: {} threads ({vectors})", self.name, self.threads));
        line("load", self.load.map_or("unknown".into(), |load| format!("{load:.2}")));
        let memory = self.memory.map(|all| all.map(|size| bytes(size as f64)));
        line("memory", memory.map_or("unknown".into(), |[all, free]| format!("{all}, {free} free")));
        line("UDP buffer", self.udp_buffer.map_or("unknown".into(), |given| bytes(given as f64)));
        line("clock", format!("{:.3} s since 1970 (UTC)", self.time.as_secs_f64()));
        match visit {
            Ok(visit) => {
                line("master", format!("{}: let in after {:.1} ms", visit.master, ms(visit.greeting)));
                line("round trip", format!("{:.2} ms, packets of {} bytes", ms(visit.round_trip), visit.mtu));
                line(
                    "bandwidth",
                    match visit.rate() {
                        Some(rate) => format!("{} a second (UDP port {} is open)", bytes(rate), visit.master.port()),
                        None => {
                            format!("unknown: the master has no large scene (UDP port {} is open)", visit.master.port())
                        }
                    },
                );
            }
            Err(reason) => line("master", reason.clone()),
        }
        let troubles = self.troubles(visit);
        for trouble in &troubles {
            line("!", trouble.clone());
        }
        if troubles.is_empty() {
            line("", "all is well".into());
        }
        screen
    }

    /// The same, for programs.
    pub fn json(&self, visit: &Result<Visit, String>) -> Value {
        json!({
            "version": env!("CARGO_PKG_VERSION"), "protocol": VERSION, "name": self.name, "threads": self.threads,
            "vectors": self.vectors, "load": self.load, "memory": self.memory.map(|[all, _]| all),
            "memory_free": self.memory.map(|[_, free]| free), "udp_buffer": self.udp_buffer,
            "time": self.time.as_secs_f64(),
            "connection": visit.as_ref().ok().map(|visit| json!({
                "master": visit.master.to_string(), "greeting_ms": ms(visit.greeting), "round_trip_ms": ms(visit.round_trip),
                "mtu": visit.mtu, "bytes_per_second": visit.rate(),
            })),
            "troubles": self.troubles(visit),
        })
    }
}

impl Visit {
    /// Bytes a second, if enough was fetched to tell.
    pub fn rate(&self) -> Option<f64> {
        let (bytes, time) = self.fetched.filter(|(bytes, time)| *bytes >= BYTES_TO_TELL && !time.is_zero())?;
        Some(bytes as f64 / time.as_secs_f64())
    }
}

/// Total and available, from `/proc/meminfo`.
fn memory(text: &str) -> Option<[u64; 2]> {
    let kilobytes = |name: &str| {
        let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(':'))?;
        line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok()
    };
    Some([kilobytes("MemTotal")? << 10, kilobytes("MemAvailable")? << 10])
}

fn udp_buffer() -> std::io::Result<usize> {
    let socket = socket2::Socket::from(UdpSocket::bind("0.0.0.0:0")?);
    let _ = socket.set_recv_buffer_size(BUFFER_WANTED);
    // Linux tells twice what it gives.
    Ok(socket.recv_buffer_size()? / 2)
}

fn vectors() -> Vec<&'static str> {
    #[cfg(target_arch = "x86_64")]
    {
        let known = [("AVX2", is_x86_feature_detected!("avx2")), ("AVX-512", is_x86_feature_detected!("avx512f"))];
        known.into_iter().filter(|(_, is_there)| *is_there).map(|(name, _)| name).collect()
    }
    #[cfg(not(target_arch = "x86_64"))]
    Vec::new()
}

fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

/// A number of bytes in few letters.
fn bytes(count: f64) -> String {
    let units = [(1e9, "GB"), (1e6, "MB"), (1e3, "kB")];
    let (scale, unit) = units.into_iter().find(|(scale, _)| count >= *scale).unwrap_or((1.0, "bytes"));
    format!("{:.1} {unit}", count / scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn well() -> (Facts, Visit) {
        let facts = Facts {
            name: "lab".into(),
            threads: 8,
            vectors: vec!["AVX2"],
            load: Some(0.1),
            memory: Some([16 << 30, 12 << 30]),
            udp_buffer: Some(4 << 20),
            time: Duration::from_secs(1),
        };
        let visit = Visit {
            master: "10.0.0.1:7464".parse().unwrap(),
            greeting: Duration::from_millis(3),
            round_trip: Duration::from_micros(400),
            mtu: 1452,
            fetched: Some((100_000_000, Duration::from_secs(1))),
        };
        (facts, visit)
    }

    #[test]
    fn a_healthy_machine_is_left_alone() {
        let (facts, visit) = well();
        let screen = facts.screen(&Ok(visit));
        assert!(screen.contains("all is well") && screen.contains("100.0 MB a second"), "{screen}");
        assert_eq!(facts.json(&Ok(visit))["troubles"], json!([]));
    }

    #[test]
    fn every_trouble_is_told_with_its_remedy() {
        let (mut facts, mut visit) = well();
        (facts.memory, facts.udp_buffer, facts.load) = (Some([1 << 30, 1 << 20]), Some(212_992), Some(7.0));
        (visit.mtu, visit.fetched) = (1200, Some((BYTES_TO_TELL, Duration::from_secs(1))));
        let troubles = facts.troubles(&Ok(visit));
        for (trouble, word) in troubles.iter().zip(["memory", "rmem_max", "--nice", "1200", "slow"]) {
            assert!(trouble.contains(word), "{trouble}");
        }
        assert_eq!(troubles.len(), 5);
        assert!(facts.screen(&Err("no master".into())).contains("no master"));
    }

    #[test]
    fn memory_is_read_from_the_systems_words() {
        assert_eq!(memory("MemTotal:       2 kB\nMemFree: 7 kB\nMemAvailable:   1 kB\n"), Some([2048, 1024]));
        assert_eq!(memory("MemTotal: x kB"), None);
        assert!(Facts::here().memory.is_some_and(|[all, free]| all >= free));
    }
}
