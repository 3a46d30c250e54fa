//! The numbers as tables, for people and as CSV.

use super::measure::percentile;
use super::simulate::Simulated;
use super::{Curves, Measured};
use crate::command::report::tables::Table;

/// What was measured, a row for each number of clients.
pub fn measured(curves: &Curves) -> Table {
    let (each, used) = match curves.is_emulated {
        true => ("cores each", "of their share used"),
        false => ("threads like the first's", "of their threads used"),
    };
    let mut table = vec![words(&[
        "clients",
        each,
        "frames/s",
        "speed-up",
        "efficiency",
        used,
        "kB/frame",
        "master, cores",
        "distinct k a client and frame",
        "sets made a frame",
        "latency p50 ms",
        "p99 ms",
    ])];
    let row = |clients: String, one: &Measured, efficiency: f64| {
        vec![
            clients,
            format!("{:.3}", if curves.is_emulated { one.shares[0] } else { one.cores() }),
            format!("{:.3}", 1.0 / one.frame_time()),
            format!("{:.2}", curves.speed_up(one)),
            format!("{efficiency:.3}"),
            format!("{:.0} %", one.quota_used() * 100.0),
            format!("{:.0}", one.bytes_per_frame / 1e3),
            format!("{:.3}", one.master_cores),
            format!("{:.2}", one.sets_per_share),
            format!("{:.1}", one.sets_per_frame),
            format!("{:.0}", percentile(&one.latencies_ms, 50)),
            format!("{:.0}", percentile(&one.latencies_ms, 99)),
        ]
    };
    table.extend(curves.measured.iter().map(|one| row(one.shares.len().to_string(), one, curves.efficiency(one))));
    table.extend(curves.uneven.iter().map(|one| {
        let parts: Vec<String> = one.shares.iter().map(|share| format!("{:.0}", share / one.shares[0])).collect();
        row(parts.join(":"), one, 1.0 / one.frame_time() / curves.ideal_rate(one))
    }));
    table
}

/// What was simulated, a row for each number of clients.
pub fn simulated(curves: &Curves) -> Table {
    let mut table = vec![words(&[
        "clients, simulated",
        "frames/s",
        "speed-up",
        "efficiency",
        "on tiles",
        "on light sets",
        "waiting",
        "master busy",
        "link busy",
        "distinct k a client and frame",
        "asked twice",
        "latency p50 ms",
        "p99 ms",
    ])];
    let percent = |share: f64| format!("{:.1} %", share * 100.0);
    table.extend(curves.simulated.iter().map(|one| {
        vec![
            one.clients.to_string(),
            format!("{:.3}", 1.0 / one.frame_time),
            format!("{:.2}", curves.simulated[0].frame_time / one.frame_time),
            format!("{:.3}", curves.simulated_efficiency(one)),
            percent(one.on_tiles),
            percent(one.on_sets),
            percent(1.0 - one.on_tiles - one.on_sets),
            percent(one.master_busy),
            percent(one.link_busy),
            format!("{:.2}", one.sets_per_share),
            percent(one.asked_twice),
            format!("{:.0}", one.latency_ms[0]),
            format!("{:.0}", one.latency_ms[1]),
        ]
    }));
    table
}

/// The paper's Table 1, frames a second; efficiencies are computed from it.
pub fn paper() -> Table {
    let mut table = vec![words(&["Wald et al. 2002, Table 1", "1", "2", "4", "8", "16", "efficiency at 16"])];
    for (name, rates) in PAPER {
        let mut row = vec![name.to_string()];
        row.extend(rates.map(|rate| format!("{rate:.1}")));
        row.push(format!("{:.2}", rates[4] / (16.0 * rates[0])));
        table.push(row);
    }
    table
}

/// Scenes of the paper, and their frames a second with 1, 2, 4, 8 and 16 clients.
pub const PAPER: [(&str, [f64; 5]); 3] = [
    ("Room with table", [0.4, 0.8, 1.6, 3.2, 5.3]),
    ("Room with egg", [0.3, 0.7, 1.4, 2.7, 5.4]),
    ("Office", [0.2, 0.3, 0.6, 1.2, 2.4]),
];

/// All rows, for programs.
pub fn csv(curves: &Curves) -> String {
    let mut text = String::from(
        "kind,clients,cores,frames_per_second,speed_up,efficiency,quota_used,bytes_per_frame,master_cores,\
         sets_per_client_and_frame,latency_p50_ms,latency_p99_ms,on_tiles,on_sets,master_busy,link_busy\n",
    );
    let of = |kind: &str, one: &Measured, efficiency: f64| {
        format!(
            "{kind},{},{},{},{},{efficiency},{},{},{},{},{},{},,,,\n",
            one.shares.len(),
            one.cores(),
            1.0 / one.frame_time(),
            curves.speed_up(one),
            one.quota_used(),
            one.bytes_per_frame,
            one.master_cores,
            one.sets_per_share,
            percentile(&one.latencies_ms, 50),
            percentile(&one.latencies_ms, 99),
        )
    };
    curves.measured.iter().for_each(|one| text += &of("measured", one, curves.efficiency(one)));
    let uneven = |one: &Measured| of("measured uneven", one, 1.0 / one.frame_time() / curves.ideal_rate(one));
    curves.uneven.iter().for_each(|one| text += &uneven(one));
    let of = |kind: &str, one: &Simulated, efficiency: Option<f64>| {
        format!(
            "{kind},{},,{},{},{},,,,{},{},{},{},{},{},{}\n",
            one.clients,
            1.0 / one.frame_time,
            curves.simulated[0].frame_time / one.frame_time,
            efficiency.map_or(String::new(), |efficiency| efficiency.to_string()),
            one.sets_per_share,
            one.latency_ms[0],
            one.latency_ms[1],
            one.on_tiles,
            one.on_sets,
            one.master_busy,
            one.link_busy,
        )
    };
    curves.simulated.iter().for_each(|one| text += &of("simulated", one, Some(curves.simulated_efficiency(one))));
    curves.simulated_uneven.iter().for_each(|one| text += &of("simulated uneven", one, None));
    text
}

/// A table in columns.
pub fn text(table: &Table) -> String {
    let line = |row: &Vec<String>| format!("| {} |\n", row.join(" | "));
    let mut rows = table.iter();
    let mut text = rows.next().map(line).unwrap_or_default();
    text += &format!("|{}\n", "---|".repeat(table.first().map_or(0, Vec::len)));
    rows.for_each(|row| text += &line(row));
    text
}

fn words(words: &[&str]) -> Vec<String> {
    words.iter().map(|word| (*word).to_string()).collect()
}
