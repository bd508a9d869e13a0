//! Portable float maps.

use std::fs;
use std::path::Path;

use super::{Format, Samples};
use crate::error::{Error, Result};
use crate::pixels::{Header, Storage};

/// A portable float map: where its samples start, and how they are stored.
struct Map {
    start: usize,
    little_endian: bool,
    /// Samples in a row, of which the last comes first.
    row: usize,
}

/// The header of a file, if it is a portable float map.
pub fn open(path: &Path) -> Result<Option<(Header, Box<dyn Format>)>> {
    use std::io::Read;
    let mut start = Vec::new();
    let file = fs::File::open(path).map_err(|error| Error::io(path, error))?;
    file.take(256).read_to_end(&mut start).map_err(|error| Error::io(path, error))?;
    let channels: &[&str] = match start.get(..2) {
        Some(b"PF") => &["R", "G", "B"],
        Some(b"Pf") => &["Y"],
        _ => return Ok(None),
    };
    let bad = || Error::io(path, "the header of the portable float map is damaged");
    // Three words after the magic one, and a single byte of white space.
    let (mut at, mut words) = (2, Vec::new());
    while words.len() < 3 {
        let rest = &start[at..];
        let from = rest.iter().position(|byte| !byte.is_ascii_whitespace()).ok_or_else(bad)?;
        let length = rest[from..].iter().position(u8::is_ascii_whitespace).ok_or_else(bad)?;
        words.push(String::from_utf8_lossy(&rest[from..from + length]).into_owned());
        at += from + length;
    }
    let number = |word: &String| word.parse::<usize>().map_err(|_| bad());
    let (width, height) = (number(&words[0])?, number(&words[1])?);
    let scale: f32 = words[2].parse().map_err(|_| bad())?;
    let row = width.saturating_mul(channels.len());
    let map = Map { start: at + 1, little_endian: scale < 0.0, row };
    let storage = vec![Storage::Float; channels.len()];
    let channels = channels.iter().map(|&name| name.to_owned()).collect();
    let header = Header { width, height, channels, storage, format: "pfm".into(), ..Header::default() };
    Ok(Some((header, Box::new(map))))
}

impl Format for Map {
    fn samples(&self, path: &Path) -> Result<Samples> {
        let bytes = fs::read(path).map_err(|error| Error::io(path, error))?;
        let words = bytes.get(self.start..).unwrap_or_default().chunks_exact(4);
        let order = if self.little_endian { f32::from_le_bytes } else { f32::from_be_bytes };
        let values: Vec<f32> = words.map(|word| order([word[0], word[1], word[2], word[3]])).collect();
        Ok(Samples::Floats(values.chunks_exact(self.row.max(1)).rev().flatten().copied().collect()))
    }
}
