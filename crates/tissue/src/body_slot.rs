//! One body in a frame: its solver, its state on the way through the frame, and what is measured of
//! it.

use crate::contact::{ContactSet, Members, Pairs, Reaction, ToolGroup};
use crate::frame::Frame;
use crate::shape::ShapeMeter;
use crate::state::BodyState;
use crate::untangle::Untangler;
use crate::{Body, StepReport, ToolForce};
use rayon::prelude::*;

/// Fewest nodes of bodies for whose sections other threads wait awake. The wait costs the
/// processor's time, and a job that is allocated.
const MIN_AWAKE_NODES: usize = 2000;

/// The solver of one body with its scratch memory.
pub(crate) trait Solver: Send + Sync + Sized {
    /// The memory that the bodies of an island share in a search.
    type History: Send + Sync;

    /// Whether bodies can touch each other.
    const COUPLES: bool;

    /// An empty history for an island of bodies like this one.
    fn new_history(&self) -> Self::History;

    /// Number of substeps in a frame.
    fn substeps(&self) -> usize;

    /// Begins a frame of an island.
    fn begin_frame(_island: &mut IslandFrame<'_, Self>) {}

    /// Advances the bodies of an island from one share (0..=1) of the frame to another, and writes
    /// what happened into their reports. It allocates nothing but longer lists of contacts, and
    /// tasks for other threads.
    fn substep(island: &mut IslandFrame<'_, Self>, from: f64, to: f64);

    /// Ends the frame: the states are those at its end.
    fn end_frame(_island: &mut IslandFrame<'_, Self>) {}

    /// The contacts of the body in the last frame. None for a solver without contact with tools.
    fn contacts(&self) -> Option<&ContactSet> {
        None
    }

    /// The same, to be found and ended by an [`IslandFrame`].
    fn contacts_mut(&mut self) -> Option<&mut ContactSet> {
        None
    }

    /// Forces of rigidly held vertices on each tool at the end of the last frame, for a solver that
    /// knows them. Others have them from the stress of the tetrahedra.
    fn held_forces(&self) -> Option<&[ToolForce]> {
        None
    }

    /// Adds the stiffness of the body against the tools of a group after the last frame, if the
    /// solver knows it; see [`crate::Stepper::tool_stiffness`].
    fn add_tool_stiffness(&mut self, _body: &Body, _group: &ToolGroup<'_>, _sum: &mut [[f64; 6]; 6]) {}
}

/// Bodies that may touch each other, in a frame.
pub(crate) struct IslandFrame<'a, S: Solver> {
    pub slots: &'a mut [BodySlot<S>],
    pub pairs: &'a mut Pairs,
    pub history: &'a mut S::History,
    pub frame: &'a Frame<'a>,
    /// Length of a substep (s).
    pub h: f32,
}

impl<S: Solver> IslandFrame<'_, S> {
    /// Finds the contacts of a substep that goes from one share of the frame to another: those
    /// between bodies, and each body's own.
    pub fn begin_contacts(&mut self, from: f64, to: f64) {
        let Self { slots, pairs, frame, h, .. } = self;
        pairs.find(&**slots, frame, *h, |_| false);
        for BodySlot { index, body, solver, state, .. } in slots.iter_mut() {
            if let Some(contacts) = solver.contacts_mut() {
                contacts.find(&frame.of(*index), body, [from, to], |i| state.x[i], |i| *h * state.v[i]);
            }
        }
    }

    /// Ends a substep of the contacts, when a share of the frame is over.
    pub fn end_contacts(&mut self, share: f64) {
        let Self { slots, pairs, frame, .. } = self;
        for BodySlot { index, body, solver, state, .. } in slots.iter_mut() {
            if let Some(contacts) = solver.contacts_mut() {
                contacts.end_substep(&frame.of(*index), body, share, |i| state.x[i]);
            }
        }
        pairs.end_substep(&**slots);
    }

    /// Ends the frame of the contacts: the states keep the anchors.
    pub fn keep_contacts(&mut self) {
        for BodySlot { solver, state, .. } in self.slots.iter_mut() {
            if let Some(contacts) = solver.contacts_mut() {
                contacts.end_frame(state);
            }
        }
        self.pairs.end_frame(self.slots);
    }
}

/// A body with its solver.
pub(crate) struct BodySlot<S> {
    /// The body's place in the model.
    pub index: usize,
    /// The body that the solver was made for.
    pub body: Body,
    pub solver: S,
    /// The state, during a frame.
    pub state: BodyState,
    /// The state at the frame's beginning.
    pub before: BodyState,
    pub report: StepReport,
    /// The island of the frame, by its first body.
    pub island: usize,
    pub reaction: Reaction,
    pub untangler: Untangler,
    pub meter: ShapeMeter,
}

impl<S: Solver> BodySlot<S> {
    /// For the body of this `index`, which has the state `rest` at rest.
    pub fn new(index: usize, body: &Body, solver: S, rest: BodyState) -> Self {
        Self {
            index,
            body: body.clone(),
            solver,
            report: StepReport::default(),
            island: index,
            reaction: Reaction::new(body),
            untangler: Untangler::new(&rest),
            meter: ShapeMeter::new(body),
            before: rest.clone(),
            state: rest,
        }
    }

    /// Begins a frame: remembers the state, and repairs inverted elements.
    pub fn begin_frame(&mut self, state: &mut BodyState, frame: &Frame<'_>) {
        self.report = StepReport::default();
        self.before.copy_from(state);
        if self.body.lattice.is_none() {
            // Tetrahedra in a lattice bear nothing.
            self.untangler.untangle(&frame.of(self.index), &self.body, state);
            state.follow_nodes(&self.body);
        } else if !self.body.bound.is_empty() {
            // A collision surface is where contact between bodies is looked for before they are
            // solved.
            state.join_lattice(&self.body);
        }
    }

    /// Measures the body at the end of a frame: speeds, volumes, and what it does to the tools.
    pub fn measure(&mut self, frame: &Frame<'_>) {
        let Self { index, body, solver, state, report, reaction, meter, .. } = self;
        report.measure(*index, body, state, meter);
        match solver.held_forces() {
            Some(forces) => reaction.set(forces),
            None => reaction.take(&frame.of(*index), body, state, solver.contacts().is_none()),
        }
    }
}

impl<S: Solver> Members for [BodySlot<S>] {
    fn count(&self) -> usize {
        self.len()
    }

    #[inline(always)]
    fn index(&self, member: usize) -> usize {
        self[member].index
    }

    #[inline(always)]
    fn body(&self, member: usize) -> &Body {
        &self[member].body
    }

    #[inline(always)]
    fn state(&self, member: usize) -> &BodyState {
        &self[member].state
    }

    fn state_mut(&mut self, member: usize) -> &mut BodyState {
        &mut self[member].state
    }
}

/// Does the same with every body of an island, in parallel.
pub(crate) fn for_each<S: Solver>(
    slots: &mut [BodySlot<S>],
    frame: &Frame<'_>,
    work: impl Fn(&mut BodySlot<S>) + Send + Sync,
) {
    if frame.single_thread || slots.len() < 2 {
        slots.iter_mut().for_each(work);
    } else if slots.iter().map(|slot| slot.body.len()).sum::<usize>() < MIN_AWAKE_NODES {
        slots.par_iter_mut().with_max_len(1).for_each(work);
    } else {
        crate::threads::for_each(slots, work);
    }
}
