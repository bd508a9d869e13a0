//! Layers by their rows: positions, names in files, the statistics that they need.

use super::layer::{BINNED, Info, Layer, OF_BIN, SINGLE};
use super::{BINS, Needs};

impl Layer {
    /// Whether a value below zero is a mistake, as in variances and counts. Filtered radiance may be negative.
    pub fn is_never_negative(self) -> bool {
        matches!(self, Self::Samples | Self::EdgeSamples | Self::Rejected) || self.info().name.ends_with("variance")
    }

    /// Whether films with these needs develop into it.
    pub fn is_in(self, needs: Needs) -> bool {
        self.info().source.is_developed(needs)
    }

    /// Number of layers.
    pub const COUNT: usize = SINGLE.len() + BINNED.len() * BINS;

    /// Every layer.
    pub fn all() -> impl Iterator<Item = Self> {
        let bins = (0..BINS as u8).flat_map(|k| OF_BIN.map(|layer| layer(k)));
        SINGLE.iter().map(|(layer, _)| *layer).chain(bins)
    }

    /// Position among all layers.
    pub fn index(self) -> usize {
        match self.bin() {
            Some((which, k)) => SINGLE.len() + BINNED.len() * k as usize + which,
            None => SINGLE.iter().position(|(layer, _)| *layer == self).unwrap_or_default(),
        }
    }

    /// Number of the bin that the layer belongs to, if any.
    pub fn bin_number(self) -> Option<u8> {
        self.bin().map(|(_, number)| number)
    }

    /// Row of [`BINNED`] and number of the bin, if the layer belongs to one.
    fn bin(self) -> Option<(usize, u8)> {
        match self {
            Self::BinColor(k) => Some((0, k)),
            Self::BinDx(k) => Some((1, k)),
            Self::BinDy(k) => Some((2, k)),
            Self::BinAmbient(k) => Some((3, k)),
            Self::BinAmbientDx(k) => Some((4, k)),
            Self::BinAmbientDy(k) => Some((5, k)),
            _ => None,
        }
    }

    /// The layer's row of the table; its name lacks the number of the bin.
    pub fn info(self) -> Info {
        match self.bin() {
            Some((which, _)) => BINNED[which],
            None => SINGLE[self.index()].1,
        }
    }

    /// Name in files, with the bin's number: `bin3_dx`.
    pub fn name(self) -> String {
        match self.bin() {
            Some((which, k)) => BINNED[which].name.replacen("bin", &format!("bin{k}"), 1),
            None => self.info().name.to_owned(),
        }
    }

    /// Channel names in files: `albedo.R`, or `R` for the colour.
    pub fn channel_names(self) -> Vec<String> {
        let name = self.name();
        let full = |channel: &&str| if name.is_empty() { (*channel).to_owned() } else { format!("{name}.{channel}") };
        self.info().channels.iter().map(full).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn every_layer_has_its_own_index_and_channel_names() {
        let layers: Vec<_> = Layer::all().collect();
        assert_eq!(layers.len(), Layer::COUNT);
        for (i, layer) in layers.iter().enumerate() {
            assert_eq!(layer.index(), i);
        }
        let names: HashSet<_> = layers.iter().flat_map(|layer| layer.channel_names()).collect();
        assert_eq!(names.len(), layers.iter().map(|layer| layer.info().channels.len()).sum::<usize>());
    }
}
