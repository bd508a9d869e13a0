//! Films as bytes: every tile's statistics as they are, little-endian, tile after tile.

use std::io::{self, Read, Write};

use super::sample::Moments;
use super::{BINS, Bin, Film, Needs, Tile};
use crate::math::Rgb;

/// Something made of words of four bytes.
trait Stored: Copy + Default {
    /// Number of words.
    const WORDS: usize;

    fn put(&self, words: &mut impl FnMut(u32));

    fn take(words: &mut impl FnMut() -> u32) -> Self;
}

impl Stored for u32 {
    const WORDS: usize = 1;

    fn put(&self, words: &mut impl FnMut(u32)) {
        words(*self);
    }

    fn take(words: &mut impl FnMut() -> u32) -> Self {
        words()
    }
}

impl<const N: usize> Stored for Moments<N> {
    const WORDS: usize = 2 * N;

    fn put(&self, words: &mut impl FnMut(u32)) {
        self.mean.iter().chain(&self.deviation).for_each(|value| words(value.to_bits()));
    }

    fn take(words: &mut impl FnMut() -> u32) -> Self {
        let mut list = || std::array::from_fn(|_| f32::from_bits(words()));
        Self { mean: list(), deviation: list() }
    }
}

impl Stored for [Bin; BINS] {
    const WORDS: usize = 15 * BINS;

    fn put(&self, words: &mut impl FnMut(u32)) {
        let colors = self.iter().flat_map(|bin| std::iter::once(bin.color).chain(bin.edges));
        colors.flat_map(|color| color.to_array()).for_each(|value| words(value.to_bits()));
    }

    fn take(words: &mut impl FnMut() -> u32) -> Self {
        let mut color = || Rgb::from_array(std::array::from_fn(|_| f32::from_bits(words())));
        std::array::from_fn(|_| Bin { color: color(), edges: std::array::from_fn(|_| color()) })
    }
}

/// Appends a list with its length.
fn put<T: Stored>(bytes: &mut Vec<u8>, list: &[T]) {
    bytes.extend((list.len() as u32).to_le_bytes());
    bytes.reserve(4 * T::WORDS * list.len());
    list.iter().for_each(|item| item.put(&mut |word| bytes.extend(word.to_le_bytes())));
}

/// Reads a list that has one of the lengths allowed.
fn take<T: Stored>(from: &mut impl Read, allowed: [usize; 2]) -> io::Result<Vec<T>> {
    let mut length = [0; 4];
    from.read_exact(&mut length)?;
    let length = u32::from_le_bytes(length) as usize;
    if !allowed.contains(&length) {
        return Err(io::Error::new(io::ErrorKind::InvalidData, format!("a tile has {length} entries of a kind")));
    }
    let mut bytes = vec![0; 4 * T::WORDS * length];
    from.read_exact(&mut bytes)?;
    let mut words = bytes.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]));
    Ok((0..length).map(|_| T::take(&mut || words.next().unwrap_or_default())).collect())
}

impl Tile {
    fn write(&self, bytes: &mut Vec<u8>) {
        put(bytes, &self.counts);
        put(bytes, &self.rejected);
        put(bytes, &self.color);
        put(bytes, &self.direct);
        put(bytes, &self.features);
        put(bytes, &self.places);
        put(bytes, &self.edges);
        put(bytes, &self.bins);
        put(bytes, &self.ambient);
    }

    /// Fills an empty tile.
    fn read(&mut self, from: &mut impl Read) -> io::Result<()> {
        let pixels = self.counts.len();
        self.counts = take(from, [pixels; 2])?;
        self.rejected = take(from, [0, pixels])?;
        self.color = take(from, [pixels; 2])?;
        self.direct = take(from, [0, pixels])?;
        self.features = take(from, [self.features.len(); 2])?;
        self.places = take(from, [self.places.len(); 2])?;
        self.edges = take(from, [self.edges.len(); 2])?;
        self.bins = take(from, [self.bins.len(); 2])?;
        self.ambient = take(from, [self.ambient.len(); 2])?;
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

    /// Reads a film of a size and with the needs it was written with.
    pub fn read((width, height): (usize, usize), needs: Needs, from: &mut impl Read) -> io::Result<Self> {
        let mut film = Self::new(width, height, needs);
        film.tiles.iter_mut().try_for_each(|tile| tile.read(from))?;
        Ok(film)
    }
}
