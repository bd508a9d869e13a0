//! Sixteen surfaces.

use super::{Rays, ShapeInfo};
pub use crate::ffi::embree::Hits;
use crate::math::lanes::{Bits, LANES, Lanes, Lanes3, Mask};
use crate::math::{Frame, Vec3, vec2};
use crate::scene::closure::KINDS;
use crate::scene::emitter::LightPoint;
use crate::scene::shape::Geometry;
use crate::scene::{Purpose, Scene, Shape, Surface, surface, texture};

/// Sixteen orthonormal frames.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Frames<const N: usize = LANES> {
    /// First tangents.
    pub s: Lanes3<N>,
    /// Second tangents.
    pub t: Lanes3<N>,
    /// Normals.
    pub n: Lanes3<N>,
}

impl<const N: usize> Frames<N> {
    /// [`Frame::around`].
    #[inline(always)]
    pub fn around(n: Lanes3<N>) -> Self {
        let one = Lanes::splat(1.0);
        let sign = one.copysign(n.z);
        let a = -one / (sign + n.z);
        let b = n.x * n.y * a;
        let s = Lanes3 { x: one + sign * n.x * n.x * a, y: sign * b, z: -sign * n.x };
        let t = Lanes3 { x: b, y: sign + n.y * n.y * a, z: -n.y };
        Self { s, t, n }
    }

    /// [`Frame::along`].
    #[inline(always)]
    pub fn along(n: Lanes3<N>, tangent: Lanes3<N>) -> Self {
        let across = tangent - n * n.dot(tangent);
        let possible = across.dot(across).greater(Lanes::splat(1e-8) * tangent.dot(tangent));
        let s = across.normalize_or(Lanes3::ZERO);
        let (along, around) = (Self { s, t: n.cross(s), n }, Self::around(n));
        Self { s: possible.select3(along.s, around.s), t: possible.select3(along.t, around.t), n }
    }

    /// The frame of one lane.
    #[inline(always)]
    pub fn get(&self, lane: usize) -> Frame {
        Frame { s: self.s.get(lane), t: self.t.get(lane), n: self.n.get(lane) }
    }

    /// World to local.
    #[inline(always)]
    pub fn to_local(&self, v: Lanes3<N>) -> Lanes3<N> {
        Lanes3 { x: self.s.dot(v), y: self.t.dot(v), z: self.n.dot(v) }
    }

    /// Local to world.
    #[inline(always)]
    pub fn to_world(&self, v: Lanes3<N>) -> Lanes3<N> {
        self.s * v.x + self.t * v.y + self.n * v.z
    }
}

/// Surfaces, as [`Surface`] has them.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct Surfaces {
    /// Positions.
    pub p: Lanes3,
    /// Geometric normals.
    pub n: Lanes3,
    /// Shading frames.
    pub frame: Frames,
    /// Directions back along the rays, in the shading frames.
    pub wi: Lanes3,
    /// Distances of ray origins from the surfaces.
    pub epsilon: Lanes,
    /// Radii of exactly curved surfaces, as [`Surface`] has them.
    curvature: Lanes,
    /// Indices of the shapes.
    pub shape: Bits,
    /// Numbers of the instances, as [`Surface`] has them.
    pub instance: Bits,
    /// Lanes whose surface is emissive; valid where a ray has hit something.
    pub emissive: Mask,
    uv: [Lanes; 2],
    barycentric: [Lanes; 2],
    primitive: Bits,
    dp_du: Lanes3,
    dp_dv: Lanes3,
}

impl Default for Surfaces {
    fn default() -> Self {
        let zero = Lanes3::ZERO;
        Self {
            p: zero,
            n: zero,
            frame: Frames { s: zero, t: zero, n: zero },
            wi: zero,
            epsilon: Lanes::ZERO,
            curvature: Lanes::ZERO,
            shape: Bits::ZERO,
            instance: Bits::ZERO,
            emissive: Mask::NONE,
            uv: [Lanes::ZERO; 2],
            barycentric: [Lanes::ZERO; 2],
            primitive: Bits::ZERO,
            dp_du: zero,
            dp_dv: zero,
        }
    }
}

impl Surfaces {
    /// The surface of one lane.
    #[inline]
    pub fn get(&self, lane: usize) -> Surface {
        Surface {
            p: self.p.get(lane),
            n: self.n.get(lane),
            frame: self.frame.get(lane),
            at: self.at(lane),
            instance: self.instance.0[lane],
            dp_du: self.dp_du.get(lane),
            dp_dv: self.dp_dv.get(lane),
            epsilon: self.epsilon.0[lane],
            curvature: self.curvature.0[lane],
            wi: self.wi.get(lane),
        }
    }

    /// Texture coordinates of one lane.
    #[inline]
    pub fn at(&self, lane: usize) -> texture::Point {
        texture::Point {
            uv: vec2(self.uv[0].0[lane], self.uv[1].0[lane]),
            barycentric: vec2(self.barycentric[0].0[lane], self.barycentric[1].0[lane]),
            primitive: self.primitive.0[lane],
            shape: self.shape.0[lane],
        }
    }

    /// Sets one lane.
    pub fn set(&mut self, lane: usize, surface: &Surface) {
        self.p.set(lane, surface.p);
        self.n.set(lane, surface.n);
        self.frame.s.set(lane, surface.frame.s);
        self.frame.t.set(lane, surface.frame.t);
        self.frame.n.set(lane, surface.frame.n);
        self.wi.set(lane, surface.wi);
        self.epsilon.0[lane] = surface.epsilon;
        self.curvature.0[lane] = surface.curvature;
        self.shape.0[lane] = surface.at.shape;
        self.instance.0[lane] = surface.instance;
        (self.uv[0].0[lane], self.uv[1].0[lane]) = surface.at.uv.into();
        (self.barycentric[0].0[lane], self.barycentric[1].0[lane]) = surface.at.barycentric.into();
        self.primitive.0[lane] = surface.at.primitive;
        self.dp_du.set(lane, surface.dp_du);
        self.dp_dv.set(lane, surface.dp_dv);
    }

    /// Copies one lane of other surfaces.
    #[inline(always)]
    pub fn copy(&mut self, to: usize, from: &Self, lane: usize) {
        self.copy_place(to, from, lane);
        self.wi.set(to, from.wi.get(lane));
        self.dp_du.set(to, from.dp_du.get(lane));
        self.dp_dv.set(to, from.dp_dv.get(lane));
        self.shape.0[to] = from.shape.0[lane];
        self.instance.0[to] = from.instance.0[lane];
        self.primitive.0[to] = from.primitive.0[lane];
        for k in 0..2 {
            self.uv[k].0[to] = from.uv[k].0[lane];
            self.barycentric[k].0[to] = from.barycentric[k].0[lane];
        }
    }

    /// Copies what visibility depends on of one lane of other surfaces: place, frame and how rays leave.
    #[inline(always)]
    pub fn copy_place(&mut self, to: usize, from: &Self, lane: usize) {
        self.p.set(to, from.p.get(lane));
        self.n.set(to, from.n.get(lane));
        self.frame.s.set(to, from.frame.s.get(lane));
        self.frame.t.set(to, from.frame.t.get(lane));
        self.frame.n.set(to, from.frame.n.get(lane));
        self.epsilon.0[to] = from.epsilon.0[lane];
        self.curvature.0[to] = from.curvature.0[lane];
    }

    /// [`Lanes::copy_beside`].
    #[inline(always)]
    pub fn copy_beside<const STEP: i32>(&mut self, from: &Self) {
        self.p.copy_beside::<STEP>(&from.p);
        self.n.copy_beside::<STEP>(&from.n);
        self.frame.s.copy_beside::<STEP>(&from.frame.s);
        self.frame.t.copy_beside::<STEP>(&from.frame.t);
        self.frame.n.copy_beside::<STEP>(&from.frame.n);
        self.wi.copy_beside::<STEP>(&from.wi);
        self.epsilon.copy_beside::<STEP>(&from.epsilon);
        self.curvature.copy_beside::<STEP>(&from.curvature);
        self.shape.copy_beside::<STEP>(&from.shape);
        self.instance.copy_beside::<STEP>(&from.instance);
        self.emissive.copy_beside::<STEP>(&from.emissive);
        self.primitive.copy_beside::<STEP>(&from.primitive);
        for k in 0..2 {
            self.uv[k].copy_beside::<STEP>(&from.uv[k]);
            self.barycentric[k].copy_beside::<STEP>(&from.barycentric[k]);
        }
        self.dp_du.copy_beside::<STEP>(&from.dp_du);
        self.dp_dv.copy_beside::<STEP>(&from.dp_dv);
    }

    /// [`Surface::leave`].
    #[inline(always)]
    pub fn leave(&self, direction: Lanes3) -> Lanes3 {
        let cosine = self.n.dot(direction);
        let off = offset(self.p, self.n, self.epsilon, direction);
        let inside = (cosine * self.curvature).less(Lanes::ZERO);
        if !inside.any() {
            return off;
        }
        let room = cosine * cosine * self.curvature.abs();
        let along = inside & room.greater(Lanes::splat(2.0) * self.epsilon * direction.dot(direction));
        along.select3(self.p + direction * (self.epsilon / cosine.abs()), off)
    }
}

/// Points offset from their surfaces to the side that `direction` leaves on.
#[inline(always)]
pub(super) fn offset(p: Lanes3, n: Lanes3, epsilon: Lanes, direction: Lanes3) -> Lanes3 {
    p + n * epsilon.copysign(n.dot(direction))
}

/// [`surface::epsilon`].
#[inline(always)]
pub(super) fn epsilon(p: Lanes3, scene_size: f32) -> Lanes {
    Lanes::splat(surface::RAY_EPSILON) * (Lanes::splat(scene_size.min(1.0)) + p.abs().max_element())
}

impl Scene {
    /// Intersects the active rays with the scene; returns the lanes that hit a surface.
    pub fn intersect_packet(&self, rays: &Rays, active: Mask, purpose: Purpose, surfaces: &mut Surfaces) -> Mask {
        let hits = self.hits_of_packet(rays, active, purpose);
        self.surfaces_of_packet(rays, &hits, active, surfaces)
    }

    /// The hits of the active rays, not yet completed.
    pub fn hits_of_packet(&self, rays: &Rays, active: Mask, purpose: Purpose) -> Hits {
        self.accel.intersect_packet(rays, active, purpose)
    }

    /// Kind of the material that a ray has hit, to sort by; the largest number if it has hit nothing.
    #[inline(always)]
    pub fn kind_of_hit(&self, hits: &Hits, lane: usize) -> usize {
        let geometry = hits.geometry[lane];
        if geometry == u32::MAX {
            return KINDS;
        }
        self.shape_infos[self.accel.shape_of(geometry, hits.instance[lane])].kind
    }

    /// Completes the hits of the active rays; returns the lanes that have hit a surface.
    pub fn surfaces_of_packet(&self, rays: &Rays, hits: &Hits, active: Mask, surfaces: &mut Surfaces) -> Mask {
        let found = !Bits(hits.geometry).equal(u32::MAX) & active;
        let left = meshes((&self.shapes, &self.shape_infos), self.accel.size(), rays, hits, found, surfaces);
        for lane in left.lanes() {
            let Some(hit) = hits.get(lane) else { continue };
            let mut one = self.accel.surface((&self.shapes, &self.shape_infos), &hit, rays.get(lane));
            one.epsilon = self.epsilon(one.p);
            surfaces.set(lane, &one);
            surfaces.emissive.set(lane, self.shape_infos[one.at.shape as usize].emitter.is_some());
        }
        found
    }

    /// Replaces emitters that camera rays have hit by the surfaces behind them.
    pub fn pass_emitters(&self, rays: &Rays, hit: &mut Mask, surfaces: &mut Surfaces) {
        for lane in (*hit & surfaces.emissive).lanes() {
            surfaces.emissive.set(lane, false);
            match self.intersect_from_camera(rays.get(lane)) {
                Some(surface) => surfaces.set(lane, &surface),
                None => hit.set(lane, false),
            }
        }
    }

    /// The surface of one lane as a point of its emitter, if it is emissive.
    #[inline]
    pub fn light_point_of(&self, surfaces: &Surfaces, lane: usize) -> Option<LightPoint> {
        let emitter = self.shape_infos[surfaces.shape.0[lane] as usize].emitter?;
        Some(LightPoint::on_surface(&surfaces.get(lane), emitter))
    }
}

vectorized! {
    /// Completes the hits on meshes in lanes; returns the lanes of all other hits.
    fn meshes(
        (shapes, shape_infos): (&[Shape], &[ShapeInfo]),
        scene_size: f32,
        rays: &Rays,
        hits: &Hits,
        found: Mask,
        surfaces: &mut Surfaces,
    ) -> Mask {
        let mut left = Mask::NONE;
        surfaces.emissive = Mask::NONE;
        let mut corners = [[[0.0f32; LANES]; 3]; 6];
        let mut side = [1.0f32; LANES];
        let (u, v) = (Lanes(hits.u), Lanes(hits.v));
        surfaces.uv = [u, v];
        for lane in found.lanes() {
            let number = hits.geometry[lane] as usize;
            if hits.instance[lane] != u32::MAX || !shape_infos[number].mesh {
                left.set(lane, true);
                continue;
            }
            surfaces.emissive.set(lane, shape_infos[number].emitter.is_some());
            let Geometry::Mesh(mesh) = &*shapes[number].geometry else { continue };
            let one = mesh.corners(hits.primitive[lane]);
            for (to, from) in corners.iter_mut().zip(one.p.iter().chain(&one.n)) {
                (to[0][lane], to[1][lane], to[2][lane]) = (*from).into();
            }
            side[lane] = mesh.side();
            if shape_infos[number].uv {
                let (u, v) = (hits.u[lane], hits.v[lane]);
                (surfaces.uv[0].0[lane], surfaces.uv[1].0[lane]) =
                    mesh.uv_at(hits.primitive[lane], [1.0 - u - v, u, v]).into();
            }
        }
        let [a, b, c, na, nb, nc] = corners.map(|[x, y, z]| Lanes3 { x: Lanes(x), y: Lanes(y), z: Lanes(z) });
        let weight = Lanes::splat(1.0) - u - v;
        let side = Lanes(side);
        let up = Lanes3::splat(Vec3::Z);
        let flat = (b - a).cross(c - a).normalize_or(up) * side;
        let smooth = (na * weight + nb * u + nc * v).normalize_or(flat * side) * side;
        let frame = Frames::around(smooth);
        surfaces.p = a * weight + b * u + c * v;
        surfaces.n = flat * Lanes::splat(1.0).copysign(flat.dot(smooth));
        surfaces.frame = frame;
        surfaces.wi = frame.to_local(-rays.direction);
        surfaces.epsilon = epsilon(surfaces.p, scene_size);
        surfaces.curvature = Lanes::ZERO;
        surfaces.shape = Bits(hits.geometry);
    surfaces.instance = Bits([u32::MAX; LANES]);
        surfaces.barycentric = [u, v];
        surfaces.primitive = Bits(hits.primitive);
        left
    }
}
