//! The page, the same tables for documents, and all numbers for programs.

use std::fmt::Write;

use plotters::prelude::SeriesLabelPosition;

use super::Section;
use super::judge::{Judged, as_seen};
use super::plot::over_time;
use super::settings::{Mode, Settings};
use crate::command::report::csv::quoted;
use crate::command::report::page::{escaped, opening, table};
use crate::command::report::plot::{Axes, Curve, PALETTE, draw};
use crate::command::report::settings::machine;
use crate::command::report::strip;
use crate::command::report::tables::{Table, short};

/// The whole page.
///
/// # Errors
/// If a plot or a picture cannot be encoded.
pub(super) fn page(sections: &[Section], settings: &Settings, block: &str) -> anyhow::Result<String> {
    let mut html = opening("Error while things move") + INTRODUCTION;
    let _ = writeln!(html, "<p>Machine: {}; {} threads.</p>", escaped(&machine()), settings.threads);
    if is_sweep(settings) {
        html += &table("FLIP by pixels a new sample, mean over the pictures, in step", &sweep(sections, settings));
        let _ = writeln!(html, "<div class=\"plot\">{}</div>", sweep_plot(sections, settings)?);
    }
    for section in sections {
        html += &about(section)?;
    }
    let _ = write!(
        html,
        "<h2>Settings</h2>\n<p>The same as <code>settings.json</code> beside this page. The command repeats the report; what \
         is played in step is then the same bits.</p>\n<pre>{}</pre>\n</body></html>\n",
        escaped(block)
    );
    Ok(html)
}

fn about(section: &Section) -> anyhow::Result<String> {
    let name = escaped(&section.name);
    let [width, height] = section.size;
    let mut html = format!(
        "<h2>{name}</h2>\n<p class=\"faint\">{}: {} moving pictures of {width}x{height} in {}; {}.</p>\n<ul>",
        escaped(&section.path.display().to_string()),
        section.pictures,
        escaped(&section.scene.display().to_string()),
        match section.floor {
            Some(floor) => format!("noise of the truths about relMSE {}", short(floor)),
            None => "the truths state no noise of their own".to_owned(),
        }
    );
    for note in &section.notes {
        let _ = write!(html, "<li class=\"amiss\">{}</li>", escaped(note));
    }
    for judged in section.judged.iter().filter(|judged| judged.non_finite > 0) {
        let (method, mode) = (escaped(&judged.play.method), judged.play.mode);
        let _ = write!(html, "<li class=\"amiss\">{method}, {mode}: {} values not finite</li>", judged.non_finite);
    }
    html += "</ul>\n";
    html += &table("As shown", &summary(section));
    let flip = over_time(&section.judged, "FLIP", |point| point.flip)?;
    let rel_mse = over_time(&section.judged, "relMSE", |point| point.rel_mse)?;
    let _ = write!(html, "<div class=\"plot\">{flip}</div>\n<div class=\"plot\">{rel_mse}</div>\n");
    html += &pictures(section)?;
    Ok(html)
}

/// The middle picture of each play, and where it is wrong.
fn pictures(section: &Section) -> anyhow::Result<String> {
    let Some(truth) = &section.truth else { return Ok(String::new()) };
    let mut html = format!(
        "<h3>Pictures</h3>\n<p class=\"faint\">{DIFFERENCES}</p>\n<div class=\"strip\"><figure><img alt=\"truth\" src=\"{}\">\
         <figcaption>truth</figcaption></figure></div>\n",
        strip::shown(truth)?
    );
    for judged in &section.judged {
        let middle = judged.points.len() / 2;
        let (Some(point), Some(shot)) = (judged.points.get(middle), judged.play.shots.get(middle)) else { continue };
        let seen = as_seen(&shot.picture, truth);
        let name = format!("{}, {}", escaped(&judged.play.method), judged.play.mode);
        let _ = writeln!(
            html,
            "<div class=\"strip\" style=\"grid-template-columns: repeat(2, auto)\"><figure><img alt=\"{name}\" src=\"{}\">\
             <figcaption>{name}: FLIP {:.3}</figcaption></figure><figure><img alt=\"its difference\" src=\"{}\">\
             <figcaption>difference</figcaption></figure></div>",
            strip::shown(&seen)?,
            point.flip,
            strip::difference(&seen, truth)?
        );
    }
    Ok(html)
}

/// A row for each play.
fn summary(section: &Section) -> Table {
    let heading = [
        "method",
        "played",
        "FLIP",
        "worst",
        "relMSE",
        "99.9 %",
        "unknown %",
        "standing FLIP",
        "flicker",
        "pictures",
        "pictures/s",
        "latency p50 ms",
        "p99 ms",
        "rays a picture",
        "bytes a picture",
    ];
    let none = || "–".to_owned();
    let three = |value: Option<f64>| value.map_or_else(none, |value| format!("{value:.3}"));
    let row = |judged: &Judged| {
        let play = &judged.play;
        let is_live = play.latency.is_some();
        let latency = |share: f64| play.latency.as_ref().and_then(|latency| latency.percentile(share));
        let ms = |share| latency(share).map_or_else(none, |micros| format!("{:.0}", micros as f64 / 1e3));
        let each = |count: u64| if play.pictures == 0 { none() } else { short(count as f64 / play.pictures as f64) };
        vec![
            play.method.clone(),
            play.mode.to_string(),
            three(judged.mean(|point| point.flip)),
            three(judged.worst(|point| point.flip)),
            judged.mean(|point| point.rel_mse).map_or_else(none, short),
            judged.mean(|point| point.percentile_999).map_or_else(none, short),
            judged.mean(|point| point.unknown).map_or_else(none, |share| format!("{:.1}", 100.0 * share)),
            three(judged.standing.map(|point| point.flip)),
            play.flicker.map_or_else(none, |flicker| format!("{flicker:.5}")),
            play.pictures.to_string(),
            if is_live { format!("{:.1}", play.pictures as f64 / play.seconds.max(1e-9)) } else { none() },
            ms(0.5),
            ms(0.99),
            each(play.cost.rays()),
            each(play.bytes),
        ]
    };
    let heading = heading.map(str::to_owned).to_vec();
    std::iter::once(heading).chain(section.judged.iter().map(row)).collect()
}

/// Several ratios were asked for.
fn is_sweep(settings: &Settings) -> bool {
    ratios(settings).len() > 1
}

fn ratios(settings: &Settings) -> Vec<u32> {
    let ratio = |mode: &Mode| if let Mode::InStep(ratio) = mode { *ratio } else { None };
    settings.modes.iter().filter_map(ratio).collect()
}

/// Mean FLIP of a method at a ratio in one recording.
fn flip_at(section: &Section, method: &str, ratio: u32) -> Option<f64> {
    let is_it = |judged: &&Judged| judged.play.method == method && judged.play.mode == Mode::InStep(Some(ratio));
    section.judged.iter().find(is_it)?.mean(|point| point.flip)
}

fn mean_at(sections: &[Section], method: &str, ratio: u32) -> Option<f64> {
    let all: Vec<f64> = sections.iter().filter_map(|section| flip_at(section, method, ratio)).collect();
    (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64)
}

/// Ratios are columns; a row for each recording and method, and for each method over all.
fn sweep(sections: &[Section], settings: &Settings) -> Table {
    let ratios = ratios(settings);
    let mut table: Table = vec![vec!["recording".to_owned(), "method".to_owned()]];
    table[0].extend(ratios.iter().map(u32::to_string));
    let cell = |value: Option<f64>| value.map_or("–".to_owned(), |value| format!("{value:.3}"));
    for section in sections {
        for (method, _) in &settings.methods {
            let mut row = vec![section.name.clone(), method.clone()];
            row.extend(ratios.iter().map(|ratio| cell(flip_at(section, method, *ratio))));
            table.push(row);
        }
    }
    for (method, _) in settings.methods.iter().filter(|_| sections.len() > 1) {
        let mut row = vec!["all".to_owned(), method.clone()];
        row.extend(ratios.iter().map(|ratio| cell(mean_at(sections, method, *ratio))));
        table.push(row);
    }
    table
}

fn sweep_plot(sections: &[Section], settings: &Settings) -> anyhow::Result<String> {
    let curve = |(number, (method, _)): (usize, &(String, frame::Chosen))| {
        let point = |ratio: &u32| {
            let flip = mean_at(sections, method, *ratio)?;
            Some([f64::from(*ratio), flip, flip, flip])
        };
        let points = ratios(settings).iter().filter_map(point).collect();
        let colour = PALETTE[number % PALETTE.len()];
        Curve { label: method.clone(), colour, is_dashed: false, is_bold: true, points, guide: Vec::new() }
    };
    let curves: Vec<Curve> = settings.methods.iter().enumerate().map(curve).collect();
    let legend = SeriesLabelPosition::UpperLeft;
    draw(&curves, None, &Axes { x: "pixels a new sample", y: "FLIP", value: short, legend })
}

/// The tables, as documents have them.
pub(super) fn markdown(sections: &[Section], settings: &Settings) -> String {
    let mut text = String::new();
    if is_sweep(settings) {
        text += &lines("FLIP by pixels a new sample, mean over the pictures, in step", &sweep(sections, settings));
    }
    for section in sections {
        text += &lines(&section.name, &summary(section));
    }
    text
}

fn lines(title: &str, table: &Table) -> String {
    let mut text = format!("{title}\n\n");
    for (number, row) in table.iter().enumerate() {
        let _ = writeln!(text, "| {} |", row.join(" | "));
        if number == 0 {
            let _ = writeln!(text, "|{}", "---|".repeat(row.len()));
        }
    }
    text + "\n"
}

/// A row for each picture that was compared.
pub(super) fn csv(sections: &[Section]) -> String {
    let mut text =
        "session,method,played,mismatch,picture,seconds,line,rel_mse,flip,percentile_99_9,unknown\n".to_owned();
    for section in sections {
        for judged in &section.judged {
            let (mode, ratio) = match judged.play.mode {
                Mode::InStep(ratio) => ("step", ratio.map_or(String::new(), |ratio| ratio.to_string())),
                Mode::RealTime => ("time", String::new()),
            };
            let moving = judged.points.iter().enumerate().map(|(number, point)| ((number + 1).to_string(), point));
            for (number, point) in moving.chain(judged.standing.iter().map(|point| ("standing".to_owned(), point))) {
                let _ = writeln!(
                    text,
                    "{},{},{mode},{ratio},{number},{},{},{:e},{:e},{:e},{:e}",
                    quoted(&section.name),
                    quoted(&judged.play.method),
                    point.t,
                    point.shows + 2,
                    point.rel_mse,
                    point.flip,
                    point.percentile_999,
                    point.unknown
                );
            }
        }
    }
    text
}

const INTRODUCTION: &str = "\
<p>How far what people see is from the truth while things move. A recording is played through each method; some of the \
pictures are compared with pictures of the same states that were drawn for long. A smaller picture is enlarged as a browser \
does it. <em>In step</em>: time stands still while a picture is drawn, and each has as many samples as it says, so that \
all machines agree to the bit. <em>Real time</em>: what this machine showed by then; latency is from an input to the first \
picture of it, as a browser receives it. <em>Standing</em>: a second later, nothing having moved (in step: nine still \
frames).</p>\n\
<p>FLIP is of 8-bit pictures at exposure 0, 0 to 1; relMSE is the mean of (x − r)² / (r² + 0.01) over pixels and \
channels of linear radiance; flicker is how much a point of the scene changes from picture to picture while only the camera \
moves.</p>\n";

const DIFFERENCES: &str = "\
The middle one of the pictures that are compared. Differences: black is right, white is off by a quarter of the truth or more.";
