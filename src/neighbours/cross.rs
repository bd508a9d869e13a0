//! The cross: the four direct neighbours of every pixel (Lehtinen et al. 2013).

use super::{Choice, KernelKind};
use crate::film::CROSS;

/// `cross`.
pub const KERNEL: KernelKind = KernelKind {
    id: "cross",
    summary: "the four direct neighbours",
    k: CROSS.count_ones(),
    parameters: &[],
    pilot: None,
    select: |pilot, _| Choice::unweighted(vec![CROSS; pilot.pixels()]),
};
