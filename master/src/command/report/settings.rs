//! All that repeats a report.

use serde_json::json;

use super::Section;
use crate::cli::{ClockArg, PeerArg, ReportArgs};
use crate::cluster::embedded;

/// The settings block: the command, and what it stood for.
pub fn settings(sections: &[Section], args: &ReportArgs) -> String {
    let scenes: Vec<_> = sections
        .iter()
        .map(|section| {
            let subject = &section.subject;
            json!({
                "name": subject.name, "path": subject.path.display().to_string(),
                "width": subject.reference.width, "height": subject.reference.height,
                "reference": subject.reference_path.display().to_string(), "shrink": subject.shrink,
                "reference_noise": subject.floor,
                "methods": section.methods.iter().map(|method| (method.name.clone(), method.settings.clone()))
                    .collect::<std::collections::BTreeMap<_, _>>(),
            })
        })
        .collect();
    let block = json!({
        "program": concat!("igi-master ", env!("CARGO_PKG_VERSION")),
        "command": command(args),
        "machine": machine(),
        "threads": super::threads(args),
        "scenes": scenes,
    });
    serde_json::to_string_pretty(&block).unwrap_or_default()
}

/// The command that repeats the report.
fn command(args: &ReportArgs) -> String {
    let measure = &args.measure;
    let mut words = vec!["igi-master".to_string(), "report".to_string()];
    words.extend(args.scenes.iter().map(|scene| quoted(&scene.display().to_string())));
    let methods = args.methods.iter().filter_map(clap::ValueEnum::to_possible_value);
    let methods = methods.map(|value| value.get_name().to_string()).collect::<Vec<_>>().join(",");
    if !methods.is_empty() {
        words.extend(["--methods".into(), methods]);
    }
    for variant in &args.variants {
        words.extend(["--variant".into(), quoted(&format!("{}={}", variant.name, variant.flags))]);
    }
    for peer in &args.peers {
        words.push("--peer".into());
        words.push(match peer {
            PeerArg::Mitsuba => "mitsuba".into(),
            PeerArg::Command { name, command } => quoted(&format!("{name}={command}")),
        });
    }
    words.push(format!("--runs {} --seconds {} --seed {}", measure.runs, measure.seconds, measure.seed));
    words.push(format!("--threads {} --time {}", super::threads(args), measure.time));
    words.push(if measure.clock == ClockArg::Cpu { "--clock cpu".into() } else { "--clock wall".into() });
    words.push(match measure.size {
        Some(size) => format!("--size {}x{}", size.width, size.height),
        None => format!("--shrink {}", measure.shrink),
    });
    if let Some(reference) = &measure.reference {
        words.extend(["--reference".into(), quoted(&reference.display().to_string())]);
    }
    if args.peers.iter().any(|peer| matches!(peer, PeerArg::Mitsuba)) {
        words.extend(["--python".into(), quoted(&measure.python.display().to_string())]);
    }
    if args.without_pruning {
        words.push("--without-pruning".into());
    }
    words.extend(["-o".into(), quoted(&args.output.display().to_string())]);
    words.join(" ")
}

/// A word for a shell.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,".contains(c);
    if word.chars().all(is_plain) { word.to_string() } else { format!("'{}'", word.replace('\'', "'\\''")) }
}

/// The processor and the number of its cores, as far as the system tells.
pub fn machine() -> String {
    let cores = embedded::cores();
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = info.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    let model = model.map_or(std::env::consts::ARCH, |(_, model)| model.trim());
    format!("{model}, {cores} cores, {}", std::env::consts::OS)
}

#[cfg(test)]
mod tests {
    use super::quoted;

    #[test]
    fn words_are_quoted_for_a_shell() {
        assert_eq!([quoted("scenes/a.obj"), quoted("it's a b")], ["scenes/a.obj", "'it'\\''s a b'"]);
    }
}
