//! Where the files are that other files name: files move, and names were written on other machines.

use std::collections::{BTreeMap, HashMap};
use std::ffi::OsString;
use std::path::{Component, Path, PathBuf};

use encoding_rs::Encoding;

use super::text;

/// Folders beside a model where its pictures mostly are.
const USUAL: [&str; 10] =
    ["textures", "texture", "tex", "maps", "map", "images", "image", "img", "materials", "pictures"];

/// So many folders above a file are looked for in other places, with it.
const PARENTS_MAX: usize = 3;

/// So many folders' lists are remembered.
const LISTINGS_MAX: usize = 1024;

/// Finds files, and remembers what folders hold.
#[derive(Debug, Default)]
pub(super) struct Finder {
    listings: HashMap<PathBuf, Listing>,
}

/// Names by their lower-case form; sorted.
type Listing = BTreeMap<String, Vec<OsString>>;

/// See [`Finder::find`].
pub(super) fn find(folders: &[&Path], name: &str) -> Option<PathBuf> {
    Finder::default().find(folders, name)
}

impl Finder {
    /// The file that a name means, seen from one of several folders: as written; with `\` for `/` and in another case;
    /// with the last folders of its path alone, since the others may be another machine's; in one of the usual folders
    /// beside. What an earlier folder holds goes before what a later one does.
    ///
    /// A name in an old encoding may be that of a file whose name was put into another one, as archives do: the
    /// encoding in which there is such a file is the right one. Some programs write addresses for names:
    /// `file:///C:/my%20tex.png`.
    pub fn find(&mut self, folders: &[&Path], name: &str) -> Option<PathBuf> {
        let found = self.find_as_written(folders, name);
        let found = found.or_else(|| re_read(name).find_map(|name| self.find_as_written(folders, &name)));
        found.or_else(|| self.find_as_written(folders, &percent_decode(name.trim_start_matches("file://"))))
    }

    fn find_as_written(&mut self, folders: &[&Path], name: &str) -> Option<PathBuf> {
        let slashed = name.replace('\\', "/");
        let exact = |name: &str| folders.iter().map(|folder| folder.join(name)).find(|path| path.is_file());
        if let Some(path) = exact(name).or_else(|| exact(&slashed)) {
            return Some(path);
        }
        let parts: Vec<&str> = slashed.split('/').filter(|part| !part.is_empty()).collect();
        let last = parts.last()?;
        let from = parts.len().saturating_sub(1 + PARENTS_MAX);
        let ends = (from..parts.len()).map(|first| parts[first..].join("/"));
        let beside = USUAL.iter().map(|folder| format!("{folder}/{last}"));
        let above = USUAL.iter().map(|folder| format!("../{folder}/{last}"));
        let tries: Vec<String> = std::iter::once(slashed.clone()).chain(ends).chain(beside).chain(above).collect();
        tries.iter().find_map(|name| folders.iter().find_map(|folder| self.in_any_case(folder, Path::new(name))))
    }

    fn in_any_case(&mut self, folder: &Path, name: &Path) -> Option<PathBuf> {
        let mut path = folder.to_owned();
        for part in name.components() {
            let Component::Normal(part) = part else {
                path.push(part);
                continue;
            };
            let alike = self.listing(&path).get(&folded(part))?;
            let entry = alike.iter().find(|entry| *entry == part).or(alike.first())?.clone();
            path.push(entry);
        }
        path.is_file().then_some(path)
    }

    fn listing(&mut self, folder: &Path) -> &Listing {
        if self.listings.len() >= LISTINGS_MAX && !self.listings.contains_key(folder) {
            self.listings.clear();
        }
        self.listings.entry(folder.to_owned()).or_insert_with(|| {
            let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
            let entries = std::fs::read_dir(folder).into_iter().flatten();
            let mut names: Vec<OsString> = entries.filter_map(|entry| Some(entry.ok()?.file_name())).collect();
            names.sort();
            let mut listing = Listing::new();
            for name in names {
                listing.entry(folded(&name)).or_default().push(name);
            }
            listing
        })
    }
}

/// `%20` to a blank, and its like; what is no escape stays.
pub(super) fn percent_decode(uri: &str) -> String {
    let bytes = uri.as_bytes();
    let (mut decoded, mut i) = (Vec::with_capacity(bytes.len()), 0);
    while i < bytes.len() {
        let escape = (bytes[i] == b'%').then(|| uri.get(i + 1..i + 3)).flatten();
        match escape.and_then(|digits| u8::from_str_radix(digits, 16).ok()) {
            Some(byte) => (decoded.push(byte), i += 3),
            None => (decoded.push(bytes[i]), i += 1),
        };
    }
    String::from_utf8_lossy(&decoded).into_owned()
}

/// Encodings of the programs that write model files.
const OLD: [&Encoding; 7] = [
    encoding_rs::GBK,
    encoding_rs::SHIFT_JIS,
    encoding_rs::EUC_KR,
    encoding_rs::BIG5,
    encoding_rs::WINDOWS_1251,
    encoding_rs::WINDOWS_1250,
    encoding_rs::WINDOWS_1252,
];

/// A name whose bytes were no UTF-8, and were read as Latin-1 ([`text::decode`]), in other encodings.
fn re_read(name: &str) -> impl Iterator<Item = String> {
    let bytes: Option<Vec<u8>> = name.chars().map(|letter| u8::try_from(letter).ok()).collect();
    let bytes = bytes.filter(|bytes| !bytes.is_ascii()).unwrap_or_default();
    let decoded = move |encoding: &&'static Encoding| {
        encoding.decode_without_bom_handling_and_without_replacement(&bytes).map(|name| name.into_owned())
    };
    OLD.iter().filter_map(decoded).filter(|name| !name.is_empty())
}

/// In lower case; names in old encodings as [`text::decode`] reads them.
fn folded(name: &std::ffi::OsStr) -> String {
    text::decode_name(name.as_encoded_bytes()).to_lowercase()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_found_where_they_went() {
        let folder = tempfile::tempdir().unwrap();
        let (obj, mtl) = (folder.path().join("model"), folder.path().join("model/mats"));
        for file in [
            "model/Images/K.png",
            "model/mats/c.png",
            "model/c.png",
            "model/é.png",
            "Maps/up.png",
            "model/proj/a/z.png",
            "model/my tex.png",
        ] {
            let path = folder.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        for (name, expected) in [
            ("c.png", "model/mats/c.png"),
            ("C.PNG", "model/mats/c.png"),
            ("../c.png", "model/mats/../c.png"),
            (r"C:\proj\images\k.png", "model/Images/K.png"),
            ("/home/me/proj/images/k.png", "model/Images/K.png"),
            ("k.png", "model/Images/K.png"),
            ("up.png", "model/../Maps/up.png"),
            ("/x/y/proj/a/z.png", "model/proj/a/z.png"),
            ("É.png", "model/é.png"),
            ("file:///C:/proj/my%20tex.png", "model/my tex.png"),
        ] {
            let found = find(&[&mtl, &obj], name);
            assert_eq!(found, Some(folder.path().join(expected)), "{name}");
        }
        for name in ["", "/", "gone.png", "mats", "..", "a/../../.."] {
            assert_eq!(find(&[&mtl, &obj], name), None, "{name}");
        }
    }

    #[test]
    fn names_in_old_encodings_are_found_under_their_new_ones() {
        let folder = tempfile::tempdir().unwrap();
        for (bytes, file) in [
            (&b"\xba\xec\xc7\xbd.png"[..], "红墙.png"),
            (b"\x95\xc7.png", "壁.png"),
            (b"\xf1\xf2\xe5\xed\xe0.png", "стена.png"),
            (b"tex\\caf\xe9.png", "café.png"),
        ] {
            std::fs::write(folder.path().join(file), "").unwrap();
            let written = text::decode(bytes).into_owned();
            assert_eq!(find(&[folder.path()], &written), Some(folder.path().join(file)), "{file}");
            std::fs::remove_file(folder.path().join(file)).unwrap();
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn names_in_old_encodings_are_found() {
        use std::os::unix::ffi::OsStrExt;
        let folder = tempfile::tempdir().unwrap();
        let name = std::ffi::OsStr::from_bytes(b"caf\xe9.png");
        std::fs::write(folder.path().join(name), "").unwrap();
        let written = text::decode(b"caf\xe9.png").into_owned();
        assert_eq!(find(&[folder.path()], &written), Some(folder.path().join(name)));
    }

    #[test]
    fn escapes_are_decoded_and_all_else_is_left_alone() {
        assert_eq!(percent_decode("my%20tex%C3%A9.png"), "my texé.png");
        assert_eq!(percent_decode("100%.png"), "100%.png");
        assert_eq!(percent_decode("%é%2"), "%é%2");
        assert_eq!(percent_decode("%ff"), "\u{fffd}");
    }
}
