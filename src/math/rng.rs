//! Hashes that turn coordinates into independent seeds and numbers.

/// Mixes 64 bits so that every input bit flips every output bit with probability one half (the finaliser of
/// SplitMix64, Steele et al. 2014).
pub fn mix(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Adds `value` to a running hash.
pub fn combine(hash: u64, value: u64) -> u64 {
    mix(hash.wrapping_add(0x9e37_79b9_7f4a_7c15).wrapping_add(value.wrapping_mul(0xd134_2543_de82_ef95)))
}

/// The top 24 bits of a hash as a float in [0, 1).
pub fn unit(hash: u64) -> f32 {
    (hash >> 40) as f32 * (1.0 / 16_777_216.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hashes_of_consecutive_numbers_are_uniform_and_uncorrelated() {
        let n = 100_000;
        let values: Vec<f64> = (0..n).map(|i| f64::from(unit(combine(7, i)))).collect();
        let mean = values.iter().sum::<f64>() / n as f64;
        let lag = values.windows(2).map(|pair| (pair[0] - 0.5) * (pair[1] - 0.5)).sum::<f64>() / n as f64;
        // Four standard errors of a uniform variable's mean and of a product of two.
        assert!((mean - 0.5).abs() < 4.0 * (1.0 / 12.0f64 / n as f64).sqrt());
        assert!(lag.abs() < 4.0 / 12.0 / (n as f64).sqrt());
    }
}
