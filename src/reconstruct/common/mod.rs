//! Tools that several methods use: frames as planes, features that are cleaned or generated, inputs of networks, errors by residuals.

pub mod compressed;
pub mod edge_means;
pub mod features;
pub mod generated;
pub mod inputs;
pub mod problem;
pub mod residual;
