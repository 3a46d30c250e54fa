//! Where pictures are saved, and as what.

use std::path::PathBuf;
use std::str::FromStr;

use super::write::try_to_write;

/// A file to write a picture to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Output {
    /// Where.
    pub path: PathBuf,
    /// What.
    pub kind: OutputKind,
}

/// Kinds of picture files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputKind {
    /// 8 bits, tone-mapped.
    Png,
    /// Linear, 32-bit float.
    Exr,
}

impl FromStr for Output {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let path = PathBuf::from(text);
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        let kind = match extension.as_deref() {
            Some("png") => OutputKind::Png,
            Some("exr") => OutputKind::Exr,
            _ => return Err("pictures are saved as .png or .exr".to_string()),
        };
        Ok(Self { path, kind })
    }
}

impl Output {
    /// The file of one picture of a series: its number stands where the name says `%d`, or `%04d` for at least four
    /// digits. `None` if the name has no such place.
    pub fn numbered(&self, number: u32) -> Option<Self> {
        let name = self.path.file_name()?.to_str()?;
        let (before, rest) = name.split_once('%')?;
        let (width, after) = rest.split_once('d')?;
        let width: usize = if width.is_empty() { 0 } else { width.strip_prefix('0')?.parse().ok()? };
        let name = format!("{before}{number:0width$}{after}");
        (width <= DIGITS_MAX).then(|| Self { path: self.path.with_file_name(name), kind: self.kind })
    }

    /// Finds out now, not after the work, whether the file can be written.
    ///
    /// # Errors
    /// Says what is in the way.
    pub fn check(&self) -> anyhow::Result<()> {
        try_to_write(&self.path)
    }
}

/// Digits that a number is padded to at most.
const DIGITS_MAX: usize = 20;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_png_and_exr_are_known() {
        assert_eq!("a/b.PNG".parse::<Output>().unwrap().kind, OutputKind::Png);
        assert_eq!("b.exr".parse::<Output>().unwrap().kind, OutputKind::Exr);
        for wrong in ["b.jpg", "b", "", ".png", "png"] {
            assert!(wrong.parse::<Output>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn pictures_of_a_series_have_their_number_in_their_name() {
        let numbered = |text: &str| Some(text.parse::<Output>().unwrap().numbered(42)?.path.display().to_string());
        for (pattern, name) in [
            ("a/out.%04d.exr", Some("a/out.0042.exr")),
            ("%d.png", Some("42.png")),
            ("x%01dy.png", Some("x42y.png")),
            ("out.exr", None),
            ("%04d/out.exr", None),
            ("out.%4d.exr", None),
            ("out.%0999d.exr", None),
            ("out.%s.exr", None),
        ] {
            assert_eq!(numbered(pattern).as_deref(), name, "{pattern}");
        }
    }
}
