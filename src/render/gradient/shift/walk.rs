//! Follows base paths vertex by vertex with offsets beside them, and sums up what they differ by.

use super::End;
use super::half_vector::{self, Extended};
use super::reconnect::{Connections, Ends};
use crate::math::Rgb;
use crate::math::lanes::{LANES, Lanes, Lanes3, Mask};
use crate::render::gradient::offsets::{Offsets, Packet};
use crate::render::gradient::states::{Kind, Level, Prefix, Prefixes, States};
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

/// Offsets' own vertices, and where those go by themselves that are not connected.
#[derive(Default)]
pub struct Room {
    own: Packet,
    extended: Vec<(usize, Option<Extended>)>,
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
        room: &mut Room,
        segment: (&Vertices, &Onward),
        active: Mask,
        states: (&States, &States),
        next: (&mut Level, usize),
        offsets: &mut Offsets,
    ) -> Difference {
        step(self, room, segment, active, states, next, offsets)
    }

    #[inline(always)]
    fn diffuse(&self, roughness: Lanes) -> Mask {
        roughness.greater(Lanes::splat(self.threshold))
    }

    /// Where an offset goes by itself.
    fn extend(&self, base: &Surface, sampled: &BsdfSample, offset: &Surface) -> Option<Extended> {
        half_vector::extend(self.scene, base, (sampled.wo, sampled.lobe), offset)
    }
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn step(
    walk: &Walk,
    room: &mut Room,
    (vertices, onward): (&Vertices, &Onward),
    active: Mask,
    (light, scatter): (&States, &States),
    next: (&mut Level, usize),
    offsets: &mut Offsets,
) -> Difference {
    let (light_apart, apart) = (light.are(Kind::Apart), scatter.are(Kind::Apart));
    for lane in (active & (light_apart | apart)).lanes() {
        let place = if light_apart.get(lane) { light.place.0[lane] } else { scatter.place.0[lane] };
        let (surfaces, materials, from) = offsets.at(walk.base, place);
        room.own.surfaces.copy(lane, surfaces, from);
        room.own.materials.copy(lane, materials, from);
    }
    let lit = active & vertices.lit & light.inside();
    let chosen = if lit.any() { chosen_light(walk, vertices, &room.own, light, lit) } else { Lanes3::ZERO };
    let ambient = if walk.ambient { active } else { Mask::NONE };
    let going = active & scatter.inside() & vertices.scattered & (onward.exists | vertices.emits | ambient);
    if !going.any() {
        return Difference { light: chosen, ambient: Lanes3::ZERO };
    }
    let segment = Segment::new(walk, vertices, room, scatter, going);
    let difference = segment.differences(walk);
    segment.go_on(walk, onward, next, offsets);
    Difference { light: chosen + difference.light, ambient: difference.ambient }
}

/// Differences of the light of chosen emitter points.
#[inline(always)]
fn chosen_light(walk: &Walk, vertices: &Vertices, own: &Packet, states: &States, active: Mask) -> Lanes3 {
    let Vertices { surfaces, materials, light, throughput, .. } = vertices;
    let scene = walk.scene;
    let base = throughput.scale(light.evals.value).scale(light.radiance);
    let of = Contributions { base, density: light.pdf + light.evals.pdf, scale: Lanes::splat(1.0) };
    let mut ends = Ends::NONE;
    let apart = active & states.are(Kind::Apart);
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
    let joining = active & states.are(Kind::Joining);
    if joining.any() {
        let moved = materials.eval(scene, surfaces, (states.wi, light.wo), joining);
        ends.value = joining.select3(moved.value.scale(light.radiance), ends.value);
        ends.density = joining.select(light.pdf + light.points.scatter_pdf(moved.pdf), ends.density);
    }
    let joined = states.are(Kind::Joined);
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
    apart: Mask,
    /// Offsets that leave the same vertices in the same directions as their base paths: how they scatter there.
    along: Evals,
    /// Offsets apart that can be connected, where both paths scatter diffusely.
    connected: Mask,
    /// Where the others apart go by themselves.
    extended: &'a [(usize, Option<Extended>)],
}

impl<'a> Segment<'a> {
    #[inline(always)]
    fn new(walk: &Walk, vertices: &'a Vertices, room: &'a mut Room, states: &'a States, going: Mask) -> Self {
        let Room { own, extended } = room;
        let apart = going & states.are(Kind::Apart);
        let diffuse = walk.diffuse(vertices.materials.roughness) & walk.diffuse(own.materials.roughness);
        let connected = apart & diffuse & vertices.scatters.smooth();
        extended.clear();
        for lane in (apart & !connected).lanes() {
            let (base, offset) = (vertices.surfaces.get(lane), own.surfaces.get(lane));
            extended.push((lane, walk.extend(&base, &vertices.scatters.get(lane), &offset)));
        }
        let along = along(walk.scene, vertices, states, going);
        Self { vertices, own, states, going, apart, along, connected, extended }
    }

    /// Differences of the emitters at the segments' ends.
    #[inline(always)]
    fn differences(&self, walk: &Walk) -> Difference {
        let Self { vertices, own, going, apart, connected, .. } = *self;
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
            difference.light = self.emitted(emits, (emission.radiance, emission.light_pdf), ends);
        }
        if walk.ambient {
            let mut ends = Ends::NONE;
            let wo = own.surfaces.frame.to_local(vertices.surfaces.frame.to_world(vertices.scatters.wo));
            let evals = own.materials.eval(walk.scene, &own.surfaces, (own.surfaces.wi, wo), connected);
            ends.value = connected.select3(evals.value, ends.value);
            ends.density = connected.select(evals.pdf, ends.density);
            self.extend_ends(&mut ends, apart, |found, _, _| Some(found.to_ambient()));
            difference.ambient = self.emitted(going, (Lanes3::splat(Rgb::ONE), Lanes::ZERO), ends);
        }
        difference
    }

    fn extend_ends(&self, ends: &mut Ends, of: Mask, end: impl Fn(&Extended, &Surface, usize) -> Option<End>) {
        for (lane, extended) in self.extended.iter().filter(|(lane, _)| of.get(*lane)) {
            if let Some(extended) = extended {
                ends.set(*lane, end(extended, &self.own.surfaces.get(*lane), *lane));
            }
        }
    }

    /// Differences of emitters at the segments' ends, which offsets apart receive as `ends`.
    #[inline(always)]
    fn emitted(&self, active: Mask, (radiance, light_pdf): (Lanes3, Lanes), ends: Ends) -> Lanes3 {
        let Self { vertices, states, along, apart, .. } = self;
        let scale = Lanes::splat(1.0) / vertices.survival;
        let pdf = vertices.scatters.pdf;
        let base = vertices.throughput.scale(vertices.scatters.weight).scale(radiance) * (pdf * scale);
        let of = Contributions { base, density: pdf + light_pdf, scale };
        let beside = !(*apart | states.are(Kind::Failed));
        let value = beside.select3(along.value.scale(radiance), ends.value);
        let density = beside.select(along.pdf + light_pdf, ends.density);
        let differences = of.differences(states.prefix.throughput.scale(value), states.prefix.ratio * density);
        active.select3(differences, Lanes3::ZERO)
    }

    /// How the offsets stand at the next vertices.
    #[inline(always)]
    fn go_on(&self, walk: &Walk, onward: &Onward, (next, edge): (&mut Level, usize), offsets: &mut Offsets) {
        let going = self.going & onward.exists;
        let (prefix, carried) = self.beyond(self.along);
        let carried = carried & !self.states.are(Kind::Failed);
        for lane in (going & !self.apart).lanes() {
            let (states, to) = next.at(self.vertices.next.0[lane], edge);
            match carried.get(lane) {
                true => states.follow(to, prefix.get(lane)),
                false => states.fail(to),
            }
        }
        let apart = going & self.apart;
        if !apart.any() {
            return;
        }
        let joins = apart & self.connected & (onward.scatter_joins | (onward.light_joins & onward.lit));
        let found = Connections::new(walk.scene, self.vertices.surfaces.p, self.own, &onward.surfaces, joins);
        let (prefix, carried) = self.beyond(Evals { value: found.value, pdf: found.pdf });
        let joined = carried & found.possible;
        for lane in (apart & self.connected).lanes() {
            let (states, to) = next.at(self.vertices.next.0[lane], edge);
            match joined.get(lane) {
                true => states.join(to, prefix.get(lane), found.wi.get(lane)),
                false => states.fail(to),
            }
        }
        self.go_on_apart(walk, onward, (next, edge), offsets);
    }

    /// Prefixes behind the segments, over which offsets scatter so, and which carry anything.
    #[inline(always)]
    fn beyond(&self, offset: Evals) -> (Prefixes, Mask) {
        let pdf = self.vertices.scatters.pdf;
        let inverse = Lanes::splat(1.0) / (pdf * self.vertices.survival);
        self.states.prefix.extended(offset.value * inverse, offset.pdf / pdf)
    }

    /// Offsets apart that stay so: those that are not connected, and those of which the base path's next vertex is glossy
    /// itself.
    fn go_on_apart(&self, walk: &Walk, onward: &Onward, (next, edge): (&mut Level, usize), offsets: &mut Offsets) {
        for (lane, extended) in self.extended.iter().filter(|(lane, _)| onward.exists.get(*lane)) {
            let kept = extended.as_ref().and_then(|extended| self.apart(*lane, extended));
            let place = kept.map(|(prefix, hit)| (prefix, offsets.push(walk.scene, walk.base.len(), &hit)));
            let (states, to) = next.at(self.vertices.next.0[*lane], edge);
            match place {
                Some((prefix, place)) => states.part(to, prefix, place),
                None => states.fail(to),
            }
        }
        let light_apart = onward.lit & !onward.light_joins;
        let scatter_apart = onward.scattered & !onward.scatter_joins;
        for lane in (self.going & onward.exists & self.connected & (light_apart | scatter_apart)).lanes() {
            let place = self.vertices.next.0[lane];
            let (base, offset) = (self.vertices.surfaces.get(lane), self.own.surfaces.get(lane));
            let extended = walk.extend(&base, &self.vertices.scatters.get(lane), &offset);
            let kept = extended.as_ref().and_then(|extended| {
                let (prefix, hit) = self.apart(lane, extended)?;
                Some((prefix, offsets.push(walk.scene, walk.base.len(), &hit), hit))
            });
            // Where the offset's own new vertex is diffuse, the way back would have joined it: there is none.
            let joinable = |hit: &Surface, lobe: Lobe| {
                let roughness = walk.scene.bsdf(hit).roughness(hit);
                lobe == Lobe::Smooth && roughness.is_some_and(|roughness| roughness > walk.threshold)
            };
            let stand = |(states, to): (&mut States, usize), lobe| match &kept {
                Some((prefix, place, hit)) if !joinable(hit, lobe) => states.part(to, *prefix, *place),
                _ => states.fail(to),
            };
            match (light_apart.get(lane), scatter_apart.get(lane)) {
                (true, false) => {
                    let joined = next.at(place, edge).0.clone();
                    let (continued, to) = next.continued_at(place, edge);
                    continued.copy(to, &joined);
                    stand(next.at(place, edge), Lobe::Smooth);
                }
                (both, _) => {
                    if both {
                        stand(next.at(place, edge), Lobe::Smooth);
                    }
                    let there = &walk.below[place as usize / LANES].scatters;
                    stand(next.continued_at(place, edge), there.get(place as usize % LANES).lobe);
                }
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
#[inline(always)]
fn along(scene: &Scene, vertices: &Vertices, states: &States, going: Mask) -> Evals {
    let Vertices { surfaces, materials, scatters, .. } = vertices;
    let mut along = Evals { value: scatters.weight * scatters.pdf, pdf: scatters.pdf };
    let joining = going & states.are(Kind::Joining);
    if joining.any() {
        let moved = materials.eval(scene, surfaces, (states.wi, scatters.wo), joining);
        along.value = joining.select3(moved.value, along.value);
        along.pdf = joining.select(moved.pdf, along.pdf);
    }
    along
}
