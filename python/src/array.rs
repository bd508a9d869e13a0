//! Images as arrays of height, width and channels in 32-bit floats, and back.

use fluxion::Image;
use numpy::ndarray::ArrayView3;
use numpy::{PyArray3, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::IntoPyDict;

/// A read-only array over the memory of an image. `owner` holds the image, never changes it, and lives as long as the array.
pub fn view<'py>(owner: &Bound<'py, PyAny>, image: &Image) -> PyResult<Bound<'py, PyArray3<f32>>> {
    let shape = (image.height, image.width, image.channels);
    let values =
        ArrayView3::from_shape(shape, &image.data).map_err(|error| PyValueError::new_err(error.to_string()))?;
    // SAFETY: the array keeps a reference to the owner, which is frozen and holds the image, so that the memory stays where
    // it is; nobody writes to it, since the array is made read-only before anyone sees it.
    #[allow(unsafe_code)]
    let array = unsafe { PyArray3::borrow_from_array(&values, owner.clone()) };
    array.try_readwrite()?.make_nonwriteable();
    Ok(array)
}

/// Whatever NumPy makes an array of, as an image of that many channels, or of any number if none is given. Two dimensions are
/// one channel.
pub fn image(array: &Bound<'_, PyAny>, what: &str, channels: Option<usize>) -> PyResult<Image> {
    let numpy = array.py().import("numpy")?;
    let options = [("dtype", numpy.getattr("float32")?)].into_py_dict(array.py())?;
    let array: PyReadonlyArrayDyn<f32> = numpy.call_method("ascontiguousarray", (array,), Some(&options))?.extract()?;
    let (height, width, found) = match *array.shape() {
        [height, width] => (height, width, 1),
        [height, width, channels] => (height, width, channels),
        ref other => {
            return Err(PyValueError::new_err(format!(
                "{what} has {} dimensions; give height, width, channels",
                other.len()
            )));
        }
    };
    if let Some(wanted) = channels.filter(|&wanted| wanted != found) {
        let text = format!("{what} has {found} channels, not {wanted}");
        return Err(PyValueError::new_err(text));
    }
    Ok(Image { width, height, channels: found, data: array.as_slice()?.to_vec() })
}
