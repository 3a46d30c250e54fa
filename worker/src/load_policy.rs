//! `--nice`: a worker on a machine that is somebody's. It runs at the lowest priority, goes home when others need the
//! machine, and comes back when they have done.
//!
//! What others use is what all but those of low priority use, less what we use, from `/proc`. [`LoadPolicy`] decides and
//! has no clock.

use std::time::Duration;

use tokio::sync::watch;

use crate::network::StopSign;

/// Decides whether to work, from how much of the machine others use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadPolicy {
    /// Cores that others may use before we go.
    pub allowed: f64,
    working: bool,
    /// For how long it has been the other way round, seconds.
    since: f64,
}

/// Others need the machine for so long before we go, seconds: not for every little program.
const BUSY_FOR: f64 = 3.0;
/// They leave it alone for so long before we come back, seconds.
const IDLE_FOR: f64 = 20.0;
/// The machine is looked at this often.
const BETWEEN_LOOKS: Duration = Duration::from_secs(1);
/// The lowest priority there is.
const NICE: i32 = 19;
/// A third of the processor where another thread wants it as well.
const NICE_TO_OWN: i32 = 5;

impl LoadPolicy {
    /// At work, until others use more than so many cores.
    pub fn new(allowed: f64) -> Self {
        Self { allowed, working: true, since: 0.0 }
    }

    /// Others have used so many cores for so many seconds: whether we should work now.
    pub fn look(&mut self, others: f64, seconds: f64) -> bool {
        let welcome = others <= self.allowed;
        self.since = if welcome == self.working { 0.0 } else { self.since + seconds };
        if self.since >= if self.working { BUSY_FOR } else { IDLE_FOR } {
            (self.working, self.since) = (welcome, 0.0);
        }
        self.working
    }
}

/// Processor time at usual priority since the machine began, and of the system for this process, seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Used {
    all: f64,
    ours: f64,
}

impl Used {
    /// From the texts of `/proc/stat` and `/proc/self/stat`, with so many ticks a second.
    pub fn parse(machine: &str, process: &str, ticks: f64) -> Option<Self> {
        // user nice system idle iowait irq softirq steal (guest is part of user)
        let line = machine.lines().next()?.strip_prefix("cpu ")?;
        let times: Vec<f64> = line.split_whitespace().map_while(|word| word.parse().ok()).collect();
        // Who runs at a low priority, as we do, needs nothing that we take; stolen time is another machine's.
        let counts = |i: &usize| !matches!(i, 1 | 3 | 4 | 7);
        let all: f64 = (0..times.len().min(8)).filter(counts).map(|i| times[i]).sum();
        // The name in parentheses may contain anything; stime is field 15, and utime is counted under `nice`.
        let fields: Vec<&str> = process.rsplit_once(')')?.1.split_whitespace().collect();
        let ours: f64 = fields.get(12)?.parse::<f64>().ok()?;
        (times.len() >= 8).then_some(Self { all: all / ticks, ours: ours / ticks })
    }

    fn now() -> Option<Self> {
        let read = |path| std::fs::read_to_string(path).ok();
        Self::parse(&read("/proc/stat")?, &read("/proc/self/stat")?, rustix::param::clock_ticks_per_second() as f64)
    }

    /// Cores that others have used since `before`, `seconds` ago.
    pub fn others_since(self, before: Self, seconds: f64) -> f64 {
        ((self.all - before.all) - (self.ours - before.ours)).max(0.0) / seconds.max(1e-3)
    }
}

/// Lowers this process's priority. Threads that are started later inherit it.
///
/// # Errors
/// The system refuses.
pub fn lower_priority() -> std::io::Result<()> {
    rustix::process::nice(NICE).map(drop).map_err(Into::into)
}

/// Lowers the priority of this thread, and of those that it starts, a little: the process has others that people wait for.
/// Linux has a priority for each thread.
///
/// # Errors
/// The system refuses.
pub fn give_way() -> std::io::Result<()> {
    rustix::process::nice(NICE_TO_OWN).map(drop).map_err(Into::into)
}

/// Looks at the machine now and then, and says whether to work; never returns unless the machine cannot be looked at.
pub async fn watch(allowed: f64, sign: watch::Sender<StopSign>) {
    let mut policy = LoadPolicy::new(allowed);
    let Some(mut before) = Used::now() else {
        tracing::warn!("cannot tell how busy this machine is: no /proc/stat");
        return;
    };
    let mut when = tokio::time::Instant::now();
    loop {
        tokio::time::sleep(BETWEEN_LOOKS).await;
        let Some(now) = Used::now() else { return };
        let seconds = when.elapsed().as_secs_f64();
        let others = now.others_since(before, seconds);
        (before, when) = (now, tokio::time::Instant::now());
        let wanted = if policy.look(others, seconds) { StopSign::Work } else { StopSign::Yield };
        let changed = sign.send_if_modified(|sign| {
            let changed = *sign != StopSign::Drain && *sign != wanted;
            if changed {
                *sign = wanted;
            }
            changed
        });
        match (changed, wanted) {
            (true, StopSign::Yield) => tracing::info!("others use {others:.1} cores of this machine: making room"),
            (true, _) => tracing::info!("the machine is free again"),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_business_disturbs_nobody_and_long_business_does() {
        let mut policy = LoadPolicy::new(0.5);
        let mut story = |others: f64, seconds: usize| (0..seconds).map(|_| policy.look(others, 1.0)).last().unwrap();
        assert!(story(0.1, 5));
        assert!(story(2.0, 2), "two seconds are a short business");
        assert!(story(0.1, 1) && story(2.0, 2), "and do not add up");
        assert!(!story(2.0, 1), "three in a row are not");
        assert!(!story(0.0, 19));
        assert!(!story(2.0, 1) && !story(0.0, 19), "idle has to last");
        assert!(story(0.0, 1));
    }

    #[test]
    fn what_others_use_is_what_is_left_of_the_whole() {
        let machine = |user: u32| format!("cpu  {user} 7777 20 9999 50 1 2 8888 0 0\ncpu0 1 2 3\n");
        let process = |system: u32| format!("7 (a ) b) S 1 1 1 0 -1 4194304 1 1 1 1 6666 {system} 0 0 39 19 1 0 5 6 7");
        let used = |all, ours| Used::parse(&machine(all), &process(ours), 100.0).unwrap();
        let (before, after) = (used(1000, 150), used(1500, 400));
        assert_eq!(before, Used { all: 10.23, ours: 1.5 });
        // 5 s of all less 2.5 s of ours, within two seconds; what polite ones and other machines use is not in them.
        assert!((after.others_since(before, 2.0) - 1.25).abs() < 1e-9);
        assert_eq!(before.others_since(before, 0.0), 0.0);
        for (machine, process) in [("", ""), ("cpu  1 2 3\n", &*process(1)), ("cpu  1 2 3 4 5 6 7 8\n", "7 (x")] {
            assert_eq!(Used::parse(machine, process, 100.0), None);
        }
    }

    #[test]
    fn this_machine_can_be_looked_at() {
        let used = Used::now().expect("Linux has /proc/stat");
        assert!(used.all > 0.0 && used.ours >= 0.0);
    }
}
