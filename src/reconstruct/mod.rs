//! Reconstructions: methods that make an image of a frame.

mod apr;
mod control_variate;
mod feature;
mod features;
mod frgr;
mod generated;
mod inputs;
mod l1;
mod l2;
mod least_trimmed;
mod nfor;
mod nlm;
#[cfg(feature = "oidn")]
mod oidn;
mod parameters;
mod primal;
mod rdfc;

pub use self::parameters::Parameters;
use crate::error::{Error, Result};
use crate::film::{Frame, Layer, Needs};
use crate::image::Image;

/// What a method makes.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The image, directly seen emitters included.
    pub image: Image,
    /// Expected squared error of each value, where the method knows it.
    pub error: Option<Image>,
    /// Images on the way to it, if the context asks for them.
    pub notes: Vec<Note>,
}

/// An intermediate image.
#[derive(Clone, Debug)]
pub struct Note {
    /// What it is, in letters, digits and underscores.
    pub name: String,
    /// The image, in radiance.
    pub image: Image,
}

/// What a method is given besides the frame.
pub struct Context<'a> {
    /// Told what is being done and the finished share.
    pub progress: &'a dyn Fn(&str, f32),
    /// Bytes that may be used besides the frame.
    pub memory: Option<u64>,
    /// Whether intermediate images are wanted.
    pub notes: bool,
}

/// A method with its parameters set.
pub trait Reconstruction: Send + Sync {
    /// What must be rendered for it.
    fn needs(&self) -> Needs;

    /// Whether solutions have an error.
    fn estimates_error(&self) -> bool {
        false
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
    /// What it does, with its unit and range.
    pub summary: &'static str,
}

/// A row of the table of methods.
pub struct Method {
    /// The name in `--method`.
    pub id: &'static str,
    /// What it is.
    pub summary: &'static str,
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
    nlm::METHOD,
    rdfc::METHOD,
    nfor::METHOD,
    frgr::METHOD,
    feature::METHOD,
    apr::METHOD,
    #[cfg(feature = "oidn")]
    oidn::METHOD,
];

/// The method that `render` uses when none is given.
pub const DEFAULT: &str = "frgr";

/// Builds the method that a text such as `l2:alpha=0.2` names.
pub fn parse(text: &str) -> Result<Box<dyn Reconstruction>> {
    let (id, values) = text.split_once(':').unwrap_or((text, ""));
    let method = METHODS.iter().find(|method| method.id == id).ok_or_else(|| {
        let names: Vec<_> = METHODS.iter().map(|method| method.id).collect();
        Error::Usage(format!("method `{id}` is not known; there are {}", names.join(", ")))
    })?;
    (method.make)(&Parameters::parse(method, values)?)
}

/// Reconstructs a frame: checks that its values make sense, and adds the directly seen emitters to the method's image.
pub fn solve(method: &dyn Reconstruction, frame: &Frame, context: &Context) -> Result<Solution> {
    for (layer, image) in frame.present() {
        if let Some((x, y, c)) = image.not_finite() {
            let what = format!("channel {} is not finite at pixel {x},{y}", layer.channel_names()[c]);
            return Err(Error::Usage(what));
        }
        if let Some((x, y, c)) = image.find(|value| value < 0.0).filter(|_| layer.is_never_negative()) {
            let what = format!("channel {} is negative at pixel {x},{y}", layer.channel_names()[c]);
            return Err(Error::Usage(what));
        }
    }
    let mut solution = method.reconstruct(frame, context)?;
    if let Some(direct) = frame.get(Layer::Direct) {
        solution.image.add(direct);
    }
    if let (Some(error), Some(variance)) = (&mut solution.error, frame.get(Layer::DirectVariance)) {
        error.add(variance);
    }
    Ok(solution)
}
