//! Everything that decides a render, as one value that can be stored: the same recipe makes the same samples.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::method::MethodRecipe;
use super::output::Outputs;
use crate::adaptive::{self, Limits};
use crate::error::{Error, Result};
use crate::film::{Needs, Recorded};
use crate::mitsuba;
use crate::neighbours::Selector;
use crate::render::Shift;
use crate::scene::Scene;

/// Everything that decides a render of a scene file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Recipe {
    /// Options that override what is in the scene file, and groups of its emitters.
    pub scene: mitsuba::Options,
    /// The reconstruction.
    pub method: MethodRecipe,
    /// Neighbours that paths are shifted to, as in `structure:k=4`.
    pub kernel: String,
    /// Samples without differences that neighbours are chosen by, if not as many as the kernel takes by itself.
    pub pilot: Option<u32>,
    /// Shift mapping with its roughness threshold.
    pub shift: Shift,
    /// Samples in which paths are shifted.
    pub differences: Differences,
    /// Statistics that are recorded besides those that the method takes.
    pub statistics: Needs,
    /// Extent of the plan.
    pub extent: Extent,
    /// Different seeds give independent images.
    pub seed: u64,
    /// Number of the first sample of every pixel.
    pub first: u32,
    /// End of the render; without any limit the scene says how many samples.
    pub limits: Limits,
    /// Name of the allocator that gives samples to the pixels that need them. Without one it is the default where there is a time or an
    /// error to decide by, and otherwise all pixels have the same number.
    pub allocator: Option<String>,
    /// File of the sample counts that pixels are to have, numbered from the first sample of an image on.
    pub goals: Option<PathBuf>,
    /// Files to write.
    pub outputs: Outputs,
}

/// Samples in which paths are shifted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Differences {
    /// Fewer where that is costly, for methods that ask for no more.
    #[default]
    Auto,
    /// All.
    Always,
}

/// Extent of the plan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Extent {
    /// Only what is needed is computed.
    #[default]
    Needed,
    /// Everything that can be recorded, and no material or texture by a faster way, to see the savings.
    All,
}

impl Default for Recipe {
    fn default() -> Self {
        Self {
            scene: mitsuba::Options::default(),
            method: MethodRecipe::default(),
            kernel: Selector::default().to_string(),
            pilot: None,
            shift: Shift::default(),
            differences: Differences::default(),
            statistics: Needs::NONE,
            extent: Extent::default(),
            seed: 0,
            first: 0,
            limits: Limits::default(),
            allocator: None,
            goals: None,
            outputs: Outputs::default(),
        }
    }
}

impl Recipe {
    /// A render for a method, with everything else by default.
    pub fn of_method(name: &str) -> Self {
        Self { method: MethodRecipe::named(name), ..Self::default() }
    }

    /// Finds faults that show without the scene, before it is read. The error says what there is instead.
    pub fn check(&self) -> Result<()> {
        let method = self.method.make()?;
        Selector::parse(&self.kernel, self.pilot)?;
        let allocator = adaptive::chosen(self.allocator.as_deref(), &self.limits, &*method.made)?;
        let decided = allocator.is_some() || self.limits.time.is_some() || self.limits.error.is_some();
        let even = self.outputs.samples.is_some() || self.goals.is_some();
        if decided && even {
            let what =
                "samples one by one and goals take a number of samples, without an allocator, a time or a target error";
            return Err(Error::Usage(what.into()));
        }
        if self.outputs.samples.is_some() && self.goals.is_some() {
            return Err(Error::Usage("samples one by one have no goals".into()));
        }
        Ok(())
    }

    /// Reads the scene.
    pub fn load(&self, file: &Path) -> Result<Scene> {
        mitsuba::load(file, &mitsuba::Options { fast_paths: self.extent == Extent::Needed, ..self.scene.clone() })
    }

    /// Statistics that are recorded for the outputs or because they are asked for.
    pub(super) fn saved(&self) -> Needs {
        let stores = self.outputs.layers.is_some() || self.outputs.samples.is_some();
        self.statistics.with_if(Recorded::Features, stores)
    }
}
