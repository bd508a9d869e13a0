//! Reports of results and images: one HTML page that needs nothing else, and a table for terminals.

mod changes;
mod page;
mod picture;
pub mod stress;
mod summary;
mod tables;

pub use self::changes::{Change, changes};
pub use self::page::{Page, Shown, View};
pub use self::picture::heat;
pub use self::summary::{Row, Summary};
pub use self::tables::{Entry, MethodErrors, SceneErrors, errors, ratios, scene_errors, summaries};
