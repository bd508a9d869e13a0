//! Shift mappings: maps from the paths of a pixel to paths of its neighbours, and the differences of their
//! contributions. The README beside this file derives the estimator.

pub mod reconnect;
mod replay;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::camera::CameraSamples;
use super::half_edges::HalfEdges;
use super::record::PathRecord;
use super::tracer::PathTracer;

/// A map from paths of a pixel to paths of its neighbours, with its scratch memory.
pub trait ShiftMapping: Send {
    /// Whether the vertices of base paths have to be recorded.
    fn needs_vertices(&self) -> bool;

    /// Shifts the recorded base paths of a wave across their half-edges and adds this end's share of every edge to the
    /// differences, which are zero before, and stay so across the film's border.
    fn shift(
        &mut self,
        tracer: &mut PathTracer,
        camera: &CameraSamples,
        record: &mut PathRecord,
        edges: &mut HalfEdges,
    );
}

/// A row of the table of shift mappings.
pub struct ShiftKind {
    /// Name in `--shift`.
    pub id: &'static str,
    /// Description for help texts.
    pub summary: &'static str,
    /// Whether one end determines an edge: shifted paths cover all paths of the other end.
    one_sided: bool,
    /// Builds it, from the roughness threshold and whether the ambient light's differences are recorded, too.
    make: fn(f32, bool) -> Box<dyn ShiftMapping>,
}

/// Every shift mapping, the default first.
pub const SHIFTS: &[ShiftKind] = &[reconnect::SHIFT, replay::SHIFT];

/// Default threshold: a material whose smooth lobes are all rougher counts as diffuse.
const THRESHOLD: f32 = 0.001;

/// A shift mapping with its parameter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "(String, f32)", into = "(String, f32)")]
#[schemars(with = "(String, f32)")]
pub struct Shift {
    /// Position in [`SHIFTS`].
    kind: usize,
    /// A material whose smooth lobes are all rougher counts as diffuse.
    threshold: f32,
}

impl Shift {
    /// The shift mapping of a name, if there is one.
    pub fn named(id: &str) -> Option<Self> {
        let kind = SHIFTS.iter().position(|kind| kind.id == id)?;
        Some(Self { kind, threshold: THRESHOLD })
    }

    /// The same with another roughness threshold.
    pub fn with_threshold(self, threshold: f32) -> Self {
        Self { threshold, ..self }
    }

    /// Name in `--shift`.
    pub fn id(self) -> &'static str {
        SHIFTS[self.kind].id
    }

    /// Whether one end determines an edge, so that edges may be sampled from there alone.
    pub fn is_one_sided(self) -> bool {
        SHIFTS[self.kind].one_sided
    }

    /// Builds the mapping. `ambient`: record differences of the ambient light, too.
    pub(super) fn mapping(self, ambient: bool) -> Box<dyn ShiftMapping> {
        (SHIFTS[self.kind].make)(self.threshold, ambient)
    }
}

impl Default for Shift {
    fn default() -> Self {
        Self { kind: 0, threshold: THRESHOLD }
    }
}

impl TryFrom<(String, f32)> for Shift {
    type Error = String;

    fn try_from((id, threshold): (String, f32)) -> Result<Self, String> {
        let shift = Self::named(&id).ok_or_else(|| format!("shift `{id}` is not known"))?;
        Ok(shift.with_threshold(threshold))
    }
}

impl From<Shift> for (String, f32) {
    fn from(shift: Shift) -> Self {
        (shift.id().to_owned(), shift.threshold)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shifts_survive_serialisation() {
        for kind in SHIFTS {
            let shift = Shift::named(kind.id).unwrap().with_threshold(0.25);
            let text = serde_json::to_string(&shift).unwrap();
            assert_eq!(serde_json::from_str::<Shift>(&text).unwrap(), shift);
        }
        assert!(serde_json::from_str::<Shift>(r#"["nosuch", 0.1]"#).is_err());
    }
}
