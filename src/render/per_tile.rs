//! Findings about the tiles of a film, each made once, when it is first needed.

use std::sync::OnceLock;

/// A finding about every tile.
pub struct PerTile<T>(Vec<OnceLock<T>>);

impl<T> PerTile<T> {
    /// Findings about a number of tiles, none of them made.
    pub fn new(tiles: usize) -> Self {
        Self((0..tiles).map(|_| OnceLock::new()).collect())
    }

    /// The finding about one tile; `find` makes it.
    pub fn get(&self, tile: usize, find: impl FnOnce() -> T) -> &T {
        self.0[tile].get_or_init(find)
    }
}
