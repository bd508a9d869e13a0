//! Triangle meshes in world space.

use std::sync::Arc;

use super::Bounds;
use crate::ffi::embree::{Hit, PaddedVertices};
use crate::math::alias::Alias;
use crate::math::{Frame, Mat4, Rgb, Vec2, Vec3, vec2, warp};
use crate::scene::light_point::{LightPoint, Position};
use crate::scene::plugin::MeshData;
use crate::scene::{Ray, Surface, texture};

/// Triangles with optional normals and texture coordinates, shared with Embree.
pub struct Mesh {
    /// World positions.
    pub positions: Arc<PaddedVertices>,
    /// Vertex numbers.
    pub triangles: Arc<Vec<[u32; 3]>>,
    /// Positions and normals of every triangle, adjacent in memory, for hits.
    corners: Vec<Corners>,
    /// Texture coordinates, or none for barycentric ones.
    uvs: Vec<Vec2>,
    /// Values by name: one a vertex under `vertex_...`, one a triangle under `face_...`.
    attributes: Vec<(String, Vec<Rgb>)>,
    /// -1 to turn the surface inside out.
    side: f32,
    /// Triangles by area.
    areas: Option<Alias>,
    area: f32,
    bounds: Bounds,
}

/// The corners of a triangle.
#[derive(Clone, Copy, Debug)]
pub struct Corners {
    /// Positions.
    pub p: [Vec3; 3],
    /// Normals, zero for flat shading.
    pub n: [Vec3; 3],
}

/// How a mesh is placed and shaded.
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    /// Object to world.
    pub to_world: Mat4,
    /// Flat shading, whatever normals the data has.
    pub face_normals: bool,
    /// Swap inside and outside.
    pub flip_normals: bool,
}

impl Mesh {
    /// Places mesh data in the world. Triangles with non-finite corners are left out. Missing vertex normals
    /// are averaged from the faces by angle (Thürmer and Wüthrich 1998) unless shading is flat.
    pub fn new(data: MeshData, placement: Placement) -> Self {
        let Placement { to_world, face_normals, flip_normals } = placement;
        let positions: Vec<Vec3> = data.positions.iter().map(|&p| to_world.transform_point3(p)).collect();
        let (mut triangles, mut attributes) = (data.triangles, data.attributes);
        let keep: Vec<bool> = triangles.iter().map(|t| t.iter().all(|&i| positions[i as usize].is_finite())).collect();
        if keep.contains(&false) {
            retain(&mut triangles, &keep);
            let of_faces = attributes.iter_mut().filter(|(name, _)| name.starts_with(FACE));
            of_faces.for_each(|(_, values)| retain(values, &keep));
        }
        let normals = if face_normals {
            Vec::new()
        } else if data.normals.is_empty() {
            angle_weighted_normals(&positions, &triangles)
        } else {
            let matrix = to_world.inverse().transpose();
            data.normals.iter().map(|&n| matrix.transform_vector3(n).normalize_or_zero()).collect()
        };
        let corners: Vec<_> = triangles
            .iter()
            .map(|triangle| Corners {
                p: triangle.map(|i| positions[i as usize]),
                n: triangle.map(|i| normals.get(i as usize).copied().unwrap_or_default()),
            })
            .collect();
        let area = |&Corners { p: [a, b, c], .. }: &Corners| 0.5 * (b - a).cross(c - a).length();
        let areas: Vec<f32> = corners.iter().map(area).collect();
        let bounds = Bounds::of(triangles.iter().flatten().map(|&i| positions[i as usize]));
        Self {
            positions: Arc::new(PaddedVertices::new(positions.iter().map(|p| p.to_array()))),
            triangles: Arc::new(triangles),
            corners,
            uvs: data.uvs,
            attributes,
            side: if flip_normals { -1.0 } else { 1.0 },
            area: areas.iter().map(|&area| f64::from(area)).sum::<f64>() as f32,
            areas: Alias::new(&areas),
            bounds,
        }
    }

    /// The corners of a triangle.
    #[inline]
    pub fn corners(&self, triangle: u32) -> &Corners {
        &self.corners[triangle as usize]
    }

    /// 1, or -1 when the surface is inside out.
    #[inline]
    pub fn side(&self) -> f32 {
        self.side
    }

    /// Geometric and shading normal at barycentric coordinates, the first turned to the side of the second.
    fn normals_at(&self, &Corners { p: [a, b, c], n }: &Corners, weights: [f32; 3]) -> (Vec3, Vec3) {
        let flat = (b - a).cross(c - a).normalize_or(Vec3::Z) * self.side;
        let smooth = n[0] * weights[0] + n[1] * weights[1] + n[2] * weights[2];
        match smooth.try_normalize() {
            Some(smooth) => {
                let smooth = smooth * self.side;
                (flat * 1f32.copysign(flat.dot(smooth)), smooth)
            }
            None => (flat, flat),
        }
    }

    fn texture_point(&self, primitive: u32, weights: [f32; 3]) -> texture::Point {
        let uv = self.uv_at(primitive, weights);
        texture::Point { uv, barycentric: vec2(weights[1], weights[2]), primitive, shape: 0 }
    }

    /// Texture coordinates at barycentric ones.
    #[inline]
    pub fn uv_at(&self, triangle: u32, weights: [f32; 3]) -> Vec2 {
        if self.uvs.is_empty() {
            return vec2(weights[1], weights[2]);
        }
        let [a, b, c] = self.triangles[triangle as usize].map(|index| self.uvs[index as usize]);
        a * weights[0] + b * weights[1] + c * weights[2]
    }

    /// The surface at the point that a ray has hit.
    #[inline]
    pub fn surface(&self, hit: &Hit, ray: Ray, derivatives: bool) -> Surface {
        let corners = self.corners(hit.primitive);
        let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
        let p = corners.p[0] * weights[0] + corners.p[1] * weights[1] + corners.p[2] * weights[2];
        let (n, shading) = self.normals_at(corners, weights);
        let (mut dp_du, mut dp_dv) = (Vec3::ZERO, Vec3::ZERO);
        let frame = if derivatives {
            (dp_du, dp_dv) = self.derivatives(hit.primitive, n);
            Frame::along(shading, dp_du)
        } else {
            Frame::around(shading)
        };
        Surface {
            p,
            n,
            frame,
            at: self.texture_point(hit.primitive, weights),
            dp_du,
            dp_dv,
            instance: u32::MAX,
            epsilon: 0.0,
            curvature: 0.0,
            wi: frame.to_local(-ray.direction),
        }
    }

    fn derivatives(&self, triangle: u32, n: Vec3) -> (Vec3, Vec3) {
        if !self.uvs.is_empty() {
            let [a, b, c] = self.corners(triangle).p;
            let [ua, ub, uc] = self.triangles[triangle as usize].map(|index| self.uvs[index as usize]);
            let (d0, d1, e0, e1) = (ub - ua, uc - ua, b - a, c - a);
            let determinant = d0.perp_dot(d1);
            if determinant != 0.0 {
                return ((e0 * d1.y - e1 * d0.y) / determinant, (e1 * d0.x - e0 * d1.x) / determinant);
            }
        }
        let frame = Frame::around(n);
        (frame.s, frame.t)
    }

    /// Number of the attribute of this name.
    pub fn attribute(&self, name: &str) -> Option<usize> {
        self.attributes.iter().position(|(known, _)| known == name)
    }

    /// Value of an attribute at a point, between the vertices as positions are.
    pub fn attribute_at(&self, attribute: usize, at: &texture::Point) -> Rgb {
        let (name, values) = &self.attributes[attribute];
        if name.starts_with(FACE) {
            return values[at.primitive as usize];
        }
        let [a, b, c] = self.triangles[at.primitive as usize].map(|index| values[index as usize]);
        a + (b - a) * at.barycentric.x + (c - a) * at.barycentric.y
    }

    /// Total area.
    pub fn area(&self) -> f32 {
        self.area
    }

    /// The middle of all geometric normals and the largest angle to one of them.
    pub fn normals(&self) -> (Vec3, f32) {
        let normals = || self.corners.iter().map(|corners| self.normals_at(corners, [1.0 / 3.0; 3]).0);
        let middle = normals().sum::<Vec3>().normalize_or(Vec3::Z);
        (middle, normals().map(|n| middle.dot(n).clamp(-1.0, 1.0).acos()).fold(0.0, f32::max))
    }

    /// Box around all triangles.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// A point uniform over the area.
    pub fn sample(&self, u: Vec2) -> Option<LightPoint> {
        let (index, rest) = self.areas.as_ref()?.sample(u.y);
        let corners = self.corners(index as u32);
        let b = warp::triangle(vec2(u.x, rest));
        let weights = [1.0 - b.x - b.y, b.x, b.y];
        let p = corners.p[0] * weights[0] + corners.p[1] * weights[1] + corners.p[2] * weights[2];
        let (n, _) = self.normals_at(corners, weights);
        let position = Position::Surface { p, n };
        Some(LightPoint::drawn(position, self.texture_point(index as u32, weights)))
    }

    /// Triangles by area; `None` without any.
    pub fn areas(&self) -> Option<&Alias> {
        self.areas.as_ref()
    }

    /// Density of [`Mesh::sample`] per solid angle at `from`.
    pub fn pdf(&self, from: Vec3, point: &LightPoint) -> f32 {
        point.area_to_solid_angle(from, 1.0 / self.area())
    }
}

/// How the names of attributes of faces start.
const FACE: &str = "face_";

fn retain<T>(values: &mut Vec<T>, keep: &[bool]) {
    let mut kept = keep.iter();
    values.retain(|_| kept.next().copied().unwrap_or_default());
}

fn angle_weighted_normals(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let mut normals = vec![Vec3::ZERO; positions.len()];
    for triangle in triangles {
        let corners = triangle.map(|index| positions[index as usize]);
        let Some(n) = (corners[1] - corners[0]).cross(corners[2] - corners[0]).try_normalize() else { continue };
        for k in 0..3 {
            let (to_next, to_last) = (corners[(k + 1) % 3] - corners[k], corners[(k + 2) % 3] - corners[k]);
            normals[triangle[k] as usize] += n * to_next.angle_between(to_last);
        }
    }
    normals.iter().map(|n| n.normalize_or_zero()).collect()
}
