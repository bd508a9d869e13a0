//! Warnings of the loader: the file is read, but not everything in it means what it says.

use std::cell::RefCell;

use crate::error::{Error, Result, SourceLoc};

/// Warnings in the order that they were found, each once.
#[derive(Debug, Default)]
pub struct Warnings {
    strict: bool,
    list: RefCell<Vec<String>>,
}

impl Warnings {
    /// None yet; if `strict`, the first one will be an error.
    pub fn new(strict: bool) -> Self {
        Self { strict, list: RefCell::default() }
    }

    /// Warns of something at a location, or fails with it.
    pub fn add(&self, loc: &SourceLoc, what: impl Into<String>) -> Result<()> {
        let what = what.into();
        if self.strict {
            return Err(loc.unsupported(what));
        }
        self.push(Error::Unsupported { loc: loc.clone(), what });
        Ok(())
    }

    fn push(&self, warning: Error) {
        let (warning, mut list) = (warning.to_string(), self.list.borrow_mut());
        if !list.contains(&warning) {
            list.push(warning);
        }
    }

    /// All warnings.
    pub fn into_list(self) -> Vec<String> {
        self.list.into_inner()
    }
}
