//! Text files from the wild: their encoding, their lines, their numbers.

use std::borrow::Cow;
use std::fmt::Write;
use std::str::SplitAsciiWhitespace;

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
        self.text.get(keyword.len()..).unwrap_or_default().trim_ascii()
    }

    /// The words behind the first, up to a comment (`# red` or `// red`).
    pub fn arguments(&self) -> impl Iterator<Item = &str> {
        let words: SplitAsciiWhitespace = self.text.split_ascii_whitespace();
        words.skip(1).take_while(|word| !word.starts_with('#') && !word.starts_with("//"))
    }
}

/// Text of any encoding, with or without a mark.
///
/// UTF-16 is known by its mark or its zeros. A line that is no UTF-8 is read as Latin-1, so that names in whatever old
/// encoding (GBK, Shift-JIS, …) stay apart, byte for byte, and `caf\xe9` is `café`.
pub(super) fn decode(bytes: &[u8]) -> Cow<'_, str> {
    if let Some(text) = decode_utf16(bytes) {
        return Cow::Owned(text);
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let only_returns = bytes.contains(&b'\r') && !bytes.contains(&b'\n');
    match std::str::from_utf8(bytes) {
        // The ends of lines of old Macintoshes.
        Ok(text) if only_returns => Cow::Owned(text.replace('\r', "\n")),
        Ok(text) => Cow::Borrowed(text),
        Err(_) => {
            let end = if only_returns { b'\r' } else { b'\n' };
            let lines: Vec<_> = bytes.split(|&byte| byte == end).map(decode_name).collect();
            Cow::Owned(lines.join("\n"))
        }
    }
}

/// A name or line that may be in an old encoding: different bytes stay different.
pub(super) fn decode_name(bytes: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(bytes.iter().map(|&byte| char::from(byte)).collect()),
    }
}

fn decode_utf16(bytes: &[u8]) -> Option<String> {
    let little = match bytes {
        [0xff, 0xfe, ..] => true,
        [0xfe, 0xff, ..] => false,
        [first, 0, second, 0, ..] if *first != 0 && *second != 0 => true,
        [0, first, 0, second, ..] if *first != 0 && *second != 0 => false,
        _ => return None,
    };
    let unit = |pair: &[u8]| if little { [pair[0], pair[1]] } else { [pair[1], pair[0]] };
    let units = bytes.chunks_exact(2).map(|pair| u16::from_le_bytes(unit(pair)));
    let text: String = char::decode_utf16(units).map(|unit| unit.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
    Some(text.trim_start_matches('\u{feff}').to_owned())
}

/// Statements that are neither empty nor comments. `\` at the end continues on the next line.
///
/// `#` starts a comment only at the beginning: names such as `Material #25` are common.
pub(super) fn lines(text: &str) -> impl Iterator<Item = Line<'_>> {
    lines_from(text, 1)
}

/// The same of a text whose first line has this number.
pub(super) fn lines_from(text: &str, first: u32) -> impl Iterator<Item = Line<'_>> {
    let mut rest = text.lines().zip(first..);
    std::iter::from_fn(move || {
        let (line, number) = rest.next()?;
        let mut text = Cow::Borrowed(line.trim_ascii());
        while is_continued(&text) {
            let joined = text.to_mut();
            joined.pop();
            joined.push(' ');
            joined.push_str(rest.next().map_or("", |(next, _)| next.trim_ascii()));
        }
        Some(Line { text, number })
    })
    .filter(|line| !line.text.is_empty() && !line.text.starts_with('#'))
}

/// In GBK, Big5 and Shift-JIS, `\` may be the second half of a letter.
fn is_continued(line: &str) -> bool {
    let before = line.strip_suffix('\\').filter(|_| !line.starts_with('#'));
    before.is_some_and(|before| before.chars().next_back().is_none_or(|letter| letter.is_ascii()))
}

/// A finite number, perhaps with the decimal comma of many countries; `None` for `nan`, `1e999`, and the ways in which
/// Windows writes what is no number (`-1.#IND`, `1.#QNAN`, `-nan(ind)`, `1.#INF`).
pub(super) fn finite(word: &str) -> Option<f64> {
    let with_comma = || word.split_once(',').and_then(|(whole, rest)| format!("{whole}.{rest}").parse().ok());
    word.parse().ok().or_else(with_comma).filter(|value: &f64| value.is_finite())
}

/// For messages: a word of a broken file may be a megabyte long, or hold what a terminal obeys.
pub(super) fn shorten(word: &str) -> String {
    let mut short = String::new();
    for letter in word.chars().take(SHORT) {
        if letter.is_control() {
            write!(short, "{}", letter.escape_default()).expect("writing to a string cannot fail");
        } else {
            short.push(letter);
        }
    }
    if word.chars().nth(SHORT).is_some() {
        short.push('…');
    }
    short
}

/// Letters of a word in a message.
const SHORT: usize = 40;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_of_every_encoding_is_read_and_names_stay_apart() {
        let utf16 = |little: bool, mark: bool| -> Vec<u8> {
            let text = if mark { "\u{feff}o é\n" } else { "o é\n" };
            text.encode_utf16().flat_map(|unit| if little { unit.to_le_bytes() } else { unit.to_be_bytes() }).collect()
        };
        for (little, mark) in [(true, true), (false, true), (true, false), (false, false)] {
            assert_eq!(decode(&utf16(little, mark)), "o é\n", "{little} {mark}");
        }
        assert_eq!(decode(b"\xef\xbb\xbfo a\n"), "o a\n");
        assert_eq!(decode(b"o caf\xe9\no \xc3\xa9\n"), "o café\no é\n");
        assert_eq!(decode(b"v 1 2 3\ro a\r"), "v 1 2 3\no a\n");
        let [red, blue] = [b"newmtl \xba\xec\xc7\xbd".as_slice(), b"newmtl \xc0\xb6\xc7\xbd"].map(decode);
        assert_ne!(red, blue);
    }

    #[test]
    fn lines_go_on_behind_a_backslash_unless_it_is_half_a_letter() {
        let read = |bytes: &[u8]| {
            let text = decode(bytes).into_owned();
            lines(&text).map(|line| (line.text.into_owned(), line.number)).collect::<Vec<_>>()
        };
        assert_eq!(read(b"f 1 2 \\\n 3\n# no \\\no a"), [("f 1 2  3".into(), 1), ("o a".into(), 4)]);
        assert_eq!(read(b"o \x95\x5c\nf 1").len(), 2);
    }

    #[test]
    fn comments_end_the_arguments() {
        let arguments = |text: &'static str| {
            Line { text: text.into(), number: 1 }.arguments().map(str::to_owned).collect::<Vec<_>>()
        };
        assert_eq!(arguments("Kd 1 0 # red"), ["1", "0"]);
        assert_eq!(arguments("Ns 10 // x"), ["10"]);
        assert_eq!(arguments("f 1//2 3//4"), ["1//2", "3//4"]);
    }

    #[test]
    fn what_is_no_finite_number_is_none() {
        for word in ["-1.#IND", "1.#QNAN", "-nan(ind)", "1.#INF", "nan", "inf", "-inf", "1e999", "", "red", "-"] {
            assert_eq!(finite(word), None, "{word}");
        }
        assert_eq!([finite("1."), finite("+.5"), finite("-1e-3")], [Some(1.0), Some(0.5), Some(-0.001)]);
        assert_eq!([finite("1,25"), finite("1,2,3"), finite("1.2,3"), finite(",")], [Some(1.25), None, None, None]);
    }
}
