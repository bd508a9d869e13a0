//! Reconstructions: methods that make an image from a frame.

mod apr;
mod blend;
mod common;
mod control_variate;
mod feature;
mod frgr;
mod gradnet;
mod l1;
mod l2;
mod least_trimmed;
mod lights;
mod net;
mod nfor;
mod nlm;
mod oidn;
mod parameters;
mod primal;
mod rdfc;

pub use self::lights::groups as light_groups;
pub use self::parameters::Parameters;
use crate::error::{Error, Result};
use crate::film::{Frame, Layer, Needs};
use crate::image::Image;
use crate::image::planes::Planes;

/// The result of a reconstruction.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The image in radiance, directly seen emitters included.
    pub image: Image,
    /// Share of every pixel that is covered, if the frame has it: filtered as the colours are where the method has weights
    /// for them, otherwise as sampled.
    pub alpha: Option<Image>,
    /// Expected squared error of each value, if the method estimates it.
    pub error: Option<Image>,
    /// Intermediate images, if the context asks for them.
    pub notes: Vec<Note>,
}

impl Solution {
    /// The intermediate image of a name, if the method made one.
    pub fn note(&self, name: &str) -> Option<&Image> {
        self.notes.iter().find(|note| note.name == name).map(|note| &note.image)
    }
}

/// An intermediate image.
#[derive(Clone, Debug)]
pub struct Note {
    /// Its name, in letters, digits and underscores.
    pub name: String,
    /// The image, in radiance.
    pub image: Image,
}

/// Everything that a method gets besides the frame.
#[derive(Clone, Copy)]
pub struct Context<'a> {
    /// Called with the current stage and the finished share.
    pub progress: &'a dyn Fn(&str, f32),
    /// Limit of the memory besides the frame, in bytes.
    pub memory: Option<u64>,
    /// Whether intermediate images are wanted.
    pub notes: bool,
}

impl Context<'_> {
    /// Runs a part of a method within the memory that is left when `held` bytes are taken off; an error names the sum of
    /// both.
    fn beside<T>(&self, held: u64, work: impl FnOnce(Option<u64>) -> Result<T>) -> Result<T> {
        work(self.memory.map(|memory| memory.saturating_sub(held))).map_err(|error| match error {
            Error::TooLittleMemory { method, size, bytes } => {
                Error::TooLittleMemory { method, size, bytes: bytes + held }
            }
            other => other,
        })
    }

    /// No progress, no limit, no intermediate images.
    pub const QUIET: Self = Self { progress: &|_, _| {}, memory: None, notes: false };
}

/// A method with its parameters set.
pub trait Reconstruction: Send + Sync {
    /// Statistics that the method takes.
    fn needs(&self) -> Needs;

    /// Whether solutions have an estimated error.
    fn estimates_error(&self) -> bool {
        false
    }

    /// Whether it takes differences to the four direct neighbours only, instead of those to any pixels.
    fn needs_cross(&self) -> bool {
        false
    }

    /// A quicker method with much the same error, if there is one: it serves between passes of adaptive sampling.
    fn guide(&self) -> Option<&dyn Reconstruction> {
        None
    }

    /// Duration of the guide over that of the method, by which the latter is foreseen.
    fn guide_share(&self) -> f64 {
        1.0
    }

    /// Warnings about what a frame lacks that the method does without.
    fn warnings(&self, _frame: &Frame) -> Vec<String> {
        Vec::new()
    }

    /// Shares of the scattered radiance, filtered by the weights that the method filters the colours by; none where it has no such
    /// weights.
    fn filter(&self, _frame: &Frame, _shares: &Planes) -> Result<Option<Planes>> {
        Ok(None)
    }

    /// The image without directly seen emitters, which [`solve`] adds.
    fn reconstruct(&self, frame: &Frame, context: &Context) -> Result<Solution>;
}

/// A parameter of a method.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// Its name in `method:name=value`.
    pub name: &'static str,
    /// Its value when not given.
    pub default: &'static str,
    /// Its meaning, with unit and range.
    pub summary: &'static str,
}

/// Contracts that a method keeps with its default parameters; stress cases and tests check them.
#[derive(Clone, Copy, Debug)]
pub struct Traits {
    /// A frame without noise is a fixed point. False for trained networks, whose images have no closed answers.
    pub exact: bool,
    /// The error is below that of the colours it is given.
    pub denoises: bool,
    /// The mean of the image is that of the colours, whatever the differences.
    pub keeps_mean: bool,
    /// Directly seen emitters are added after the reconstruction, and do not take part in it.
    pub direct_apart: bool,
    /// A firefly stays within 16 pixels, with errors of the size of the noise outside.
    pub robust: bool,
    /// Treatment of differences.
    pub edges: EdgeTrust,
    /// Largest deviation at another exposure, of the largest value. More than rounding where the method makes decisions.
    pub exposure_tolerance: f32,
}

/// How far a method trusts differences.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EdgeTrust {
    /// No differences are used.
    Unused,
    /// Whatever their variances say.
    Always,
    /// By their variances.
    ByVariance,
}

impl Traits {
    /// A method that takes features and colours only.
    pub const FILTER: Self = Self {
        exact: true,
        denoises: true,
        keeps_mean: false,
        direct_apart: true,
        robust: true,
        edges: EdgeTrust::Unused,
        exposure_tolerance: 1e-3,
    };
    /// A method that solves for differences, whatever their variances.
    pub const POISSON: Self = Self { robust: false, edges: EdgeTrust::Always, ..Self::FILTER };
}

/// A row of the table of methods.
pub struct Method {
    /// Name in `--method`.
    pub id: &'static str,
    /// Description for help texts.
    pub summary: &'static str,
    /// Contracts that it keeps.
    pub traits: Traits,
    /// Its parameters.
    pub parameters: &'static [Parameter],
    /// Builds it.
    pub make: fn(&Parameters) -> Result<Box<dyn Reconstruction>>,
}

/// Every method.
pub const METHODS: &[Method] = &[
    primal::METHOD,
    l2::METHOD,
    l1::METHOD,
    control_variate::METHOD,
    least_trimmed::METHOD,
    gradnet::METHOD,
    nlm::METHOD,
    rdfc::METHOD,
    nfor::METHOD,
    frgr::METHOD,
    feature::METHOD,
    apr::METHOD,
    net::METHOD,
    blend::METHOD,
    oidn::METHOD,
];

/// The method that `render` uses when none is given.
pub const DEFAULT: &str = "net";

/// Builds the method that a text such as `l2:alpha=0.2` names.
pub fn parse(text: &str) -> Result<Box<dyn Reconstruction>> {
    let (id, values) = text.split_once(':').unwrap_or((text, ""));
    let unknown = || Error::unknown("method", id, METHODS.iter().map(|method| method.id));
    let method = METHODS.iter().find(|method| method.id == id).ok_or_else(unknown)?;
    (method.make)(&Parameters::parse(method, values)?)
}

/// Names of the methods that find all that they need in a frame.
pub fn possible(frame: &Frame) -> Vec<&'static str> {
    let corner = frame.corner(16);
    let works =
        |method: &&Method| parse(method.id).is_ok_and(|made| made.reconstruct(&corner, &Context::QUIET).is_ok());
    METHODS.iter().filter(works).map(|method| method.id).collect()
}

/// Checks the values of edges that are none of a layer.
fn check_edges(frame: &Frame) -> Result<()> {
    let Some(edges) = frame.own_edges() else { return Ok(()) };
    let binned = edges.bins.iter().chain(&edges.ambient).flatten();
    let wrong = match edges.variance.iter().find(|variance| !variance.is_finite() || variance.min_element() < 0.0) {
        Some(_) => Some("variance"),
        None => edges.mean.iter().chain(binned).find(|value| !value.is_finite()).map(|_| "difference"),
    };
    let impossible = |weight: &f32| !weight.is_finite() || *weight < 0.0;
    match wrong.or_else(|| edges.weights.iter().flatten().find(|weight| impossible(weight)).map(|_| "weight")) {
        Some(what) => {
            Err(Error::BadData(format!("the frame has a {what} between chosen neighbours that is no possible one")))
        }
        None => Ok(()),
    }
}

/// Reconstructs a frame: checks that its values make sense, and adds the directly seen emitters to the method's image.
pub fn solve(method: &dyn Reconstruction, frame: &Frame, context: &Context) -> Result<Solution> {
    for (layer, image) in frame.present() {
        if let Some((x, y, c)) = image.not_finite() {
            let what = format!("channel {} is not finite at pixel {x},{y}", layer.channel_names()[c]);
            return Err(Error::BadData(what));
        }
        if let Some((x, y, c)) = image.find(|value| value < 0.0).filter(|_| layer.is_never_negative()) {
            let what = format!("channel {} is negative at pixel {x},{y}", layer.channel_names()[c]);
            return Err(Error::BadData(what));
        }
    }
    check_edges(frame)?;
    let mut solution = method.reconstruct(frame, context)?;
    if let Some(direct) = frame.get(Layer::Direct) {
        solution.image.add(direct);
    }
    solution.alpha = solution.alpha.or_else(|| frame.get(Layer::Alpha).cloned());
    if let (Some(error), Some(variance)) = (&mut solution.error, frame.get(Layer::DirectVariance)) {
        error.add(variance);
    }
    Ok(solution)
}
