//! A text cut where lines end, so that many threads can read it at once.

use rayon::prelude::*;

use super::super::text;

/// A stretch has about so many bytes.
pub(super) const BYTES: usize = 4 << 20;

/// A part of a text.
pub(super) struct Stretch<'a> {
    pub text: &'a str,
    /// What stands before it.
    pub before: Counts,
}

/// Numbers of lines and statements.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Counts {
    pub lines: u32,
    pub positions: usize,
    pub normals: usize,
    pub uvs: usize,
    /// `o`.
    pub objects: usize,
}

impl Stretch<'_> {
    fn count(&self) -> Counts {
        let breaks = self.text.bytes().filter(|&byte| byte == b'\n').count();
        let mut counts = Counts { lines: u32::try_from(breaks).unwrap_or(u32::MAX), ..Counts::default() };
        for line in text::lines(self.text) {
            match line.text.split_ascii_whitespace().next() {
                Some("v") => counts.positions += 1,
                Some("vn") => counts.normals += 1,
                Some("vt") => counts.uvs += 1,
                Some("o") => counts.objects += 1,
                _ => {}
            }
        }
        counts
    }
}

/// Stretches of about so many bytes, of whole statements; and what is in all of them.
pub(super) fn cut(text: &str, bytes: usize) -> (Vec<Stretch<'_>>, Counts) {
    let mut stretches = Vec::new();
    let mut rest = text;
    while !rest.is_empty() {
        let (stretch, after) = rest.split_at(end(rest, bytes));
        stretches.push(Stretch { text: stretch, before: Counts::default() });
        rest = after;
    }
    let counts: Vec<Counts> = stretches.par_iter().map(Stretch::count).collect();
    let mut before = Counts::default();
    for (stretch, counts) in stretches.iter_mut().zip(counts) {
        stretch.before = before;
        before.lines = before.lines.saturating_add(counts.lines);
        before.positions += counts.positions;
        before.normals += counts.normals;
        before.uvs += counts.uvs;
        before.objects += counts.objects;
    }
    (stretches, before)
}

/// Behind the first line that ends after so many bytes, and does not go on.
fn end(text: &str, bytes: usize) -> usize {
    let mut at = bytes.min(text.len()).saturating_sub(1);
    while let Some(length) = text.as_bytes()[at..].iter().position(|&byte| byte == b'\n') {
        let line = text.as_bytes()[..at + length].trim_ascii_end();
        at += length + 1;
        if !line.ends_with(b"\\") {
            return at;
        }
    }
    text.len()
}
