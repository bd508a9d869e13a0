//! The cross: the four direct neighbours of every pixel (Lehtinen et al. 2013).

use super::KernelKind;
use crate::film::CROSS;

/// `cross`.
pub const KERNEL: KernelKind = KernelKind {
    id: "cross",
    summary: "the four direct neighbours",
    k: CROSS.count_ones(),
    pilot: None,
    select: |frame, _| vec![CROSS; frame.width * frame.height],
};
