//! Checkpoints as files. All numbers are little-endian:
//!
//! | bytes | content |
//! |---|---|
//! | 8 | `FLUXCKPT` |
//! | 4 | version of the format |
//! | 4 | length of the header |
//! | | header, JSON: origin of the film, seconds, first rejected sample, kernel, notes of an adaptive run |
//! | | of a film with chosen neighbours: their mask of every pixel |
//! | | the film's statistics, tile by tile |
//! | | of an adaptive run: every pixel's sample count goal, and the images of the pass before |
//! | 4 | CRC-32 of everything before |

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::Path;
use std::time::Duration;

use crc32fast::Hasher;
use serde::{Deserialize, Serialize};

use super::{Checkpoint, Origin};
use crate::adaptive::{Journal, Notes, PreviousPass};
use crate::error::{Error, Result};
use crate::files;
use crate::film::{EdgeNeed, Film, Kernel, Needs, Neighbours, Rejected};
use crate::image::Image;
use crate::render::{RenderOutcome, SampleId};

const MAGIC: [u8; 8] = *b"FLUXCKPT";

/// Version of the format: raised whenever the bytes change their meaning.
const VERSION: u32 = 4;
/// Versions before that are read, too.
const BEFORE: [u32; 2] = [3, 2];
/// The version whose films have no alpha, and the number of statistics that they have.
const WITHOUT_ALPHA: (u32, usize) = (2, 10);

/// Headers longer than this are damaged.
const MAX_HEADER: u32 = 1 << 20;

#[derive(Serialize, Deserialize)]
struct Header {
    origin: Origin,
    seconds: f64,
    /// The first sample that was not finite.
    rejected: Option<(SampleId, String)>,
    adaptive: Option<Adaptive>,
    #[serde(default)]
    kernel: StoredKernel,
}

/// The half-edges that the film has.
#[derive(Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum StoredKernel {
    #[default]
    Cross,
    Pending,
    /// By masks that follow.
    Chosen {
        directed: bool,
    },
}

/// The parts of a journal that follow.
#[derive(Serialize, Deserialize)]
struct Adaptive {
    notes: Notes,
    goals: bool,
    previous: bool,
}

/// A stream whose bytes are summed up on the way.
struct Summed<T> {
    inner: T,
    sum: Hasher,
}

impl<T> Summed<T> {
    fn new(inner: T) -> Self {
        Self { inner, sum: Hasher::new() }
    }
}

impl<T: Write> Write for Summed<T> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.inner.write(bytes)?;
        self.sum.update(&bytes[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

impl<T: Read> Read for Summed<T> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let count = self.inner.read(bytes)?;
        self.sum.update(&bytes[..count]);
        Ok(count)
    }
}

/// Writes a checkpoint, which replaces the file at `path` when it is complete.
pub fn save(path: &Path, origin: &Origin, outcome: &RenderOutcome, journal: Option<&Journal>) -> Result<()> {
    files::replace(path, |part| {
        let write = || {
            let mut to = Summed::new(BufWriter::with_capacity(1 << 20, File::create(part)?));
            write(&mut to, origin, outcome, journal)?;
            let sum = to.sum.clone().finalize();
            to.write_all(&sum.to_le_bytes())?;
            to.flush()
        };
        write().map_err(|error| Error::io(part, error))
    })
}

fn write(to: &mut impl Write, origin: &Origin, outcome: &RenderOutcome, journal: Option<&Journal>) -> io::Result<()> {
    let adaptive = journal.map(|journal| Adaptive {
        notes: journal.notes.clone(),
        goals: !journal.goals.is_empty(),
        previous: journal.previous.is_some(),
    });
    let rejected = outcome.first_rejected.map(|(id, reason)| (id, reason.0.to_owned()));
    let mut origin = origin.clone();
    if let [run] = origin.runs.as_mut_slice() {
        run.samples = outcome.film.most_samples();
    }
    let (kernel, masks) = match outcome.film.kernel() {
        Kernel::Cross => (StoredKernel::Cross, &[][..]),
        Kernel::Pending => (StoredKernel::Pending, &[][..]),
        Kernel::Chosen(chosen) => (StoredKernel::Chosen { directed: chosen.is_directed() }, chosen.masks()),
    };
    let header = Header { origin, seconds: outcome.elapsed.as_secs_f64(), rejected, adaptive, kernel };
    let header = serde_json::to_vec(&header)?;
    to.write_all(&MAGIC)?;
    to.write_all(&VERSION.to_le_bytes())?;
    to.write_all(&(header.len() as u32).to_le_bytes())?;
    to.write_all(&header)?;
    masks.iter().try_for_each(|mask| to.write_all(&mask.to_le_bytes()))?;
    outcome.film.write(to)?;
    let Some(journal) = journal else { return Ok(()) };
    journal.goals.iter().try_for_each(|goal| to.write_all(&goal.to_le_bytes()))?;
    let images = journal.previous.iter().flat_map(PreviousPass::images);
    images.flat_map(|image| &image.data).try_for_each(|value| to.write_all(&value.to_le_bytes()))
}

/// Whether a file begins like a checkpoint.
pub fn is_one(path: &Path) -> bool {
    let mut magic = [0; MAGIC.len()];
    File::open(path).and_then(|mut file| file.read_exact(&mut magic)).is_ok() && magic == MAGIC
}

/// Reads a checkpoint.
pub fn load(path: &Path) -> Result<Checkpoint> {
    let open = || {
        let file = File::open(path)?;
        Ok((file.metadata()?.len(), file))
    };
    let (length, file) = open().map_err(|error: io::Error| Error::io(path, error))?;
    let mut from = Summed::new(BufReader::with_capacity(1 << 20, file));
    let checkpoint = read(&mut from, length).map_err(|error| Error::io(path, explain(error)))?;
    let sum = from.sum.clone().finalize();
    let mut stored = [0; 4];
    let ends = from.inner.read_exact(&mut stored).is_ok() && matches!(from.inner.read(&mut [0]), Ok(0));
    if !ends || u32::from_le_bytes(stored) != sum {
        return Err(Error::io(path, "is damaged: its checksum is not that of its content"));
    }
    Ok(checkpoint)
}

fn explain(error: io::Error) -> String {
    match error.kind() {
        io::ErrorKind::UnexpectedEof => "is damaged: it ends too early".into(),
        io::ErrorKind::InvalidData => format!("is damaged: {error}"),
        _ => error.to_string(),
    }
}

fn read(from: &mut impl Read, length: u64) -> io::Result<Checkpoint> {
    let mut magic = [0; MAGIC.len()];
    let invalid = |what: String| io::Error::new(io::ErrorKind::InvalidData, what);
    if from.read_exact(&mut magic).is_err() || magic != MAGIC {
        return Err(io::Error::other("is no checkpoint of `fluxion render --checkpoint`"));
    }
    let version = word(from)?;
    if version != VERSION && !BEFORE.contains(&version) {
        let what = format!(
            "is a checkpoint of format {version}; this fluxion reads formats {} to {VERSION}",
            BEFORE.iter().min().unwrap_or(&VERSION)
        );
        return Err(io::Error::other(what));
    }
    let count = word(from)?;
    if count > MAX_HEADER {
        return Err(invalid(format!("its header claims {count} bytes")));
    }
    let mut header = vec![0; count as usize];
    from.read_exact(&mut header)?;
    let header: Header = serde_json::from_slice(&header).map_err(|error| invalid(error.to_string()))?;
    let (width, height) = header.origin.size;
    let pixels = width.checked_mul(height).filter(|&pixels| pixels > 0);
    // Nothing is allocated for more pixels than the file has bytes for.
    let least = pixels.and_then(|pixels| pixels.checked_mul(header.least_bytes()));
    if least.is_none_or(|least| least as u64 > length) {
        return Err(invalid(format!("its header claims {width}x{height} pixels in {length} bytes")));
    }
    let mut film = Film::new(width, height, header.origin.needs);
    match header.kernel {
        StoredKernel::Cross => {}
        StoredKernel::Pending => film = film.pending(),
        StoredKernel::Chosen { directed } => {
            film.choose(Neighbours::new((width, height), words(from, width * height)?, directed));
        }
    }
    let film = match version {
        version if version == WITHOUT_ALPHA.0 => film.read_statistics(WITHOUT_ALPHA.1, from)?,
        _ => film.read(from)?,
    };
    let journal = match header.adaptive {
        Some(adaptive) => Some(journal(adaptive, (width, height), from)?),
        None => None,
    };
    let elapsed = Duration::try_from_secs_f64(header.seconds).map_err(|error| invalid(error.to_string()))?;
    // Reasons are for the user's eyes: one that this version would not give is still one.
    let first_rejected = header.rejected.map(|(id, reason)| (id, Rejected::named(&reason)));
    let outcome = RenderOutcome { elapsed, first_rejected, ..RenderOutcome::of(film) };
    Ok(Checkpoint { origin: header.origin, outcome, journal })
}

fn journal(adaptive: Adaptive, (width, height): (usize, usize), from: &mut impl Read) -> io::Result<Journal> {
    let goals = if adaptive.goals { words(from, width * height)? } else { Vec::new() };
    let mut previous = None;
    if adaptive.previous {
        let mut images = Vec::new();
        for channels in PreviousPass::channels() {
            let data = words(from, width * height * channels)?.into_iter().map(f32::from_bits).collect();
            images.push(Image { width, height, channels, data });
        }
        previous = PreviousPass::from_images(images);
    }
    Ok(Journal { notes: adaptive.notes, goals, previous })
}

impl Header {
    /// Fewest bytes that a pixel of the film takes.
    fn least_bytes(&self) -> usize {
        match self.kernel {
            StoredKernel::Cross => self.origin.needs.bytes_per_pixel(),
            _ => Needs { edges: EdgeNeed::Off, ..self.origin.needs }.bytes_per_pixel(),
        }
    }
}

fn words(from: &mut impl Read, count: usize) -> io::Result<Vec<u32>> {
    let mut bytes = Vec::new();
    from.by_ref().take(4 * count as u64).read_to_end(&mut bytes)?;
    if bytes.len() < 4 * count {
        return Err(io::Error::from(io::ErrorKind::UnexpectedEof));
    }
    Ok(bytes.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]])).collect())
}

fn word(from: &mut impl Read) -> io::Result<u32> {
    let mut bytes = [0; 4];
    from.read_exact(&mut bytes)?;
    Ok(u32::from_le_bytes(bytes))
}
