//! A look at the headers of EXR files before OpenEXR reads them: it makes room for as many bytes as an attribute claims
//! to have, and only then finds that the file has ended.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek};
use std::path::Path;

const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// Names are at most this long, by the format.
const MAX_NAME: u64 = 255;

/// Checks the first header of an EXR file; returns the fault, if there is one. Other files are not checked.
pub fn validate(path: &Path) -> io::Result<Option<String>> {
    let file = File::open(path)?;
    let length = file.metadata()?.len();
    let mut from = BufReader::new(file);
    let mut magic = [0; 4];
    if from.read_exact(&mut magic).is_err() || magic != MAGIC {
        return Ok(None);
    }
    from.seek_relative(4)?;
    loop {
        let Some(name) = string(&mut from)? else { return Ok(Some("a name in the header does not end".into())) };
        if name.is_empty() {
            return Ok(None);
        }
        let mut size = [0; 4];
        if string(&mut from)?.is_none() || from.read_exact(&mut size).is_err() {
            return Ok(Some("the header does not end".into()));
        }
        let size = u64::from(u32::from_le_bytes(size));
        if size > length - from.stream_position()?.min(length) {
            let name = String::from_utf8_lossy(&name).into_owned();
            return Ok(Some(format!("attribute `{name}` of the header claims {size} bytes of {length}")));
        }
        from.seek_relative(size as i64)?;
    }
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
        let header = |size: u8| [&MAGIC[..], &[2, 0, 0, 0], b"a\0int\0", &[size, 0, 0, 0], &[1, 2, 3, 4, 0]].concat();
        assert_eq!(found(&header(4)), None);
        assert!(found(&header(200)).unwrap().contains("`a` of the header claims 200 bytes"));
        assert_eq!(found(b"\x89PNG and so on"), None);
        assert!(found(&header(4)[..16]).unwrap().contains("does not end"));
    }
}
