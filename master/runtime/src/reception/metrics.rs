//! What the master tells those who look after it: `--metrics` answers Prometheus and health checks.
//!
//! The loops that draw beat ([`Beats`]); everything else is on the cluster's board ([`Status`]) anyway.
//! [`page`] makes text of both, and is pure.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use anyhow::anyhow;
use health::{Page, Report, Server};
use protocol::schedule::WorkerState;
use serde_json::json;

use crate::cluster::pulse::Beats;
use crate::cluster::{Cluster, Status, WorkerInfo, roster};
use crate::console::Console;

/// A loop that has not gone round for so long hangs; saving a large picture may take a while.
const HANGS_AFTER: Duration = Duration::from_secs(120);

/// Answers at the address of `--metrics` until the server is dropped.
///
/// # Errors
/// The address cannot be listened at.
pub fn watch(address: SocketAddr, cluster: &Cluster, console: &Console) -> anyhow::Result<Server> {
    let (status, pulse) = (cluster.board(), cluster.pulse().clone());
    let report = move || report(&status(), &pulse.beats(), Instant::now());
    let server = Server::start(address, report).map_err(|error| anyhow!(error))?;
    let url = format!("http://{}/metrics", server.address());
    console.line(&format!("metrics: {url}   (/healthz and /readyz beside it)"));
    console.emit("metrics", json!({ "url": url, "address": server.address().to_string() }));
    Ok(server)
}

fn report(status: &Status, beats: &Beats, now: Instant) -> Report {
    let since = now.saturating_duration_since(beats.last);
    let alive = if since < HANGS_AFTER { Ok(()) } else { Err(format!("no sign of life for {} s", since.as_secs())) };
    // Ready is who takes workers in; a master that waits for its first one must be found by it.
    let ready = alive.clone().map(|()| match status.workers {
        0 => "waiting for workers".to_owned(),
        _ => roster::summary(status),
    });
    Report { page: page(status, beats), alive, ready }
}

/// All numbers, as Prometheus reads them.
pub fn page(status: &Status, beats: &Beats) -> Page {
    let Status { counters, cost, .. } = status;
    let mut page = Page::default();
    page.counter("igi_frames_total", "Complete frames; pictures shown, where people watch.", beats.frames as f64);
    page.histogram("igi_frame_latency_seconds", "From one complete frame to the next.", &beats.frame_latency);
    if let Some([median, worst]) = beats.input_latency {
        let help = "From an input to the first picture that shows it, over the latest inputs.";
        page.gauges("igi_input_latency_seconds", help, "quantile", [("0.5", median), ("0.99", worst)]);
    }

    page.counter("igi_tiles_total", "Tiles whose answer was used.", counters.delivered as f64);
    page.counter("igi_tiles_sent_total", "Tiles sent to workers, the same one perhaps twice.", counters.sent as f64);
    page.counter(
        "igi_tiles_asked_twice_total",
        "Tiles asked of a second worker because threads were idle.",
        counters.asked_twice as f64,
    );
    page.counter("igi_tiles_given_up_total", "Tiles set aside: workers die of them.", counters.given_up as f64);
    page.counter("igi_answers_useless_total", "Answers that nobody waited for any more.", counters.useless as f64);
    page.counter("igi_leases_expired_total", "Tiles not answered in time.", counters.leases_expired as f64);
    page.counter("igi_quarantines_total", "Times a worker was put into quarantine.", counters.quarantines as f64);
    let help = "Answers that were asked of another worker, to compare.";
    page.counter("igi_answers_checked_total", help, counters.checked as f64);
    page.counter("igi_workers_exposed_total", "Workers found to compute wrongly.", counters.exposed as f64);

    let help = "Thread time of the answers that were used.";
    page.counters("igi_work_seconds_total", help, "stage", cost.seconds_by_stage());
    let rays = cost.rays_by_kind().map(|(kind, rays)| (kind, rays as f64));
    page.counters("igi_rays_total", "Rays of the answers that were used.", "kind", rays);
    page.counter("igi_photon_queries_total", "Photon-map queries.", cost.photon_queries as f64);
    page.counter("igi_samples_dropped_total", "Samples that were not finite.", cost.dropped as f64);

    let bytes = [("sent", status.bytes_sent as f64), ("received", status.bytes_received as f64)];
    page.counters("igi_bytes_total", "Bytes to and from workers, all that UDP carries.", "direction", bytes);
    page.counter("igi_refused_total", "Connections refused: wrong token, version or protocol.", status.refused as f64);

    let count = |state| status.list.iter().filter(|info| info.state == state).count() as f64;
    let states = STATES.map(|state| (roster::word(state), count(state)));
    page.gauges("igi_workers", "Workers that are there, by what they do.", "state", states);
    let able = |state| matches!(state, WorkerState::Ready | WorkerState::Slow);
    let threads: usize = status.list.iter().filter(|info| able(info.state)).map(|info| info.threads).sum();
    page.gauge("igi_worker_threads", "Threads of the workers that answer.", threads as f64);
    let busy = [("dispatcher", status.busy.dispatcher), ("drawing", status.busy.drawing)];
    let help = "Share of the last second that a thread of the master was busy: near 1, more workers bring no more.";
    page.gauges("igi_master_busy", help, "thread", busy);
    let in_flight: usize = status.list.iter().map(|info| info.in_flight).sum();
    page.gauge("igi_tiles_in_flight", "Tiles that workers hold.", in_flight as f64);
    each_worker(&mut page, &status.list);
    page
}

/// One line a worker that is there, by the master's number for it; `--json` has the names.
fn each_worker(page: &mut Page, list: &[WorkerInfo]) {
    let each = |value: fn(&WorkerInfo) -> f64| list.iter().map(move |info| (info.worker, value(info)));
    let mut counter = |name, help, value| page.counter_each(name, help, "worker", each(value));
    counter("igi_worker_answers_total", "Answers of a worker.", |info| info.answered as f64);
    let help = "Answers of a worker that others gave as well when they were asked.";
    counter("igi_worker_answers_confirmed_total", help, |info| info.confirmed as f64);
    counter("igi_worker_answer_bytes_total", "Bytes of a worker's answers.", |info| info.answer_bytes as f64);
    let mut gauge = |name, help, value| page.gauge_each(name, help, "worker", each(value));
    gauge("igi_worker_ready", "1: a worker answers; 0: igi_workers says what it does.", |info| {
        f64::from(u8::from(info.state == WorkerState::Ready))
    });
    let help = "Workers that compute behind a relay; 1: a worker that computes itself.";
    gauge("igi_worker_computing", help, |info| info.behind.map_or(1.0, |behind| f64::from(behind.workers)));
    let help = "Relays on the longest way to who computes.";
    gauge("igi_worker_relays_deep", help, |info| info.behind.map_or(0.0, |behind| f64::from(behind.depth)));
    gauge("igi_worker_tiles_in_flight", "Tiles that a worker holds.", |info| info.in_flight as f64);
    gauge("igi_worker_answer_seconds", "Usual thread time of a worker's answer.", |info| {
        info.thread_time.as_secs_f64()
    });
    gauge("igi_worker_turnaround_seconds", "Usual time from a question to a worker's answer.", |info| {
        info.turnaround.as_secs_f64()
    });
    let help = "There and back to a worker, as the transport measures it.";
    gauge("igi_worker_round_trip_seconds", help, |info| info.round_trip.as_secs_f64());
}

/// Every state has its line, so that a graph falls to zero instead of ending.
const STATES: [WorkerState; 6] = [
    WorkerState::Idle,
    WorkerState::Preparing,
    WorkerState::Ready,
    WorkerState::Slow,
    WorkerState::Quarantined,
    WorkerState::Leaving,
];

#[cfg(test)]
mod tests {
    use protocol::answer::Cost;
    use protocol::schedule::Counters;

    use super::*;
    use crate::cluster::Busy;
    use crate::cluster::pulse::Pulse;

    fn beats(at: Instant) -> Beats {
        let pulse = Pulse::default();
        pulse.drawn(0, at);
        pulse.drawn(1, at);
        pulse.drawn(2, at + Duration::from_secs(1));
        pulse.beats().clone()
    }

    #[test]
    fn the_page_says_what_the_board_says() {
        let status = Status {
            counters: Counters { delivered: 7, leases_expired: 2, ..Counters::default() },
            cost: Cost { shadow_rays: 5, micros: [1_500_000, 0, 0, 0, 0, 0], ..Cost::default() },
            bytes_sent: 11,
            busy: Busy { dispatcher: 0.25, drawing: 0.5 },
            list: vec![roster::tests::info(4, WorkerState::Ready, None)],
            ..Status::default()
        };
        let page = page(&status, &beats(Instant::now()));
        for line in [
            "igi_tiles_total 7",
            "igi_leases_expired_total 2",
            "igi_rays_total{kind=\"shadow\"} 5",
            "igi_work_seconds_total{stage=\"eye\"} 1.5",
            "igi_bytes_total{direction=\"sent\"} 11",
            "igi_workers{state=\"quarantined\"} 0",
            "igi_master_busy{thread=\"drawing\"} 0.5",
            "igi_worker_answers_total{worker=\"4\"} 0",
            "igi_worker_ready{worker=\"4\"} 1",
            "igi_frames_total 3",
            // Two frames within a second: half a second each.
            "igi_frame_latency_seconds_bucket{le=\"0.25\"} 0",
            "igi_frame_latency_seconds_bucket{le=\"0.5\"} 2",
            "igi_frame_latency_seconds_sum 1",
        ] {
            assert!(page.text().lines().any(|said| said == line), "{line} is not in\n{}", page.text());
        }
        assert!(!page.text().contains("input_latency"), "nobody has moved anything");
    }

    #[test]
    fn a_loop_that_does_not_go_round_is_not_alive() {
        let now = Instant::now();
        let beats = beats(now);
        assert_eq!(report(&Status::default(), &beats, now).ready, Ok("waiting for workers".into()));
        let late = report(&Status::default(), &beats, now + HANGS_AFTER + Duration::from_secs(1));
        assert!(late.alive.is_err() && late.ready.is_err());
    }
}
