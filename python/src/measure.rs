//! Image files, metrics, and the table of methods.

use std::path::PathBuf;

use fluxion::Image;
use fluxion::image::io::{self, Extras};
use fluxion::metrics::METRICS;
use fluxion::reconstruct::METHODS;
use numpy::{IntoPyArray, PyArray1, PyArray3, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::array::image;
use crate::work;

/// Distances between two images of height x width x 3, by the metrics of `fluxion compare`, or those named.
#[pyfunction]
#[pyo3(signature = (image, reference, metrics=None))]
pub fn compare<'py>(
    py: Python<'py>,
    image: &Bound<'py, PyAny>,
    reference: &Bound<'py, PyAny>,
    metrics: Option<Vec<String>>,
) -> PyResult<Bound<'py, PyDict>> {
    let named = |text: &str| crate::array::image(if text == "image" { image } else { reference }, text, Some(3));
    let (image, reference) = (named("image")?, named("reference")?);
    let all = METRICS.iter().map(|metric| metric.id.to_owned());
    let names = metrics.unwrap_or_else(|| all.collect());
    for name in &names {
        if fluxion::metrics::find(name).is_none() {
            let known: Vec<_> = METRICS.iter().map(|metric| metric.id).collect();
            return Err(PyValueError::new_err(format!("{name} is no metric; there are {}", known.join(", "))));
        }
    }
    let measured = work::run(py, 0, None, move |link| {
        let found = names.into_iter().filter_map(|name| Some((fluxion::metrics::find(&name)?, name)));
        let measure = |(metric, name): (&fluxion::metrics::Metric, String)| {
            link.report(&name, 0.0);
            Ok((name, metric.measure(&image, &reference)?.mean))
        };
        found.map(measure).collect::<fluxion::Result<Vec<_>>>()
    })?;
    let dict = PyDict::new(py);
    measured.into_iter().try_for_each(|(name, value)| dict.set_item(name, value))?;
    Ok(dict)
}

/// The metrics of `compare` with their descriptions.
#[pyfunction]
pub fn metrics(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let dict = PyDict::new(py);
    METRICS.iter().try_for_each(|metric| dict.set_item(metric.id, metric.summary))?;
    Ok(dict)
}

/// The methods of `reconstruct` with their descriptions and parameters.
#[pyfunction]
pub fn methods(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let dict = PyDict::new(py);
    for method in METHODS {
        let of =
            method.parameters.iter().map(|known| format!("\n  {}={}: {}", known.name, known.default, known.summary));
        dict.set_item(method.id, method.summary.to_owned() + &of.collect::<String>())?;
    }
    Ok(dict)
}

/// Reads an image file as linear colours: height x width x 3.
#[pyfunction]
pub fn read_image(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyArray3<f32>>> {
    let Image { width, height, channels, data } = work::run(py, 0, None, move |_| io::read_color(&path))?;
    let array: Bound<'_, PyArray1<f32>> = data.into_pyarray(py);
    array.reshape([height, width, channels])
}

/// Writes linear colours of height x width x 3 in the format of the extension: exr, hdr, pfm and tiff as they are, png and jpg
/// display-encoded, made brighter by `exposure` powers of two.
#[pyfunction]
#[pyo3(signature = (path, array, *, exposure=0.0))]
pub fn write_image(py: Python<'_>, path: PathBuf, array: &Bound<'_, PyAny>, exposure: f32) -> PyResult<()> {
    let image = image(array, "the image", Some(3))?;
    work::run(py, 0, None, move |_| io::write_color(&path, &image, &Extras { exposure, ..Extras::default() }))
}
