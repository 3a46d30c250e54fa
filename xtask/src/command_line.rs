//! What was asked for.

use crate::tier::{TIERS, Tier};

/// One call of `cargo xtask`.
#[derive(Debug)]
pub enum Request {
    Help,
    List,
    Test(TestRequest),
}

/// `cargo xtask test`.
#[derive(Debug)]
pub struct TestRequest {
    pub tiers: Vec<&'static Tier>,
    /// Whether that is all of them: then those that cannot run here are passed by.
    pub all: bool,
    pub dry_run: bool,
    /// What goes to the test programs.
    pub arguments: Vec<String>,
}

/// Understands the words after `cargo xtask`.
pub fn parse(words: impl IntoIterator<Item = String>) -> Result<Request, String> {
    let mut words = words.into_iter();
    match words.next().as_deref() {
        Some("test") => {}
        None | Some("help" | "--help" | "-h") => return Ok(Request::Help),
        Some(other) => return Err(format!("there is no chore `{other}`, only `test`")),
    }
    let mut request = TestRequest { tiers: Vec::new(), all: false, dry_run: false, arguments: Vec::new() };
    let mut list = false;
    while let Some(word) = words.next() {
        match word.as_str() {
            "--help" | "-h" => return Ok(Request::Help),
            "--list" => list = true,
            "--dry-run" => request.dry_run = true,
            "--" => request.arguments = words.by_ref().collect(),
            "--tier" => request.add(&words.next().ok_or("--tier wants a name")?)?,
            _ => match word.strip_prefix("--tier=") {
                Some(names) => request.add(names)?,
                None => return Err(format!("`{word}` is no option; what tests are to be told goes after `--`")),
            },
        }
    }
    if list {
        return Ok(Request::List);
    }
    if request.tiers.is_empty() {
        request.add("quick")?;
    }
    let without_tests = request.tiers.iter().find(|tier| tier.steps.iter().any(|step| !step.runs_tests()));
    match without_tests {
        Some(tier) if !request.arguments.is_empty() => Err(format!(
            "`{}` runs other programs than tests: it takes nothing after `--` (see --dry-run for what it runs)",
            tier.name
        )),
        _ => Ok(Request::Test(request)),
    }
}

impl TestRequest {
    fn add(&mut self, names: &str) -> Result<(), String> {
        for name in names.split(',') {
            if name == "all" {
                self.all = true;
                self.tiers = TIERS.iter().filter(|tier| !tier.is_part_of_quick).collect();
                continue;
            }
            let tier = TIERS.iter().find(|tier| tier.name == name).ok_or_else(|| {
                let known: Vec<_> = TIERS.iter().map(|tier| tier.name).collect();
                format!("there is no tier `{name}`; there are {}, and all", known.join(", "))
            })?;
            if !self.tiers.iter().any(|known| known.name == name) {
                self.tiers.push(tier);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(words: &str) -> Result<TestRequest, String> {
        match parse(words.split_whitespace().map(str::to_owned))? {
            Request::Test(request) => Ok(request),
            other => panic!("{other:?}"),
        }
    }

    fn names(request: &TestRequest) -> Vec<&str> {
        request.tiers.iter().map(|tier| tier.name).collect()
    }

    #[test]
    fn tiers_are_named_and_arguments_go_on() {
        assert_eq!(names(&asked("test").unwrap()), ["quick"]);
        let request = asked("test --tier physics,browser --tier=physics -- glass --nocapture --list").unwrap();
        assert_eq!(names(&request), ["physics", "browser"]);
        assert_eq!(request.arguments, ["glass", "--nocapture", "--list"]);
        assert!(!request.all && !request.dry_run);
    }

    #[test]
    fn all_are_all_but_nothing_twice() {
        let request = asked("test --tier all --dry-run").unwrap();
        assert!(request.all && request.dry_run);
        assert!(names(&request).contains(&"quick") && names(&request).contains(&"netns"));
        assert!(!names(&request).contains(&"physics"), "it is part of quick");
    }

    #[test]
    fn what_is_wrong_is_named() {
        assert!(asked("test --tier fast").unwrap_err().contains("simulation"));
        assert!(asked("test --tier").unwrap_err().contains("--tier"));
        assert!(asked("test glass").unwrap_err().contains("after `--`"));
        assert!(asked("test --tier mitsuba -- glass").unwrap_err().contains("after `--`"));
        assert!(asked("tests").unwrap_err().contains("`tests`"));
        assert!(matches!(parse(["test", "--list"].map(str::to_owned)), Ok(Request::List)));
        assert!(matches!(parse([]), Ok(Request::Help)));
    }
}
