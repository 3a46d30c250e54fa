//! `igi-master compare`: how far a picture is from a reference.

use anyhow::anyhow;
use frame::metrics::{Difference, SizesDiffer, flip, heat};
use frame::tone::{Image8, Tone};
use serde_json::json;

use crate::cli::CompareArgs;
use runtime::console::print;
use runtime::failure::{Failure, Success};
use runtime::files::{OutputKind, encode_png, missing_from, read_picture, write_whole};

/// Compares, prints the measures, and saves the map of differences.
///
/// # Errors
/// [`Failure`] if a file is missing or broken, the sizes differ, or the reference says that it lacks light.
pub fn compare(args: &CompareArgs) -> Result<Success, Failure> {
    if let Some(output) = &args.output {
        if output.kind != OutputKind::Png {
            return Err(Failure::Usage("the map of differences is saved as .png".to_string()));
        }
        output.check()?;
    }
    if let Some(missing) = missing_from(&args.reference).filter(|_| !args.incomplete) {
        return Err(Failure::Failed(anyhow!(
            "{}: is no truth to judge by: it lacks {missing} (--incomplete compares all the same)",
            args.reference.display()
        )));
    }
    let (picture, reference) = (read_picture(&args.picture)?, read_picture(&args.reference)?);
    let difference = Difference::between(&picture, &reference).map_err(|SizesDiffer| {
        let [ours, theirs] = [&picture, &reference].map(|picture| format!("{}x{}", picture.width, picture.height));
        anyhow!("the pictures have different sizes, {ours} and {theirs}: draw the first one again with --size {theirs}")
    })?;
    let shown = [&reference, &picture].map(|picture| Tone::PLAIN.develop(picture));
    let seen = flip(&shown[0], &shown[1]).ok_or_else(|| anyhow!("the pictures have no pixels"))?;

    let Difference { bias, rmse, rel_mse, smape, percentile_999, max, non_finite } = difference;
    if args.json {
        // JSON has no infinity: measures of pictures that are not finite are null.
        let measures = json!({
            "rel_mse": rel_mse, "rmse": rmse, "smape": smape, "bias": bias, "flip": seen.mean,
            "percentile_99_9": percentile_999, "max": max, "non_finite": non_finite,
        });
        print(&format!("{measures}\n"));
    } else {
        print(&format!(
            "relMSE           {rel_mse:.6}    mean (x - r)² / (r² + 0.01)\n\
             RMSE             {rmse:.6}\n\
             SMAPE            {smape:.6}\n\
             mean             {:+.3} %     of the reference's\n\
             FLIP             {:.6}    as shown at exposure 0, clipped\n\
             99.9 % within    {percentile_999:.6}\n\
             largest          {max:.6}\n\
             not finite       {non_finite}\n",
            bias * 100.0,
            seen.mean
        ));
    }
    if let Some(output) = &args.output {
        let pixels = seen.map.iter().map(|value| heat(*value)).collect();
        let map = Image8 { width: picture.width, height: picture.height, pixels };
        write_whole(&output.path, &encode_png(&map)?)?;
    }
    Ok(Success::Done)
}
