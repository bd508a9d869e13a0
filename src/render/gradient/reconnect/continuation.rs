//! Offsets on the way to the next vertices of their base paths: connected, extended or failed.

use super::connection::Connections;
use super::half_vector::Extension;
use super::offsets::OffsetSurfaces;
use super::segment::{NextVertices, OffsetSegment, ShiftContext};
use super::states::{Kind, LevelStates, Prefix, Prefixes, States};
use crate::math::lanes::{LANES, Lanes, Mask};
use crate::scene::Surface;
use crate::scene::bsdf::Lobe;
use crate::scene::closure::Evals;

impl OffsetSegment<'_> {
    /// Sets the states of the offsets at the next vertices, across a half-edge of each path.
    #[inline(always)]
    pub fn continue_offsets(
        &self,
        context: &ShiftContext,
        next: &NextVertices,
        (states, slot): (&mut LevelStates, usize),
        offsets: &mut OffsetSurfaces,
    ) {
        let leaving = self.leaving & next.exists;
        let (prefix, carried) = self.extended_prefix(self.base_scatter);
        let carried = carried & !self.states.are(Kind::Failed);
        for lane in (leaving & !self.unconnected).lanes() {
            let (states, to) = states.at(self.vertices.next.0[lane], slot);
            match carried.get(lane) {
                true => states.set_connected(to, prefix.get(lane)),
                false => states.fail(to),
            }
        }
        let unconnected = leaving & self.unconnected;
        if !unconnected.any() {
            return;
        }
        let connects = unconnected & self.connectable & (next.connects_scatter | (next.connects_light & next.lit));
        let found = Connections::new(context.scene, self.vertices.surfaces.p, self.offset, &next.surfaces, connects);
        let (prefix, carried) = self.extended_prefix(Evals { value: found.value, pdf: found.pdf });
        let connected = carried & found.possible;
        for lane in (unconnected & self.connectable).lanes() {
            let (states, to) = states.at(self.vertices.next.0[lane], slot);
            match connected.get(lane) {
                true => states.set_just_connected(to, prefix.get(lane), found.wi.get(lane)),
                false => states.fail(to),
            }
        }
        self.continue_extended(next, (states, slot), (context, offsets));
        self.continue_unconnected(context, next, (states, slot), offsets);
    }

    /// Prefixes behind the segments, over which the offsets scatter as given, and the lanes that carry light on.
    #[inline(always)]
    fn extended_prefix(&self, offset: Evals) -> (Prefixes, Mask) {
        let pdf = self.vertices.scatters.pdf;
        let inverse = Lanes::splat(1.0) / (pdf * self.vertices.survival);
        self.states.prefix.extended(offset.value * inverse, offset.pdf / pdf)
    }

    /// Offsets that cannot be connected over this segment keep a vertex of their own.
    fn continue_extended(
        &self,
        next: &NextVertices,
        (states, slot): (&mut LevelStates, usize),
        (context, offsets): (&ShiftContext, &mut OffsetSurfaces),
    ) {
        for (lane, extension) in self.extensions.iter().filter(|(lane, _)| next.exists.get(*lane)) {
            let kept = extension.as_ref().and_then(|extension| self.own_vertex(*lane, extension));
            let kept = kept.map(|(prefix, hit)| (prefix, offsets.push(context.scene, context.base.len(), &hit)));
            let (states, to) = states.at(self.vertices.next.0[*lane], slot);
            match kept {
                Some((prefix, vertex_index)) => states.set_unconnected(to, prefix, vertex_index),
                None => states.fail(to),
            }
        }
    }

    /// Offsets that could be connected stay unconnected where the base path's next vertex is glossy itself, for its light,
    /// its continuation, or both.
    fn continue_unconnected(
        &self,
        context: &ShiftContext,
        next: &NextVertices,
        (states, slot): (&mut LevelStates, usize),
        offsets: &mut OffsetSurfaces,
    ) {
        let light = next.lit & !next.connects_light;
        let scatter = next.scattered & !next.connects_scatter;
        for lane in (self.leaving & next.exists & self.connectable & (light | scatter)).lanes() {
            let next_vertex = self.vertices.next.0[lane];
            let (base, offset) = (self.vertices.surfaces.get(lane), self.offset.surfaces.get(lane));
            let extension = context.extend(&base, &self.vertices.scatters.get(lane), &offset);
            let kept = extension.as_ref().and_then(|extension| {
                let (prefix, hit) = self.own_vertex(lane, extension)?;
                Some((prefix, offsets.push(context.scene, context.base.len(), &hit), hit))
            });
            // If the offset's own new vertex is diffuse, the inverse shift would connect to it: this one must fail.
            let connectable = |hit: &Surface, lobe: Lobe| {
                let roughness = context.scene.bsdf(hit).roughness(hit);
                lobe == Lobe::Smooth && roughness.is_some_and(|roughness| roughness > context.threshold)
            };
            let set = |(states, to): (&mut States, usize), lobe| match &kept {
                Some((prefix, vertex_index, hit)) if !connectable(hit, lobe) => {
                    states.set_unconnected(to, *prefix, *vertex_index);
                }
                _ => states.fail(to),
            };
            if light.get(lane) {
                set(states.at(next_vertex, slot), Lobe::Smooth);
            }
            if scatter.get(lane) {
                let there = &context.below[next_vertex as usize / LANES].scatters;
                set(states.at_for_scatter(next_vertex, slot), there.get(next_vertex as usize % LANES).lobe);
            }
        }
    }

    /// Prefix and vertex of an offset behind an extension, if it hits a surface and carries light on.
    fn own_vertex(&self, lane: usize, Extension { copied, hit, .. }: &Extension) -> Option<(Prefix, Surface)> {
        let (pdf, survival) = (self.vertices.scatters.pdf.0[lane], self.vertices.survival.0[lane]);
        let value = copied.value * copied.jacobian / (pdf * survival);
        let prefix = self.states.prefix.get(lane).extended(value, copied.pdf * copied.jacobian / pdf)?;
        Some((prefix, (*hit)?))
    }
}
