//! Texture names as MTL files write them: options first, then a file name that may hold blanks.

use glam::Vec2;

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
}

/// Splits `-s 2 2 1 my tex.png` into its options and `my tex.png`.
pub(super) fn parse(text: &str, line: u32) -> Result<TextureName, String> {
    let mut name =
        TextureName { file: String::new(), line, scale: Vec2::ONE, offset: Vec2::ZERO, clamp: false, channel: None };
    let mut rest = text;
    while let Some((option, after)) = first_word(rest).filter(|(word, _)| word.starts_with('-')) {
        let Some(kind) = Arguments::of(option) else { break };
        rest = name.option(option, kind, after);
    }
    name.file = rest.trim().trim_matches('"').to_owned();
    if name.file.is_empty() {
        return Err("a file name is missing behind the texture's keyword".into());
    }
    Ok(name)
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
    /// Takes an option's arguments; returns what follows them.
    fn option<'a>(&mut self, option: &str, arguments: Arguments, mut rest: &'a str) -> &'a str {
        match arguments {
            Arguments::Words(count) => {
                for _ in 0..count {
                    let Some((word, after)) = first_word(rest) else { break };
                    match (option, word) {
                        ("-clamp", word) => self.clamp = word == "on",
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
                    let Some(value) = word.parse().ok().filter(|value: &f32| value.is_finite()) else { break };
                    // The last word is the file, even if its name is a number.
                    if after.trim().is_empty() {
                        break;
                    }
                    values.push(value);
                    rest = after;
                }
                let default = if option == "-s" { 1.0 } else { 0.0 };
                let uv = Vec2::new(*values.first().unwrap_or(&default), *values.get(1).unwrap_or(&default));
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

fn first_word(text: &str) -> Option<(&str, &str)> {
    let text = text.trim_start();
    let end = text.find(char::is_whitespace).unwrap_or(text.len());
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
        assert_eq!(parse("-imfchan g x.png", 1).unwrap().channel, Some(1));
    }

    #[test]
    fn a_texture_without_a_name_is_refused() {
        for text in ["", "  ", "-s", "-clamp on", "-type"] {
            assert!(parse(text, 1).is_err(), "{text:?}");
        }
    }
}
