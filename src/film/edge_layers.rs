//! Edges between any pixels as images for files: the mask of every pixel's neighbours, and for every step that is in use a layer
//! of the differences across it, at the lower end of each edge.

use super::{BINS, Edges, Frame, Layer, Neighbours, STEPS, opposite};
use crate::image::Image;
use crate::math::{Rgb, vec3};

/// Name of the layer of masks over [`STEPS`], which single precision holds exactly.
const MASKS: &str = "neighbours.Y";

const RGB: [&str; 3] = ["R", "G", "B"];

/// Names of the layers of a step: means, variances, and bins of the differences and of those of the ambient light.
#[derive(Clone, Copy)]
enum Part {
    Mean,
    Variance,
    Bin(usize),
    Ambient(usize),
}

impl Part {
    fn all() -> impl Iterator<Item = Self> {
        let binned = (0..BINS).flat_map(|k| [Self::Bin(k), Self::Ambient(k)]);
        [Self::Mean, Self::Variance].into_iter().chain(binned)
    }

    /// Name of the layer for a step, as in `edge_2_-1`.
    fn name(self, (x, y): (i32, i32)) -> String {
        match self {
            Self::Mean => format!("edge_{x}_{y}"),
            Self::Variance => format!("edge_variance_{x}_{y}"),
            Self::Bin(k) => format!("bin{k}_edge_{x}_{y}"),
            Self::Ambient(k) => format!("bin{k}_ambient_edge_{x}_{y}"),
        }
    }

    /// The values of an edge; none if the edges come without them.
    fn get(self, edges: &Edges, edge: usize) -> Option<Rgb> {
        match self {
            Self::Mean => edges.mean.get(edge).copied(),
            Self::Variance => edges.variance.get(edge).copied(),
            Self::Bin(k) => edges.bins.get(edge).map(|bins| bins[k]),
            Self::Ambient(k) => edges.ambient.get(edge).map(|bins| bins[k]),
        }
    }

    /// Sets the values of all edges.
    fn set(self, edges: &mut Edges, values: Vec<Rgb>) {
        let put = |bins: &mut Vec<[Rgb; BINS]>, k: usize| {
            bins.resize(values.len(), [Rgb::ZERO; BINS]);
            bins.iter_mut().zip(&values).for_each(|(bins, value)| bins[k] = *value);
        };
        match self {
            Self::Mean => edges.mean = values,
            Self::Variance => edges.variance = values,
            Self::Bin(k) => put(&mut edges.bins, k),
            Self::Ambient(k) => put(&mut edges.ambient, k),
        }
    }
}

/// Channels of weights: at the lower and at the higher end of the edge.
const ENDS: [&str; 2] = ["lower", "higher"];

/// Name of the weights across a step, as in `edge_weight_2_-1.lower`.
fn weight_name((x, y): (i32, i32), end: usize) -> String {
    format!("edge_weight_{x}_{y}.{}", ENDS[end])
}

/// Channels of a frame's own edges, by name, each with the values of all pixels. The error says which edges are too long.
pub fn channels(edges: &Edges) -> Result<Vec<(String, Vec<f32>)>, String> {
    let pixels = edges.pixels();
    let mut masks = vec![0u32; pixels];
    let mut channels = Vec::new();
    for (kind, &offset) in edges.offsets().iter().enumerate() {
        let Some(step) = STEPS.iter().position(|step| *step == offset) else {
            return Err(format!("files hold edges within windows of 5x5 pixels, and there is one across {offset:?}"));
        };
        let of_kind: Vec<_> = (0..edges.len()).filter(|&edge| edges.kind(edge) == kind).collect();
        for &edge in &of_kind {
            let [lower, higher] = edges.ends(edge);
            masks[lower] |= 1 << step;
            masks[higher] |= 1 << opposite(step);
        }
        for end in (0..ENDS.len()).filter(|_| !edges.weights.is_empty()) {
            let mut values = vec![0.0; pixels];
            of_kind.iter().for_each(|&edge| values[edges.ends(edge)[0]] = edges.weights[edge][end]);
            channels.push((weight_name(offset, end), values));
        }
        for part in Part::all().filter(|part| part.get(edges, of_kind[0]).is_some()) {
            for (c, channel) in RGB.iter().enumerate() {
                let mut values = vec![0.0; pixels];
                for &edge in &of_kind {
                    values[edges.ends(edge)[0]] = part.get(edges, edge).map_or(0.0, |value| value[c]);
                }
                channels.push((format!("{}.{channel}", part.name(offset)), values));
            }
        }
    }
    channels.push((MASKS.to_owned(), masks.iter().map(|&mask| mask as f32).collect()));
    Ok(channels)
}

/// Edges from the channels of a file, if it has masks of neighbours. `channel` finds one by its name. An edge
/// exists if either end's mask has it. Numbers of samples are those of the frame's ends.
pub fn edges(frame: &Frame, channel: impl Fn(&str) -> Option<Vec<f32>>) -> Option<Edges> {
    let (masks, size) = (channel(MASKS)?, (frame.width, frame.height));
    let neighbours = Neighbours::new(size, masks.iter().map(|&mask| mask as u32).collect(), true);
    let mut edges = Edges::new(size, neighbours.pairs());
    for part in Part::all() {
        let mut values = vec![Rgb::ZERO; edges.len()];
        let mut found = false;
        for (kind, &offset) in edges.offsets().iter().enumerate() {
            let name = part.name(offset);
            let planes = RGB.map(|c| channel(&format!("{name}.{c}")));
            let [Some(r), Some(g), Some(b)] = planes else { continue };
            found = true;
            for edge in (0..edges.len()).filter(|&edge| edges.kind(edge) == kind) {
                let at = edges.ends(edge)[0];
                values[edge] = vec3(r[at], g[at], b[at]);
            }
        }
        if found {
            part.set(&mut edges, values);
        }
    }
    let mut weights = vec![[0.0; 2]; edges.len()];
    let mut weighted = false;
    for (kind, &offset) in edges.offsets().iter().enumerate() {
        let [Some(lower), Some(higher)] = [0, 1].map(|end| channel(&weight_name(offset, end))) else { continue };
        weighted = true;
        for edge in (0..edges.len()).filter(|&edge| edges.kind(edge) == kind) {
            let at = edges.ends(edge)[0];
            weights[edge] = [lower[at], higher[at]];
        }
    }
    if weighted {
        edges.weights = weights;
    }
    let samples = frame.get(Layer::EdgeSamples).or_else(|| frame.get(Layer::Samples));
    let least = |samples: &Image, edge| edges.ends(edge).map(|end| samples.data[end] as u32).into_iter().min();
    edges.counts = samples
        .map_or_else(Vec::new, |samples| (0..edges.len()).map(|edge| least(samples, edge).unwrap_or(0)).collect());
    Some(edges)
}
