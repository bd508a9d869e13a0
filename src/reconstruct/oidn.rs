//! Open Image Denoise (Intel, 2018 on), a trained network, for comparison. It needs no gradients.

use super::{Context, Method, Parameter, Parameters, Reconstruction, Solution, Traits};
use crate::error::Result;
use crate::film::{Frame, Layer, Needs};
use crate::image::oidn::denoise;

/// `oidn`.
pub const METHOD: Method = Method {
    id: "oidn",
    summary: "Open Image Denoise, a trained network, with albedo and normal; path tracing only",
    traits: Traits { exact: false, ..Traits::FILTER },
    parameters: &[
        Parameter {
            name: "prefilter",
            default: "none",
            summary: "of albedo and normal: `none`, or `accurate`, each denoised by itself first",
        },
        Parameter {
            name: "direct",
            default: "on",
            summary: "whether directly seen emitters are denoised with the rest, `on`, or added afterwards, `off`",
        },
    ],
    make,
};

fn make(parameters: &Parameters) -> Result<Box<dyn Reconstruction>> {
    let accurate = parameters.choice("prefilter", &["none", "accurate"])? == "accurate";
    Ok(Box::new(Oidn { accurate, direct: parameters.switch("direct")? }))
}

struct Oidn {
    accurate: bool,
    direct: bool,
}

impl Reconstruction for Oidn {
    fn needs(&self) -> Needs {
        Needs { features: true, ..Needs::default() }
    }

    fn reconstruct(&self, frame: &Frame, _context: &Context) -> Result<Solution> {
        let (albedo, normal) = (frame.require(Layer::Albedo)?, frame.require(Layer::Normal)?);
        let direct = frame.get(Layer::Direct).filter(|_| self.direct);
        let mut color = frame.require(Layer::Color)?.clone();
        direct.iter().for_each(|direct| color.add(direct));
        let mut image = denoise(&color, albedo, normal, self.accurate)?;
        // They are added again to every method's image.
        direct.iter().for_each(|direct| {
            image.data.iter_mut().zip(&direct.data).for_each(|(value, direct)| *value -= direct);
        });
        Ok(Solution { image, alpha: None, error: None, notes: Vec::new() })
    }
}
