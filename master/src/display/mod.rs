//! What goes between the loop and those who watch: their words and what they are told, the hub where both meet, and
//! pictures developed for screens and files.

pub mod develop;
pub mod hub;
pub mod hues;
mod letters;
pub mod paint;
pub mod saved;
pub mod words;

/// A number in a few digits, for people.
fn short_number(value: f32) -> String {
    match value.abs() {
        size if (99.5..1e6).contains(&size) => format!("{value:.0}"),
        0.0 => "0".into(),
        size if (0.01..1e6).contains(&size) => {
            let digits = (2 - size.log10().floor() as i32).clamp(0, 4);
            format!("{value:.*}", digits as usize)
        }
        _ => format!("{value:.1e}"),
    }
}
