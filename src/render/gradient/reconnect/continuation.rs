//! Offsets on the way to the next vertices of their base paths: connected, extended or closed.

use super::SegmentDifferences;
use super::segment::Segment;
use super::states::{LevelStates, Prefixes};
use crate::math::lanes::{Lanes, Lanes3, Mask};
use crate::scene::closure::Evals;

impl Segment<'_> {
    /// Sets the states of the offsets at the next vertices, across a half-edge of each path. Returns all further differences of the
    /// offsets that are closed there.
    #[inline(always)]
    pub fn continue_offsets(&self, states: (&mut LevelStates, usize)) -> SegmentDifferences {
        let exists = self.leaving & self.next.exists;
        let (joined, unconnected) = (exists & !self.unconnected, exists & self.unconnected);
        let mut closed = SegmentDifferences::NONE;
        if joined.any() {
            closed = self.joined(joined);
        }
        if unconnected.any() {
            closed += self.continue_unconnected(unconnected, states);
        }
        closed
    }

    /// All further differences of just connected offsets: from the next vertices on they are their base paths.
    #[inline(always)]
    fn joined(&self, lanes: Mask) -> SegmentDifferences {
        let (prefix, carried) = self.extended_prefix(self.moved);
        let base = self.next.throughput;
        // A colour that only one of the two paths has left lets only that one go on, so that the other has to count alone.
        let shared = carried & prefix.throughput.same_zeros(base);
        let share = Lanes::splat(1.0) / (Lanes::splat(1.0) + prefix.ratio);
        let apart = shared.select3((prefix.throughput - base) * share, -base);
        let apart = lanes.select3(apart, Lanes3::ZERO);
        let received = &self.next.received;
        SegmentDifferences { color: apart.scale(received.total()), ambient: apart.scale(received.ambient) }
    }

    /// All further differences of offsets that have failed, for the light or for the continuation of the next vertices.
    #[inline(always)]
    fn failed(&self, light: Mask, scatter: Mask) -> SegmentDifferences {
        let received = &self.next.received;
        let lost = light.select3(received.sampled, Lanes3::ZERO) + scatter.select3(received.scattered, Lanes3::ZERO);
        let base = -self.next.throughput;
        let ambient = scatter.select3(base.scale(received.ambient), Lanes3::ZERO);
        SegmentDifferences { color: (light | scatter).select3(base.scale(lost), Lanes3::ZERO), ambient }
    }

    /// Offsets are connected where they can be, but not to a glossy next vertex: for its light, its continuation, or both, they
    /// keep a vertex of their own, as do offsets that cannot be connected over this segment.
    #[inline(always)]
    fn continue_unconnected(&self, lanes: Mask, (states, slot): (&mut LevelStates, usize)) -> SegmentDifferences {
        let Self { vertices, next, extended, .. } = *self;
        let connectable = lanes & self.connected.connectable;
        let to_vertices = &self.connected.next;
        let (mut connected, mut joint) = (Mask::NONE, None);
        if to_vertices.possible.any() {
            let (prefix, carried) = self.extended_prefix(Evals { value: to_vertices.value, pdf: to_vertices.pdf });
            connected = lanes & carried & to_vertices.possible;
            joint = Some((prefix, to_vertices.wi));
        }
        let (prefix, carried) = self.extended_prefix(Evals { value: extended.value, pdf: extended.pdf });
        let kept = lanes & carried & extended.possible & extended.hit;
        // If the offset's own new vertex is diffuse, the inverse shift would connect to it: this one must fail.
        let own_light = kept & (!connectable | (next.glossy_light & !extended.diffuse));
        let own_scatter = kept & (!connectable | (next.glossy_scatter & !(next.smooth & extended.diffuse)));
        let (joint_light, joint_scatter) = (connected & !next.glossy_light, connected & !next.glossy_scatter);
        if let Some((prefix, wi)) = joint {
            for lane in joint_light.lanes() {
                let (states, to) = states.at(vertices.next.0[lane], slot);
                states.set_just_connected(to, prefix.get(lane), wi.get(lane));
            }
            for lane in (joint_scatter & !joint_light).lanes() {
                let (states, to) = states.at_for_scatter(vertices.next.0[lane], slot);
                states.set_just_connected(to, prefix.get(lane), wi.get(lane));
            }
        }
        for lane in own_light.lanes() {
            let (states, to) = states.at(vertices.next.0[lane], slot);
            states.set_unconnected(to, prefix.get(lane), extended.vertex_index.0[lane]);
        }
        for lane in (own_scatter & !own_light).lanes() {
            let (states, to) = states.at_for_scatter(vertices.next.0[lane], slot);
            states.set_unconnected(to, prefix.get(lane), extended.vertex_index.0[lane]);
        }
        let (light_fails, scatter_fails) = (lanes & !(own_light | joint_light), lanes & !(own_scatter | joint_scatter));
        for lane in (scatter_fails & !light_fails).lanes() {
            let (states, to) = states.at_for_scatter(vertices.next.0[lane], slot);
            states.close(to);
        }
        self.failed(light_fails, scatter_fails)
    }

    /// Prefixes behind the segments, over which the offsets scatter as given, and the lanes that carry light on.
    #[inline(always)]
    fn extended_prefix(&self, offset: Evals) -> (Prefixes, Mask) {
        let pdf = self.vertices.scatters.pdf;
        let inverse = Lanes::splat(1.0) / (pdf * self.vertices.survival);
        self.states.prefix.extended(offset.value * inverse, offset.pdf / pdf)
    }
}
