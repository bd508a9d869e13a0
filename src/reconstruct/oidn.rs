//! Open Image Denoise (Intel, 2018 on), a trained network, for comparison. It needs no gradients.

use super::{Context, Method, Parameter, Parameters, Reconstruction, Solution, Traits};
use crate::error::Result;
use crate::film::{Frame, Layer, Needs};
use crate::image::Image;
use crate::image::oidn::{check, denoise};

/// `oidn`.
pub const METHOD: Method = Method {
    id: "oidn",
    summary: "Open Image Denoise, a trained network, with albedo and normal; path tracing only; it has to be installed",
    traits: Traits { exact: false, ..Traits::FILTER },
    parameters: &[
        Parameter {
            name: "prefilter",
            default: "accurate",
            summary: "of albedo and normal: `accurate`, each denoised by itself first, or `none`",
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
    let accurate = parameters.choice("prefilter", &["accurate", "none"])? == "accurate";
    check()?;
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

    fn reconstruct(&self, frame: &Frame, context: &Context) -> Result<Solution> {
        let image = clean(frame, self.accurate, frame.get(Layer::Direct).filter(|_| self.direct), context.memory)?;
        Ok(Solution { image, alpha: None, error: None, notes: Vec::new() })
    }
}

/// A frame's scattered light, denoised: together with the light of directly seen emitters, if that is given, which is
/// subtracted again, since it is added to every method's image. The library takes about so many bytes of `memory`.
pub fn clean(frame: &Frame, accurate: bool, direct: Option<&Image>, memory: Option<u64>) -> Result<Image> {
    let (albedo, normal) = (frame.require(Layer::Albedo)?, frame.require(Layer::Normal)?);
    let mut color = frame.require(Layer::Color)?.clone();
    direct.iter().for_each(|direct| color.add(direct));
    let mut image = denoise(&color, [albedo, normal], accurate, memory)?;
    direct.iter().for_each(|direct| {
        image.data.iter_mut().zip(&direct.data).for_each(|(value, direct)| *value -= direct);
    });
    Ok(image)
}
