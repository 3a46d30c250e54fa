//! The tiers of tests, as a table: what each runs, with what, and how long it takes.
//!
//! CONTRIBUTING.md shows the same table to people; a test compares the two.

use crate::need::Need;

/// Tests that are run together.
#[derive(Debug)]
pub struct Tier {
    pub name: &'static str,
    pub what: &'static str,
    /// On two cores, after everything is built.
    pub takes: &'static str,
    pub needs: &'static [Need],
    pub steps: &'static [Step],
    /// What its test programs understand beside the usual words of `cargo test`.
    pub arguments: &'static str,
    /// Whether `quick` runs the same tests; `all` does not run them twice.
    pub is_part_of_quick: bool,
}

/// One command.
#[derive(Debug)]
pub struct Step {
    pub variables: &'static [(&'static str, &'static str)],
    /// Its words, with a space between them.
    pub command: &'static str,
    /// What the test programs are told, before what the person tells them.
    pub to_tests: &'static [&'static str],
}

impl Tier {
    /// What it needs and this machine has not.
    pub fn missing(&self) -> Vec<Need> {
        self.needs.iter().copied().filter(|need| !need.is_met()).collect()
    }
}

impl Step {
    /// Whether it understands what goes to test programs.
    pub fn runs_tests(&self) -> bool {
        self.command.starts_with("cargo test ")
    }
}

const fn plain(command: &'static str) -> Step {
    Step { variables: &[], command, to_tests: &[] }
}

/// One whose test programs say what they see.
const fn with(variables: &'static [(&'static str, &'static str)], command: &'static str) -> Step {
    Step { variables, command, to_tests: &["--nocapture"] }
}

pub const TIERS: &[Tier] = &[
    Tier {
        name: "quick",
        what: "everything that needs nothing but Rust and a C compiler; what CI runs",
        takes: "about 12 minutes",
        needs: &[],
        steps: &[plain("cargo test --workspace")],
        arguments: "",
        is_part_of_quick: false,
    },
    Tier {
        name: "unit",
        what: "the rooms' own unit and property tests, and how files are read",
        takes: "2 minutes",
        needs: &[],
        steps: &[
            plain("cargo test --workspace --lib"),
            plain("cargo test -p scenes --tests"),
            plain("cargo test -p tests --test tidy"),
        ],
        arguments: "",
        is_part_of_quick: true,
    },
    Tier {
        name: "physics",
        what: "light against closed forms, the reference path tracer against Mitsuba's stored pictures, every method's quick \
               cases, bits that must not change",
        takes: "5 minutes",
        needs: &[],
        steps: &[plain(
            "cargo test -p tests --test physics --test reference_tracer --test references --test pruning --test lifting --test virtual_lights --test unfound_light --test golden",
        )],
        arguments: "",
        is_part_of_quick: true,
    },
    Tier {
        name: "cluster",
        what: "real masters and workers as processes over QUIC: killed, stopped, rotated, found, scaled, watched",
        takes: "3 minutes",
        needs: &[],
        steps: &[plain(
            "cargo test -p tests --test questions --test cluster --test relays --test checkpoint --test lost --test rotation --test secrets --test lan --test scale --test metrics --test logs",
        )],
        arguments: "",
        is_part_of_quick: true,
    },
    Tier {
        name: "simulation",
        what: "the whole cluster in one thread, with faults drawn from seeds: 10,000 stories",
        takes: "1 minute",
        needs: &[],
        steps: &[plain("cargo test -p tests --test simulation")],
        arguments: "--seeds N (so many stories), --seed S (one of them, told)",
        is_part_of_quick: true,
    },
    Tier {
        name: "hostile",
        what: "bytes of strangers: the corpus with 30 times as many mutations, 10,000 strangers at the door",
        takes: "5 minutes",
        needs: &[],
        steps: &[
            with(&[("IGI_FUZZ", "12000")], "cargo test -p tests --test hostile"),
            with(&[("IGI_FLOOD", "10000")], "cargo test -p runtime --lib floods"),
        ],
        arguments: "",
        is_part_of_quick: false,
    },
    Tier {
        name: "browser",
        what: "the viewer in Chromium: looked around in, edited, shared, photographed",
        takes: "4 minutes",
        needs: &[Need::Program("chromedriver", "chromium-driver"), Need::Program("chromium", "chromium")],
        steps: &[with(&[("IGI_TEST_BROWSER", "1")], "cargo test -p tests --test viewer")],
        arguments: "",
        is_part_of_quick: false,
    },
    Tier {
        name: "window",
        what: "the native window on a virtual screen, by mouse and keyboard; filter and tone curve on a graphics processor",
        takes: "5 minutes",
        needs: &[
            Need::Program("Xvfb", "xvfb"),
            Need::Program("xdotool", "xdotool"),
            Need::Library("libxkbcommon-x11.so.0", "libxkbcommon-x11-0"),
            Need::Library("libX11-xcb.so.1", "libx11-xcb1"),
            Need::Library("libXcursor.so.1", "libxcursor1"),
            Need::Library("libXi.so.6", "libxi6"),
            Need::Library("libEGL.so.1", "libegl1 libgl1-mesa-dri"),
            Need::Library("libvulkan.so.1", "libvulkan1 mesa-vulkan-drivers"),
        ],
        steps: &[
            with(&[("IGI_TEST_WINDOW", "1")], "cargo test -p master --features window --test window"),
            with(&[], "cargo test -p runtime --features window --lib show::"),
        ],
        arguments: "",
        is_part_of_quick: false,
    },
    Tier {
        name: "kills",
        what: "a master killed a hundred times while somebody edits, each at another moment by its seed: the session comes back",
        takes: "6 minutes",
        needs: &[],
        steps: &[with(&[("IGI_TEST_KILLS", "100")], "cargo test -p tests --test viewer storm")],
        arguments: "",
        is_part_of_quick: false,
    },
    Tier {
        name: "otel",
        what: "spans of frames, as an OpenTelemetry collector gets them",
        takes: "10 seconds",
        needs: &[],
        steps: &[plain("cargo test -p master --features otel --test otel")],
        arguments: "",
        is_part_of_quick: false,
    },
    Tier {
        name: "oidn",
        what: "pictures denoised by Open Image Denoise: nearer the truth, named, the same bits again, raw in the end",
        takes: "1 minute",
        needs: &[Need::OpenImageDenoise],
        steps: &[
            with(&[("IGI_TEST_OIDN", "1")], "cargo test -p master --test denoise"),
            with(&[("IGI_TEST_OIDN", "1")], "cargo test -p tests --test viewer denoising"),
        ],
        arguments: "",
        is_part_of_quick: false,
    },
    Tier {
        name: "netns",
        what: "workers in network namespaces of their own that fail in eleven ways: cables pulled, packets lost, stopped, \
               killed",
        takes: "5 minutes",
        needs: &[Need::Program("ip", "iproute2"), Need::Program("nft", "nftables"), Need::Root],
        steps: &[with(&[("IGI_TEST_NETNS", "1")], "cargo test -p tests --test netns")],
        arguments: "",
        is_part_of_quick: false,
    },
    Tier {
        name: "docker",
        what: "deploy/docker-compose.yml for real: killed, paused, cut off, scaled, stopped",
        takes: "4 minutes",
        needs: &[Need::Docker],
        steps: &[with(&[("IGI_TEST_DOCKER", "1")], "cargo test -p tests --test containers")],
        arguments: "",
        is_part_of_quick: false,
    },
    Tier {
        name: "slurm",
        what: "deploy/slurm/workers.sbatch under a real Slurm: cancelled, requeued, killed, out of time",
        takes: "3 minutes",
        needs: &[Need::Slurm],
        steps: &[with(&[("IGI_TEST_SLURM", "1")], "cargo test -p tests --test slurm")],
        arguments: "",
        is_part_of_quick: false,
    },
    Tier {
        name: "references",
        what: "every scene drawn down to the noise of its reference, by igi and by the reference path tracer (IGI_SCENES=DIR \
               adds scenes that are not shipped)",
        takes: "an hour",
        needs: &[],
        steps: &[Step {
            variables: &[],
            command: "cargo test --release -p tests --test references --test reference_tracer",
            to_tests: &["--ignored", "--nocapture"],
        }],
        arguments: "",
        is_part_of_quick: false,
    },
    Tier {
        name: "mitsuba",
        what: "the Cornell box by the reference path tracer and by Mitsuba 3, pixel by pixel; prints what people judge by \
               (tests/cross_check.py --help)",
        takes: "5 minutes",
        needs: &[Need::Program("python3", "python3"), Need::Python("numpy"), Need::Python("mitsuba")],
        steps: &[
            plain(
                "cargo run --release -- reference scenes/cornell -o target/cross-check-ours.exr --size 40x40 --samples 2048",
            ),
            plain(
                "python3 tests/cross_check.py scenes/cornell -o target/cross-check-mitsuba.exr --size 40x40 --spp 256 --runs 8 --against target/cross-check-ours.exr",
            ),
        ],
        arguments: "",
        is_part_of_quick: false,
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_told_apart_and_every_tier_says_what_it_is() {
        for (index, tier) in TIERS.iter().enumerate() {
            assert!(TIERS[..index].iter().all(|other| other.name != tier.name) && tier.name != "all");
            assert!(!tier.what.is_empty() && !tier.takes.is_empty() && !tier.steps.is_empty());
            assert!(!tier.is_part_of_quick || tier.needs.is_empty(), "quick needs nothing");
        }
    }

    #[test]
    fn people_are_shown_the_same_table() {
        let page = include_str!("../../CONTRIBUTING.md");
        for tier in TIERS {
            let row = page.lines().find(|line| line.starts_with(&format!("| `{}` |", tier.name)));
            let row = row.unwrap_or_else(|| panic!("CONTRIBUTING.md does not have {}", tier.name));
            assert!(row.contains(tier.takes), "CONTRIBUTING.md says another time than `{}`: {row}", tier.takes);
        }
    }

    #[test]
    fn cargo_knows_the_word() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../.cargo/config.toml");
        let settings = std::fs::read_to_string(path).expect("cargo has settings here");
        assert!(settings.lines().any(|line| line == "xtask = \"run --quiet --package xtask --\""), "{settings}");
    }

    /// Files of tests that no tier names are forgotten ones; those of the master run with `quick`.
    #[test]
    fn every_test_program_belongs_to_a_tier() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/tests");
        let named: Vec<&str> =
            TIERS.iter().flat_map(|tier| tier.steps).flat_map(|step| step.command.split(' ')).collect();
        for entry in std::fs::read_dir(folder).expect("the tests can be listed") {
            let path = entry.expect("an entry").path();
            let name = path.file_stem().and_then(|name| name.to_str()).expect("a name").to_owned();
            assert!(named.contains(&name.as_str()) || name == "builders", "tests/tests/{name} belongs to no tier");
        }
    }
}
