//! The three forms of the method: as published, as its authors' program has it, and as measures best here.

/// A form of the method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Yan et al. 2024, as printed.
    Paper,
    /// As the authors' program, where it differs from the paper.
    Code,
    /// Weights by the noise that is left, so that the error keeps falling as samples are added.
    Best,
}

impl std::str::FromStr for Form {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        match text {
            "paper" => Ok(Self::Paper),
            "code" => Ok(Self::Code),
            "best" => Ok(Self::Best),
            _ => Err(()),
        }
    }
}

/// Weights of the terms of the filter's objective besides the gradients', whose weight is 1.
pub struct Weights {
    /// Material colour.
    pub albedo: f32,
    /// Shading normal.
    pub normal: f32,
    /// The denoised image: of [`Form::Best`] the one that gradients have gone into.
    pub denoised: f32,
    /// The result of the coarser level.
    pub upsampled: f32,
}

impl Form {
    /// Radius of the window of the first denoising. With good gradients little is gained beyond five pixels, and
    /// bias comes with it.
    pub fn window(self) -> usize {
        if self == Self::Best { 5 } else { 10 }
    }

    /// Radius of the window that the choice between the first denoising's filters is smoothed over.
    pub fn choice(self) -> usize {
        match self {
            Self::Paper => 0,
            Self::Code => 3,
            Self::Best => 2,
        }
    }

    /// Weights for a number of samples per pixel (Yan et al. 2024, section 3.3.5).
    pub fn weights(self, spp: f32) -> Weights {
        let root = 1.0 / spp.sqrt();
        match self {
            Self::Paper => {
                Weights { albedo: 16.0 * root, normal: 0.16 * root, denoised: 8.0 * root, upsampled: 8.0 * root }
            }
            Self::Code => Weights {
                albedo: 16.0 * root,
                normal: 0.16 * root,
                denoised: 8.0 * root,
                upsampled: (8.0 * root).min(1.0),
            },
            // Features have done their part in the denoised image. The coarse level has less noise and is less
            // sharp: its share falls like the variance of what it is weighed against.
            Self::Best => Weights { albedo: 0.0, normal: 0.0, denoised: 0.5, upsampled: (64.0 / spp).min(4.0) },
        }
    }
}
