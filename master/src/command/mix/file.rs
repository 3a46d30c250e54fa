//! Mixes in files: an EXR with the mix as its picture, and a layer `lamp1`, `lamp2` … for what each lamp brings at factor 1;
//! their names are among its attributes.

use std::path::Path;

use anyhow::{Context, anyhow, ensure};
use frame::Picture;
use frame::tone::Exposure;
use glam::Vec3;

use super::{Mix, Share};
use runtime::files::{encode_exr, read_layers, read_metadata};

/// The attribute with the lamps' names, a JSON list.
const LAMPS: &str = "lamps";
/// The attribute with their factors in this picture.
const FACTORS: &str = "factors";
/// Most lamps of a file.
const LAMPS_MAX: usize = 4096;

/// The bytes of the file.
pub(super) fn encode(mix: &Mix, factors: &[Vec3], picture: &Picture) -> anyhow::Result<Vec<u8>> {
    let names: Vec<&str> = mix.shares.iter().map(|share| share.name.as_str()).collect();
    let layers: Vec<String> = (1..=names.len()).map(layer).collect();
    let shares = layers.iter().zip(&mix.shares);
    let layers: Vec<_> = shares.map(|(layer, share)| (layer.as_str(), true, share.picture.clone())).collect();
    let mut metadata = mix.metadata.clone();
    metadata.retain(|(name, _)| ![LAMPS, FACTORS, EXPOSURE].contains(name));
    metadata.push((LAMPS, serde_json::to_string(&names)?));
    metadata.push((FACTORS, serde_json::to_string(factors)?));
    if mix.exposure == Exposure::Auto {
        metadata.push((EXPOSURE, "auto".into()));
    }
    encode_exr(picture, &layers, &metadata)
}

/// The attribute that says that the scene's lights are in units of their own.
const EXPOSURE: &str = "exposure";

/// Reads what [`encode`] has written.
///
/// # Errors
/// The file is missing, broken, or none of these.
pub(super) fn read(path: &Path) -> anyhow::Result<Mix> {
    let (_, words) = read_metadata(path)?;
    let wrong = |what: &str| anyhow!("{}: {what}", path.display());
    let names = words
        .get(LAMPS)
        .ok_or_else(|| wrong("has no layer for each lamp; `igi-master mix SCENE` makes such a file"))?;
    let names: Vec<String> =
        serde_json::from_str(names).with_context(|| wrong("its attribute igi:lamps is no list of names"))?;
    ensure!((1..=LAMPS_MAX).contains(&names.len()), wrong("has no lamp, or too many"));
    let layers = read_layers(path, &(1..=names.len()).map(layer).collect::<Vec<_>>())?;
    let shares = names.into_iter().zip(layers).map(|(name, picture)| Share { name, picture }).collect();
    let exposure = if words.contains_key(EXPOSURE) { Exposure::Auto } else { Exposure::Fixed(0.0) };
    let kept = KEPT.into_iter().filter_map(|name| Some((name, words.get(name)?.clone())));
    Ok(Mix { shares, metadata: kept.collect(), exposure })
}

/// What is told on of how lamps were drawn.
const KEPT: [&str; 5] = ["version", "scene", "method", "seed", "frames"];

fn layer(number: usize) -> String {
    format!("lamp{number}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mix_comes_back_from_its_file_to_the_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let share = |name: &str, value: f32| Share {
            name: name.into(),
            picture: Picture::from_fn(3, 2, |x, y| Vec3::new(value, x as f32, y as f32)),
        };
        let shares = vec![share("candle 3", 0.1), share("sky, \"blue\"", 7.0)];
        let mix = Mix { shares, metadata: vec![("seed", "4".into())], exposure: Exposure::Auto };
        let factors = [Vec3::ONE, Vec3::splat(0.5)];
        std::fs::write(&path, encode(&mix, &factors, &Picture::black(3, 2)).unwrap()).unwrap();
        let again = read(&path).unwrap();
        assert_eq!((again.exposure, &again.metadata), (Exposure::Auto, &mix.metadata));
        for (read, written) in again.shares.iter().zip(&mix.shares) {
            assert_eq!((&read.name, &read.picture), (&written.name, &written.picture));
        }
        std::fs::write(&path, encode_exr(&Picture::black(3, 2), &[], &[]).unwrap()).unwrap();
        let refused = read(&path).err().unwrap().to_string();
        assert!(refused.contains("has no layer for each lamp"), "{refused}");
    }
}
