//! View layers: several pictures of a scene in one file, each with layers of its own, as Blender writes them.

use super::aovs::BEAUTY;
use crate::image::io::Pixels;

/// Name of Blender's picture of all view layers after its compositor, which has no other layers.
const COMPOSITE: &str = "composite";

/// Whether a view is what a compositor has made of the others.
pub fn is_composite(view: &str) -> bool {
    view.eq_ignore_ascii_case(COMPOSITE)
}

/// Names of the view layers, in the order of the file; a composite comes last.
pub fn names(channels: &[String]) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    for name in channels {
        let mut parts = name.rsplitn(3, '.');
        let (_, layer, view) = (parts.next(), parts.next(), parts.next());
        let (Some(layer), Some(view)) = (layer, view) else { continue };
        if BEAUTY.contains(&layer.to_lowercase().as_str()) && !found.iter().any(|known| known == view) {
            found.push(view.to_owned());
        }
    }
    found.sort_by_key(|view| is_composite(view));
    found
}

/// Channels of a file without those of all view layers but one.
pub fn only(mut pixels: Pixels, views: &[String], chosen: &str) -> Pixels {
    let is_other = |name: &String| {
        let of = |view: &&String| name.strip_prefix(view.as_str()).is_some_and(|rest| rest.starts_with('.'));
        views.iter().filter(|view| *view != chosen).any(|view| of(&view))
    };
    pixels.channels.iter_mut().filter(|name| is_other(name)).for_each(String::clear);
    pixels
}
