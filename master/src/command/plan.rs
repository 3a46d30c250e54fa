//! `igi-master plan`: what a scene uses, what is left out for it, and what that saves.

use frame::Method;
use frame::methods::reference::REFERENCE;
use protocol::answer::Fields;
use scenes::Needs;
use serde_json::{Value, json};

use crate::cli::PlanArgs;
use runtime::console::print;
use runtime::failure::{Failure, Success};
use runtime::pruning::parts::{KINDS, Part, parts};

/// Prints the plan.
///
/// # Errors
/// [`Failure::Scene`] if the scene cannot be read.
pub fn plan(args: &PlanArgs) -> Result<Success, Failure> {
    let loaded = scenes::read::load(&args.scene)?;
    let needs = Needs::of(&loaded.scene);
    let (quality, filter) = args.method.igi().map_err(Failure::Usage)?;
    let parts = parts(&needs, &quality, &filter);
    if args.json {
        print(&format!("{}\n", as_json(&needs, &parts)));
        return Ok(Success::Done);
    }
    for note in &loaded.notes {
        eprintln!("{note}");
    }
    let mut text = format!("{}\n{} objects, {} triangles\n", args.scene.display(), needs.objects, needs.triangles);
    for kind in KINDS {
        text += &format!("\n{kind}\n");
        for part in parts.iter().filter(|part| part.kind == kind) {
            text += &format!("  {}  {:<22} {}\n", if part.used { "yes" } else { "  -" }, part.name, part.why);
            for saving in &part.saves {
                text += &format!("  {:27} saves {} {}\n", "", saving.amount, saving.unit);
            }
        }
    }
    if let Some(missing) = REFERENCE.misses(&loaded.scene) {
        text += &format!("\nThe reference path tracer misses {missing}.\n");
    }
    let left_out = parts.iter().filter(|part| !part.used).count();
    text += &format!("\n{left_out} parts are left out. igi-master bench --pruning measures what that saves.\n");
    print(&text);
    Ok(Success::Done)
}

fn as_json(needs: &Needs, parts: &[Part]) -> Value {
    let Fields { emitted, surface } = Fields::of(needs);
    let part = |part: &Part| {
        let saves: Vec<Value> =
            part.saves.iter().map(|saving| json!({ "amount": saving.amount, "unit": saving.unit })).collect();
        json!({ "kind": part.kind, "name": part.name, "used": part.used, "why": part.why, "saves": saves })
    };
    let parts: Vec<Value> = parts.iter().map(part).collect();
    json!({ "needs": needs, "fields": { "emitted": emitted, "surface": surface }, "parts": parts })
}
