//! Shares of a core for processes: Linux control groups, version 1 or 2, whichever the machine has.
//!
//! The group is made, limited and removed here; nothing else on the machine is touched.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

use anyhow::{Context, anyhow, ensure};

/// A group of processes that together get so much of a core, and no more. Removed when dropped: then its processes
/// should have ended.
#[derive(Debug)]
pub struct Quota {
    group: PathBuf,
}

/// Where groups can be made.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Hierarchy {
    /// Version 1: our own group.
    One(PathBuf),
    /// Version 2: the topmost group, and our own.
    Two { top: PathBuf, own: PathBuf },
}

/// The kernel hands out no smaller slices, microseconds.
const SLICE_MIN: f64 = 1_000.0;
/// Slices come round so often if they are not too small then, microseconds: often enough that a client's answers do
/// not come in bursts.
const PERIOD: f64 = 20_000.0;
/// … and never more seldom, microseconds.
const PERIOD_MAX: f64 = 1_000_000.0;

impl Quota {
    /// A group without processes, limited to a share of a core, 0.005 to 1.
    ///
    /// # Errors
    /// In words that say what to do, where the machine has no control groups or we may not make any.
    pub fn new(cores: f64) -> anyhow::Result<Self> {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let name = format!("igi-scale-{}-{}", std::process::id(), NUMBER.fetch_add(1, Ordering::Relaxed));
        // Looked up before we step aside: afterwards our own group is another, with clients in it that are not held yet.
        static HIERARCHY: OnceLock<Option<Hierarchy>> = OnceLock::new();
        let read = |path: &str| fs::read_to_string(path).unwrap_or_default();
        let found = HIERARCHY.get_or_init(|| hierarchy(&read("/proc/mounts"), &read("/proc/self/cgroup")));
        Self::within(found.as_ref().ok_or_else(|| anyhow!(NONE))?, &name, cores).context(REFUSED)
    }

    fn within(hierarchy: &Hierarchy, name: &str, cores: f64) -> anyhow::Result<Self> {
        let (slice, period) = slice(cores);
        match hierarchy {
            Hierarchy::One(own) => {
                let quota = Self::make(own.join(name))?;
                write(&quota.group.join("cpu.cfs_period_us"), &period.to_string())?;
                write(&quota.group.join("cpu.cfs_quota_us"), &slice.to_string())?;
                Ok(quota)
            }
            Hierarchy::Two { top, own } => {
                let limited = |parent: &Path| {
                    let before = divide(parent)?;
                    let made = Self::make(parent.join(name)).and_then(|quota| {
                        can_hold(&quota.group)?;
                        write(&quota.group.join("cpu.max"), &format!("{slice} {period}"))?;
                        Ok(quota)
                    });
                    if made.is_err() && before == Divided::Now {
                        // As long as it is divided, nobody can step aside.
                        write(&parent.join("cgroup.subtree_control"), "-cpu")?;
                    }
                    made
                };
                // Only the topmost group may hold processes beside groups with limits; that takes root. Elsewhere we have
                // to leave our group to the groups in it.
                limited(top).or_else(|_| limited(own)).or_else(|_: anyhow::Error| {
                    step_aside(own)?;
                    limited(own)
                })
            }
        }
    }

    fn make(group: PathBuf) -> anyhow::Result<Self> {
        fs::create_dir(&group).with_context(|| format!("{}", group.display()))?;
        Ok(Self { group })
    }

    /// From now on, a process and all its threads belong to the group.
    ///
    /// # Errors
    /// The process is gone, or not ours.
    pub fn hold(&self, process: u32) -> anyhow::Result<()> {
        write(&self.group.join("cgroup.procs"), &process.to_string())
    }
}

impl Drop for Quota {
    fn drop(&mut self) {
        // A process that has just ended may still be counted for a moment.
        for _ in 0..50 {
            match fs::remove_dir(&self.group) {
                Err(error) if error.kind() == std::io::ErrorKind::ResourceBusy => {
                    std::thread::sleep(std::time::Duration::from_millis(10));
                }
                _ => return,
            }
        }
        tracing::warn!("{} could not be removed", self.group.display());
    }
}

/// Processor time that a process has used so far, seconds, by the system's count of hundredths; `None` if it is gone.
pub fn cpu_seconds(process: u32) -> Option<f64> {
    let stat = fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // The name is in brackets and may hold anything; user and system time are the 12th and 13th field after it.
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
    let mut ticks = || fields.next()?.parse::<u64>().ok();
    Some((ticks()? + ticks()?) as f64 / 100.0)
}

/// Since when groups in a group of version 2 may have limits.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Divided {
    Before,
    Now,
}

/// Lets groups in a group of version 2 have limits of their own.
fn divide(parent: &Path) -> anyhow::Result<Divided> {
    let switch = parent.join("cgroup.subtree_control");
    let is_on = fs::read_to_string(&switch).is_ok_and(|list| list.split_whitespace().any(|one| one == "cpu"));
    if is_on {
        return Ok(Divided::Before);
    }
    write(&switch, "+cpu")?;
    Ok(Divided::Now)
}

/// Whether processes may enter a new group of version 2. A group that holds processes can be divided all the same, by
/// processor time: then its groups are for threads only, and the kernel calls them `domain invalid`.
fn can_hold(group: &Path) -> anyhow::Result<()> {
    let kind = fs::read_to_string(group.join("cgroup.type")).unwrap_or_default();
    ensure!(!kind.contains("invalid"), "{}: the group above it holds processes of its own", group.display());
    Ok(())
}

/// Moves this process into a group in its own one, which stays when it has ended: whoever made ours removes both.
fn step_aside(own: &Path) -> anyhow::Result<()> {
    let aside = own.join("igi-master");
    if !aside.is_dir() {
        fs::create_dir(&aside).with_context(|| format!("{}", aside.display()))?;
    }
    write(&aside.join("cgroup.procs"), &std::process::id().to_string())
}

/// Time to run and time to wait for more, microseconds, that make such a share.
fn slice(cores: f64) -> (u64, u64) {
    let period = PERIOD.max(SLICE_MIN / cores).min(PERIOD_MAX);
    ((period * cores).round() as u64, period.round() as u64)
}

/// Finds where this process may have sub-groups, from the texts of /proc/mounts and /proc/self/cgroup.
fn hierarchy(mounts: &str, own: &str) -> Option<Hierarchy> {
    let fields = || mounts.lines().map(|line| line.split(' ').collect::<Vec<_>>()).filter(|fields| fields.len() >= 4);
    let has_cpu = |list: &str| list.split(',').any(|one| one == "cpu");
    // `4:cpu,cpuacct:/path`, and `0::/path` for version 2.
    let path = |is_it: &dyn Fn(&str, &str) -> bool| {
        own.lines().find_map(|line| {
            let mut parts = line.splitn(3, ':');
            let (number, list, path) = (parts.next()?, parts.next()?, parts.next()?);
            is_it(number, list).then(|| path.trim_start_matches('/').to_string())
        })
    };
    let within = |mount: &str, path: Option<String>| Path::new(mount).join(path.unwrap_or_default());
    let one = fields().find(|fields| fields[2] == "cgroup" && has_cpu(fields[3]));
    if let Some(fields) = one {
        return Some(Hierarchy::One(within(fields[1], path(&|_, list| has_cpu(list)))));
    }
    let two = fields().find(|fields| fields[2] == "cgroup2")?;
    Some(Hierarchy::Two { top: two[1].into(), own: within(two[1], path(&|number, _| number == "0")) })
}

fn write(file: &Path, text: &str) -> anyhow::Result<()> {
    fs::write(file, text).with_context(|| format!("{}", file.display()))
}

const NONE: &str = "this machine has no control groups for processor time (Linux, cgroup v1 or v2), so clients cannot be \
                    held to equal shares of it";
const REFUSED: &str = "clients cannot be held to shares of a core: no control group can be made. Run it as root, or where \
                       groups are delegated (systemd-run --user --scope -p Delegate=yes igi-master scale …)";

#[cfg(test)]
mod tests {
    use super::*;

    const ONE: &str = "cgroup /sys/fs/cgroup/cpuset cgroup rw,relatime,cpuset 0 0\n\
                       cgroup /sys/fs/cgroup/cpu,cpuacct cgroup rw,nosuid,cpu,cpuacct 0 0\n\
                       cgroup2 /sys/fs/cgroup/unified cgroup2 rw 0 0\n";
    const TWO: &str = "proc /proc proc rw 0 0\ncgroup2 /sys/fs/cgroup cgroup2 rw,nsdelegate 0 0\n";

    #[test]
    fn groups_are_made_below_our_own() {
        let own = "5:cpuset:/\n4:cpu,cpuacct:/user.slice\n0::/other\n";
        assert_eq!(hierarchy(ONE, own), Some(Hierarchy::One("/sys/fs/cgroup/cpu,cpuacct/user.slice".into())));
        assert_eq!(
            hierarchy(TWO, "0::/user.slice/a:b\n"),
            Some(Hierarchy::Two { top: "/sys/fs/cgroup".into(), own: "/sys/fs/cgroup/user.slice/a:b".into() })
        );
        assert_eq!(
            hierarchy(TWO, "0::/\n"),
            Some(Hierarchy::Two { top: "/sys/fs/cgroup".into(), own: "/sys/fs/cgroup/".into() })
        );
        assert_eq!(hierarchy("proc /proc proc rw 0 0\nx\n", "0::/\n"), None);
    }

    #[test]
    fn slices_make_the_share_and_are_not_too_small() {
        for cores in [0.005, 0.02, 0.05, 0.1, 0.33, 1.0] {
            let (slice, period) = slice(cores);
            assert!((slice as f64 / period as f64 / cores - 1.0).abs() < 0.01, "{cores}: {slice} of {period}");
            assert!(slice as f64 >= SLICE_MIN && period as f64 <= PERIOD_MAX);
        }
    }

    /// The files of both versions, in a folder that stands for the file system of groups.
    #[test]
    fn limits_are_written_as_each_version_wants_them() {
        let folder = tempfile::tempdir().unwrap();
        let quota = Quota::within(&Hierarchy::One(folder.path().into()), "a", 0.1).unwrap();
        quota.hold(4711).unwrap();
        let read = |file: &str| fs::read_to_string(folder.path().join(file)).unwrap();
        assert_eq!(
            [read("a/cpu.cfs_quota_us"), read("a/cpu.cfs_period_us"), read("a/cgroup.procs")],
            ["2000", "20000", "4711"]
        );
        assert!(Quota::within(&Hierarchy::One(folder.path().into()), "a", 0.1).is_err(), "it is there already");

        fs::write(folder.path().join("cgroup.subtree_control"), "memory").unwrap();
        let [missing, own] = ["missing", "own"].map(|name| folder.path().join(name));
        fs::create_dir(&own).unwrap();
        let quota = Quota::within(&Hierarchy::Two { top: folder.path().into(), own: own.clone() }, "b", 0.02).unwrap();
        assert_eq!([read("b/cpu.max"), read("cgroup.subtree_control")], ["1000 50000", "+cpu"]);
        std::mem::forget(quota);
        // Who may not write at the top does it in its own group.
        let quota = Quota::within(&Hierarchy::Two { top: missing.clone(), own }, "c", 0.02).unwrap();
        assert_eq!([read("own/c/cpu.max"), read("own/cgroup.subtree_control")], ["1000 50000", "+cpu"]);
        std::mem::forget(quota);
        assert!(Quota::within(&Hierarchy::Two { top: missing.clone(), own: missing }, "d", 0.1).is_err());
        // What was divided in vain is put together again.
        let full = folder.path().join("full");
        fs::create_dir_all(full.join("e")).unwrap();
        fs::write(full.join("cgroup.subtree_control"), "memory").unwrap();
        assert!(Quota::within(&Hierarchy::Two { top: full, own: folder.path().join("none") }, "e", 0.1).is_err());
        assert_eq!(read("full/cgroup.subtree_control"), "-cpu");
        // Our own group is left first, if it cannot be divided as it is.
        let held = folder.path().join("held");
        fs::create_dir_all(held.join("cgroup.subtree_control")).unwrap();
        assert!(Quota::within(&Hierarchy::Two { top: folder.path().join("none"), own: held }, "f", 0.1).is_err());
        assert_eq!(read("held/igi-master/cgroup.procs"), std::process::id().to_string());
    }

    #[test]
    fn groups_for_threads_only_hold_no_process() {
        let folder = tempfile::tempdir().unwrap();
        assert!(can_hold(folder.path()).is_ok(), "version 1, or the topmost group, says nothing");
        for (kind, can) in [("domain\n", true), ("domain threaded\n", true), ("domain invalid\n", false)] {
            fs::write(folder.path().join("cgroup.type"), kind).unwrap();
            assert_eq!(can_hold(folder.path()).is_ok(), can, "{kind}");
        }
    }

    #[test]
    fn time_of_a_process_is_known_while_it_is_there() {
        if cfg!(target_os = "linux") {
            assert!(cpu_seconds(std::process::id()).is_some_and(|seconds| seconds >= 0.0));
            assert_eq!(cpu_seconds(u32::MAX), None);
        }
    }
}
