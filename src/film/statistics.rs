//! The tables of statistics: what can be asked for, by [`Recorded`], and everything that a film accumulates per pixel for it.
//! Needs, options, plans, parts of data sets, checkpoint files and Python's keywords are made of these rows;
//! [`layer`](super::layer) says which images are developed from which statistic.

use super::statistic::Statistic;
use super::{EdgeNeed, Needs};
use crate::math::Rgb;

/// A statistic that can be asked for, by its row in [`RECORDED`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Recorded {
    /// Albedo, normal and depth with their variances.
    Features,
    /// Means of the [`BINS`](super::BINS) sample groups, of colour and of edges.
    Bins,
    /// Ambient occlusion with its variance.
    Occlusion,
    /// World position with its variance.
    Position,
    /// Bins of the radiance that an ambient light would add, and of its differences.
    Ambient,
    /// Share of every pixel that is covered.
    Alpha,
}

/// A row of [`RECORDED`].
#[derive(Clone, Copy, Debug)]
pub struct RecordedInfo {
    /// The statistic.
    pub id: Recorded,
    /// Name in options, plans, data sets, files and Python.
    pub name: &'static str,
    /// Description for help texts.
    pub help: &'static str,
    /// Who asks for it.
    pub asker: Asker,
    /// Whether it describes the surfaces that camera paths come to.
    of_surfaces: bool,
    /// Number of a sample's [`Values`](super::Values) that it is of.
    values: usize,
}

/// Who asks for a statistic, besides methods.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Asker {
    /// Whoever saves layers.
    Layers,
    /// Whoever saves layers, by an option of its name.
    Option,
    /// The scene's film, by its pixel format: reasons why it is recorded, and why not.
    Film(&'static str, &'static str),
}

const fn row(id: Recorded, name: &'static str, asker: Asker, help: &'static str) -> RecordedInfo {
    RecordedInfo { id, name, help, asker, of_surfaces: false, values: 0 }
}

impl RecordedInfo {
    /// The row of a statistic of values that samples have for it alone.
    const fn of_values(self, values: usize) -> Self {
        Self { values, ..self }
    }

    /// The row of a statistic of the surfaces that camera paths come to.
    const fn of_surfaces(self) -> Self {
        Self { of_surfaces: true, ..self }
    }
}

/// Every statistic that can be asked for, in the order of [`Recorded`].
pub const RECORDED: &[RecordedInfo] = &[
    row(Recorded::Features, "features", Asker::Layers, "albedo, normal and depth").of_surfaces(),
    row(
        Recorded::Bins,
        "bins",
        Asker::Option,
        "the statistics of eight groups of samples, the even ones independent of the odd ones",
    ),
    row(Recorded::Occlusion, "occlusion", Asker::Option, "ambient occlusion").of_values(1).of_surfaces(),
    row(Recorded::Position, "position", Asker::Option, "world positions").of_values(3).of_surfaces(),
    row(
        Recorded::Ambient,
        "ambient",
        Asker::Option,
        "the radiance that an ambient light would add, by which `feature:ambient` sees unlit surfaces",
    ),
    row(
        Recorded::Alpha,
        "alpha",
        Asker::Film("the film's pixel_format has alpha", "the film's pixel_format has none"),
        "the share of every pixel that is covered",
    )
    .of_values(1),
];

impl Recorded {
    /// The statistic's row.
    pub const fn info(self) -> &'static RecordedInfo {
        &RECORDED[self as usize]
    }

    /// Set of the statistics that describe the surfaces that camera paths come to, as bits by their positions in the table.
    pub(super) const OF_SURFACES: u32 = {
        let (mut bits, mut k) = (0, 0);
        while k < RECORDED.len() {
            bits |= (RECORDED[k].of_surfaces as u32) << k;
            k += 1;
        }
        bits
    };

    /// Position of the statistic's values among those that samples have for statistics.
    pub(super) const fn offset(self) -> usize {
        let (mut offset, mut k) = (0, 0);
        while k < self as usize {
            offset += RECORDED[k].values;
            k += 1;
        }
        offset
    }
}

/// Number of values that samples have for statistics.
pub(super) const VALUES: usize = {
    let (mut sum, mut k) = (0, 0);
    while k < RECORDED.len() {
        sum += RECORDED[k].values;
        k += 1;
    }
    sum
};

/// Rows of [`STATISTICS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Record {
    Color,
    Direct,
    /// Albedo, normal and depth.
    Surface,
    Occlusion,
    Position,
    /// One end's share of the differences, of every half-edge.
    Edges,
    ColorBins,
    EdgeBins,
    AmbientBins,
    AmbientEdgeBins,
    Alpha,
    /// Scattered and directly seen light of every group of emitters.
    Lights,
}

/// Values of a group of emitters: three of its scattered light, then three of what is directly seen.
pub(super) const LIGHT: usize = 6;

/// Every statistic, in the order of [`Record`] and of checkpoint files: new ones come last.
pub(super) const STATISTICS: &[Statistic] = &[
    Statistic::moments(3, |slot, taken| slot.add(taken.sample.color.to_array())),
    Statistic::moments(3, |slot, taken| slot.add(taken.sample.direct.to_array()))
        .sparse(|sample| sample.direct != Rgb::ZERO),
    Statistic::moments(7, |slot, taken| slot.add(taken.sample.features.surface())).asked(Recorded::Features),
    Statistic::moments(1, |slot, taken| slot.add(taken.sample.values.get::<1>(Recorded::Occlusion)))
        .asked(Recorded::Occlusion),
    Statistic::moments(3, |slot, taken| slot.add(taken.sample.values.get::<3>(Recorded::Position)))
        .asked(Recorded::Position),
    Statistic::moments(3, |slot, taken| slot.add_colors(taken.colors())).of_edges(),
    Statistic::bins(3, |slot, taken| slot.add_to_bin(taken.sample.color.to_array())).asked(Recorded::Bins),
    Statistic::bins(3, |slot, taken| slot.add_colors_to_bin(taken.colors())).asked(Recorded::Bins).of_edges(),
    Statistic::bins(3, |slot, taken| slot.add_to_bin(taken.sample.ambient.to_array())).asked(Recorded::Ambient),
    Statistic::bins(3, |slot, taken| slot.add_colors_to_bin(taken.ambients())).asked(Recorded::Ambient).of_edges(),
    Statistic::moments(1, |slot, taken| slot.add(taken.sample.values.get::<1>(Recorded::Alpha)))
        .asked(Recorded::Alpha)
        .since(3),
    Statistic::moments(LIGHT, |slot, taken| {
        slot.add_all(LIGHT * taken.lights.len(), taken.lights.iter().flat_map(|light| light.values()));
    })
    .of_lights()
    .since(5),
];

/// Version of checkpoint files that was the first to have all statistics.
pub const NEWEST: u32 = {
    let (mut newest, mut k) = (0, 0);
    while k < STATISTICS.len() {
        if STATISTICS[k].since > newest {
            newest = STATISTICS[k].since;
        }
        k += 1;
    }
    newest
};

impl Record {
    pub fn statistic(self) -> &'static Statistic {
        &STATISTICS[self as usize]
    }

    /// Whether a film with these needs has the statistic.
    pub fn is_recorded(self, needs: Needs) -> bool {
        self.statistic().is_recorded(needs)
    }

    /// Whether the statistic is not recorded because all of its values are known to be zero, in a scene that scatters no
    /// light. The ambient light is no part of the scene.
    pub fn is_known_zero(self, needs: Needs) -> bool {
        if self == Self::AmbientEdgeBins {
            return false;
        }
        let sampled = Needs { edges: EdgeNeed::Sampled, ..needs };
        needs.edges == EdgeNeed::KnownZero && self.statistic().of_edges && self.is_recorded(sampled)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_in_the_order_of_their_names() {
        let names = [
            (Record::Color, 3),
            (Record::Direct, 3),
            (Record::Surface, 7),
            (Record::Occlusion, 1),
            (Record::Position, 3),
            (Record::Edges, 3),
            (Record::ColorBins, 3),
            (Record::EdgeBins, 3),
            (Record::AmbientBins, 3),
            (Record::AmbientEdgeBins, 3),
            (Record::Alpha, 1),
            (Record::Lights, LIGHT),
        ];
        assert_eq!(names.len(), STATISTICS.len());
        for (k, (record, values)) in names.into_iter().enumerate() {
            assert_eq!((record as usize, record.statistic().values), (k, values));
        }
        assert!(Record::Direct.statistic().sparse.is_some() && Record::AmbientEdgeBins.statistic().of_edges);
        for (k, row) in RECORDED.iter().enumerate() {
            assert_eq!(row.id as usize, k);
            let own = STATISTICS.iter().find(|statistic| statistic.asked == Some(row.id));
            assert!(own.is_some_and(|own| [0, own.values].contains(&row.values)), "{} is of other values", row.name);
        }
        assert!(STATISTICS.is_sorted_by_key(|statistic| statistic.since), "new statistics come last");
        let after = |row: &RecordedInfo| row.id.offset() + row.values;
        assert!(RECORDED.windows(2).all(|rows| after(&rows[0]) == rows[1].id.offset()));
        assert_eq!(RECORDED.last().map(after), Some(VALUES));
        assert_eq!(STATISTICS.last().map(|statistic| statistic.since), Some(NEWEST));
    }
}
