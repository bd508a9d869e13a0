//! Kernels: the neighbours that the paths of every pixel are shifted to, chosen after a few samples without differences.
//!
//! ```text
//! Frame of the pilot --Selector--> masks over a window of 5x5 --closure--> film::Neighbours
//! ```

mod cross;
mod nearest;
mod random;
mod structure;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::film::{Frame, Needs, Neighbours, STEPS};

/// A row of the table of kernels.
pub struct KernelKind {
    /// Name in `--kernel`.
    pub id: &'static str,
    /// Description for help texts.
    pub summary: &'static str,
    /// Number of neighbours when not given.
    pub k: u32,
    /// Statistics of the pilot that it looks at; none if it needs no pilot.
    pilot: Option<Needs>,
    /// Chooses masks over [`STEPS`] by the pilot.
    select: fn(&Frame, &Selector) -> Vec<u32>,
}

/// Every kernel, the default first.
pub const KERNELS: &[KernelKind] = &[cross::KERNEL, nearest::KERNEL, structure::KERNEL, random::KERNEL];

/// Samples of a pilot, unless told otherwise.
pub const PILOT: u32 = 4;

/// A kernel with its parameters.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "(String, u32)", into = "(String, u32)")]
pub struct Selector {
    /// Position in [`KERNELS`].
    kind: usize,
    /// Most neighbours that a pixel chooses.
    k: u32,
    /// Least similarity of a neighbour, for kernels that compare pixels.
    threshold: f32,
    /// Samples of every pixel before the choice.
    pilot: u32,
}

impl Selector {
    /// The kernel that a text such as `structure:k=4` names, with pilots of so many samples where it needs one.
    pub fn parse(text: &str, pilot: u32) -> Result<Self> {
        let (id, parameters) = text.split_once(':').unwrap_or((text, ""));
        let kind = KERNELS.iter().position(|kind| kind.id == id).ok_or_else(|| {
            let names: Vec<_> = KERNELS.iter().map(|kind| kind.id).collect();
            Error::Usage(format!("kernel `{id}` is not known; there are {}", names.join(", ")))
        })?;
        let row = &KERNELS[kind];
        let pilot = if row.pilot.is_some() { pilot } else { 0 };
        let mut made = Self { kind, k: row.k, threshold: structure::THRESHOLD, pilot };
        for part in parameters.split(',').filter(|part| !part.is_empty()) {
            let wrong =
                || Error::Usage(format!("`{part}` of kernel `{id}` is not one of its parameters; {}", row.takes()));
            let (name, value) = part.split_once('=').ok_or_else(wrong)?;
            let most = STEPS.len() as u32;
            match name {
                "k" if row.takes_k() => {
                    made.k = value.parse().ok().filter(|k| (1..=most).contains(k)).ok_or_else(wrong)?
                }
                "threshold" if row.takes_threshold() => {
                    made.threshold = value.parse().ok().filter(|t| (0.0..=1.0).contains(t)).ok_or_else(wrong)?;
                }
                _ => return Err(wrong()),
            }
        }
        Ok(made)
    }

    fn row(&self) -> &'static KernelKind {
        &KERNELS[self.kind]
    }

    /// Whether the neighbours are the four direct ones of every pixel.
    pub fn is_cross(&self) -> bool {
        self.kind == 0
    }

    /// The kernel for headers: nothing for the cross.
    pub fn name(&self) -> String {
        if self.is_cross() { String::new() } else { self.to_string() }
    }

    /// Samples that every pixel has before its neighbours are chosen; zero if they do not depend on any.
    pub fn pilot(&self) -> u32 {
        self.pilot
    }

    /// Statistics that the choice depends on.
    pub fn needs(&self) -> Needs {
        self.row().pilot.unwrap_or_default()
    }

    /// Chooses the neighbours of every pixel. Unless edges may be `directed`, pixels that were chosen choose back.
    pub fn select(&self, pilot: &Frame, directed: bool) -> Neighbours {
        Neighbours::new((pilot.width, pilot.height), (self.row().select)(pilot, self), directed)
    }
}

impl KernelKind {
    fn takes_k(&self) -> bool {
        self.id != cross::KERNEL.id
    }

    fn takes_threshold(&self) -> bool {
        self.id == structure::KERNEL.id
    }

    /// The parameters that it takes, for messages and tables.
    pub fn takes(&self) -> String {
        match (self.takes_k(), self.takes_threshold()) {
            (false, _) => "it has none".to_owned(),
            (true, false) => format!("it has k, a number from 1 to {}", STEPS.len()),
            (true, true) => format!("it has k, a number from 1 to {}, and threshold, from 0 to 1", STEPS.len()),
        }
    }
}

impl Default for Selector {
    fn default() -> Self {
        Self { kind: 0, k: KERNELS[0].k, threshold: structure::THRESHOLD, pilot: 0 }
    }
}

impl std::fmt::Display for Selector {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let row = self.row();
        f.write_str(row.id)?;
        if row.takes_k() {
            write!(f, ":k={}", self.k)?;
        }
        if row.takes_threshold() {
            write!(f, ",threshold={}", self.threshold)?;
        }
        Ok(())
    }
}

impl TryFrom<(String, u32)> for Selector {
    type Error = Error;

    fn try_from((text, pilot): (String, u32)) -> Result<Self> {
        Self::parse(&text, pilot)
    }
}

impl From<Selector> for (String, u32) {
    fn from(selector: Selector) -> Self {
        (selector.to_string(), selector.pilot)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernels_survive_serialisation_and_refuse_what_they_do_not_take() {
        for kind in KERNELS {
            let selector = Selector::parse(kind.id, 6).unwrap();
            let text = serde_json::to_string(&selector).unwrap();
            assert_eq!(serde_json::from_str::<Selector>(&text).unwrap(), selector);
            assert_eq!(selector.pilot(), if kind.id == "structure" { 6 } else { 0 });
        }
        assert_eq!(
            Selector::parse("structure:k=7,threshold=0.5", 1).unwrap().to_string(),
            "structure:k=7,threshold=0.5"
        );
        for wrong in [
            "no",
            "cross:k=4",
            "random:k=0",
            "random:k=25",
            "nearest:threshold=0.1",
            "structure:threshold=2",
            "random:k",
        ] {
            assert!(matches!(Selector::parse(wrong, 1), Err(Error::Usage(_))), "{wrong}");
        }
    }
}
