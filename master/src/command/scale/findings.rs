//! What the numbers say: in sentences.

use super::simulate::{Model, Simulated};
use super::{Curves, Measured};

/// Below this, clients are not used well.
const GOOD: f64 = 0.9;
/// Busier than this, a master or a link is the limit.
const BUSY: f64 = 0.85;

/// What is to be known, one sentence each.
pub fn findings(curves: &Curves, model: &Model, pixels: u64) -> Vec<String> {
    let mut said = Vec::new();
    if let Some(most) = curves.measured.last() {
        said.push(format!(
            "Measured with {} clients: {:.2} frames a second, efficiency {:.3}; a client makes {:.2} distinct light sets for \
             a frame that it takes part in.",
            most.shares.len(),
            1.0 / most.frame_time(),
            curves.efficiency(most),
            most.sets_per_share,
        ));
    }
    let starved = |measured: &&Measured| measured.quota_used() < 0.93;
    if let Some(worst) = curves.measured.iter().filter(starved).min_by(|a, b| a.quota_used().total_cmp(&b.quota_used()))
    {
        said.push(format!(
            "With {} clients they used only {:.0} % of {}: they waited for questions, or the machine was busy with other \
             things.",
            worst.shares.len(),
            worst.quota_used() * 100.0,
            if curves.is_emulated { "their share of the machine" } else { "their threads' time" },
        ));
    }
    if let Some(uneven) = &curves.uneven {
        let ideal = curves.ideal_rate(uneven);
        said.push(format!(
            "Clients of unequal speed make {:.1} % of what all of them would make by themselves.",
            100.0 / uneven.frame_time() / ideal
        ));
    }
    let agreement = curves.measured.iter().filter_map(|measured| {
        let simulated = curves.simulated.iter().find(|one| one.clients == measured.shares.len())?;
        Some((measured.shares.len(), simulated.frame_time / measured.frame_time() - 1.0))
    });
    if let Some((clients, off)) = agreement.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())) {
        said.push(format!(
            "Where both exist, the simulation is off by {:+.1} % at most (frame time, {clients} clients).",
            off * 100.0
        ));
    }
    said.push(saturation(curves));
    let answers = curves.measured.first().map_or(1.0, |one| one.answers_per_frame);
    let most = curves.simulated.last().map_or(1, |one| one.clients);
    let (micros, busiest) = model.bottleneck(most);
    let by_master = 1e6 / (micros * answers);
    let by_link = 1e6 * model.link / (model.bytes * answers);
    said.push(format!(
        "With {most} clients, the master ends at {by_master:.0} frames a second ({:.1} Mpixel/s) by {busiest}, with {} cores; \
         it takes {:.0} µs of a core for an answer, all its work counted. Its link ends at {by_link:.0}.",
        by_master * pixels as f64 / 1e6,
        model.cores,
        model.master.with(most).all(),
    ));
    said
}

/// What becomes the limit first as clients are added.
fn saturation(curves: &Curves) -> String {
    let Some(first) = curves.simulated.iter().find(|one| curves.simulated_efficiency(one) < GOOD) else {
        let most = curves.simulated.last().map_or(0, |one| one.clients);
        return format!("In the simulation nothing saturates up to {most} clients: efficiency stays above {GOOD}.");
    };
    let Simulated { clients, master_busy, busiest, link_busy, on_tiles, on_sets, .. } = first;
    let efficiency = curves.simulated_efficiency(first);
    let waiting = 1.0 - on_tiles - on_sets;
    let repeated = on_sets - curves.simulated.first().map_or(0.0, |one| one.on_sets);
    let what = if *master_busy > BUSY {
        format!("the master, by {busiest}: busy {:.0} % of the time", master_busy * 100.0)
    } else if *link_busy > BUSY {
        format!("the master's link, which is busy {:.0} % of the time", link_busy * 100.0)
    } else if repeated > waiting {
        format!("light sets that several clients make for themselves: they take {:.0} % of their time", on_sets * 100.0)
    } else {
        format!("the number of tiles in flight: clients wait {:.0} % of their time", waiting * 100.0)
    };
    format!("What saturates first, in the simulation: {what}, at {clients} clients (efficiency {efficiency:.2}).")
}
