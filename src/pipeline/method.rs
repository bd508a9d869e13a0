//! The method of a recipe.

use std::time::Instant;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::host::Host;
use super::stats::Stats;
use crate::error::Result;
use crate::film::Frame;
use crate::reconstruct::{self, Context, Reconstruction, Solution};

/// A reconstruction, and how it is to work.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MethodRecipe {
    /// Its name with its parameters, as in `frgr:levels=2`.
    pub name: String,
    /// Limit of its memory besides the frame, in bytes. The image is the same.
    pub memory: Option<u64>,
    /// Whether intermediate images are kept.
    pub notes: bool,
}

impl Default for MethodRecipe {
    fn default() -> Self {
        Self { name: reconstruct::DEFAULT.into(), memory: None, notes: false }
    }
}

/// A reconstruction that is ready to work.
pub struct Method {
    /// Its name with its parameters.
    pub name: String,
    /// The reconstruction.
    pub made: Box<dyn Reconstruction>,
    memory: Option<u64>,
    notes: bool,
}

impl MethodRecipe {
    /// The method of a name.
    pub fn named(name: &str) -> Self {
        Self { name: name.into(), ..Self::default() }
    }

    /// Makes the method. The error lists the known ones, or their parameters.
    pub fn make(&self) -> Result<Method> {
        let Self { name, memory, notes } = self.clone();
        Ok(Method { made: reconstruct::parse(&name)?, name, memory, notes })
    }
}

impl Method {
    /// The context of a reconstruction for a host.
    pub fn context<'a>(&self, host: &Host<'a>) -> Context<'a> {
        Context { progress: host.progress, memory: self.memory, notes: self.notes }
    }

    /// Reconstructs, and takes the time.
    pub fn solve(&self, frame: &Frame, host: &Host, stats: &mut Stats) -> Result<Solution> {
        self.made.warnings(frame).iter().for_each(|warning| (host.warn)(warning));
        let start = Instant::now();
        let solution = reconstruct::solve(&*self.made, frame, &self.context(host))?;
        stats.seconds.reconstruct += start.elapsed().as_secs_f64();
        self.check_notes(&solution, host);
        Ok(solution)
    }

    /// Warns if intermediate images are asked for and there are none.
    pub(super) fn check_notes(&self, solution: &Solution, host: &Host) {
        if self.notes && solution.notes.is_empty() {
            (host.warn)(&format!("the method {} has no intermediate images", self.name));
        }
    }
}
