//! Runs the commands of a tier.

use std::path::Path;
use std::process::Command;

use crate::tier::{Step, Tier};

/// Runs all of a tier, or prints it; whether all passed. One that fails does not keep the others from running.
pub fn tier(tier: &Tier, arguments: &[String], dry_run: bool) -> bool {
    let mut passed = true;
    for step in tier.steps {
        let (variables, words) = (unset(step), words(step, arguments));
        let line = variables
            .iter()
            .map(|(name, value)| format!("{name}={value}"))
            .chain(words.iter().map(|word| quoted(word)));
        println!("$ {}", line.collect::<Vec<_>>().join(" "));
        if !dry_run {
            let mut command = Command::new(&words[0]);
            command.args(&words[1..]).envs(variables).current_dir(root());
            passed &= match command.status() {
                Ok(status) => status.success(),
                Err(wrong) => {
                    eprintln!("{}: {wrong}", words[0]);
                    false
                }
            };
        }
    }
    passed
}

/// The whole command: the step's words, then what goes to the test programs.
fn words(step: &Step, arguments: &[String]) -> Vec<String> {
    let mut words: Vec<_> = step.command.split(' ').map(str::to_owned).collect();
    let own = step.to_tests.iter().map(ToString::to_string);
    let to_tests: Vec<_> = own.chain(arguments.iter().cloned()).collect();
    if !to_tests.is_empty() {
        words.push("--".to_owned());
        words.extend(to_tests);
    }
    words
}

/// The variables that nobody has set to something else.
fn unset(step: &Step) -> Vec<(&'static str, &'static str)> {
    step.variables.iter().filter(|(name, _)| std::env::var_os(name).is_none()).copied().collect()
}

fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "-_./=:,".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("xtask/ lies in the workspace")
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: Step = Step {
        variables: &[("IGI_XTASK_TESTS_OWN", "1"), ("PATH", "none")],
        command: "cargo test -p tests",
        to_tests: &["--ignored"],
    };

    #[test]
    fn arguments_come_after_what_the_tier_itself_says() {
        assert_eq!(words(&STEP, &["a b".to_owned()]), ["cargo", "test", "-p", "tests", "--", "--ignored", "a b"]);
        let plain = Step { to_tests: &[], ..STEP };
        assert_eq!(words(&plain, &[]), ["cargo", "test", "-p", "tests"]);
        assert_eq!((quoted("a b"), quoted("--seeds")), ("'a b'".to_owned(), "--seeds".to_owned()));
    }

    #[test]
    fn variables_that_are_set_are_kept() {
        assert_eq!(unset(&STEP), [("IGI_XTASK_TESTS_OWN", "1")]);
    }
}
