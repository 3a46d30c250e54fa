//! What was measured, as a table for people and programs.

use std::fmt::Write;

use frame::measure::{Figures, Measured};
use serde_json::{Value, json};

use super::Sheet;
use super::drawing::left_out;

/// Every point: cell, place in the scene's file, illuminance and its error; the figures of all before them, as comments.
pub(super) fn csv(sheet: &Sheet) -> String {
    let mut text = String::new();
    let Sheet { plan, values, figures, .. } = sheet;
    let _ = writeln!(text, "# illuminance, {}; {}", sheet.title, sheet.method);
    for (name, figure, unit) in named(figures) {
        let _ = writeln!(text, "# {name}: {} ± {}{unit}", figure.value, figure.within);
    }
    if let Some(said) = left_out(sheet) {
        let _ = writeln!(text, "# left out: {said}");
    }
    text += "column,row,x_m,y_m,illuminance_lx,within_lx\n";
    for (number, value) in values.iter().enumerate() {
        let Some(Measured { value, within }) = value else { continue };
        let [column, row] = plan.grid.cell(number);
        let [x, y] = plan.grid.middle(number).map(|at| at * plan.metre);
        let _ = writeln!(text, "{column},{row},{x:.4},{y:.4},{value},{within}");
    }
    text
}

/// For programs.
pub(super) fn json(sheet: &Sheet) -> Value {
    let figures = named(&sheet.figures);
    let figures = figures
        .into_iter()
        .map(|(name, figure, _)| (name.to_owned(), json!({ "value": figure.value, "within": figure.within })));
    json!({
        "title": sheet.title,
        "points": sheet.values.iter().flatten().count(),
        "buried": sheet.plan.buried,
        "counts": sheet.plan.grid.counts,
        "spacing_m": sheet.plan.grid.spacing().map(|side| side * sheet.plan.metre),
        "figures": figures.collect::<serde_json::Map<_, _>>(),
    })
}

/// All figures with names and units.
pub(super) fn named(figures: &Figures) -> [(&'static str, Measured, &'static str); 5] {
    let Figures { min, average, max, uniformity, diversity } = *figures;
    [
        ("Emin", min, " lx"),
        ("Eavg", average, " lx"),
        ("Emax", max, " lx"),
        ("Uo = Emin/Eavg", uniformity, ""),
        ("Ud = Emin/Emax", diversity, ""),
    ]
}
