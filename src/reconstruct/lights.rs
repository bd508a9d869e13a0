//! The light of groups of emitters in a reconstructed image: pixel by pixel it is shared among the groups as their own light is,
//! filtered by one set of weights, so that the groups add up to the image whatever the method.

use std::ops::Range;

use super::common::inputs::Inputs;
use super::nlm::Nlm;
use super::{Note, Reconstruction, Solution};
use crate::error::{Error, Result};
use crate::film::{Frame, Layer, LightLayers};
use crate::image::Image;

/// Radius of the window of the non-local means that filter the groups' light where a method has no weights of its own.
const WINDOW: usize = 6;
/// Times that they do: single bright samples of a group become hills instead of squares as large as the window.
const PASSES: usize = 2;

/// Images of all groups, in radiance, directly seen emitters included. They add up to the solution's image.
pub fn groups(method: &dyn Reconstruction, frame: &Frame, solution: &Solution) -> Result<Vec<Note>> {
    let Some(first) = frame.lights.first() else { return Ok(Vec::new()) };
    let inputs = Inputs::new(frame, 1)?;
    let planes = |lights: &LightLayers| inputs.mirrored(&lights.color, inputs.scale);
    let all = frame.lights[1..].iter().fold(planes(first), |all, lights| all.and(&planes(lights)));
    let filtered = match method.filter(frame, &all)? {
        Some(filtered) => filtered,
        None => {
            let filter = Nlm::of_window(WINDOW);
            (0..PASSES).try_fold(all, |all, _| Ok::<_, Error>(filter.filter(frame, &all)?.unwrap_or(all)))?
        }
    };
    let filtered: Vec<_> = (0..frame.lights.len())
        .map(|k| filtered.part(3 * k, 3).to_image(frame.width, frame.height, 1.0 / inputs.scale))
        .collect();
    let mut notes: Vec<_> =
        frame.lights.iter().map(|lights| Note { name: lights.name.clone(), image: lights.direct.clone() }).collect();
    for (i, &value) in solution.image.data.iter().enumerate() {
        let scattered = value - frame.get(Layer::Direct).map_or(0.0, |direct| direct.data[i]);
        let shares = shares(&filtered, i);
        notes.iter_mut().zip(shares).for_each(|(note, share)| note.image.data[i] += scattered * share);
    }
    Ok(notes)
}

/// Shares of the groups in a value, which add up to one: those of its channel, of all channels where that is black, or equal ones.
fn shares(filtered: &[Image], i: usize) -> impl Iterator<Item = f32> {
    let light =
        |image: &Image, values: Range<usize>| image.data[values].iter().map(|&value| f64::from(value)).sum::<f64>();
    let of_all = |values: Range<usize>| filtered.iter().map(|image| light(image, values.clone())).sum::<f64>();
    let (channel, pixel) = (i..i + 1, i / 3 * 3..i / 3 * 3 + 3);
    let values = if of_all(channel.clone()) > 0.0 { channel } else { pixel };
    let (whole, equal) = (of_all(values.clone()), 1.0 / filtered.len() as f32);
    filtered.iter().map(move |image| if whole > 0.0 { (light(image, values.clone()) / whole) as f32 } else { equal })
}
