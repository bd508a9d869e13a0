//! Polygons as triangles.

use earcut::Earcut;
use earcut::utils3d::project3d_to_2d;

use crate::math::Vec3;

/// Cuts polygons into triangles, with memory that is used again.
#[derive(Default)]
pub struct Triangulation {
    earcut: Earcut<f32>,
    outline: Vec<[f32; 3]>,
    flat: Vec<[f32; 2]>,
    indices: Vec<u32>,
}

impl Triangulation {
    /// Appends the triangles of a polygon: around its first corner if it is convex, by ear clipping otherwise.
    pub fn add(&mut self, corners: &[u32], positions: &[Vec3], triangles: &mut Vec<[u32; 3]>) {
        // A corner that is given twice turns neither way, and would hide that its neighbours do.
        let mut distinct = corners.to_vec();
        distinct.dedup_by_key(|corner| positions[*corner as usize].to_array().map(f32::to_bits));
        let ends = |list: &[u32]| [list[0], list[list.len() - 1]].map(|corner| positions[corner as usize]);
        while distinct.len() > 1 && ends(&distinct)[0] == ends(&distinct)[1] {
            distinct.pop();
        }
        let corners = &distinct;
        let normal = normal(corners, positions);
        if corners.len() <= 3 || is_convex(corners, positions, normal) || !self.clip(corners, positions) {
            triangles.extend(corners.windows(2).skip(1).map(|pair| [corners[0], pair[0], pair[1]]));
            return;
        }
        for ear in self.indices.chunks_exact(3) {
            let [a, b, c] = [ear[0], ear[1], ear[2]].map(|index| corners[index as usize]);
            let [pa, pb, pc] = [a, b, c].map(|index| positions[index as usize]);
            // Ears may come out turned over.
            let turned = (pb - pa).cross(pc - pa).dot(normal) < 0.0;
            triangles.push(if turned { [a, c, b] } else { [a, b, c] });
        }
    }

    /// Fills `indices`; false for a polygon that has no plane or no inside.
    fn clip(&mut self, corners: &[u32], positions: &[Vec3]) -> bool {
        self.outline.clear();
        self.outline.extend(corners.iter().map(|&index| positions[index as usize].to_array()));
        if self.outline.as_flattened().iter().any(|value| !value.is_finite())
            || !project3d_to_2d(&self.outline, corners.len(), &mut self.flat)
        {
            return false;
        }
        self.earcut.earcut(self.flat.iter().copied(), &[], &mut self.indices);
        !self.indices.is_empty()
    }
}

/// Normal of a polygon with its doubled area as length (Newell's sum).
fn normal(corners: &[u32], positions: &[Vec3]) -> Vec3 {
    let Some(&first) = corners.first() else { return Vec3::ZERO };
    let to = |index: u32| positions[index as usize] - positions[first as usize];
    corners.windows(2).map(|pair| to(pair[0]).cross(to(pair[1]))).sum()
}

/// Whether no corner turns against the others. A corner that is out of line by rounding alone turns neither way.
fn is_convex(corners: &[u32], positions: &[Vec3], normal: Vec3) -> bool {
    let n = corners.len();
    (0..n).all(|i| {
        let [a, b, c] = [i, i + 1, i + 2].map(|k| positions[corners[k % n] as usize]);
        let (to, from) = (b - a, c - b);
        to.cross(from).dot(normal) >= -1e-5 * to.length() * from.length() * normal.length()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vec3;

    /// Triangles of a polygon in some plane, and their area.
    fn cut(outline: &[[f32; 2]]) -> (usize, f32) {
        let (u, v) = (vec3(0.6, 0.0, 0.8), vec3(0.0, 1.0, 0.0));
        let positions: Vec<Vec3> = outline.iter().map(|[x, y]| u * *x + v * *y + Vec3::ONE).collect();
        let corners: Vec<u32> = (0..outline.len() as u32).collect();
        let mut triangles = Vec::new();
        Triangulation::default().add(&corners, &positions, &mut triangles);
        let normal = u.cross(v);
        let area = |&[a, b, c]: &[u32; 3]| {
            let [a, b, c] = [a, b, c].map(|index| positions[index as usize]);
            0.5 * (b - a).cross(c - a).dot(normal)
        };
        assert!(triangles.iter().all(|triangle| area(triangle) >= 0.0), "{triangles:?}");
        (triangles.len(), triangles.iter().map(area).sum())
    }

    #[test]
    fn areas_are_those_of_the_outlines() {
        let square = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        let dart = [[0.0, 0.0], [2.0, 0.0], [0.5, 0.5], [0.0, 2.0]];
        let late_dart = [[2.0, 0.0], [0.5, 0.5], [0.0, 2.0], [0.0, 0.0]];
        let doubled = [[0.0, 0.0], [2.0, 0.0], [0.5, 0.5], [0.5, 0.5], [0.0, 2.0], [0.0, 2.0], [0.0, 0.0]];
        assert!((cut(&doubled).1 - 1.0).abs() < 1e-5 && (cut(&doubled[3..]).1 + 1.0).abs() > 0.5);
        let comb = [[0.0, 0.0], [5.0, 0.0], [5.0, 2.0], [4.0, 2.0], [4.0, 1.0], [3.0, 1.0], [3.0, 2.0], [0.0, 2.0]];
        for (outline, expected) in [(&square[..], 4.0), (&dart, 1.0), (&late_dart, 1.0), (&comb, 9.0)] {
            let (count, area) = cut(outline);
            assert_eq!(count, outline.len() - 2);
            assert!((area - expected).abs() < 1e-5, "{outline:?}: {area}");
            let mut other_way = outline.to_vec();
            other_way.reverse();
            other_way.iter_mut().for_each(|[x, _]| *x = -*x);
            assert!((cut(&other_way).1 - expected).abs() < 1e-5, "{outline:?}");
        }
    }

    #[test]
    fn outlines_without_an_inside_are_no_panic() {
        for outline in [&[][..], &[[0.0, 0.0]], &[[0.0; 2]; 5], &[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [1.0, 0.0]]] {
            cut(outline);
        }
        let positions = [vec3(f32::NAN, 0.0, 0.0), Vec3::X, Vec3::Y, Vec3::ONE];
        Triangulation::default().add(&[0, 1, 2, 3], &positions, &mut Vec::new());
    }
}
