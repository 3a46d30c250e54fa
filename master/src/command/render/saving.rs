//! A picture that is done goes to every file that was asked for; what is in the way of one is no loss for the others.

use frame::tone::{Exposure, Tone};
use frame::{FrontEnd, Igi, Layer, Picture};

use super::metadata;
use crate::cli::RenderArgs;
use crate::conduct::Tally;
use crate::files::{Output, OutputKind, Unsaved, encode_exr, encode_png};
use crate::narrator::Narrator;

/// Saves a picture of a moment wherever it can be saved, and says so; how many places it could not be saved at.
pub(crate) fn save(
    outputs: &[Output],
    args: &RenderArgs,
    time: f64,
    front: &mut Igi,
    tally: &Tally,
    unsaved: &mut Unsaved,
    narrator: &Narrator,
) -> usize {
    if outputs.iter().any(|output| output.kind == OutputKind::Png) {
        advise(args.look.exposure.0, &front.show(Layer::Final), narrator);
    }
    let before = unsaved.count();
    for output in outputs {
        match unsaved.write(&output.path, encode(output, args, time, front, tally)) {
            Ok(()) => narrator.saved(&output.path),
            Err(reason) => narrator.unsaved(&output.path, &reason),
        }
    }
    unsaved.count() - before
}

pub(super) fn encode(
    output: &Output,
    args: &RenderArgs,
    time: f64,
    front: &mut Igi,
    tally: &Tally,
) -> anyhow::Result<Vec<u8>> {
    let picture = front.show(Layer::Final);
    match output.kind {
        OutputKind::Png => {
            let tone = Tone { exposure: args.look.exposure.0, operator: args.look.tone.into() };
            encode_png(&tone.develop(&picture))
        }
        OutputKind::Exr => {
            let layers = if args.look.aov { layers(front) } else { Vec::new() };
            encode_exr(&picture, &layers, &metadata(args, time, front, tally))
        }
    }
}

/// Nobody should wonder about a white or black picture.
fn advise(exposure: Exposure, picture: &Picture, narrator: &Narrator) {
    let (chosen, auto) = (exposure.stops(picture), Exposure::Auto.stops(picture));
    let word = if auto < chosen { "bright" } else { "dark" };
    if (auto - chosen).abs() > STOPS_AMISS {
        narrator
            .say(&format!("the picture is very {word}: --exposure auto would choose {auto:.1} instead of {chosen:.1}"));
    }
}

/// Name, coloured or not, and picture of every layer that `--aov` adds.
fn layers(front: &mut Igi) -> Vec<(&'static str, bool, Picture)> {
    let layers = [
        ("raw", true, Layer::Raw),
        ("albedo", true, Layer::Albedo),
        ("normal", true, Layer::Normal),
        ("distance", false, Layer::Distance),
        ("irradiance", true, Layer::Irradiance),
        ("samples", false, Layer::Samples),
        ("deviation", true, Layer::Error),
        ("worker", false, Layer::Worker),
        ("cost", false, Layer::Cost),
    ];
    layers.into_iter().map(|(name, coloured, layer)| (name, coloured, front.show(layer))).collect()
}

/// An exposure this far from the automatic one is probably not what was meant.
const STOPS_AMISS: f32 = 4.0;
