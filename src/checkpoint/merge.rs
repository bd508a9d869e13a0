//! Films of different samples added up, tile by tile, so that any number of them takes the memory of a few tiles.
//!
//! Sums in single precision depend on their order. Films are sorted by their samples and added as a binary tree over the runs that
//! they hold: two neighbours of the same number of runs are one of twice as many. Groups of a power of two that are merged first give
//! the bits of all in one go.

use std::path::{Path, PathBuf};

use super::Origin;
use super::header::{self, Header, Reader};
use crate::error::{Error, Result};
use crate::film::{Film, Frame, Kernel, Tile};
use crate::render::RenderOutcome;

/// Films that are open at the same time; a power of two.
const GROUP: usize = 256;

/// Bytes of each that are read at a time.
const BUFFER: usize = 1 << 16;

/// The result of a merge.
#[derive(Clone, Debug)]
pub struct Merged {
    /// Scene, settings and samples of all.
    pub origin: Origin,
    /// Samples of all pixels.
    pub samples: u64,
}

/// Adds up checkpoints into another one.
pub fn merge(paths: &[PathBuf], output: &Path) -> Result<Merged> {
    let Some(sources) = Sources::open(paths)? else {
        return in_groups(paths, output, |parts| merge(parts, output));
    };
    let (header, kernel) = (sources.header(), sources.kernel());
    let mut samples = 0;
    header::write(output, (&header, &kernel), |to| {
        let mut bytes = Vec::new();
        sources.add_up(|tile| {
            samples += tile.samples();
            bytes.clear();
            tile.write(&mut bytes);
            std::io::Write::write_all(to, &bytes).map_err(|error| Error::io(output, error))
        })
    })?;
    Ok(Merged { origin: header.origin, samples })
}

/// Adds up checkpoints into means and variances; `beside` names a folder for temporary files.
pub fn develop(paths: &[PathBuf], beside: &Path) -> Result<(Frame, Merged)> {
    let Some(sources) = Sources::open(paths)? else {
        return in_groups(paths, beside, |parts| develop(parts, beside));
    };
    let (Header { origin, .. }, kernel) = (sources.header(), sources.kernel());
    let mut tiles = Vec::new();
    sources.add_up(|tile| {
        tiles.push(tile);
        Ok(())
    })?;
    let outcome = RenderOutcome::of(Film::of_tiles(origin.size, (origin.needs, &origin.lights), kernel, tiles));
    let frame = outcome.film.develop().with_provenance(origin.provenance(&outcome));
    Ok((frame, Merged { origin, samples: outcome.film.samples() }))
}

/// Merges groups into temporary files beside `output` first, for more films than can be open.
fn in_groups<T>(paths: &[PathBuf], output: &Path, merge_parts: impl FnOnce(&[PathBuf]) -> Result<T>) -> Result<T> {
    let failed = |error| Error::io(output, error);
    let folder = output.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let parts = tempfile::Builder::new().prefix(".merge.").tempdir_in(folder).map_err(failed)?;
    let mut sorted = Vec::new();
    for path in paths {
        sorted.push((Reader::open(path, BUFFER)?.header.origin.runs, path.clone()));
    }
    sorted.sort();
    let mut merged = Vec::new();
    for (k, group) in sorted.chunks(GROUP).enumerate() {
        let (part, group) = (parts.path().join(format!("{k}.ckpt")), group.iter().map(|(_, path)| path.clone()));
        merge(&group.collect::<Vec<_>>(), &part)?;
        merged.push(part);
    }
    merge_parts(&merged)
}

/// Films that belong together, in the order of their samples.
struct Sources(Vec<Reader>);

impl Sources {
    /// Opens films and checks that they can be added; none if there are too many. The error names the one that does not belong.
    fn open(paths: &[PathBuf]) -> Result<Option<Self>> {
        if paths.len() > GROUP {
            return Ok(None);
        }
        let mut sources = paths.iter().map(|path| Reader::open(path, BUFFER)).collect::<Result<Vec<_>>>()?;
        sources.sort_by(|a, b| a.header.origin.runs.cmp(&b.header.origin.runs));
        let Some(first) = sources.first() else { return Err(Error::Usage("there is no film to merge".into())) };
        let mut all = first.header.origin.clone();
        for other in &sources[1..] {
            let refused = |why: String| {
                Error::mismatch(other.path(), format!("cannot be added to {}: it {why}", first.path().display()))
            };
            all.adds_to(&other.header.origin).map_err(refused)?;
            if first.kernel != other.kernel {
                let why = "has chosen other neighbours by its own pilot: films that are to be merged take a --kernel without one";
                return Err(refused(why.into()));
            }
            all.runs.extend(other.header.origin.runs.iter().cloned());
        }
        Ok(Some(Self(sources)))
    }

    fn kernel(&self) -> Kernel {
        self.0[0].kernel.clone()
    }

    /// The header of the sum. Decisions of adaptive runs were made for each of them alone.
    fn header(&self) -> Header {
        let mut origin = self.0[0].header.origin.clone();
        origin.runs = self.0.iter().flat_map(|source| source.header.origin.runs.clone()).collect();
        let seconds = self.0.iter().map(|source| source.header.seconds).sum();
        let rejected = self.0.iter().find_map(|source| source.header.rejected());
        Header::new(origin, seconds, rejected, &self.0[0].kernel, None)
    }

    /// Hands the tiles of the sum on, one by one. The error names the film that is damaged, after which the sum is worth nothing.
    fn add_up(mut self, mut take: impl FnMut(Tile) -> Result<()>) -> Result<()> {
        let (first, kernel) = (self.0[0].header.origin.clone(), self.kernel());
        for empty in Tile::all(first.size, first.needs, &kernel) {
            let mut sums: Vec<(usize, Tile)> = Vec::new();
            for source in &mut self.0 {
                let mut tile = empty.clone();
                source.tile(&mut tile)?;
                sums.push((source.header.origin.runs.len(), tile));
                while let [.., (before, _), (after, _)] = sums.as_slice() {
                    if before != after {
                        break;
                    }
                    add_last(&mut sums);
                }
            }
            while sums.len() > 1 {
                add_last(&mut sums);
            }
            sums.pop().map_or(Ok(()), |(_, tile)| take(tile))?;
        }
        self.0.into_iter().try_for_each(Reader::finish)
    }
}

/// Adds the last of some sums to the one before.
fn add_last(sums: &mut Vec<(usize, Tile)>) {
    if let (Some((count, tile)), Some((runs, sum))) = (sums.pop(), sums.last_mut()) {
        *runs += count;
        sum.merge(&tile);
    }
}
