//! The solvers of all bodies of a model, behind the stages of a frame.

use crate::body_slot::{BodySlot, IslandFrame, Solver, for_each};
use crate::contact::{ContactSet, Coupling, Reaction, ToolGroup};
use crate::frame::Frame;
use crate::island::{Island, Islands, press_tools};
use crate::report::Divergence;
use crate::state::BodyState;
use crate::{Body, BodyContact, Model, State, StepReport};
use glam::DVec3;
use std::sync::Arc;

/// The stages of a frame that the stepper runs, whatever the kind of the solvers.
pub(crate) trait SolverSet: Send + Sync {
    /// Another set of the same solvers and settings, for no body yet.
    fn another(&self) -> Box<dyn SolverSet>;

    /// Changes to another model; bodies that both have in common keep their solvers. New ones are
    /// made on the threads of the pool that calls; by the calling thread if `single_thread`.
    fn set_model(&mut self, model: &Model, single_thread: bool);

    /// Whether the model is the one that was set, and the state is one of it.
    fn fits(&self, model: &Model, state: &State) -> bool;

    /// Remembers where the frame begins, and repairs bodies with inverted elements.
    fn begin_frame(&mut self, state: &mut State, frame: &Frame<'_>);

    /// Finds what may touch in the frame, and sorts the bodies into islands.
    fn build_islands(&mut self, model: &Model, state: &State, frame: &Frame<'_>);

    /// Advances the islands by a frame, substep by substep, on the threads of a pool if there is
    /// one, and measures their bodies.
    fn solve_islands(&mut self, state: &mut State, frame: &Frame<'_>, pool: Option<&rayon::ThreadPool>);

    /// Sums up the frame. If a position is not finite, all bodies return to the beginning of the
    /// frame.
    fn end_frame(&mut self, state: &mut State) -> StepReport;

    /// Calls `visit` for every body with its forces on the tools in the last frame.
    fn for_bodies(&self, visit: &mut dyn FnMut(usize, &Reaction, Option<&ContactSet>));

    /// Calls `visit(body, vertex, force)` for every contact force (N) of tools and other bodies on
    /// a vertex at the end of the last frame, which left `state`.
    fn for_contact_forces(&self, state: &State, visit: &mut dyn FnMut(usize, u32, DVec3));

    /// Adds the stiffness of all bodies against the tools of a group after the last frame.
    fn add_tool_stiffness(&mut self, group: &ToolGroup<'_>, sum: &mut [[f64; 6]; 6]);
}

/// Makes the solver of a body; the flag says whether the calling thread does all the work.
type MakeSolver<S> = Arc<dyn Fn(&Body, bool) -> S + Send + Sync>;

/// Bodies with solvers of one kind.
pub(crate) struct BodySolvers<S: Solver> {
    make: MakeSolver<S>,
    /// Island by island, the largest first.
    slots: Vec<BodySlot<S>>,
    islands: Islands<S>,
    /// Finds which bodies may touch; None if bodies pass through each other.
    coupling: Option<Coupling>,
    /// The contact and the filtered pairs of the model that the coupling was made for.
    contact: Option<BodyContact>,
    filtered: Vec<[usize; 2]>,
}

impl<S: Solver> BodySolvers<S> {
    /// For no body yet.
    pub fn new(make: impl Fn(&Body, bool) -> S + Send + Sync + 'static) -> Self {
        Self::made_by(Arc::new(make))
    }

    fn made_by(make: MakeSolver<S>) -> Self {
        Self {
            make,
            slots: Vec::new(),
            islands: Islands::new(&[]),
            coupling: None,
            contact: None,
            filtered: Vec::new(),
        }
    }
}

impl<S: Solver + 'static> SolverSet for BodySolvers<S> {
    fn another(&self) -> Box<dyn SolverSet> {
        Box::new(Self::made_by(Arc::clone(&self.make)))
    }

    fn set_model(&mut self, model: &Model, single_thread: bool) {
        let mut old = std::mem::take(&mut self.slots);
        let mut take = |body| old.iter().position(|slot| slot.body.is(body)).map(|at| old.swap_remove(at));
        let mut slots: Vec<(&Body, Option<BodySlot<S>>)> = model.bodies.iter().map(|body| (body, take(body))).collect();
        let make = |(body, slot): &mut (&Body, Option<BodySlot<S>>)| {
            let new = || BodySlot::new(0, body, (self.make)(body, single_thread), BodyState::at_rest(body));
            slot.get_or_insert_with(new);
        };
        match single_thread {
            true => slots.iter_mut().for_each(make),
            false => crate::threads::for_each(&mut slots, make),
        }
        let slots = slots.into_iter().filter_map(|(_, slot)| slot).enumerate();
        self.slots = slots.map(|(index, slot)| BodySlot { index, ..slot }).collect();
        self.islands = Islands::new(&self.slots);
        self.contact = model.body_contact;
        self.filtered.clone_from(&model.filtered);
        let couple = |contact: BodyContact| Coupling::new(model, contact);
        self.coupling = model.body_contact.filter(|_| S::COUPLES).map(couple);
    }

    fn fits(&self, model: &Model, state: &State) -> bool {
        let contact = self.coupling.is_none() || self.contact == model.body_contact && self.filtered == model.filtered;
        let counts = contact && self.slots.len() == model.bodies.len() && self.slots.len() == state.bodies.len();
        // A model that was built again from the same parts is the same; one that was cut elsewhere
        // is not.
        let same = |slot: &BodySlot<S>| {
            let size = state.bodies[slot.index].x.len();
            size == slot.state.x.len() && model.bodies[slot.index].is_alike(&slot.body)
        };
        counts && self.slots.iter().all(same)
    }

    fn begin_frame(&mut self, state: &mut State, frame: &Frame<'_>) {
        for slot in &mut self.slots {
            slot.begin_frame(&mut state.bodies[slot.index], frame);
        }
    }

    fn build_islands(&mut self, model: &Model, state: &State, frame: &Frame<'_>) {
        if let Some(coupling) = &mut self.coupling {
            coupling.find(model, state, frame);
        }
        self.islands.build(&mut self.slots, self.coupling.as_ref());
    }

    fn solve_islands(&mut self, state: &mut State, frame: &Frame<'_>, pool: Option<&rayon::ThreadPool>) {
        for slot in &mut self.slots {
            std::mem::swap(&mut slot.state, &mut state.bodies[slot.index]);
        }
        let (coupling, slots) = (self.coupling.as_ref(), &mut self.slots[..]);
        self.islands.for_each(slots, pool, |Island { pairs, history, .. }, slots| {
            if let Some(coupling) = coupling {
                pairs.begin_frame(coupling, frame, slots);
            }
            let substeps = slots[0].solver.substeps();
            let (h, share) = ((frame.dt / substeps as f64) as f32, |k: usize| k as f64 / substeps as f64);
            let mut island = IslandFrame { slots, pairs, history, frame, h };
            S::begin_frame(&mut island);
            for k in 0..substeps {
                S::substep(&mut island, share(k), share(k + 1));
            }
            S::end_frame(&mut island);
            for_each(island.slots, frame, |slot| slot.measure(frame));
            press_tools(island.slots, island.pairs, frame);
        });
    }

    fn end_frame(&mut self, state: &mut State) -> StepReport {
        let report = self.slots.iter().fold(StepReport::default(), |all, slot| all.with(&slot.report));
        let broken = matches!(report.divergence, Some(Divergence::NonFinite { .. }));
        for slot in &mut self.slots {
            // All bodies of a state belong to one instant: if one is lost, all are restored.
            if broken {
                slot.state.copy_from(&slot.before);
            }
            std::mem::swap(&mut slot.state, &mut state.bodies[slot.index]);
        }
        report
    }

    fn for_bodies(&self, visit: &mut dyn FnMut(usize, &Reaction, Option<&ContactSet>)) {
        self.slots.iter().for_each(|slot| visit(slot.index, &slot.reaction, slot.solver.contacts()));
    }

    fn for_contact_forces(&self, state: &State, visit: &mut dyn FnMut(usize, u32, DVec3)) {
        let x = |body: usize, vertex: u32| state.bodies[body].x[vertex as usize];
        self.islands.for_contact_forces(&self.slots, x, visit);
    }

    fn add_tool_stiffness(&mut self, group: &ToolGroup<'_>, sum: &mut [[f64; 6]; 6]) {
        for BodySlot { body, solver, .. } in &mut self.slots {
            solver.add_tool_stiffness(body, group, sum);
        }
    }
}
