//! Arrays as NumPy's `.npy` files, version 1.0 of the format.

use std::path::Path;

use half::f16;
use half::slice::HalfFloatSliceExt;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::files;

/// Type of the numbers in a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Number {
    /// 32 bits.
    #[default]
    Float32,
    /// 16 bits; larger numbers become the largest there is, 65504.
    Float16,
}

impl Number {
    /// The name of the type in headers.
    pub fn descriptor(self) -> &'static str {
        match self {
            Self::Float32 => "<f4",
            Self::Float16 => "<f2",
        }
    }
}

/// The largest half-precision number.
const LARGEST: f32 = 65504.0;

/// Writes an array in the order of its last index, whole or not at all.
pub fn write(path: &Path, shape: &[usize], data: &[f32], number: Number) -> Result<()> {
    assert_eq!(shape.iter().product::<usize>(), data.len(), "as many numbers as the shape says");
    let body = match number {
        Number::Float32 => data.iter().flat_map(|value| value.to_le_bytes()).collect(),
        Number::Float16 => halves(data),
    };
    files::write(path, [header(shape, number), body].concat())
}

/// Everything before the numbers of an array.
pub fn header(shape: &[usize], number: Number) -> Vec<u8> {
    let shape: String = shape.iter().map(|length| format!("{length}, ")).collect();
    let mut header = format!("{{'descr': '{}', 'fortran_order': False, 'shape': ({shape}), }}", number.descriptor());
    // Magic bytes, version and length are ten bytes; the data begin at a multiple of 64.
    let padding = (header.len() + 11).next_multiple_of(64) - header.len() - 11;
    header.extend(std::iter::repeat_n(' ', padding).chain(['\n']));
    let length = (header.len() as u16).to_le_bytes();
    [b"\x93NUMPY\x01\x00", length.as_slice(), header.as_bytes()].concat()
}

fn halves(data: &[f32]) -> Vec<u8> {
    let clamped: Vec<f32> = data.iter().map(|value| value.clamp(-LARGEST, LARGEST)).collect();
    let mut halves = vec![f16::ZERO; data.len()];
    halves.convert_from_f32_slice(&clamped);
    halves.iter().flat_map(|half| half.to_le_bytes()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_have_the_bytes_that_numpy_writes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npy");
        write(&path, &[1, 2, 2], &[1.0, -2.5, 1e9, 0.0], Number::Float16).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let header = "{'descr': '<f2', 'fortran_order': False, 'shape': (1, 2, 2, ), }";
        assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
        assert!(bytes[10..].starts_with(header.as_bytes()));
        let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        assert_eq!((start % 64, bytes[start - 1]), (0, b'\n'));
        assert_eq!(&bytes[start..], [0, 0x3c, 0, 0xc1, 0xff, 0x7b, 0, 0]);
        write(&path, &[3], &[1.0, -2.5, 1e9], Number::Float32).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        assert_eq!(&bytes[bytes.len() - 4..], 1e9f32.to_le_bytes());
    }
}
