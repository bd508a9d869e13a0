//! A look at the headers of EXR files before a library reads them: OpenEXR makes room for as many bytes as an attribute
//! claims to have, and only then finds that the file has ended.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek};
use std::path::Path;

use crate::error::{Error, Result};

const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// Names are at most this long, by the format.
const MAX_NAME: u64 = 255;

/// Flag in the version of files of several parts, which have as many headers and an empty one after them.
const MULTIPART: u8 = 0x10;

/// Fails if the headers of an EXR file are damaged. Other files are not checked.
pub fn check(path: &Path) -> Result<()> {
    match validate(path) {
        Ok(None) => Ok(()),
        Ok(Some(what)) => Err(Error::io(path, what)),
        Err(error) => Err(Error::io(path, error)),
    }
}

/// The fault in the headers of an EXR file, if there is one.
fn validate(path: &Path) -> io::Result<Option<String>> {
    let file = File::open(path)?;
    let length = file.metadata()?.len();
    let mut from = BufReader::new(file);
    let mut magic = [0; 4];
    if from.read_exact(&mut magic).is_err() || magic != MAGIC {
        return Ok(None);
    }
    let mut version = [0; 4];
    if from.read_exact(&mut version).is_err() {
        return Ok(Some("the header does not end".into()));
    }
    let mut starts = true;
    loop {
        let Some(name) = string(&mut from)? else { return Ok(Some("a name in the header does not end".into())) };
        if name.is_empty() {
            if starts || version[1] & MULTIPART == 0 {
                return Ok(None);
            }
            starts = true;
            continue;
        }
        starts = false;
        let mut size = [0; 4];
        let kind = string(&mut from)?;
        let (Some(kind), Ok(())) = (kind, from.read_exact(&mut size)) else {
            return Ok(Some("the header does not end".into()));
        };
        let size = u64::from(u32::from_le_bytes(size));
        let named = || String::from_utf8_lossy(&name).into_owned();
        if size > length - from.stream_position()?.min(length) {
            return Ok(Some(format!("attribute `{}` of the header claims {size} bytes of {length}", named())));
        }
        // Readers take as much as the kind says, whatever the size, and would go on elsewhere.
        let mut value = vec![0; size as usize];
        from.read_exact(&mut value)?;
        if let Some(expected) = size_of_kind(&kind, &value).filter(|&expected| expected != size) {
            let expected = if expected == ENDLESS { "as many as its value takes".into() } else { expected.to_string() };
            return Ok(Some(format!("attribute `{}` of the header has {size} bytes, not {expected}", named())));
        }
    }
}

/// Size of a value that does not end within its bytes.
const ENDLESS: u64 = u64::MAX;

/// Bytes of a value, as far as they are known from its kind.
fn size_of_kind(kind: &[u8], value: &[u8]) -> Option<u64> {
    let word = |at: usize| {
        let bytes = value.get(at..at + 4).and_then(|bytes| bytes.try_into().ok());
        u64::from(bytes.map_or(0, u32::from_le_bytes))
    };
    Some(match kind {
        b"compression" | b"lineOrder" | b"envmap" | b"deepImageState" => 1,
        b"int" | b"float" => 4,
        b"v2i" | b"v2f" | b"double" | b"rational" | b"timecode" => 8,
        b"tiledesc" => 9,
        b"v3i" | b"v3f" => 12,
        b"box2i" | b"box2f" | b"v2d" => 16,
        b"v3d" => 24,
        b"keycode" => 28,
        b"chromaticities" => 32,
        b"m33f" => 36,
        b"m44f" => 64,
        b"m33d" => 72,
        b"m44d" => 128,
        b"preview" => 8 + 4 * word(0) * word(4),
        b"chlist" => {
            // Names, each with sixteen bytes, and an empty one.
            let mut at = 0;
            loop {
                let name = value.get(at..)?.iter().position(|&byte| byte == 0);
                match name {
                    None => return Some(ENDLESS),
                    Some(0) => return Some(at as u64 + 1),
                    Some(length) => at += length + 1 + 16,
                }
                if at > value.len() {
                    return Some(ENDLESS);
                }
            }
        }
        _ => return None,
    })
}

/// A name without the zero that ends it; none when it does not end in time.
fn string(from: &mut impl BufRead) -> io::Result<Option<Vec<u8>>> {
    let mut name = Vec::new();
    from.take(MAX_NAME + 1).read_until(0, &mut name)?;
    Ok((name.pop() == Some(0)).then_some(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attributes_longer_than_the_file_are_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let found = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            validate(&path).unwrap()
        };
        let of = |kind: &[u8], size: u8, value: &[u8]| {
            [&MAGIC[..], &[2, 0, 0, 0], b"a\0", kind, &[0, size, 0, 0, 0], value, &[0]].concat()
        };
        let header = |size: u8| of(b"int", size, &[1, 2, 3, 4]);
        assert!(found(&of(b"box2i", 3, &[0; 3])).unwrap().contains("has 3 bytes, not 16"));
        let channel = [&b"R\0"[..], &[0; 16], &[0]].concat();
        assert_eq!(found(&of(b"chlist", 19, &channel)), None);
        assert!(found(&of(b"chlist", 20, &[&channel[..], &[7]].concat())).unwrap().contains("has 20 bytes, not 19"));
        assert!(found(&of(b"chlist", 10, &channel[..10])).unwrap().contains("has 10 bytes"));
        assert_eq!(found(&header(4)), None);
        assert!(found(&header(200)).unwrap().contains("`a` of the header claims 200 bytes"));
        let two = |size: u8| {
            let second = &header(size)[8..];
            [&MAGIC[..], &[2, 0x10, 0, 0], &header(4)[8..], second, &[0]].concat()
        };
        assert_eq!(found(&two(4)), None);
        assert!(found(&two(200)).unwrap().contains("claims 200 bytes"));
        assert_eq!(found(b"\x89PNG and so on"), None);
        assert!(found(&header(4)[..16]).unwrap().contains("does not end"));
    }
}
