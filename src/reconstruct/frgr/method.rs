//! The method `frgr`, by itself or near the image of another method.

use super::{Frgr, HELD_BYTES, Kind, Outcome};
use crate::error::Result;
use crate::film::{Frame, Layer, Needs, Recorded};
use crate::reconstruct::common::inputs::NET_BYTES;
use crate::reconstruct::net::Net;
use crate::reconstruct::oidn::{self, Features, Quality};
use crate::reconstruct::{Context, EdgeTrust, Method, Parameter, Parameters, Reconstruction, Solution, Traits};

const fn parameter(name: &'static str, default: &'static str, summary: &'static str) -> Parameter {
    Parameter { name, default, summary }
}

/// `frgr`.
pub const METHOD: Method = Method {
    id: "frgr",
    summary: "colours filtered by weights that gradients and features guide, on several scales; consistent",
    traits: Traits { edges: EdgeTrust::ByVariance, ..Traits::FILTER },
    parameters: &[
        parameter("levels", "2", "resolutions that are worked on, 1 to 8, each half of the one before"),
        parameter("radius", "4", "radius of the gradient-guided filter's window, 1 to 10 pixels"),
        parameter("form", "best", "`paper`: as published; `code`: as its authors' program; `best`: as measures best"),
        parameter("solver", "sweeps", "of the filter's weights: `sweeps`, stopped early, or `exact`, slower"),
        parameter("resample", "glu", "between resolutions: `glu`, guided linear upsampling, or `bilinear`"),
        parameter("albedo", "on", "whether the albedo guides, `on` or `off`; left out when the layer is missing"),
        parameter("normal", "on", "whether the normal guides, `on` or `off`; left out when the layer is missing"),
        parameter("denoised", "on", "whether the filter is held near the denoised image, `on` or `off`"),
        parameter(
            "denoiser",
            "rdfc",
            "of that image: `rdfc`, non-local means, `net`, or `oidn`, Open Image Denoise, if installed",
        ),
        parameter("enhance", "on", "whether gradients are weighted by their worth, `on` or `off`"),
        parameter("filter", "on", "whether colours are filtered, `on`, or the enhanced image is the result, `off`"),
    ],
    make,
};

fn make(parameters: &Parameters) -> Result<Box<dyn Reconstruction>> {
    let resample = parameters.choice("resample", &["glu", "bilinear"])?;
    let mut features = Vec::new();
    for (name, kind) in [("albedo", Kind::Albedo), ("normal", Kind::Normal)] {
        if parameters.switch(name)? {
            features.push(kind);
        }
    }
    let levels = parameters.get("levels", "a number from 1 to 8", |levels| (1..=8).contains(levels))?;
    let filtered = parameters.switch("filter")?;
    let frgr = Frgr {
        // Coarser levels guide the filter only.
        levels: if filtered { levels } else { 1 },
        radius: parameters.get("radius", "a number from 1 to 10", |radius| (1..=10).contains(radius))?,
        form: parameters.get("form", "paper, code or best", |_| true)?,
        solver: parameters.get("solver", "sweeps or exact", |_| true)?,
        guided: resample == "glu",
        features,
        denoised: parameters.switch("denoised")?,
        enhance: parameters.switch("enhance")?,
        filtered,
    };
    let denoiser = match parameters.choice("denoiser", &["rdfc", "oidn", "net"])?.as_ref() {
        "oidn" => Denoiser::Oidn,
        "net" => Denoiser::Net(Net::new(true)?),
        _ => Denoiser::Means,
    };
    Ok(Box::new(Near::new(frgr, denoiser)?))
}

/// [`Frgr`] near an image of a choice of denoisers.
pub struct Near {
    frgr: Frgr,
    denoiser: Denoiser,
}

/// The method whose image the result is near.
pub enum Denoiser {
    /// Non-local means.
    Means,
    /// Open Image Denoise.
    Oidn,
    /// Trained networks.
    Net(Net),
}

impl Near {
    /// Fails if the denoiser has to be installed and is not.
    pub fn new(frgr: Frgr, denoiser: Denoiser) -> Result<Self> {
        if let Denoiser::Oidn = denoiser {
            oidn::check()?;
        }
        Ok(Self { frgr, denoiser })
    }

    /// Filters, and gives the images on the way, too.
    pub fn run(&self, frame: &Frame, context: &Context) -> Result<Outcome> {
        let pixels = (frame.width * frame.height) as u64;
        let of_denoiser = if let Denoiser::Net(_) = self.denoiser { NET_BYTES * pixels } else { 0 };
        let base = self.frgr.begin(frame, context, of_denoiser)?;
        let report = |_: &str, share: f32| (context.progress)("denoise", 0.1 + 0.35 * share);
        let image = match &self.denoiser {
            Denoiser::Means => return self.frgr.run(&base, context),
            Denoiser::Oidn => {
                let networks = (Quality::High, Features::Prefiltered(Quality::Balanced));
                let direct = frame.get(Layer::Direct);
                context.beside(HELD_BYTES * pixels, |memory| oidn::clean(frame, direct, networks, memory))?
            }
            Denoiser::Net(net) => {
                let context_of = |memory| Context { progress: &report, memory, notes: false };
                context.beside(HELD_BYTES * pixels, |memory| net.image(frame, &context_of(memory)))?.image
            }
        };
        self.frgr.near_image(&base, &image, context)
    }
}

impl Reconstruction for Near {
    fn needs(&self) -> Needs {
        self.frgr.needs().with_if(Recorded::Features, !matches!(self.denoiser, Denoiser::Means))
    }

    fn estimates_error(&self) -> bool {
        true
    }

    fn needs_cross(&self) -> bool {
        true
    }

    fn reconstruct(&self, frame: &Frame, context: &Context) -> Result<Solution> {
        Ok(self.run(frame, context)?.solution)
    }
}
