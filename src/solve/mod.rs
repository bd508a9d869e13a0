//! Solvers on image grids.

pub mod dct;
pub mod poisson;
