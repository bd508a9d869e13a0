//! Kernels with their parameters.

use serde::{Deserialize, Serialize};

use super::{Encoder, KERNELS, KernelKind, Parameter, Pilot, learned, structure};
use crate::error::{Error, Result};
use crate::film::{CROSS, Frame, Kernel, Needs, Neighbours, STEPS};
use crate::scene::sensor::Sensor;

/// A kernel with its parameters.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "(String, u32)", into = "(String, u32)")]
pub struct Selector {
    /// Position in [`KERNELS`].
    kind: usize,
    /// Most neighbours that a pixel chooses.
    pub(super) k: u32,
    /// Least similarity of a neighbour, for kernels that compare pixels.
    pub(super) threshold: f32,
    /// Whether the cross is kept, for kernels that have weights.
    pub(super) keeps_cross: bool,
    /// Samples of every pixel before the choice.
    pilot: u32,
}

impl Selector {
    /// The kernel that a text such as `structure:k=4` names, with pilots of so many samples, or of as many as it takes by itself,
    /// if it needs one.
    pub fn parse(text: &str, pilot: Option<u32>) -> Result<Self> {
        let (id, parameters) = text.split_once(':').unwrap_or((text, ""));
        let unknown = || Error::unknown("kernel", id, KERNELS.iter().map(|kind| kind.id));
        let kind = KERNELS.iter().position(|kind| kind.id == id).ok_or_else(unknown)?;
        let row = &KERNELS[kind];
        let samples = row.pilot.map_or(0, |needs| pilot.unwrap_or(needs.samples));
        let least = row.pilot.map_or(0, |needs| needs.least);
        if samples < least {
            return Err(Error::Usage(format!("kernel `{id}` needs a pilot of at least {least} samples")));
        }
        let mut made = Self { kind, k: row.k, threshold: structure::THRESHOLD, keeps_cross: false, pilot: samples };
        for part in parameters.split(',').filter(|part| !part.is_empty()) {
            made.set(part).ok_or_else(|| {
                Error::Usage(format!("`{part}` of kernel `{id}` is not one of its parameters; {}", row.takes()))
            })?;
        }
        Ok(made)
    }

    /// Sets a parameter from a text such as `k=4`, if it is one with a value.
    fn set(&mut self, text: &str) -> Option<()> {
        let (name, value) = text.split_once('=')?;
        match self.row().parameters.iter().find(|parameter| parameter.name() == name)? {
            Parameter::K => self.k = value.parse().ok().filter(|k| (1..=STEPS.len() as u32).contains(k))?,
            Parameter::Threshold => self.threshold = value.parse().ok().filter(|t| (0.0..=1.0).contains(t))?,
            Parameter::Neighbours => {
                self.keeps_cross = ["learned", "cross"].iter().position(|choice| *choice == value)? == 1;
            }
        }
        Some(())
    }

    fn row(&self) -> &'static KernelKind {
        &KERNELS[self.kind]
    }

    /// Whether the neighbours are the four direct ones of every pixel, without weights.
    pub fn is_cross(&self) -> bool {
        self.kind == 0
    }

    /// The kernel for headers: nothing for the cross.
    pub fn name(&self) -> String {
        if self.is_cross() { String::new() } else { self.to_string() }
    }

    /// Samples that every pixel has before its neighbours are chosen, or their weights; zero if these do not depend on any.
    pub fn pilot(&self) -> u32 {
        self.pilot
    }

    /// Statistics that the choice depends on.
    pub fn needs(&self) -> Needs {
        self.row().pilot.map_or(Needs::NONE, |pilot| pilot.needs)
    }

    /// An encoder of the pilot's samples after the first, whose frame gives it the scale; none if samples are not encoded.
    pub fn encoder(&self, first: &Frame, sensor: &Sensor) -> Option<Encoder> {
        self.encodes().then(|| learned::encoder(first, sensor))
    }

    /// Whether the choice depends on samples one by one.
    pub fn encodes(&self) -> bool {
        self.row().pilot.is_some_and(|pilot| pilot.encoded)
    }

    /// Neighbours that are known before the pilot, which then has differences, too, and only gives them weights; none if it
    /// chooses them. Edges may be `directed`, as by [`Selector::select`].
    pub fn known(&self, size: (usize, usize), directed: bool) -> Option<Neighbours> {
        self.keeps_cross.then(|| Neighbours::new(size, vec![CROSS; size.0 * size.1], directed))
    }

    /// Whether a film with these half-edges is still to have its neighbours, or their weights, chosen.
    pub fn is_pending(&self, kernel: &Kernel) -> bool {
        match kernel {
            Kernel::Cross => false,
            Kernel::Pending => true,
            Kernel::Chosen(neighbours) => self.keeps_cross && neighbours.weights().is_empty(),
        }
    }

    /// Samples of every pixel before the first one with differences.
    pub fn without_differences(&self) -> u32 {
        if self.keeps_cross { 0 } else { self.pilot }
    }

    /// Chooses the neighbours of every pixel. Unless edges may be `directed`, pixels that were chosen choose back.
    pub fn select(&self, pilot: &Pilot, directed: bool) -> Neighbours {
        let choice = (self.row().select)(pilot, self);
        Neighbours::new((pilot.frame.width, pilot.frame.height), choice.masks, directed).weighted(choice.weights)
    }
}

impl Default for Selector {
    fn default() -> Self {
        Self { kind: 0, k: KERNELS[0].k, threshold: structure::THRESHOLD, keeps_cross: false, pilot: 0 }
    }
}

impl std::fmt::Display for Selector {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(self.row().id)?;
        for (number, parameter) in self.row().parameters.iter().enumerate() {
            write!(f, "{}{}=", if number == 0 { ":" } else { "," }, parameter.name())?;
            match parameter {
                Parameter::K => write!(f, "{}", self.k)?,
                Parameter::Threshold => write!(f, "{}", self.threshold)?,
                Parameter::Neighbours => f.write_str(if self.keeps_cross { "cross" } else { "learned" })?,
            }
        }
        Ok(())
    }
}

impl TryFrom<(String, u32)> for Selector {
    type Error = Error;

    fn try_from((text, pilot): (String, u32)) -> Result<Self> {
        Self::parse(&text, Some(pilot))
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
            let selector = Selector::parse(kind.id, Some(6)).unwrap();
            let text = serde_json::to_string(&selector).unwrap();
            assert_eq!(serde_json::from_str::<Selector>(&text).unwrap(), selector);
            assert_eq!(selector.pilot(), if kind.pilot.is_some() { 6 } else { 0 });
        }
        for text in ["structure:k=7,threshold=0.5", "learned:k=2,neighbours=cross"] {
            assert_eq!(Selector::parse(text, None).unwrap().to_string(), text);
        }
        assert_eq!(["structure", "learned"].map(|text| Selector::parse(text, None).unwrap().pilot()), [4, 8]);
        for wrong in [
            "no",
            "cross:k=4",
            "random:k=0",
            "random:k=25",
            "nearest:threshold=0.1",
            "structure:threshold=2",
            "structure:neighbours=cross",
            "learned:neighbours=all",
            "learned",
            "random:k",
        ] {
            assert!(matches!(Selector::parse(wrong, Some(1)), Err(Error::Usage(_))), "{wrong}");
        }
    }
}
