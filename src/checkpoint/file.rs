//! Checkpoints as files, written and read as a whole.

use std::io::{self, Write};
use std::path::Path;
use std::time::Duration;

use super::header::{self, Adaptive, Header, Reader};
use super::{Checkpoint, Origin};
use crate::adaptive::{Journal, PreviousPass};
use crate::error::{Error, Result};
use crate::film::{Film, Tile};
use crate::image::Image;
use crate::render::RenderOutcome;

/// Bytes that are read at a time.
const BUFFER: usize = 1 << 20;

/// Writes a checkpoint, which replaces the file at `path` when it is complete.
pub fn save(path: &Path, origin: &Origin, outcome: &RenderOutcome, journal: Option<&Journal>) -> Result<()> {
    let adaptive = journal.map(|journal| Adaptive {
        notes: journal.notes.clone(),
        goals: !journal.goals.is_empty(),
        previous: journal.previous.is_some(),
    });
    let mut origin = origin.clone();
    if let [run] = origin.runs.as_mut_slice() {
        run.samples = outcome.film.most_samples();
    }
    let (seconds, kernel) = (outcome.elapsed.as_secs_f64(), outcome.film.kernel());
    let header = Header::new(origin, seconds, outcome.first_rejected, kernel, adaptive);
    header::write(path, (&header, kernel), |to| {
        let mut write = || {
            outcome.film.write(to)?;
            let Some(journal) = journal else { return Ok(()) };
            journal.goals.iter().try_for_each(|goal| to.write_all(&goal.to_le_bytes()))?;
            let images = journal.previous.iter().flat_map(PreviousPass::images);
            images.flat_map(|image| &image.data).try_for_each(|value| to.write_all(&value.to_le_bytes()))
        };
        write().map_err(|error: io::Error| Error::io(path, error))
    })
}

/// Reads a checkpoint.
pub fn load(path: &Path) -> Result<Checkpoint> {
    let mut from = Reader::open(path, BUFFER)?;
    let ((width, height), needs) = (from.header.origin.size, from.header.origin.needs);
    let (mut tiles, kernel) = (Vec::new(), from.kernel.clone());
    for mut tile in Tile::all((width, height), needs, &kernel) {
        from.tile(&mut tile)?;
        tiles.push(tile);
    }
    let film = Film::of_tiles((width, height), (needs, &from.header.origin.lights), kernel, tiles);
    let adaptive = from.header.adaptive.take();
    let journal = adaptive.map(|adaptive| journal(adaptive, (width, height), &mut from)).transpose()?;
    let elapsed = Duration::try_from_secs_f64(from.header.seconds)
        .map_err(|error| Error::io(path, format!("is damaged: {error}")))?;
    let outcome = RenderOutcome { elapsed, first_rejected: from.header.rejected(), ..RenderOutcome::of(film) };
    let origin = from.header.origin.clone();
    from.finish()?;
    Ok(Checkpoint { origin, outcome, journal })
}

fn journal(adaptive: Adaptive, (width, height): (usize, usize), from: &mut Reader) -> Result<Journal> {
    let goals = if adaptive.goals { from.words(width * height)? } else { Vec::new() };
    let mut previous = None;
    if adaptive.previous {
        let mut images = Vec::new();
        for channels in PreviousPass::channels() {
            let data = from.words(width * height * channels)?.into_iter().map(f32::from_bits).collect();
            images.push(Image { width, height, channels, data });
        }
        previous = PreviousPass::from_images(images);
    }
    Ok(Journal { notes: adaptive.notes, goals, previous })
}
