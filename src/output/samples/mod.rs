//! Camera samples one by one, as arrays that NumPy opens: what per-sample denoisers and kernel selectors learn from.
//!
//! A folder holds a file for each quantity, of the shape (samples, rows, columns, channels), and `samples.json`, which describes
//! them. Samples are written as soon as they are taken, so that the memory does not grow with their number.

mod column;

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock};

use schemars::JsonSchema;
use serde::Serialize;

use self::column::{COLUMNS, Column};
use crate::error::{Error, Result};
use crate::files;
use crate::film::{Film, Kernel, Provenance, STEPS};
use crate::image::npy::{self, Number};
use crate::math::Rgb;
use crate::render::{SampleSink, Samples, WaveSamples};
use crate::scene::Scene;
use crate::scene::sensor::Sensor;
use crate::sync::{into_inner, lock};

/// Writes the samples of a render into a folder.
pub struct SampleWriter {
    folder: PathBuf,
    sensor: Sensor,
    spp: u32,
    columns: Vec<Array>,
    /// Differences of the samples that come with some, with room for the half-edges of every pixel.
    differences: OnceLock<Option<Array>>,
    /// Positions within the pixels, by number of the sample.
    film: Mutex<Vec<f32>>,
    failed: Mutex<Option<Error>>,
}

/// A file of values, (samples, rows, columns, channels).
struct Array {
    path: PathBuf,
    file: File,
    /// Bytes before the values.
    start: u64,
    shape: Vec<usize>,
}

/// The description that `samples.json` holds.
#[derive(Serialize, JsonSchema)]
pub struct Description {
    /// Version of Fluxion.
    version: String,
    /// Name of the scene file.
    scene: String,
    /// The scene's, in hexadecimal.
    fingerprint: String,
    /// Seed of the samples, as a decimal number.
    seed: String,
    /// Samples of every pixel that there is room for.
    samples: u32,
    /// Samples that every pixel has, fewer if the render was stopped; zeros stand for the others.
    taken: u32,
    /// Pixels in a row.
    width: usize,
    /// Number of rows.
    height: usize,
    /// Neighbours of the differences.
    kernel: String,
    /// Files in the folder.
    arrays: Vec<Entry>,
}

/// A file of the folder.
#[derive(Serialize, JsonSchema)]
pub struct Entry {
    /// Name of the file.
    file: String,
    /// Lengths of the array's indices, the last one fastest.
    shape: Vec<usize>,
    /// Description of the values.
    content: String,
}

impl SampleWriter {
    /// Preallocates the files for `spp` samples of every pixel.
    pub fn new(folder: &Path, scene: &Scene, spp: u32) -> Result<Self> {
        std::fs::create_dir_all(folder).map_err(|error| Error::io(folder, error))?;
        let sensor = scene.sensor().clone();
        let of_column = |column: &Column| {
            let shape = vec![spp as usize, sensor.height, sensor.width, column.channels];
            Array::create(folder.join(format!("{}.npy", column.name)), shape)
        };
        let columns = COLUMNS.iter().map(of_column).collect::<Result<_>>()?;
        let (film, failed) = (Mutex::new(vec![0.0; 2 * spp as usize]), Mutex::new(None));
        Ok(Self { folder: folder.to_path_buf(), sensor, spp, columns, differences: OnceLock::new(), film, failed })
    }

    /// Completes the folder by what is known of the whole film. The error is the first that has occurred while writing.
    pub fn finish(self, film: &Film, provenance: &Provenance) -> Result<()> {
        if let Some(error) = into_inner(self.failed) {
            return Err(error);
        }
        let positions = into_inner(self.film);
        npy::write(&self.folder.join("film.npy"), &[self.spp as usize, 2], &positions, Number::Float32)?;
        let mut arrays: Vec<_> =
            self.columns.iter().zip(COLUMNS).map(|(array, column)| array.entry(column.content)).collect();
        let content = "position within the pixel, right and down in [0, 1), the same for all pixels";
        arrays.push(Entry { file: "film.npy".into(), shape: vec![self.spp as usize, 2], content: content.into() });
        if let Some(array) = self.differences.into_inner().flatten() {
            let steps: Vec<_> = STEPS.iter().map(|(x, y)| format!("({x}, {y})")).collect();
            let masks: Vec<f32> = match film.kernel() {
                Kernel::Chosen(neighbours) => neighbours.masks().iter().map(|&mask| mask as f32).collect(),
                _ => vec![crate::film::CROSS as f32; film.width * film.height],
            };
            let path = self.folder.join("neighbours.npy");
            npy::write(&path, &[film.height, film.width], &masks, Number::Float32)?;
            arrays.push(array.entry(
                "radiance that the pixel's end of an edge adds to `neighbour minus pixel`, of every neighbour in the order of its bits; \
                 not a number in samples without differences, zero beyond the last neighbour",
            ));
            arrays.push(Entry {
                file: "neighbours.npy".into(),
                shape: vec![film.height, film.width],
                content: format!("mask of the neighbours; its bits are steps in columns and rows: {}", steps.join(" ")),
            });
        }
        let description = Description {
            version: provenance.version.clone(),
            scene: provenance.scene.clone(),
            fingerprint: provenance.fingerprint.clone(),
            seed: provenance.seed.clone(),
            samples: self.spp,
            taken: film.fewest_samples(),
            width: film.width,
            height: film.height,
            kernel: if provenance.kernel.is_empty() { "cross".into() } else { provenance.kernel.clone() },
            arrays,
        };
        let path = self.folder.join("samples.json");
        let text = serde_json::to_string_pretty(&description).map_err(|error| Error::bad_data(&path, error))?;
        files::write(&path, text + "\n")
    }

    fn write(&self, wave: &WaveSamples) -> Result<()> {
        let mut values = Vec::new();
        for (first, count) in runs(wave.pixels) {
            let to = (wave.number, wave.pixels[first]);
            for (array, column) in self.columns.iter().zip(COLUMNS) {
                values.clear();
                let samples = &wave.samples.all[first..first + count];
                samples.iter().for_each(|sample| (column.append)(sample, &self.sensor, &mut values));
                array.put(to, &values)?;
            }
            let Some(array) = self.differences(wave.samples) else { continue };
            values.clear();
            for index in first..first + count {
                let found = wave.samples.differences(index).map_or(&[][..], |found| found.color);
                let colors = found.iter().copied().chain(std::iter::repeat(Rgb::ZERO)).take(array.shape[3]);
                values.extend(colors.flat_map(|color| color.to_array()));
            }
            array.put(to, &values)?;
        }
        Ok(())
    }

    /// The file of differences, made with the first samples that come with some.
    fn differences(&self, samples: &Samples) -> Option<&Array> {
        let slots = samples.slots()?;
        let make = || {
            let shape = vec![self.spp as usize, self.sensor.height, self.sensor.width, slots, 3];
            let path = self.folder.join("differences.npy");
            self.note(Array::create(path, shape).and_then(Array::without_values))
        };
        self.differences.get_or_init(make).as_ref()
    }

    /// Keeps the first error.
    fn note<T>(&self, result: Result<T>) -> Option<T> {
        let mut failed = lock(&self.failed);
        match result {
            Ok(value) => Some(value),
            Err(error) => {
                failed.get_or_insert(error);
                None
            }
        }
    }
}

impl SampleSink for SampleWriter {
    fn put(&self, wave: &WaveSamples) {
        if wave.number >= self.spp {
            return;
        }
        let mut film = lock(&self.film);
        film[2 * wave.number as usize..][..2].copy_from_slice(&wave.film.to_array());
        drop(film);
        self.note(self.write(wave));
    }
}

/// Runs of pixels that follow each other in a row: the first of each, and their number.
fn runs(pixels: &[(usize, usize)]) -> impl Iterator<Item = (usize, usize)> {
    let mut first = 0;
    std::iter::from_fn(move || {
        let &(x, y) = pixels.get(first)?;
        let count = pixels[first..].iter().enumerate().take_while(|(k, pixel)| **pixel == (x + k, y)).count();
        first += count;
        Some((first - count, count))
    })
}

impl Array {
    /// A file with room for all values, which are zero.
    fn create(path: PathBuf, shape: Vec<usize>) -> Result<Self> {
        let header = npy::header(&shape, Number::Float32);
        let make = || {
            let file = File::create(&path)?;
            file.write_all_at(&header, 0)?;
            file.set_len((header.len() + shape.iter().product::<usize>() * size_of::<f32>()) as u64)?;
            Ok(file)
        };
        let file = make().map_err(|error: std::io::Error| Error::io(&path, error))?;
        Ok(Self { path, file, start: header.len() as u64, shape })
    }

    /// Preallocates a file filled with NaN.
    fn without_values(self) -> Result<Self> {
        let row: usize = self.shape[2..].iter().product();
        let blank = vec![f32::NAN; row];
        for sample in 0..self.shape[0] as u32 {
            (0..self.shape[1]).try_for_each(|y| self.put((sample, (0, y)), &blank))?;
        }
        Ok(self)
    }

    /// Writes values from a pixel of a sample on.
    fn put(&self, (sample, (x, y)): (u32, (usize, usize)), values: &[f32]) -> Result<()> {
        let of_pixel = self.shape[3..].iter().product::<usize>() * size_of::<f32>();
        let pixel = (sample as usize * self.shape[1] + y) * self.shape[2] + x;
        let at = self.start + (pixel * of_pixel) as u64;
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.file.write_all_at(&bytes, at).map_err(|error| Error::io(&self.path, error))
    }

    fn entry(&self, content: &str) -> Entry {
        let file = self.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Entry { file, shape: self.shape.clone(), content: content.to_owned() }
    }
}
