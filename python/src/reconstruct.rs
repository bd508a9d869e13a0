//! Reconstructions.

use std::sync::Arc;

use fluxion::pipeline::{MethodRecipe, Stats};
use fluxion::reconstruct::{DEFAULT, Note, Reconstruction, light_groups};
use numpy::PyArray3;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::array::view;
use crate::error::raised;
use crate::frame::Frame;
use crate::work;

/// A reconstructed image.
#[pyclass(frozen, subclass, module = "fluxion")]
pub struct Solution(pub Solved);

/// A solution with the images of its light groups.
pub struct Solved {
    pub solution: fluxion::Solution,
    pub lights: Vec<Note>,
}

impl Solved {
    /// A solution of a frame by a method.
    pub fn new(
        method: &dyn Reconstruction,
        frame: &fluxion::Frame,
        solution: fluxion::Solution,
    ) -> fluxion::Result<Self> {
        let lights = light_groups(method, frame, &solution)?;
        Ok(Self { solution, lights })
    }
}

#[pymethods]
impl Solution {
    /// The image in radiance, directly seen emitters included: height x width x 3.
    #[getter]
    fn image<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        view(slf.as_any(), &slf.get().0.solution.image)
    }

    /// Share of every pixel that is covered, if the frame has it.
    #[getter]
    fn alpha<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyArray3<f32>>>> {
        slf.get().0.solution.alpha.as_ref().map(|image| view(slf.as_any(), image)).transpose()
    }

    /// Expected squared error of each value, if the method estimates it.
    #[getter]
    fn error<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyArray3<f32>>>> {
        slf.get().0.solution.error.as_ref().map(|image| view(slf.as_any(), image)).transpose()
    }

    /// Intermediate images by their names, if they were asked for.
    #[getter]
    fn notes<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        images(slf, &slf.get().0.solution.notes)
    }

    /// The light of groups of emitters by their names, if the frame has it; the images add up to `image`.
    #[getter]
    fn lights<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        images(slf, &slf.get().0.lights)
    }

    fn __repr__(&self) -> String {
        format!("<fluxion.Solution of {}x{} pixels>", self.0.solution.image.width, self.0.solution.image.height)
    }
}

/// Images by their names.
fn images<'py>(owner: &Bound<'py, Solution>, notes: &[Note]) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(owner.py());
    for note in notes {
        dict.set_item(&note.name, view(owner.as_any(), &note.image)?)?;
    }
    Ok(dict)
}

/// Makes an image of a frame by a method with its parameters, such as `"frgr:levels=2"`; `fluxion.methods()` lists them.
///
/// `memory` bounds what the method uses besides the frame, in megabytes; with `notes` intermediate images are kept; `threads`
/// is the number of threads (0: one per core); `progress` is called with the stage and the finished share.
#[pyfunction]
#[pyo3(signature = (frame, method=DEFAULT, *, memory=None, notes=false, threads=0, progress=None))]
pub fn reconstruct(
    py: Python<'_>,
    frame: &Frame,
    method: &str,
    memory: Option<u64>,
    notes: bool,
    threads: usize,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Solution> {
    let memory = memory.map(|megabytes| megabytes.saturating_mul(1 << 20));
    let method = MethodRecipe { name: method.to_owned(), memory, notes }.make().map_err(raised)?;
    let frame = Arc::clone(&frame.0);
    let solved = work::run(py, threads, progress, move |link| {
        let solution = link.hosted(|host| method.solve(&frame, host, &mut Stats::default()))?;
        Solved::new(&*method.made, &frame, solution)
    })?;
    Ok(Solution(solved))
}
