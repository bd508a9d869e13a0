//! References: path-traced images of many samples with their own noise, as EXR files that can be continued.

mod check;

use std::path::Path;

use crate::error::{Error, Result};
use crate::film::{Film, Layer, Needs, Provenance};
use crate::image::Image;
use crate::image::io::{ImageFile, Kind, OpenImage, Pixels, read, write};
use crate::math::rng;
use crate::render::{Budget, Control, EPOCH, RenderSettings, render};
use crate::scene::Scene;

pub use self::check::{Verdict, check_folder};

/// Seed of references, far from those that people choose.
pub const SEED: u64 = 0x5eed_0000_0001;

/// Channels in files: radiance, directly seen emitters included; the standard error of each value (variances themselves
/// would be too small for half floats); and the first half less the second.
const CHANNELS: [&str; 9] =
    ["R", "G", "B", "sigma.R", "sigma.G", "sigma.B", "difference.R", "difference.G", "difference.B"];

/// Attribute of a reference's expected relMSE, by which files are known to be references.
const FLOOR: &str = "floor";

/// Largest half float.
const HALF_MAX: f32 = 65504.0;

/// A reference image: the mean of two halves whose samples are independent of each other. Within a half they go on from
/// wave to wave, so that many short waves are as good as a long one.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// Radiance, directly seen emitters included.
    pub image: Image,
    /// Variance of each value of `image`, from its samples. It takes no account of how evenly they are spread.
    pub variance: Image,
    /// The first half less the second.
    pub difference: Image,
    /// Samples per pixel, of both halves.
    pub spp: u32,
    /// Seed of the first half.
    pub seed: u64,
    /// Seeds of the references that were added.
    pub added: Vec<u64>,
    /// Seconds it took to render.
    pub seconds: f64,
    /// The scene's, in hexadecimal.
    pub fingerprint: String,
    /// [`EPOCH`] of the samples; 0 of files that do not say.
    pub epoch: u32,
}

impl Reference {
    /// A reference without samples.
    pub fn new(scene: &Scene, seed: u64) -> Self {
        let black = Image::new(scene.sensor().width, scene.sensor().height, 3);
        Self {
            image: black.clone(),
            variance: black.clone(),
            difference: black,
            spp: 0,
            seed,
            added: Vec::new(),
            seconds: 0.0,
            fingerprint: scene.fingerprint_hex(),
            epoch: EPOCH,
        }
    }

    /// Expected relMSE of the image itself against the true one, from the difference of the halves.
    pub fn floor(&self) -> f64 {
        if self.spp == 0 {
            return f64::INFINITY;
        }
        floor(&self.image, &self.difference)
    }

    /// Renders the next wave, `spp` samples in each half. Nothing changes when `control.stop` ends it early; then
    /// this is false.
    pub fn add_wave(&mut self, scene: &Scene, spp: u32, control: &Control) -> Result<bool> {
        let (mut halves, mut seconds) = (Vec::new(), 0.0);
        for (k, seed) in [self.seed, rng::combine(self.seed, 1)].into_iter().enumerate() {
            let progress = |share: f32| (control.progress)(0.5 * (k as f32 + share));
            let control = Control { stop: control.stop, progress: &progress, ..Control::QUIET };
            let (budget, first, needs) = (Budget::Spp(spp), self.spp / 2, Needs::default());
            let outcome = render(scene, RenderSettings { seed, first, ..RenderSettings::new(budget, needs) }, &control);
            if outcome.stopped {
                return Ok(false);
            }
            seconds += outcome.elapsed.as_secs_f64();
            halves.push(image_and_variance(&outcome.film)?);
        }
        self.merge(&halves[0], &halves[1], spp);
        self.seconds += seconds;
        Ok(true)
    }

    /// Adds a mean and its variance of `spp` samples to each half.
    fn merge(&mut self, a: &(Image, Image), b: &(Image, Image), spp: u32) {
        let m = 2.0 * f64::from(spp);
        for i in 0..self.image.data.len() {
            let at = |image: &Image| f64::from(image.data[i]);
            let difference = at(&a.0) - at(&b.0);
            let within = squares(at(&a.1), m / 2.0) + squares(at(&b.1), m / 2.0);
            let between = 0.25 * difference * difference * m;
            self.add_value(i, m, (0.5 * (at(&a.0) + at(&b.0)), within + between, difference));
        }
        self.spp += 2 * spp;
    }

    /// Adds a reference of other samples. The error says why that is not possible.
    pub fn add(&mut self, other: &Self) -> std::result::Result<(), String> {
        let size = |reference: &Self| (reference.image.width, reference.image.height);
        if size(self) != size(other) {
            return Err(format!("has {:?} pixels instead of {:?}", size(other), size(self)));
        }
        if self.fingerprint != other.fingerprint {
            return Err("is of another scene".into());
        }
        if self.epoch != other.epoch {
            return Err(format!("is of another epoch of samples: {}, not {}", other.epoch, self.epoch));
        }
        if let Some(seed) = other.seeds().find(|&seed| self.seeds().any(|own| own == seed)) {
            return Err(format!("has the same samples, those of --seed {seed}"));
        }
        let m = f64::from(other.spp);
        for i in 0..self.image.data.len() {
            let at = |image: &Image| f64::from(image.data[i]);
            self.add_value(i, m, (at(&other.image), squares(at(&other.variance), m), at(&other.difference)));
        }
        self.spp += other.spp;
        self.seconds += other.seconds;
        self.added.extend(other.seeds());
        Ok(())
    }

    /// Seeds of all samples.
    fn seeds(&self) -> impl Iterator<Item = u64> {
        std::iter::once(self.seed).chain(self.added.iter().copied())
    }

    /// Adds `m` samples of a value by their mean, their squared deviations from it, and the difference of their halves.
    fn add_value(&mut self, i: usize, m: f64, (mean, deviations, difference): (f64, f64, f64)) {
        let n = f64::from(self.spp);
        let share = m / (n + m);
        let at = |image: &Image| f64::from(image.data[i]);
        let (old, old_difference) = (at(&self.image), at(&self.difference));
        let between = (mean - old) * (mean - old) * n * share;
        let all = squares(at(&self.variance), n) + deviations + between;
        self.variance.data[i] = (all / ((n + m) * (n + m - 1.0))) as f32;
        self.image.data[i] = (old + share * (mean - old)) as f32;
        self.difference.data[i] = (old_difference + share * (difference - old_difference)) as f32;
    }

    /// Whether every value is one that half floats have room for.
    pub fn fits_half(&self) -> bool {
        self.image.data.iter().chain(&self.difference.data).all(|value| value.abs() <= HALF_MAX)
            && self.variance.data.iter().all(|variance| variance.sqrt() <= HALF_MAX)
    }

    /// Writes it as half floats, if it fits, or as floats. The file is replaced at once: there is never half of one.
    pub fn save(&self, path: &Path, half: bool) -> Result<()> {
        let mut data = Vec::with_capacity(self.image.data.len() * 3);
        for pixel in (0..self.image.data.len()).step_by(3) {
            let rgb = |image: &Image| [image.data[pixel], image.data[pixel + 1], image.data[pixel + 2]];
            data.extend(rgb(&self.image));
            data.extend(rgb(&self.variance).map(f32::sqrt));
            data.extend(rgb(&self.difference));
        }
        let provenance = Provenance {
            method: "primal".into(),
            fingerprint: self.fingerprint.clone(),
            epoch: self.epoch.to_string(),
            seed: self.seeds().map(|seed| seed.to_string()).collect::<Vec<_>>().join("+"),
            spp: self.spp.to_string(),
            seconds: format!("{:.3}", self.seconds),
            ..Provenance::new()
        };
        let mut attributes = provenance.attributes();
        attributes.push((Provenance::name(FLOOR), format!("{:.3e}", self.floor())));
        let channels = CHANNELS.map(String::from).to_vec();
        let (width, height) = (self.image.width, self.image.height);
        let pixels = Pixels { width, height, channels, data, window: None, attributes };
        write(path, &pixels, if half && self.fits_half() { Kind::Half } else { Kind::Float }, Some("zip"))
    }

    /// Whether a file was written by [`Reference::save`].
    pub fn is_one(path: &Path) -> Result<bool> {
        Ok(ImageFile::open(path)?.attribute(&Provenance::name(FLOOR)).is_some())
    }

    /// Reads one that [`Reference::save`] wrote.
    pub fn load(path: &Path) -> Result<Self> {
        let pixels = read(path, &Provenance::NAMES)?;
        let Provenance { fingerprint, epoch, seed, spp, seconds, .. } = Provenance::from_attributes(&pixels.attributes);
        let lacks = |name: &str| not_one(path, &format!("its header has no sensible `fluxion:{name}`"));
        let spp = spp.parse::<u32>().ok().filter(|spp| *spp > 0 && spp % 2 == 0);
        let seconds = seconds.parse::<f64>().ok().filter(|s| (0.0..1e9).contains(s));
        let seeds = seed.split('+').map(|seed| seed.parse().ok()).collect::<Option<Vec<u64>>>();
        let (seed, added) = seeds.and_then(|seeds| Some((*seeds.first()?, seeds[1..].to_vec()))).unzip();
        let fingerprint = Some(fingerprint).filter(|text| !text.is_empty());
        let positions = CHANNELS.map(|name| pixels.channels.iter().position(|other| other == name));
        let Some(positions) = positions.into_iter().collect::<Option<Vec<_>>>() else {
            return Err(not_one(path, &format!("it lacks some of the channels {}", CHANNELS.join(", "))));
        };
        let channels = |positions: &[usize]| {
            let samples = pixels.data.chunks_exact(pixels.channels.len());
            let data = samples.flat_map(|pixel| positions.iter().map(|&at| pixel[at])).collect();
            Image { width: pixels.width, height: pixels.height, channels: 3, data }
        };
        let [image, mut variance, difference] = [0, 3, 6].map(|first| channels(&positions[first..first + 3]));
        for (what, image) in [("value", &image), ("standard error", &variance), ("difference", &difference)] {
            if let Some((x, y, _)) = image.not_finite() {
                return Err(Error::bad_data(path, format!("the {what} at pixel {x},{y} is not finite")));
            }
        }
        variance.data.iter_mut().for_each(|sigma| *sigma *= *sigma);
        Ok(Self {
            image,
            variance,
            difference,
            spp: spp.ok_or_else(|| lacks("spp"))?,
            seed: seed.ok_or_else(|| lacks("seed"))?,
            added: added.unwrap_or_default(),
            seconds: seconds.ok_or_else(|| lacks("seconds"))?,
            fingerprint: fingerprint.ok_or_else(|| lacks("fingerprint"))?,
            epoch: epoch.parse().unwrap_or(0),
        })
    }
}

/// Sum of `n` samples' squared deviations from their mean, from the variance of that.
fn squares(variance: f64, n: f64) -> f64 {
    variance * n * (n - 1.0).max(0.0)
}

/// Expected relMSE of the mean of two independent halves, from their difference.
pub fn floor(image: &Image, difference: &Image) -> f64 {
    relative(image, difference.data.iter().map(|&difference| (f64::from(difference) / 2.0).powi(2)))
}

/// Mean of squared errors over the squares of an image's values, as relMSE has it.
pub fn relative(image: &Image, squares: impl Iterator<Item = f64>) -> f64 {
    let of = |(&value, square): (&f32, f64)| square / (f64::from(value) * f64::from(value) + 0.01);
    image.data.iter().zip(squares).map(of).sum::<f64>() / image.data.len() as f64
}

fn not_one(path: &Path, why: &str) -> Error {
    Error::io(path, format!("is no reference made by `fluxion reference`: {why}"))
}

/// Fails if a reference with the fingerprint `known` is not of this scene.
pub fn check(known: &str, path: &Path, scene: &Scene) -> Result<()> {
    let other = scene.fingerprint_hex();
    if known != other {
        let what = format!(
            "is the reference of another scene or of an older version of it (fingerprint {known}, the scene has \
             {other}); `fluxion reference` makes one"
        );
        return Err(Error::mismatch(path, what));
    }
    Ok(())
}

/// Radiance with directly seen emitters, and its variance.
pub fn image_and_variance(film: &Film) -> Result<(Image, Image)> {
    let frame = film.develop();
    let sum = |a, b| {
        let mut image = frame.require(a)?.clone();
        image.add(frame.require(b)?);
        Ok::<_, Error>(image)
    };
    Ok((sum(Layer::Color, Layer::Direct)?, sum(Layer::ColorVariance, Layer::DirectVariance)?))
}
