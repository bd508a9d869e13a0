//! Follows base paths vertex by vertex with offsets beside them, and sums up what they differ by.

use super::End;
use super::half_vector::{self, Extended};
use super::reconnect::{Connections, Ends};
use crate::math::Rgb;
use crate::math::lanes::{LANES, Lanes, Lanes3, Mask};
use crate::render::gradient::offsets::{Offsets, Packet};
use crate::render::gradient::states::{Level, Prefix, Prefixes, States};
use crate::render::vertices::Vertices;
use crate::scene::bsdf::{BsdfSample, Lobe};
use crate::scene::packet::{Evals, Surfaces};
use crate::scene::{Scene, Surface};

/// Shares of (neighbour - pixel) by reconnection: sums of (J f(y) - f(x)) / D over the contributions so far, D being the
/// sum of both paths' densities.
#[derive(Clone, Copy)]
pub struct Difference {
    /// Of the scene's light.
    pub light: Lanes3,
    /// Of the ambient one, if it is asked for.
    pub ambient: Lanes3,
}

/// Contributions of base paths: f(x) before division by `density`, the sum of their strategies'.
#[derive(Clone, Copy)]
struct Contributions {
    base: Lanes3,
    density: Lanes,
    /// What is divided by besides densities, inverted.
    scale: Lanes,
}

impl Contributions {
    /// Differences to J f(y), of J times the density given, both relative to the base's prefix; to nothing where the
    /// offset carries nothing.
    #[inline(always)]
    fn differences(&self, offset: Lanes3, density: Lanes) -> Lanes3 {
        let pair = offset.nonzero() & density.greater(Lanes::ZERO);
        let other = pair.select3(offset * self.scale, Lanes3::ZERO);
        let densities = self.density + pair.select(density, Lanes::ZERO);
        (other - self.base) * (Lanes::splat(1.0) / densities)
    }
}

/// What the segments from some vertices lead to, as far as light reaches.
pub struct Onward {
    /// Which lead to another vertex.
    exists: Mask,
    /// The surfaces there, where an offset is apart.
    surfaces: Surfaces,
    /// Where the chosen light is joined, and where there is one.
    light_joins: Mask,
    lit: Mask,
    /// Where the continuation is joined, and where there is one.
    scatter_joins: Mask,
    scattered: Mask,
}

/// A level of a wave's paths that is being walked along.
pub struct Walk<'a> {
    /// What is traced.
    pub scene: &'a Scene,
    /// Smooth lobes of roughness above it count as diffuse.
    pub threshold: f32,
    /// Whether differences of the ambient light are asked for.
    pub ambient: bool,
    /// The first vertices of all paths.
    pub base: &'a [Vertices],
    /// The next level.
    pub below: &'a [Vertices],
}

impl Walk<'_> {
    /// What the vertices of `active` paths lead to; `apart` are those that offsets may have to be connected to. `reaches`
    /// says whether light reaches the next vertex of a sample's path.
    pub fn onward(&self, vertices: &Vertices, active: Mask, apart: Mask, reaches: impl Fn(u32) -> bool) -> Onward {
        let none = Mask::NONE;
        let mut onward = Onward {
            exists: none,
            surfaces: Surfaces::default(),
            light_joins: none,
            lit: none,
            scatter_joins: none,
            scattered: none,
        };
        for lane in (active & vertices.scattered).lanes().filter(|&lane| reaches(vertices.id.0[lane])) {
            let (packet, place) = (vertices.next.0[lane] as usize / LANES, vertices.next.0[lane] as usize % LANES);
            let Some(there) = self.below.get(packet).filter(|there| there.met.get(place)) else { continue };
            onward.exists.set(lane, true);
            if apart.get(lane) {
                onward.surfaces.copy(lane, &there.surfaces, place);
                let diffuse = there.materials.roughness.0[place] > self.threshold;
                let smooth = there.scatters.smooth().get(place);
                onward.light_joins.set(lane, diffuse);
                onward.lit.set(lane, there.lit.get(place));
                onward.scattered.set(lane, there.scattered.get(place));
                onward.scatter_joins.set(lane, diffuse && smooth && there.scattered.get(place));
            }
        }
        onward
    }

    /// Takes the offsets across one edge from some vertices of active paths to the next ones: returns the differences of
    /// the lights chosen there and of the emitters met next, and says in `next` how the offsets stand there.
    pub fn step(
        &self,
        vertices: &Vertices,
        onward: &Onward,
        active: Mask,
        (light, scatter): (&States, &States),
        next: (&mut Level, usize),
        offsets: &mut Offsets,
    ) -> Difference {
        let mut own = Packet::default();
        for lane in (active & (light.apart | scatter.apart)).lanes() {
            let place = if light.apart.get(lane) { light.place.0[lane] } else { scatter.place.0[lane] };
            let (surfaces, materials, from) = offsets.at(self.base, place);
            own.surfaces.copy(lane, surfaces, from);
            own.materials.copy(lane, materials, from);
        }
        let lit = active & vertices.lit & light.inside;
        let chosen = if lit.any() { chosen_light(self, vertices, &own, light, lit) } else { Lanes3::ZERO };
        let ambient = if self.ambient { active } else { Mask::NONE };
        let going = active & scatter.inside & vertices.scattered & (onward.exists | vertices.emits | ambient);
        if !going.any() {
            return Difference { light: chosen, ambient: Lanes3::ZERO };
        }
        let mut segment = Segment::new(self, vertices, &own, scatter, going);
        let difference = segment.differences(self);
        segment.go_on(self, onward, next, offsets);
        Difference { light: chosen + difference.light, ambient: difference.ambient }
    }

    fn diffuse(&self, roughness: Lanes) -> Mask {
        roughness.greater(Lanes::splat(self.threshold))
    }

    /// Where an offset goes by itself.
    fn extend(&self, base: &Surface, sampled: &BsdfSample, offset: &Surface) -> Option<Extended> {
        half_vector::extend(self.scene, base, (sampled.wo, sampled.lobe), offset)
    }
}

/// Differences of the light of chosen emitter points.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn chosen_light(walk: &Walk, vertices: &Vertices, own: &Packet, states: &States, active: Mask) -> Lanes3 {
    let Vertices { surfaces, materials, light, throughput, .. } = vertices;
    let scene = walk.scene;
    let base = throughput.scale(light.evals.value).scale(light.radiance);
    let of = Contributions { base, density: light.pdf + light.evals.pdf, scale: Lanes::splat(1.0) };
    let mut ends = Ends::NONE;
    let apart = active & states.apart;
    if apart.any() {
        let both_diffuse = walk.diffuse(materials.roughness) & walk.diffuse(own.materials.roughness);
        // An emitter's only point is lit by nothing else, whatever the materials.
        let connected = apart & (light.points.delta | both_diffuse);
        ends = Ends::to_lights(scene, surfaces.p, own, &light.points, connected);
        for lane in (apart & !connected).lanes() {
            let (base, offset) = (surfaces.get(lane), own.surfaces.get(lane));
            let extended = half_vector::extend(scene, &base, (light.wo.get(lane), Lobe::Smooth), &offset);
            ends.set(lane, extended.and_then(|found| found.end(scene, &offset, &light.points.get(lane))));
        }
    }
    let joining = active & states.joining;
    if joining.any() {
        let moved = materials.eval(scene, surfaces, (states.wi, light.wo), joining);
        ends.value = joining.select3(moved.value.scale(light.radiance), ends.value);
        ends.density = joining.select(light.pdf + light.points.scatter_pdf(moved.pdf), ends.density);
    }
    let joined = states.joined;
    let value = joined.select3(light.evals.value.scale(light.radiance), ends.value);
    let density = joined.select(of.density, ends.density);
    let differences = of.differences(states.prefix.throughput.scale(value), states.prefix.ratio * density);
    active.select3(differences, Lanes3::ZERO)
}

/// Segments of base paths with the offsets beside them.
struct Segment<'a> {
    vertices: &'a Vertices,
    own: &'a Packet,
    states: &'a States,
    going: Mask,
    /// Offsets that leave the same vertices in the same directions as their base paths: how they scatter there.
    along: Evals,
    /// Offsets that can be connected, where both paths scatter diffusely.
    connected: Mask,
    /// Where the others apart go by themselves.
    extended: [Option<Extended>; LANES],
}

impl<'a> Segment<'a> {
    fn new(walk: &Walk, vertices: &'a Vertices, own: &'a Packet, states: &'a States, going: Mask) -> Self {
        let apart = going & states.apart;
        let diffuse = walk.diffuse(vertices.materials.roughness) & walk.diffuse(own.materials.roughness);
        let connected = apart & diffuse & vertices.scatters.smooth();
        let mut extended = [None; LANES];
        for lane in (apart & !connected).lanes() {
            let (base, offset) = (vertices.surfaces.get(lane), own.surfaces.get(lane));
            extended[lane] = walk.extend(&base, &vertices.scatters.get(lane), &offset);
        }
        let along = along(walk.scene, vertices, states, going);
        Self { vertices, own, states, going, along, connected, extended }
    }

    /// Differences of the emitters at the segments' ends.
    fn differences(&mut self, walk: &Walk) -> Difference {
        let Self { vertices, own, states, going, connected, .. } = *self;
        let mut difference = Difference { light: Lanes3::ZERO, ambient: Lanes3::ZERO };
        let emits = going & vertices.emits;
        if emits.any() {
            let emission = &vertices.emission;
            let mut ends = Ends::NONE;
            if (emits & connected).any() {
                let base = vertices.surfaces.p;
                ends = Ends::to_lights(walk.scene, base, own, &emission.points, emits & connected);
            }
            let point = |lane| emission.points.get(lane);
            self.extend_ends(&mut ends, emits, |found, offset, lane| found.end(walk.scene, offset, &point(lane)));
            difference.light = emitted(self, emits, (emission.radiance, emission.light_pdf), ends);
        }
        if walk.ambient {
            let mut ends = Ends::NONE;
            let wo = own.surfaces.frame.to_local(vertices.surfaces.frame.to_world(vertices.scatters.wo));
            let evals = own.materials.eval(walk.scene, &own.surfaces, (own.surfaces.wi, wo), connected);
            ends.value = connected.select3(evals.value, ends.value);
            ends.density = connected.select(evals.pdf, ends.density);
            self.extend_ends(&mut ends, going & states.apart, |found, _, _| Some(found.to_ambient()));
            let white = (Lanes3::splat(Rgb::ONE), Lanes::ZERO);
            difference.ambient = emitted(self, going, white, ends);
        }
        difference
    }

    fn extend_ends(&self, ends: &mut Ends, of: Mask, end: impl Fn(&Extended, &Surface, usize) -> Option<End>) {
        for lane in of.lanes() {
            if let Some(extended) = &self.extended[lane] {
                ends.set(lane, end(extended, &self.own.surfaces.get(lane), lane));
            }
        }
    }

    /// How the offsets stand at the next vertices.
    fn go_on(&self, walk: &Walk, onward: &Onward, (next, edge): (&mut Level, usize), offsets: &mut Offsets) {
        let going = self.going & onward.exists;
        let states = self.states;
        let beside = Beside::new(self);
        for lane in (going & !states.apart).lanes() {
            let (states, to) = next.at(self.vertices.next.0[lane], edge);
            for states in states {
                match beside.carried.get(lane) {
                    true => states.follow(to, beside.prefix.get(lane)),
                    false => states.fail(to),
                }
            }
        }
        let apart = going & states.apart;
        if !apart.any() {
            return;
        }
        let joins = apart & self.connected & (onward.scatter_joins | (onward.light_joins & onward.lit));
        let joined = join(walk.scene, self, onward, joins);
        for lane in apart.lanes() {
            let (states, to) = next.at(self.vertices.next.0[lane], edge);
            let [light, scatter] = states;
            if !self.connected.get(lane) {
                let kept = self.extended[lane].as_ref().and_then(|extended| self.apart(lane, extended));
                let place = kept.map(|(prefix, hit)| (prefix, offsets.push(walk.scene, walk.base.len(), &hit)));
                for states in [light, scatter] {
                    match place {
                        Some((prefix, place)) => states.part(to, prefix, place),
                        None => states.fail(to),
                    }
                }
                continue;
            }
            for states in [&mut *light, &mut *scatter] {
                match joined.carried.get(lane) {
                    true => states.join(to, joined.prefix.get(lane), joined.wi.get(lane)),
                    false => states.fail(to),
                }
            }
            // The next vertex is joined, unless it is glossy itself.
            let light_apart = onward.lit.get(lane) && !onward.light_joins.get(lane);
            let scatter_apart = onward.scattered.get(lane) && !onward.scatter_joins.get(lane);
            if light_apart || scatter_apart {
                let (light, scatter) = (light_apart.then_some(light), scatter_apart.then_some(scatter));
                self.go_on_apart(walk, lane, (light, scatter, to), offsets);
            }
        }
    }

    /// An offset goes on by itself although both paths scatter diffusely, as the next vertex of the base path is glossy.
    fn go_on_apart(
        &self,
        walk: &Walk,
        lane: usize,
        (light, scatter, to): (Option<&mut States>, Option<&mut States>, usize),
        offsets: &mut Offsets,
    ) {
        let (base, offset) = (self.vertices.surfaces.get(lane), self.own.surfaces.get(lane));
        let extended = walk.extend(&base, &self.vertices.scatters.get(lane), &offset);
        let next_lobe = walk.below[self.vertices.next.0[lane] as usize / LANES]
            .scatters
            .get(self.vertices.next.0[lane] as usize % LANES)
            .lobe;
        let place = extended.as_ref().and_then(|extended| {
            let (prefix, hit) = self.apart(lane, extended)?;
            Some((prefix, offsets.push(walk.scene, walk.base.len(), &hit), hit))
        });
        for (states, lobe) in [(light, Lobe::Smooth), (scatter, next_lobe)] {
            let Some(states) = states else { continue };
            // Where the offset's own new vertex is diffuse, the way back would have joined it: there is none.
            let joinable = |hit: &Surface| {
                let roughness = walk.scene.bsdf(hit).roughness(hit);
                lobe == Lobe::Smooth && roughness.is_some_and(|roughness| roughness > walk.threshold)
            };
            match &place {
                Some((prefix, place, hit)) if !joinable(hit) => states.part(to, *prefix, *place),
                _ => states.fail(to),
            }
        }
    }

    /// The prefix and the vertex of an offset that has gone by itself.
    fn apart(&self, lane: usize, Extended { copied, hit, .. }: &Extended) -> Option<(Prefix, Surface)> {
        let (pdf, survival) = (self.vertices.scatters.pdf.0[lane], self.vertices.survival.0[lane]);
        let value = copied.value * copied.jacobian / (pdf * survival);
        let prefix = self.states.prefix.get(lane).extended(value, copied.pdf * copied.jacobian / pdf)?;
        Some((prefix, (*hit)?))
    }
}

/// How offsets scatter that leave the same vertices in the same directions as their base paths.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn along(scene: &Scene, vertices: &Vertices, states: &States, going: Mask) -> Evals {
    let Vertices { surfaces, materials, scatters, .. } = vertices;
    let mut along = Evals { value: scatters.weight * scatters.pdf, pdf: scatters.pdf };
    let joining = going & states.joining;
    if joining.any() {
        let moved = materials.eval(scene, surfaces, (states.wi, scatters.wo), joining);
        along.value = joining.select3(moved.value, along.value);
        along.pdf = joining.select(moved.pdf, along.pdf);
    }
    along
}

/// Differences of emitters at the segments' ends, which offsets apart receive as `ends`.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn emitted(segment: &Segment, active: Mask, (radiance, light_pdf): (Lanes3, Lanes), ends: Ends) -> Lanes3 {
    let Segment { vertices, states, along, .. } = segment;
    let scale = Lanes::splat(1.0) / vertices.survival;
    let pdf = vertices.scatters.pdf;
    let base = vertices.throughput.scale(vertices.scatters.weight).scale(radiance) * (pdf * scale);
    let of = Contributions { base, density: pdf + light_pdf, scale };
    let beside = states.joining | states.joined;
    let value = beside.select3(along.value.scale(radiance), ends.value);
    let density = beside.select(along.pdf + light_pdf, ends.density);
    let differences = of.differences(states.prefix.throughput.scale(value), states.prefix.ratio * density);
    active.select3(differences, Lanes3::ZERO)
}

/// Prefixes behind a segment, and which carry anything.
struct Beside {
    prefix: Prefixes,
    carried: Mask,
    wi: Lanes3,
}

impl Beside {
    /// Of offsets that follow their base paths.
    fn new(segment: &Segment) -> Self {
        follow(segment)
    }
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn follow(segment: &Segment) -> Beside {
    let Segment { vertices, states, along, .. } = segment;
    let pdf = vertices.scatters.pdf;
    let inverse = Lanes::splat(1.0) / (pdf * vertices.survival);
    let (prefix, carried) = states.prefix.extended(along.value * inverse, along.pdf / pdf);
    Beside { prefix, carried: carried & (states.joining | states.joined), wi: Lanes3::ZERO }
}

/// Prefixes of offsets that are connected to their base paths' next vertices.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn join(scene: &Scene, segment: &Segment, onward: &Onward, joins: Mask) -> Beside {
    let Segment { vertices, own, states, .. } = segment;
    let found = Connections::new(scene, vertices.surfaces.p, own, &onward.surfaces, joins);
    let pdf = vertices.scatters.pdf;
    let inverse = Lanes::splat(1.0) / (pdf * vertices.survival);
    let (prefix, carried) = states.prefix.extended(found.value * inverse, found.pdf / pdf);
    Beside { prefix, carried: carried & found.possible, wi: found.wi }
}
