//! Solvers on image grids.

pub mod dct;
pub mod graph;
pub mod irls;
pub mod multigrid;
pub mod poisson;
pub mod simplex;
