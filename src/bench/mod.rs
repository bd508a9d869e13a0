//! Error against run time: scenes x methods x budgets x seeds, each rendered and reconstructed by itself, as records.

mod case;
mod cell;
mod record;
mod runs;
mod store;

pub use self::case::{Case, Truth};
pub use self::cell::{Budget, Pilot, RunResult, Runner};
pub use self::record::{LeftOut, MEASURES, Record, Results, Seconds, machine};
pub use self::runs::Runs;
pub use self::store::Store;
