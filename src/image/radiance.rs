//! Radiance files of the kinds that libraries leave out: in X, Y and Z, or with their rows in another order than from the top
//! left (Ward, "Radiance file formats", 2008).

use std::ops::Deref;
use std::path::Path;

use crate::error::{Error, Result};
use crate::pixels::{Header, OpenImage, Storage};

/// Format of samples in X, Y and Z with a common exponent.
const XYZE: &str = "32-bit_rle_xyze";
/// Longest header that is looked at.
const MAX_HEADER: usize = 1 << 16;
/// Lengths of rows that may be compressed channel by channel.
const COMPRESSED: std::ops::RangeInclusive<usize> = 8..=0x7fff;

/// A file of which the header has been read.
pub struct Radiance {
    header: Header,
    path: std::path::PathBuf,
    pixels: Vec<u8>,
    order: Order,
}

/// Axes as the resolution line names them: of the rows in the file, and along them.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Order {
    /// Whether rows of the file are columns of the picture.
    by_column: bool,
    /// Whether columns are counted from the right.
    from_right: bool,
    /// Whether rows are counted from the bottom.
    from_bottom: bool,
}

impl Order {
    const USUAL: Self = Self { by_column: false, from_right: false, from_bottom: false };
}

impl Radiance {
    /// Reads the header; none of other files, and of those that every library reads.
    pub fn open(path: &Path) -> Result<Option<Self>> {
        use std::io::Read;
        let mut start = [0; 2];
        let mut file = std::fs::File::open(path).map_err(|error| Error::io(path, error))?;
        if file.read_exact(&mut start).is_err() || start != *b"#?" {
            return Ok(None);
        }
        let bytes = std::fs::read(path).map_err(|error| Error::io(path, error))?;
        let Some((format, resolution, end)) = header(&bytes) else { return Ok(None) };
        let (order, width, height) = match parse(resolution) {
            Some(found) => found,
            None => {
                let what = format!("`{resolution}` is no order and number of rows, as in -Y 480 +X 640");
                return Err(Error::io(path, what));
            }
        };
        if order == Order::USUAL && format != XYZE {
            return Ok(None);
        }
        let names = if format == XYZE { ["X", "Y", "Z"] } else { ["R", "G", "B"] };
        let header = Header {
            width,
            height,
            channels: names.map(String::from).to_vec(),
            storage: vec![Storage::Float; 3],
            format: "hdr".into(),
            ..Header::default()
        };
        header.check(path, bytes.len())?;
        Ok(Some(Self { header, path: path.to_owned(), pixels: bytes[end..].to_vec(), order }))
    }
}

/// The format, the resolution line and where the pixels start. None where the header does not end.
fn header(bytes: &[u8]) -> Option<(&str, &str, usize)> {
    let text = &bytes[..bytes.len().min(MAX_HEADER)];
    let mut at = 0;
    let mut line = || {
        let length = text[at..].iter().position(|&byte| byte == b'\n')?;
        let line = std::str::from_utf8(&text[at..at + length]).ok()?.trim_end();
        at += length + 1;
        Some((line, at))
    };
    let mut format = "";
    loop {
        match line()?.0 {
            "" => break,
            other => format = other.strip_prefix("FORMAT=").map_or(format, str::trim),
        }
    }
    let (resolution, end) = line()?;
    Some((format, resolution, end))
}

/// The order of rows, width and height from a line as `-Y 480 +X 640`.
fn parse(line: &str) -> Option<(Order, usize, usize)> {
    let words: Vec<&str> = line.split_ascii_whitespace().collect();
    let [first, rows, second, columns] = *words.as_slice() else { return None };
    let (rows, columns) = (rows.parse().ok()?, columns.parse().ok()?);
    let (order, width, height) = match (first, second) {
        ("-Y" | "+Y", "-X" | "+X") => ((second, first, false), columns, rows),
        ("-X" | "+X", "-Y" | "+Y") => ((first, second, true), rows, columns),
        _ => return None,
    };
    let (x, y, by_column) = order;
    Some((Order { by_column, from_right: x == "-X", from_bottom: y == "+Y" }, width, height))
}

/// Rows of four bytes a pixel, uncompressed.
struct Rows<'a> {
    bytes: &'a [u8],
}

impl Rows<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (taken, rest) = self.bytes.split_first_chunk()?;
        self.bytes = rest;
        Some(*taken)
    }

    /// The next row of so many pixels; none where the file ends.
    fn next(&mut self, length: usize) -> Option<Vec<[u8; 4]>> {
        let mut row = vec![[0; 4]; length];
        let is_compressed = COMPRESSED.contains(&length)
            && matches!(self.bytes, &[2, 2, high, low, ..] if usize::from(high) << 8 | usize::from(low) == length);
        if !is_compressed {
            self.plain(&mut row)?;
            return Some(row);
        }
        self.take::<4>()?;
        for channel in 0..4 {
            let mut at = 0;
            while at < length {
                let [count] = self.take()?;
                let (count, run) = match count {
                    0..=128 => (usize::from(count), None),
                    _ => (usize::from(count - 128), Some(self.take::<1>()?[0])),
                };
                for pixel in row.get_mut(at..at + count)? {
                    pixel[channel] = match run {
                        Some(value) => value,
                        None => self.take::<1>()?[0],
                    };
                }
                at += count.max(1);
            }
        }
        Some(row)
    }

    /// Pixels one after the other; 1, 1, 1 and a number repeats the last one so many times.
    fn plain(&mut self, row: &mut [[u8; 4]]) -> Option<()> {
        let (mut at, mut shift) = (0, 0);
        while at < row.len() {
            let pixel: [u8; 4] = self.take()?;
            if pixel[..3] == [1, 1, 1] && at > 0 && shift < 32 {
                let count = usize::from(pixel[3]) << shift;
                let last = row[at - 1];
                row.get_mut(at..at.checked_add(count)?)?.fill(last);
                (at, shift) = (at + count, shift + 8);
            } else {
                row[at] = pixel;
                (at, shift) = (at + 1, 0);
            }
        }
        Some(())
    }
}

impl Deref for Radiance {
    type Target = Header;

    fn deref(&self) -> &Header {
        &self.header
    }
}

impl OpenImage for Radiance {
    fn attribute(&self, _name: &str) -> Option<String> {
        None
    }

    fn floats(&self) -> Result<Vec<f32>> {
        let (width, height, order) = (self.width, self.height, self.order);
        let (rows, length) = if order.by_column { (width, height) } else { (height, width) };
        let mut data = vec![0.0; 3 * width * height];
        let mut file = Rows { bytes: &self.pixels };
        for slow in 0..rows {
            let row = file.next(length);
            let row = row.ok_or_else(|| Error::io(&self.path, "the pixels end too early, or are damaged"))?;
            for (fast, [r, g, b, exponent]) in row.into_iter().enumerate() {
                let (x, y) = if order.by_column { (slow, fast) } else { (fast, slow) };
                let x = if order.from_right { width - 1 - x } else { x };
                let y = if order.from_bottom { height - 1 - y } else { y };
                let scale = if exponent == 0 { 0.0 } else { (f32::from(exponent) - 136.0).exp2() };
                let at = 3 * (y * width + x);
                data[at..at + 3].copy_from_slice(&[r, g, b].map(|value| f32::from(value) * scale));
            }
        }
        Ok(data)
    }

    fn bytes(&self) -> Result<Vec<u8>> {
        Ok(self.floats()?.into_iter().map(|value| (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file of 2x3 pixels that are numbered row by row from the top left, in some order.
    fn file(resolution: &str, numbers: [u8; 6]) -> Vec<u8> {
        let mut bytes = format!("#?RADIANCE\n# c\nFORMAT=32-bit_rle_rgbe\n\n{resolution}\n").into_bytes();
        numbers.iter().for_each(|&n| bytes.extend([n, 0, 0, 136]));
        bytes
    }

    fn read(bytes: &[u8]) -> Result<Option<Vec<f32>>> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.hdr");
        std::fs::write(&path, bytes).unwrap();
        Radiance::open(&path)?.map(|file| file.floats()).transpose()
    }

    #[test]
    fn rows_of_every_order_are_read() {
        for (resolution, numbers) in [
            ("-Y 3 -X 2", [2, 1, 4, 3, 6, 5]),
            ("+Y 3 +X 2", [5, 6, 3, 4, 1, 2]),
            ("+Y 3 -X 2", [6, 5, 4, 3, 2, 1]),
            ("+X 2 -Y 3", [1, 3, 5, 2, 4, 6]),
            ("+X 2 +Y 3", [5, 3, 1, 6, 4, 2]),
            ("-X 2 -Y 3", [2, 4, 6, 1, 3, 5]),
            ("-X 2 +Y 3", [6, 4, 2, 5, 3, 1]),
        ] {
            let red: Vec<f32> = read(&file(resolution, numbers)).unwrap().unwrap().into_iter().step_by(3).collect();
            assert_eq!(red, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], "{resolution}");
        }
        assert!(read(&file("-Y 3 +X 2", [0; 6])).unwrap().is_none(), "left to the library");
    }

    #[test]
    fn compressed_rows_are_read_and_damaged_ones_are_errors() {
        let start = b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 8\n".to_vec();
        let row = [&[2, 2, 0, 8, 136, 10][..], &[8, 1, 2, 3, 4, 5, 6, 7, 8], &[136, 3], &[136, 136]].concat();
        let found = read(&[&start[..], &row].concat()).unwrap().unwrap();
        assert_eq!((found[0], found[1], found[2], found[22]), (10.0, 1.0, 3.0, 8.0));
        for length in 0..row.len() {
            assert!(read(&[&start[..], &row[..length]].concat()).is_err(), "{length}");
        }
        // A run beyond the row.
        assert!(read(&[&start[..], &[2, 2, 0, 8, 137, 10, 0, 0]].concat()).is_err());
        let old = [&start[..], &[9, 8, 7, 136, 1, 1, 1, 7]].concat();
        assert_eq!(read(&old).unwrap().unwrap()[21..], [9.0, 8.0, 7.0]);
        assert!(read(b"#?RGBE\nFORMAT=32-bit_rle_xyze\n\nnonsense\n").unwrap_err().to_string().contains("`nonsense`"));
    }
}
