//! Renders.

use std::sync::{Arc, Mutex};

use fluxion::adaptive::Start;
use fluxion::internals::files::claim;
use fluxion::pipeline::{Host, Prepared};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error::raised;
use crate::frame::Frame;
use crate::recipe::Keywords;
use crate::reconstruct::{Solution, Solved};
use crate::scene::SceneOrPath;
use crate::work;

/// A rendered and reconstructed image, with the frame that it was made of.
#[pyclass(frozen, extends = Solution, module = "fluxion")]
pub struct Rendering {
    /// The layers that were recorded.
    #[pyo3(get)]
    frame: Py<Frame>,
    /// Mean number of samples of a pixel.
    #[pyo3(get)]
    spp: f64,
    /// Seconds of rendering, without reading the scene and without reconstruction.
    #[pyo3(get)]
    seconds: f64,
    /// What was computed and what was left out, as `fluxion info` says it.
    #[pyo3(get)]
    plan: String,
}

#[pymethods]
impl Rendering {
    /// The reconstruction by itself.
    #[getter]
    fn solution<'py>(slf: &Bound<'py, Self>) -> Bound<'py, Solution> {
        slf.as_super().clone()
    }

    fn __repr__(&self) -> String {
        format!("<fluxion.Rendering with {} samples a pixel in {:.2} s>", self.spp, self.seconds)
    }
}

/// A render that has ended.
struct Done {
    frame: fluxion::Frame,
    solution: Solved,
    spp: f64,
    seconds: f64,
    plan: String,
}

impl Done {
    /// Renders from a start on, and writes the files that are asked for.
    fn new(prepared: &Prepared, start: Start, host: &Host) -> fluxion::Result<Self> {
        let mut rendered = prepared.run(start, host)?;
        if let Err(error) = prepared.write(&mut rendered) {
            // The image is not lost with a file.
            (host.warn)(&error.to_string());
        }
        let plan = rendered.stats.plan;
        let (spp, seconds) = (rendered.render.film.mean_spp(), rendered.render.elapsed.as_secs_f64());
        let solution = match rendered.solution {
            Some(solution) => solution,
            None => prepared.method.solve(&rendered.frame, host, &mut Default::default())?,
        };
        let solution = Solved::new(&*prepared.method.made, &rendered.frame, solution)?;
        Ok(Self { frame: rendered.frame, solution, spp, seconds, plan })
    }
}

/// Renders a scene, or a scene file, and reconstructs the image.
///
/// `spp` are samples per pixel, `time` seconds for everything but reading the scene, `target_error` the estimated relMSE to stop
/// at; without any of them the scene says how many samples. `method` is the reconstruction with its parameters, `adaptive` an
/// allocator such as `"predicted_error"`, which is the default with `time` and `target_error`; `size` the film's width and
/// height. `layers` records features for further reconstructions of the frame; every name that `fluxion.statistics()` lists is a keyword that
/// records that statistic, as the option of `fluxion render` does. `goals` names an EXR file of the samples that every pixel is to have,
/// `cryptomatte` one of mattes to write, `samples` a folder for single samples. `checkpoint` names a file that all samples are saved in every
/// `checkpoint_every` seconds; with `resume` the render goes on from it. The same seed gives the same bits as the program does, on any number
/// of `threads` (0: one per core). `progress` is called with the stage and the finished share. An exception in it, or Ctrl-C, ends the render.
#[pyfunction]
#[pyo3(signature = (scene, *, progress=None, **keywords))]
#[pyo3(
    text_signature = "(scene, *, spp=None, time=None, target_error=None, seed=0, first=0, goals=None, size=None, method='net', adaptive=None, kernel='cross', pilot=None, shift='reconnect', every_difference=False, layers=False, memory=None, notes=False, cryptomatte=None, samples=None, checkpoint=None, checkpoint_every=60, resume=False, threads=0, progress=None, **statistics)"
)]
pub fn render(
    py: Python<'_>,
    scene: SceneOrPath<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    keywords: Option<&Bound<'_, PyDict>>,
) -> PyResult<Py<Rendering>> {
    let (Keywords { mut recipe, size, threads, checkpoints, .. }, left) = Keywords::read(keywords)?;
    if let Some((name, _)) = left.first() {
        return Err(PyTypeError::new_err(format!("render() has no keyword argument '{name}'")));
    }
    recipe.outputs.image = true;
    recipe.check().map_err(raised)?;
    if checkpoints.is_some() && recipe.outputs.samples.is_some() {
        return Err(PyValueError::new_err("samples cannot be resumed: give either samples or checkpoint"));
    }
    recipe.outputs.cryptomatte.iter().try_for_each(|path| claim(path)).map_err(raised)?;
    let (scene, path) = scene.scene(py, size)?;
    let done = work::run(py, threads, progress, move |link| {
        let prepared = recipe.prepare(&scene, &path)?;
        link.hosted(|host| match checkpoints {
            None => Done::new(&prepared, prepared.start(&Mutex::default()), host),
            Some(checkpoints) => {
                let _lock = checkpoints.lock()?;
                let origin = prepared.origin()?;
                checkpoints.keep((&prepared, origin), host, |start, host| Done::new(&prepared, start, host))
            }
        })
    })?;
    let Done { frame, solution, spp, seconds, plan } = done;
    let rendering = Rendering { frame: Py::new(py, Frame(Arc::new(frame)))?, spp, seconds, plan };
    Py::new(py, PyClassInitializer::from(Solution(solution)).add_subclass(rendering))
}
