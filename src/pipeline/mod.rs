//! A render from the recipe to the written image: the one place that joins scene, method, plan, samples and outputs.
//!
//! ```text
//! Recipe --load--> Scene --prepare--> Prepared --run--> Rendered --write--> images, layers, mattes
//!                                        ^                 |
//!                  Checkpoints: start ---+---- films <-----+
//! ```
//!
//! The program, jobs of farms, benches, sets of training data and the Python module all render by it.

mod checkpoints;
mod host;
mod method;
mod output;
mod prepare;
mod recipe;
mod run;
mod stats;
mod write;

pub use self::checkpoints::Checkpoints;
pub use self::host::{Host, RENDERING};
pub use self::method::{Method, MethodRecipe};
pub use self::output::Outputs;
pub use self::prepare::Prepared;
pub use self::recipe::{Differences, Extent, Recipe};
pub use self::run::Rendered;
pub use self::stats::{Seconds, Stats, peak_bytes, reset_peak};
