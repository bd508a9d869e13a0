//! Groups of emitters whose light is recorded by itself.

use glob::Pattern;

use crate::error::{Error, Result};

/// A partition of a scene's emitters; empty where no light is recorded by itself.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LightGroups {
    names: Vec<String>,
    /// Group of every emitter.
    of_emitter: Vec<u8>,
}

/// Largest number of groups.
pub const MOST_GROUPS: usize = 32;

impl LightGroups {
    /// Parses `key=lamp*,fill=window*,rest`: a group and a pattern for the names of its emitters, with `*` for any letters and
    /// `?` for one; a group without a pattern has the emitters that are in none before. A group may be named several times. The
    /// error says which emitters are in no group, and which patterns fit none.
    pub fn parse(text: &str, emitters: &[impl AsRef<str>]) -> Result<Self> {
        let mut names: Vec<String> = Vec::new();
        let mut of_emitter = vec![None; emitters.len()];
        for part in text.split(',').map(str::trim) {
            let (name, pattern) = part.split_once('=').unwrap_or((part, "*"));
            let legal = |c: char| c.is_alphanumeric() || "_-".contains(c);
            if name.is_empty() || !name.chars().all(legal) {
                let what =
                    format!("`{name}` is no name of a light group: letters, digits, _ and -, as in `key=lamp*,rest`");
                return Err(Error::Usage(what));
            }
            let fits = Pattern::new(pattern).map_err(|why| Error::Usage(format!("light group `{part}`: {why}")))?;
            let group = names.iter().position(|other| other == name).unwrap_or_else(|| {
                names.push(name.to_owned());
                names.len() - 1
            });
            let fitting: Vec<_> = (0..emitters.len()).filter(|&k| fits.matches(emitters[k].as_ref())).collect();
            if fitting.is_empty() && pattern != "*" {
                let known = listed(emitters.iter().map(AsRef::as_ref));
                return Err(Error::Usage(format!(
                    "light group `{part}` fits no emitter of the scene: there are {known}"
                )));
            }
            for k in fitting {
                of_emitter[k].get_or_insert(group as u8);
            }
        }
        if names.len() > MOST_GROUPS {
            return Err(Error::Usage(format!("{} light groups; there may be {MOST_GROUPS}", names.len())));
        }
        let left = emitters.iter().zip(&of_emitter).filter(|(_, group)| group.is_none());
        let left: Vec<_> = left.map(|(name, _)| name.as_ref()).collect();
        if !left.is_empty() {
            let left = listed(left.into_iter());
            return Err(Error::Usage(format!(
                "no light group has the emitters {left}: add one without a pattern, as in `,rest`"
            )));
        }
        Ok(Self { names, of_emitter: of_emitter.into_iter().flatten().collect() })
    }

    /// Names of the groups.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Number of groups.
    pub fn count(&self) -> usize {
        self.names.len()
    }

    /// The group of an emitter.
    #[inline]
    pub fn of(&self, emitter: u32) -> usize {
        usize::from(self.of_emitter[emitter as usize])
    }
}

/// Some names, the first few of them if there are many.
fn listed<'a>(names: impl ExactSizeIterator<Item = &'a str>) -> String {
    const SHOWN: usize = 12;
    let more = names.len().saturating_sub(SHOWN);
    let mut shown: Vec<_> = names.take(SHOWN).map(|name| format!("`{name}`")).collect();
    if more > 0 {
        shown.push(format!("{more} more"));
    }
    if shown.is_empty() { "none".into() } else { shown.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EMITTERS: [&str; 4] = ["lamp_1", "lamp_2", "window", "sun"];

    #[test]
    fn the_first_group_that_fits_has_the_emitter() {
        let groups = LightGroups::parse("key=lamp_?, fill=w*,rest,key=sun", &EMITTERS).unwrap();
        assert_eq!(groups.names(), ["key", "fill", "rest"]);
        assert_eq!([0, 1, 2, 3].map(|emitter| groups.of(emitter)), [0, 0, 1, 2]);
        let groups = LightGroups::parse("a=*amp*,a=sun,b=window", &EMITTERS).unwrap();
        assert_eq!([0, 1, 2, 3].map(|emitter| groups.of(emitter)), [0, 0, 1, 0]);
        assert_eq!(LightGroups::parse("all", &[""; 0]).unwrap().count(), 1);
    }

    #[test]
    fn faults_say_what_there_is() {
        let many = (0..33).map(|k| format!("g{k}")).collect::<Vec<_>>().join(",");
        for (text, expected) in [
            ("key=lamp*", "no light group has the emitters `window`, `sun`: add one"),
            ("key=spot*,rest", "fits no emitter of the scene: there are `lamp_1`, `lamp_2`, `window`, `sun`"),
            ("=lamp*", "no name of a light group"),
            ("a.b=lamp*", "`a.b` is no name"),
            ("key=[,rest", "light group `key=[`"),
            (many.as_str(), "33 light groups"),
        ] {
            let error = LightGroups::parse(text, &EMITTERS).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
    }
}
