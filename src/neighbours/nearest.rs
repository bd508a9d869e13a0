//! The nearest pixels, whatever they show.

use super::{Choice, KernelKind, Parameter};

/// `nearest`.
pub const KERNEL: KernelKind = KernelKind {
    id: "nearest",
    summary: "the k nearest pixels of a window of 5x5",
    k: 8,
    parameters: &[Parameter::K],
    pilot: None,
    select: |pilot, selector| Choice::unweighted(vec![(1 << selector.k) - 1; pilot.pixels()]),
};
