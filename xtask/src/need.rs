//! What a tier needs of the machine, whether it is there, and how to get it.

use std::fmt;
use std::process::{Command, Stdio};

/// Something that a machine has or has not.
#[derive(Clone, Copy, Debug)]
pub enum Need {
    /// A program on the `PATH`, and the package of Debian that has it.
    Program(&'static str, &'static str),
    /// A shared library that is loaded when it is needed, and the package of Debian that has it.
    Library(&'static str, &'static str),
    /// A module of Python, by the name that both `import` and `pip` know.
    Python(&'static str),
    /// Open Image Denoise, named by IGI_OIDN or known to the system.
    OpenImageDenoise,
    /// Network namespaces and control groups may be made.
    Root,
    /// A Docker daemon that answers.
    Docker,
    /// A Slurm that this machine is part of.
    Slurm,
}

impl Need {
    /// Whether this machine has it.
    pub fn is_met(self) -> bool {
        match self {
            Self::Program(name, _) => on_path(name),
            Self::Library(name, _) => {
                // Where there is no such list, the test itself will tell.
                let list = Command::new("ldconfig").arg("-p").stderr(Stdio::null()).output();
                list.map_or(true, |list| String::from_utf8_lossy(&list.stdout).contains(name))
            }
            Self::Python(module) => succeeds("python3", &["-c", &format!("import {module}")]),
            Self::OpenImageDenoise => {
                std::env::var_os("IGI_OIDN").is_some() || Self::Library("libOpenImageDenoise.so.2", "").is_met()
            }
            Self::Root => succeeds("unshare", &["--net", "true"]),
            Self::Docker => succeeds("docker", &["info"]),
            Self::Slurm => succeeds("sinfo", &[]),
        }
    }

    /// What to do where it is missing.
    pub fn remedy(self) -> String {
        match self {
            Self::Program(_, package) | Self::Library(_, package) => {
                format!("On Debian: apt-get install {package}")
            }
            Self::Python(module) => format!("Install it: python3 -m pip install {module}"),
            Self::OpenImageDenoise => "Install it from your system's packages or https://www.openimagedenoise.org, or: \
                                       python3 -m pip install pyoidn; then IGI_OIDN names pyoidn/oidn/lib, where pip has put it"
                .to_owned(),
            Self::Root => "Run it as root, in a container with --privileged".to_owned(),
            Self::Docker => "On Debian: apt-get install docker.io docker-compose; then start dockerd".to_owned(),
            Self::Slurm => {
                "On Debian: apt-get install slurm-wlm munge; tests/tests/slurm.rs says how to set it up".to_owned()
            }
        }
    }
}

impl fmt::Display for Need {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Program(name, _) | Self::Library(name, _) => write!(f, "{name}"),
            Self::Python(module) => write!(f, "Python's {module}"),
            Self::OpenImageDenoise => write!(f, "Open Image Denoise"),
            Self::Root => write!(f, "root's rights over networks and control groups"),
            Self::Docker => write!(f, "a Docker daemon"),
            Self::Slurm => write!(f, "a Slurm"),
        }
    }
}

fn on_path(program: &str) -> bool {
    std::env::var_os("PATH").is_some_and(|path| std::env::split_paths(&path).any(|dir| dir.join(program).is_file()))
}

fn succeeds(program: &str, arguments: &[&str]) -> bool {
    let mut command = Command::new(program);
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_there_is_found_and_what_is_not_is_not() {
        assert!(Need::Program("cargo", "cargo").is_met());
        assert!(!Need::Program("no-such-program-of-igi", "none").is_met());
        assert!(!Need::Library("libno-such-library-of-igi.so.0", "none").is_met() || !on_path("ldconfig"));
        assert!(!Need::Python("no_such_module_of_igi").is_met());
    }
}
