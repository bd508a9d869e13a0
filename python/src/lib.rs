//! The Python module: scenes, renders, frames and reconstructions, with arrays that share their memory.

mod array;
mod error;
mod frame;
mod job;
mod measure;
mod recipe;
mod reconstruct;
mod render;
mod scene;
mod work;

use pyo3::prelude::*;

#[pymodule]
mod _fluxion {
    #[pymodule_export]
    use crate::error::FluxionError;
    #[pymodule_export]
    use crate::frame::Frame;
    #[pymodule_export]
    use crate::job::Job;
    #[pymodule_export]
    use crate::measure::{compare, methods, metrics, read_image, write_image};
    #[pymodule_export]
    use crate::recipe::statistics;
    #[pymodule_export]
    use crate::reconstruct::{Solution, reconstruct};
    #[pymodule_export]
    use crate::render::{Rendering, render};
    #[pymodule_export]
    use crate::scene::{Scene, class_of, load_file, load_lines, load_string};
    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
