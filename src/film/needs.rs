//! Statistics that a film records: asked for by methods, decided by the plan.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::Error as _;
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::{Map, Value, json};

use super::statistics::{RECORDED, Recorded, STATISTICS};
use super::tile::CROSS;

/// Statistics that a method asks for besides the colour, or that a film records. In files an object: `true` or `false` by the name of every
/// statistic of [`RECORDED`], `edges` and `lights`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Needs {
    /// Statistics of the table.
    pub recorded: RecordedSet,
    /// Differences to the neighbouring pixels with their variances.
    pub edges: EdgeNeed,
    /// Number of groups of emitters whose light is recorded by itself.
    pub lights: u8,
}

/// A set of statistics.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RecordedSet(u32);

/// How a film gets the differences between pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum EdgeNeed {
    /// There are none.
    #[default]
    Off,
    /// The scene scatters no light, so every difference is zero: nothing is sampled, and frames hold zeros.
    KnownZero,
    /// They are sampled by shifted paths, in fewer samples where that is costly.
    Thinned,
    /// They are sampled by shifted paths, in every sample.
    Sampled,
}

impl EdgeNeed {
    /// Whether paths have to be shifted.
    pub fn is_sampled(self) -> bool {
        self >= Self::Thinned
    }

    /// Whether frames have differences, sampled or not.
    pub fn is_on(self) -> bool {
        self != Self::Off
    }
}

impl Needs {
    /// Colour alone.
    pub const NONE: Self = Self { recorded: RecordedSet(0), edges: EdgeNeed::Off, lights: 0 };

    /// Colour and sampled edges.
    pub const EDGES: Self = Self { edges: EdgeNeed::Sampled, ..Self::NONE };

    /// Everything that can be recorded of a scene without groups of emitters.
    pub const ALL: Self = Self { recorded: RecordedSet((1 << RECORDED.len()) - 1), ..Self::EDGES };

    /// These and a statistic.
    #[must_use]
    pub const fn with(self, statistic: Recorded) -> Self {
        Self { recorded: RecordedSet(self.recorded.0 | 1 << statistic as u32), ..self }
    }

    /// These and, if a condition holds, a statistic.
    #[must_use]
    pub const fn with_if(self, statistic: Recorded, condition: bool) -> Self {
        if condition { self.with(statistic) } else { self }
    }

    /// Whether a statistic is among them.
    pub const fn has(self, statistic: Recorded) -> bool {
        self.recorded.0 >> statistic as u32 & 1 == 1
    }

    /// Whether surfaces have to be described that camera paths come to.
    pub const fn describe_surfaces(self) -> bool {
        self.recorded.0 & Recorded::OF_SURFACES != 0
    }

    /// Bytes per pixel of a film with the edges of the cross, as long as the camera sees no emitter directly; 24 more where it
    /// does.
    pub fn bytes_per_pixel(self) -> usize {
        let counts = size_of::<u32>() * (1 + usize::from(self.edges.is_sampled()));
        let recorded = STATISTICS.iter().filter(|statistic| statistic.is_recorded(self) && statistic.sparse.is_none());
        counts
            + recorded
                .map(|statistic| size_of::<f32>() * statistic.span(0, &CROSS, usize::from(self.lights)).len())
                .sum::<usize>()
    }

    /// The same, with sampled differences in every sample.
    #[must_use]
    pub fn with_every_difference(self) -> Self {
        let edges = if self.edges.is_sampled() { EdgeNeed::Sampled } else { self.edges };
        Self { edges, ..self }
    }

    /// Whether everything that `other` asks for is recorded.
    pub fn cover(self, other: Self) -> bool {
        self.union(other) == self
    }

    /// Everything that either asks for.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self {
            recorded: RecordedSet(self.recorded.0 | other.recorded.0),
            edges: self.edges.max(other.edges),
            lights: self.lights.max(other.lights),
        }
    }
}

const EDGES: &str = "edges";
const LIGHTS: &str = "lights";

impl Serialize for Needs {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let mut map = to.serialize_map(None)?;
        RECORDED.iter().try_for_each(|row| map.serialize_entry(row.name, &self.has(row.id)))?;
        map.serialize_entry(EDGES, &self.edges)?;
        map.serialize_entry(LIGHTS, &self.lights)?;
        map.end()
    }
}

impl<'de> Deserialize<'de> for Needs {
    /// Statistics that are not named are not recorded: files that were written before there were any lack their names.
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let mut needs = Self::NONE;
        for (name, value) in Map::deserialize(from)? {
            let wrong = |error: serde_json::Error| D::Error::custom(format!("{name}: {error}"));
            match (name.as_str(), RECORDED.iter().find(|row| row.name == name)) {
                (_, Some(row)) => needs = needs.with_if(row.id, serde_json::from_value(value).map_err(wrong)?),
                (EDGES, _) => needs.edges = serde_json::from_value(value).map_err(wrong)?,
                (LIGHTS, _) => needs.lights = serde_json::from_value(value).map_err(wrong)?,
                _ => return Err(D::Error::custom(format!("statistic `{name}` is not known"))),
            }
        }
        Ok(needs)
    }
}

impl JsonSchema for Needs {
    fn schema_name() -> Cow<'static, str> {
        "Needs".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let recorded = |help: &str| json!({"type": "boolean", "description": format!("Whether it has {help}.")});
        let mut properties: Map<_, _> = RECORDED.iter().map(|row| (row.name.to_owned(), recorded(row.help))).collect();
        properties.insert(EDGES.into(), Value::from(generator.subschema_for::<EdgeNeed>()));
        properties.insert(LIGHTS.into(), Value::from(generator.subschema_for::<u8>()));
        schemars::json_schema!({"type": "object", "description": "Statistics of a film.", "properties": properties})
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn needs_are_read_back_from_files_and_from_those_that_lack_new_names() {
        let needs = Needs { lights: 3, ..Needs::EDGES }.with(Recorded::Position);
        let text = serde_json::to_string(&needs).unwrap();
        assert!(text.contains(r#""position":true"#) && text.contains(r#""edges":"sampled","lights":3"#), "{text}");
        assert_eq!(serde_json::from_str::<Needs>(&text).unwrap(), needs);
        let before =
            r#"{"features":true,"edges":"thinned","bins":false,"occlusion":false,"position":false,"ambient":false}"#;
        let thinned = Needs { edges: EdgeNeed::Thinned, ..Needs::NONE };
        assert_eq!(serde_json::from_str::<Needs>(before).unwrap(), thinned.with(Recorded::Features));
        assert!(serde_json::from_str::<Needs>(r#"{"motion":true}"#).unwrap_err().to_string().contains("`motion`"));
    }

    #[test]
    fn a_union_has_what_either_has() {
        let (a, b) = (Needs::EDGES.with(Recorded::Bins), Needs::NONE.with(Recorded::Alpha));
        assert!(a.union(b).has(Recorded::Bins) && a.union(b).has(Recorded::Alpha) && !a.has(Recorded::Alpha));
        assert!(a.union(b).cover(b) && !b.cover(a) && Needs::ALL.cover(a));
    }
}
