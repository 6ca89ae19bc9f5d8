//! The beginning of a frame: which vertices may touch something in it.

use super::ContactSet;
use super::find::bounds;
use crate::contact::{ToolForce, compliant_grasp, tool_placement};
use crate::frame::Frame;
use crate::state::BodyState;
use crate::{Body, ToolContact};
use glam::Vec3A;

/// A vertex within this distance of a surface (m), beyond what it may travel in two frames, may
/// touch it in a frame.
const REACH_MARGIN: f32 = 1e-3;

/// The matrix stays the same if at most so many vertices more or fewer touch, and an eighth of
/// them: as many as two jaws touch. The low-rank update has room for more.
const MAX_CHANGED_CONTACTS: usize = 24;

impl ContactSet {
    /// Begins a frame: finds what may be touched in it.
    ///
    /// If many other vertices touch than the quasi-Newton solver's matrix contains, the warm start
    /// in `state` is set to those that touch now.
    pub fn begin_frame(&mut self, frame: &Frame<'_>, body: &Body, state: &mut BodyState) {
        self.anchors.clone_from(&state.anchors);
        self.forces.clear();
        self.forces.resize(frame.tools.len(), ToolForce::default());
        self.mark_fixed(frame, body);
        self.holes.begin_frame(frame, body, state);
        compliant_grasp::find(frame, body, &self.fixed, &mut self.compliant);
        tool_placement::place(frame, body, 0.0, 1.0, &mut self.placed);
        // Room for all contacts that a substep may have, so that only the first one allocates.
        self.contacts.clear();
        self.places.clear();
        let most = (self.supports.len() + frame.colliders.len()) * self.surface.len() + body.len() + self.tethers.len();
        self.contacts.reserve(most);
        self.places.reserve(most);
        let anchors = 2 * self.surface.len();
        state.anchors.reserve(anchors.saturating_sub(state.anchors.len()));
        self.find_near(frame, body, state);
        if frame.tool_contact == ToolContact::Surface {
            self.features.begin_frame(frame, body, state, &self.placed, &self.holes, self.reach);
        } else {
            self.features.clear();
        }
    }

    fn mark_fixed(&mut self, frame: &Frame<'_>, body: &Body) {
        for (fixed, vertex) in self.fixed.iter_mut().zip(&body.vertices) {
            *fixed = vertex.pinned;
        }
        for grasp in frame.rigid_grasps() {
            grasp.nodes.iter().for_each(|i| self.fixed[body.internal[*i as usize] as usize] = true);
        }
        for (k, bound) in body.bound.iter().enumerate() {
            self.fixed[self.nodes + k] = bound.shares().all(|(node, _)| self.fixed[node as usize]);
        }
    }

    fn find_near(&mut self, frame: &Frame<'_>, body: &Body, state: &mut BodyState) {
        self.near.clear();
        self.touching.fill(false);
        let dt = frame.dt as f32;
        let fastest = self.surface.iter().map(|i| state.v[*i as usize].length_squared()).fold(0.0, f32::max).sqrt();
        let fall = dt * dt * frame.gravity.length() as f32;
        let carried = frame.carried(body, false);
        self.reach = REACH_MARGIN + carried as f32 + 2.5 * (dt * fastest + fall);
        self.list_reachable(bounds(self.surface.iter().map(|i| state.x[*i as usize])));
        // A loose body falls in this frame; a held one may not.
        let loose = !self.fixed.contains(&true) && self.compliant.is_empty();
        let drop = if loose { dt * dt * frame.gravity.as_vec3a() } else { Vec3A::ZERO };
        let (mut touching, mut changed) = (0, 0);
        let mut hanging = self.compliant.iter().map(|h| h.vertex).peekable();
        let mut tethered = self.tethers.iter().map(|t| t.vertex).peekable();
        for k in 0..self.surface.len() {
            let vertex = self.surface[k];
            let i = vertex as usize;
            while let Some(before) = hanging.next_if(|h| *h < vertex) {
                self.near.push(before);
            }
            let hangs = hanging.next_if_eq(&vertex).is_some();
            let mut near = hangs;
            while tethered.next_if(|t| *t <= vertex).is_some_and(|t| t == vertex) {
                near = true;
            }
            let mut touches = false;
            if !self.fixed[i] {
                let (x, ahead) = (state.x[i], state.x[i] + dt * state.v[i] + drop);
                self.for_sources(frame, body, i, x, |_, height, normal, point, _, _| {
                    near = true;
                    touches |= height < 0.0 || (ahead - point).dot(normal) < 0.0;
                });
            }
            if near {
                self.near.push(vertex);
            }
            self.touching[i] = touches;
        }
        self.near.extend(hanging);
        // Edges and triangles that pressed at the end of the last frame.
        for anchor in &state.feature_anchors {
            for i in anchor.feature.0 {
                self.touching[i as usize] |= !self.fixed[i as usize];
            }
        }
        if self.is_bound {
            self.spread_touching(body);
        }
        let mut count = |i: usize| {
            touching += usize::from(self.touching[i]);
            changed += usize::from(self.touching[i] != state.warm.supported[i]);
        };
        if self.is_bound {
            (0..self.nodes).for_each(count);
        } else {
            self.surface.iter().for_each(|i| count(*i as usize));
        }
        if changed > MAX_CHANGED_CONTACTS + touching / 8 {
            state.warm.supported.copy_from_slice(&self.touching[..self.nodes]);
        }
    }

    /// Marks the nodes of the vertices of a collision surface that touch.
    fn spread_touching(&mut self, body: &Body) {
        let (nodes, bound) = self.touching.split_at_mut(self.nodes);
        for (bound, _) in body.bound.iter().zip(bound).filter(|(_, touches)| **touches) {
            bound.shares().for_each(|(node, _)| nodes[node as usize] |= !self.fixed[node as usize]);
        }
    }
}
