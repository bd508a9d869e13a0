//! Relative mean squared error (Rousselle et al. 2011), over channels.

use super::{Metric, average};

/// Keeps dark pixels from deciding everything.
const EPSILON: f64 = 0.01;

/// Mean over pixels and channels of (I - R)² / (R² + 0.01).
pub const METRIC: Metric = Metric {
    id: "relmse",
    summary: "mean of (I - R)² / (R² + 0.01) over channels",
    measure: |image, reference| average(image, reference, |a, b| (a - b) * (a - b) / (b * b + EPSILON)),
};
