//! Mean squared error.

use super::{Metric, average};

/// Mean over pixels and channels of (I - R)².
pub const METRIC: Metric = Metric {
    id: "mse",
    summary: "mean squared error over channels",
    measure: |image, reference| average(image, reference, |a, b| (a - b) * (a - b)),
};
