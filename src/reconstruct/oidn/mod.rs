//! Open Image Denoise (Intel, 2018 on), a trained network, for comparison. It needs no gradients.

mod library;

use self::library::denoise;
pub use self::library::{Features, Quality, check};
use super::common::features::without_features;
use super::{Context, Method, Parameter, Parameters, Reconstruction, Solution, Traits};
use crate::error::Result;
use crate::film::{Frame, Layer, Needs, Recorded};
use crate::image::Image;

/// `oidn`.
pub const METHOD: Method = Method {
    id: "oidn",
    summary: "Open Image Denoise, a trained network, with albedo and normal; path tracing only; it has to be installed",
    traits: Traits { exact: false, direct_apart: false, ..Traits::FILTER },
    parameters: &[
        Parameter {
            name: "prefilter",
            default: "accurate",
            summary: "of albedo and normal: `accurate`, each denoised by itself first, `balanced`, by smaller networks, or `none`",
        },
        Parameter {
            name: "quality",
            default: "high",
            summary: "of the networks: `high`, `balanced` or `fast`, which take less time and leave more error",
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
    let quality = match parameters.choice("quality", &["high", "balanced", "fast"])?.as_ref() {
        "balanced" => Quality::Balanced,
        "fast" => Quality::Fast,
        _ => Quality::High,
    };
    let features = match parameters.choice("prefilter", &["accurate", "balanced", "none"])?.as_ref() {
        "accurate" => Features::Prefiltered(quality),
        "balanced" => Features::Prefiltered(Quality::Balanced),
        _ => Features::Noisy,
    };
    check()?;
    Ok(Box::new(Oidn { networks: (quality, features), direct: parameters.switch("direct")? }))
}

struct Oidn {
    networks: (Quality, Features),
    direct: bool,
}

impl Reconstruction for Oidn {
    fn needs(&self) -> Needs {
        Needs::NONE.with(Recorded::Features)
    }

    fn warnings(&self, frame: &Frame) -> Vec<String> {
        without_features(frame, "oidn", [Layer::Albedo, Layer::Normal])
    }

    fn reconstruct(&self, frame: &Frame, context: &Context) -> Result<Solution> {
        let direct = frame.get(Layer::Direct).filter(|_| self.direct);
        let image = clean(frame, direct, self.networks, context.memory)?;
        Ok(Solution { image, alpha: None, error: None, notes: Vec::new() })
    }
}

/// A frame's scattered light, denoised with the features that it has: together with the light of directly seen emitters, if that is given, which is
/// subtracted again, since it is added to every method's image. The library takes about so many bytes of `memory`.
pub fn clean(
    frame: &Frame,
    direct: Option<&Image>,
    networks: (Quality, Features),
    memory: Option<u64>,
) -> Result<Image> {
    let mut color = frame.require(Layer::Color)?.clone();
    direct.iter().for_each(|direct| color.add(direct));
    let mut image = denoise(&color, [Layer::Albedo, Layer::Normal].map(|layer| frame.get(layer)), networks, memory)?;
    direct.iter().for_each(|direct| {
        image.data.iter_mut().zip(&direct.data).for_each(|(value, direct)| *value -= direct);
    });
    Ok(image)
}
