//! Neural networks: inference of trained ones, on the CPU. The bits do not depend on the machine or the number of threads.
//!
//! ```text
//! weights (safetensors) -> convolutions -> tensor -> tensor
//! ```

pub mod convolution;
pub mod gradnet;
pub mod resample;
pub mod tensor;
pub mod unet;
pub mod weights;

pub use self::convolution::{Activation, Convolution};
pub use self::gradnet::GradNet;
pub use self::tensor::Tensor;
pub use self::unet::UNet;
pub use self::weights::Weights;
