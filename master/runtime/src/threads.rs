//! Processor time by thread, as the system counts it: figures that hold on a busy machine as well.

use std::collections::BTreeMap;

/// What threads of one kind have used.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Used {
    /// Seconds of their own work …
    pub user: f64,
    /// … and of the system's for them.
    pub system: f64,
}

impl Used {
    /// Seconds in all.
    pub fn all(self) -> f64 {
        self.user + self.system
    }
}

impl std::ops::AddAssign for Used {
    fn add_assign(&mut self, other: Self) {
        self.user += other.user;
        self.system += other.system;
    }
}

/// What every thread of this process has used so far, by its number.
#[derive(Clone, Debug, Default)]
pub struct Threads(BTreeMap<u32, (String, Used)>);

/// The main thread, which asks, absorbs and looks around.
pub const MAIN: &str = "main";
/// The thread that says who is asked what.
pub const DISPATCHER: &str = "dispatcher";
/// Threads of the network.
pub const NETWORK: &str = "network";
impl Threads {
    /// Now. Nothing where the system does not tell (it must be Linux).
    pub fn now() -> Self {
        Self::of("self")
    }

    /// And those of another process, by one name.
    pub fn and(mut self, process: u32, name: &str) -> Self {
        let theirs = Self::of(&process.to_string()).0.into_iter();
        self.0.extend(theirs.map(|(number, (_, used))| (number, (name.to_owned(), used))));
        self
    }

    fn of(process: &str) -> Self {
        let ticks = rustix::param::clock_ticks_per_second() as f64;
        let folder = std::fs::read_dir(format!("/proc/{process}/task")).into_iter().flatten().flatten();
        let thread = |entry: std::fs::DirEntry| {
            let number: u32 = entry.file_name().to_str()?.parse().ok()?;
            let stat = std::fs::read_to_string(entry.path().join("stat")).ok()?;
            let (name, [user, system]) = parse(&stat)?;
            let name = if number == std::process::id() { MAIN.into() } else { name };
            Some((number, (name, Used { user: user as f64 / ticks, system: system as f64 / ticks })))
        };
        Self(folder.filter_map(thread).collect())
    }

    /// What was used since then, by kind: threads of one name, whatever number follows it.
    pub fn since(&self, before: &Self) -> BTreeMap<String, Used> {
        let mut kinds: BTreeMap<String, Used> = BTreeMap::new();
        for (number, (name, used)) in &self.0 {
            let before = before.0.get(number).filter(|(was, _)| was == name).map_or(Used::default(), |(_, used)| *used);
            let used = Used { user: used.user - before.user, system: used.system - before.system };
            let kind = name.trim_end_matches(|end: char| end.is_ascii_digit() || end == ' ' || end == '-');
            *kinds.entry(kind.to_owned()).or_default() += used;
        }
        kinds
    }
}

/// Name and ticks, the thread's own and the system's, of a line of `/proc/…/stat`: proc(5).
fn parse(stat: &str) -> Option<(String, [u64; 2])> {
    // The name may contain anything, brackets too.
    let (open, close) = (stat.find('(')?, stat.rfind(')')?);
    let name = stat.get(open + 1..close)?.to_owned();
    // The first field after it is the third of all.
    let mut ticks = stat.get(close + 1..)?.split_whitespace().skip(14 - 3);
    let mut next = || ticks.next()?.parse().ok();
    Some((name, [next()?, next()?]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_of_the_systems_is_read_whatever_the_name() {
        let line = "12 (a ) (b) S 1 2 3 4 5 6 7 8 9 10 77 33 0 0 20 0 1 0 5 0 0";
        assert_eq!(parse(line), Some(("a ) (b".into(), [77, 33])));
        assert_eq!(parse("12 (cut"), None);
        assert_eq!(parse("12 (short) S 1 2"), None);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_thread_that_works_is_seen_under_its_name() {
        let before = Threads::now();
        let (done, wait) = std::sync::mpsc::channel::<()>();
        let work = move || {
            let mut sum = 0.0_f64;
            for step in 0..60_000_000 {
                sum = (sum + f64::from(step)).sqrt();
            }
            drop(done);
            std::thread::sleep(std::time::Duration::from_secs(2));
            sum
        };
        let thread = std::thread::Builder::new().name("busy 7".into()).spawn(work).unwrap();
        let _ = wait.recv();
        let used = Threads::now().since(&before);
        assert!(used.get("busy").is_some_and(|used| used.all() > 0.0), "{used:?}");
        assert!(thread.join().unwrap() > 0.0);
    }
}
