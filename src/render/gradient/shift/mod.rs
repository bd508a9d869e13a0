//! The shift of a base path to a neighbouring pixel, and the difference of their contributions.

pub mod half_vector;
pub mod reconnect;

use self::half_vector::Copied;
use self::reconnect::Connection;
use super::base_path::{BasePath, Vertex};
use crate::math::{Rgb, Vec3};
use crate::render::path::{Emission, Light, Scatter};
use crate::scene::bsdf::Lobe;
use crate::scene::{Ray, Scene, Surface};

/// What an offset path has gathered relative to its base path.
#[derive(Clone, Copy, Debug)]
struct Prefix {
    /// J f(y) / p(x).
    throughput: Rgb,
    /// J p(y) / p(x).
    ratio: f32,
}

impl Prefix {
    /// Goes on by a segment with these factors; `None` when nothing is carried on.
    fn extended(self, value: Rgb, ratio: f32) -> Option<Self> {
        let next = Self { throughput: self.throughput * value, ratio: self.ratio * ratio };
        (next.throughput != Rgb::ZERO && next.ratio > 0.0).then_some(next)
    }
}

/// How an offset path stands to its base path at a vertex.
#[derive(Clone, Copy, Debug)]
enum State {
    /// It has a vertex of its own.
    Apart(Prefix, Surface),
    /// It has just joined the base path's vertex, from the local direction given.
    Joining(Prefix, Vec3),
    /// It is the base path from the last vertex on.
    Joined(Prefix),
    /// It could not be continued.
    Failed,
}

/// Sums of J f(y)/D and f(x)/D over the contributions of a path.
struct Difference(Rgb);

impl Difference {
    /// A contribution of the base alone: the shift has failed.
    fn base_only(&mut self, base: Rgb, density: f32) {
        self.0 -= base / density;
    }

    /// A contribution of both. `base` and `offset` are f(x) and J f(y) before division by `density`, the
    /// base's, and `shifted`, J times the offset's.
    fn pair(&mut self, base: Rgb, offset: Rgb, density: f32, shifted: f32) {
        if offset == Rgb::ZERO || shifted <= 0.0 {
            return self.base_only(base, density);
        }
        self.0 += (offset - base) / (density + shifted);
    }

    /// A contribution of which the offset has its last segment for itself, or none. `scale` is what both are
    /// divided by besides densities, inverted.
    fn pair_with_end(&mut self, base: Rgb, prefix: Prefix, scale: f32, density: f32, end: Option<End>) {
        match end {
            Some(end) => {
                let offset = prefix.throughput * end.value * end.radiance * (end.jacobian * scale);
                self.pair(base, offset, density, prefix.ratio * end.jacobian * (end.light_pdf + end.pdf));
            }
            None => self.base_only(base, density),
        }
    }
}

/// The offset's own last segment, to an emitter.
pub struct End {
    /// f cos at the offset's vertex.
    pub value: Rgb,
    /// Density per solid angle of scattering there, or probability of a delta lobe.
    pub pdf: f32,
    /// Density per solid angle of choosing the point from there; 0 after a delta lobe.
    pub light_pdf: f32,
    /// Radiance received.
    pub radiance: Rgb,
    /// dω' / dω.
    pub jacobian: f32,
}

/// Reconnection where both paths scatter diffusely, half-vector copies elsewhere.
pub struct Shift {
    /// Roughness above which a smooth lobe counts as diffuse.
    pub threshold: f32,
}

impl Shift {
    /// This end's share of (neighbour - pixel): the sum of (J f(y) - f(x)) / D over the path's contributions.
    /// `ray` is the neighbour's camera ray.
    pub fn difference(&self, scene: &Scene, base: &BasePath, ray: Ray) -> Rgb {
        let mut difference = Difference(Rgb::ZERO);
        let start = Prefix { throughput: Rgb::ONE, ratio: 1.0 };
        let first = scene.intersect(ray).map_or(State::Failed, |surface| State::Apart(start, surface));
        // At a vertex the offset may stand differently for its light and for its continuation.
        let (mut at_light, mut at_scatter) = (first, first);
        let lit = &base.vertices[..base.lit_length()];
        for (k, vertex) in lit.iter().enumerate() {
            if let Some(light) = &vertex.light {
                self.add_light(scene, vertex, light, at_light, &mut difference);
            }
            let next = lit.get(k + 1);
            let Some(scatter) = vertex.scatter.as_ref().filter(|_| next.is_some() || vertex.emission.is_some()) else {
                break;
            };
            (at_light, at_scatter) = self.advance(scene, vertex, scatter, at_scatter, next, &mut difference);
        }
        difference.0
    }

    fn is_diffuse(&self, roughness: Option<f32>) -> bool {
        roughness.is_some_and(|roughness| roughness > self.threshold)
    }

    fn scatters_diffusely(&self, lobe: Lobe, roughness: Option<f32>) -> bool {
        lobe == Lobe::Smooth && self.is_diffuse(roughness)
    }

    /// The contribution of a vertex's chosen emitter point.
    fn add_light(&self, scene: &Scene, vertex: &Vertex, light: &Light, state: State, difference: &mut Difference) {
        let Light { point, radiance, wo, eval, pdf } = light;
        let base = vertex.throughput * eval.value * *radiance;
        let density = pdf + eval.pdf;
        match state {
            State::Failed => difference.base_only(base, density),
            State::Joined(prefix) => {
                let offset = prefix.throughput * eval.value * *radiance;
                difference.pair(base, offset, density, prefix.ratio * density);
            }
            State::Joining(prefix, wi) => {
                let moved = scene.bsdf(&vertex.surface).eval(&vertex.surface, wi, *wo);
                let offset = prefix.throughput * moved.value * *radiance;
                difference.pair(base, offset, density, prefix.ratio * (pdf + moved.pdf));
            }
            State::Apart(prefix, surface) => {
                let roughness = scene.bsdf(&surface).roughness(&surface);
                let end = if self.is_diffuse(vertex.roughness) && self.is_diffuse(roughness) {
                    reconnect::to_light(scene, &vertex.surface, &surface, point)
                } else {
                    half_vector::to_light(scene, &vertex.surface, *wo, Lobe::Smooth, &surface, point)
                };
                difference.pair_with_end(base, prefix, 1.0, density, end);
            }
        }
    }

    /// Follows the offset along a segment: adds the emitter at its end, and says how the offset stands at the
    /// next vertex for its light and for its continuation.
    fn advance(
        &self,
        scene: &Scene,
        vertex: &Vertex,
        scatter: &Scatter,
        state: State,
        next: Option<&Vertex>,
        difference: &mut Difference,
    ) -> (State, State) {
        let segment = Segment { vertex, scatter };
        match state {
            State::Failed => {
                segment.add_base_only(difference);
                (State::Failed, State::Failed)
            }
            State::Joined(prefix) => {
                segment.add_joined(prefix, segment.base_value(), scatter.bsdf.pdf, difference);
                let next =
                    prefix.extended(scatter.bsdf.weight / scatter.survival, 1.0).map_or(State::Failed, State::Joined);
                (next, next)
            }
            State::Joining(prefix, wi) => {
                let moved = scene.bsdf(&vertex.surface).eval(&vertex.surface, wi, scatter.bsdf.wo);
                segment.add_joined(prefix, moved.value, moved.pdf, difference);
                let value = moved.value / (scatter.bsdf.pdf * scatter.survival);
                let next = prefix.extended(value, moved.pdf / scatter.bsdf.pdf).map_or(State::Failed, State::Joined);
                (next, next)
            }
            State::Apart(prefix, surface) => {
                let roughness = scene.bsdf(&surface).roughness(&surface);
                if self.scatters_diffusely(scatter.bsdf.lobe, vertex.roughness) && self.is_diffuse(roughness) {
                    return self.advance_connectable(scene, segment, prefix, &surface, next, difference);
                }
                let extended = self.extend(scene, segment, prefix, &surface);
                segment.add_extended_emission(scene, prefix, &surface, &extended, difference);
                let state = extended.map_or(State::Failed, Extended::state);
                (state, state)
            }
        }
    }

    /// A segment that diffuse ends are reconnected over; only a glossy next vertex is reached in another way.
    fn advance_connectable(
        &self,
        scene: &Scene,
        segment: Segment,
        prefix: Prefix,
        surface: &Surface,
        next: Option<&Vertex>,
        difference: &mut Difference,
    ) -> (State, State) {
        if let Some(emission) = &segment.vertex.emission {
            segment.add_reconnected_emission(scene, prefix, surface, emission, difference);
        }
        let Some(next) = next else { return (State::Failed, State::Failed) };
        let lobe = next.scatter.as_ref().map(|scatter| scatter.bsdf.lobe);
        let light_joins = self.is_diffuse(next.roughness);
        let scatter_joins = lobe.is_some_and(|lobe| self.scatters_diffusely(lobe, next.roughness));
        let wants_light = next.light.is_some();
        let mut joined = State::Failed;
        if (wants_light && light_joins) || scatter_joins {
            if let Some(connection) = Connection::new(scene, &segment.vertex.surface, surface, &next.surface) {
                let pdf = segment.scatter.bsdf.pdf;
                let value = connection.value * (connection.jacobian / (pdf * segment.scatter.survival));
                if let Some(prefix) = prefix.extended(value, connection.pdf * connection.jacobian / pdf) {
                    joined = State::Joining(prefix, connection.wi);
                }
            }
        }
        let mut at_light = joined;
        let mut at_scatter = joined;
        let light_apart = wants_light && !light_joins;
        let scatter_apart = lobe.is_some() && !scatter_joins;
        if light_apart || scatter_apart {
            let extended = self.extend(scene, segment, prefix, surface);
            // Where the offset's own new vertex is diffuse, the way back would have reconnected to it.
            let apart = |lobe: Lobe| match &extended {
                Some(found) if !found.can_be_joined(self, scene, lobe) => {
                    extended.map_or(State::Failed, Extended::state)
                }
                _ => State::Failed,
            };
            if light_apart {
                at_light = apart(Lobe::Smooth);
            }
            if scatter_apart {
                at_scatter = lobe.map_or(State::Failed, apart);
            }
        }
        (at_light, at_scatter)
    }

    /// Copies the half vector of a segment's first vertex and finds what the offset meets.
    fn extend(&self, scene: &Scene, segment: Segment, prefix: Prefix, surface: &Surface) -> Option<Extended> {
        let Scatter { bsdf, survival } = segment.scatter;
        let copied = half_vector::copy(scene, &segment.vertex.surface, bsdf.wo, bsdf.lobe, surface)?;
        let value = copied.value * (copied.jacobian / (bsdf.pdf * survival));
        let prefix = prefix.extended(value, copied.pdf * copied.jacobian / bsdf.pdf)?;
        let ray = surface.ray(copied.wo);
        Some(Extended { prefix, copied, direction: ray.direction, hit: scene.intersect(ray) })
    }
}

/// An offset that has gone its own way over a segment.
#[derive(Clone, Copy)]
struct Extended {
    prefix: Prefix,
    copied: Copied,
    direction: Vec3,
    hit: Option<Surface>,
}

impl Extended {
    fn state(self) -> State {
        self.hit.map_or(State::Failed, |surface| State::Apart(self.prefix, surface))
    }

    fn can_be_joined(&self, shift: &Shift, scene: &Scene, lobe: Lobe) -> bool {
        self.hit.as_ref().is_some_and(|hit| shift.scatters_diffusely(lobe, scene.bsdf(hit).roughness(hit)))
    }
}

/// A segment of the base path, seen from its first vertex.
#[derive(Clone, Copy)]
struct Segment<'a> {
    vertex: &'a Vertex,
    scatter: &'a Scatter,
}

impl Segment<'_> {
    /// f cos of the base at the segment's first vertex.
    fn base_value(&self) -> Rgb {
        self.scatter.bsdf.weight * self.scatter.bsdf.pdf
    }

    /// f(x) of the emission at the segment's end, before division by the segment's density.
    fn base(&self, emission: &Emission) -> Rgb {
        self.vertex.throughput * self.base_value() * emission.radiance / self.scatter.survival
    }

    fn add_base_only(&self, difference: &mut Difference) {
        if let Some(emission) = &self.vertex.emission {
            difference.base_only(self.base(emission), self.scatter.bsdf.pdf + emission.light_pdf);
        }
    }

    /// Emission after a vertex that both paths share; the offset scatters there with `value` and `pdf`.
    fn add_joined(&self, prefix: Prefix, value: Rgb, pdf: f32, difference: &mut Difference) {
        if let Some(emission) = &self.vertex.emission {
            let offset = prefix.throughput * value * emission.radiance / self.scatter.survival;
            let density = self.scatter.bsdf.pdf + emission.light_pdf;
            difference.pair(self.base(emission), offset, density, prefix.ratio * (pdf + emission.light_pdf));
        }
    }

    fn add_reconnected_emission(
        &self,
        scene: &Scene,
        prefix: Prefix,
        surface: &Surface,
        emission: &Emission,
        difference: &mut Difference,
    ) {
        let end = reconnect::to_light(scene, &self.vertex.surface, surface, &emission.point);
        self.add_emission_with_end(prefix, emission, end, difference);
    }

    fn add_emission_with_end(
        &self,
        prefix: Prefix,
        emission: &Emission,
        end: Option<End>,
        difference: &mut Difference,
    ) {
        let density = self.scatter.bsdf.pdf + emission.light_pdf;
        difference.pair_with_end(self.base(emission), prefix, 1.0 / self.scatter.survival, density, end);
    }

    /// Emission met by both paths on their own ways.
    fn add_extended_emission(
        &self,
        scene: &Scene,
        prefix: Prefix,
        surface: &Surface,
        extended: &Option<Extended>,
        difference: &mut Difference,
    ) {
        let Some(emission) = &self.vertex.emission else { return };
        let delta = self.scatter.bsdf.lobe.is_delta();
        let end = extended.as_ref().and_then(|found| {
            half_vector::end(scene, &found.copied, delta, surface, found.direction, found.hit.as_ref(), &emission.point)
        });
        self.add_emission_with_end(prefix, emission, end, difference);
    }
}
