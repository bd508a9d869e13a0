//! Scenes.

use std::ffi::CString;
use std::path::PathBuf;
use std::sync::Arc;

use fluxion::scene::load::{self, Options};
use fluxion::scene::sensor::Crop;
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::work;

/// A scene that has been read, ready to be rendered.
#[pyclass(frozen, module = "fluxion")]
pub struct Scene {
    scene: Arc<fluxion::Scene>,
    path: PathBuf,
    options: Options,
    light_groups: Option<String>,
}

/// Reads a scene file in the format of Mitsuba 3.
///
/// Keywords that are none of the options give the file's parameters (`$name`) values, over its `<default>`s. `size` is the
/// film's width and height, `crop` the column, row, width and height of the part to render, `sensor` an id or a number,
/// `max_depth` the longest path in edges, `threads` the number of threads that build the scene (0: one per core),
/// `texture_memory` megabytes. `light_groups` names groups of emitters whose light is recorded by itself, by patterns of their ids or
/// those of their shapes: `"key=lamp*,fill=window*,rest"`. Warnings of the reader are Python's; with `strict` they are errors.
#[pyfunction]
#[pyo3(signature = (path, *, size=None, crop=None, sensor=None, max_depth=None, strict=false, threads=0, texture_memory=4096, light_groups=None, **defines))]
#[allow(clippy::too_many_arguments)]
pub fn load_file(
    py: Python<'_>,
    path: PathBuf,
    size: Option<(usize, usize)>,
    crop: Option<(usize, usize, usize, usize)>,
    sensor: Option<Bound<'_, PyAny>>,
    max_depth: Option<u32>,
    strict: bool,
    threads: usize,
    texture_memory: u64,
    light_groups: Option<String>,
    defines: Option<&Bound<'_, PyDict>>,
) -> PyResult<Scene> {
    let define = |(name, value): (Bound<'_, PyAny>, Bound<'_, PyAny>)| Ok((name.extract()?, text(&value)?));
    let options = Options {
        parameters: defines.into_iter().flatten().map(define).collect::<PyResult<_>>()?,
        sensor: sensor.as_ref().map(text).transpose()?,
        size,
        crop: crop.map(|(x, y, width, height)| Crop { x, y, width, height }),
        max_depth,
        strict,
        threads,
        texture_memory: texture_memory.saturating_mul(1 << 20),
        ..Options::default()
    };
    load(py, path, options, light_groups)
}

/// A value as scene files have it.
fn text(value: &Bound<'_, PyAny>) -> PyResult<String> {
    let text = value.str()?.extract::<String>()?;
    Ok(if value.is_instance_of::<pyo3::types::PyBool>() { text.to_lowercase() } else { text })
}

fn load(py: Python<'_>, path: PathBuf, options: Options, light_groups: Option<String>) -> PyResult<Scene> {
    let (from, by, groups) = (path.clone(), options.clone(), light_groups.clone());
    let scene = work::run(py, 0, None, move |_| {
        let mut scene = load::load(&from, &by)?;
        groups.map_or(Ok(()), |groups| scene.group_lights(&groups))?;
        Ok(scene)
    })?;
    let category = py.get_type::<PyUserWarning>();
    for warning in scene.warnings() {
        PyErr::warn(py, &category, &CString::new(warning.replace('\0', " "))?, 2)?;
    }
    Ok(Scene { scene: Arc::new(scene), path, options, light_groups })
}

#[pymethods]
impl Scene {
    /// Pixels in a row of the film.
    #[getter]
    fn width(&self) -> usize {
        self.scene.sensor().width
    }

    /// Rows of the film.
    #[getter]
    fn height(&self) -> usize {
        self.scene.sensor().height
    }

    /// Samples per pixel that the file asks for.
    #[getter]
    fn spp(&self) -> u32 {
        self.scene.sensor().spp
    }

    /// The scene file.
    #[getter]
    fn path(&self) -> PathBuf {
        self.path.clone()
    }

    /// Warnings of the reader.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.scene.warnings().to_vec()
    }

    fn __repr__(&self) -> String {
        format!("<fluxion.Scene {} of {}x{} pixels>", self.path.display(), self.width(), self.height())
    }
}

impl Scene {
    /// The scene with a film of another size, read again if need be.
    pub fn sized(&self, py: Python<'_>, size: Option<(usize, usize)>) -> PyResult<Arc<fluxion::Scene>> {
        match size {
            Some(size) if size != (self.width(), self.height()) => {
                let options = Options { size: Some(size), ..self.options.clone() };
                Ok(load(py, self.path.clone(), options, self.light_groups.clone())?.scene)
            }
            _ => Ok(Arc::clone(&self.scene)),
        }
    }
}

/// A scene, or the path of a scene file.
#[derive(FromPyObject)]
pub enum SceneOrPath<'py> {
    Scene(Bound<'py, Scene>),
    Path(PathBuf),
}

impl SceneOrPath<'_> {
    /// The scene, with a film of another size if one is given.
    pub fn scene(self, py: Python<'_>, size: Option<(usize, usize)>) -> PyResult<(Arc<fluxion::Scene>, PathBuf)> {
        match self {
            Self::Scene(scene) => Ok((scene.get().sized(py, size)?, scene.get().path.clone())),
            Self::Path(path) => {
                let scene = load(py, path, Options { size, ..Options::default() }, None)?;
                Ok((scene.scene, scene.path))
            }
        }
    }
}
