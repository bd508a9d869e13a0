//! Hostile frames, systems and scenes. Every case has a closed answer, an invariant or an independent solution, and says
//! how far from it every method, solver or shift is, and how far it may be.

mod frame;
mod frames;
mod furnaces;
mod probe;
mod scenes;
mod solvers;
mod statistics;
mod systems;

use std::panic::{AssertUnwindSafe, catch_unwind};

use schemars::JsonSchema;
use serde::Serialize;

use crate::error::Result;

/// A hard problem with a known answer.
pub struct Case {
    /// Kind and name, as in `frames/firefly`.
    pub name: &'static str,
    /// Description of the case.
    pub summary: &'static str,
    run: fn(&mut Checks) -> Result<()>,
}

/// A measured figure and its bound.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Check {
    /// Subject of the figure: a method, a solver, a shift.
    pub subject: String,
    /// The measured quantity; small values are good.
    pub measure: &'static str,
    /// The figure.
    pub value: f64,
    /// The largest that passes.
    pub bound: f64,
}

impl Check {
    /// Whether the figure is a number and within its bound.
    pub fn passed(&self) -> bool {
        self.value <= self.bound
    }
}

/// Figures of a case.
#[derive(Debug, Default, Serialize, JsonSchema)]
pub struct Checks {
    /// In the order in which they were made.
    pub list: Vec<Check>,
    /// Error that ended the case early.
    pub failed: Option<String>,
}

impl Checks {
    fn add(&mut self, subject: impl Into<String>, measure: &'static str, value: f64, bound: f64) {
        self.list.push(Check { subject: subject.into(), measure, value, bound });
    }

    /// Whether all figures are within their bounds, and there are some.
    pub fn passed(&self) -> bool {
        self.failed.is_none() && !self.list.is_empty() && self.list.iter().all(Check::passed)
    }
}

impl Case {
    /// Tries everything. A panic is a failure like any other.
    pub fn check(&self) -> Checks {
        let mut checks = Checks::default();
        let run = catch_unwind(AssertUnwindSafe(|| (self.run)(&mut checks)));
        checks.failed = match run {
            Ok(done) => done.err().map(|error| error.to_string()),
            Err(panic) => {
                let text = panic.downcast_ref::<String>().map(String::as_str);
                let text = text.or(panic.downcast_ref::<&str>().copied()).unwrap_or("no message");
                Some(format!("panic: {text}"))
            }
        };
        checks
    }
}

/// All cases, from frames to scenes.
pub fn cases() -> impl Iterator<Item = &'static Case> {
    [frames::CASES, statistics::CASES, solvers::CASES, furnaces::CASES, scenes::CASES].into_iter().flatten()
}
