//! Edges between pixels: the differences that a frame holds, to whichever neighbours they were sampled.

use super::BINS;
use crate::image::Image;
use crate::math::Rgb;

/// Undirected edges between any two pixels of an image, in compressed sparse rows: one row for each pixel, with its edges
/// to pixels of higher index. Pixels are numbered along the lines of the image. Values are those of the lower end towards
/// the higher one: `mean[e]` estimates I(higher) - I(lower), in radiance.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Edges {
    /// Start of every pixel's row among the edges, and the end of the last: one entry more than there are pixels.
    rows: Vec<u32>,
    /// Lower and higher end of every edge.
    ends: Vec<[u32; 2]>,
    /// Steps from lower to higher ends, in x and y.
    offsets: Vec<(i32, i32)>,
    /// Position of every edge's step in `offsets`.
    kinds: Vec<u32>,
    /// Start of every pixel's entries in `incident`, and the end of the last.
    incident_rows: Vec<u32>,
    /// Edges that have the pixel as an end, nearest ends first.
    incident: Vec<u32>,
    /// Means of all samples, in radiance.
    pub mean: Vec<Rgb>,
    /// Variances of the means, in squared radiance; empty unless asked for.
    pub variance: Vec<Rgb>,
    /// Number of samples with differences at the end that has fewer; empty unless bins are asked for.
    pub counts: Vec<u32>,
    /// Means of the bins; empty unless asked for.
    pub bins: Vec<[Rgb; BINS]>,
    /// Means of the bins of the ambient light's differences; empty unless asked for.
    pub ambient: Vec<[Rgb; BINS]>,
    /// Weights of the neighbour's corrected value at the lower and at the higher end, relative to the pixel's own weight of
    /// one; empty if the edges come without weights.
    pub weights: Vec<[f32; 2]>,
}

/// The parts of edges that a method asks for besides their means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EdgeParts {
    /// Variances of the means.
    pub variance: bool,
    /// Means of the bins.
    pub bins: bool,
    /// Means of the bins of the ambient light.
    pub ambient: bool,
}

/// An edge seen from one of its ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfEdge {
    /// Index of the edge.
    pub edge: usize,
    /// The pixel at the other end.
    pub to: usize,
    /// Sign of the edge's values in this direction: I(to) - I(here) = sign * mean.
    pub sign: f32,
}

/// Differences to the right and downwards as dense images, for methods that work on a grid.
#[derive(Clone, Copy, Debug)]
pub struct Cross<'a> {
    /// I(x + 1, y) - I(x, y) and I(x, y + 1) - I(x, y), in radiance; zero where there is no edge.
    pub mean: [&'a Image; 2],
    /// Variances of the means, in squared radiance, where the frame has them.
    pub variance: [Option<&'a Image>; 2],
}

impl Edges {
    /// Edges to the right (kind 0) and downwards (kind 1) from all pixels, without values.
    pub fn cross((width, height): (usize, usize)) -> Self {
        let pixels = width * height;
        let mut edges = Self { offsets: vec![(1, 0), (0, 1)], ..Self::default() };
        (edges.rows, edges.incident_rows) = (Vec::with_capacity(pixels + 1), Vec::with_capacity(pixels + 1));
        (edges.ends, edges.kinds) = (Vec::with_capacity(2 * pixels), Vec::with_capacity(2 * pixels));
        edges.incident = Vec::with_capacity(4 * pixels);
        for i in 0..pixels {
            let (row, right, down) = (edges.ends.len() as u32, (i + 1) % width != 0, i + width < pixels);
            edges.rows.push(row);
            edges.incident_rows.push(edges.incident.len() as u32);
            // Nearest ends first: left, right, up, down.
            if i % width != 0 {
                edges.incident.push(edges.rows[i - 1]);
            }
            if right {
                edges.incident.push(row);
                edges.ends.push([i as u32, i as u32 + 1]);
                edges.kinds.push(0);
            }
            if i >= width {
                edges.incident.push(edges.rows[i - width] + u32::from(right));
            }
            if down {
                edges.incident.push(row + u32::from(right));
                edges.ends.push([i as u32, (i + width) as u32]);
                edges.kinds.push(1);
            }
        }
        edges.rows.push(edges.ends.len() as u32);
        edges.incident_rows.push(edges.incident.len() as u32);
        edges
    }

    /// Edges between pairs of pixels, without values; a pair that occurs twice counts once, one of equal pixels not at
    /// all.
    pub fn new(size: (usize, usize), pairs: impl IntoIterator<Item = [usize; 2]>) -> Self {
        let ordered = |[a, b]: [usize; 2]| [a.min(b) as u32, a.max(b) as u32];
        let mut ends: Vec<_> = pairs.into_iter().filter(|[a, b]| a != b).map(ordered).collect();
        ends.sort_unstable();
        ends.dedup();
        let (width, pixels) = (size.0, size.0 * size.1);
        let rows = starts(pixels, ends.iter().map(|ends| ends[0]));
        let incident_rows = starts(pixels, ends.iter().flatten().copied());
        let mut next = incident_rows.clone();
        let mut incident = vec![0; 2 * ends.len()];
        for (edge, &pixel) in ends.iter().enumerate().flat_map(|(edge, ends)| ends.iter().map(move |end| (edge, end))) {
            incident[next[pixel as usize] as usize] = edge as u32;
            next[pixel as usize] += 1;
        }
        let distance = |edge: &u32| ends[*edge as usize][1] - ends[*edge as usize][0];
        for row in incident_rows.windows(2) {
            // Stable, so that of two ends at the same distance the lower one comes first.
            incident[row[0] as usize..row[1] as usize].sort_by_key(distance);
        }
        let (mut offsets, mut kinds) = (Vec::new(), Vec::with_capacity(ends.len()));
        let at = |pixel: u32| ((pixel as usize % width) as i32, (pixel as usize / width) as i32);
        for &[lower, higher] in &ends {
            let (from, to) = (at(lower), at(higher));
            let offset = (to.0 - from.0, to.1 - from.1);
            let kind = offsets.iter().position(|known| *known == offset).unwrap_or_else(|| {
                offsets.push(offset);
                offsets.len() - 1
            });
            kinds.push(kind as u32);
        }
        Self { rows, ends, offsets, kinds, incident_rows, incident, ..Self::default() }
    }

    /// Number of edges.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Whether there is no edge.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.rows.len() - 1
    }

    /// Lower and higher end of an edge.
    #[inline(always)]
    pub fn ends(&self, edge: usize) -> [usize; 2] {
        self.ends[edge].map(|end| end as usize)
    }

    /// Steps in x and y from lower to higher ends; [`Edges::kind`] is a position in this list.
    pub fn offsets(&self) -> &[(i32, i32)] {
        &self.offsets
    }

    /// Position of an edge's step in [`Edges::offsets`].
    #[inline(always)]
    pub fn kind(&self, edge: usize) -> usize {
        self.kinds[edge] as usize
    }

    /// Edges from a pixel to pixels of higher index, as a range of indices.
    pub fn row(&self, pixel: usize) -> std::ops::Range<usize> {
        self.rows[pixel] as usize..self.rows[pixel + 1] as usize
    }

    /// All edges of a pixel, in the order of the distance of their other ends in index; of two at the same distance the
    /// lower end comes first.
    #[inline(always)]
    pub fn around(&self, pixel: usize) -> impl Iterator<Item = HalfEdge> {
        let range = self.incident_rows[pixel] as usize..self.incident_rows[pixel + 1] as usize;
        self.incident[range].iter().map(move |&edge| {
            let [lower, higher] = self.ends(edge as usize);
            let (to, sign) = if lower == pixel { (higher, 1.0) } else { (lower, -1.0) };
            HalfEdge { edge: edge as usize, to, sign }
        })
    }

    /// The edge from a pixel to another one, if there is one.
    pub fn between(&self, from: usize, to: usize) -> Option<HalfEdge> {
        let (lower, higher) = (from.min(to), from.max(to));
        let edge = self.row(lower).find(|&edge| self.ends[edge][1] as usize == higher)?;
        Some(HalfEdge { edge, to, sign: if from == lower { 1.0 } else { -1.0 } })
    }

    /// Whether the edges are those of [`Edges::cross`].
    pub fn is_cross(&self, size: (usize, usize)) -> bool {
        self.ends == Self::cross(size).ends
    }
}

/// Start of each of `count` rows with the given entries, and the end of the last row.
fn starts(count: usize, entries: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut starts = vec![0; count + 1];
    entries.for_each(|row| starts[row as usize + 1] += 1);
    (0..count).for_each(|row| starts[row + 1] += starts[row]);
    starts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cross_has_an_edge_for_every_pair_of_neighbours() {
        for (width, height) in [(1, 1), (1, 5), (6, 1), (4, 3)] {
            let edges = Edges::cross((width, height));
            assert_eq!(edges.len(), (width - 1) * height + width * (height - 1), "{width}x{height}");
            assert_eq!(edges.pixels(), width * height);
            assert!(edges.is_cross((width, height)));
            let pairs = (0..edges.len()).map(|edge| edges.ends(edge));
            let general = Edges::new((width, height), pairs);
            let around =
                |edges: &Edges| (0..width * height).map(|i| edges.around(i).collect()).collect::<Vec<Vec<_>>>();
            assert!(around(&general) == around(&edges) && general.rows == edges.rows, "{width}x{height}");
            let degrees: usize = (0..edges.pixels()).map(|pixel| edges.around(pixel).count()).sum();
            assert_eq!(degrees, 2 * edges.len());
        }
        let edges = Edges::cross((4, 3));
        assert_eq!(edges.offsets(), [(1, 0), (0, 1)]);
        let around: Vec<_> = edges.around(5).map(|half| (half.to, half.sign)).collect();
        assert_eq!(around, [(4, -1.0), (6, 1.0), (1, -1.0), (9, 1.0)]);
    }

    #[test]
    fn edges_between_any_pixels_are_found_from_both_ends() {
        let edges = Edges::new((5, 4), [[7, 2], [2, 7], [3, 3], [0, 19], [12, 8]]);
        assert_eq!((0..edges.len()).map(|edge| edges.ends(edge)).collect::<Vec<_>>(), [[0, 19], [2, 7], [8, 12]]);
        assert_eq!(edges.offsets(), [(4, 3), (0, 1), (-1, 1)]);
        assert_eq!(edges.between(7, 2), Some(HalfEdge { edge: 1, to: 2, sign: -1.0 }));
        assert_eq!(edges.between(2, 7), Some(HalfEdge { edge: 1, to: 7, sign: 1.0 }));
        assert_eq!((edges.between(3, 4), edges.row(8)), (None, 2..3));
        assert!(!edges.is_cross((5, 4)));
    }
}
