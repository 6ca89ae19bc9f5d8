//! Vertex Block Descent: every vertex in turn takes a Newton step on its own 3x3 block, all
//! vertices of one colour at once.
//!
//! Chen, Liu, Yang and Yuksel, "Vertex block descent", SIGGRAPH 2024. The paper's solver; and what
//! the quasi-Newton solver falls back to.

mod body_descent;
mod kernel;
mod lane_sweep;
#[cfg(test)]
mod lane_tests;
mod stretched;
mod sweep;
mod vertex_step;

use crate::Body;
use crate::body_slot::{BodySlot, IslandFrame, Solver};
use crate::contact::{ContactSet, Pairs};
use crate::frame::Frame;
use crate::settings::Descent;
pub(crate) use body_descent::BodyDescent;

/// The sweeps of a body with its contacts.
pub(crate) struct TouchingDescent {
    descent: BodyDescent,
    contacts: ContactSet,
}

impl TouchingDescent {
    /// For `body`; `single_thread`: the calling thread does all the work.
    pub fn new(settings: Descent, body: &Body, single_thread: bool) -> Self {
        Self { descent: BodyDescent::new(settings, body, single_thread), contacts: ContactSet::new(body) }
    }
}

impl Solver for TouchingDescent {
    type History = ();
    const COUPLES: bool = true;

    fn new_history(&self) {}

    fn substeps(&self) -> usize {
        self.descent.settings.substeps
    }

    fn begin_frame(island: &mut IslandFrame<'_, Self>) {
        let frame = island.frame;
        for BodySlot { index, body, solver, state, .. } in island.slots.iter_mut() {
            solver.descent.begin_frame(&frame.of(*index), body, state);
            solver.contacts.begin_frame(&frame.of(*index), body, state);
        }
    }

    fn substep(island: &mut IslandFrame<'_, Self>, from: f64, to: f64) {
        island.begin_contacts(from, to);
        sweep_substep(island.slots, island.pairs, island.frame, to);
        island.end_contacts(to);
    }

    fn end_frame(island: &mut IslandFrame<'_, Self>) {
        island.keep_contacts();
    }

    fn contacts(&self) -> Option<&ContactSet> {
        Some(&self.contacts)
    }

    fn contacts_mut(&mut self) -> Option<&mut ContactSet> {
        Some(&mut self.contacts)
    }
}

impl Sweeps for TouchingDescent {
    fn sweeps(&mut self) -> (&mut BodyDescent, &mut ContactSet) {
        (&mut self.descent, &mut self.contacts)
    }
}

/// A solver that can sweep.
pub(crate) trait Sweeps: Solver {
    /// The sweeps of the body and its contacts.
    fn sweeps(&mut self) -> (&mut BodyDescent, &mut ContactSet);
}

/// One substep of implicit Euler of an island, which ends when `share` of the frame is over:
/// predict, start, sweep body after body a number of times, take the velocities.
pub(crate) fn sweep_substep<S: Sweeps>(slots: &mut [BodySlot<S>], pairs: &mut Pairs, frame: &Frame<'_>, share: f64) {
    let mut iterations = 0;
    for member in 0..slots.len() {
        let pressed = pairs.presses(slots, member);
        slots[member].solver.sweeps().0.pressed = pressed;
    }
    for BodySlot { index, body, solver, state, report, .. } in slots.iter_mut() {
        let (descent, contacts) = solver.sweeps();
        iterations = descent.settings.iterations;
        contacts.press(body, &[], |i| body.place(&state.x, i));
        descent.start(&frame.of(*index), share, body, contacts, state, report);
    }
    pairs.list_roles(slots);
    for _ in 0..iterations {
        for member in 0..slots.len() {
            let pressed = if pairs.is_empty() { &[][..] } else { pairs.contacts_of(slots, member) };
            let BodySlot { body, solver, state, .. } = &mut slots[member];
            let (descent, contacts) = solver.sweeps();
            if !pressed.is_empty() || contacts.is_pressed() {
                contacts.press(body, pressed, |i| body.place(&state.x, i));
            }
            descent.sweep(frame, body, contacts, state);
        }
    }
    for BodySlot { index, body, solver, state, report, .. } in slots.iter_mut() {
        let descent = solver.sweeps().0;
        report.iterations += iterations;
        descent.take_velocities(&frame.of(*index), body, state);
        state.follow_nodes(body);
    }
}
