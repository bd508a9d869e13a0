//! Frames of other programs: their auxiliary channels (AOVs) as layers. Known are the names that Mitsuba 3 (integrators `aov`
//! and `moment`), Blender's Cycles, pbrt-v4, LuxCore, Arnold and RenderMan give them.

use super::{BINS, Frame, Layer};
use crate::image::Image;
use crate::image::io::Pixels;
use crate::math::rng;

/// Layers with the names that programs give them, the best first: the last part of a channel's name before its component.
const NAMES: &[(Layer, &[&str])] = &[
    (Layer::Color, &BEAUTY),
    (Layer::Albedo, &["denoising albedo", "denoise_albedo", "albedo", "diffuse_albedo"]),
    (
        Layer::Normal,
        &[
            "denoising normal",
            "avg_shading_normal",
            "sh_normal",
            "ns",
            "nn",
            "normal",
            "normals",
            "shading_normal",
            "n",
        ],
    ),
    (Layer::Depth, &["denoising depth", "depth", "dd", "z"]),
    (Layer::Position, &["position", "pp", "pos", "p"]),
    (Layer::Samples, &["debug sample count", "sample count", "samplecount"]),
];

/// Names of the picture itself, the best first.
pub const BEAUTY: [&str; 7] = ["noisy image", "combined", "beauty", "rgba", "rgb_imagepipeline", "ci", "c"];

/// Components of a channel group, in order.
const COMPONENTS: [&[&str]; 3] = [&["r", "g", "b"], &["x", "y", "z"], &["t"]];

/// Layers with the layers of their variances.
const VARIANCES: [(Layer, Layer); 4] = [
    (Layer::Albedo, Layer::AlbedoVariance),
    (Layer::Normal, Layer::NormalVariance),
    (Layer::Depth, Layer::DepthVariance),
    (Layer::Position, Layer::PositionVariance),
];

/// Prefix of Mitsuba's second moments.
const SECOND_MOMENT: &str = "m2_";

/// Suffix of RenderMan's variances of samples.
const VARIANCE: &str = "_var";

/// Adds the layers that a frame lacks, as far as the file's other channels say what they are. `spp` are the samples of every
/// pixel where the file does not say.
pub fn complete(frame: &mut Frame, pixels: &Pixels, spp: Option<u32>) {
    let file = File::new(pixels);
    let mut groups = Vec::new();
    if let (None, Some(color)) = (frame.get(Layer::Color), file.group("", COMPONENTS[0])) {
        frame.set(Layer::Color, file.image(&color));
    }
    for (layer, names) in NAMES {
        let group =
            if *layer == Layer::Depth { file.depth(names) } else { file.named(names, layer.info().channels.len()) };
        if let Some(group) = group {
            if frame.get(*layer).is_none() {
                frame.set(*layer, file.image(&group));
            }
            groups.push((*layer, group));
        }
    }
    if let (None, Some(spp)) = (frame.get(Layer::Samples), spp) {
        frame.set(Layer::Samples, constant(frame, 1, spp as f32));
    }
    let Some(count) = frame.get(Layer::Samples).map(|samples| samples.data.clone()) else { return };
    for (layer, variance) in VARIANCES {
        let Some(image) = frame.get(layer) else { continue };
        let group = groups.iter().find(|(known, _)| *known == layer).map(|(_, group)| group);
        let known = group.and_then(|group| file.variance(group, &count));
        // Passes for denoisers have hardly any noise.
        let known = known.unwrap_or_else(|| constant(frame, image.channels, 0.0));
        if frame.get(variance).is_none() {
            frame.set(variance, known);
        }
    }
    if let (None, Some(variance)) = (frame.get(Layer::ColorVariance), file.color_variance(&count)) {
        frame.set(Layer::ColorVariance, variance);
    }
    add_bins(frame);
}

fn constant(frame: &Frame, channels: usize, value: f32) -> Image {
    Image {
        data: vec![value; frame.width * frame.height * channels],
        ..Image::new(frame.width, frame.height, channels)
    }
}

/// A file's channels by their names in lower case.
struct File<'a> {
    pixels: &'a Pixels,
    names: Vec<String>,
}

/// Some channels that belong together: the part of their names before the component, and their positions.
struct Group {
    prefix: String,
    positions: Vec<usize>,
}

impl<'a> File<'a> {
    fn new(pixels: &'a Pixels) -> Self {
        Self { pixels, names: pixels.channels.iter().map(|name| name.to_lowercase()).collect() }
    }

    fn group(&self, prefix: &str, components: &[&str]) -> Option<Group> {
        let find = |component: &&str| {
            let wanted = if prefix.is_empty() { (*component).to_owned() } else { format!("{prefix}.{component}") };
            self.names.iter().position(|name| *name == wanted)
        };
        let positions = components.iter().map(find).collect::<Option<Vec<_>>>()?;
        Some(Group { prefix: prefix.to_owned(), positions })
    }

    /// Everything before a component, once each, second moments left out.
    fn prefixes(&self) -> Vec<&str> {
        let mut prefixes: Vec<_> =
            self.names.iter().map(|name| name.rsplit_once('.').map_or("", |(prefix, _)| prefix)).collect();
        prefixes.dedup();
        prefixes.retain(|prefix| !prefix.starts_with(SECOND_MOMENT));
        prefixes
    }

    /// The group with the first of some names that the file has.
    fn named(&self, names: &[&str], channels: usize) -> Option<Group> {
        let prefixes = self.prefixes();
        names.iter().find_map(|name| {
            let of_name = prefixes.iter().filter(|prefix| component(prefix) == *name);
            of_name.into_iter().find_map(|prefix| match channels {
                1 => self.group(prefix, &["x"]).or_else(|| self.group(prefix, &["y"])),
                _ => COMPONENTS[..2].iter().find_map(|components| self.group(prefix, components)),
            })
        })
    }

    /// A depth: of Mitsuba's, the component `T` under any name.
    fn depth(&self, names: &[&str]) -> Option<Group> {
        let prefixes = self.prefixes();
        let by_component = || prefixes.iter().find_map(|prefix| self.group(prefix, COMPONENTS[2]));
        let by_name = || {
            names.iter().find_map(|name| {
                let of_name = prefixes.iter().filter(|prefix| component(prefix) == *name);
                of_name.into_iter().find_map(|prefix| self.group(prefix, &["z"]).or_else(|| self.group(prefix, &["v"])))
            })
        };
        by_component().or_else(by_name)
    }

    fn image(&self, group: &Group) -> Image {
        let samples = self.pixels.data.chunks_exact(self.pixels.channels.len());
        let data = samples.flat_map(|pixel| group.positions.iter().map(|&at| pixel[at])).collect();
        Image { data, ..Image::new(self.pixels.width, self.pixels.height, group.positions.len()) }
    }

    /// Variance of the mean from that of the samples.
    fn over_counts(&self, of_samples: &Group, counts: &[f32]) -> Image {
        let mut variance = self.image(of_samples);
        let channels = variance.channels;
        variance.data.iter_mut().enumerate().for_each(|(i, value)| *value /= counts[i / channels].max(1.0));
        variance
    }

    /// Variance of the mean of a group whose second moments, or variances of samples, the file has.
    fn variance(&self, group: &Group, counts: &[f32]) -> Option<Image> {
        let components: Vec<_> = group.positions.iter().map(|&at| component(&self.names[at])).collect();
        if let Some(of_samples) = self.group(&format!("{}{VARIANCE}", group.prefix), &components) {
            return Some(self.over_counts(&of_samples, counts));
        }
        let squares = self.group(&format!("{SECOND_MOMENT}{}", group.prefix), &components)?;
        let (mean, mut variance) = (self.image(group), self.image(&squares));
        let channels = mean.channels;
        for (i, (square, mean)) in variance.data.iter_mut().zip(&mean.data).enumerate() {
            *square = (*square - mean * mean).max(0.0) / (counts[i / channels] - 1.0).max(1.0);
        }
        Some(variance)
    }

    /// Variance of the colour: RenderMan's mean squared error, the variance of samples that pbrt and Arnold write, or from the
    /// second moments of Mitsuba's colours.
    fn color_variance(&self, counts: &[f32]) -> Option<Image> {
        if let Some(of_mean) = self.group("mse", COMPONENTS[0]) {
            return Some(self.image(&of_mean));
        }
        if let Some(of_samples) = self.group("variance", COMPONENTS[0]) {
            return Some(self.over_counts(&of_samples, counts));
        }
        let features: Vec<&str> = NAMES[1..].iter().flat_map(|(_, names)| names.iter().copied()).collect();
        let prefixes = self.prefixes();
        let is_color = |prefix: &&&str| !features.contains(&component(prefix));
        let of_colors = || prefixes.iter().filter(is_color);
        let exact = of_colors().find_map(|prefix| self.variance(&self.group(prefix, COMPONENTS[0])?, counts));
        exact.or_else(|| {
            let xyz = of_colors().find_map(|prefix| {
                let group = self.group(prefix, COMPONENTS[1])?;
                Some((self.variance(&group, counts)?, self.image(&group)))
            });
            let ((variance, xyz), color) = (xyz?, self.image(&self.group("", COMPONENTS[0])?));
            Some(from_luminance(&variance, &xyz, &color))
        })
    }
}

/// Variance of red, green and blue from that of the luminance, as if noise changed the brightness alone.
fn from_luminance(variance: &Image, xyz: &Image, color: &Image) -> Image {
    let mut result = color.clone();
    for ((rgb, variance), xyz) in
        result.data.chunks_exact_mut(3).zip(variance.data.chunks_exact(3)).zip(xyz.data.chunks_exact(3))
    {
        let relative = if xyz[1] > 0.0 { variance[1] / (xyz[1] * xyz[1]) } else { 0.0 };
        rgb.iter_mut().for_each(|value| *value = relative * *value * *value);
    }
    result
}

/// Part of a name after its last point.
fn component(name: &str) -> &str {
    name.rsplit('.').next().unwrap_or_default()
}

/// Bins of two independent halves, for methods that compare these: the colour with noise of its own variance added, and with
/// it taken off (Leiner et al. 2023).
fn add_bins(frame: &mut Frame) {
    let (Some(color), Some(variance)) = (frame.get(Layer::Color), frame.get(Layer::ColorVariance)) else { return };
    if frame.get(Layer::BinColor(0)).is_some() {
        return;
    }
    let half = |sign: f32| {
        let mut half = color.clone();
        for (pixel, values) in half.data.chunks_exact_mut(3).enumerate() {
            let noise = sign * gaussian(pixel as u64);
            values
                .iter_mut()
                .zip(&variance.data[3 * pixel..])
                .for_each(|(value, v)| *value += noise * v.max(0.0).sqrt());
        }
        half
    };
    let halves = [half(1.0), half(-1.0)];
    (0..BINS).for_each(|k| frame.set(Layer::BinColor(k as u8), halves[k % 2].clone()));
}

/// A number with mean zero and variance one, the same for the same index (Box and Muller 1958).
fn gaussian(index: u64) -> f32 {
    let [u, v] = [0, 1].map(|k| rng::unit(rng::combine(rng::mix(index), k)));
    (-2.0 * (1.0 - u).max(f32::MIN_POSITIVE).ln()).sqrt() * (std::f32::consts::TAU * v).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A frame of one pixel from channels and their values.
    fn frame(channels: &[(&str, f32)], spp: Option<u32>) -> Frame {
        let pixels = Pixels {
            width: 1,
            height: 1,
            channels: channels.iter().map(|(name, _)| (*name).to_owned()).collect(),
            data: channels.iter().map(|(_, value)| *value).collect(),
            ..Pixels::default()
        };
        let mut frame = Frame::new(1, 1);
        if let Some(color) = File::new(&pixels).group("", COMPONENTS[0]) {
            frame.set(Layer::Color, File::new(&pixels).image(&color));
        }
        complete(&mut frame, &pixels, spp);
        frame
    }

    /// Channels of files of one pixel, with the samples where they do not say, and whether they have depths and variances.
    const FILES: &[(&str, &str, Option<u32>, bool, bool)] = &[
        (
            "mitsuba",
            "R=1 G=2 B=3 _arg_0.i.R=1 _arg_0.i.G=2 _arg_0.i.B=3 m2__arg_0.i.R=4 m2__arg_0.i.G=4 m2__arg_0.i.B=25
            _arg_0.albedo.R=0.5 _arg_0.albedo.G=0.25 _arg_0.albedo.B=0.125
            m2__arg_0.albedo.R=0.25 m2__arg_0.albedo.G=0.25 m2__arg_0.albedo.B=0.125
            _arg_0.nn.X=0 _arg_0.nn.Y=0.6 _arg_0.nn.Z=0.8 _arg_0.dd.y.T=7 m2__arg_0.dd.y.T=50",
            Some(5),
            true,
            true,
        ),
        (
            "cycles",
            "View/Layer.Combined.R=9 View/Layer.Combined.G=9 View/Layer.Combined.B=9
            View/Layer.Noisy/Image.R=1 View/Layer.Noisy/Image.G=2 View/Layer.Noisy/Image.B=3
            View/Layer.Denoising/Albedo.R=0.5 View/Layer.Denoising/Albedo.G=0.25 View/Layer.Denoising/Albedo.B=0.125
            View/Layer.Denoising/Normal.X=0 View/Layer.Denoising/Normal.Y=0.6 View/Layer.Denoising/Normal.Z=0.8
            View/Layer.Denoising/Depth.Z=7 View/Layer.Debug/Sample/Count.X=5",
            None,
            true,
            false,
        ),
        (
            "pbrt",
            "R=1 G=2 B=3 Albedo.R=0.5 Albedo.G=0.25 Albedo.B=0.125 Ns.X=0 Ns.Y=0.6 Ns.Z=0.8 N.X=1 N.Y=0 N.Z=0
            Variance.R=3 Variance.G=0 Variance.B=16",
            Some(4),
            false,
            true,
        ),
        (
            "renderman",
            "Ci.r=1 Ci.g=2 Ci.b=3 albedo.r=0.5 albedo.g=0.25 albedo.b=0.125 albedo_var.r=1 albedo_var.g=1 albedo_var.b=1
            normal.X=0 normal.Y=0.6 normal.Z=0.8 mse.r=0.75 mse.g=0 mse.b=4 z.z=7",
            Some(4),
            true,
            true,
        ),
        (
            "arnold",
            "R=1 G=2 B=3 denoise_albedo.R=0.5 denoise_albedo.G=0.25 denoise_albedo.B=0.125 N.X=0 N.Y=0.6 N.Z=0.8 Z.Z=7
            variance.R=3 variance.G=0 variance.B=16",
            Some(4),
            true,
            true,
        ),
        (
            "luxcore",
            "RGB_IMAGEPIPELINE.R=1 RGB_IMAGEPIPELINE.G=2 RGB_IMAGEPIPELINE.B=3 ALBEDO.R=0.5 ALBEDO.G=0.25 ALBEDO.B=0.125
            AVG_SHADING_NORMAL.X=0 AVG_SHADING_NORMAL.Y=0.6 AVG_SHADING_NORMAL.Z=0.8 DEPTH.Z=7 SAMPLECOUNT.Y=4",
            None,
            true,
            false,
        ),
    ];

    #[test]
    fn channels_of_other_programs_become_layers() {
        for &(name, text, spp, depth, variance) in FILES {
            let channel = |part: &str| {
                let (name, value) = part.split_once('=').unwrap();
                // Spaces in names are written as slashes.
                (name.replace('/', " "), value.parse().unwrap())
            };
            let channels: Vec<(String, f32)> = text.split_whitespace().map(channel).collect();
            let channels: Vec<_> = channels.iter().map(|(name, value)| (name.as_str(), *value)).collect();
            let frame = frame(&channels, spp);
            let data = |layer| frame.get(layer).map(|image| image.data.clone());
            assert_eq!(data(Layer::Color), Some(vec![1.0, 2.0, 3.0]), "{name}");
            assert_eq!(data(Layer::Albedo), Some(vec![0.5, 0.25, 0.125]), "{name}");
            assert_eq!(data(Layer::Normal), Some(vec![0.0, 0.6, 0.8]), "{name}");
            assert_eq!(data(Layer::Depth).is_some_and(|depth| depth == [7.0]), depth, "{name}");
            let expected = variance.then(|| vec![0.75, 0.0, 4.0]);
            assert_eq!(data(Layer::ColorVariance), expected, "{name}");
            assert_eq!(data(Layer::BinColor(3)).is_some(), variance, "{name}");
            let of_albedo = if name == "renderman" { 0.25 } else { 0.0 };
            assert_eq!(data(Layer::AlbedoVariance).map(|data| data[0]), Some(of_albedo), "{name}");
            assert!(data(Layer::NormalVariance).is_some(), "{name}");
        }
    }

    #[test]
    fn made_up_halves_have_the_mean_of_the_colour_and_noise_of_twice_its_variance() {
        let mut frame = Frame::new(100, 100);
        frame.set(Layer::Color, constant(&frame, 3, 5.0));
        frame.set(Layer::ColorVariance, constant(&frame, 3, 0.25));
        frame.set(Layer::Samples, constant(&frame, 1, 16.0));
        add_bins(&mut frame);
        let [a, _] = frame.color_half(0).unwrap();
        let [b, _] = frame.color_half(1).unwrap();
        assert!(a.data.iter().zip(&b.data).all(|(a, b)| (a + b - 10.0).abs() < 1e-5));
        // With the image's own noise of a quarter this makes a half, and none of it is in common.
        let variance = a.data.iter().map(|a| (a - 5.0).powi(2)).sum::<f32>() / a.data.len() as f32;
        assert!((variance - 0.25).abs() < 0.02, "{variance}");
    }
}
