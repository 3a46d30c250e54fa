//! Texture names as MTL files write them: options first, then a file name that may hold blanks.

use glam::Vec2;

use super::text;

/// A texture and how it lies on the surface.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TextureName {
    /// As written, without options.
    pub file: String,
    /// Line of the MTL file.
    pub line: u32,
    /// `-s` and `-o`: texture coordinates are multiplied by the one, then the other is added.
    pub scale: Vec2,
    pub offset: Vec2,
    /// `-clamp on`.
    pub clamp: bool,
    /// `-imfchan`: the channel that a mask or number is read from, 0 … 3, if it is told.
    pub channel: Option<u8>,
    /// `-bm`: factor on a relief.
    pub bump: f32,
    /// Options that would change what is seen, and are not heeded.
    pub unheeded: Vec<&'static str>,
}

/// Splits `-s 2 2 1 my tex.png` into its options and `my tex.png`; `None` if no name is left.
///
/// Options that nobody knows (`-colorspace sRGB`) take one word. Some exporters write options behind the name.
pub(super) fn parse(text: &str, line: u32) -> Option<TextureName> {
    let (scale, offset) = (Vec2::ONE, Vec2::ZERO);
    let mut name = TextureName {
        file: String::new(),
        line,
        scale,
        offset,
        clamp: false,
        channel: None,
        bump: 1.0,
        unheeded: Vec::new(),
    };
    let mut rest = text.trim_ascii();
    while let Some((option, after)) = first_word(rest).filter(|(word, _)| is_option(word)) {
        let kind = match Arguments::of(option) {
            Some(kind) => kind,
            // `-odd name.png` may be a name.
            None if first_word(after).is_some_and(|(_, behind)| first_word(behind).is_some()) => Arguments::Words(1),
            None => break,
        };
        rest = name.option(option, kind, after);
    }
    let (file, mut options) = split_behind(rest.trim_ascii());
    name.file = file.trim_matches('"').to_owned();
    while let Some((option, after)) = first_word(options) {
        options = Arguments::of(option).map_or(after, |kind| name.option(option, kind, after));
    }
    (!name.file.is_empty()).then_some(name)
}

/// `-s`, but not `-1`.
fn is_option(word: &str) -> bool {
    word.strip_prefix('-').is_some_and(|rest| rest.starts_with(|letter: char| letter.is_ascii_alphabetic()))
}

/// The file name, and known options behind it: they start at the first ` -option` behind a word with a dot.
fn split_behind(text: &str) -> (&str, &str) {
    let starts = text.match_indices(" -").map(|(at, _)| at);
    let mut known = starts.filter(|&at| first_word(&text[at..]).is_some_and(|(word, _)| Arguments::of(word).is_some()));
    match known.find(|&at| text[..at].contains('.')) {
        Some(at) => (text[..at].trim_ascii_end(), &text[at..]),
        None => (text, ""),
    }
}

/// What follows an option.
#[derive(Clone, Copy)]
enum Arguments {
    Words(usize),
    /// One to three numbers.
    Numbers,
}

impl Arguments {
    fn of(option: &str) -> Option<Self> {
        Some(match option {
            "-s" | "-o" | "-t" => Self::Numbers,
            "-mm" => Self::Words(2),
            "-bm" | "-boost" | "-blendu" | "-blendv" | "-cc" | "-clamp" | "-imfchan" | "-texres" | "-type" => {
                Self::Words(1)
            }
            _ => return None,
        })
    }
}

impl TextureName {
    /// What the file may be called, likeliest first: as written; without what may be a comment; the last word of what
    /// begins like an option.
    pub fn names(&self) -> impl Iterator<Item = &str> + Clone {
        let without_comment = self.file.split_once(" #").map(|(name, _)| name.trim_ascii_end());
        let last = self.file.rsplit_once(' ').filter(|_| self.file.starts_with('-')).map(|(_, name)| name);
        std::iter::once(self.file.as_str()).chain(without_comment).chain(last)
    }

    /// Remembers an option whose arguments would change the texture's values.
    fn mention(&mut self, option: &str, arguments: &str) {
        let mut words = arguments.split_ascii_whitespace();
        let (first, second) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
        let is = |word: &str, value: f32| number(word) == Some(value);
        let unheeded = match option {
            "-mm" if !(is(first, 0.0) && is(second, 1.0)) => "-mm",
            "-boost" if !is(first, 0.0) => "-boost",
            "-cc" if first == "on" => "-cc",
            "-imfchan" if matches!(first, "l" | "z") => "-imfchan",
            _ => return,
        };
        self.unheeded.push(unheeded);
    }

    /// Takes an option's arguments; returns what follows them.
    fn option<'a>(&mut self, option: &str, arguments: Arguments, mut rest: &'a str) -> &'a str {
        match arguments {
            Arguments::Words(count) => {
                self.mention(option, rest);
                for _ in 0..count {
                    let Some((word, after)) = first_word(rest) else { break };
                    match (option, word) {
                        ("-clamp", word) => self.clamp = word == "on",
                        ("-bm", word) => self.bump = number(word).filter(|bump| bump.is_finite()).unwrap_or(1.0),
                        ("-imfchan", "r") => self.channel = Some(0),
                        ("-imfchan", "g") => self.channel = Some(1),
                        ("-imfchan", "b") => self.channel = Some(2),
                        ("-imfchan", "m") => self.channel = Some(3),
                        _ => {}
                    }
                    rest = after;
                }
            }
            Arguments::Numbers => {
                let mut values = Vec::new();
                while let Some((word, after)) = first_word(rest).filter(|_| values.len() < 3) {
                    let Some(value) = number(word) else { break };
                    // Before the name, the last word is the file, even if its name is a number, unless it is a third one.
                    if after.trim_ascii().is_empty() && self.file.is_empty() && values.len() < 2 {
                        break;
                    }
                    values.push(value);
                    rest = after;
                }
                let default = if option == "-s" { 1.0 } else { 0.0 };
                let value = |i: usize| values.get(i).copied().filter(|value| value.is_finite()).unwrap_or(default);
                let uv = Vec2::new(value(0), value(1));
                match option {
                    "-s" => self.scale = uv,
                    "-o" => self.offset = uv,
                    _ => {}
                }
            }
        }
        rest
    }
}

/// A number, or what was meant to be one.
fn number(word: &str) -> Option<f32> {
    let is_none = || word.contains(".#") || word.contains("nan(");
    text::finite(word).map(|value| value as f32).or_else(|| is_none().then_some(f32::NAN))
}

fn first_word(text: &str) -> Option<(&str, &str)> {
    let text = text.trim_ascii_start();
    let end = text.find(|letter: char| letter.is_ascii_whitespace()).unwrap_or(text.len());
    (end > 0).then(|| text.split_at(end))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(text: &str, file: &str, scale: [f32; 2], offset: [f32; 2], clamp: bool) {
        let name = parse(text, 1).unwrap();
        assert_eq!(
            (name.file.as_str(), name.scale.to_array(), name.offset.to_array(), name.clamp),
            (file, scale, offset, clamp)
        );
    }

    #[test]
    fn options_are_told_from_names_with_blanks() {
        check("tex.png", "tex.png", [1.0; 2], [0.0; 2], false);
        check("-s 2 3 1 my tex.png", "my tex.png", [2.0, 3.0], [0.0; 2], false);
        check("-s 2 my tex.png", "my tex.png", [2.0, 1.0], [0.0; 2], false);
        check("-o 0.5 0.25 -clamp on -bm 0.3 a b.jpg", "a b.jpg", [1.0; 2], [0.5, 0.25], true);
        check("-mm 0 1 -s 1 1 1 7", "7", [1.0; 2], [0.0; 2], false);
        check("\"quoted name.png\"", "quoted name.png", [1.0; 2], [0.0; 2], false);
        check("-odd name.png", "-odd name.png", [1.0; 2], [0.0; 2], false);
        check("-colorspace sRGB -s 2 2 1 c.png", "c.png", [2.0; 2], [0.0; 2], false);
        check("c.png -s 2 3 1", "c.png", [2.0, 3.0], [0.0; 2], false);
        check("my c.png -o 0.5 -clamp on", "my c.png", [1.0; 2], [0.5, 0.0], true);
        check("wall -s old.png", "wall -s old.png", [1.0; 2], [0.0; 2], false);
        check("-s 1.#QNAN 1e99 1 c.png", "c.png", [1.0; 2], [0.0; 2], false);
        assert_eq!(parse("-imfchan g x.png", 1).unwrap().channel, Some(1));
        assert_eq!(parse("b.png -bm 0.25", 1).unwrap().bump, 0.25);
        let names = |text: &str| parse(text, 1).unwrap().names().map(str::to_owned).collect::<Vec<_>>();
        assert_eq!(names("c.png # red"), ["c.png # red", "c.png"]);
        assert_eq!(names("-flip c.png"), ["-flip c.png", "c.png"]);
    }

    #[test]
    fn a_texture_without_a_name_is_none() {
        for text in ["", "  ", "-s", "-s 1 1 1", "-clamp on", "-type"] {
            assert_eq!(parse(text, 1), None, "{text:?}");
        }
    }
}
