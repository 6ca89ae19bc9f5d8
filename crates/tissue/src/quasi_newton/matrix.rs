//! What the factor of a body's matrix knows of what holds and presses it, and when it is made anew.

use super::part::{QuasiNewtonSolver, position};
use crate::Body;
use crate::contact::Source;
use crate::integrator::Frame;
use crate::state::BodyState;

impl QuasiNewtonSolver {
    /// Marks the nodes that tools carry; a factor in which others are held is made anew.
    pub(super) fn hold(&mut self, frame: &Frame<'_>, body: &Body) {
        self.held.fill(false);
        for grasp in frame.rigid_grasps() {
            for node in &grasp.nodes {
                let i = self.layout.number[body.internal[*node as usize] as usize] as usize;
                if i < self.layout.free {
                    self.held[i] = true;
                }
            }
        }
    }

    /// Makes the factor anew if it is not the one for the nodes that are held, pressed or hang on a tool.
    pub(super) fn refresh_factor(&mut self, frame: &Frame<'_>, body: &Body, state: &BodyState) {
        let Some(factor) = &mut self.factor else { return };
        let mut stale = !self.usable || self.held != self.held_in_factor;
        for i in 0..self.layout.free {
            let stiffness = self.contacts.stiffness(frame, body, state, self.layout.vertex[i] as usize);
            stale |= stiffness != self.touches_in_factor[i];
            self.touches_in_factor[i] = stiffness;
        }
        if stale {
            self.patch.clear();
            self.rest_correction = None;
            self.known.clear();
            for (i, vertex) in self.layout.vertex[..self.layout.free].iter().enumerate() {
                if state.supported[*vertex as usize] {
                    self.known.push((i as u32, body.vertices[*vertex as usize].contact_stiffness));
                }
            }
            self.usable = factor.factorise(&self.held, &self.touches_in_factor);
            self.held_in_factor.copy_from_slice(&self.held);
        }
    }

    /// Lets the matrix know of what presses where a substep began or would have gone by itself; false if it did already.
    pub fn learn_touches(&mut self, frame: &Frame<'_>, body: &Body, state: &mut BodyState) -> bool {
        let (x, targets, number) = (&self.x, &self.targets, &self.layout.number);
        let places = |vertex: u32| {
            let i = number[vertex as usize] as usize;
            [position(&x[i]), position(&targets[i])]
        };
        let mut new = false;
        for touch in self.contacts.touches().iter().filter(|touch| !matches!(touch.source, Source::Grasp(..))) {
            let presses = places(touch.vertex).iter().any(|x| touch.height(*x) < 0.0);
            let known = &mut state.supported[touch.vertex as usize];
            new |= presses && !*known;
            *known |= presses;
        }
        if new {
            self.refresh_factor(frame, body, state);
        }
        new
    }
}
