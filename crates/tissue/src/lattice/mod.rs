//! The lattice backend: a solver whose elements are those of `trocar-lattice`.
//!
//! The vertices of a body are embedded in its lattice: x = W q with the lattice's nodes q. They
//! remain what everything outside of this module reads. Contacts, supports and compliant grasps are
//! found and kept by the same code as for tetrahedra; their energies are functions of x, so their
//! forces on q are W' f. Pins and rigidly held vertices are stiff springs on x. Elasticity, inertia
//! and viscosity are those of the lattice.

mod minimise;
mod start;
mod system;
mod terms;
#[cfg(test)]
mod tests;

use crate::body_slot::{BodySlot, IslandFrame, Solver};
use crate::contact::ContactSet;
use crate::frame::Frame;
use crate::{Body, QuasiNewton, SolverSettings, ToolForce};
use glam::DVec3;
use minimise::{Island, Precision};
use start::Start;
use system::{Lattice, LatticeSystem};
use terms::{Place, Share, Term};
use trocar_core::Wrench;
use trocar_lattice::Motion;

/// Stiffness of the spring of a rigidly held vertex, over Young's modulus times the edge of a cell.
/// A vertex that a newton pulls out of tissue of 12 kPa in cells of 4 mm is off by 2 um.
const HOLD_STIFFNESS: f64 = 1e4;

/// The lattice solver of one body.
pub(crate) struct LatticeSolver {
    substeps: usize,
    precision: Precision,
    /// None if the body cannot move.
    system: Option<LatticeSystem>,
    contacts: ContactSet,
    /// Rigidly held vertices with their tools, by vertex; without a tool they stay where they are.
    held: Vec<Held>,
    /// Forces of held vertices on each tool.
    forces: Vec<ToolForce>,
    /// Whether another body presses it when a substep begins.
    pressed: bool,
    /// Where it begins the substep.
    start: Start,
    /// Scratch: what the vertices are written from.
    motion: Motion,
}

/// A rigidly held vertex in a frame.
#[derive(Clone, Copy, Debug)]
struct Held {
    vertex: u32,
    /// The grasp, of all, and the node in it.
    grasp: usize,
    node: usize,
    /// Where it is at the frame's beginning (m).
    place: DVec3,
}

impl LatticeSolver {
    /// For `body`.
    pub fn new(settings: SolverSettings, body: &Body) -> Self {
        let precision = match settings {
            SolverSettings::QuasiNewton(QuasiNewton { tolerance, relative, .. }) => Precision { tolerance, relative },
            SolverSettings::Descent(_) => Precision { tolerance: 3e-8, relative: 1e-2 },
        };
        Self {
            substeps: settings.substeps(),
            precision,
            system: body.lattice.as_deref().map(LatticeSystem::new),
            contacts: ContactSet::new(body),
            held: Vec::new(),
            forces: Vec::new(),
            pressed: false,
            start: Start::default(),
            motion: Motion::default(),
        }
    }
}

impl Solver for LatticeSolver {
    type History = ();
    const COUPLES: bool = true;

    fn new_history(&self) {}

    fn substeps(&self) -> usize {
        self.substeps
    }

    fn begin_frame(island: &mut IslandFrame<'_, Self>) {
        for BodySlot { index, body, solver, state, .. } in island.slots.iter_mut() {
            let frame = island.frame.of(*index);
            state.disturbed = false;
            state.join_lattice(body);
            if let Some(system) = &mut solver.system {
                system.forget_factor();
            }
            solver.contacts.begin_frame(&frame, body, state);
            solver.forces.clear();
            solver.forces.resize(frame.tools.len(), ToolForce::default());
            solver.held.clear();
            for (g, grasp) in frame.grasps.iter().enumerate() {
                let counts = grasp.body == *index && !grasp.torn;
                if !counts || (grasp.compliance.is_some() && grasp.tool < frame.tools.len()) {
                    continue;
                }
                for (k, node) in grasp.nodes.iter().enumerate() {
                    let vertex = body.internal[*node as usize];
                    let place = state.x[vertex as usize].as_dvec3();
                    solver.held.push(Held { vertex, grasp: g, node: k, place });
                }
            }
            // A node in several grasps follows the last.
            solver.held.sort_by_key(|held| (held.vertex, std::cmp::Reverse(held.grasp)));
            solver.held.dedup_by_key(|held| held.vertex);
        }
    }

    fn substep(island: &mut IslandFrame<'_, Self>, from: f64, to: f64) {
        island.begin_contacts(from, to);
        let IslandFrame { slots, pairs, frame, .. } = island;
        for member in 0..slots.len() {
            slots[member].solver.pressed = pairs.presses(&**slots, member);
        }
        let h = frame.dt * (to - from);
        // Terms point into them while the slots change.
        let bodies: Vec<Body> = slots.iter().map(|slot| slot.body.clone()).collect();
        let mut terms = Vec::new();
        for (member, (slot, body)) in slots.iter().zip(&bodies).enumerate() {
            terms::push_contacts(member, (body, &slot.state.x), slot.solver.contacts.list(), &mut terms);
        }
        let first_pair = terms.len();
        terms::push_pairs(|m| (&bodies[m], &slots[m].state.x[..]), pairs, &mut terms);
        let first_held = terms.len();
        for (member, (slot, body)) in slots.iter().zip(&bodies).enumerate() {
            hold(&slot.solver.held, member, body, frame, to, &mut terms);
        }

        slots.iter_mut().for_each(|slot| Start::begin(slot, frame, h));
        let precision = slots[0].solver.precision;
        let x = slots.iter_mut().map(|slot| std::mem::take(&mut slot.solver.start.guess)).collect();
        let lattices = slots.iter_mut().zip(&bodies).enumerate();
        let lattices = lattices.filter_map(|(member, (slot, body))| lattice(slot, member, body, h)).collect();
        let mut search = Island { lattices, terms, x, precision };
        let outcome = search.minimise();
        let Island { terms, x, .. } = search;

        for (pair, term) in pairs.list_mut().iter_mut().zip(&terms[first_pair..first_held]) {
            pair.limit = term.limit as f32;
        }
        for (slot, x) in slots.iter_mut().zip(&x) {
            let BodySlot { body, solver, state, report, .. } = slot;
            report.iterations += outcome.steps;
            report.fallbacks += usize::from(!outcome.converged);
            if let (Some(embedding), Some(lattice)) = (&body.lattice, &mut state.lattice)
                && solver.start.end(x, h, lattice)
            {
                embedding.write(lattice, &mut solver.motion, &mut state.x, &mut state.v);
            }
        }
        let places: Vec<&[DVec3]> = x.iter().map(|x| &x[..]).collect();
        press_tools(slots, &terms[first_held..], &places, frame);
        slots.iter_mut().zip(x).for_each(|(slot, x)| slot.solver.start.guess = x);
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

    fn held_forces(&self) -> Option<&[ToolForce]> {
        Some(&self.forces)
    }
}

/// The lattice of a body that can move, in a substep of `h` (s).
fn lattice<'a>(slot: &'a mut BodySlot<LatticeSolver>, member: usize, body: &'a Body, h: f64) -> Option<Lattice<'a>> {
    let LatticeSolver { system, start, .. } = &mut slot.solver;
    let (embedding, system, state) = (body.lattice.as_deref()?, system.as_mut()?, slot.state.lattice.as_ref()?);
    let (predictor, loads, viscosity) = (&start.predictor[..], &start.loads[..], body.material.viscosity);
    system.begin_substep();
    Some(Lattice { member, embedding, system, h, predictor, loads, viscosity, start: &state.positions })
}

/// Appends the springs of rigidly held vertices of a body, whose tools are where they are when
/// `share` of the frame is over.
fn hold<'a>(held: &[Held], member: usize, body: &'a Body, frame: &Frame<'_>, share: f64, terms: &mut Vec<Term<'a>>) {
    let Some(embedding) = body.lattice.as_deref() else { return };
    let stiffness = HOLD_STIFFNESS * body.material.young_modulus * embedding.settings.cell;
    for held in held {
        let grasp = &frame.grasps[held.grasp];
        let place = frame
            .tools
            .get(grasp.tool)
            .map_or(held.place, |tool| grasp.prescribed_node(&tool.at(share), held.node).1 - body.origin);
        let point = embedding.points[held.vertex as usize].as_ref();
        let at = point.map_or(Place::Fixed(held.place), Place::Embedded);
        terms.push(Term::spring(Share { member, share: 1.0, place: at }, place, stiffness));
    }
}

/// Measures the forces of rigidly held vertices on their tools, from the springs that `hold` made.
fn press_tools(slots: &mut [BodySlot<LatticeSolver>], springs: &[Term<'_>], x: &[&[DVec3]], frame: &Frame<'_>) {
    let mut springs = springs.iter();
    for slot in slots {
        let LatticeSolver { held, forces, .. } = &mut slot.solver;
        forces.fill(ToolForce::default());
        if slot.body.lattice.is_none() {
            continue;
        }
        for (held, spring) in held.iter().zip(&mut springs) {
            let tool = frame.grasps[held.grasp].tool;
            if let (Some(force), Some(motion)) = (forces.get_mut(tool), frame.tools.get(tool)) {
                let (pull, place) = spring.pull(x);
                force.constraint += Wrench::at(pull, slot.body.origin + place - motion.to.translation);
            }
        }
    }
}
