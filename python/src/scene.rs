//! Scenes.

use std::ffi::CString;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use fluxion::mitsuba::{self, Line, Options};
use fluxion::scene::sensor::Crop;
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::work;

/// A scene that has been read, ready to be rendered.
#[pyclass(frozen, module = "fluxion")]
pub struct Scene {
    scene: Arc<fluxion::Scene>,
    source: Source,
    options: Options,
    /// Owner of files that were written for the scene, and that may be read again.
    _files: Option<Py<PyAny>>,
}

/// Text of a scene.
#[derive(Clone)]
enum Source {
    File(PathBuf),
    Text(Arc<str>),
    Lines(Arc<[Line]>),
}

impl Source {
    fn load(&self, options: &Options) -> fluxion::Result<fluxion::Scene> {
        match self {
            Self::File(path) => mitsuba::load(path, options),
            Self::Text(text) => mitsuba::load_text(text, options),
            Self::Lines(lines) => mitsuba::load_lines(lines, options),
        }
    }

    /// Name of the file, or one in its place.
    fn path(&self) -> PathBuf {
        match self {
            Self::File(path) => path.clone(),
            Self::Text(_) => "scene.xml".into(),
            Self::Lines(_) => "scene".into(),
        }
    }
}

/// Keyword arguments of everything that reads scenes: options, and under all other names values of the file's parameters.
pub fn options(keywords: Option<&Bound<'_, PyDict>>) -> PyResult<Options> {
    let mut options = Options::default();
    for (name, value) in keywords.into_iter().flatten() {
        let name: String = name.extract()?;
        match name.as_str() {
            // Options that are not given.
            "size" | "crop" | "sensor" | "max_depth" | "light_groups" if value.is_none() => {}
            "size" => options.size = Some(value.extract()?),
            "crop" => {
                let (x, y, width, height) = value.extract()?;
                options.crop = Some(Crop { x, y, width, height });
            }
            "sensor" => options.sensor = Some(text(&value)?),
            "max_depth" => options.max_depth = Some(value.extract()?),
            "strict" => options.strict = value.extract()?,
            "threads" => options.threads = value.extract()?,
            "texture_memory" => options.texture_memory = value.extract::<u64>()?.saturating_mul(1 << 20),
            "light_groups" => options.light_groups = Some(value.extract()?),
            _ => options.parameters.push((name, text(&value)?)),
        }
    }
    Ok(options)
}

/// Reads a scene file in the format of Mitsuba 3.
///
/// Keywords that are none of the options give the file's parameters (`$name`) values, over its `<default>`s. `size` is the
/// film's width and height, `crop` the column, row, width and height of the part to render, `sensor` an id or a number,
/// `max_depth` the longest path in edges, `threads` the number of threads that build the scene (0: one per core),
/// `texture_memory` megabytes. `light_groups` names groups of emitters whose light is recorded by itself, by patterns of their ids or
/// those of their shapes: `"key=lamp*,fill=window*,rest"`. Warnings of the reader are Python's; with `strict` they are errors.
#[pyfunction]
#[pyo3(signature = (path, **keywords))]
#[pyo3(
    text_signature = "(path, *, size=None, crop=None, sensor=None, max_depth=None, strict=False, threads=0, texture_memory=4096, light_groups=None, **defines)"
)]
pub fn load_file(py: Python<'_>, path: PathBuf, keywords: Option<&Bound<'_, PyDict>>) -> PyResult<Scene> {
    let options = options(keywords)?;
    load(py, Source::File(path), options, None)
}

/// Reads a scene from the text of a scene file, with the keywords of `load_file`. Files that it names are looked for in the current
/// folder.
#[pyfunction]
#[pyo3(signature = (xml, **keywords))]
pub fn load_string(py: Python<'_>, xml: &str, keywords: Option<&Bound<'_, PyDict>>) -> PyResult<Scene> {
    let options = options(keywords)?;
    load(py, Source::Text(xml.into()), options, None)
}

/// Reads a scene from lines of XML with the places that they are named by in messages. `files` owns files that they name.
#[pyfunction]
#[pyo3(signature = (lines, files, **keywords))]
pub fn load_lines(
    py: Python<'_>,
    lines: Vec<(String, String)>,
    files: Py<PyAny>,
    keywords: Option<&Bound<'_, PyDict>>,
) -> PyResult<Scene> {
    let options = options(keywords)?;
    let line = |(origin, xml): (String, String)| Line { origin: Path::new(&origin).into(), xml };
    let lines = lines.into_iter().map(line).collect();
    load(py, Source::Lines(lines), options, Some(files))
}

/// The element of scene files that a plugin is written as; None of one that is not known.
#[pyfunction]
pub fn class_of(plugin: &str) -> Option<&'static str> {
    mitsuba::class_of(plugin)
}

/// A value as scene files have it.
fn text(value: &Bound<'_, PyAny>) -> PyResult<String> {
    let text = value.str()?.extract::<String>()?;
    Ok(if value.is_instance_of::<pyo3::types::PyBool>() { text.to_lowercase() } else { text })
}

fn load(py: Python<'_>, source: Source, options: Options, files: Option<Py<PyAny>>) -> PyResult<Scene> {
    let (from, by) = (source.clone(), options.clone());
    let scene = work::run(py, 0, None, move |_| from.load(&by))?;
    let category = py.get_type::<PyUserWarning>();
    for warning in scene.warnings() {
        PyErr::warn(py, &category, &CString::new(warning.replace('\0', " "))?, 2)?;
    }
    Ok(Scene { scene: Arc::new(scene), source, options, _files: files })
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
        self.source.path()
    }

    /// Warnings of the reader.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.scene.warnings().to_vec()
    }

    fn __repr__(&self) -> String {
        format!("<fluxion.Scene {} of {}x{} pixels>", self.source.path().display(), self.width(), self.height())
    }
}

impl Scene {
    /// The scene with a film of another size, read again if need be.
    pub fn sized(&self, py: Python<'_>, size: Option<(usize, usize)>) -> PyResult<Arc<fluxion::Scene>> {
        match size {
            Some(size) if size != (self.width(), self.height()) => {
                let options = Options { size: Some(size), ..self.options.clone() };
                Ok(load(py, self.source.clone(), options, None)?.scene)
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
            Self::Scene(scene) => Ok((scene.get().sized(py, size)?, scene.get().source.path())),
            Self::Path(path) => {
                let scene = load(py, Source::File(path.clone()), Options { size, ..Options::default() }, None)?;
                Ok((scene.scene, path))
            }
        }
    }
}
