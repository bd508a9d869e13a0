//! Jobs of many chunks, a folder for each.

use std::path::PathBuf;

use fluxion::job::{self, ChunkEnd, Settings};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::error::raised;
use crate::recipe::Keywords;
use crate::scene::options;
use crate::work;

/// Renders in chunks for many machines: a folder with a plan, and a checkpoint for each chunk.
#[pyclass(frozen, module = "fluxion")]
pub struct Job(job::Job);

#[pymethods]
impl Job {
    /// Plans a job in a new folder: `spp` samples per pixel of every scene, in `chunks` parts; `frames` are the first and the last of the
    /// frames of every scene, which is read with the parameter `frame`; with `adaptive` an allocator allocates three quarters of the samples in a
    /// second round. Further keywords are those of `load_file` and of `render`.
    #[staticmethod]
    #[pyo3(signature = (scenes, folder, *, chunks=1, frames=None, adaptive=None, **keywords))]
    #[pyo3(text_signature = "(scenes, folder, *, spp, chunks=1, frames=None, adaptive=None, **keywords)")]
    fn plan(
        py: Python<'_>,
        scenes: Vec<PathBuf>,
        folder: PathBuf,
        chunks: u32,
        frames: Option<(u32, u32)>,
        adaptive: Option<String>,
        keywords: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let (Keywords { mut recipe, size, threads, checkpoints, checkpoint_every }, left) = Keywords::read(keywords)?;
        if checkpoints.is_some() {
            return Err(PyValueError::new_err("chunks have checkpoints of their own"));
        }
        let Some(spp) = recipe.limits.spp.take() else {
            return Err(PyValueError::new_err("a job takes spp: samples per pixel"));
        };
        if chunks == 0 || frames.is_some_and(|(first, last)| first > last || last == u32::MAX) {
            return Err(PyValueError::new_err("chunks are a number from 1 on, frames a first and a last one"));
        }
        let others = PyDict::new(py);
        left.into_iter().try_for_each(|(name, value)| others.set_item(name, value))?;
        recipe.scene = options(Some(&others))?;
        recipe.scene.size = size;
        let job = work::run(py, threads, None, move |link| {
            let (folder, adaptive) = (folder.as_path(), adaptive.as_deref());
            let (scenes, recipe) = (&scenes[..], &recipe);
            let settings = Settings { folder, scenes, frames, spp, chunks, adaptive, recipe, checkpoint_every };
            let job = link.hosted(|host| job::Job::new(&settings, &|text| (host.warn)(text)))?;
            job.create(&[])?;
            Ok(job)
        })?;
        Ok(Self(job))
    }

    /// Reads the plan in a folder.
    #[staticmethod]
    fn load(folder: PathBuf) -> PyResult<Self> {
        job::Job::load(&folder).map(Self).map_err(raised)
    }

    /// Number of chunks.
    #[getter]
    fn chunks(&self) -> usize {
        self.0.chunks()
    }

    /// Names of the images.
    #[getter]
    fn images(&self) -> Vec<String> {
        (0..self.0.images()).map(|image| self.0.name(image)).collect()
    }

    /// Renders a chunk, unless it is complete; goes on with it if it was interrupted. Whether it is complete now.
    #[pyo3(signature = (chunk, *, threads=0, progress=None))]
    fn run(&self, py: Python<'_>, chunk: usize, threads: usize, progress: Option<&Bound<'_, PyAny>>) -> PyResult<bool> {
        let job = self.0.clone();
        let end = work::run(py, threads, progress, move |link| link.hosted(|host| job.run(chunk, host)))?;
        Ok(!matches!(end, ChunkEnd::Stopped(..)))
    }

    /// Allocates the samples of the second round, when the first is complete: fewest and most of a pixel, by the images' names.
    fn allocate<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let job = self.0.clone();
        let found = PyDict::new(py);
        for image in work::run(py, 0, None, move |_| job.allocate())? {
            found.set_item(image.name, (image.least, image.most))?;
        }
        Ok(found)
    }

    /// Numbers of chunks by their states; `verify` reads the files of complete ones from end to end.
    #[pyo3(signature = (verify=false))]
    fn status<'py>(&self, py: Python<'py>, verify: bool) -> PyResult<Bound<'py, PyDict>> {
        let job = self.0.clone();
        let status = work::run(py, 0, None, move |_| job.status(verify))?;
        let found = PyDict::new(py);
        found.set_item("chunks", status.chunks)?;
        found.set_item("complete", status.complete)?;
        for (name, numbers) in [
            ("started", status.started),
            ("missing", status.missing),
            ("waiting", status.waiting),
            ("wrong", status.wrong),
        ] {
            found.set_item(name, numbers)?;
        }
        Ok(found)
    }

    /// Merges the chunks of every image, and reconstructs it by the method that they were rendered for unless `image` is false: the files
    /// that were written. With `partial` chunks may be missing.
    #[pyo3(signature = (*, partial=false, image=true))]
    fn merge<'py>(&self, py: Python<'py>, partial: bool, image: bool) -> PyResult<Bound<'py, PyList>> {
        let job = self.0.clone();
        let merged = work::run(py, 0, None, move |link| {
            let of = |number| link.hosted(|host| job.merge(number, partial, image, host));
            (0..job.images()).map(of).collect::<fluxion::Result<Vec<_>>>()
        })?;
        PyList::new(py, merged.into_iter().map(|merged| merged.image.unwrap_or(merged.film)))
    }

    fn __repr__(&self) -> String {
        format!("<fluxion.Job of {} chunks in {}>", self.0.chunks(), self.0.folder.display())
    }
}
