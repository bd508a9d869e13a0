//! Neighbours at random, for tests.

use super::{Choice, KernelKind, Parameter};
use crate::film::STEPS;
use crate::math::rng;

/// `random`.
pub const KERNEL: KernelKind = KernelKind {
    id: "random",
    summary: "k pixels of a window of 5x5 at random, for tests",
    k: 4,
    parameters: &[Parameter::K],
    pilot: None,
    select: |pilot, selector| {
        Choice::unweighted((0..pilot.pixels()).map(|pixel| choose(pixel as u64, selector.k)).collect())
    },
};

/// The steps with the smallest random keys.
fn choose(pixel: u64, k: u32) -> u32 {
    let mut keys: Vec<_> = (0..STEPS.len()).map(|step| (rng::combine(rng::mix(pixel), step as u64), step)).collect();
    keys.sort_unstable();
    keys.iter().take(k as usize).fold(0, |mask, (_, step)| mask | 1 << step)
}
