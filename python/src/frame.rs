//! Frames.

use std::ffi::CString;
use std::path::PathBuf;
use std::sync::Arc;

use fluxion::film::{Frame as Layers, Layer};
use fluxion::{Image, exr};
use numpy::PyArray3;
use pyo3::exceptions::{PyKeyError, PyUserWarning, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::array::{image, view};
use crate::error::raised;
use crate::work;

/// Means and variances of all samples, as layers: what a reconstruction takes.
///
/// `frame["albedo"]` is a read-only array of height, width and channels over the frame's own memory; `frame.keys()` are the
/// layers that there are. The scattered colour is `color`; add `direct`, the emitters that the camera sees.
#[pyclass(frozen, mapping, module = "fluxion")]
pub struct Frame(pub Arc<Layers>);

/// Name of a layer in Python.
fn name(layer: Layer) -> String {
    match layer {
        Layer::Color => "color".into(),
        Layer::ColorVariance => "color_variance".into(),
        Layer::Alpha => "alpha".into(),
        other => other.name(),
    }
}

fn layer(wanted: &str) -> Option<Layer> {
    Layer::all().find(|&layer| name(layer) == wanted)
}

#[pymethods]
impl Frame {
    /// A frame of arrays, such as another renderer's image and auxiliary channels (AOVs).
    ///
    /// `color` is the radiance, height x width x 3, `spp` the samples of a pixel. Further layers are given by their names:
    /// `albedo`, `normal`, `depth`, `position`, each with its `_variance`, the variance of the mean, if it is known;
    /// `color_variance`, which most methods need. Features without a variance are taken to have no noise.
    #[staticmethod]
    #[pyo3(signature = (color, *, spp=None, **layers))]
    fn from_arrays(color: &Bound<'_, PyAny>, spp: Option<u32>, layers: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let mut frame = frame_of(image(color, "color", Some(3))?)?;
        set_layers(&mut frame, layers)?;
        frame.complete(spp);
        Ok(Self(Arc::new(frame)))
    }

    /// A frame of several renders of one picture with different seeds, of `spp` samples a pixel each: their mean, with the
    /// variance that they tell. Two are enough for a method to work, eight tell its noise well.
    #[staticmethod]
    #[pyo3(signature = (colors, *, spp, **layers))]
    fn from_renders(colors: Vec<Bound<'_, PyAny>>, spp: u32, layers: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let renders = colors.iter().map(|color| image(color, "a render", Some(3))).collect::<PyResult<Vec<_>>>()?;
        let mut frame = Layers::of_renders(&renders, spp).map_err(raised)?;
        set_layers(&mut frame, layers)?;
        frame.complete(None);
        Ok(Self(Arc::new(frame)))
    }

    /// Reads an EXR file of layers, as `save` and `fluxion render --layers` write it, or of another renderer's auxiliary
    /// channels, with `spp` samples where the file does not say how many, and of several view layers the one of a name.
    #[staticmethod]
    #[pyo3(signature = (path, *, spp=None, view_layer=None))]
    fn load(py: Python<'_>, path: PathBuf, spp: Option<u32>, view_layer: Option<String>) -> PyResult<Self> {
        let (frame, warning) = work::run(py, 0, None, move |_| {
            exr::load_other(&path, exr::Reading { spp, view_layer: view_layer.as_deref() })
        })?;
        if let Some(warning) = warning {
            PyErr::warn(py, &py.get_type::<PyUserWarning>(), &CString::new(warning.replace('\0', " "))?, 2)?;
        }
        Ok(Self(Arc::new(frame)))
    }

    /// Writes all layers to an EXR file, without loss.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let frame = Arc::clone(&self.0);
        work::run(py, 0, None, move |_| exr::save(&path, &frame))
    }

    /// Pixels in a row.
    #[getter]
    fn width(&self) -> usize {
        self.0.width
    }

    /// Number of rows.
    #[getter]
    fn height(&self) -> usize {
        self.0.height
    }

    /// Scene, seed, samples, version and so on, as the headers of files have them.
    #[getter]
    fn provenance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        for (name, value) in self.0.provenance.attributes() {
            dict.set_item(name.trim_start_matches("fluxion:"), value)?;
        }
        Ok(dict)
    }

    /// Names of the layers that there are.
    fn keys(&self) -> Vec<String> {
        self.0.present().map(|(layer, _)| name(layer)).collect()
    }

    fn __len__(&self) -> usize {
        self.0.present().count()
    }

    fn __contains__(&self, key: &str) -> bool {
        layer(key).is_some_and(|layer| self.0.get(layer).is_some())
    }

    fn __getitem__<'py>(slf: &Bound<'py, Self>, key: &str) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let frame = &slf.get().0;
        match layer(key).and_then(|layer| frame.get(layer)) {
            Some(image) => view(slf.as_any(), image),
            None => Err(PyKeyError::new_err(format!("{key}: the frame has {}", slf.get().keys().join(", ")))),
        }
    }

    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.keys().into_pyobject(py)?.call_method0("__iter__")
    }

    fn __repr__(&self) -> String {
        format!("<fluxion.Frame of {}x{} pixels, {} layers>", self.0.width, self.0.height, self.__len__())
    }
}

/// A frame of a colour alone.
fn frame_of(color: Image) -> PyResult<Layers> {
    if color.is_empty() {
        return Err(PyValueError::new_err("color has no pixels"));
    }
    let mut frame = Layers::new(color.width, color.height);
    frame.set(Layer::Color, color);
    Ok(frame)
}

fn set_layers(frame: &mut Layers, layers: Option<&Bound<'_, PyDict>>) -> PyResult<()> {
    for (key, array) in layers.into_iter().flatten() {
        let key: String = key.extract()?;
        let layer = layer(&key).ok_or_else(|| {
            let known: Vec<_> = Layer::all().filter(|layer| layer.bin_number().is_none()).map(name).collect();
            PyValueError::new_err(format!("{key} is no layer; there are {}", known.join(", ")))
        })?;
        let image = image(&array, &key, Some(layer.info().channels.len()))?;
        if (image.width, image.height) != (frame.width, frame.height) {
            let text = format!(
                "{key} is of {}x{} pixels, color of {}x{}",
                image.width, image.height, frame.width, frame.height
            );
            return Err(PyValueError::new_err(text));
        }
        frame.set(layer, image);
    }
    Ok(())
}
