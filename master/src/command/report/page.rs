//! The page: all of it in one file, to be read by people.

use std::fmt::Write;

use super::Section;
use super::judgement::Series;
use super::left_out::LeftOut;
use super::strip;
use super::tables::{self, Table};

/// The whole page.
///
/// # Errors
/// If a plot or a picture cannot be encoded.
pub(super) fn page(
    sections: &[Section],
    left_out: &LeftOut,
    marks: &[f64],
    clock: &str,
    settings: &str,
    machine: &str,
) -> anyhow::Result<String> {
    let mut html = opening("Error against run time") + INTRODUCTION;
    let _ = writeln!(html, "<p>Machine: {}. Seconds are {}.</p>", escaped(machine), escaped(clock));
    html += "<ul>";
    for section in sections {
        let name = escaped(&section.subject.name);
        let _ = write!(html, "<li><a href=\"#{name}\">{name}</a></li>");
    }
    let chapter = left_out.page();
    if !chapter.is_empty() {
        html += "<li><a href=\"#left-out\">what is left out</a></li>";
    }
    html += "</ul>\n";
    for section in sections {
        html += &scene(section, marks, clock)?;
    }
    html += &chapter;
    let _ = write!(
        html,
        "<h2>Settings</h2>\n<p>The same as <code>settings.json</code> beside this page. The command repeats the \
         report; pictures after a number of frames are then the same bits, times are the machine's.</p>\n<pre>{}</pre>\n",
        escaped(settings)
    );
    html += "</body></html>\n";
    Ok(html)
}

/// The beginning of a page that needs nothing but itself, up to its heading.
pub(crate) fn opening(title: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <title>{title}</title><style>{}</style></head><body>\n<h1>{title}</h1>\n",
        include_str!("page.css")
    )
}

/// A scene: what was found, plots, tables, pictures.
fn scene(section: &Section, marks: &[f64], clock: &str) -> anyhow::Result<String> {
    let Section { subject, series, findings, troubles, preparations, .. } = section;
    let name = escaped(&subject.name);
    let mut html = format!(
        "<h2 id=\"{name}\">{name}</h2>\n<p class=\"faint\">{} triangles, {}x{} pixels; reference {}, {}.</p>\n",
        subject.scene.triangle_count(),
        subject.reference.width,
        subject.reference.height,
        escaped(&subject.reference_path.display().to_string()),
        match subject.floor {
            Some(floor) => format!("whose own noise is about relMSE {}", tables::short(floor)),
            None => "whose own noise nobody states, so that it counts as bias".to_string(),
        }
    );
    html += "<ul>";
    for finding in findings {
        let class = if finding.is_amiss { " class=\"amiss\"" } else { "" };
        let _ = write!(html, "<li{class}>{}</li>", escaped(&finding.text));
    }
    for trouble in troubles {
        let _ = write!(html, "<li class=\"amiss\">{}</li>", escaped(trouble));
    }
    html += "</ul>\n";
    if series.iter().all(|series| series.points.is_empty()) {
        return Ok(html + "<p>Nothing was measured.</p>\n");
    }

    let seconds = format!("seconds, {clock}");
    let [errors, parts] = [section.error_plot(&seconds)?, section.parts_plot(&seconds)?];
    let _ = write!(html, "<div class=\"plot\">{errors}</div>\n<p class=\"faint\">{ERRORS}</p>\n");
    let _ = write!(html, "<div class=\"plot\">{parts}</div>\n<p class=\"faint\">{PARTS}</p>\n");
    for (mark, seconds) in marks.iter().enumerate().filter(|(mark, _)| reached(series, *mark)) {
        html += &table(&format!("At {seconds} s"), &tables::equal_time(series, mark));
    }
    html += &table("Time to an error", &tables::equal_error(series));
    html += &table("In the limit", &tables::limits(series));
    html += &table("What a sample costs (counts are a sample's)", &tables::costs(series, preparations));
    html += &pictures(section, marks)?;
    Ok(html)
}

/// A grid: a row for each method, picture and difference for each mark.
fn pictures(section: &Section, marks: &[f64]) -> anyhow::Result<String> {
    let reached: Vec<(usize, f64)> =
        marks.iter().copied().enumerate().filter(|(mark, _)| reached(&section.series, *mark)).collect();
    let reference = &section.subject.reference;
    let mut html = format!(
        "<h3>Pictures</h3>\n<p class=\"faint\">{DIFFERENCES}</p>\n<div class=\"strip\"><figure><img alt=\"reference\" \
         src=\"{}\"><figcaption>reference</figcaption></figure></div>\n",
        strip::shown(reference)?
    );
    for series in &section.series {
        if reached.is_empty() || series.pictures.iter().all(Option::is_none) {
            continue;
        }
        let _ =
            write!(html, "<div class=\"strip\" style=\"grid-template-columns: repeat({}, auto)\">", 2 * reached.len());
        for (mark, seconds) in &reached {
            let Some(picture) = series.pictures.get(*mark).and_then(Option::as_ref) else { continue };
            let (name, shown) = (escaped(&series.name), strip::shown(picture)?);
            let error = series.marks[*mark].as_ref().map_or(String::new(), |p| tables::short(p.rel_mse.value));
            let _ = write!(
                html,
                "<figure><img alt=\"{name} at {seconds} s\" src=\"{shown}\"><figcaption>{name}, {seconds} s: relMSE {error}\
                 </figcaption></figure><figure><img alt=\"its difference\" src=\"{}\"><figcaption>difference</figcaption>\
                 </figure>",
                strip::difference(picture, reference)?
            );
        }
        html += "</div>\n";
    }
    Ok(html)
}

/// Some method reached the mark.
fn reached(series: &[Series], mark: usize) -> bool {
    series.iter().any(|series| series.marks.get(mark).is_some_and(Option::is_some))
}

pub(crate) fn table(title: &str, rows: &Table) -> String {
    let mut html = format!("<h3>{title}</h3>\n<div class=\"scroll\"><table>");
    for (number, row) in rows.iter().enumerate() {
        let cell = if number == 0 { "th" } else { "td" };
        html += "<tr>";
        for word in row {
            let _ = write!(html, "<{cell}>{}</{cell}>", escaped(word));
        }
        html += "</tr>\n";
    }
    html + "</table></div>\n"
}

/// Text as HTML.
pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

const INTRODUCTION: &str = "\
<p>How far the pictures of several methods are from a reference, and how fast they get closer. Every method draws the \
same scene several times with different random numbers; the time until its workers are ready is not counted, nor is \
comparing. What is drawn is looked at after 1, 2, 4, 8, … frames or samples a pixel, and at the first one after each \
mark.</p>\n\
<p>The error is relMSE, the mean of (x − r)² / (r² + 0.01) over pixels and channels of linear radiance. An unbiased \
method's error falls as 1/time for ever: slope −1 on logarithmic axes. A slope of 0 is a <em>floor</em>: more time does \
not help. A method that filters has two curves: as a person sees it, and <em>raw</em>, the plain mean of its samples.</p>\n";

const ERRORS: &str = "\
Error against time. Bars: 95 % interval of the mean over runs. Dashed black: law fitted to the last decade of samples, on \
top of the reference's noise; its slope is in the legend, the expected one in parentheses. Grey: the reference's own \
noise, below which nothing can be measured.";

const PARTS: &str = "\
The same error in its two parts. Variance (line) is what differs from run to run and falls with time; bias² (dashed) is \
what all runs have in common, the reference's noise taken off; where it is not above 0 beyond chance, only the upper end of its \
interval is marked. Bars: 95 % intervals, bootstrapped over runs.";

const DIFFERENCES: &str = "\
The first run of each method. Differences: black is right, white is off by a quarter of the reference or more.";

#[cfg(test)]
mod tests {
    use super::escaped;

    #[test]
    fn names_cannot_break_the_page() {
        assert_eq!(escaped("<a b=\"&\">"), "&lt;a b=&quot;&amp;&quot;&gt;");
    }
}
