//! Open Image Denoise (Intel, 2018 on), version 2: its ray tracing filter, on the CPU. The library is looked for when it is
//! first used, so that neither building nor running needs it.
#![allow(unsafe_code)]

use std::env;
use std::ffi::{CStr, OsString, c_char, c_int, c_void};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use libloading::{Library, Symbol};

/// An image of three floats a pixel, under the name that the filter knows it by.
pub type Input<'a> = (&'static CStr, &'a [f32]);

/// Size of the networks: larger ones take more time and leave less error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quality {
    /// The smallest.
    Fast = 4,
    /// The middle: two fifths of the largest one's work.
    Balanced = 5,
    /// The largest.
    High = 6,
}

/// Handles of devices and filters.
type Handle = *mut c_void;

/// Values of the library's enumerations.
const DEVICE_TYPE_CPU: c_int = 1;
const FORMAT_FLOAT3: c_int = 3;
const ERROR_NONE: c_int = 0;

/// File names of the library, the one for running first.
const FILES: [&str; 2] = ["libOpenImageDenoise.so.2", "libOpenImageDenoise.so"];

/// Help for those who lack it.
const MISSING: &str = "Open Image Denoise 2 was not found: install it with `pip install pyoidn` in a virtual environment that \
                       is active, or let OIDN_DIR name the folder of an installation that has it in lib/";

/// The functions of the library that are called.
struct Functions {
    new_device: unsafe extern "C" fn(c_int) -> Handle,
    set_device_int: unsafe extern "C" fn(Handle, *const c_char, c_int),
    set_device_bool: unsafe extern "C" fn(Handle, *const c_char, bool),
    commit_device: unsafe extern "C" fn(Handle),
    device_error: unsafe extern "C" fn(Handle, *mut *const c_char) -> c_int,
    release_device: unsafe extern "C" fn(Handle),
    new_filter: unsafe extern "C" fn(Handle, *const c_char) -> Handle,
    set_filter_image: unsafe extern "C" fn(Handle, *const c_char, Handle, c_int, usize, usize, usize, usize, usize),
    set_filter_bool: unsafe extern "C" fn(Handle, *const c_char, bool),
    set_filter_int: unsafe extern "C" fn(Handle, *const c_char, c_int),
    commit_filter: unsafe extern "C" fn(Handle),
    execute_filter: unsafe extern "C" fn(Handle),
    release_filter: unsafe extern "C" fn(Handle),
    /// The library, which stays as long as its functions may be called.
    _library: Library,
}

/// The library's functions, or the reason why there are none.
fn functions() -> Result<&'static Functions, String> {
    static FUNCTIONS: OnceLock<Result<Functions, String>> = OnceLock::new();
    FUNCTIONS.get_or_init(load).as_ref().map_err(Clone::clone)
}

/// Whether the library can be used; the error says how to get it.
pub fn check() -> Result<(), String> {
    functions().map(|_| ())
}

fn load() -> Result<Functions, String> {
    let mut unusable = None;
    for path in candidates() {
        // SAFETY: the library's own initialisation is run, which has no preconditions.
        match unsafe { Library::new(&path) }.and_then(Functions::of) {
            Ok(functions) => return Ok(functions),
            Err(error) if Path::new(&path).exists() => {
                let path = Path::new(&path).display();
                unusable.get_or_insert(format!("{path} cannot be used as Open Image Denoise 2: {error}"));
            }
            Err(_) => {}
        }
    }
    Err(unusable.unwrap_or_else(|| MISSING.to_owned()))
}

/// Names to try: in OIDN_DIR, on the loader's path, and in the wheel of the active virtual environment.
fn candidates() -> Vec<OsString> {
    let in_folder = |folder: PathBuf| FILES.map(|file| folder.join(file).into_os_string());
    let mut paths = Vec::new();
    if let Some(folder) = env::var_os("OIDN_DIR").map(PathBuf::from) {
        paths.extend(in_folder(folder.join("lib")));
        paths.extend(in_folder(folder));
    }
    paths.extend(FILES.map(OsString::from));
    if let Some(environment) = env::var_os("VIRTUAL_ENV") {
        let pythons = std::fs::read_dir(Path::new(&environment).join("lib")).into_iter().flatten().flatten();
        let wheels = pythons.map(|python| python.path().join("site-packages/pyoidn/oidn/lib"));
        paths.extend(wheels.flat_map(in_folder));
    }
    paths
}

impl Functions {
    fn of(library: Library) -> Result<Self, libloading::Error> {
        macro_rules! function {
            ($name:literal) => {{
                // SAFETY: the types of the fields are those of the functions in the library's header.
                let symbol: Symbol<_> = unsafe { library.get($name)? };
                *symbol
            }};
        }
        Ok(Self {
            new_device: function!(b"oidnNewDevice\0"),
            set_device_int: function!(b"oidnSetDeviceInt\0"),
            set_device_bool: function!(b"oidnSetDeviceBool\0"),
            commit_device: function!(b"oidnCommitDevice\0"),
            device_error: function!(b"oidnGetDeviceError\0"),
            release_device: function!(b"oidnReleaseDevice\0"),
            new_filter: function!(b"oidnNewFilter\0"),
            set_filter_image: function!(b"oidnSetSharedFilterImage\0"),
            set_filter_bool: function!(b"oidnSetFilterBool\0"),
            set_filter_int: function!(b"oidnSetFilterInt\0"),
            commit_filter: function!(b"oidnCommitFilter\0"),
            execute_filter: function!(b"oidnExecuteFilter\0"),
            release_filter: function!(b"oidnReleaseFilter\0"),
            _library: library,
        })
    }

    /// Fails with the error that has happened since the last call, if any: of a device, or where it is null of this thread.
    fn check(&self, device: Handle) -> Result<(), String> {
        let mut message = std::ptr::null();
        // SAFETY: the device is valid or null; the message is read before the next call.
        unsafe {
            if (self.device_error)(device, &mut message) == ERROR_NONE {
                return Ok(());
            }
            let known = (!message.is_null()).then(|| CStr::from_ptr(message).to_string_lossy().into_owned());
            Err(known.unwrap_or_else(|| "unknown error".into()))
        }
    }
}

/// A device of so many threads.
pub struct Device {
    handle: Handle,
    functions: &'static Functions,
    /// Megabytes that filters may use, if they are not free to choose; images are then filtered tile by tile.
    memory: Option<c_int>,
}

impl Device {
    /// Starts Open Image Denoise (0 threads: one per core), with about so many bytes of memory for filters. The error is its own
    /// message, or says how to get it.
    pub fn new(threads: usize, memory: Option<u64>) -> Result<Self, String> {
        let functions = functions()?;
        // SAFETY: creating a device has no preconditions; null is checked for.
        let handle = unsafe { (functions.new_device)(DEVICE_TYPE_CPU) };
        if handle.is_null() {
            functions.check(handle)?;
            return Err("no device: the library's device modules must lie beside it".into());
        }
        let memory = memory.map(|bytes| c_int::try_from(bytes >> 20).unwrap_or(c_int::MAX).max(1));
        let device = Self { handle, functions, memory };
        // SAFETY: the device is valid and the names are null-terminated.
        unsafe {
            (functions.set_device_int)(handle, c"numThreads".as_ptr(), threads as c_int);
            (functions.set_device_bool)(handle, c"setAffinity".as_ptr(), false);
            (functions.commit_device)(handle);
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
        quality: Quality,
    ) -> Result<Vec<f32>, String> {
        let floats = width.checked_mul(height).and_then(|pixels| pixels.checked_mul(3));
        let floats = floats.filter(|&floats| inputs.iter().all(|(_, data)| data.len() == floats));
        let mut output = vec![0.0f32; floats.ok_or("images of different sizes")?];
        let functions = self.functions;
        // SAFETY: the device is valid; the filter is released below.
        let filter = unsafe { (functions.new_filter)(self.handle, c"RT".as_ptr()) };
        if filter.is_null() {
            self.check()?;
            return Err("no filter".into());
        }
        let set = |name: *const c_char, data: *const f32| {
            // SAFETY: `data` holds width * height pixels of three floats, as checked above, which outlive the filter.
            // Inputs are only read.
            unsafe {
                let data = data.cast_mut().cast();
                (functions.set_filter_image)(filter, name, data, FORMAT_FLOAT3, width, height, 0, 0, 0);
            }
        };
        for (name, data) in inputs {
            set(name.as_ptr(), data.as_ptr());
        }
        set(c"output".as_ptr(), output.as_mut_ptr());
        // SAFETY: the filter is valid, all its images are set, and it is not used after its release.
        unsafe {
            options.iter().for_each(|option| (functions.set_filter_bool)(filter, option.as_ptr(), true));
            (functions.set_filter_int)(filter, c"quality".as_ptr(), quality as c_int);
            self.memory.iter().for_each(|&most| (functions.set_filter_int)(filter, c"maxMemoryMB".as_ptr(), most));
            (functions.commit_filter)(filter);
            (functions.execute_filter)(filter);
            (functions.release_filter)(filter);
        }
        self.check()?;
        Ok(output)
    }

    fn check(&self) -> Result<(), String> {
        self.functions.check(self.handle)
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: the device is valid and not used any more.
        unsafe { (self.functions.release_device)(self.handle) }
    }
}
