//! FRGR, multi-scale filtering reconstruction for gradient-domain rendering (Yan et al. 2024).
//!
//! ```text
//! gradients ─ outliers ──────────┐                                 coarse level, the same way ─┐
//! features ── clean ─┐           ├─ enhance ─ an image of the best ─┐                          │ up
//! colour ─────────── denoise ────┘            differences           ├─ filter ─ result ────────┘
//!                    └── resample: choices for going down and up ───┘
//! ```
//!
//! Every pixel of the result is a convex combination of the sampled colours around it. What their differences should
//! be is known from the gradients, enhanced into those of an image; how much noise they carry from their variances.

mod denoise;
mod enhance;
mod filter;
mod form;
mod level;
mod method;
mod outliers;
mod pyramid;
mod resample;

use std::borrow::Cow;

use self::enhance::{Enhanced, enhance};
use self::filter::{FilterProblem, Solver, Term};
use self::form::Form;
use self::level::Level;
pub use self::method::{Denoiser, METHOD, Near};
use self::resample::Resampling;
use super::common::features::{Feature, Kind};
use super::common::inputs::Inputs;
use super::{Context, Note, Reconstruction, Solution};
use crate::error::{Error, Result};
use crate::film::{EdgeNeed, Frame, Needs, Recorded};
use crate::image::Image;
use crate::image::nl_means::rdfc::Denoised;
use crate::image::planes::Planes;
use crate::solve::poisson;

/// The reconstruction with its parameters: by itself near non-local means, or near any other image by [`Frgr::near`].
#[derive(Clone)]
pub struct Frgr {
    levels: usize,
    radius: usize,
    form: Form,
    solver: Solver,
    guided: bool,
    features: Vec<Kind>,
    denoised: bool,
    enhance: bool,
    filtered: bool,
}

impl Default for Frgr {
    /// The parameters of `frgr`.
    fn default() -> Self {
        Self {
            levels: 2,
            radius: 4,
            form: Form::Best,
            solver: Solver::Sweeps,
            guided: true,
            features: vec![Kind::Albedo, Kind::Normal],
            denoised: true,
            enhance: true,
            filtered: true,
        }
    }
}

/// Floats held for every pixel besides the frame while levels are worked on, of the finest level while another method denoises
/// it, and while a band is denoised: upper bounds; 160 were measured in all.
const LEVEL_FLOATS: u64 = 180;
const HELD_FLOATS: u64 = 40;
const BAND_FLOATS: u64 = 45;

/// A band that is worked on has at least so many rows.
const LEAST_ROWS: u64 = 32;

/// A frame as [`Frgr`] works on it: outliers removed, features cleaned, variances raised to those around. Made once, for any number of
/// images that it is filtered near.
pub struct Base<'a> {
    inputs: Inputs<'a>,
    level: Level,
}

/// A level and its denoised image.
struct Prepared<'a> {
    level: Cow<'a, Level>,
    denoised: Planes,
    error: Planes,
}

/// A filtered image, with those that it was made of.
pub struct Outcome {
    /// The filtered image.
    pub solution: Solution,
    /// The image that it is near, in radiance.
    pub denoised: Image,
    /// The image of the enhanced differences, in radiance.
    pub enhanced: Image,
}

impl Reconstruction for Frgr {
    fn needs(&self) -> Needs {
        Needs { edges: EdgeNeed::Thinned, ..Needs::NONE }.with_if(Recorded::Features, !self.features.is_empty())
    }

    fn estimates_error(&self) -> bool {
        true
    }

    fn needs_cross(&self) -> bool {
        true
    }

    fn reconstruct(&self, frame: &Frame, context: &Context) -> Result<Solution> {
        Ok(self.run(&self.begin(frame, context, 0)?, context)?.solution)
    }
}

/// Bytes that are held besides the frame of a pixel while another method makes the image that the result is near.
pub const HELD_BYTES: u64 = 4 * HELD_FLOATS;

impl Frgr {
    /// The reconstruction that ends with the image of the enhanced differences.
    pub fn unfiltered(self) -> Self {
        // Coarser levels guide the filter only.
        Self { levels: 1, filtered: false, ..self }
    }

    /// Prepares a frame. Fails if what is held, and `more` bytes of the method that makes the image to filter near, is not within the bound on
    /// memory.
    pub fn begin<'a>(&self, frame: &'a Frame, context: &Context, more: u64) -> Result<Base<'a>> {
        (context.progress)("clean", 0.0);
        let inputs = Inputs::new(frame, 1 << (self.levels - 1))?;
        rows_beside(&inputs, context, more)?;
        let level = self.prepare(&inputs, frame)?;
        Ok(Base { inputs, level })
    }

    /// Filters near the image of non-local means.
    pub fn run(&self, base: &Base, context: &Context) -> Result<Outcome> {
        let rows = rows_beside(&base.inputs, context, 0)?;
        (context.progress)("denoise", 0.1);
        let report = |share: f32| (context.progress)("denoise", 0.1 + 0.35 * share);
        self.near(base, denoise::by_means(&base.level, self.form, rows, &report), context)
    }

    /// Filters near an image that another method has made of the frame, in radiance.
    pub fn near_image(&self, base: &Base, image: &Image, context: &Context) -> Result<Outcome> {
        self.near(base, denoise::judged(&base.level, &base.inputs, image), context)
    }

    /// Filters near a denoised image.
    fn near(&self, base: &Base, denoised: Denoised, context: &Context) -> Result<Outcome> {
        let Base { inputs, level } = base;
        let frame = inputs.frame;
        let mut notes = Notes { wanted: context.notes, size: (frame.width, frame.height), notes: Vec::new() };
        notes.add("dx", &level.gradients[0], inputs.scale);
        notes.add("dy", &level.gradients[1], inputs.scale);
        notes.add("denoised", &denoised.image, inputs.scale);
        let image_of = |planes: &Planes| planes.to_image(frame.width, frame.height, 1.0 / inputs.scale);
        let shown = image_of(&denoised.image);
        let Denoised { image, error } = denoised;
        (context.progress)("pyramid", 0.45);
        let mut levels = vec![Prepared { level: Cow::Borrowed(level), denoised: image, error }];
        let mut choices = Vec::new();
        for k in 1..self.levels {
            let (coarse, choice) = self.coarser(&levels[k - 1]);
            notes.add(&format!("level{k}_color"), &coarse.level.color, inputs.scale);
            levels.push(coarse);
            choices.push(choice);
        }
        let mut upper: Option<[Planes; 2]> = None;
        for k in (0..self.levels).rev() {
            // A level has four times the pixels of the one before.
            let left = 0.4 * 0.25f32.powi(k as i32);
            (context.progress)("enhance", 1.0 - left - 0.1);
            let this = levels.pop().expect("as many as are counted");
            let enhanced = self.enhance(&this, inputs.spp);
            notes.add(&format!("level{k}_enhanced"), &enhanced.image, inputs.scale);
            let outcome = |image: &Planes, notes: Notes| {
                let error = Some(error_image(&this, &enhanced, inputs, frame));
                let solution = Solution { image: image_of(image), alpha: None, error, notes: notes.notes };
                Outcome { solution, denoised: shown.clone(), enhanced: image_of(&enhanced.image) }
            };
            if !self.filtered {
                return Ok(outcome(&enhanced.image, notes));
            }
            (context.progress)("filter", 1.0 - 0.5 * left);
            let [image, variance] = self.filter(&this, &enhanced.image, upper.as_ref(), inputs.spp);
            notes.add(&format!("level{k}_filtered"), &image, inputs.scale);
            if k == 0 {
                return Ok(outcome(&image, notes));
            }
            upper = Some([choices[k - 1].up(&image), choices[k - 1].up_variance(&variance.sum())]);
        }
        unreachable!("there is a level 0")
    }

    /// The finest level: outliers removed, features cleaned, variances raised to those around.
    fn prepare(&self, inputs: &Inputs, frame: &Frame) -> Result<Level> {
        let [color, variance] = inputs.color()?;
        let noise_test = self.form != Form::Code;
        let clean = |axis: usize| {
            let [mean, variance] = inputs.gradient(axis)?;
            let edges = [[inputs.width - 1, inputs.height], [inputs.width, inputs.height - 1]][axis];
            Ok::<_, Error>(outliers::remove(&mean, &variance, edges, noise_test))
        };
        let ([dx, dx_noise], [dy, dy_noise]) = (clean(0)?, clean(1)?);
        let mut features = Vec::new();
        for &kind in &self.features {
            if frame.get(kind.layers()[0]).is_some() {
                features.push(Feature::of(kind, inputs)?);
            }
        }
        let level = Level { color, variance, gradients: [dx, dy], noise: [dx_noise, dy_noise], features };
        Ok(if self.form == Form::Best { level.with_variance_floor() } else { level })
    }

    /// The next level, and how to get to it and back.
    fn coarser(&self, fine: &Prepared) -> (Prepared<'static>, Resampling) {
        let Prepared { level, denoised, error } = fine;
        let choice = if self.guided {
            let features = level.features.iter().map(|feature| feature.mean.map(|value| 0.1 * value));
            Resampling::guided(&features.fold(denoised.clone(), |guide, feature| guide.and(&feature)))
        } else {
            Resampling::bilinear(denoised.width, denoised.height)
        };
        let features = level.features.iter().map(|feature| Feature {
            kind: feature.kind,
            mean: choice.down(&feature.mean),
            variance: choice.down_variance(&feature.variance),
        });
        let coarse = Level {
            color: choice.down(&level.color),
            variance: choice.down_variance(&level.variance),
            gradients: pyramid::gradients(&choice, &level.gradients),
            noise: pyramid::variances(&choice, &level.noise),
            features: features.collect(),
        };
        let prepared =
            Prepared { level: Cow::Owned(coarse), denoised: choice.down(denoised), error: choice.down(error) };
        (prepared, choice)
    }

    fn enhance(&self, this: &Prepared, spp: f32) -> Enhanced {
        if self.enhance {
            return enhance(&this.level, &this.denoised, &this.error, self.form, spp);
        }
        // The image of the sampled differences as they are, all of the same weight.
        let level = &this.level;
        let (width, height) = (level.color.width, level.color.height);
        let channel = |planes: &Planes, c: usize| -> Vec<f64> {
            (0..width * height).map(|i| f64::from(planes.at(c, (i % width) as isize, (i / width) as isize))).collect()
        };
        let [dx, dy] = &level.gradients;
        let solve = |c| poisson::screened(width, &channel(&level.color, c), &channel(dx, c), &channel(dy, c), 0.2);
        let channels = [solve(0), solve(1), solve(2)];
        let image = Planes::from_fn(width, height, 3, |c, x, y| channels[c][y * width + x] as f32);
        Enhanced { image, error: None }
    }

    /// The filtered colour and its variance. `upper` is the result of the coarser level and the sum of its variances.
    fn filter(&self, this: &Prepared, guide: &Planes, upper: Option<&[Planes; 2]>, spp: f32) -> [Planes; 2] {
        let Prepared { level, denoised, .. } = this;
        let weights = self.form.weights(spp);
        let mut terms = vec![Term { value: Cow::Borrowed(guide), target: guide, weight: 1.0 }];
        if self.denoised {
            let target = if self.form == Form::Best && self.enhance { guide } else { denoised };
            terms.push(Term { value: Cow::Borrowed(&level.color), target, weight: weights.denoised });
        }
        for feature in &level.features {
            let mean = &feature.mean;
            let weight = if feature.kind == Kind::Albedo { weights.albedo } else { weights.normal };
            let value = match upper {
                // In the authors' program these also ask that colour and upsampled result agree.
                Some([up, _]) if self.form == Form::Code => {
                    Cow::Owned(level.color.zip(up, |color, up| color - up).zip(mean, |rest, mean| rest + mean))
                }
                _ => Cow::Borrowed(mean),
            };
            if weight > 0.0 {
                terms.push(Term { value, target: mean, weight });
            }
        }
        let mut penalty = level.variance.sum();
        if let Some([up, up_variance]) = upper {
            terms.push(Term { value: Cow::Borrowed(up), target: up, weight: weights.upsampled });
            if self.form != Form::Paper {
                penalty = penalty.zip(up_variance, |color, up| color + up);
            }
        }
        let (color, variance) = (&level.color, &level.variance);
        FilterProblem { color, variance, penalty: &penalty, terms, radius: self.radius, solver: self.solver }.solve()
    }
}

/// Rows that may be denoised at a time while `more` bytes are another method's; fails if the bound on memory does not allow that.
fn rows_beside(inputs: &Inputs, context: &Context, more: u64) -> Result<usize> {
    rows(inputs, context.memory, HELD_BYTES * (inputs.width * inputs.height) as u64 + more)
}

/// Rows that are denoised at a time, within a bound on memory, of which the denoiser takes so many bytes.
fn rows(inputs: &Inputs, memory: Option<u64>, denoiser: u64) -> Result<usize> {
    let Some(memory) = memory else { return Ok(inputs.height) };
    let (width, height) = (inputs.width as u64, inputs.height as u64);
    let levels = 4 * LEVEL_FLOATS * width * height;
    let row = 4 * BAND_FLOATS * width;
    let least = (levels + row * LEAST_ROWS.min(height)).max(denoiser);
    if memory < least {
        return Err(Error::TooLittleMemory { method: METHOD.id, size: (inputs.width, inputs.height), bytes: least });
    }
    Ok(((memory - levels) / row).min(height) as usize)
}

/// Estimated squared error of every value: the channels share it by their variances.
fn error_image(this: &Prepared, enhanced: &Enhanced, inputs: &Inputs, frame: &Frame) -> Image {
    let variance = &this.level.variance;
    let total = variance.sum();
    let error = enhanced.error.as_ref().unwrap_or(&this.error);
    let value = |c: usize, x: usize, y: usize| {
        let (x, y) = (x as isize, y as isize);
        let share = if total.at(0, x, y) > 0.0 { 3.0 * variance.at(c, x, y) / total.at(0, x, y) } else { 1.0 };
        share * error.at(0, x, y).max(0.0)
    };
    let planes = Planes::from_fn(inputs.width, inputs.height, 3, value);
    planes.to_image(frame.width, frame.height, 1.0 / (inputs.scale * inputs.scale))
}

/// Intermediate images, if they are wanted.
struct Notes {
    wanted: bool,
    size: (usize, usize),
    notes: Vec<Note>,
}

impl Notes {
    fn add(&mut self, name: &str, planes: &Planes, scale: f32) {
        if self.wanted {
            // Coarse levels keep the padding that makes their sides even.
            let (width, height) = (planes.width.min(self.size.0), planes.height.min(self.size.1));
            self.notes.push(Note { name: name.to_owned(), image: planes.to_image(width, height, 1.0 / scale) });
        }
    }
}
