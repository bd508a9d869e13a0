//! Random numbers as a pure function of seed, pixel, sample and dimension.
//!
//! Even and odd samples follow a sequence each: every choice takes the first two or four dimensions of Sobol's sequence, shuffled
//! and scrambled after Owen by hashes (Burley 2020). Choices, pixels and the two sequences are scrambled apart, so that the halves
//! of the samples are independent estimates; more sequences would stratify less (docs/design/performance.md). Every
//! bounce owns its choices, whatever happened before it.
//!
//! All pixels have the same position on the film in samples of the same number: the camera's ray of a pixel is then the
//! ray that a path of its neighbour is shifted to.

use crate::math::lanes::{Bits, Lanes};
use crate::math::{Vec2, rng, vec2};

/// Sequences that samples belong to in turn.
const SEQUENCES: u32 = 2;

/// Constants that scramble the dimensions of a choice apart.
const SALTS: [u32; 4] = [0x68bc_21eb, 0x02e5_be93, 0x3c6e_f372, 0x9b05_688c];

/// Columns of the matrix of Sobol's third dimension, in reverse (primitive polynomial x² + x + 1).
const THIRD: [u32; 32] = [
    0x1, 0x3, 0x6, 0x9, 0x17, 0x3a, 0x71, 0xa3, 0x116, 0x339, 0x677, 0x9aa, 0x1601, 0x3903, 0x7706, 0xaa09, 0x10117,
    0x3033a, 0x60671, 0x909a3, 0x171616, 0x3a3939, 0x717777, 0xa3aaaa, 0x1170001, 0x33a0003, 0x6710006, 0x9a30009,
    0x16160017, 0x3939003a, 0x77770071, 0xaaaa00a3,
];

/// Columns of the matrix of Sobol's fourth dimension, in reverse (x³ + x + 1).
const FOURTH: [u32; 32] = [
    0x1, 0x3, 0x4, 0xa, 0x1f, 0x2e, 0x45, 0xc9, 0x11b, 0x2a4, 0x79a, 0xb67, 0x101e, 0x302d, 0x4041, 0xa0c3, 0x1f104,
    0x2e28a, 0x457df, 0xc9bae, 0x11a105, 0x2a7289, 0x79e7db, 0xb6dba4, 0x100011a, 0x30002a7, 0x400079e, 0xa000b6d,
    0x1f001001, 0x2e003003, 0x45004004, 0xc900a00a,
];

/// Position of all samples with one index in their sequences.
#[derive(Clone, Copy, Debug)]
pub struct Sampler {
    seed: u64,
    sequence: u64,
    /// Number within the sequence, its bits in reverse.
    reversed: u32,
}

/// Random numbers of next-event estimation at a vertex.
#[derive(Clone, Copy, Debug)]
pub struct LightNumbers {
    /// Selects the emitter.
    pub choice: Lanes,
    /// Select the point on it.
    pub point: [Lanes; 2],
}

/// Random numbers of scattering at a vertex.
#[derive(Clone, Copy, Debug)]
pub struct ScatterNumbers {
    /// Selects the lobe.
    pub lobe: Lanes,
    /// Select the direction.
    pub direction: [Lanes; 2],
    /// Decides on survival of Russian roulette.
    pub survival: Lanes,
}

impl Sampler {
    /// Sample number `index` of every pixel of a render with this seed.
    pub fn new(seed: u64, index: u32) -> Self {
        let sequence = u64::from(index % SEQUENCES);
        Self { seed: rng::mix(seed), sequence, reversed: (index / SEQUENCES).reverse_bits() }
    }

    /// Hash that keeps the numbers of pixel number `pixel` apart from those of other pixels.
    pub fn hash(&self, pixel: u64) -> u32 {
        fold(rng::combine(rng::combine(self.seed, pixel), self.sequence))
    }

    /// Position within the pixel, the same for all.
    pub fn film(&self) -> Vec2 {
        let hash = fold(rng::combine(rng::combine(self.seed, u64::MAX), self.sequence));
        let [x, y] = self.pair(Bits::splat(hash));
        vec2(x.0[0], y.0[0])
    }

    /// Positions within cells of pixels of these hashes, and hashes for the lens there; `cell` numbers the cells.
    #[inline(always)]
    pub fn cell(&self, hashes: Bits, cell: Bits) -> ([Lanes; 2], Bits) {
        let hashes = part(hashes, u32::MAX).zip(cell, |hash, cell| mix(hash ^ mix(cell)));
        (self.pair(hashes), hashes)
    }

    /// Positions on the lens for pixels of these hashes.
    #[inline(always)]
    pub fn lens(&self, hashes: Bits) -> [Lanes; 2] {
        self.pair(part(hashes, 0))
    }

    /// Random numbers of ambient occlusion's directions.
    #[inline(always)]
    pub fn occlusion(&self, hashes: Bits) -> [Lanes; 2] {
        self.pair(part(hashes, 1))
    }

    /// Next-event estimation at the vertex after `depth` scattering events.
    #[inline(always)]
    pub fn light(&self, hashes: Bits, depth: u32) -> LightNumbers {
        let [u, v, choice, _] = self.block(part(hashes, depth.wrapping_mul(2).wrapping_add(2)));
        LightNumbers { choice, point: [u, v] }
    }

    /// Scattering at that vertex.
    #[inline(always)]
    pub fn scatter(&self, hashes: Bits, depth: u32) -> ScatterNumbers {
        let [u, v, lobe, survival] = self.block(part(hashes, depth.wrapping_mul(2).wrapping_add(3)));
        ScatterNumbers { lobe, direction: [u, v], survival }
    }

    /// Two dimensions.
    #[inline(always)]
    fn pair(&self, hashes: Bits) -> [Lanes; 2] {
        let index = self.index(hashes);
        [dimension(index, hashes, SALTS[0]), dimension(second_dimension(index), hashes, SALTS[1])]
    }

    /// Four dimensions, of which the first two are the best distributed.
    #[inline(always)]
    fn block(&self, hashes: Bits) -> [Lanes; 4] {
        let index = self.index(hashes);
        // Bits that no sample so far has set would only shift all samples alike, as scrambling does.
        let set = index.zip(scramble(Bits::ZERO, hashes), |index, first| index ^ first.reverse_bits());
        let bits = (u32::BITS - self.reversed.trailing_zeros()) as usize;
        let [third, fourth] = [&THIRD, &FOURTH].map(|columns| sum_of_columns(set, &columns[..bits]));
        [
            dimension(index, hashes, SALTS[0]),
            dimension(second_dimension(index), hashes, SALTS[1]),
            dimension(third, hashes, SALTS[2]),
            dimension(fourth, hashes, SALTS[3]),
        ]
    }

    /// Numbers of the sample within shuffled sequences. Everything happens with bits in reverse, where scrambling after Owen is a hash
    /// that only carries upwards.
    #[inline(always)]
    fn index(&self, hashes: Bits) -> Bits {
        scramble(Bits::splat(self.reversed), hashes).map(u32::reverse_bits)
    }
}

/// The values of one dimension, scrambled.
#[inline(always)]
fn dimension(values: Bits, hashes: Bits, salt: u32) -> Lanes {
    let hashes = hashes.map(|hash| mix(hash ^ salt));
    scramble(values, hashes).map(u32::reverse_bits).unit()
}

fn fold(hash: u64) -> u32 {
    (hash ^ (hash >> 32)) as u32
}

#[inline(always)]
fn part(hashes: Bits, number: u32) -> Bits {
    hashes.map(|hash| mix(hash.wrapping_add(number.wrapping_mul(0x9e37_79b9))))
}

/// Mixes 32 bits so that every input bit flips every output bit with probability one half.
#[inline(always)]
fn mix(x: u32) -> u32 {
    let x = (x ^ (x >> 16)).wrapping_mul(0x21f0_aaad);
    let x = (x ^ (x >> 15)).wrapping_mul(0xd35a_2d97);
    x ^ (x >> 15)
}

/// A permutation by a hash in which each bit depends on lower bits only (Laine and Karras 2011, with the constants of
/// Vegdahl 2021).
#[inline(always)]
fn scramble(values: Bits, hashes: Bits) -> Bits {
    values.zip(hashes, |x, hash| {
        let x = x ^ x.wrapping_mul(0x3d20_adea);
        let x = x.wrapping_add(hash).wrapping_mul((hash >> 16) | 1);
        let x = x ^ x.wrapping_mul(0x0552_6c56);
        x ^ x.wrapping_mul(0x53a2_2864)
    })
}

/// Sobol's second dimension, in reverse. Its matrix is Pascal's triangle modulo 2, whose entry (j, b) is odd when the bits
/// of j are among those of b: a sum over supersets, one bit of the positions at a time.
#[inline(always)]
fn second_dimension(index: Bits) -> Bits {
    index.map(|x| {
        let x = x ^ ((x >> 1) & 0x5555_5555);
        let x = x ^ ((x >> 2) & 0x3333_3333);
        let x = x ^ ((x >> 4) & 0x0f0f_0f0f);
        let x = x ^ ((x >> 8) & 0x00ff_00ff);
        x ^ ((x >> 16) & 0x0000_ffff)
    })
}

/// A dimension of Sobol's sequence, in reverse, by its matrix.
#[inline(always)]
fn sum_of_columns(index: Bits, columns: &[u32]) -> Bits {
    let mut sum = Bits::ZERO;
    for (bit, column) in columns.iter().enumerate() {
        sum = sum.zip(index, |sum, x| sum ^ (((x >> bit) & 1).wrapping_neg() & column));
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 40 vertices' numbers of a pixel.
    fn numbers(index: u32) -> Vec<f32> {
        let sampler = Sampler::new(3, index);
        let hashes = Bits::splat(sampler.hash(705));
        let mut numbers = Vec::new();
        for depth in 0..40 {
            let LightNumbers { choice, point } = sampler.light(hashes, depth);
            let ScatterNumbers { lobe, direction, survival } = sampler.scatter(hashes, depth);
            numbers.extend([choice, survival, lobe].into_iter().chain(point).chain(direction).map(|lanes| lanes.0[5]));
        }
        numbers
    }

    #[test]
    fn numbers_are_in_range_uniform_in_every_dimension_and_repeatable() {
        let n = 4096;
        let mut means = vec![0.0f64; 280];
        for index in 0..n {
            for (mean, value) in means.iter_mut().zip(numbers(index)) {
                assert!((0.0..1.0).contains(&value));
                *mean += f64::from(value) / f64::from(n);
            }
        }
        // Five standard errors of independent numbers; the sequence does better.
        means.iter().for_each(|mean| assert!((mean - 0.5).abs() < 5.0 * (1.0 / 12.0 / f64::from(n)).sqrt()));
        assert_eq!(numbers(17), numbers(17));
        assert_ne!(numbers(17), numbers(18));
    }

    #[test]
    fn every_pair_of_dimensions_is_stratified_in_all_elementary_boxes() {
        for first in [0, 64] {
            let points: Vec<[f32; 2]> = (first..first + 64)
                .map(|i| {
                    let sampler = Sampler::new(3, SEQUENCES * i + 1);
                    let [u, v] = sampler.scatter(Bits::splat(sampler.hash(9)), 4).direction;
                    [u.0[0], v.0[0]]
                })
                .collect();
            for columns in [1, 2, 4, 8, 16, 32, 64] {
                let rows = 64 / columns;
                let mut boxes = [0; 64];
                let cell = |x: f32, n: usize| (x * n as f32) as usize;
                points.iter().for_each(|[u, v]| boxes[cell(*u, columns) * rows + cell(*v, rows)] += 1);
                assert_eq!(boxes, [1; 64], "{columns} columns");
            }
        }
    }

    #[test]
    fn four_dimensions_are_stratified_together() {
        for first in [0, 64, 65536] {
            let points = (first..first + 64).map(|i| {
                let sampler = Sampler::new(3, SEQUENCES * i);
                let ScatterNumbers { lobe, direction: [u, v], survival } =
                    sampler.scatter(Bits::splat(sampler.hash(9)), 4);
                [u, v, lobe, survival].map(|lanes| lanes.0[3])
            });
            let (mut halves, mut strata) = ([0; 16], [0u64; 4]);
            for point in points {
                halves[point.iter().fold(0, |at, &x| 2 * at + usize::from(x >= 0.5))] += 1;
                strata.iter_mut().zip(point).for_each(|(strata, x)| *strata |= 1 << (x * 64.0) as u32);
            }
            assert_eq!((halves, strata), ([4; 16], [u64::MAX; 4]), "from {first} on");
        }
    }

    #[test]
    fn halves_and_pixels_are_scrambled_apart_and_the_film_is_shared() {
        let camera = |index| Sampler::new(3, index).film();
        assert!((0..7).all(|index| camera(index) != camera(index + 1)));
        let lens = |index, pixel| {
            let sampler = Sampler::new(3, index);
            sampler.lens(Bits::splat(sampler.hash(pixel)))[0].0[0]
        };
        // Correlation over many pixels, of neighbours and of halves; five standard errors.
        let n = 4096;
        let sum = |f: &dyn Fn(u64) -> f32| (0..n).map(|i| f64::from(f(i))).sum::<f64>() / n as f64;
        let bound = 5.0 / 12.0 / (n as f64).sqrt();
        assert!(sum(&|i| (lens(0, i) - 0.5) * (lens(0, i + 1) - 0.5)).abs() < bound);
        assert!(sum(&|i| (lens(0, i) - 0.5) * (lens(1, i) - 0.5)).abs() < bound);
    }
}
