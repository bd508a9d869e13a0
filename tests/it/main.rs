//! All integration tests, as one program: it is linked once.

mod adaptive;
mod apr;
mod architecture;
mod bench;
mod bsdf;
mod cli;
mod common;
mod comparators;
mod corrupt;
mod edges;
mod film;
mod frgr;
mod gradient;
mod interruption;
mod lights;
mod loader;
mod methods;
mod oidn;
mod outputs;
mod report;
mod stress;
mod textures;
mod vocabulary;
mod wild;
