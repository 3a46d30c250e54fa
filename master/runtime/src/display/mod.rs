//! What goes between the loop and viewers: messages both ways, the hub that passes them on, and pictures for screens and
//! files.

pub mod encoded;
pub mod hub;
pub mod hues;
mod letters;
pub mod message;
pub mod paint;
pub mod saved;
pub mod thread;

/// A number in a few digits, for people.
pub fn short_number(value: f32) -> String {
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
