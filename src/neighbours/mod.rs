//! Kernels: the neighbours that the paths of every pixel are shifted to, chosen after a few samples without differences.
//!
//! ```text
//! Pilot (frame, encoded samples) --Selector--> masks over a window of 5x5, weights --closure--> film::Neighbours
//! ```

mod cross;
mod learned;
mod nearest;
mod random;
mod selector;
mod structure;

pub use self::learned::Encoder;
pub use self::selector::Selector;
use crate::film::{Frame, Needs, Recorded, STEPS, StepWeights};

/// A row of the table of kernels.
pub struct KernelKind {
    /// Name in `--kernel`.
    pub id: &'static str,
    /// Description for help texts.
    pub summary: &'static str,
    /// Number of neighbours when not given.
    pub k: u32,
    /// Parameters that it takes.
    parameters: &'static [Parameter],
    /// Needs of the choice; none if neighbours do not depend on the picture.
    pilot: Option<PilotNeeds>,
    /// Chooses neighbours by a pilot.
    select: fn(&Pilot, &Selector) -> Choice,
}

/// Every kernel, the default first.
pub const KERNELS: &[KernelKind] =
    &[cross::KERNEL, nearest::KERNEL, structure::KERNEL, learned::KERNEL, random::KERNEL];

/// The part of the pilot that a kernel looks at.
#[derive(Clone, Copy)]
struct PilotNeeds {
    /// Statistics of the frame.
    needs: Needs,
    /// Samples of every pixel, when not given.
    samples: u32,
    /// Fewest samples.
    least: u32,
    /// Whether samples are encoded one by one.
    encoded: bool,
}

/// Features of the first samples.
const FEATURES: PilotNeeds =
    PilotNeeds { needs: Needs::NONE.with(Recorded::Features), samples: 4, least: 1, encoded: false };

/// The first samples of a render, without differences.
pub struct Pilot<'a> {
    /// Their frame.
    pub frame: &'a Frame,
    /// All but the first of every pixel, encoded, for kernels that ask for it.
    pub encoder: Option<&'a Encoder>,
}

impl Pilot<'_> {
    /// Number of pixels.
    fn pixels(&self) -> usize {
        self.frame.width * self.frame.height
    }
}

/// Neighbours that a kernel has chosen.
struct Choice {
    /// Masks over [`STEPS`].
    masks: Vec<u32>,
    /// Weights across all steps of every pixel, relative to its own; empty if the kernel has none.
    weights: Vec<StepWeights>,
}

impl Choice {
    fn unweighted(masks: Vec<u32>) -> Self {
        Self { masks, weights: Vec::new() }
    }
}

/// A parameter of kernels.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Parameter {
    /// Most neighbours that a pixel chooses.
    K,
    /// Least similarity of a neighbour.
    Threshold,
    /// Whether neighbours are learned, or those of the cross.
    Neighbours,
}

impl Parameter {
    fn name(self) -> &'static str {
        match self {
            Self::K => "k",
            Self::Threshold => "threshold",
            Self::Neighbours => "neighbours",
        }
    }

    /// Its values, for messages and tables.
    fn values(self) -> String {
        match self {
            Self::K => format!("k, a number from 1 to {}", STEPS.len()),
            Self::Threshold => "threshold, from 0 to 1".to_owned(),
            Self::Neighbours => "neighbours, `learned` or `cross`".to_owned(),
        }
    }
}

impl KernelKind {
    /// The parameters that it takes, for messages and tables.
    pub fn takes(&self) -> String {
        let all: Vec<_> = self.parameters.iter().map(|parameter| parameter.values()).collect();
        if all.is_empty() { "it has none".to_owned() } else { format!("it has {}", all.join(", and ")) }
    }
}
