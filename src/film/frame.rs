//! Developed images.

use std::borrow::Cow;

use rayon::prelude::*;

use super::layer::Layer;
use super::{BINS, Cross, EdgeParts, Edges, LightLayers, Provenance, aovs, bin_count};
use crate::error::{Error, Result};
use crate::image::Image;
use crate::image::io::{DataWindow, Pixels};
use crate::math::{Rgb, vec3};

/// Means and variances of a film, as layers. A frame developed in memory and one read from a file are the same.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// Pixels in a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    layers: Vec<Option<Image>>,
    /// Edges in place of the cross that the layers hold.
    edges: Option<Edges>,
    /// Light of groups of emitters, if it was recorded by itself.
    pub lights: Vec<LightLayers>,
    /// Scene, seed, samples, version and so on.
    pub provenance: Provenance,
    /// The larger picture that the frame is a part of, if it is.
    pub window: Option<DataWindow>,
}

impl Frame {
    /// A frame without layers.
    pub fn new(width: usize, height: usize) -> Self {
        let layers = vec![None; Layer::COUNT];
        Self { width, height, layers, edges: None, lights: Vec::new(), provenance: Provenance::default(), window: None }
    }

    /// A frame of several renders of one picture with different seeds, of `spp` samples a pixel each: their mean and its
    /// variance, and bins of as many of them as there are powers of two, eight at most.
    pub fn of_renders(renders: &[Image], spp: u32) -> Result<Self> {
        let [first, _, ..] = renders else {
            return Err(Error::Usage(format!("a variance takes two or more renders: there are {}", renders.len())));
        };
        let fits = |render: &Image| render.shape() == first.shape();
        if first.is_empty() || first.channels != 3 || !renders.iter().all(fits) || spp == 0 {
            return Err(Error::Mismatch("the renders are of different sizes, or of no pixel, colour or sample".into()));
        }
        let mut frame = Self::new(first.width, first.height);
        let mean = |of: &[&Image]| {
            let value = |i: usize| of.iter().map(|image| f64::from(image.data[i])).sum::<f64>() / of.len() as f64;
            Image { data: (0..first.data.len()).map(|i| value(i) as f32).collect(), ..first.clone() }
        };
        let (color, count) = (mean(&renders.iter().collect::<Vec<_>>()), renders.len() as f64);
        let variance = |i: usize| {
            let squares = renders.iter().map(|render| f64::from(render.data[i] - color.data[i]).powi(2)).sum::<f64>();
            (squares / (count - 1.0) / count) as f32
        };
        let variance = Image { data: (0..first.data.len()).map(variance).collect(), ..first.clone() };
        let groups = BINS.min(1 << renders.len().ilog2());
        for k in 0..BINS {
            let group: Vec<_> = renders.iter().skip(k % groups).step_by(groups).collect();
            frame.set(Layer::BinColor(k as u8), mean(&group));
        }
        let samples = vec![renders.len() as f32 * spp as f32; first.width * first.height];
        frame.set(Layer::Samples, Image { channels: 1, data: samples, ..first.clone() });
        frame.set(Layer::Color, color);
        frame.set(Layer::ColorVariance, variance);
        Ok(frame)
    }

    /// Adds what layers of another program say of others: variances of features, of which those without any have no noise, and
    /// halves of the samples. `spp` are the samples of every pixel where the layers do not say.
    pub fn complete(&mut self, spp: Option<u32>) {
        aovs::complete(self, &Pixels::default(), spp);
    }

    /// The upper left corner of the frame's layers, at most so many pixels wide and high; without edges of its own.
    pub fn corner(&self, side: usize) -> Self {
        let (width, height) = (self.width.min(side), self.height.min(side));
        let mut corner = Self { provenance: self.provenance.clone(), ..Self::new(width, height) };
        for (layer, image) in self.present() {
            corner.set(layer, image.part((0, 0), (width, height)));
        }
        corner
    }

    /// The same frame with its provenance.
    pub fn with_provenance(self, provenance: Provenance) -> Self {
        Self { provenance, ..self }
    }

    /// A layer, if it is there.
    pub fn get(&self, layer: Layer) -> Option<&Image> {
        self.layers[layer.index()].as_ref()
    }

    /// A layer that must be there; the error says how to get it.
    pub fn require(&self, layer: Layer) -> Result<&Image> {
        self.get(layer).ok_or_else(|| Error::Missing {
            layer: layer.channel_names().join(", "),
            remedy: match layer.info().flag {
                "always" if layer == Layer::ColorVariance => {
                    "`fluxion render --layers` writes it, Mitsuba where an integrator `moment` is around the others, and \
                     pbrt's `gbuffer` film"
                        .into()
                }
                "always" if layer == Layer::Samples => "give the samples per pixel with --spp".into(),
                "always" => "every file that `fluxion render --layers` writes has it".into(),
                flag => format!("`fluxion render` records it with {flag}"),
            },
        })
    }

    /// Puts a layer in.
    pub fn set(&mut self, layer: Layer, image: Image) {
        let expected = (self.width, self.height, layer.info().channels.len());
        assert_eq!(image.shape(), expected, "layer {} has the wrong shape", layer.name());
        self.layers[layer.index()] = Some(image);
    }

    /// The layers that are there.
    pub fn present(&self) -> impl Iterator<Item = (Layer, &Image)> {
        Layer::all().filter_map(|layer| Some((layer, self.get(layer)?)))
    }

    /// Replaces the differences of the layers by edges between any pixels.
    pub fn set_edges(&mut self, edges: Edges) {
        assert_eq!(edges.pixels(), self.width * self.height, "edges of another size");
        self.edges = Some(edges);
    }

    /// The edges of [`Frame::set_edges`], if they take the place of those of layers.
    pub fn own_edges(&self) -> Option<&Edges> {
        self.edges.as_ref()
    }

    /// Differences to the right and downwards as images. The error names the layer that is missing, or says that the
    /// edges are others.
    pub fn cross(&self) -> Result<Cross<'_>> {
        if self.edges.is_some() {
            let remedy = "this method takes differences to the right and downwards only, and the frame has edges between \
                          other pixels";
            return Err(Error::Missing { layer: Layer::Dx.channel_names().join(", "), remedy: remedy.into() });
        }
        Ok(Cross {
            mean: [self.require(Layer::Dx)?, self.require(Layer::Dy)?],
            variance: [self.get(Layer::DxVariance), self.get(Layer::DyVariance)],
        })
    }

    /// The frame's edges, with the parts that are asked for. The error names the layer that is missing.
    pub fn edges(&self, parts: EdgeParts) -> Result<Cow<'_, Edges>> {
        match &self.edges {
            Some(edges) => {
                for (wanted, there, layer) in [
                    (parts.variance, !edges.variance.is_empty(), Layer::DxVariance),
                    (parts.bins, !edges.bins.is_empty() && !edges.counts.is_empty(), Layer::BinDx(0)),
                    (parts.ambient, !edges.ambient.is_empty(), Layer::BinAmbientDx(0)),
                ] {
                    if wanted && !there && !edges.is_empty() {
                        let remedy = "the frame's edges were made without it".into();
                        return Err(Error::Missing { layer: layer.channel_names().join(", "), remedy });
                    }
                }
                Ok(Cow::Borrowed(edges))
            }
            None => Ok(Cow::Owned(self.edges_of_layers(parts)?)),
        }
    }

    fn edges_of_layers(&self, parts: EdgeParts) -> Result<Edges> {
        let mut edges = Edges::cross((self.width, self.height));
        let values = |of_axis: [&Image; 2], edge: usize| {
            let rgb = &of_axis[edges.kind(edge)].data[3 * edges.ends(edge)[0]..][..3];
            vec3(rgb[0], rgb[1], rgb[2])
        };
        let pair = |layers: [Layer; 2]| Ok::<_, Error>([self.require(layers[0])?, self.require(layers[1])?]);
        let all = |layers| {
            let of_axis = pair(layers)?;
            Ok::<Vec<Rgb>, Error>((0..edges.len()).into_par_iter().map(|edge| values(of_axis, edge)).collect())
        };
        let binned = |layers: [fn(u8) -> Layer; 2]| {
            let bins = (0..BINS as u8).map(|k| pair(layers.map(|layer| layer(k)))).collect::<Result<Vec<_>>>()?;
            let of_edge = |edge| std::array::from_fn(|k| values(bins[k], edge));
            Ok::<Vec<[Rgb; BINS]>, Error>((0..edges.len()).into_par_iter().map(of_edge).collect())
        };
        let mean = all([Layer::Dx, Layer::Dy])?;
        let variance = if parts.variance { all([Layer::DxVariance, Layer::DyVariance])? } else { Vec::new() };
        let bins = if parts.bins { binned([Layer::BinDx, Layer::BinDy])? } else { Vec::new() };
        let ambient = if parts.ambient { binned([Layer::BinAmbientDx, Layer::BinAmbientDy])? } else { Vec::new() };
        let counts = if parts.bins || parts.ambient { self.edge_counts(&edges)? } else { Vec::new() };
        (edges.mean, edges.variance, edges.bins, edges.ambient, edges.counts) = (mean, variance, bins, ambient, counts);
        Ok(edges)
    }

    /// Number of samples with differences at the end of every edge that has fewer.
    fn edge_counts(&self, edges: &Edges) -> Result<Vec<u32>> {
        let samples = self.get(Layer::EdgeSamples).map_or_else(|| self.require(Layer::Samples), Ok)?;
        let least = |edge| edges.ends(edge).map(|end| samples.data[end] as u32).into_iter().min().unwrap_or(0);
        Ok((0..edges.len()).map(least).collect())
    }

    /// Mean of the colour of the samples in every other bin, from `first` (0 or 1) on, and the variance of that mean.
    pub fn color_half(&self, first: usize) -> Result<[Image; 2]> {
        let bins = (0..BINS).map(|k| self.require(Layer::BinColor(k as u8))).collect::<Result<Vec<_>>>()?;
        let samples = self.require(Layer::Samples)?;
        let [mut mean, mut variance] = [(); 2].map(|()| Image::new(self.width, self.height, 3));
        for i in 0..mean.data.len() {
            let values = std::array::from_fn(|k| bins[k].data[i]);
            (mean.data[i], variance.data[i]) = half(values, samples.data[i / 3] as u32, first);
        }
        Ok([mean, variance])
    }
}

/// Mean of every other bin, from `first` (0 or 1) on, and the variance of that mean, from the bins' means of `samples`
/// samples. Where these bins are empty, the mean is that of the others; the variance is zero where only one bin has
/// samples.
pub fn half(bins: [f32; BINS], samples: u32, first: usize) -> (f32, f32) {
    let count = |k: usize| f64::from(bin_count(samples, k));
    let in_half = |k: usize| k % 2 == first && count(k) > 0.0;
    let empty = !(0..BINS).any(in_half);
    let used = || (0..BINS).filter(|&k| if empty { count(k) > 0.0 } else { in_half(k) });
    let value = |k: usize| f64::from(bins[k]);
    let total: f64 = used().map(count).sum();
    let mean = used().map(|k| count(k) * value(k)).sum::<f64>() / total.max(1.0);
    let squares: f64 = used().map(|k| count(k) * (value(k) - mean).powi(2)).sum();
    let freedom = (used().count() as f64 - 1.0).max(1.0);
    (mean as f32, (squares / freedom / total.max(1.0)) as f32)
}
