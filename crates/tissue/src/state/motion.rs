//! A body's motion in double precision and node order: what other integrators work on.

use super::body_state::BodyState;
use super::friction::{Anchor, Source};
use crate::Body;
use glam::{DVec3, Vec3A};

/// The motion of a body in double precision, in node order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BodyMotion {
    /// Positions relative to [`Body::origin`] (m).
    pub positions: Vec<DVec3>,
    /// Velocities (m/s).
    pub velocities: Vec<DVec3>,
    /// Where friction holds each node at each support, relative to [`Body::origin`] (m), support by
    /// support; empty if it holds none.
    pub anchors: Vec<Option<DVec3>>,
}

impl BodyMotion {
    /// Takes the motion over from a body's state.
    pub(crate) fn load(&mut self, body: &Body, state: &BodyState) {
        let vertices = || body.internal.iter().map(|i| *i as usize);
        self.positions.clear();
        self.positions.extend(vertices().map(|i| state.x[i].as_dvec3()));
        self.velocities.clear();
        self.velocities.extend(vertices().map(|i| state.v[i].as_dvec3()));
        let nodes = body.nodes_of_vertices();
        self.anchors.clear();
        self.anchors.resize(body.supports.len() * body.len(), None);
        for anchor in &state.anchors {
            if let Source::Support(s) = anchor.source {
                let k = s as usize * body.len() + nodes[anchor.vertex as usize];
                self.anchors[k] = Some(anchor.place.as_dvec3());
            }
        }
    }

    /// Gives the motion to a body's state, rounded to single precision.
    pub(crate) fn store(&self, body: &Body, state: &mut BodyState) {
        state.follows = false;
        for (node, i) in body.internal.iter().enumerate() {
            let i = *i as usize;
            state.x[i] = self.positions[node].as_vec3a();
            state.v[i] = self.velocities[node].as_vec3a();
            state.warm.falling[i] = 0.0;
        }
        state.anchors.retain(|anchor| !matches!(anchor.source, Source::Support(_)));
        for (k, place) in self.anchors.iter().enumerate() {
            if let Some(place) = place {
                let (vertex, source) = (body.internal[k % body.len()], Source::Support((k / body.len()) as u32));
                let place: Vec3A = place.as_vec3a();
                state.anchors.push(Anchor { vertex, source, place });
            }
        }
        state.anchors.sort_unstable_by_key(|anchor| (anchor.vertex, anchor.source));
    }
}
