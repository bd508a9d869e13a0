//! The nearest pixels, whatever they show.

use super::KernelKind;

/// `nearest`.
pub const KERNEL: KernelKind = KernelKind {
    id: "nearest",
    summary: "the k nearest pixels of a window of 5x5",
    k: 8,
    pilot: None,
    select: |frame, selector| vec![(1 << selector.k) - 1; frame.width * frame.height],
};
