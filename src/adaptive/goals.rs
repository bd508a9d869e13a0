//! Sample counts that pixels are to have, as a file, so that many machines take the samples of one adaptive render: in a first round
//! those of even counts, and in a second one those that are allocated by the first.

use std::path::Path;

use super::Allocator;
use super::allocate::{Demand, allocate};
use super::budget::{FIRST_SHARE, FIRST_SPP};
use crate::error::{Error, Result};
use crate::film::{BINS, Frame, Layer};
use crate::image::io::{Kind, Pixels, read, write};
use crate::reconstruct::{self, Context, Reconstruction};

/// Samples of every pixel in the end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Goals {
    /// Columns and rows.
    pub size: (usize, usize),
    /// Counts, row by row.
    pub counts: Vec<u32>,
}

/// Channels that counts are in: that of [`Goals::save`] and of layers, and that of images.
const CHANNELS: [&str; 2] = ["samples", "samples.Y"];

/// Largest count that a channel holds exactly.
const MOST: f32 = (1 << 24) as f32;

impl Goals {
    /// `spp` samples a pixel in the mean, allocated by those of a first round, which `frame` was developed from.
    pub fn new(
        frame: &Frame,
        spp: u32,
        (method, allocator): (&dyn Reconstruction, &dyn Allocator),
        context: &Context,
    ) -> Result<Self> {
        let by_error = allocator.needs_error();
        let solve = || reconstruct::solve(method.guide().unwrap_or(method), frame, context);
        let solution = by_error.then(solve).transpose()?;
        let need = allocator.need(frame, solution.as_ref())?;
        let counts: Vec<u32> = frame.require(Layer::Samples)?.data.iter().map(|&count| count as u32).collect();
        let there: u64 = counts.iter().map(|&count| u64::from(count)).sum();
        let left = (u64::from(spp) * counts.len() as u64).saturating_sub(there);
        // Without the scene nothing is known of costs.
        let cost = vec![1.0; need.len()];
        let demand = Demand { width: frame.width, need: &need, cost: &cost, counts: &counts };
        Ok(Self { size: (frame.width, frame.height), counts: raised(&demand, left) })
    }

    /// Reads the counts of a file: goals, or an image or layers of another render.
    pub fn load(path: &Path) -> Result<Self> {
        let Pixels { width, height, channels, data, .. } = read(path, &[])?;
        let at = CHANNELS.iter().find_map(|name| channels.iter().position(|channel| channel == name));
        let Some(at) = at else { return Err(Error::io(path, "has no channel `samples`, which sample counts are in")) };
        let values: Vec<f32> = data.chunks_exact(channels.len()).map(|pixel| pixel[at]).collect();
        if let Some(wrong) = values.iter().find(|&&value| !(0.0..=MOST).contains(&value) || value.fract() != 0.0) {
            return Err(Error::io(path, format!("a pixel is to have {wrong} samples")));
        }
        Ok(Self { size: (width, height), counts: values.iter().map(|&value| value as u32).collect() })
    }

    /// Writes the counts as the channel `samples` of an EXR file.
    pub fn save(&self, path: &Path) -> Result<()> {
        let (width, height) = self.size;
        let (channels, data) = (vec![CHANNELS[0].to_owned()], self.counts.iter().map(|&count| count as f32).collect());
        let pixels = Pixels { width, height, channels, data, window: None, attributes: Vec::new() };
        write(path, &pixels, Kind::Float, Some("zips"))
    }

    /// Counts of a film whose pixels begin with sample number `first` and have at most `spp`.
    pub fn of_chunk(&self, first: u32, spp: Option<u32>) -> Vec<u32> {
        let count = |&goal: &u32| goal.saturating_sub(first).min(spp.unwrap_or(u32::MAX));
        self.counts.iter().map(count).collect()
    }

    /// Numbers of samples from `first` to the largest goal that divide the rest into chunks of alike many samples. Chunks are of multiples of
    /// eight, so that bins stay whole; where there are fewer of these than chunks the last ones are empty.
    pub fn divide(&self, first: u32, chunks: u32) -> Vec<u32> {
        let most = self.counts.iter().copied().max().unwrap_or(0).max(first);
        // Pixels that take part in each group of eight samples: those whose last one it is, and all of the groups after it.
        let mut pixels = vec![0u64; (most - first).div_ceil(BINS as u32) as usize];
        for &goal in self.counts.iter().filter(|&&goal| goal > first) {
            pixels[(goal - first).div_ceil(BINS as u32) as usize - 1] += 1;
        }
        (1..pixels.len()).rev().for_each(|group| pixels[group - 1] += pixels[group]);
        let (total, mut done, mut group) = (pixels.iter().sum::<u64>(), 0, 0);
        let mut bounds = vec![first];
        for chunk in 1..=u64::from(chunks) {
            while group < pixels.len() && done * u64::from(chunks) < total * chunk {
                done += pixels[group];
                group += 1;
            }
            bounds.push((first + (group * BINS) as u32).min(most));
        }
        bounds
    }
}

/// Samples of every pixel in the first of two rounds: a multiple of eight, so that bins stay whole.
pub fn first_round(spp: u32) -> u32 {
    ((FIRST_SHARE * f64::from(spp)) as u32 / BINS as u32 * BINS as u32).max(FIRST_SPP)
}

/// Counts with `samples` more, allocated by need and cost.
pub(super) fn raised(demand: &Demand, samples: u64) -> Vec<u32> {
    demand.counts.iter().zip(allocate(demand, samples)).map(|(count, more)| count + more).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_take_every_sample_once_and_are_of_alike_work() {
        let counts: Vec<u32> = (0..1000).map(|i| 16 + (i * i) % 577).collect();
        let goals = Goals { size: (100, 10), counts };
        for chunks in [1, 2, 5, 24, 200] {
            let bounds = goals.divide(16, chunks);
            assert_eq!((bounds.len(), bounds[0]), (chunks as usize + 1, 16));
            assert_eq!(bounds.last(), goals.counts.iter().max());
            let of_chunk: Vec<u64> = bounds
                .windows(2)
                .map(|of| goals.of_chunk(of[0], Some(of[1] - of[0])).iter().map(|&count| u64::from(count)).sum())
                .collect();
            let all: u64 = goals.of_chunk(16, None).iter().map(|&count| u64::from(count)).sum();
            assert_eq!(of_chunk.iter().sum::<u64>(), all);
            // As alike as groups of eight samples of all pixels allow.
            let even = all / u64::from(chunks);
            assert!(of_chunk.iter().all(|&work| work <= even + 2 * 8000), "{chunks}: {of_chunk:?}");
            assert!(
                bounds[..chunks as usize]
                    .iter()
                    .all(|bound| *bound == goals.counts[24] || bound % 8 == 0 || bounds.last() == Some(bound))
            );
        }
        assert_eq!(Goals { size: (2, 1), counts: vec![8, 8] }.divide(8, 2), [8, 8, 8]);
    }

    #[test]
    fn counts_are_the_same_from_a_file_and_wrong_ones_are_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("goals.exr");
        let goals = Goals { size: (3, 2), counts: vec![0, 1, 2, 1 << 20, (1 << 24) - 1, 5] };
        goals.save(&path).unwrap();
        assert_eq!(Goals::load(&path).unwrap(), goals);
        for wrong in [-1.0, 0.5, f32::NAN, 1e9] {
            let (channels, data) = (vec!["samples".to_owned()], vec![wrong]);
            let pixels = Pixels { width: 1, height: 1, channels, data, window: None, attributes: Vec::new() };
            write(&path, &pixels, Kind::Float, None).unwrap();
            assert!(Goals::load(&path).unwrap_err().to_string().contains("a pixel is to have"));
        }
    }
}
