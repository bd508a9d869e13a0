//! Files of several parts, as an EXR file may have them, as one image: V-Ray, Nuke and Houdini write every layer into a part of
//! its own.

use super::Header;

/// A part with its own header.
#[derive(Clone, Debug, Default)]
pub struct Part {
    /// Its name; may be empty.
    pub name: String,
    /// Its size and channels.
    pub header: Header,
    /// Whether its pixels are lists of samples at different depths, which are not read.
    pub deep: bool,
}

/// The parts of one size, with a header of all their channels.
pub struct Merged {
    /// The header of all.
    pub header: Header,
    /// Positions of the parts in the file.
    pub parts: Vec<usize>,
}

/// Merges the parts of the same size and place as the first one with colours, or as the first one. Channels have the names of
/// their parts before their own, unless they have one already. None without a part that can be read.
pub fn merge(all: &[Part]) -> Option<Merged> {
    let flat: Vec<usize> = (0..all.len()).filter(|&i| !all[i].deep).collect();
    let main = flat.iter().find(|&&i| has_colors(&all[i].header)).or(flat.first())?;
    let place = |i: usize| (all[i].header.width, all[i].header.height, all[i].header.origin);
    let parts: Vec<usize> = flat.iter().copied().filter(|&i| place(i) == place(*main)).collect();
    let mut header =
        Header { parts: all.len(), channels: Vec::new(), storage: Vec::new(), ..all[*main].header.clone() };
    for &i in &parts {
        let Part { name, header: part, .. } = &all[i];
        for (channel, storage) in part.channels.iter().zip(&part.storage) {
            let is_plain = !channel.contains('.') || header.channels.contains(channel);
            let full = if is_plain && !name.is_empty() && all.len() > 1 {
                format!("{name}.{channel}")
            } else {
                channel.clone()
            };
            header.channels.push(full);
            header.storage.push(*storage);
        }
    }
    Some(Merged { header, parts })
}

fn has_colors(header: &Header) -> bool {
    let has = |wanted: &str| {
        header.channels.iter().any(|name| name.rsplit('.').next().is_some_and(|last| last.eq_ignore_ascii_case(wanted)))
    };
    ["r", "g", "b"].into_iter().all(has)
}

/// Puts the samples of one part, channels interleaved, among those of all.
pub fn interleave<T: Copy>(all: &mut [T], (channels, first): (usize, usize), part: &[T], count: usize) {
    for (to, from) in all.chunks_exact_mut(channels).zip(part.chunks_exact(count)) {
        to[first..first + count].copy_from_slice(from);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pixels::Storage;

    fn part(name: &str, width: usize, channels: &str, deep: bool) -> Part {
        let channels: Vec<_> = channels.split(' ').map(String::from).collect();
        let storage = vec![Storage::Float; channels.len()];
        Part { name: name.into(), header: Header { width, height: 2, channels, storage, ..Header::default() }, deep }
    }

    #[test]
    fn parts_of_the_size_of_the_colours_become_one() {
        let parts = [part("depth", 3, "Z", false), part("rgba", 3, "R G B", false), part("small", 2, "R G B", false)];
        let Merged { header, parts } = merge(&parts).unwrap();
        assert_eq!(
            (header.channels.join(" "), parts, header.parts),
            ("depth.Z rgba.R rgba.G rgba.B".into(), vec![0, 1], 3)
        );
        let parts = [part("deep", 3, "R G B", true), part("b", 3, "N.X N.Y N.Z", false), part("c", 3, "N.X", false)];
        assert_eq!(merge(&parts).unwrap().header.channels.join(" "), "N.X N.Y N.Z c.N.X");
        assert_eq!(merge(&[part("only", 3, "R G B", false)]).unwrap().header.channels.join(" "), "R G B");
        assert!(merge(&[part("deep", 3, "R", true)]).is_none());
        let mut all = [0; 6];
        interleave(&mut all, (3, 1), &[1, 2, 3, 4], 2);
        assert_eq!(all, [0, 1, 2, 0, 3, 4]);
    }
}
