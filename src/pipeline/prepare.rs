//! Decisions before a render: the needs of method, kernel and outputs are joined here and nowhere else.

use std::path::Path;
use std::time::Duration;

use super::method::Method;
use super::output::Outputs;
use super::recipe::{Differences, Extent, Recipe};
use crate::adaptive::{self, Allocator, Goals, Limits};
use crate::checkpoint::{Origin, Run, content};
use crate::error::{Error, Result};
use crate::neighbours::Selector;
use crate::plan::Plan;
use crate::reconstruct::{self, METHODS, Reconstruction};
use crate::render::{Budget, EPOCH, RenderSettings};
use crate::scene::Scene;

/// A render of which everything is decided.
pub struct Prepared<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The reconstruction.
    pub method: Method,
    /// Statistics that are recorded, with the reasons.
    pub plan: Plan,
    /// Settings of the samples.
    pub settings: RenderSettings,
    /// End of the render.
    pub limits: Limits,
    /// Allocator of an adaptive render; none where all pixels have the same number of samples, or their goals.
    pub allocator: Option<&'static dyn Allocator>,
    /// Duration of a reconstruction, where it is known beforehand.
    pub reconstruction: Option<Duration>,
    /// Files to write.
    pub outputs: Outputs,
    /// Warnings about the recipe.
    pub warnings: Vec<String>,
    /// Samples that every pixel is to have, if a file says so.
    pub(super) goals: Option<Vec<u32>>,
    /// Everything that files say of the render, without the checksum of the scene's content.
    pub(super) origin: Origin,
}

impl Recipe {
    /// Decides about a render of a scene, which was read from `file`. The error says what of the recipe cannot be.
    pub fn prepare<'a>(&self, scene: &'a Scene, file: &Path) -> Result<Prepared<'a>> {
        self.check()?;
        let method = self.method.make()?;
        let allocator = adaptive::chosen(self.allocator.as_deref(), &self.limits, &*method.made)?;
        let limits = self.limits.or_samples(scene.sensor().spp);
        let wanted = Selector::parse(&self.kernel, self.pilot)?;
        let kernel = kernel(wanted, &*method.made, limits.spp)?;
        let needed = method.made.needs().union(kernel.needs());
        let needed = match self.differences {
            Differences::Always => needed.with_every_difference(),
            Differences::Auto => needed,
        };
        let plan = match self.extent {
            Extent::Needed => Plan::new(scene, needed, self.saved()),
            Extent::All => Plan::all(scene),
        };
        let plan = plan.with_kernel(&kernel);
        let mut warnings = Vec::new();
        if scene.emitters().is_empty() {
            warnings.push(format!("nothing in {} emits light: the image is black", file.display()));
        }
        if kernel.is_cross() && !wanted.is_cross() {
            warnings.push("this method takes no differences: --kernel changes nothing".into());
        }
        let (seed, first, shift) = (self.seed, self.first, self.shift);
        let budget = limits.time.map_or(Budget::Spp(limits.spp.unwrap_or(scene.sensor().spp)), Budget::Time);
        let settings = RenderSettings { budget, seed, first, needs: plan.needs, shift, kernel };
        let origin = origin(scene, file, (&method.name, &plan), &settings);
        let (goals, outputs) = (goals(self, scene)?, self.outputs.clone());
        Ok(Prepared {
            scene,
            method,
            plan,
            settings,
            limits,
            allocator,
            reconstruction: None,
            outputs,
            warnings,
            goals,
            origin,
        })
    }
}

impl Prepared<'_> {
    /// Origin of the film, with the checksum of everything that the scene was read from.
    pub fn origin(&self) -> Result<Origin> {
        Ok(Origin { content: content(self.scene)?, ..self.origin.clone() })
    }
}

fn origin(scene: &Scene, file: &Path, (method, plan): (&str, &Plan), settings: &RenderSettings) -> Origin {
    let &RenderSettings { seed, first, needs, shift, kernel, .. } = settings;
    Origin {
        version: env!("CARGO_PKG_VERSION").into(),
        epoch: EPOCH,
        scene: file.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        content: String::new(),
        fingerprint: scene.fingerprint_hex(),
        method: method.to_owned(),
        plan: plan.summary(),
        size: (scene.sensor().width, scene.sensor().height),
        needs,
        shift,
        kernel,
        lights: scene.light_groups().names().to_vec(),
        runs: vec![Run { seed, first, samples: 0 }],
    }
}

/// Sample counts that the film's pixels are to have, if a file says so.
fn goals(recipe: &Recipe, scene: &Scene) -> Result<Option<Vec<u32>>> {
    let Some(path) = &recipe.goals else { return Ok(None) };
    let goals = Goals::load(path)?;
    let (width, height) = (scene.sensor().width, scene.sensor().height);
    if goals.size != (width, height) {
        let (columns, rows) = goals.size;
        return Err(Error::mismatch(path, format!("is of {columns}x{rows} pixels, the film of {width}x{height}")));
    }
    Ok(Some(goals.of_chunk(recipe.first, recipe.limits.spp)))
}

/// The neighbours for a method and for films of so many samples, if that is known; the cross for methods that take no
/// differences. The error says which methods take them.
fn kernel(selector: Selector, method: &dyn Reconstruction, spp: Option<u32>) -> Result<Selector> {
    if selector.is_cross() || !(method.needs_cross() || method.needs().edges.is_sampled()) {
        return Ok(Selector::default());
    }
    if method.needs_cross() {
        let takes =
            |id: &&str| reconstruct::parse(id).is_ok_and(|made| made.needs().edges.is_sampled() && !made.needs_cross());
        let names: Vec<_> = METHODS.iter().map(|method| method.id).filter(takes).collect();
        let what = "this method takes differences to the four direct neighbours only; with other kernels take";
        return Err(Error::Usage(format!("{what} --method {}", names.join(", "))));
    }
    let pilot = selector.pilot();
    if let Some(spp) = spp.filter(|&spp| spp < pilot || spp <= selector.without_differences()) {
        return Err(Error::Usage(format!("a pilot of {pilot} samples is too long for {spp}: give a smaller --pilot")));
    }
    Ok(selector)
}
