//! Provenance of images: scene, seed, samples, method and version, as header attributes of their files.

/// Header attributes of everything that is written; empty where something is not known.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Provenance {
    /// Version of Fluxion.
    pub version: String,
    /// Number of the samples, which changes when any bit of any sample does.
    pub epoch: String,
    /// Name of the scene file.
    pub scene: String,
    /// Hash of the scene's text, in hexadecimal.
    pub fingerprint: String,
    /// Seeds of the random numbers, with spaces between them.
    pub seed: String,
    /// Mean number of samples per pixel.
    pub spp: String,
    /// Seconds of rendering.
    pub seconds: String,
    /// Reconstruction with its parameters.
    pub method: String,
    /// Summary of the plan: what was computed and what was left out.
    pub plan: String,
    /// Neighbours that paths were shifted to, if not the cross.
    pub kernel: String,
}

/// Prefix of the attributes' names.
const PREFIX: &str = "fluxion:";

impl Provenance {
    /// Names of the attributes, in the order of the fields.
    pub const NAMES: [&'static str; 10] = [
        "fluxion:version",
        "fluxion:epoch",
        "fluxion:scene",
        "fluxion:fingerprint",
        "fluxion:seed",
        "fluxion:spp",
        "fluxion:seconds",
        "fluxion:method",
        "fluxion:plan",
        "fluxion:kernel",
    ];

    /// Provenance of something that this version of the program makes.
    pub fn new() -> Self {
        Self { version: env!("CARGO_PKG_VERSION").into(), ..Self::default() }
    }

    fn values(&mut self) -> [&mut String; 10] {
        [
            &mut self.version,
            &mut self.epoch,
            &mut self.scene,
            &mut self.fingerprint,
            &mut self.seed,
            &mut self.spp,
            &mut self.seconds,
            &mut self.method,
            &mut self.plan,
            &mut self.kernel,
        ]
    }

    /// Names and values of everything that is known.
    pub fn attributes(&self) -> Vec<(String, String)> {
        let mut copy = self.clone();
        let pairs = Self::NAMES.into_iter().zip(copy.values());
        pairs.filter(|(_, value)| !value.is_empty()).map(|(name, value)| (name.to_owned(), value.clone())).collect()
    }

    /// Reads the attributes of a file; others than [`Provenance::NAMES`] are ignored.
    pub fn from_attributes(attributes: &[(String, String)]) -> Self {
        let mut provenance = Self::default();
        for (name, slot) in Self::NAMES.into_iter().zip(provenance.values()) {
            if let Some((_, value)) = attributes.iter().find(|(other, _)| other == name) {
                slot.clone_from(value);
            }
        }
        provenance
    }

    /// Name of a further attribute of this kind.
    pub fn name(key: &str) -> String {
        format!("{PREFIX}{key}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attributes_are_read_back_and_unknown_ones_are_left_out() {
        let provenance = Provenance { seed: "3 4".into(), method: "l2".into(), ..Provenance::new() };
        let mut attributes = provenance.attributes();
        assert_eq!(attributes.len(), 3);
        assert!(attributes.iter().all(|(name, _)| name.starts_with(PREFIX)));
        attributes.push((Provenance::name("floor"), "1e-4".into()));
        assert_eq!(Provenance::from_attributes(&attributes), provenance);
    }
}
