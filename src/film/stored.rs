//! Films as bytes, tile after tile: counts, then the planes of the table of statistics. Every list is preceded by its
//! length; all words are little-endian.

use std::io::{self, Read, Write};

use super::statistics::STATISTICS;
use super::{Film, Tile};

/// Appends a list of words with its length.
fn put(bytes: &mut Vec<u8>, words: impl ExactSizeIterator<Item = u32>) {
    bytes.extend((words.len() as u32).to_le_bytes());
    bytes.reserve(4 * words.len());
    words.for_each(|word| bytes.extend(word.to_le_bytes()));
}

/// Reads a list of words that has one of the lengths allowed.
fn take(from: &mut impl Read, allowed: [usize; 2]) -> io::Result<Vec<u32>> {
    let mut length = [0; 4];
    from.read_exact(&mut length)?;
    let length = u32::from_le_bytes(length) as usize;
    if !allowed.contains(&length) {
        return Err(io::Error::new(io::ErrorKind::InvalidData, format!("a tile has {length} values of a kind")));
    }
    let mut bytes = vec![0; 4 * length];
    from.read_exact(&mut bytes)?;
    Ok(bytes.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]])).collect())
}

impl Tile {
    /// Appends everything that was recorded, without loss.
    pub fn write(&self, bytes: &mut Vec<u8>) {
        for counts in [&self.counts, &self.edge_counts, &self.rejected] {
            put(bytes, counts.iter().copied());
        }
        for plane in &self.planes {
            put(bytes, plane.iter().map(|value| value.to_bits()));
        }
    }

    /// Fills an empty tile by one of a checkpoint file of a version, which lacks the statistics that are newer.
    pub fn read(&mut self, version: u32, from: &mut impl Read) -> io::Result<()> {
        let pixels = self.counts.len();
        self.counts = take(from, [pixels; 2])?;
        self.edge_counts = take(from, [self.edge_counts.len(); 2])?;
        self.rejected = take(from, [0, pixels])?;
        for (k, statistic) in STATISTICS.iter().enumerate().take_while(|(_, statistic)| statistic.since <= version) {
            let allowed =
                if statistic.sparse.is_some() { [0, self.floats(statistic)] } else { [self.planes[k].len(); 2] };
            self.planes[k] = take(from, allowed)?.into_iter().map(f32::from_bits).collect();
        }
        Ok(())
    }
}

impl Film {
    /// Writes everything that was recorded, without loss.
    pub fn write(&self, to: &mut impl Write) -> io::Result<()> {
        let mut bytes = Vec::new();
        self.tiles.iter().try_for_each(|tile| {
            bytes.clear();
            tile.write(&mut bytes);
            to.write_all(&bytes)
        })
    }
}
