//! The page: all of it in one file, to be read by people.

use std::fmt::Write;

use plotters::chart::SeriesLabelPosition;
use plotters::style::RGBColor;
use scenes::Scene;

use super::settings::{ClientSource, Settings};
use super::{Curves, tables};
use crate::command::report::page::{escaped, opening, table};
use crate::command::report::plot::{Axes, Curve, PALETTE, draw};

/// Speed-up and efficiency against the number of clients.
///
/// # Errors
/// If the plotting library fails.
pub fn plots(curves: &Curves) -> anyhow::Result<[String; 2]> {
    let first = curves.simulated.first().map_or(1.0, |one| one.frame_time);
    let measured = curves.measured.iter().map(|one| (curves.firsts(one), curves.speed_up(one)));
    let simulated = curves.simulated.iter().map(|one| (one.clients as f64, first / one.frame_time));
    let (_, rates) = tables::PAPER[0];
    let paper = (0..5).map(|power| (f64::from(1 << power), rates[power] / rates[0]));
    let all = [
        ("measured", 0, false, measured.collect::<Vec<_>>()),
        ("simulated", 1, true, simulated.collect()),
        ("the paper, room with table", 6, false, paper.collect()),
    ];
    let most = all.iter().flat_map(|(.., points)| points).map(|(clients, _)| *clients).fold(1.0, f64::max);
    let curve = |(label, colour, is_dashed, points): &(&str, usize, bool, Vec<(f64, f64)>), per_client: bool| Curve {
        label: (*label).to_string(),
        colour: PALETTE[*colour],
        is_dashed: *is_dashed,
        is_bold: *colour == 0,
        points: points
            .iter()
            .map(|(clients, value)| (*clients, if per_client { value / clients } else { *value }))
            .map(|(clients, value)| [clients, value, value, value])
            .collect(),
        guide: Vec::new(),
    };
    let ideal = |end: f64| Curve {
        label: "ideal".into(),
        colour: RGBColor(150, 150, 150),
        is_dashed: true,
        is_bold: false,
        points: vec![[1.0, 1.0, 1.0, 1.0], [most, end, end, end]],
        guide: Vec::new(),
    };
    let x = if curves.is_emulated { "clients" } else { "clients (as many like the first)" };
    let plot = |per_client: bool, y, legend| {
        let mut drawn: Vec<Curve> = all.iter().map(|one| curve(one, per_client)).collect();
        drawn.push(ideal(if per_client { 1.0 } else { most }));
        let value = |value: f64| if value < 0.95 { format!("{value:.2}") } else { format!("{value:.0}") };
        draw(&drawn, None, &Axes { x, y, value, legend })
    };
    Ok([
        plot(false, "speed-up", SeriesLabelPosition::UpperLeft)?,
        plot(true, "efficiency", SeriesLabelPosition::LowerLeft)?,
    ])
}

/// The whole page.
pub fn page(
    name: &str,
    curves: &Curves,
    said: &[String],
    plots: &[&String],
    scene: &Scene,
    settings: &Settings,
) -> String {
    let mut html = opening("Frames a second against the number of clients");
    let _ = writeln!(
        html,
        "<p>{}, {}x{} pixels, {} triangles; {} frames for each number of clients, the same ones each time.</p>",
        escaped(name),
        scene.camera.width,
        scene.camera.height,
        scene.triangle_count(),
        settings.frames
    );
    if let ClientSource::Emulated(share) = settings.clients {
        let _ = write!(
            html,
            "<p><strong>This emulates a cluster.</strong> All clients are processes of one machine, and speak to the master by \
         QUIC over its loopback; each is held to {} of a core by the kernel, which makes it one of many equal, slow machines. \
         The network between them is faster than any real one, and all share one memory. Whatever else the machine does \
         shows as time that clients did not get.</p>\n<ul>",
            share
        );
    } else {
        let _ = write!(
            html,
            "<p><strong>These are {} clients that were connected</strong>, {CONNECTED}</p>\n<ul>",
            most_of(curves)
        );
    }
    said.iter().for_each(|sentence| _ = write!(html, "<li>{}</li>", escaped(sentence)));
    html += "</ul>\n";
    plots.iter().for_each(|plot| _ = writeln!(html, "<div class=\"plot\">{plot}</div>"));
    html += &table("Measured", &tables::measured(curves));
    let _ = writeln!(html, "<p class=\"faint\">{MEASURED}</p>");
    html += &table("Simulated", &tables::simulated(curves));
    let _ = writeln!(
        html,
        "<p class=\"faint\">{SIMULATED} Link {} Mbit/s, {} ms to each client.</p>",
        settings.bandwidth, settings.delay
    );
    html += &table("Beside", &tables::paper());
    let command = escaped(&settings.command(&scene.camera));
    let _ = writeln!(html, "<h2>Settings</h2>\n<pre>{command}</pre>\n</body></html>");
    html
}

fn most_of(curves: &Curves) -> usize {
    curves.measured.last().map_or(0, |one| one.shares.len())
}

const CONNECTED: &str = "\
each as fast as its machine is, and all there all the time: those beyond the number of a row were not asked. They are counted in \
threads of the first client: how long a thread takes for a tile, over what it takes on average, says how fast it is. So \
efficiency compares with what they would make by themselves, not with their number. The simulation is of clients that \
are all like the first.";

const MEASURED: &str = "\
Efficiency is T₁ / (P · T_P); for unequal clients it is what they make together over the sum of what each would make by \
itself. A client may wait for questions, or the machine may be busy with other work: then less than its share is used. \
Latency is the time from a frame's first question to its last answer, several frames being in flight. \
Every row draws the same picture, bit for bit: otherwise there would be no page.";

const SIMULATED: &str = "\
The same front end and the same schedule, with clients, network and clock computed: each tile takes what it took the one \
client that was measured, on average, answers pass the master's link one after the other, then its threads: those of the network, the one that \
decides who is asked, the one that assembles the picture. Each takes for an answer what it took with the most clients measured, and a core, of \
which there are as many as here; what deciding takes more with more clients is measured apart.";
