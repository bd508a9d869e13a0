//! The half-edges of a wave: which neighbours its paths are shifted to, and the differences found so far.

use super::camera::CameraSamples;
use crate::film::{CROSS, Differences, Neighbours, STEPS};
use crate::math::Rgb;

/// Half-edges of the paths of a wave, path by path.
#[derive(Default)]
pub struct HalfEdges {
    /// Number of half-edges before those of every path, and of all.
    starts: Vec<u32>,
    /// Positions of their steps in [`STEPS`].
    steps: Vec<u8>,
    /// Differences of the scattered radiance.
    color: Vec<Rgb>,
    /// Differences of the ambient light.
    ambient: Vec<Rgb>,
    /// Half-edges of the path that has the most.
    most: usize,
}

impl HalfEdges {
    /// Starts a wave without differences. Without chosen neighbours every path has the cross, across the film's border, too.
    pub fn start(&mut self, camera: &CameraSamples, neighbours: Option<&Neighbours>) {
        self.starts.clear();
        self.steps.clear();
        self.starts.push(0);
        self.most = 0;
        for &(x, y) in camera.pixels {
            match neighbours {
                Some(neighbours) => {
                    self.steps.extend(neighbours.steps(y * camera.size.0 + x).map(|step| step as u8));
                }
                None => self.steps.extend(0..CROSS.count_ones() as u8),
            }
            let start = self.starts.last().copied().unwrap_or(0);
            self.most = self.most.max(self.steps.len() - start as usize);
            self.starts.push(self.steps.len() as u32);
        }
        for differences in [&mut self.color, &mut self.ambient] {
            differences.clear();
            differences.resize(self.steps.len(), Rgb::ZERO);
        }
    }

    /// Half-edges of the path that has the most.
    pub fn most(&self) -> usize {
        self.most
    }

    /// Number of a path's half-edges.
    #[inline(always)]
    pub fn degree(&self, path: usize) -> usize {
        (self.starts[path + 1] - self.starts[path]) as usize
    }

    /// Step across half-edge number `slot` of a path, if it has so many.
    #[inline(always)]
    pub fn step(&self, path: usize, slot: usize) -> Option<(i32, i32)> {
        (slot < self.degree(path)).then(|| STEPS[self.steps[self.starts[path] as usize + slot] as usize])
    }

    /// Largest distance of a neighbour in columns or rows.
    pub fn reach(&self) -> usize {
        let distance = |&step: &u8| STEPS[step as usize].0.unsigned_abs().max(STEPS[step as usize].1.unsigned_abs());
        self.steps.iter().map(distance).max().unwrap_or(0) as usize
    }

    /// Adds to the differences across half-edge number `slot` of a path.
    #[inline(always)]
    pub fn add(&mut self, path: usize, slot: usize, (color, ambient): (Rgb, Option<Rgb>)) {
        let at = self.starts[path] as usize + slot;
        self.color[at] += color;
        if let Some(ambient) = ambient {
            self.ambient[at] += ambient;
        }
    }

    /// The differences of a path.
    pub fn differences(&self, path: usize) -> Differences<'_> {
        let span = self.starts[path] as usize..self.starts[path + 1] as usize;
        Differences { color: &self.color[span.clone()], ambient: &self.ambient[span] }
    }
}
