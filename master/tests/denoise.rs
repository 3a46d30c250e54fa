//! Pictures that are denoised by Open Image Denoise: nearer the truth, and in the end the raw picture. Where the library is
//! not installed, the tests that need it say that they were skipped, unless IGI_TEST_OIDN is set.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use frame::Picture;
use frame::metrics::Difference;
use frame::parts::Undenoised;
use glam::Vec3;
use runtime::denoise::{Denoiser, Place};
use runtime::files::{encode_exr, read_metadata, read_picture};
use serde_json::Value;

/// As the program finds it.
fn library() -> Option<PathBuf> {
    std::env::var_os("IGI_OIDN").map(PathBuf::from)
}

/// The denoiser; without one, `None`, and a word.
fn denoiser() -> Option<Denoiser> {
    match Denoiser::open(library().as_deref(), Place::Processor) {
        Ok(denoiser) => Some(denoiser),
        Err(reason) => {
            assert!(std::env::var_os("IGI_TEST_OIDN").is_none(), "{reason}");
            eprintln!("skipped: {reason}");
            None
        }
    }
}

fn scene(name: &str) -> String {
    format!("{}/../scenes/{name}", env!("CARGO_MANIFEST_DIR"))
}

fn render(scene: &str, folder: &Path, more: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_igi-master"));
    command.current_dir(folder).env_remove("RUST_LOG").env_remove("IGI_WORKERS").env_remove("IGI_LISTEN");
    command.args(["render", scene, "--json"]).args(more);
    command.output().expect("the program starts")
}

/// Renders, and gives the hash of the raw picture.
fn raw_hash(scene: &str, folder: &Path, more: &[&str]) -> String {
    let output = render(scene, folder, more);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let events = String::from_utf8_lossy(&output.stdout).into_owned();
    let mut events = events.lines().map(|line| serde_json::from_str::<Value>(line).expect("JSON"));
    let picture = events.find(|event| event["event"] == "picture").expect("there is a picture");
    picture["raw_sha256"].as_str().expect("a hash").to_owned()
}

/// The layer of the raw picture.
fn raw_layer(path: &Path) -> Picture {
    let image = exr::prelude::read_all_flat_layers_from_file(path).expect("an EXR");
    let layer = &image.layer_data[0];
    let values = |name: &str| -> Vec<f32> {
        let channel = layer.channel_data.list.iter().find(|channel| channel.name.to_string() == name);
        channel.expect("the channel is there").sample_data.values_as_f32().collect()
    };
    let [red, green, blue] = ["raw.R", "raw.G", "raw.B"].map(values);
    let (width, height) = (layer.size.width() as u32, layer.size.height() as u32);
    Picture::from_fn(width, height, |x, y| {
        let at = (y * width + x) as usize;
        Vec3::new(red[at], green[at], blue[at])
    })
}

fn rel_mse(picture: &Picture, reference: &Picture) -> f64 {
    Difference::between(picture, reference).expect("they have one size").rel_mse
}

#[test]
fn without_the_library_it_is_said_how_to_get_it_before_any_work() {
    let folder = tempfile::tempdir().unwrap();
    let junk = folder.path().join("junk.so");
    std::fs::write(&junk, "no library").unwrap();
    let empty = folder.path().join("empty");
    std::fs::create_dir(&empty).unwrap();
    let [junk, empty] = [&junk, &empty].map(|path| path.to_str().unwrap());
    for (path, reason) in [("/nowhere", "/nowhere"), (junk, "junk.so"), (empty, "there is none of")] {
        for more in [&["-o", "a.png"][..], &["-o", "a.%d.png", "--frames-range", "0..2"]] {
            let arguments = [&["--denoise", "--oidn", path, "--frames", "1"], more].concat();
            let output = render(&scene("cornell"), folder.path(), &arguments);
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            assert_eq!(output.status.code(), Some(1), "{path}: {said}");
            assert!(
                said.starts_with("igi-master: Open Image Denoise cannot be used (") && said.contains(reason),
                "{said}"
            );
            assert!(said.contains("pip install pyoidn") && said.trim_end().lines().count() == 1, "{said}");
        }
    }
    let files = std::fs::read_dir(folder.path()).unwrap().count();
    assert_eq!(files, 2, "nothing was drawn");
}

#[test]
fn files_are_nearer_the_truth_say_what_they_went_through_and_leave_the_rest_as_it_was() {
    let Some(denoiser) = denoiser() else { return };
    let folder = tempfile::tempdir().unwrap();
    for name in ["conference", "cornell_spheres"] {
        let file = |file: &str| folder.path().join(format!("{name}-{file}"));
        let at = |path: &Path| path.to_str().unwrap().to_owned();
        let common = ["--size", "200x150", "--frames", "9", "--aov", "-o"];
        let plain = raw_hash(&scene(name), folder.path(), &[&common[..], &[&at(&file("plain.exr"))]].concat());
        let [exr, png, again] = ["a.exr", "a.png", "b.exr"].map(file);
        let denoised =
            raw_hash(&scene(name), folder.path(), &[&common[..], &[&at(&exr), "-o", &at(&png), "--denoise"]].concat());
        assert_eq!(denoised, plain, "the raw picture is as without");
        raw_hash(&scene(name), folder.path(), &[&common[..], &[&at(&again), "--denoise"]].concat());

        let reference = read_picture(Path::new(&format!("{}/ref.exr", scene(name)))).unwrap().shrunk(2).unwrap();
        let raw = raw_layer(&file("plain.exr"));
        let shown = read_picture(&file("plain.exr")).unwrap();
        let [first, second] = [&exr, &again].map(|path| read_picture(path).unwrap());
        let [raw_error, shown_error, error] = [&raw, &shown, &first].map(|picture| rel_mse(picture, &reference));
        println!("{name}: raw {raw_error:.5}, smoothed {shown_error:.5}, denoised {error:.5}");
        assert!(error < 0.9 * shown_error && error < 0.4 * raw_error, "{name}: {error} {shown_error} {raw_error}");
        assert_eq!(first, second, "the same picture gives the same bits");
        assert_eq!(raw_layer(&exr), raw);

        let words = |path: &Path| read_metadata(path).unwrap().1;
        assert_eq!(words(&exr).get("denoiser"), Some(&denoiser.name()));
        assert!(words(&exr)["command"].contains(" --denoise "));
        assert_eq!(words(&file("plain.exr")).get("denoiser"), None);
        let bytes = std::fs::read(&png).unwrap();
        let said = format!("denoised by {}", denoiser.name());
        assert!(bytes.windows(said.len()).any(|window| window == said.as_bytes()), "the PNG says so");
    }
}

#[test]
fn it_fades_as_noise_falls_below_its_own_bias() {
    let Some(_) = denoiser() else { return };
    let folder = tempfile::tempdir().unwrap();
    // Small pictures have much that a denoiser blurs. Many samples are the truth here: what is compared is what a picture
    // with fewer samples has lost by being denoised.
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let draw = |frames: &str, more: &[&str]| {
        let file = path(&format!("{frames}.exr"));
        let common = ["--size", "48x36", "--aov", "--frames", frames, "-o", &file];
        raw_hash(&scene("cornell_spheres"), folder.path(), &[&common[..], more].concat());
        (read_picture(Path::new(&file)).unwrap(), raw_layer(Path::new(&file)))
    };
    let (_, truth) = draw("2000", &["--seed", "7"]);
    let mut changes = Vec::new();
    for frames in ["36", "144", "576"] {
        let (denoised, raw) = draw(frames, &["--denoise"]);
        let [error, raw_error] = [&denoised, &raw].map(|picture| rel_mse(picture, &truth));
        let change = rel_mse(&denoised, &raw);
        println!("{frames} frames: raw {raw_error:.6}, denoised {error:.6}, apart {change:.6}");
        assert!(error < 1.1 * raw_error, "{frames} frames: {error} {raw_error}");
        changes.push(change);
    }
    assert!(changes[2] < 0.4 * changes[0], "{changes:?}");
}

/// A row of the numbers of a report.
#[derive(Clone, Debug)]
struct Row {
    method: String,
    view: String,
    samples: f64,
    seconds: f64,
    rel_mse: f64,
}

/// Of a report on the Cornell box, at 80×80.
fn report(folder: &Path, more: &[&str]) -> Result<Vec<Row>, String> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_igi-master"));
    command.arg("report").arg(scene("cornell")).args([
        "--runs",
        "1",
        "--size",
        "80x80",
        "--without-pruning",
        "--quiet",
    ]);
    let output = command.args(["--seconds", "2", "-o"]).arg(folder.join("report")).args(more).output().unwrap();
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned());
    }
    let text = std::fs::read_to_string(folder.join("report/points.csv")).unwrap();
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let heading = lines.next().unwrap();
    let column = |name: &str| heading.iter().position(|known| *known == name).unwrap();
    let words = ["method", "view", "samples", "seconds", "rel_mse"].map(column);
    let row = |line: Vec<&str>| {
        let [method, view, samples, seconds, rel_mse] = words.map(|column| line[column]);
        let [samples, seconds, rel_mse] = [samples, seconds, rel_mse].map(|number| number.parse().unwrap());
        Row { method: method.into(), view: view.into(), samples, seconds, rel_mse }
    };
    Ok(lines.map(row).collect())
}

#[test]
fn reports_denoise_on_the_clock_whoever_has_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let refused = report(folder.path(), &["--methods", "igi+oidn", "--oidn", "/nowhere"]).unwrap_err();
    assert!(refused.contains("pip install pyoidn"), "{refused}");
    let Some(_) = denoiser() else { return };

    // Another renderer: the truth, with noise, after a hundredth of a second.
    let truth = read_picture(Path::new(&format!("{}/ref.exr", scene("cornell")))).unwrap().shrunk(4).unwrap();
    let noise = noise(80, 80);
    let noisy = Picture::from_fn(80, 80, |x, y| truth.at(x, y) * (0.5 + noise.at(x, y)));
    let [picture, script] = ["noisy.exr", "noisy.sh"].map(|name| folder.path().join(name));
    std::fs::write(&picture, encode_exr(&noisy, &[], &[]).unwrap()).unwrap();
    let said = |number: &str| {
        let path = picture.display();
        format!("echo '{{\"run\": 0, \"samples\": {number}, \"seconds\": 0.01, \"picture\": \"{path}\"}}'\n")
    };
    std::fs::write(&script, format!("echo '{{\"prepared\": 0}}'\n{}", said("1"))).unwrap();
    let peer = |name: &str| format!("{name}=sh {}", script.display());
    let (plain, denoised) = (peer("other"), peer("other+oidn"));
    let rows = report(folder.path(), &["--methods", "igi,igi+oidn", "--peer", &plain, "--peer", &denoised]).unwrap();
    let of = |method: &str| rows.iter().filter(|row| row.method == method).cloned().collect::<Vec<_>>();
    let [plain, denoised] = ["other", "other+oidn"].map(|name| of(name)[0].clone());
    assert!(denoised.rel_mse < 0.7 * plain.rel_mse, "{denoised:?}, {plain:?}");
    assert!(plain.seconds == 0.01 && denoised.seconds > 0.011, "its time counts: {denoised:?}");
    let (raw, ours) = (of("igi raw"), of("igi+oidn"));
    let pairs = ours.iter().filter_map(|ours| Some((ours, raw.iter().find(|raw| raw.samples == ours.samples)?)));
    let (ours, raw) = pairs.min_by(|a, b| a.0.samples.total_cmp(&b.0.samples)).expect("both had as many frames once");
    assert!(ours.rel_mse < 0.7 * raw.rel_mse, "{ours:?}, {raw:?}");
    assert!(rows.iter().all(|row| !row.method.contains("+oidn") || row.view == "shown"), "{rows:?}");
}

/// Grain of 0 to 1.
fn noise(width: u32, height: u32) -> Picture {
    let grain = |x: u32, y: u32| {
        // Finaliser of MurmurHash3.
        let hash = ((x << 16) | y).wrapping_mul(0x9e37_79b9);
        let hash = (hash ^ (hash >> 16)).wrapping_mul(0x85eb_ca6b);
        let hash = (hash ^ (hash >> 13)).wrapping_mul(0xc2b2_ae35);
        ((hash ^ (hash >> 16)) >> 8) as f32 / (1 << 24) as f32
    };
    Picture::from_fn(width, height, |x, y| Vec3::splat(grain(x, y)))
}

#[test]
fn other_sizes_and_stops_leave_it_usable() {
    let Some(mut denoiser) = denoiser() else { return };
    let noise = |width: u32, height: u32| {
        let radiance = noise(width, height);
        let [albedo, normal] = [Vec3::ONE, Vec3::Z].map(|value| Picture::from_fn(width, height, |_, _| value));
        Undenoised::foreign(radiance, albedo, normal)
    };
    let spread = |picture: &Picture| {
        let mean = picture.pixels.iter().map(|pixel| pixel.x).sum::<f32>() / picture.pixels.len() as f32;
        picture.pixels.iter().map(|pixel| (pixel.x - mean).powi(2)).sum::<f32>() / picture.pixels.len() as f32
    };
    for (width, height) in [(64, 48), (33, 100), (64, 48), (1, 1)] {
        let picture = denoiser.denoise(&noise(width, height)).unwrap();
        assert_eq!((picture.width, picture.height), (width, height));
        assert!(picture.pixels.iter().all(|pixel| pixel.is_finite()));
        // Uniform noise has a variance of 1/12.
        assert!(spread(&picture) < 0.01, "{width}x{height}: {}", spread(&picture));
    }
    // Stopped from elsewhere, sooner or later: then or after, never for good.
    let (stop, large) = (denoiser.stop(), noise(640, 480));
    let whole = denoiser.denoise(&large).unwrap();
    let is_over = std::sync::atomic::AtomicBool::new(false);
    let stopped = std::thread::scope(|scope| {
        scope.spawn(|| {
            while !is_over.load(std::sync::atomic::Ordering::Relaxed) {
                stop.store(true, std::sync::atomic::Ordering::Relaxed);
                std::thread::yield_now();
            }
        });
        let stopped = denoiser.denoise(&large);
        is_over.store(true, std::sync::atomic::Ordering::Relaxed);
        stopped
    });
    assert_eq!(stopped, Err(runtime::denoise::Trouble::Stopped));
    assert_eq!(denoiser.denoise(&large).unwrap(), whole);
}
