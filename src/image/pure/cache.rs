//! The cache of textures beyond memory that these libraries have not: textures are held in memory whole.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::error::Result;

/// A cache of image files that are too large to be held at once: there is none.
pub enum TextureSystem {}

impl TextureSystem {
    /// None, whatever its size.
    pub fn new(_megabytes: u32) -> Option<Arc<Self>> {
        None
    }
}

/// A file in a texture system.
pub struct CachedTexture(Arc<TextureSystem>);

impl CachedTexture {
    /// Opens a file.
    pub fn open(system: &Arc<TextureSystem>, _path: &Path) -> Result<Self> {
        Ok(Self(Arc::clone(system)))
    }

    /// The first samples of a pixel by its place in the file.
    pub fn texel(&self, _x: i32, _y: i32, _samples: &mut [f32]) {
        match *self.0 {}
    }
}

/// Lookups that found no texel: none, since all texels are in memory.
pub fn failed_lookups() -> Option<(PathBuf, u64)> {
    None
}
