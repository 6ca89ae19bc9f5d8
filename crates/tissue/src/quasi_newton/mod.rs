//! The fast solver: a warped, prefactored quasi-Newton method.
//!
//! Every substep minimises implicit Euler's incremental potential of a body by L-BFGS (Nocedal
//! 1980). Its first guess of the inverse Hessian is the body's stiffness at rest, factorised once
//! (Liu, Bouaziz and Kavan, "Quasi-Newton methods for real-time simulation of hyperelastic
//! materials", 2017), and turned with the tissue around each node (stiffness warping, Mueller and
//! others 2002). The method is global: a force at one end of an organ is felt at the other within
//! one iteration. A line search by slope and a guard on the volumes make it safe. If the search
//! fails, Vertex Block Descent sweeps the island for that substep.
//!
//! Bodies that may touch each other are minimised together: one history and one line search over
//! all of them, while each keeps its own matrix.
//!
//! From the substep down: this file (a substep of an island), `minimise` (its minimisation),
//! `two_loop` and `line_search` (one step of it), `body_system` and `apply_step` (one body),
//! `system` (its matrix), `low_rank_update` (what is not in it), `elements` and `stress` (its
//! elements).

mod apply_step;
mod body_system;
mod coarse;
mod column_cache;
mod contact_springs;
mod dashpots;
mod dense;
mod elements;
mod factor;
mod half_columns;
mod history;
mod island_system;
mod iterate;
mod layout;
mod line_search;
mod low_rank_update;
mod memory;
mod minimise;
mod packing;
mod resting;
mod rigid_modes;
mod sleep;
mod sleeping;
mod springs;
mod stiffened;
mod stress;
mod supernode;
mod system;
mod tile;
mod tile_parts;
mod tiles;
mod tool_stiffness;
mod tree;
mod two_loop;
mod warp;

use crate::Body;
use crate::body_slot::{BodySlot, Solver, for_each};
use crate::contact::{ContactSet, ToolGroup};
use crate::descent::{BodyDescent, Sweeps, sweep_substep};
pub(crate) use body_system::QuasiNewtonSolver;
use history::History;
use island_system::IslandSystem;

impl Solver for QuasiNewtonSolver {
    type History = History;
    const COUPLES: bool = true;

    fn new_history(&self) -> History {
        History::new(self.settings.memory)
    }

    fn substeps(&self) -> usize {
        self.settings.substeps
    }

    fn begin_frame(island: &mut IslandSystem<'_>) {
        let frame = island.frame;
        for_each(island.slots, frame, |BodySlot { index, body, solver, state, .. }| {
            solver.begin_frame(&frame.of(*index), body, state);
        });
        island.begin_frame();
    }

    fn substep(island: &mut IslandSystem<'_>, from: f64, to: f64) {
        island.find_contacts(from, to);
        island.save_limited();
        let solved =
            island.check_systems() && island.minimise(to) || island.add_contacts_to_systems() && island.minimise(to);
        if !solved {
            island.restore_limited();
            island.sweep(to);
        }
        island.end_substep(to);
    }

    fn end_frame(island: &mut IslandSystem<'_>) {
        for BodySlot { body, solver, state, .. } in island.slots.iter_mut() {
            solver.touching.contacts.end_frame(state);
            solver.iterate.store(&solver.layout, state);
            state.follow_nodes(body);
        }
        island.pairs.end_frame(island.slots);
    }

    fn contacts(&self) -> Option<&ContactSet> {
        Some(&self.touching.contacts)
    }

    fn add_tool_stiffness(&mut self, body: &Body, group: &ToolGroup<'_>, sum: &mut [[f64; 6]; 6]) {
        self.add_stiffness(body, group, sum);
    }
}

impl Sweeps for QuasiNewtonSolver {
    fn sweeps(&mut self) -> (&mut BodyDescent, &mut ContactSet) {
        (&mut self.fallback, &mut self.touching.contacts)
    }
}

impl IslandSystem<'_> {
    /// Forgets the history, and evaluates the elements of bodies whose volumes are not known.
    fn begin_frame(&mut self) {
        self.history.clear();
        let h = self.h;
        for_each(self.slots, self.frame, |BodySlot { solver, .. }| {
            solver.sleep.active = true;
            if !solver.elements.is_accepted_here {
                solver.evaluate_in_place(h);
            }
        });
    }

    /// Forgets the history, and evaluates the elements as they are.
    fn reset(&mut self) {
        self.history.clear();
        let h = self.h;
        for_each(self.slots, self.frame, |BodySlot { solver, .. }| {
            solver.sleep.active = true;
            solver.evaluate_in_place(h);
        });
    }

    fn find_contacts(&mut self, from: f64, to: f64) {
        let Self { slots, pairs, frame, h, .. } = self;
        let (frame, h) = (*frame, *h);
        pairs.find(&**slots, frame, h, |member| from > 0.0 && !slots[member].solver.sleep.active);
        for_each(slots, frame, |BodySlot { index, body, solver, .. }| {
            solver.find_contacts(&frame.of(*index), body, [from, to], h);
        });
    }

    /// Whether the matrices of all bodies can be used. Contacts that are not in them may be too
    /// stiff for them.
    fn check_systems(&mut self) -> bool {
        let usable = self.slots.iter().all(|slot| slot.solver.system.usable);
        if !usable {
            self.all().for_each(|body| body.clear_targets());
        }
        usable
    }

    /// Adds the tools and supports that press where the substep began, or would have ended without
    /// contact, to the matrices, for another minimisation. False if they have them all.
    fn add_contacts_to_systems(&mut self) -> bool {
        let mut new = false;
        for BodySlot { index, body, solver, state, .. } in self.slots.iter_mut() {
            new |= solver.add_contacts_to_system(&self.frame.of(*index), body, state);
        }
        let usable = new && self.slots.iter().all(|slot| slot.solver.system.usable);
        if usable {
            self.reset();
            self.restore_limited();
        }
        usable
    }

    /// Sweeps the substep: the fallback.
    fn sweep(&mut self, to: f64) {
        for slot in self.slots.iter_mut() {
            slot.report.fallbacks += 1;
            slot.solver.iterate.store(&slot.solver.layout, &mut slot.state);
            slot.solver.fallback.begin_frame(&self.frame.of(slot.index), &slot.body, &slot.state);
        }
        sweep_substep(self.slots, self.pairs, self.frame, to);
        for BodySlot { solver, state, .. } in self.slots.iter_mut() {
            solver.iterate.load(&solver.layout, state);
        }
        self.reset();
    }

    fn end_substep(&mut self, to: f64) {
        let (frame, coupled) = (self.frame, !self.pairs.is_empty());
        for_each(self.slots, frame, |BodySlot { index, body, solver, state, .. }| {
            solver.end_substep(&frame.of(*index), body, to);
            if coupled {
                solver.iterate.store(&solver.layout, state);
                state.follow_nodes(body);
            }
        });
        self.pairs.end_substep(self.slots);
    }

    /// Remembers the reports' counts of held nodes that stay behind.
    fn save_limited(&mut self) {
        self.slots.iter_mut().for_each(|slot| slot.solver.progress.limited = slot.report.grasp_limited);
    }

    /// Puts those counts back before a substep is tried again.
    fn restore_limited(&mut self) {
        self.slots.iter_mut().for_each(|slot| slot.report.grasp_limited = slot.solver.progress.limited);
    }
}
