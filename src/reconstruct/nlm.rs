//! Non-local means (Buades et al. 2005, with the distance of Rousselle et al. 2012), of the colour alone or with
//! features. It needs no gradients.

use super::common::features::{Feature, Kind, without_features};
use super::common::inputs::{Inputs, check_memory};
use super::{Context, Method, Parameter, Parameters, Reconstruction, Solution, Traits};
use crate::error::Result;
use crate::film::{Frame, Needs, Recorded};
use crate::image::nl_means::{self, Guides, NlmSettings};
use crate::image::planes::Planes;

/// `nlm`.
pub const METHOD: Method = Method {
    id: "nlm",
    summary: "non-local means of the colour; path tracing only",
    traits: Traits::FILTER,
    parameters: &[
        Parameter { name: "window", default: "9", summary: "radius of the window, 1 to 12 pixels" },
        Parameter { name: "patch", default: "3", summary: "radius of the patches that are compared, 0 to 4 pixels" },
        Parameter { name: "k", default: "0.45", summary: "differences that are tolerated, in standard deviations" },
        Parameter {
            name: "features",
            default: "on",
            summary: "whether albedo and normal must be alike too, `on` or `off`",
        },
    ],
    make,
};

/// Bytes held for every pixel besides the frame, an upper bound.
const BYTES: u64 = 250;

/// Tolerance of features, in standard deviations.
const FEATURE: f32 = 0.6;

fn make(parameters: &Parameters) -> Result<Box<dyn Reconstruction>> {
    let features = parameters.switch("features")?;
    Ok(Box::new(Nlm {
        features,
        settings: NlmSettings {
            window: parameters.get("window", "a number from 1 to 12", |window| (1..=12).contains(window))?,
            patch: parameters.get("patch", "a number from 0 to 4", |patch| (0..=4).contains(patch))?,
            color: parameters.get("k", "a number in [0.01, 100]", |k| (0.01..=100.0).contains(k))?,
            feature: features.then_some(FEATURE),
        },
    }))
}

/// Features that pixels are compared by.
const KINDS: [Kind; 2] = [Kind::Albedo, Kind::Normal];

/// The filter with its parameters.
pub struct Nlm {
    features: bool,
    settings: NlmSettings,
}

impl Nlm {
    /// The images that pixels are compared by.
    fn guides(&self, inputs: &Inputs) -> Result<Guides> {
        let mut features = Vec::new();
        if self.features {
            let has = |kind: &Kind| kind.layers().iter().all(|&layer| inputs.frame.get(layer).is_some());
            for kind in KINDS.into_iter().filter(has) {
                features.push(Feature::of(kind, inputs)?.guide());
            }
        }
        Ok(Guides { color: inputs.guide()?, features })
    }
}

impl Nlm {
    /// `nlm` with a window of another radius.
    pub fn of_window(window: usize) -> Self {
        Self { features: true, settings: NlmSettings { window, patch: 3, color: 0.45, feature: Some(FEATURE) } }
    }
}

impl Reconstruction for Nlm {
    fn needs(&self) -> Needs {
        Needs::NONE.with_if(Recorded::Features, self.features)
    }

    fn warnings(&self, frame: &Frame) -> Vec<String> {
        if self.features { without_features(frame, METHOD.id, KINDS.map(|kind| kind.layers()[0])) } else { Vec::new() }
    }

    fn filter(&self, frame: &Frame, shares: &Planes) -> Result<Option<Planes>> {
        Ok(Some(nl_means::filter(shares, &self.guides(&Inputs::new(frame, 1)?)?, self.settings)))
    }

    fn reconstruct(&self, frame: &Frame, context: &Context) -> Result<Solution> {
        let inputs = Inputs::new(frame, 1)?;
        check_memory(frame, context, METHOD.id, BYTES)?;
        let guides = self.guides(&inputs)?;
        let alpha = inputs.alpha()?;
        let values = alpha.as_ref().map(|alpha| guides.color.mean.clone().and(alpha));
        let filtered = nl_means::filter(values.as_ref().unwrap_or(&guides.color.mean), &guides, self.settings);
        let image = filtered.part(0, 3).to_image(frame.width, frame.height, 1.0 / inputs.scale);
        let alpha = alpha.map(|_| inputs.clamp_alpha(filtered.part(3, 1).to_image(frame.width, frame.height, 1.0)));
        let alpha = alpha.transpose()?;
        Ok(Solution { image, alpha, error: None, notes: Vec::new() })
    }
}
