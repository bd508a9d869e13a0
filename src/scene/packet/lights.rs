//! Sixteen emitter points.

use super::info::UniformMeshLight;
use super::{Rays, Surfaces, surfaces};
use crate::math::lanes::{Bits, LANES, Lanes, Lanes3, Mask};
use crate::math::{Rgb, Vec3, vec2};
use crate::scene::emitter::{Chosen, EnvMap, EnvmapHits, LightPoint, LightTriangle, Position, Receiver};
use crate::scene::{Scene, accel, texture};

/// Emitter points, as [`LightPoint`] has them.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct Lights {
    /// Positions; directions towards those at infinity.
    at: Lanes3,
    /// Normals of those on surfaces.
    n: Lanes3,
    /// Lanes whose point lies on a surface.
    surface: Mask,
    /// Lanes whose point is at infinity.
    far: Mask,
    /// Lanes whose point is the only one of its emitter, which no path hits by scattering.
    pub delta: Mask,
    emitter: Bits,
    /// Triangles of the points on meshes of uniform radiance.
    triangle: Bits,
    /// Lanes whose point lies on a mesh of uniform radiance.
    uniform_mesh: Mask,
    /// Lanes whose point is a direction of the environment image, with densities and radiance.
    envmap: Mask,
    envmap_pdf: Lanes,
    envmap_radiance: Lanes3,
    /// The others.
    points: [LightPoint; LANES],
}

impl Default for Lights {
    fn default() -> Self {
        Self {
            at: Lanes3::ZERO,
            n: Lanes3::ZERO,
            surface: Mask::NONE,
            far: Mask::NONE,
            delta: Mask::NONE,
            emitter: Bits::ZERO,
            triangle: Bits::ZERO,
            uniform_mesh: Mask::NONE,
            envmap: Mask::NONE,
            envmap_pdf: Lanes::ZERO,
            envmap_radiance: Lanes3::ZERO,
            points: [LightPoint::at_infinity(Vec3::Z, 0); LANES],
        }
    }
}

impl Lights {
    /// Sets one lane.
    pub fn set(&mut self, lane: usize, point: LightPoint, uniform_mesh: bool) {
        let (at, n) = match point.position {
            Position::Surface { p, n } => (p, n),
            Position::Point { p } => (p, Vec3::ZERO),
            Position::Infinity { direction } => (direction, Vec3::ZERO),
        };
        self.at.set(lane, at);
        self.n.set(lane, n);
        self.surface.set(lane, matches!(point.position, Position::Surface { .. }));
        self.far.set(lane, matches!(point.position, Position::Infinity { .. }));
        self.delta.set(lane, point.delta);
        self.emitter.0[lane] = point.emitter;
        self.triangle.0[lane] = point.at.primitive;
        self.uniform_mesh.set(lane, uniform_mesh);
        self.envmap.set(lane, false);
        self.points[lane] = point;
    }

    /// Sets one lane to a direction of the environment image.
    fn set_envmap(&mut self, lane: usize, (direction, emitter): (Vec3, u32), pdf: f32, radiance: Rgb) {
        self.set(lane, LightPoint::at_infinity(direction, emitter), false);
        self.envmap.set(lane, true);
        self.envmap_pdf.0[lane] = pdf;
        self.envmap_radiance.set(lane, radiance);
    }

    /// Whether one lane's point is at infinity.
    pub fn is_far(&self, lane: usize) -> bool {
        self.far.get(lane)
    }

    /// The emitter of one lane's point.
    pub fn emitter(&self, lane: usize) -> u32 {
        self.emitter.0[lane]
    }

    /// The point of one lane; of the environment image only its direction.
    pub fn get(&self, lane: usize) -> LightPoint {
        if !self.uniform_mesh.get(lane) {
            return self.points[lane];
        }
        let position = Position::Surface { p: self.at.get(lane), n: self.n.get(lane) };
        let at = texture::Point { primitive: self.triangle.0[lane], ..Default::default() };
        LightPoint { emitter: self.emitter.0[lane], ..LightPoint::drawn(position, at) }
    }

    /// Unit directions towards the points, and [`LightPoint::solid_angle`].
    #[inline(always)]
    pub fn seen_from(&self, from: Lanes3) -> (Lanes3, Lanes) {
        let one = Lanes::splat(1.0);
        let to = self.at - from;
        let squared = to.dot(to);
        let inverse = one / squared.sqrt();
        let direction = squared.greater(Lanes::ZERO).select3(to * inverse, Lanes3::ZERO);
        let per_distance = inverse * inverse;
        let cosine = -self.n.dot(direction);
        let of_surface = cosine.greater(Lanes::ZERO).select(cosine * per_distance, Lanes::ZERO);
        let angle = self.surface.select(of_surface, self.far.select(one, per_distance));
        (self.far.select3(self.at, direction), angle)
    }

    /// Shadow rays from surfaces towards the points.
    #[inline(always)]
    pub(super) fn shadow_rays(&self, scene_size: f32, from: &Surfaces) -> Rays {
        let towards = self.far.select3(self.at, self.at - from.p);
        let origin = from.leave(towards);
        let near = surfaces::offset(self.at, self.n, surfaces::epsilon(self.at, scene_size), from.p - self.at);
        let end = self.surface.select3(near, self.at);
        let t_far = self.far.select(Lanes::splat(f32::INFINITY), Lanes::splat(accel::SHADOW_END));
        Rays { origin, direction: self.far.select3(self.at, end - origin), t_far }
    }

    /// Densities of hitting the points by scattering of density `pdf`: zero for emitters of a single point.
    #[inline(always)]
    pub fn scatter_pdf(&self, pdf: Lanes) -> Lanes {
        self.delta.select(Lanes::ZERO, pdf)
    }
}

/// Emissive triangles that were sampled for sixteen surfaces.
struct SampledTriangles {
    /// Corner, both edges and normal, coordinate by coordinate.
    triangles: [[[f32; LANES]; 3]; 4],
    /// Random numbers that are left after the choice of a triangle.
    rest: [f32; LANES],
    /// Densities per area.
    density: [f32; LANES],
}

impl SampledTriangles {
    const NONE: Self = Self { triangles: [[[0.0; LANES]; 3]; 4], rest: [0.0; LANES], density: [0.0; LANES] };

    /// Sets one lane to a triangle of a mesh, which is chosen if none was, and returns its number; `density` is that of the whole
    /// choice, per area.
    #[inline(always)]
    fn set(
        &mut self,
        lane: usize,
        (mesh_light, chosen): (&UniformMeshLight, Option<u32>),
        u: f32,
        density: f32,
    ) -> u32 {
        let (triangle, rest) = chosen.map_or_else(|| mesh_light.areas.sample(u), |triangle| (triangle as usize, u));
        let LightTriangle { corner, sides, n } = mesh_light.triangles[triangle];
        for (to, from) in self.triangles.iter_mut().zip([corner, sides[0], sides[1], n]) {
            (to[0][lane], to[1][lane], to[2][lane]) = from.into();
        }
        (self.rest[lane], self.density[lane]) = (rest, density);
        triangle as u32
    }

    /// Sets the points of the lanes on meshes of uniform radiance, uniformly over their triangles as `warp::triangle`.
    /// Returns the lanes whose surface faces the point, with densities per solid angle.
    #[inline(always)]
    fn place(self, lights: &mut Lights, from: &Surfaces, u: Lanes) -> (Mask, Lanes) {
        let [corner, side, other_side, n] =
            self.triangles.map(|[x, y, z]| Lanes3 { x: Lanes(x), y: Lanes(y), z: Lanes(z) });
        let one = Lanes::splat(1.0);
        let root = (one - u).max(Lanes::ZERO).sqrt();
        let p = corner + side * (one - root) + other_side * (Lanes(self.rest) * root);
        let on_mesh = lights.uniform_mesh;
        lights.at = on_mesh.select3(p, lights.at);
        lights.n = on_mesh.select3(n, lights.n);
        lights.surface = lights.surface | on_mesh;
        let (_, angle) = lights.seen_from(from.p);
        (on_mesh & angle.greater(Lanes::ZERO), Lanes(self.density) / angle)
    }
}

impl Scene {
    /// Samples an emitter point for every active surface. Returns the lanes that have one, and densities per solid angle,
    /// the choice of the emitter included.
    #[inline(always)]
    pub fn sample_lights(
        &self,
        from: &Surfaces,
        active: Mask,
        (choice, [u, v]): (Lanes, [Lanes; 2]),
        lights: &mut Lights,
    ) -> (Mask, Lanes) {
        let mut found = Mask::NONE;
        let mut pdf = Lanes::ZERO;
        let Some(table) = self.emitter_choice.as_ref() else { return (found, pdf) };
        let mut triangles = SampledTriangles::NONE;
        (lights.delta, lights.far, lights.uniform_mesh, lights.envmap) =
            (Mask::NONE, Mask::NONE, Mask::NONE, Mask::NONE);
        let mut on_envmap = Mask::NONE;
        for lane in active.lanes() {
            let receiver = self.receiver(from, lane);
            let Some(Chosen { emitter: index, triangle, chance }) = table.choose(&receiver, choice.0[lane]) else {
                continue;
            };
            let info = &self.emitter_infos[index];
            if let Some(mesh_light) = &info.mesh_light {
                let density = if info.density > 0.0 { info.density } else { chance / mesh_light.area };
                lights.triangle.0[lane] = triangles.set(lane, (mesh_light, triangle), v.0[lane], density);
                lights.emitter.0[lane] = index as u32;
                lights.uniform_mesh.set(lane, true);
                continue;
            }
            let (p, emitter) = (receiver.p, &self.emitters[index]);
            if self.envmap == Some(index as u32) {
                on_envmap.set(lane, true);
                pdf.0[lane] = chance;
                continue;
            }
            let Some(mut point) = emitter.sample(p, vec2(u.0[lane], v.0[lane])) else { continue };
            point.emitter = index as u32;
            let one = emitter.pdf(p, &point) * chance;
            if one > 0.0 {
                lights.set(lane, point, false);
                found.set(lane, true);
                pdf.0[lane] = one;
            }
        }
        if let Some((index, map)) =
            self.envmap.filter(|_| on_envmap.any()).and_then(|i| Some((i, self.emitters[i as usize].envmap()?)))
        {
            let sample = map.sample_packet([u, v], on_envmap);
            pdf = on_envmap.select(pdf * sample.pdf, pdf);
            for lane in on_envmap.lanes() {
                lights.set_envmap(lane, (sample.direction.get(lane), index), pdf.0[lane], sample.radiance.get(lane));
            }
            found = found | (on_envmap & pdf.greater(Lanes::ZERO));
        }
        if lights.uniform_mesh.any() {
            let (seen, of_triangles) = triangles.place(lights, from, u);
            pdf = seen.select(of_triangles, pdf);
            found = found | seen;
        }
        (found, pdf)
    }

    /// Radiance that emitter points send from `direction`, in which they are seen.
    #[inline(always)]
    pub fn light_radiance(&self, lights: &Lights, direction: Lanes3, active: Mask) -> Lanes3 {
        let mut radiance = Lanes3::ZERO;
        for lane in (active & lights.uniform_mesh).lanes() {
            let info = &self.emitter_infos[lights.emitter.0[lane] as usize];
            radiance.set(lane, info.mesh_light.as_ref().map_or(Rgb::ZERO, |mesh_light| mesh_light.radiance));
        }
        radiance = lights.n.dot(direction).less(Lanes::ZERO).select3(radiance, Lanes3::ZERO);
        radiance = lights.envmap.select3(lights.envmap_radiance, radiance);
        for lane in (active & !(lights.uniform_mesh | lights.envmap)).lanes() {
            radiance.set(lane, self.radiance(&lights.points[lane], -direction.get(lane)));
        }
        radiance
    }

    /// A surface as a receiver of light.
    #[inline(always)]
    pub fn receiver(&self, surfaces: &Surfaces, lane: usize) -> Receiver {
        let one_sided = self.shape_infos[surfaces.shape.0[lane] as usize].one_sided;
        let n = surfaces.frame.n.get(lane) * surfaces.wi.z.0[lane].signum();
        Receiver { p: surfaces.p.get(lane), n: if one_sided { n } else { Vec3::ZERO } }
    }

    /// Densities with which [`Scene::sample_lights`] samples the points from other surfaces, from which they have the given
    /// solid angles.
    #[inline(always)]
    pub fn light_pdf(&self, lights: &Lights, (from, angle): (&Surfaces, Lanes), active: Mask) -> Lanes {
        let (mut density, mut quick) = (Lanes::ZERO, Mask::NONE);
        for lane in (active & lights.uniform_mesh).lanes() {
            density.0[lane] = self.emitter_infos[lights.emitter.0[lane] as usize].density;
            quick.set(lane, density.0[lane] > 0.0);
        }
        let mut pdf = angle.greater(Lanes::ZERO).select(density / angle, Lanes::ZERO);
        pdf = lights.envmap.select(lights.envmap_pdf, pdf);
        for lane in (active & !(quick | lights.envmap)).lanes() {
            pdf.0[lane] = self.emitter_pdf(&self.receiver(from, lane), &lights.get(lane));
        }
        pdf
    }

    /// Radiance that active rays receive from emitters at their ends: surfaces where they `hit` any, else the environment.
    pub fn seen_radiance(&self, rays: &Rays, surfaces: &Surfaces, (active, hit): (Mask, Mask)) -> Lanes3 {
        let envmap = self.envmap_hits(rays, active & !hit);
        let mut seen = envmap.map_or(Lanes3::ZERO, |envmap| (active & !hit).select3(envmap.radiance, Lanes3::ZERO));
        let others = if self.envmap.is_some() { hit } else { active };
        for lane in (others & (!hit | surfaces.emissive)).lanes() {
            let direction = rays.direction.get(lane);
            let point = if hit.get(lane) { self.light_point_of(surfaces, lane) } else { self.environment(direction) };
            seen.set(lane, point.map_or(Rgb::ZERO, |point| self.radiance(&point, -direction)));
        }
        seen
    }

    /// The environment image along active rays that have hit nothing, with the density with which [`Scene::sample_lights`]
    /// finds its points; `None` if the environment is no image.
    pub fn envmap_hits(&self, rays: &Rays, active: Mask) -> Option<EnvmapHits> {
        let emitter = self.envmap.filter(|_| active.any())?;
        let index = emitter as usize;
        let mut hits = envmap_hits(self.emitters[index].envmap()?, rays, active);
        hits.emitter = emitter;
        // Emitters at infinity are chosen with the same chance everywhere.
        let chance = self.emitter_choice.as_ref().map_or(0.0, |choice| choice.constant(index).unwrap_or_default());
        hits.pdf = hits.pdf * Lanes::splat(chance);
        Some(hits)
    }

    /// Sets one lane to an emitter point that a path has hit, with its radiance and the density with which it would have
    /// been sampled.
    pub fn keep_light(&self, lights: &mut Lights, lane: usize, point: LightPoint, (radiance, pdf): (Rgb, f32)) {
        match point.position {
            // After a delta lobe the density is zero, but offsets may need it.
            Position::Infinity { direction } if self.envmap == Some(point.emitter) => {
                let pdf = if pdf > 0.0 { pdf } else { self.emitter_pdf(&Receiver::NOWHERE, &point) };
                lights.set_envmap(lane, (direction, point.emitter), pdf, radiance);
            }
            _ => lights.set(lane, point, self.emitter_infos[point.emitter as usize].mesh_light.is_some()),
        }
    }
}

vectorized! {
    /// [`EnvMap::hits`] in the widest vectors that there are.
    fn envmap_hits(map: &EnvMap, rays: &Rays, active: Mask) -> EnvmapHits {
        map.hits(rays.direction, active)
    }
}
