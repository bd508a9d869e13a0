//! Sources of layers: the statistic that a layer is developed from, and the position of its values in it.

use super::Needs;
use super::statistics::Record;

/// Source of a layer's values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Source {
    SampleCount,
    EdgeSampleCount,
    RejectedCount,
    /// Means of a statistic from the given value on.
    Mean(Record, usize),
    /// Variances of the means of a statistic from the given value on.
    Variance(Record, usize),
    /// Means of one bin of a statistic.
    Bin(Record),
    /// Both ends of every edge along an axis joined: means.
    EdgeMean(Record, Axis),
    /// Both ends joined: variances of the means.
    EdgeVariance(Record, Axis),
    /// Both ends joined: means of one bin.
    EdgeBin(Record, Axis),
}

/// Direction of a layer of edges, with the positions of both ends' shares among a pixel's twelve difference values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    /// Step from the near pixel of an edge to the far one.
    pub step: (usize, usize),
    /// First value at the near pixel: its share of "far minus near".
    pub near: usize,
    /// First value at the far pixel: its share of "near minus far".
    pub far: usize,
}

pub(super) const X: Axis = Axis { step: (1, 0), near: 0, far: 3 };
pub(super) const Y: Axis = Axis { step: (0, 1), near: 6, far: 9 };

impl Source {
    /// The statistic, unless the source is a count.
    pub fn record(self) -> Option<Record> {
        match self {
            Self::SampleCount | Self::EdgeSampleCount | Self::RejectedCount => None,
            Self::Mean(record, _) | Self::Variance(record, _) | Self::Bin(record) => Some(record),
            Self::EdgeMean(record, _) | Self::EdgeVariance(record, _) | Self::EdgeBin(record, _) => Some(record),
        }
    }

    /// Whether a film with these needs can develop it: from a statistic, from a count, or as a known zero.
    pub fn is_developed(self, needs: Needs) -> bool {
        self.record().is_none_or(|record| record.is_recorded(needs) || record.is_known_zero(needs))
    }
}
