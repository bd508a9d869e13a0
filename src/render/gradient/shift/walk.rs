//! Follows a base path vertex by vertex with an offset beside it, and sums up what they differ by.

use super::half_vector::{self, Extended};
use super::reconnect::{self, Connection};
use super::{End, Rgb};
use crate::math::Vec3;
use crate::render::gradient::base_path::{BasePath, Vertex};
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

/// At a vertex the offset may stand differently for its light and for its continuation: a material that is smooth
/// and diffuse at once is joined for the one and not for the other.
#[derive(Clone, Copy)]
struct States {
    light: State,
    scatter: State,
}

impl From<State> for States {
    fn from(both: State) -> Self {
        Self { light: both, scatter: both }
    }
}

impl From<Option<State>> for States {
    fn from(both: Option<State>) -> Self {
        both.unwrap_or(State::Failed).into()
    }
}

/// A segment of the base path: the vertex it leaves and how.
#[derive(Clone, Copy)]
struct Segment<'a> {
    vertex: &'a Vertex,
    scatter: &'a Scatter,
}

impl Segment<'_> {
    /// f(x) of light at the segment's end, before division by the segment's density.
    fn base(&self, radiance: Rgb) -> Rgb {
        let Scatter { bsdf, survival } = self.scatter;
        self.vertex.throughput * bsdf.weight * radiance * (bsdf.pdf / survival)
    }

    /// The prefix behind the segment, which the offset scatters over with `value` and `pdf`, all Jacobians in.
    fn extend(&self, prefix: Prefix, value: Rgb, pdf: f32) -> Option<Prefix> {
        let Scatter { bsdf, survival } = self.scatter;
        prefix.extended(value / (bsdf.pdf * survival), pdf / bsdf.pdf)
    }
}

/// A contribution of the base path: f(x) before division by `density`, the sum of its strategies'.
#[derive(Clone, Copy)]
struct Contribution {
    base: Rgb,
    density: f32,
    /// What is divided by besides densities, inverted.
    scale: f32,
}

impl Contribution {
    /// Difference when the shift has failed.
    fn alone(self) -> Rgb {
        -self.base / self.density
    }

    /// Difference to J f(y), of J times the density given, both relative to the base's prefix.
    fn pair(self, offset: Rgb, shifted: f32) -> Rgb {
        if offset == Rgb::ZERO || shifted <= 0.0 {
            return self.alone();
        }
        (offset * self.scale - self.base) / (self.density + shifted)
    }

    /// Difference to an offset that has its last segment for itself, or none.
    fn end(self, prefix: Prefix, end: Option<End>) -> Rgb {
        end.map_or_else(
            || self.alone(),
            |end| {
                let offset = prefix.throughput * end.value * end.radiance * end.jacobian;
                self.pair(offset, prefix.ratio * end.jacobian * (end.light_pdf + end.pdf))
            },
        )
    }
}

/// This end's share of (neighbour - pixel) by reconnection: the sum of (J f(y) - f(x)) / D over the contributions so far.
pub struct Walk<'a> {
    scene: &'a Scene,
    threshold: f32,
    difference: Rgb,
    /// That of the ambient light, if it is asked for.
    ambient: Option<Rgb>,
}

impl<'a> Walk<'a> {
    /// Nothing yet. Smooth lobes of roughness above `threshold` count as diffuse.
    pub fn new(scene: &'a Scene, threshold: f32, ambient: bool) -> Self {
        Self { scene, threshold, difference: Rgb::ZERO, ambient: ambient.then_some(Rgb::ZERO) }
    }

    /// Walks along the base path as far as light reaches, with an offset that starts with `ray`. Returns the differences
    /// in the scene's light and in the ambient one.
    pub fn along(mut self, base: &BasePath, ray: Ray) -> (Rgb, Rgb) {
        let end = if self.ambient.is_some() { base.vertices.len() } else { base.lit_length() };
        let lit = &base.vertices[..end];
        let start = Prefix { throughput: Rgb::ONE, ratio: 1.0 };
        let mut states =
            States::from(self.scene.intersect_from_camera(ray).map(|surface| State::Apart(start, surface)));
        for (k, vertex) in lit.iter().enumerate() {
            if let Some(light) = &vertex.light {
                self.add_light(vertex, light, states.light);
            }
            let next = lit.get(k + 1);
            match &vertex.scatter {
                Some(scatter) if next.is_some() || vertex.emission.is_some() || self.ambient.is_some() => {
                    states = self.advance(Segment { vertex, scatter }, states.scatter, next);
                }
                _ => break,
            }
        }
        (self.difference, self.ambient.unwrap_or_default())
    }

    fn is_diffuse(&self, roughness: Option<f32>) -> bool {
        roughness.is_some_and(|roughness| roughness > self.threshold)
    }

    fn is_diffuse_at(&self, surface: &Surface) -> bool {
        self.is_diffuse(self.scene.bsdf(surface).roughness(surface))
    }

    fn scatters_diffusely(&self, scatter: &Scatter, vertex: &Vertex) -> bool {
        scatter.bsdf.lobe == Lobe::Smooth && self.is_diffuse(vertex.roughness)
    }

    /// A contribution of the base alone: the shift has failed.
    fn add_base_only(&mut self, of: Contribution) {
        self.difference += of.alone();
    }

    /// A contribution of both: J f(y) and J times the offset's density, both relative to the base's prefix.
    fn add_pair(&mut self, of: Contribution, offset: Rgb, shifted: f32) {
        self.difference += of.pair(offset, shifted);
    }

    /// A contribution of which the offset has its last segment for itself, or none.
    fn add_end(&mut self, of: Contribution, prefix: Prefix, end: Option<End>) {
        self.difference += of.end(prefix, end);
    }

    /// The ambient light at the end of a segment, if it is asked for: as from an environment that nothing blocks.
    fn add_ambient(&mut self, segment: Segment, difference: impl FnOnce(Contribution) -> Rgb) {
        if let Some(sum) = &mut self.ambient {
            *sum += difference(contribution(segment, (Rgb::ONE, 0.0)));
        }
    }

    /// The contribution of a vertex's chosen emitter point.
    fn add_light(&mut self, vertex: &Vertex, light: &Light, state: State) {
        let Light { point, radiance, wo, eval, pdf } = light;
        let base = vertex.throughput * eval.value * *radiance;
        let of = Contribution { base, density: pdf + eval.pdf, scale: 1.0 };
        match state {
            State::Failed => self.add_base_only(of),
            State::Joined(prefix) => {
                self.add_pair(of, prefix.throughput * eval.value * *radiance, prefix.ratio * of.density);
            }
            State::Joining(prefix, wi) => {
                let moved = self.scene.bsdf(&vertex.surface).eval(&vertex.surface, wi, *wo);
                let moved_pdf = point.scatter_pdf(moved.pdf);
                self.add_pair(of, prefix.throughput * moved.value * *radiance, prefix.ratio * (pdf + moved_pdf));
            }
            State::Apart(prefix, surface) => {
                let both_diffuse = || self.is_diffuse(vertex.roughness) && self.is_diffuse_at(&surface);
                // An emitter's only point is lit by nothing else, whatever the materials.
                let end = if point.delta || both_diffuse() {
                    reconnect::to_light(self.scene, &vertex.surface, &surface, point)
                } else {
                    half_vector::extend(self.scene, &vertex.surface, (*wo, Lobe::Smooth), &surface)
                        .and_then(|extended| extended.end(self.scene, &surface, point))
                };
                self.add_end(of, prefix, end);
            }
        }
    }

    /// Follows the offset along a segment: adds the emitter at its end, and says how the offset stands at the
    /// next vertex.
    fn advance(&mut self, segment: Segment, state: State, next: Option<&Vertex>) -> States {
        let Segment { vertex, scatter } = segment;
        match state {
            State::Failed => {
                if let Some(emission) = &vertex.emission {
                    self.add_base_only(emitted(segment, emission));
                }
                self.add_ambient(segment, Contribution::alone);
                State::Failed.into()
            }
            State::Joined(prefix) => {
                self.go_on(segment, prefix, scatter.bsdf.weight * scatter.bsdf.pdf, scatter.bsdf.pdf)
            }
            State::Joining(prefix, wi) => {
                let moved = self.scene.bsdf(&vertex.surface).eval(&vertex.surface, wi, scatter.bsdf.wo);
                self.go_on(segment, prefix, moved.value, moved.pdf)
            }
            State::Apart(prefix, surface) => {
                if self.scatters_diffusely(scatter, vertex) && self.is_diffuse_at(&surface) {
                    if let Some(emission) = &vertex.emission {
                        let end = reconnect::to_light(self.scene, &vertex.surface, &surface, &emission.point);
                        self.add_end(emitted(segment, emission), prefix, end);
                    }
                    let (scene, from) = (self.scene, &vertex.surface);
                    self.add_ambient(segment, |of| {
                        of.end(prefix, reconnect::to_ambient(scene, from, scatter.bsdf.wo, &surface))
                    });
                    return next.map_or(State::Failed.into(), |next| self.join(segment, prefix, &surface, next));
                }
                let extended = self.extend(segment, &surface);
                if let Some(emission) = &vertex.emission {
                    let end = extended.as_ref().and_then(|found| found.end(self.scene, &surface, &emission.point));
                    self.add_end(emitted(segment, emission), prefix, end);
                }
                self.add_ambient(segment, |of| of.end(prefix, extended.as_ref().map(Extended::to_ambient)));
                extended.and_then(|extended| self.apart(segment, prefix, &extended)).into()
            }
        }
    }

    /// Both paths leave the same vertex in the same direction; the offset scatters there with `value` and `pdf`.
    fn go_on(&mut self, segment: Segment, prefix: Prefix, value: Rgb, pdf: f32) -> States {
        if let Some(emission) = &segment.vertex.emission {
            let offset = prefix.throughput * value * emission.radiance;
            self.add_pair(emitted(segment, emission), offset, prefix.ratio * (pdf + emission.light_pdf));
        }
        self.add_ambient(segment, |of| of.pair(prefix.throughput * value, prefix.ratio * pdf));
        segment.extend(prefix, value, pdf).map(State::Joined).into()
    }

    /// Over a segment between diffuse ends the base's next vertex is joined, unless it is glossy itself.
    fn join(&self, segment: Segment, prefix: Prefix, surface: &Surface, next: &Vertex) -> States {
        let light_joins = self.is_diffuse(next.roughness);
        let scatter_joins = next.scatter.as_ref().is_some_and(|scatter| self.scatters_diffusely(scatter, next));
        let mut states = States::from(State::Failed);
        if scatter_joins || (light_joins && next.light.is_some()) {
            let joined =
                Connection::new(self.scene, &segment.vertex.surface, surface, &next.surface).and_then(|found| {
                    let prefix = segment.extend(prefix, found.value * found.jacobian, found.pdf * found.jacobian)?;
                    Some(State::Joining(prefix, found.wi))
                });
            states = joined.into();
        }
        let light_apart = next.light.is_some() && !light_joins;
        let scatter_apart = next.scatter.as_ref().filter(|_| !scatter_joins);
        if !light_apart && scatter_apart.is_none() {
            return states;
        }
        let extended = self.extend(segment, surface);
        // Where the offset's own new vertex is diffuse, the way back would have joined it: there is none.
        let apart = |lobe: Lobe| {
            let extended = extended.as_ref()?;
            let joinable = lobe == Lobe::Smooth && extended.hit.as_ref().is_some_and(|hit| self.is_diffuse_at(hit));
            if joinable { None } else { self.apart(segment, prefix, extended) }
        };
        if light_apart {
            states.light = apart(Lobe::Smooth).unwrap_or(State::Failed);
        }
        if let Some(scatter) = scatter_apart {
            states.scatter = apart(scatter.bsdf.lobe).unwrap_or(State::Failed);
        }
        states
    }

    /// Where the offset goes by itself over a segment.
    fn extend(&self, segment: Segment, surface: &Surface) -> Option<Extended> {
        let sampled = &segment.scatter.bsdf;
        half_vector::extend(self.scene, &segment.vertex.surface, (sampled.wo, sampled.lobe), surface)
    }

    fn apart(&self, segment: Segment, prefix: Prefix, extended: &Extended) -> Option<State> {
        let Extended { copied, hit, .. } = extended;
        let prefix = segment.extend(prefix, copied.value * copied.jacobian, copied.pdf * copied.jacobian)?;
        Some(State::Apart(prefix, (*hit)?))
    }
}

/// The contribution of an emitter at the end of a segment.
fn emitted(segment: Segment, emission: &Emission) -> Contribution {
    contribution(segment, (emission.radiance, emission.light_pdf))
}

/// The contribution of light at the end of a segment, with the density of choosing it otherwise.
fn contribution(segment: Segment, (radiance, light_pdf): (Rgb, f32)) -> Contribution {
    let scale = 1.0 / segment.scatter.survival;
    Contribution { base: segment.base(radiance), density: segment.scatter.bsdf.pdf + light_pdf, scale }
}
