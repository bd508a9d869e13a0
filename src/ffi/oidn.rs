//! Open Image Denoise (Intel, 2018 on): its ray tracing filter, on the CPU.
#![allow(unsafe_code)]

use std::ffi::{CStr, c_char};

use oidn::sys as raw;

/// An image of three floats a pixel, under the name that the filter knows it by.
pub type Input<'a> = (&'static CStr, &'a [f32]);

/// A device of so many threads.
pub struct Device(raw::OIDNDevice);

impl Device {
    /// Starts Open Image Denoise (0 threads: one per core). The error is its own message.
    pub fn new(threads: usize) -> Result<Self, String> {
        // SAFETY: creating a device has no preconditions; null is checked for.
        let handle = unsafe { raw::oidnNewDevice(raw::OIDNDeviceType_OIDN_DEVICE_TYPE_CPU) };
        if handle.is_null() {
            return Err("no device: the library's device modules must lie beside it".into());
        }
        let device = Self(handle);
        // SAFETY: the device is valid and the names are null-terminated.
        unsafe {
            raw::oidnSetDeviceInt(device.0, c"numThreads".as_ptr(), threads as i32);
            raw::oidnSetDeviceBool(device.0, c"setAffinity".as_ptr(), false);
            raw::oidnCommitDevice(device.0);
        }
        device.check()?;
        Ok(device)
    }

    /// Filters images of `width` by `height` pixels into one: the colour if it is among them, else the only one.
    pub fn filter(
        &self,
        (width, height): (usize, usize),
        inputs: &[Input],
        options: &[&'static CStr],
    ) -> Result<Vec<f32>, String> {
        let floats = width.checked_mul(height).and_then(|pixels| pixels.checked_mul(3));
        let floats = floats.filter(|&floats| inputs.iter().all(|(_, data)| data.len() == floats));
        let mut output = vec![0.0f32; floats.ok_or("images of different sizes")?];
        // SAFETY: the device is valid; the filter is released below.
        let filter = unsafe { raw::oidnNewFilter(self.0, c"RT".as_ptr()) };
        if filter.is_null() {
            self.check()?;
            return Err("no filter".into());
        }
        let set = |name: *const c_char, data: *const f32| {
            // SAFETY: `data` holds width * height pixels of three floats, as checked above, which outlive the filter.
            // Inputs are only read.
            unsafe {
                let format = raw::OIDNFormat_OIDN_FORMAT_FLOAT3;
                raw::oidnSetSharedFilterImage(filter, name, data.cast_mut().cast(), format, width, height, 0, 0, 0);
            }
        };
        for (name, data) in inputs {
            set(name.as_ptr(), data.as_ptr());
        }
        set(c"output".as_ptr(), output.as_mut_ptr());
        // SAFETY: the filter is valid, all its images are set, and it is not used after its release.
        unsafe {
            options.iter().for_each(|option| raw::oidnSetFilterBool(filter, option.as_ptr(), true));
            raw::oidnCommitFilter(filter);
            raw::oidnExecuteFilter(filter);
            raw::oidnReleaseFilter(filter);
        }
        self.check()?;
        Ok(output)
    }

    /// The error that has happened since the last call, if any.
    fn check(&self) -> Result<(), String> {
        let mut message = std::ptr::null();
        // SAFETY: the device is valid; the message is read before the next call.
        unsafe {
            if raw::oidnGetDeviceError(self.0, &mut message) == raw::OIDNError_OIDN_ERROR_NONE {
                return Ok(());
            }
            let known = (!message.is_null()).then(|| CStr::from_ptr(message).to_string_lossy().into_owned());
            Err(known.unwrap_or_else(|| "unknown error".into()))
        }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: the device is valid and not used any more.
        unsafe { raw::oidnReleaseDevice(self.0) }
    }
}
