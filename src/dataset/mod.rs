//! Training data for denoisers: the same render at several numbers of samples, beside a target of other samples.
//!
//! ```text
//! scene -> film -+- spp[0] -> snapshot -> files
//!                +- spp[1] -> snapshot -> files        every film goes on where the last one stopped
//!                +- ...
//! scene -> two films of other seeds -> target, and its noise -> files -> manifest
//! ```

mod layout;

use std::path::Path;
use std::sync::atomic::AtomicBool;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::layout::Layout;
use self::layout::{Snapshot, Target, file};
use crate::error::{Error, Result};
use crate::files;
use crate::film::Needs;
pub use crate::image::npy::Number;
use crate::math::rng;
use crate::plan::Plan;
use crate::reconstruct::{self, Context, Reconstruction};
use crate::reference::{fingerprint, floor};
use crate::render::{Budget, Control, RenderOutcome, RenderSettings, render, resume};
use crate::scene::Scene;

/// Settings of a set of frames, the same for all of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Recipe {
    /// Numbers of samples per pixel, rising. Each has those before as its first samples.
    pub spp: Vec<u32>,
    /// Samples per pixel of the target, in two halves.
    pub reference: u32,
    /// Method that makes the target of each half, with its parameters; one without bias.
    pub target: String,
    /// Methods whose images are stored with the layers, with their parameters.
    pub methods: Vec<String>,
    /// Whether the intermediate images of these methods are stored, those of the frame's size.
    pub notes: bool,
    /// Statistics that are stored.
    pub layers: Needs,
    /// Options that override what is in the scene files, as on the command line.
    pub scene_options: String,
    /// Arrangement of the files.
    pub layout: Layout,
    /// Type of the numbers.
    pub number: Number,
    /// Seed; every scene mixes its own with it.
    pub seed: u64,
}

/// Everything to know about a frame: `NAME.json`, written when all of its files are there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Manifest {
    /// Name of the frame, with which its files begin.
    pub name: String,
    /// The scene file.
    pub scene: String,
    /// The scene's, in hexadecimal.
    pub fingerprint: String,
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Seed of the samples, as a decimal number.
    pub seed: String,
    /// Seed of the first half of the target.
    pub target_seed: String,
    /// Expected relMSE of the target itself, from the difference of its halves.
    pub floor: f64,
    /// Channels of the files of layers, in their order.
    pub channels: Vec<String>,
    /// Version of Fluxion.
    pub version: String,
    /// The settings.
    pub recipe: Recipe,
}

/// Whether a folder has the frame already. The error says that it was made with other settings.
pub fn is_there(folder: &Path, name: &str, recipe: &Recipe) -> Result<bool> {
    let path = folder.join(format!("{name}.json"));
    if !path.exists() {
        return Ok(false);
    }
    let text = std::fs::read_to_string(&path).map_err(|error| Error::io(&path, error))?;
    let manifest: Manifest = serde_json::from_str(&text).map_err(|error| Error::bad_data(&path, error))?;
    if manifest.recipe == *recipe {
        return Ok(true);
    }
    Err(Error::mismatch(&path, "is of a frame with other settings: give the same ones, or another folder"))
}

/// Renders the frame `name` of a scene into a folder, the manifest last. `report` is called with the finished share. False
/// if `stop` ended it early; then files of it may be there, which the next attempt replaces.
pub fn make(
    (scene, source): (&Scene, &Path),
    (folder, name): (&Path, &str),
    recipe: &Recipe,
    stop: &AtomicBool,
    report: &dyn Fn(f32),
) -> Result<bool> {
    let methods = recipe.methods.iter().map(|text| Ok((column(text), reconstruct::parse(text)?)));
    let methods = methods.collect::<Result<Vec<_>>>()?;
    let last = recipe.spp.last().copied().unwrap_or_default();
    let share = |samples: u32| samples as f32 / (recipe.reference + last).max(1) as f32;
    let control = Control { stop, ..Control::QUIET };
    let (stem, seed) = (folder.join(name), rng::combine(recipe.seed, scene.fingerprint()));
    let target_seed = rng::combine(seed, 1);
    let Some(target) = target(scene, target_seed, recipe, &control)? else { return Ok(false) };
    report(share(recipe.reference));
    let needs = methods.iter().fold(recipe.layers, |needs, (_, method)| needs.union(method.needs()));
    let needs = Plan::new(scene, needs, recipe.layers).needs;
    let mut outcome = RenderOutcome::new(scene, needs);
    let mut channels = Vec::new();
    for &spp in &recipe.spp {
        let settings = RenderSettings { seed, ..RenderSettings::new(Budget::Spp(spp), needs) };
        outcome = resume(scene, settings, &control, outcome);
        if outcome.stopped {
            return Ok(false);
        }
        let frame = outcome.film.develop();
        let solve = |(column, method): &(String, Box<dyn Reconstruction>)| {
            let context = Context { notes: recipe.notes, ..Context::QUIET };
            Ok((column.clone(), reconstruct::solve(method.as_ref(), &frame, &context)?))
        };
        let solutions = methods.iter().map(solve).collect::<Result<_>>()?;
        channels =
            recipe.layout.write(&stem, spp, &Snapshot { frame, layers: recipe.layers, solutions }, recipe.number)?;
        report(share(recipe.reference + spp));
    }
    recipe.layout.write_target(&stem, &target, recipe.number)?;
    let sensor = scene.sensor();
    let manifest = Manifest {
        name: name.to_owned(),
        scene: source.display().to_string(),
        fingerprint: fingerprint(scene),
        width: sensor.width,
        height: sensor.height,
        seed: seed.to_string(),
        target_seed: target_seed.to_string(),
        floor: floor(&target.image, &target.difference),
        channels,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        recipe: recipe.clone(),
    };
    let path = file(&stem, ".json");
    let text = serde_json::to_string_pretty(&manifest).map_err(|error| Error::bad_data(&path, error))?;
    files::write(&path, text + "\n")?;
    Ok(true)
}

/// Name of a method's channels: its text, with underscores for what is neither letter nor digit.
pub fn column(method: &str) -> String {
    method.replace(|c: char| !c.is_ascii_alphanumeric(), "_")
}

/// The target, none if the render was stopped.
fn target(scene: &Scene, seed: u64, recipe: &Recipe, control: &Control) -> Result<Option<Target>> {
    let method = reconstruct::parse(&recipe.target)?;
    let needs = Plan::new(scene, method.needs(), Needs::default()).needs;
    let mut halves = Vec::new();
    for seed in [seed, rng::combine(seed, 1)] {
        let settings = RenderSettings { seed, ..RenderSettings::new(Budget::Spp(recipe.reference / 2), needs) };
        let outcome = render(scene, settings, control);
        if outcome.stopped {
            return Ok(None);
        }
        halves.push(reconstruct::solve(method.as_ref(), &outcome.film.develop(), &Context::QUIET)?.image);
    }
    Ok(Some(Target::new(&halves[0], &halves[1])))
}
