//! A file of tokens: those that a master lets workers in with, now.
//!
//! ```text
//! # one a line; the first is the one for new workers
//! igi1-…
//! igi1-… until 1795834800
//! ```
//! Whoever gives a master another token while it runs writes it before the old one, which stays valid until the moment
//! after `until`, seconds since the beginning of 1970 (UTC); without that, as long as it is in the file. A worker reads
//! the first one only.

use std::fmt::Write;

use crate::identity::Token;

/// Tokens that a master lets in at a time: one a worker, if there are no more.
pub const TOKENS_MAX: usize = 256;
/// Longest file, bytes.
pub const BYTES_MAX: u64 = 64 << 10;

/// A line of the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// What workers have to know.
    pub token: Token,
    /// It is revoked from then on, seconds since the beginning of 1970 (UTC).
    pub until: Option<u64>,
}

/// Reads a file: at least one token, the first of which is for new workers.
///
/// # Errors
/// In words, with the line's number.
pub fn parse(text: &str) -> Result<Vec<Entry>, String> {
    let lines = text.lines().enumerate().map(|(at, line)| (at + 1, line.trim()));
    let mut entries = Vec::new();
    for (number, line) in lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#')) {
        let entry = entry(line).map_err(|reason| format!("line {number}: {reason}"))?;
        if entries.is_empty() && entry.until.is_some() {
            return Err(format!("line {number}: the first token is for new workers, and cannot be one that ends"));
        }
        entries.push(entry);
        if entries.len() > TOKENS_MAX {
            return Err(format!("line {number}: at most {TOKENS_MAX} tokens may be valid at a time"));
        }
    }
    if entries.is_empty() { Err("there is no token in it".into()) } else { Ok(entries) }
}

fn entry(line: &str) -> Result<Entry, String> {
    let words: Vec<_> = line.split_whitespace().collect();
    let (token, until) = match words[..] {
        [token] => (token, None),
        [token, "until", moment] => {
            let moment = moment.parse().map_err(|_| format!("`{moment}` is no moment: seconds since 1970"))?;
            (token, Some(moment))
        }
        _ => return Err("wants a token, or `TOKEN until SECONDS`".into()),
    };
    Ok(Entry { token: token.parse().map_err(|error: crate::identity::NoToken| error.to_string())?, until })
}

/// The file with these tokens.
pub fn write(entries: &[Entry]) -> String {
    let mut text = String::from("# tokens that the master lets workers in with; the first is for new workers\n");
    for Entry { token, until } in entries {
        let until = until.map_or(String::new(), |until| format!(" until {until}"));
        // Nothing goes wrong when writing to memory.
        let _ = writeln!(text, "{token}{until}");
    }
    text
}

/// A new token goes before the others, which are revoked at that moment at the latest, or at once.
pub fn rotated(token: Token, before: Vec<Entry>, until: Option<u64>, now: u64) -> Vec<Entry> {
    let sooner = |entry: Entry| {
        let until = entry.until.into_iter().chain(until).min();
        Entry { until, ..entry }
    };
    let is_current = |entry: &Entry| entry.until.is_some_and(|until| until > now) && !entry.token.is_expired(now);
    let old = before.into_iter().filter(|_| until.is_some()).map(sooner).filter(is_current);
    std::iter::once(Entry { token, until: None }).chain(old).take(TOKENS_MAX).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::identity::Expiry;

    fn token(number: u8) -> Token {
        Token::whole([number; 16], [number; 16], None)
    }

    proptest! {
        #[test]
        fn files_survive_being_written(numbers in prop::collection::vec((any::<u8>(), any::<Option<u64>>()), 1..TOKENS_MAX)) {
            let entry = |(at, (number, until)): (usize, (u8, Option<u64>))| {
                Entry { token: token(number), until: until.filter(|_| at > 0) }
            };
            let entries: Vec<_> = numbers.into_iter().enumerate().map(entry).collect();
            prop_assert_eq!(parse(&write(&entries)), Ok(entries));
        }

        #[test]
        fn no_text_panics(text: String, moment: String) {
            let _ = parse(&text);
            let _ = parse(&format!("{} until {moment}", token(1)));
        }
    }

    #[test]
    fn a_file_with_one_token_is_a_token_file() {
        assert_eq!(parse(&format!("\n  {}\n", token(3))), Ok(vec![Entry { token: token(3), until: None }]));
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        let good = token(1).to_string();
        for (text, words) in [
            (String::new(), "no token"),
            (format!("{good}\nigi1-abc"), "line 2"),
            (format!("{good} until tomorrow"), "`tomorrow` is no moment"),
            (format!("{good} until 9"), "line 1: the first token is for new workers"),
            (format!("{good} for ever"), "wants a token"),
            (format!("{good}\n").repeat(TOKENS_MAX + 1), "at most"),
        ] {
            let error = parse(&text).unwrap_err();
            assert!(error.contains(words), "{error}");
        }
    }

    #[test]
    fn an_old_token_stays_for_its_grace_or_not_at_all() {
        let old = |until| Entry { token: token(1), until };
        let new = Entry { token: token(2), until: None };
        assert_eq!(rotated(token(2), vec![old(None)], Some(100), 10), [new.clone(), old(Some(100))]);
        assert_eq!(rotated(token(2), vec![old(Some(50))], Some(100), 10), [new.clone(), old(Some(50))]);
        assert_eq!(
            rotated(token(2), vec![old(Some(5))], Some(100), 10),
            std::slice::from_ref(&new),
            "it was revoked before"
        );
        assert_eq!(rotated(token(2), vec![old(None)], None, 10), std::slice::from_ref(&new));
        let expired = Entry { token: Token { expires: Expiry::new(9), ..token(1) }, until: None };
        assert_eq!(rotated(token(2), vec![expired], Some(100), 10), [new]);
    }
}
