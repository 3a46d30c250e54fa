//! Secrets on the command line. Every user of a machine can read the command line of every process (`ps`); its environment
//! can be read by the same user only. So a program that was given a secret as an argument begins again, in its own place
//! and with the same process number, with the secret in its environment.

use std::env;
use std::ffi::OsString;
use std::io;
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::os::unix::process::CommandExt;
use std::process::Command;

/// A flag whose value is a secret, such as `--token`, and the variable of the environment that means the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Flag {
    /// With its dashes.
    pub name: &'static str,
    /// Less than the flag, where both are there.
    pub variable: &'static str,
}

/// Begins this program again without the secrets on its command line, if there are any: then it does not return. `warn` is
/// told before, with the flag.
///
/// Call it before there are threads, and when the command line is known to be sound.
///
/// # Errors
/// The system does not let it begin again: the secret stays where it is.
pub fn hide(flags: &[Flag], warn: impl Fn(&Flag)) -> io::Result<()> {
    let mut words = env::args_os();
    let Some(name) = words.next() else { return Ok(()) };
    let (words, found) = without(words, flags);
    if found.is_empty() {
        return Ok(());
    }
    found.iter().for_each(|(flag, _)| warn(flag));
    let again = |program: OsString| {
        let mut command = Command::new(program);
        command.arg0(&name).args(&words).envs(found.iter().map(|(flag, secret)| (flag.variable, secret)));
        command.exec()
    };
    // Its name first, which is what others see of it; the link works even if the file was replaced since.
    if let Ok(program) = env::current_exe() {
        let _ = again(program.into_os_string());
    }
    Err(again("/proc/self/exe".into()))
}

/// The words without secrets, and the secrets.
fn without(words: impl Iterator<Item = OsString>, flags: &[Flag]) -> (Vec<OsString>, Vec<(Flag, OsString)>) {
    let (mut kept, mut found) = (Vec::new(), Vec::new());
    let mut words = words;
    while let Some(word) = words.next() {
        if word == "--" {
            // No flags from here on.
            kept.push(word);
            kept.extend(words);
            break;
        }
        let value = |flag: &Flag| word.as_bytes().strip_prefix(flag.name.as_bytes())?.strip_prefix(b"=");
        if let Some(flag) = flags.iter().find(|flag| word == flag.name) {
            found.extend(words.next().map(|secret| (*flag, secret)));
        } else if let Some((flag, secret)) = flags.iter().find_map(|flag| Some((*flag, value(flag)?))) {
            found.push((flag, OsString::from_vec(secret.to_vec())));
        } else {
            kept.push(word);
        }
    }
    (kept, found)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOKEN: Flag = Flag { name: "--token", variable: "A_TOKEN" };

    #[test]
    fn secrets_are_taken_out_and_all_else_stays_in_its_order() {
        let split = |line: &str| {
            let (kept, found) = without(line.split(' ').map(OsString::from), &[TOKEN]);
            let words: Vec<_> = kept.iter().map(|word| word.to_string_lossy().into_owned()).collect();
            (words.join(" "), found.into_iter().map(|(_, secret)| secret.into_string().unwrap()).collect::<Vec<_>>())
        };
        for (line, kept, found) in [
            ("render a --token x --size 4x4", "render a --size 4x4", &["x"][..]),
            ("render a --token=x=y", "render a", &["x=y"]),
            ("--token-file f --tokens 3", "--token-file f --tokens 3", &[]),
            ("--token a --token b", "", &["a", "b"]),
            ("a -- --token x", "a -- --token x", &[]),
            ("a --token", "a", &[]),
        ] {
            assert_eq!(split(line), (kept.to_owned(), found.iter().map(|&s| s.to_owned()).collect()), "{line}");
        }
    }
}
