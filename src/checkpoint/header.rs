//! The part of a checkpoint's file before its tiles, and the checksum behind them. All numbers are little-endian:
//!
//! | bytes | content |
//! |---|---|
//! | 8 | `FLUXCKPT` |
//! | 4 | version of the format |
//! | 4 | length of the header |
//! | | header, JSON: origin of the film, seconds, first rejected sample, kernel, notes of an adaptive run |
//! | | of a film with chosen neighbours: their mask of every pixel, and weights, if any, as half floats |
//! | | the film's statistics, tile by tile |
//! | | of an adaptive run: every pixel's sample count goal, and the images of the pass before |
//! | 4 | CRC-32 of everything before |

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crc32fast::Hasher;
use half::f16;
use serde::{Deserialize, Serialize};

use super::Origin;
use crate::adaptive::Notes;
use crate::error::{Error, Result};
use crate::files;
use crate::film::{EdgeNeed, Kernel, NEWEST, Needs, Neighbours, Rejected, STEPS, StepWeights, Tile};
use crate::render::SampleId;

const MAGIC: [u8; 8] = *b"FLUXCKPT";

/// Version of the format, which every new statistic raises.
const VERSION: u32 = NEWEST;
/// The oldest version that is read.
const OLDEST: u32 = 2;

/// Headers longer than this are damaged.
const MAX_HEADER: u32 = 1 << 24;

/// Everything about a film but its statistics.
#[derive(Serialize, Deserialize)]
pub struct Header {
    pub origin: Origin,
    pub seconds: f64,
    /// The first sample that was not finite.
    rejected: Option<(SampleId, String)>,
    pub adaptive: Option<Adaptive>,
    #[serde(default)]
    kernel: StoredKernel,
}

/// The parts of a journal that follow the tiles.
#[derive(Serialize, Deserialize)]
pub struct Adaptive {
    pub notes: Notes,
    pub goals: bool,
    pub previous: bool,
}

/// The half-edges that the film has.
#[derive(Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum StoredKernel {
    #[default]
    Cross,
    Pending,
    /// By masks that follow, and weights if there are any.
    Chosen {
        directed: bool,
        #[serde(default)]
        weighted: bool,
    },
}

impl Header {
    /// The header of a film.
    pub fn new(
        origin: Origin,
        seconds: f64,
        rejected: Option<(SampleId, Rejected)>,
        kernel: &Kernel,
        adaptive: Option<Adaptive>,
    ) -> Self {
        let kernel = match kernel {
            Kernel::Cross => StoredKernel::Cross,
            Kernel::Pending => StoredKernel::Pending,
            Kernel::Chosen(chosen) => {
                StoredKernel::Chosen { directed: chosen.is_directed(), weighted: !chosen.weights().is_empty() }
            }
        };
        Self { origin, seconds, rejected: rejected.map(|(id, reason)| (id, reason.0.to_owned())), adaptive, kernel }
    }

    /// The first sample that was not finite. Unknown reasons are kept for display.
    pub fn rejected(&self) -> Option<(SampleId, Rejected)> {
        self.rejected.as_ref().map(|(id, reason)| (*id, Rejected::named(reason)))
    }

    /// Fewest bytes that a pixel of the film takes.
    fn least_bytes(&self) -> usize {
        match self.kernel {
            StoredKernel::Cross => self.origin.needs.bytes_per_pixel(),
            _ => Needs { edges: EdgeNeed::Off, ..self.origin.needs }.bytes_per_pixel(),
        }
    }
}

/// A stream whose bytes are counted and whose checksum is computed on the way.
pub struct Checksummed<T> {
    inner: T,
    sum: Hasher,
    count: u64,
}

impl<T> Checksummed<T> {
    fn new(inner: T) -> Self {
        Self { inner, sum: Hasher::new(), count: 0 }
    }

    fn add(&mut self, bytes: &[u8]) {
        self.sum.update(bytes);
        self.count += bytes.len() as u64;
    }
}

impl<T: Write> Write for Checksummed<T> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.inner.write(bytes)?;
        self.add(&bytes[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

impl<T: Read> Read for Checksummed<T> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let count = self.inner.read(bytes)?;
        self.add(&bytes[..count]);
        Ok(count)
    }
}

/// Writes a file that replaces the one at `path` when it is complete: header, then what `rest` appends, then the checksum.
pub fn write(
    path: &Path,
    (header, kernel): (&Header, &Kernel),
    rest: impl FnOnce(&mut Checksummed<BufWriter<File>>) -> Result<()>,
) -> Result<()> {
    files::replace(path, |part| {
        let failed = |error: io::Error| Error::io(part, error);
        let mut to = Checksummed::new(BufWriter::with_capacity(1 << 20, File::create(part).map_err(failed)?));
        start(&mut to, header, kernel).map_err(failed)?;
        rest(&mut to)?;
        let sum = to.sum.clone().finalize();
        to.write_all(&sum.to_le_bytes()).and_then(|()| to.flush()).map_err(failed)
    })
}

fn start(to: &mut impl Write, header: &Header, kernel: &Kernel) -> io::Result<()> {
    let header = serde_json::to_vec(header)?;
    to.write_all(&MAGIC)?;
    to.write_all(&VERSION.to_le_bytes())?;
    to.write_all(&(header.len() as u32).to_le_bytes())?;
    to.write_all(&header)?;
    let Kernel::Chosen(chosen) = kernel else { return Ok(()) };
    chosen.masks().iter().try_for_each(|mask| to.write_all(&mask.to_le_bytes()))?;
    chosen.weights().iter().flatten().try_for_each(|weight| to.write_all(&weight.to_le_bytes()))
}

/// Whether a file begins like a checkpoint.
pub fn is_one(path: &Path) -> bool {
    let mut magic = [0; MAGIC.len()];
    File::open(path).and_then(|mut file| file.read_exact(&mut magic)).is_ok() && magic == MAGIC
}

/// The fault of a file that was claimed, as renders do when they begin, and never written.
const EMPTY: &str = "is empty: whoever was to write it ended before it did";

/// A checkpoint that is being read: its tiles come one by one.
pub struct Reader {
    path: PathBuf,
    from: Checksummed<BufReader<File>>,
    /// Bytes of the file.
    length: u64,
    pub header: Header,
    pub kernel: Kernel,
    /// Version of the format, which says which statistics the film has.
    version: u32,
}

impl Reader {
    /// Opens a file and reads its header; `buffer` bytes are read at a time.
    pub fn open(path: &Path, buffer: usize) -> Result<Self> {
        let failed = |error| Error::io(path, explain(error));
        let file = File::open(path).map_err(failed)?;
        let length = file.metadata().map_err(failed)?.len();
        if length == 0 {
            return Err(Error::io(path, EMPTY));
        }
        let mut from = Checksummed::new(BufReader::with_capacity(buffer, file));
        let (header, version) = header(&mut from, length).map_err(failed)?;
        let size = header.origin.size;
        let kernel = match header.kernel {
            StoredKernel::Cross => Kernel::Cross,
            StoredKernel::Pending => Kernel::Pending,
            StoredKernel::Chosen { directed, weighted } => {
                let pixels = size.0 * size.1;
                let masks = words(&mut from, pixels).map_err(failed)?;
                let weights = if weighted { weights(&mut from, pixels).map_err(failed)? } else { Vec::new() };
                Kernel::Chosen(Arc::new(Neighbours::new(size, masks, directed).weighted(weights)))
            }
        };
        Ok(Self { path: path.to_path_buf(), from, length, header, kernel, version })
    }

    /// Name of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Fills the next of the film's tiles.
    pub fn tile(&mut self, tile: &mut Tile) -> Result<()> {
        tile.read(self.version, &mut self.from).map_err(|error| Error::io(&self.path, explain(error)))
    }

    /// Reads so many words.
    pub fn words(&mut self, count: usize) -> Result<Vec<u32>> {
        words(&mut self.from, count).map_err(|error| Error::io(&self.path, explain(error)))
    }

    /// Skips the rest of the file and checks the checksum. The error says that the file is damaged.
    pub fn finish(mut self) -> Result<()> {
        let left = (self.length.saturating_sub(size_of::<u32>() as u64)).saturating_sub(self.from.count);
        let mut skipped = self.from.by_ref().take(left);
        io::copy(&mut skipped, &mut io::sink()).map_err(|error| Error::io(&self.path, explain(error)))?;
        let sum = self.from.sum.clone().finalize();
        let mut stored = [0; 4];
        let ends = self.from.inner.read_exact(&mut stored).is_ok() && matches!(self.from.inner.read(&mut [0]), Ok(0));
        if !ends || u32::from_le_bytes(stored) != sum {
            return Err(Error::io(&self.path, "is damaged: its checksum is not that of its content"));
        }
        Ok(())
    }
}

fn explain(error: io::Error) -> String {
    match error.kind() {
        io::ErrorKind::UnexpectedEof => "is damaged: it ends too early".into(),
        io::ErrorKind::InvalidData => format!("is damaged: {error}"),
        _ => error.to_string(),
    }
}

/// The header, and the version of the format.
fn header(from: &mut impl Read, length: u64) -> io::Result<(Header, u32)> {
    let mut magic = [0; MAGIC.len()];
    let invalid = |what: String| io::Error::new(io::ErrorKind::InvalidData, what);
    if from.read_exact(&mut magic).is_err() || magic != MAGIC {
        return Err(io::Error::other("is no checkpoint of `fluxion render --checkpoint`"));
    }
    let version = word(from)?;
    if !(OLDEST..=VERSION).contains(&version) {
        let what = format!("is a checkpoint of format {version}; this fluxion reads formats {OLDEST} to {VERSION}");
        return Err(io::Error::other(what));
    }
    let count = word(from)?;
    if count > MAX_HEADER || u64::from(count) > length {
        return Err(invalid(format!("its header claims {count} bytes")));
    }
    let mut header = vec![0; count as usize];
    from.read_exact(&mut header)?;
    let header: Header = serde_json::from_slice(&header).map_err(|error| invalid(error.to_string()))?;
    if header.origin.lights.len() != usize::from(header.origin.needs.lights) {
        return Err(invalid("its header names other light groups than the film has".into()));
    }
    let (width, height) = header.origin.size;
    let pixels = width.checked_mul(height).filter(|&pixels| pixels > 0);
    // Nothing is allocated for more pixels than the file has bytes for.
    let least = pixels.and_then(|pixels| pixels.checked_mul(header.least_bytes()));
    if least.is_none_or(|least| least as u64 > length) {
        return Err(invalid(format!("its header claims {width}x{height} pixels in {length} bytes")));
    }
    Ok((header, version))
}

fn words(from: &mut impl Read, count: usize) -> io::Result<Vec<u32>> {
    let mut bytes = Vec::new();
    from.by_ref().take(4 * count as u64).read_to_end(&mut bytes)?;
    if bytes.len() < 4 * count {
        return Err(io::Error::from(io::ErrorKind::UnexpectedEof));
    }
    Ok(bytes.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]])).collect())
}

/// Half floats across all steps of so many pixels.
fn weights(from: &mut impl Read, pixels: usize) -> io::Result<Vec<StepWeights>> {
    let halves: Vec<_> = words(from, pixels * STEPS.len() / 2)?
        .into_iter()
        .flat_map(|word| [word as u16, (word >> 16) as u16].map(f16::from_bits))
        .collect();
    if halves.iter().any(|weight| !weight.is_finite() || weight.is_sign_negative()) {
        return Err(io::Error::new(io::ErrorKind::InvalidData, "a weight is negative or not finite"));
    }
    Ok(halves.chunks_exact(STEPS.len()).map(|of_pixel| std::array::from_fn(|step| of_pixel[step])).collect())
}

fn word(from: &mut impl Read) -> io::Result<u32> {
    Ok(words(from, 1)?[0])
}
