//! Jobs: renders in chunks for many machines. A folder is the only state: `job.json`, the plan with the recipe of all chunks, and a
//! checkpoint for each chunk, `0003.ckpt` when it is complete and `0003.part.ckpt` before.
//!
//! ```text
//! plan --job.json--> run 0, 1, 2, ... (on any machine) --checkpoints--> status, merge --> images
//!                     ^                                        |
//!                     +---- goals of a second round -- allocate <+
//! ```

mod allocate;
mod chunk;
mod description;
mod merge;
mod ranges;
mod run;
mod schedulers;
mod status;

pub use self::allocate::Allocated;
pub use self::chunk::{Chunk, State};
pub use self::description::{FirstRound, Job, Settings};
pub use self::merge::Merged;
pub use self::ranges::ranges;
pub use self::run::ChunkEnd;
pub use self::status::Status;
