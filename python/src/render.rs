//! Renders.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use fluxion::adaptive::{self, AdaptiveSettings, Allocator, Limits};
use fluxion::film::{Needs, Provenance, Recorded};
use fluxion::neighbours::Selector;
use fluxion::plan::{self, Plan};
use fluxion::reconstruct::{self, Reconstruction};
use fluxion::reference::fingerprint;
use fluxion::render::{Budget, Control, RenderSettings, SHIFTS, Shift};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::error::raised;
use crate::frame::Frame;
use crate::reconstruct::{Solution, Solved, Wishes};
use crate::scene::SceneOrPath;
use crate::work::{self, Link};

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

/// Everything that decides a render.
struct Job {
    scene: Arc<fluxion::Scene>,
    method: Box<dyn Reconstruction>,
    allocator: Option<&'static dyn Allocator>,
    limits: Limits,
    settings: RenderSettings,
    wishes: Wishes,
    provenance: Provenance,
}

/// A render that has ended.
struct Done {
    frame: fluxion::Frame,
    solution: Solved,
    spp: f64,
    seconds: f64,
}

impl Job {
    fn run(self, link: &Link) -> fluxion::Result<Done> {
        let progress = |share| link.set("rendering", share);
        let control = Control { stop: &link.stop, progress: &progress, ..Control::QUIET };
        let (render, frame, solution) = match self.allocator {
            None => {
                let outcome = fluxion::render(&self.scene, self.settings, &control);
                let frame = outcome.film.develop();
                let solution = self.wishes.solve(self.method.as_ref(), &frame, link)?;
                (outcome, frame, solution)
            }
            Some(allocator) => {
                let (render, method, limits) = (self.settings, self.method.as_ref(), self.limits);
                let settings = AdaptiveSettings { render, method, allocator, limits, reconstruction: None };
                let report = |stage: &str, share| link.report(stage, share);
                let done = adaptive::run(&self.scene, &settings, &control, &self.wishes.context(&report))?;
                let solution = Solved::new(method, &done.frame, done.solution)?;
                (done.render, done.frame, solution)
            }
        };
        let (spp, seconds) = (render.film.mean_spp(), render.elapsed.as_secs_f64());
        let mut frame = frame.with_provenance(self.provenance.after(spp, seconds));
        frame.window = self.scene.sensor().window();
        Ok(Done { frame, solution, spp, seconds })
    }
}

fn limits(spp: Option<u32>, time: Option<f64>, error: Option<f64>) -> PyResult<Limits> {
    let wrong = |what: &str| Err(PyValueError::new_err(what.to_owned()));
    if spp == Some(0) {
        return wrong("spp is a number of samples from 1 on");
    }
    if spp.is_some() && time.is_some() {
        return wrong("give either spp or time");
    }
    if error.is_some_and(|error| !(error > 0.0 && error.is_finite())) {
        return wrong("target_error is a positive relMSE");
    }
    let time = match time.map(Duration::try_from_secs_f64) {
        Some(Ok(time)) if !time.is_zero() => Some(time),
        Some(_) => return wrong("time is a positive number of seconds"),
        None => None,
    };
    Ok(Limits { spp, time, error })
}

/// What files say of the render, as far as it is known beforehand.
fn provenance(
    scene: &fluxion::Scene,
    path: &Path,
    (seed, method): (u64, &str),
    (plan, kernel): (&Plan, &Selector),
) -> Provenance {
    Provenance {
        scene: path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        fingerprint: fingerprint(scene),
        seed: seed.to_string(),
        method: method.to_owned(),
        plan: plan.summary(),
        kernel: kernel.name(),
        ..Provenance::new()
    }
}

/// Renders a scene, or a scene file, and reconstructs the image.
///
/// `spp` are samples per pixel, `time` seconds for everything but reading the scene, `target_error` the estimated relMSE to stop
/// at; without any of them the scene says how many samples. `method` is the reconstruction with its parameters, `adaptive` an
/// allocator such as `"predicted_error"`, which is the default with `time` and `target_error`; `size` the film's width and
/// height. `layers` records features for further reconstructions of the frame, `bins`, `occlusion`, `position` and `ambient` what
/// the options of `fluxion render` of these names do. The same seed gives the same bits as the program does, on any number of
/// `threads` (0: one per core). `progress` is called with the stage and the finished share. An exception in it, or Ctrl-C, ends the
/// render.
#[pyfunction]
#[pyo3(signature = (
    scene, *, spp=None, time=None, target_error=None, seed=0, first=0, size=None, method=reconstruct::DEFAULT, adaptive=None,
    kernel="cross", pilot=None, shift=SHIFTS[0].id, layers=false, bins=false, occlusion=false, position=false, ambient=false,
    memory=None, notes=false, threads=0, progress=None
))]
#[allow(clippy::too_many_arguments, clippy::fn_params_excessive_bools)]
pub fn render(
    py: Python<'_>,
    scene: SceneOrPath<'_>,
    spp: Option<u32>,
    time: Option<f64>,
    target_error: Option<f64>,
    seed: u64,
    first: u32,
    size: Option<(usize, usize)>,
    method: &str,
    adaptive: Option<&str>,
    kernel: &str,
    pilot: Option<u32>,
    shift: &str,
    layers: bool,
    bins: bool,
    occlusion: bool,
    position: bool,
    ambient: bool,
    memory: Option<u64>,
    notes: bool,
    threads: usize,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Py<Rendering>> {
    let limits = limits(spp, time, target_error)?;
    let reconstruction = reconstruct::parse(method).map_err(raised)?;
    let allocator = adaptive::chosen(adaptive, &limits, reconstruction.as_ref()).map_err(raised)?;
    let shift = Shift::named(shift).ok_or_else(|| PyValueError::new_err(format!("{shift} is no shift mapping")))?;
    let selector = Selector::parse(kernel, pilot).map_err(raised)?;
    let (scene, path) = scene.scene(py, size)?;
    let limits = limits.or_samples(scene.sensor().spp);
    let kernel = plan::kernel(selector, reconstruction.as_ref(), limits.spp).map_err(raised)?;
    let needed = reconstruction.needs().union(kernel.needs());
    let saved = Needs::NONE.with_if(Recorded::Features, layers).with_if(Recorded::Bins, ).with_if(Recorded::Occlusion, ).with_if(Recorded::Position, ).with_if(Recorded::Ambient, );
    let plan = Plan::new(&scene, needed, saved).with_kernel(&kernel);
    let budget = limits.time.map_or(Budget::Spp(limits.spp.unwrap_or(1)), Budget::Time);
    let settings = RenderSettings { budget, seed, first, needs: plan.needs, shift, kernel };
    let provenance = provenance(&scene, &path, (seed, method), (&plan, &kernel));
    let wishes = Wishes { memory, notes };
    let job = Job { scene, method: reconstruction, allocator, limits, settings, wishes, provenance };
    let Done { frame, solution, spp, seconds } = work::run(py, threads, progress, move |link| job.run(link))?;
    let rendering = Rendering { frame: Py::new(py, Frame(Arc::new(frame)))?, spp, seconds, plan: plan.summary() };
    Py::new(py, PyClassInitializer::from(Solution(solution)).add_subclass(rendering))
}
