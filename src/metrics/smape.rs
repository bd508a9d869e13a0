//! Symmetric mean absolute percentage error.

use super::{Metric, average};

/// Keeps black on black at zero.
const EPSILON: f64 = 0.01;

/// Mean over pixels and channels of |I - R| / (|I| + |R| + 0.01): between 0 and 1.
pub const METRIC: Metric = Metric {
    id: "smape",
    summary: "mean of |I - R| / (|I| + |R| + 0.01) over channels",
    measure: |image, reference| average(image, reference, |a, b| (a - b).abs() / (a.abs() + b.abs() + EPSILON)),
};
