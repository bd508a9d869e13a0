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
use crate::adaptive::Limits;
use crate::error::{Error, Result};
use crate::files;
use crate::film::Needs;
pub use crate::image::npy::Number;
use crate::math::rng;
use crate::pipeline::{Host, Method, MethodRecipe, Recipe, Stats};
use crate::reference::floor;
use crate::render::{Budget, RenderOutcome};
use crate::scene::Scene;

/// Method whose renders take no statistics but those that are asked for.
const PLAIN: &str = "primal";

/// Settings of a set of frames, the same for all of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Settings {
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
    pub recipe: Settings,
}

/// Whether a folder has the frame already. The error says that it was made with other settings.
pub fn is_there(folder: &Path, name: &str, settings: &Settings) -> Result<bool> {
    let path = folder.join(format!("{name}.json"));
    if !path.exists() {
        return Ok(false);
    }
    let text = std::fs::read_to_string(&path).map_err(|error| Error::io(&path, error))?;
    let manifest: Manifest = serde_json::from_str(&text).map_err(|error| Error::bad_data(&path, error))?;
    if manifest.recipe == *settings {
        return Ok(true);
    }
    Err(Error::mismatch(&path, "is of a frame with other settings: give the same ones, or another folder"))
}

/// Renders the frame `name` of a scene into a folder, the manifest last. `report` is called with the finished share. False
/// if `stop` ended it early; then files of it may be there, which the next attempt replaces.
pub fn make(
    (scene, source): (&Scene, &Path),
    (folder, name): (&Path, &str),
    settings: &Settings,
    stop: &AtomicBool,
    report: &dyn Fn(f32),
) -> Result<bool> {
    let methods = settings.methods.iter().map(|text| {
        let method = MethodRecipe { notes: settings.notes, ..MethodRecipe::named(text) };
        Ok((column(text), method.make()?))
    });
    let methods = methods.collect::<Result<Vec<_>>>()?;
    let last = settings.spp.last().copied().unwrap_or_default();
    let share = |samples: u32| samples as f32 / (settings.reference + last).max(1) as f32;
    let host = Host { stop, ..Host::QUIET };
    let (stem, seed) = (folder.join(name), rng::combine(settings.seed, scene.fingerprint()));
    let target_seed = rng::combine(seed, 1);
    let Some(target) = target((scene, source), target_seed, settings, &host)? else { return Ok(false) };
    report(share(settings.reference));
    let statistics = methods.iter().fold(settings.layers, |needs, (_, method)| needs.union(method.made.needs()));
    let mut prepared = Recipe { statistics, seed, ..Recipe::of_method(PLAIN) }.prepare(scene, source)?;
    let mut outcome = RenderOutcome::new(scene, prepared.settings.needs);
    let mut channels = Vec::new();
    for &spp in &settings.spp {
        prepared.settings.budget = Budget::Spp(spp);
        outcome = prepared.render(outcome, None, &host);
        if outcome.stopped {
            return Ok(false);
        }
        let frame = outcome.film.develop();
        let solve = |(column, method): &(String, Method)| {
            Ok((column.clone(), method.solve(&frame, &host, &mut Stats::default())?))
        };
        let solutions = methods.iter().map(solve).collect::<Result<_>>()?;
        let snapshot = Snapshot { frame, layers: settings.layers, solutions };
        channels = settings.layout.write(&stem, spp, &snapshot, settings.number)?;
        report(share(settings.reference + spp));
    }
    settings.layout.write_target(&stem, &target, settings.number)?;
    let sensor = scene.sensor();
    let manifest = Manifest {
        name: name.to_owned(),
        scene: source.display().to_string(),
        fingerprint: scene.fingerprint_hex(),
        width: sensor.width,
        height: sensor.height,
        seed: seed.to_string(),
        target_seed: target_seed.to_string(),
        floor: floor(&target.image, &target.difference),
        channels,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        recipe: settings.clone(),
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
fn target((scene, source): (&Scene, &Path), seed: u64, settings: &Settings, host: &Host) -> Result<Option<Target>> {
    let mut halves = Vec::new();
    for seed in [seed, rng::combine(seed, 1)] {
        let limits = Limits { spp: Some(settings.reference / 2), ..Limits::default() };
        let recipe = Recipe { seed, limits, ..Recipe::of_method(&settings.target) };
        let prepared = recipe.prepare(scene, source)?;
        let outcome = prepared.render(RenderOutcome::new(scene, prepared.settings.needs), None, host);
        if outcome.stopped {
            return Ok(None);
        }
        halves.push(prepared.method.solve(&outcome.film.develop(), host, &mut Stats::default())?.image);
    }
    Ok(Some(Target::new(&halves[0], &halves[1])))
}
