//! What leaving out saves, scene by scene, as a part of the report. Beside the races and not in them: on one thread, at
//! a size of its own.

use std::fmt::Write;

use frame::Filter;
use protocol::question::Quality;
use scenes::Scene;

use super::page::{escaped, table};
use super::progress::Progress;
use super::tables::Table;
use runtime::failure::Failure;
use runtime::interrupt::Interrupt;
use runtime::pruning::{Burden, RaceSettings, Row, measure, measure_burden, measure_plain_room};

/// All that was measured so far.
#[derive(Default)]
pub struct LeftOut {
    /// One a scene, the plain room first.
    rows: Vec<Row>,
    /// Nothing if it was interrupted.
    burden: Option<Burden>,
}

/// Runs of the report's progress that the rooms count for.
pub const ROOMS: usize = 2;

impl LeftOut {
    /// The rooms that are built here: the one that needs least, and what its file may hold beside.
    ///
    /// # Errors
    /// If no worker can be started.
    pub fn of_rooms(interrupt: &Interrupt, progress: &mut Progress) -> Result<Self, Failure> {
        progress.scene("a plain room");
        let mut left_out = Self::default();
        let plain = measure_plain_room(SIZE, &settings(), interrupt, &mut |share| progress.running(WHAT, share))?;
        left_out.rows.extend(plain);
        progress.reached(progress.done() + 1);
        if !interrupt.asked() {
            left_out.burden = measure_burden(SIZE, &settings(), interrupt, &mut |share| progress.running(WHAT, share))?;
        }
        progress.reached(progress.done() + 1);
        Ok(left_out)
    }

    /// One more scene.
    ///
    /// # Errors
    /// If no worker can be started.
    pub fn add(
        &mut self,
        name: &str,
        scene: &Scene,
        interrupt: &Interrupt,
        progress: &mut Progress,
    ) -> Result<(), Failure> {
        if !interrupt.asked() {
            let mut scene = scene.clone();
            [scene.camera.width, scene.camera.height] = SIZE;
            let say = &mut |share| progress.running(WHAT, share);
            self.rows.extend(measure(name.to_string(), scene, &settings(), interrupt, say)?);
        }
        progress.reached(progress.done() + 1);
        Ok(())
    }

    /// What is not as promised: pictures that depend on what was left out.
    pub fn broken(&self) -> Option<String> {
        let row = self.rows.iter().find(|row| !row.same_bits);
        let burden = self.burden.as_ref().is_some_and(|burden| !burden.same_bits);
        match row {
            Some(row) => Some(format!("{}: the pruned pipeline draws another picture than the whole one", row.name)),
            None => burden.then(|| "what nobody sees in a file changes the picture".to_string()),
        }
    }

    /// The chapter of the page; nothing if nothing was measured.
    pub fn page(&self) -> String {
        if self.rows.is_empty() {
            return String::new();
        }
        let mut html = format!("<h2 id=\"left-out\">What is left out, and what that saves</h2>\n{INTRODUCTION}");
        html += &table("Whole and pruned pipeline", &self.table());
        if let Some(burden) = &self.burden {
            let _ = writeln!(
                html,
                "<p>The plain room out of a file that also holds glass, mirrors, gloss, textures, holes, lamps, a moving object, \
                 lights and an environment, all hidden, unused or black, takes {} times as long, for {}.</p>",
                burden.ratio,
                if burden.same_bits { "the same bits" } else { "ANOTHER PICTURE" }
            );
        }
        for row in &self.rows {
            let _ = writeln!(
                html,
                "<p class=\"faint\">{} does without: {}.</p>",
                escaped(&row.name),
                escaped(&row.left_out.join(", "))
            );
        }
        html
    }

    fn table(&self) -> Table {
        let heading = [
            "scene",
            "parts left out",
            "CPU ms a frame, all kept",
            "pruned",
            "ratio (least–greatest)",
            "M rays, all kept",
            "pruned",
            "answer bytes/pixel, all kept",
            "pruned",
            "film bytes/pixel, all kept",
            "pruned",
            "worker MB, all kept",
            "pruned",
            "same bits",
        ];
        let row = |row: &Row| {
            let mut words = vec![row.name.clone(), row.left_out.len().to_string()];
            let both = |say: &dyn Fn(&runtime::pruning::Figures) -> String| row.sides.each_ref().map(say);
            words.extend(both(&|side| format!("{:.1}", side.cpu_ms_per_frame)));
            words.push(row.ratio.to_string());
            words.extend(both(&|side| format!("{:.2}", side.rays_m())));
            words.extend(both(&|side| format!("{:.2}", side.packed_bytes_per_pixel)));
            words.extend(both(&|side| side.film_bytes_per_pixel.to_string()));
            words.extend(both(&|side| format!("{:.3}", side.worker_mb())));
            words.push(if row.same_bits { "yes" } else { "NO" }.to_string());
            words
        };
        std::iter::once(heading.map(String::from).to_vec()).chain(self.rows.iter().map(row)).collect()
    }

    /// The same for programs.
    pub fn csv(&self) -> String {
        let mut text = CSV_HEADING.to_string();
        for row in &self.rows {
            let [all, pruned] = &row.sides;
            let _ = writeln!(
                text,
                "{},{},{},{},{},{},{},{},{},{},{},{},{},{}",
                super::csv::quoted(&row.name),
                row.left_out.len(),
                all.cpu_ms_per_frame,
                pruned.cpu_ms_per_frame,
                row.ratio.median,
                row.ratio.least,
                row.ratio.greatest,
                all.packed_bytes_per_pixel,
                pruned.packed_bytes_per_pixel,
                all.film_bytes_per_pixel,
                pruned.film_bytes_per_pixel,
                all.worker_bytes,
                pruned.worker_bytes,
                row.same_bits,
            );
        }
        text
    }
}

/// The default settings: what people use.
fn settings() -> RaceSettings {
    let quality = Quality::default();
    RaceSettings { frames: FRAMES, quality, filter: Filter::plane(quality.interleave) }
}

const WHAT: &str = "what leaving out saves";
/// Small: a ratio needs many turns rather than many pixels.
const SIZE: [u32; 2] = [120, 90];
/// Of each turn.
const FRAMES: u32 = 3;

const CSV_HEADING: &str = "scene,parts_left_out,cpu_ms_per_frame_all_kept,cpu_ms_per_frame_pruned,ratio,ratio_least,\
ratio_greatest,packed_bytes_per_pixel_all_kept,packed_bytes_per_pixel_pruned,film_bytes_per_pixel_all_kept,\
film_bytes_per_pixel_pruned,worker_bytes_all_kept,worker_bytes_pruned,same_bits\n";

const INTRODUCTION: &str = "\
<p>Stages, fields and kernels that a scene has no work for are left out; no bit of the picture depends on it. Here every \
scene is drawn both ways in turn, with the default settings, at 120×90 pixels on one thread: seven turns of three frames \
each, medians of processor time. <code>igi-master plan SCENE</code> says of each part why it is there or not, and what \
that saves.</p>\n";
