//! The house rules, as tests: who imports whom, no clocks in pure rooms, every file says what it is.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("tests/ lies in the workspace").to_path_buf()
}

/// Folder of sources → our crates that may be imported there.
fn arrows() -> BTreeMap<&'static str, &'static [&'static str]> {
    BTreeMap::from([
        ("scenes", &[][..]),
        ("protocol", &["scenes"][..]),
        ("worker/light", &["scenes", "protocol"][..]),
        ("master/frame", &["scenes", "protocol"][..]),
        ("health", &[][..]),
        ("secrets", &[][..]),
        ("worker", &["scenes", "protocol", "light", "health", "secrets"][..]),
        ("tests/cases", &["scenes", "protocol", "light", "frame"][..]),
        ("master/runtime", &["scenes", "protocol", "frame", "worker", "health", "secrets"][..]),
        ("master", &["scenes", "protocol", "frame", "runtime", "cases", "health", "secrets"][..]),
    ])
}

const OURS: [&str; 10] =
    ["scenes", "protocol", "light", "frame", "health", "secrets", "worker", "runtime", "master", "cases"];

fn sources(folder: &Path) -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("sources can be listed") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let text = fs::read_to_string(&path).expect("sources are text");
                found.push((path, text));
            }
        }
    }
    found.sort();
    found
}

/// The text without comments, so that words in prose do not count.
fn code(text: &str) -> String {
    text.lines().map(|line| line.split("//").next().unwrap_or("")).collect::<Vec<_>>().join("\n")
}

#[test]
fn manifests_and_sources_keep_to_the_arrows() {
    for (room, allowed) in arrows() {
        let manifest = fs::read_to_string(root().join(room).join("Cargo.toml")).expect("every room has a manifest");
        let normal = manifest.split("[dev-dependencies]").next().unwrap_or("");
        for name in OURS {
            let depends = normal.lines().any(|line| line.starts_with(&format!("{name}.workspace")));
            assert!(!depends || allowed.contains(&name), "{room}/Cargo.toml may not depend on {name}");
        }
    }
}

#[test]
fn two_rooms_of_the_master_know_workers() {
    let source = root().join("master/runtime/src");
    let knows: Vec<_> = sources(&source)
        .into_iter()
        .filter(|(_, text)| {
            let code = code(text);
            let boundary = |before: &str| !before.ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':');
            code.match_indices("worker::").any(|(at, _)| boundary(&code[..at]))
        })
        .map(|(path, _)| path.strip_prefix(&source).expect("it lies there").to_path_buf())
        .filter(|path| !path.starts_with("relay"))
        .collect();
    let embedded = [PathBuf::from("cluster/embedded.rs")];
    assert_eq!(
        knows, embedded,
        "the crate `worker` is used where embedded workers start, and where the master is one itself"
    );
}

/// The cases know how light moves, the master does not: where it runs them is one command.
#[test]
fn only_the_selftest_knows_cases() {
    let knows: Vec<_> = sources(&root().join("master/src"))
        .into_iter()
        .filter(|(_, text)| code(text).contains("cases::"))
        .map(|(path, _)| path.strip_prefix(root().join("master/src")).expect("it lies there").to_path_buf())
        .filter(|path| !path.starts_with("command/selftest"))
        .collect();
    let flags = ["cli/parse.rs", "cli/selftest.rs"].map(PathBuf::from);
    assert_eq!(knows, flags, "the crate `cases` is used by the self-test and its flags");
}

/// A module with parts is a folder with a mod.rs, everywhere.
#[test]
fn modules_with_parts_are_folders() {
    for room in ["scenes", "protocol", "health", "secrets", "worker", "master", "tests", "xtask"] {
        for (path, _) in sources(&root().join(room)) {
            let parts = path.with_extension("");
            let has_parts = parts.is_dir() && !sources(&parts).is_empty();
            assert!(
                !has_parts,
                "{} has parts in a folder beside it: move it to {}/mod.rs",
                path.display(),
                parts.display()
            );
        }
    }
}

/// Rooms of the master that need each other, directly or by others, are one room with two names.
#[test]
fn no_circle_of_modules_in_the_master() {
    let source = root().join("master/runtime/src");
    let lib = fs::read_to_string(source.join("lib.rs")).expect("the master has a library");
    let modules: Vec<&str> = lib
        .lines()
        .filter_map(|line| line.trim_start_matches("pub ").strip_prefix("mod ")?.strip_suffix(';'))
        .collect();
    assert!(modules.len() > 10, "{modules:?}");
    let mut uses: BTreeMap<&str, BTreeMap<&str, PathBuf>> = BTreeMap::new();
    for (path, text) in sources(&source) {
        let inside = path.strip_prefix(&source).expect("it lies there");
        let first = inside.iter().next().and_then(|part| part.to_str()).expect("a name");
        let Some(from) = modules.iter().find(|module| **module == first.trim_end_matches(".rs")) else { continue };
        let code = code(&text);
        for rest in code.split("crate::").skip(1) {
            // `crate::name…`, or `crate::{one, other…}`.
            let group = rest.strip_prefix('{').map_or(rest, |list| list.split('}').next().unwrap_or(""));
            let ends: &[_] = if group.len() == rest.len() { &[] } else { &[','] };
            for name in group.split(ends) {
                let is_part = |c: char| c.is_alphanumeric() || c == '_';
                let name = name.trim_start().split(|c| !is_part(c)).next().unwrap_or("");
                if let Some(to) = modules.iter().find(|module| **module == name && *module != from) {
                    uses.entry(from).or_default().insert(to, inside.to_path_buf());
                }
            }
        }
    }
    // What needs nothing that is left can go; what is left then goes round in circles.
    while let Some(free) = uses.iter().find(|(_, needs)| !needs.keys().any(|to| uses.contains_key(to))) {
        let free = *free.0;
        uses.remove(free);
    }
    assert!(uses.is_empty(), "modules that need each other: {uses:#?}");
}

/// Who has run README's first command has both programs that its next sections need.
#[test]
fn the_first_command_of_the_readme_builds_all_programs() {
    let readme = fs::read_to_string(root().join("README.md")).expect("there is a README");
    let block = readme.split("```").nth(1).expect("it has commands");
    let first = block.lines().find(|line| line.starts_with("cargo")).expect("the first of them");
    assert!(first.starts_with("cargo build --release && "), "{first}");
    let manifest = fs::read_to_string(root().join("Cargo.toml")).expect("the workspace has a manifest");
    let built = manifest.lines().find_map(|line| line.strip_prefix("default-members = ")).expect("default members");
    let built: Vec<String> = serde_json::from_str(built).expect("a list of folders");
    for program in ["igi-master", "igi-worker"] {
        let has = |member: &String| {
            let manifest = fs::read_to_string(root().join(member).join("Cargo.toml")).expect("a manifest");
            manifest.contains(&format!("[[bin]]\nname = \"{program}\""))
        };
        assert!(built.iter().any(has), "{program} is not among what `cargo build` builds: {built:?}");
    }
}

/// All that people read, but for what tools have made.
fn documents() -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    let mut folders = vec![root()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("folders can be listed") {
            let path = entry.expect("an entry").path();
            let name = path.file_name().expect("a name").to_string_lossy();
            if path.is_dir() && !name.starts_with('.') && name != "target" {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "md") {
                let text = fs::read_to_string(&path).expect("documents are text");
                found.push((path, text));
            }
        }
    }
    found
}

/// Lines outside code blocks.
fn prose(text: &str) -> impl Iterator<Item = &str> {
    text.split("```").step_by(2).flat_map(str::lines)
}

/// What a link to a heading is called: lower case, blanks as hyphens, no punctuation.
fn anchor(heading: &str) -> String {
    let kept = heading.trim_start_matches('#').trim().to_lowercase().replace(' ', "-");
    kept.chars().filter(|c| c.is_alphanumeric() || "-_".contains(*c)).collect()
}

#[test]
fn links_between_documents_lead_somewhere() {
    assert_eq!(anchor("## Error after 1, 10 and 60 seconds"), "error-after-1-10-and-60-seconds");
    let mut followed = 0;
    for (path, text) in documents() {
        let folder = path.parent().expect("a folder");
        for link in prose(&text).flat_map(|line| line.split("](").skip(1)) {
            let target = link.split(')').next().unwrap_or("");
            if target.contains("://") {
                continue;
            }
            let (file, heading) = target.split_once('#').unwrap_or((target, ""));
            let to = if file.is_empty() { path.clone() } else { folder.join(file) };
            assert!(to.exists(), "{} links to {target}, which is not there", path.display());
            if !heading.is_empty() {
                let page = fs::read_to_string(&to).expect("only documents have headings");
                let is_there = prose(&page).any(|line| line.starts_with('#') && anchor(line) == heading);
                assert!(is_there, "{} links to {target}: there is no such heading", path.display());
            }
            followed += 1;
        }
    }
    assert!(followed > 50, "links are found: {followed}");
}

/// What stands between backticks, outside code blocks.
fn quoted(text: &str) -> Vec<String> {
    let text = prose(text).collect::<Vec<_>>().join("\n");
    text.split('`').skip(1).step_by(2).map(|code| code.replace('\n', " ")).collect()
}

/// Whether a crate has a test program of this name, and in it, or anywhere if none is named, a function or module whose
/// name has `part` in it.
fn has_test(room: &str, program: Option<&str>, part: Option<&str>) -> bool {
    let folder = match program {
        Some(program) => {
            let folder = root().join(room).join("tests").join(program);
            if folder.is_dir() { folder } else { folder.with_extension("rs") }
        }
        None => root().join(room),
    };
    let files = match folder.is_dir() {
        true => sources(&folder),
        false => fs::read_to_string(&folder).map(|text| vec![(folder, text)]).unwrap_or_default(),
    };
    let has_part = |path: &Path, text: &str, part: &str| {
        let is_named = text.lines().any(|line| line.split_once("fn ").is_some_and(|(_, name)| name.contains(part)));
        is_named || path.with_extension("").ends_with(part) || path.parent().is_some_and(|at| at.ends_with(part))
    };
    files.iter().any(|(path, text)| part.is_none_or(|part| has_part(path, text, part)))
}

/// Tests that documents tell people to run: `cargo test -p CRATE [--test PROGRAM] [PART OF A NAME]`.
#[test]
fn tests_that_documents_name_are_there() {
    assert!(has_test("tests", Some("tidy"), Some("documents_name")) && has_test("protocol", None, Some("schedule")));
    assert!(!has_test("tests", Some("none"), None) && !has_test("secrets", None, Some("schedule")));
    let mut found = 0;
    for (path, text) in documents() {
        for command in quoted(&text) {
            let Some(words) = command.split_once("cargo test ").map(|(_, words)| words) else { continue };
            let mut words = words.split(' ').take_while(|word| *word != "--");
            let (mut room, mut program, mut part) = (None, None, None);
            while let Some(word) = words.next() {
                match word {
                    "-p" => room = words.next(),
                    "--test" => program = words.next(),
                    "--features" => drop(words.next()),
                    _ if word.starts_with('-') => {}
                    _ => part = Some(word),
                }
            }
            let room = match room {
                None => continue,
                Some("light") => "worker/light",
                Some("frame") => "master/frame",
                Some("runtime") => "master/runtime",
                Some("cases") => "tests/cases",
                Some(other) => other,
            };
            assert!(has_test(room, program, part), "{} names tests that are not there: {command}", path.display());
            found += 1;
        }
    }
    assert!(found > 20, "commands are found: {found}");
}

/// Files that documents name, whole or by the end of their path; those of a scene or a run are not ours.
#[test]
fn files_that_documents_name_are_there() {
    let ours: Vec<String> = ["scenes", "protocol", "worker", "master", "health", "secrets", "tests", "xtask"]
        .iter()
        .flat_map(|room| sources(&root().join(room)))
        .map(|(path, _)| path.strip_prefix(root()).expect("it lies there").display().to_string())
        .collect();
    let mut found = 0;
    for (path, text) in documents() {
        for name in quoted(&text).into_iter().filter(|name| name.ends_with(".rs") && !name.contains(' ')) {
            let is_there = ours.iter().any(|file| *file == name || file.ends_with(&format!("/{name}")));
            assert!(is_there, "{} names {name}, which is not there", path.display());
            found += 1;
        }
    }
    assert!(found > 20, "names are found: {found}");
}

/// A newcomer reads it in five minutes; whatever else is worth knowing has a page under docs/.
const README_WORDS: usize = 1200;

/// Everything between blanks counts as a word, commands included.
#[test]
fn the_readme_is_short() {
    let readme = fs::read_to_string(root().join("README.md")).expect("there is a README");
    let words = readme.split_whitespace().count();
    assert!(words <= README_WORDS, "README.md has {words} words: at most {README_WORDS}");
}

#[test]
fn light_and_frame_know_questions_and_answers_only() {
    for room in ["worker/light/src", "master/frame/src"] {
        for (path, text) in sources(&root().join(room)) {
            for part in code(&text).split("protocol::").skip(1) {
                let ok = part.starts_with("question") || part.starts_with("answer") || part.starts_with('{');
                assert!(ok, "{} imports protocol::{}", path.display(), part.split(';').next().unwrap_or(""));
            }
        }
    }
}

#[test]
fn pure_rooms_know_no_clock_socket_or_file() {
    for room in ["scenes/src", "protocol/src", "worker/light/src", "master/frame/src", "tests/cases/src"] {
        for (path, text) in sources(&root().join(room)) {
            // Reading files is what these two are for.
            if path.starts_with(root().join("scenes/src/read")) || path.ends_with("cases/src/rows/files.rs") {
                continue;
            }
            for word in ["std::time::Instant", "SystemTime", "std::net", "std::fs", "tokio", "thread_rng", "static mut"]
            {
                let code = code(&text);
                let code = code.split("#[cfg(test)]").next().unwrap_or("");
                assert!(!code.contains(word), "{} knows {word}", path.display());
            }
        }
    }
}

#[test]
fn every_file_opens_by_saying_what_it_is() {
    for room in ["scenes/src", "protocol/src", "health", "secrets", "worker", "master", "tests", "xtask"] {
        for (path, text) in sources(&root().join(room)) {
            assert!(text.starts_with("//!"), "{} has no opening sentence", path.display());
        }
    }
}

/// As in deny.toml, which `cargo deny` checks as well.
const PERMISSIVE: [&str; 14] = [
    "MIT",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "ISC",
    "BSL-1.0",
    "Zlib",
    "0BSD",
    "Unlicense",
    "CC0-1.0",
    "Unicode-3.0",
    "CDLA-Permissive-2.0",
    "IJG",
];

/// The fonts of the window: licences of fonts, which may be given away inside programs.
const FONTS: &str = "epaint_default_fonts";

/// Whether some alternative of a licence expression is permissive: `A OR B`, `A/B`, `(A OR B) AND C`.
fn is_permissive(licence: &str) -> bool {
    let all = |part: &str| {
        let part = part.trim().trim_start_matches('(').trim_end_matches(')');
        part.replace('/', " OR ").split(" OR ").any(|one| PERMISSIVE.contains(&one.trim()))
    };
    licence.split(" AND ").all(all)
}

#[test]
fn dependencies_are_permissive_and_from_the_registry() {
    assert!(
        !is_permissive("GPL-3.0") && !is_permissive("MIT AND GPL-3.0") && is_permissive("(GPL-3.0 OR MIT) AND ISC")
    );
    let rules = fs::read_to_string(root().join("deny.toml")).expect("the rules are there");
    assert!(PERMISSIVE.iter().all(|licence| rules.contains(&format!("\"{licence}\""))), "deny.toml has other licences");

    let mut metadata = std::process::Command::new(env!("CARGO"));
    metadata.args(["metadata", "--format-version", "1", "--locked", "--all-features"]).current_dir(root());
    let output = metadata.output().expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).expect("it is JSON");
    let packages = metadata["packages"].as_array().expect("there are packages");
    assert!(packages.len() > 100);
    for package in packages {
        let (name, licence) = (&package["name"], package["license"].as_str().unwrap_or("none"));
        assert!(is_permissive(licence) || name == FONTS, "{name} has the licence {licence}");
        let source = package["source"].as_str();
        let registry = "registry+https://github.com/rust-lang/crates.io-index";
        assert!(source.is_none_or(|source| source == registry), "{name} comes from {source:?}");
    }
}

/// The loop, the parts and the description of methods know no method; a method knows no other.
#[test]
fn nothing_that_methods_stand_on_knows_a_method() {
    let frame = root().join("master/frame/src");
    let is_test = |path: &Path| path.file_name().is_some_and(|name| name == "tests.rs");
    let without_tests = |text: &str| code(text).split("#[cfg(test)]\nmod tests {").next().unwrap_or("").to_owned();
    for room in ["front_end", "parts", "live", "metrics", "tone"] {
        for (path, text) in sources(&frame.join(room)).iter().filter(|(path, _)| !is_test(path)) {
            assert!(!without_tests(text).contains("methods::"), "{} knows a method", path.display());
        }
    }
    let methods = ["igi", "reference", "render_cache", "shading_cache"];
    for method in methods {
        for (path, text) in sources(&frame.join("methods").join(method)) {
            let others = methods.iter().filter(|other| **other != method);
            for other in others {
                assert!(!code(&text).contains(&format!("{other}::")), "{} knows {other}", path.display());
            }
        }
    }
}

/// Methods come to the master as a list. What may name one: the command line, what is about the parts of IGI, the files of
/// references, and recordings of when there was only one.
#[test]
fn the_master_names_methods_in_few_places() {
    const MAY: [&str; 8] = [
        "main.rs",
        "methods.rs",
        "cli/",
        "pruning/",
        "command/plan.rs",
        "command/reference.rs",
        "files/record.rs",
        "live/record/format2.rs",
    ];
    let rooms = ["master/src", "master/runtime/src"].map(|room| root().join(room));
    for (path, text) in rooms.iter().flat_map(|room| sources(room)) {
        let inside = rooms.iter().find_map(|room| path.strip_prefix(room).ok()).expect("it lies there");
        let inside = inside.display().to_string();
        let code = code(&text);
        let code = code.split("#[cfg(test)]\nmod tests {").next().unwrap_or("");
        let is_word = |word: &str| code.split(|c: char| !c.is_alphanumeric() && c != '_').any(|part| part == word);
        let names = ["Igi", "IGI", "REFERENCE", "ReferenceSetup"].into_iter().any(is_word);
        let names = names
            || ["igi", "reference", "render_cache", "shading_cache"]
                .iter()
                .any(|method| code.contains(&format!("methods::{method}")));
        assert!(!names || MAY.iter().any(|may| inside.starts_with(may)), "{inside} names a method");
    }
}
