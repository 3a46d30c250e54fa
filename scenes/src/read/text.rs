//! Lines of text files from the wild, each with its number.

use std::borrow::Cow;

/// A statement, which may have been continued over several lines of the file.
#[derive(Debug)]
pub(super) struct Line<'a> {
    /// Without surrounding blanks.
    pub text: Cow<'a, str>,
    /// Of its first line, counted from 1.
    pub number: u32,
}

impl Line<'_> {
    /// What follows the first word.
    pub fn rest_after(&self, keyword: &str) -> &str {
        self.text.get(keyword.len()..).unwrap_or_default().trim()
    }
}

/// UTF-8, with or without mark; bytes that are none (old files are in Latin-1) become `\u{fffd}`.
pub(super) fn decode(bytes: &[u8]) -> Cow<'_, str> {
    String::from_utf8_lossy(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes))
}

/// Statements that are neither empty nor comments. `\` at the end continues on the next line.
///
/// `#` starts a comment only at the beginning: names such as `Material #25` are common.
pub(super) fn lines(text: &str) -> impl Iterator<Item = Line<'_>> {
    let mut rest = text.lines().zip(1u32..);
    std::iter::from_fn(move || {
        let (line, number) = rest.next()?;
        let mut text = Cow::Borrowed(line.trim());
        while text.ends_with('\\') && !text.starts_with('#') {
            let joined = text.to_mut();
            joined.pop();
            joined.push(' ');
            joined.push_str(rest.next().map_or("", |(next, _)| next.trim()));
        }
        Some(Line { text, number })
    })
    .filter(|line| !line.text.is_empty() && !line.text.starts_with('#'))
}

/// For messages: a word of a broken file may be a megabyte long.
pub(super) fn shorten(word: &str) -> String {
    let mut short: String = word.chars().take(40).collect();
    if short.len() < word.len() {
        short.push('…');
    }
    short
}
