//! Weights of networks, as safetensors files: the length of a JSON header, the header, raw numbers.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::convolution::{Activation, Convolution};
use super::tensor::Tensor;

/// Named arrays.
#[derive(Debug, Default)]
pub struct Weights(BTreeMap<String, Array>);

#[derive(Debug)]
struct Array {
    shape: Vec<usize>,
    values: Vec<f32>,
}

#[derive(Deserialize)]
struct Entry {
    dtype: String,
    shape: Vec<usize>,
    data_offsets: [usize; 2],
}

impl Weights {
    /// The arrays of a file, of single or half floats. The error says what is wrong with it.
    pub fn parse(bytes: &[u8]) -> Result<Self, String> {
        let (length, rest) = bytes.split_first_chunk::<8>().ok_or("is shorter than its header")?;
        let length = usize::try_from(u64::from_le_bytes(*length)).ok().filter(|&length| length <= rest.len());
        let (header, data) = rest.split_at(length.ok_or("is shorter than its header")?);
        let header: BTreeMap<String, serde_json::Value> =
            serde_json::from_slice(header).map_err(|error| format!("has no sensible header: {error}"))?;
        let mut arrays = BTreeMap::new();
        for (name, value) in header.into_iter().filter(|(name, _)| name != "__metadata__") {
            let entry =
                serde_json::from_value(value).map_err(|error| format!("has no sensible entry {name}: {error}"))?;
            let array = array(&entry, data).map_err(|why| format!("has an array {name} {why}"))?;
            arrays.insert(name, array);
        }
        Ok(Self(arrays))
    }

    /// The convolution whose arrays are `name.weight` (outputs, inputs, rows, columns) and `name.bias`.
    pub fn convolution(&self, name: &str, dilation: usize, activation: Activation) -> Result<Convolution, String> {
        let (weight, bias) = self.pair(name)?;
        let [outputs, inputs, rows, columns] = weight.shape[..] else {
            return Err(format!("has an array {name}.weight of {} dimensions instead of 4", weight.shape.len()));
        };
        if rows != columns || rows % 2 == 0 || bias.shape != [outputs] {
            return Err(format!("has no convolution {name}: its shapes are {:?} and {:?}", weight.shape, bias.shape));
        }
        Ok(Convolution::new((outputs, inputs, rows), dilation, &weight.values, &bias.values, activation))
    }

    /// The transposed convolution whose arrays are `name.weight` (inputs, outputs, 4, 4) and `name.bias`.
    pub fn transposed(&self, name: &str, activation: Activation) -> Result<Convolution, String> {
        let (weight, bias) = self.pair(name)?;
        match (&weight.shape[..], &bias.shape[..]) {
            (&[inputs, outputs, 4, 4], &[biases]) if biases == outputs => {
                Ok(Convolution::transposed((outputs, inputs), &weight.values, &bias.values, activation))
            }
            shapes => Err(format!("has no transposed convolution {name}: its shapes are {shapes:?}")),
        }
    }

    /// Whether there is an array of this name.
    pub fn has(&self, name: &str) -> bool {
        self.0.contains_key(name)
    }

    /// An array of height, width and channels.
    pub fn tensor(&self, name: &str) -> Option<Tensor> {
        let array = self.0.get(name)?;
        let [height, width, channels] = array.shape[..] else { return None };
        Some(Tensor { width, height, channels, data: array.values.clone() })
    }

    fn pair(&self, name: &str) -> Result<(&Array, &Array), String> {
        let get = |part: &str| {
            let name = format!("{name}.{part}");
            self.0.get(&name).ok_or(format!("lacks the array {name}"))
        };
        Ok((get("weight")?, get("bias")?))
    }
}

fn array(entry: &Entry, data: &[u8]) -> Result<Array, String> {
    if entry.shape.contains(&0) {
        return Err("without values".into());
    }
    let [start, end] = entry.data_offsets;
    let bytes = data.get(start..end).ok_or("beyond its end")?;
    let count = entry.shape.iter().try_fold(1usize, |count, &length| count.checked_mul(length)).ok_or("of no size")?;
    let (size, read): (usize, fn(&[u8]) -> f32) = match entry.dtype.as_str() {
        "F32" => (4, |bytes| f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])),
        "F16" => (2, |bytes| half::f16::from_le_bytes([bytes[0], bytes[1]]).to_f32()),
        other => return Err(format!("of type {other}: single and half floats are read")),
    };
    if bytes.len() != count.saturating_mul(size) {
        return Err(format!("of {} bytes instead of {}", bytes.len(), count.saturating_mul(size)));
    }
    let values: Vec<f32> = bytes.chunks_exact(size).map(read).collect();
    if values.iter().any(|value| !value.is_finite()) {
        return Err("with a value that is not finite".into());
    }
    Ok(Array { shape: entry.shape.clone(), values })
}
