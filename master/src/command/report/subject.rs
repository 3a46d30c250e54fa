//! What is measured: a scene at a size, and the picture that it should become.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::anyhow;
use frame::Picture;
use scenes::Scene;
use scenes::read::Loaded;

use super::settings::{Target, TargetSize};
use runtime::failure::Failure;
use runtime::files::{missing_from, read_metadata, read_picture};

/// A scene and its reference.
pub struct Subject {
    /// For people.
    pub name: String,
    /// As given.
    pub path: PathBuf,
    /// Its camera has the size of the reference.
    pub scene: Arc<Scene>,
    /// What its picture should be.
    pub reference: Picture,
    /// The file that the reference is from.
    pub reference_path: PathBuf,
    /// Pixels of that file that one pixel of the reference is the mean of, along a side.
    pub shrink: u32,
    /// Expected relMSE of the reference itself: what cannot be measured. Nothing if nobody knows.
    pub floor: Option<f64>,
}

impl Subject {
    /// Reads both.
    ///
    /// # Errors
    /// [`Failure::Scene`] if the scene cannot be used, [`Failure::Failed`] if there is no reference (and
    /// how to make one) or it lacks light, [`Failure::Usage`] if the sizes do not fit.
    pub fn load(path: &Path, target: &Target) -> Result<Self, Failure> {
        let Loaded { mut scene, base, .. } = scenes::read::load_at(path, target.time)?;
        let folder = if path.is_dir() { path } else { path.parent().unwrap_or(path) };
        // An edited scene lies beside the one that ref.exr is of.
        let usual = if base.is_some() { path.with_extension("ref.exr") } else { folder.join("ref.exr") };
        let reference_path = target.reference.clone().unwrap_or_else(|| usual.clone());
        if !reference_path.exists() {
            return Err(Failure::Failed(anyhow!(
                "{}: there is no such reference. To make one: igi-master reference {} -o {} --until-noise 1e-4; \
                 or name one with --reference",
                reference_path.display(),
                path.display(),
                usual.display()
            )));
        }
        if let Some(missing) = missing_from(&reference_path) {
            return Err(Failure::Failed(anyhow!(
                "{}: is no truth to judge by: it lacks {missing}. Name another with --reference",
                reference_path.display()
            )));
        }
        let full = read_picture(&reference_path)?;
        let shrink = match target.size {
            TargetSize::Pixels(size) => full.width / size.width.max(1),
            TargetSize::Shrink(shrink) => shrink,
        };
        let fits = |p: &Picture| match target.size {
            TargetSize::Pixels(size) => (size.width, size.height) == (p.width, p.height),
            TargetSize::Shrink(_) => true,
        };
        let reference = full.shrunk(shrink).filter(fits).ok_or_else(|| {
            Failure::Usage(format!(
                "{}: is {}x{} pixels, which is no whole multiple of the size asked for: try {}",
                reference_path.display(),
                full.width,
                full.height,
                sizes(full.width, full.height)
            ))
        })?;
        let bad = frame::metrics::non_finite(&reference);
        if bad > 0 {
            return Err(Failure::Failed(anyhow!("{}: {bad} values are not finite", reference_path.display())));
        }
        (scene.camera.width, scene.camera.height) = (reference.width, reference.height);
        let noise = stated_noise(folder, &reference_path).or_else(|| own_noise(&reference_path));
        let floor = noise.map(|noise| noise / f64::from(shrink * shrink));
        let path = path.to_path_buf();
        let name = runtime::files::name_of(&path);
        Ok(Self { name, path, scene: Arc::new(scene), reference, reference_path, shrink, floor })
    }
}

/// Sizes that divide a picture's, for people.
fn sizes(width: u32, height: u32) -> String {
    let divides = |n: &u32| width.is_multiple_of(*n) && height.is_multiple_of(*n) && width / n >= 8;
    let sizes: Vec<_> = (1..=16).filter(divides).map(|n| format!("{}x{}", width / n, height / n)).collect();
    sizes.join(", ")
}

/// The expected relMSE of a reference as its scene's JSON states it: `references: [{ "file": …,
/// "expected_relmse_of_ref": … }]`.
fn stated_noise(folder: &Path, reference: &Path) -> Option<f64> {
    let text = std::fs::read_to_string(folder.join("scene.json")).ok()?;
    let json: serde_json::Value = serde_json::from_str(&text).ok()?;
    let is_it = |entry: &&serde_json::Value| {
        let file = entry.get("file").and_then(serde_json::Value::as_str);
        file.is_some_and(|file| folder.join(file) == reference)
    };
    let entry = json.get("references")?.as_array()?.iter().find(is_it)?;
    entry.get("expected_relmse_of_ref")?.as_f64().filter(|noise| *noise > 0.0 && noise.is_finite())
}

/// The same as a picture of `igi-master reference` states it.
fn own_noise(reference: &Path) -> Option<f64> {
    let (_, words) = read_metadata(reference).ok()?;
    words.get("noise_rel_mse")?.parse().ok().filter(|noise: &f64| *noise > 0.0 && noise.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use runtime::files::MISSES;

    #[test]
    fn sizes_that_fit_are_offered() {
        assert_eq!(sizes(400, 300), "400x300, 200x150, 100x75, 80x60, 40x30");
    }

    #[test]
    fn a_references_noise_is_found_where_it_is_stated() {
        let folder = tempfile::tempdir().unwrap();
        let json = r#"{ "references": [{ "file": "a.exr" }, { "file": "b.exr", "expected_relmse_of_ref": 0.002 }] }"#;
        std::fs::write(folder.path().join("scene.json"), json).unwrap();
        let noise = |file: &str| stated_noise(folder.path(), &folder.path().join(file));
        assert_eq!([noise("a.exr"), noise("b.exr"), noise("c.exr")], [None, Some(0.002), None]);
    }

    #[test]
    fn a_reference_that_lacks_light_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ref.exr");
        let (scene, target) = (Path::new("../scenes/cornell"), |reference| Target {
            reference: Some(reference),
            size: TargetSize::Shrink(1),
            time: None,
        });
        for (words, is_refused) in [(vec![(MISSES, "the light of a sun".to_string())], true), (Vec::new(), false)] {
            std::fs::write(&path, runtime::files::encode_exr(&Picture::black(8, 8), &[], &words).unwrap()).unwrap();
            let refused = Subject::load(scene, &target(path.clone())).err().map(|failure| failure.to_string());
            assert_eq!(refused.is_some(), is_refused, "{refused:?}");
            assert!(refused.is_none_or(|said| said.contains("it lacks the light of a sun")));
        }
    }

    #[test]
    fn a_reference_of_our_own_knows_its_noise() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ref.exr");
        let picture = Picture::black(8, 8);
        for (words, noise) in [(vec![("noise_rel_mse", "1.5e-3".to_string())], Some(1.5e-3)), (Vec::new(), None)] {
            std::fs::write(&path, runtime::files::encode_exr(&picture, &[], &words).unwrap()).unwrap();
            assert_eq!(own_noise(&path), noise);
        }
    }
}
