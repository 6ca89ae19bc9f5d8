//! The lattice backend: a solver whose elements are those of `trocar-lattice`.
//!
//! The vertices of a body are embedded in its lattice: x = W q with the lattice's nodes q. They
//! remain what everything outside of this module reads. Contacts, supports and compliant grasps are
//! found and kept by the same code as for tetrahedra; their energies are functions of x, so their
//! forces on q are W' f. Pins and rigidly held vertices are stiff springs on x. Elasticity, inertia
//! and viscosity are those of the lattice.

mod minimise;
mod system;
mod terms;

use crate::body_slot::{BodySlot, IslandFrame, Solver};
use crate::contact::ContactSet;
use crate::frame::Frame;
use crate::{Body, QuasiNewton, SolverSettings, ToolForce};
use glam::DVec3;
use minimise::{Island, Precision};
use system::{Lattice, LatticeSystem};
use terms::{Place, Share, Term};
use trocar_core::Wrench;
use trocar_lattice::BodyState as LatticeState;

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
            if let (Some(embedding), Some(lattice)) = (&body.lattice, &mut state.lattice) {
                embedding.follow(lattice, &mut state.x, &mut state.v);
            }
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
        let mut terms = Vec::new();
        for (member, BodySlot { body, solver, state, .. }) in slots.iter().enumerate() {
            terms::push_contacts(member, (body, &state.x), solver.contacts.list(), &mut terms);
        }
        let first_pair = terms.len();
        terms::push_pairs(|m| (&slots[m].body, &slots[m].state.x[..]), pairs, &mut terms);
        let first_held = terms.len();
        slots.iter().enumerate().for_each(|(member, slot)| hold(slot, member, frame, to, &mut terms));

        let precision = slots[0].solver.precision;
        let starts: Vec<Start> = slots.iter().map(|slot| Start::of(slot, frame, h)).collect();
        let x = starts.iter().map(|start| start.guess.clone()).collect();
        let lattices = slots.iter_mut().zip(&starts).enumerate();
        let lattices = lattices.filter_map(|(member, (slot, start))| lattice(slot, member, start, h)).collect();
        let mut search = Island { lattices, terms, x, precision };
        let outcome = search.minimise();
        let Island { terms, x, .. } = search;

        for (pair, term) in pairs.list_mut().iter_mut().zip(&terms[first_pair..first_held]) {
            pair.limit = term.limit as f32;
        }
        for ((slot, start), x) in slots.iter_mut().zip(starts).zip(&x) {
            let BodySlot { body, state, report, .. } = slot;
            report.iterations += outcome.steps;
            report.fallbacks += usize::from(!outcome.converged);
            if let (Some(embedding), Some(lattice)) = (&body.lattice, &mut state.lattice) {
                start.end(x, h, lattice);
                embedding.write(lattice, &mut state.x, &mut state.v);
            }
        }
        let x: Vec<&[DVec3]> = x.iter().map(|x| &x[..]).collect();
        press_tools(slots, &terms[first_held..], &x, frame);
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

/// Where a lattice begins a substep.
struct Start {
    /// Acceleration times time that free flight adds to the velocity (m/s), and the predictor (m).
    flight: DVec3,
    predictor: Vec<DVec3>,
    /// Forces on the nodes (N).
    loads: Vec<DVec3>,
    /// Where the search starts (m).
    guess: Vec<DVec3>,
}

impl Start {
    /// Of a body in a substep of `h` (s). Empty for a body that cannot move.
    ///
    /// A body in free flight falls exactly: gravity's part of its motion is h^2/2 g. Elsewhere it
    /// is implicit Euler's h^2 g.
    fn of(slot: &BodySlot<LatticeSolver>, frame: &Frame<'_>, h: f64) -> Self {
        let BodySlot { index, body, solver, state, .. } = slot;
        let mut start = Self { flight: DVec3::ZERO, predictor: Vec::new(), loads: Vec::new(), guess: Vec::new() };
        let (Some(embedding), Some(lattice)) = (&body.lattice, &state.lattice) else { return start };
        start.loads.resize(lattice.positions.len(), DVec3::ZERO);
        let mut loaded = false;
        frame.of(*index).for_loads(body, |vertex, force| {
            if let Some(point) = &embedding.points[vertex] {
                point.spread(force, &mut start.loads);
                loaded = true;
            }
        });
        let free = !loaded && !solver.pressed && solver.held.is_empty() && embedding.body.pins().is_empty();
        let flies = free && solver.contacts.is_idle(|i| state.x[i]);
        start.flight = h * frame.gravity;
        let reach = if flies { 0.5 * h } else { h };
        let nodes = || lattice.positions.iter().zip(&lattice.velocities);
        start.predictor.extend(nodes().map(|(x, v)| *x + h * *v + reach * start.flight));
        if flies {
            start.guess.clone_from(&start.predictor);
        } else {
            // A body that hardly moves starts where it is, and may come to rest.
            let fastest = lattice.velocities.iter().map(|v| v.length_squared()).fold(0.0, f64::max).sqrt();
            let share = if h * fastest > solver.precision.tolerance { h } else { 0.0 };
            start.guess.extend(nodes().map(|(x, v)| *x + share * *v));
        }
        start
    }

    /// Ends the substep at `x`: v + h g + (x - y)/h, which equals (x - x0)/h for implicit Euler,
    /// and is exact in free flight.
    fn end(&self, x: &[DVec3], h: f64, lattice: &mut LatticeState) {
        for (i, x) in x.iter().enumerate() {
            lattice.velocities[i] += self.flight + (*x - self.predictor[i]) / h;
            lattice.positions[i] = *x;
        }
    }
}

/// The lattice of a body that can move, in a substep of `h` (s).
fn lattice<'a>(slot: &'a mut BodySlot<LatticeSolver>, member: usize, start: &Start, h: f64) -> Option<Lattice<'a>> {
    let BodySlot { body, solver, state, .. } = slot;
    let (embedding, system, state) = (body.lattice.clone()?, solver.system.as_mut()?, state.lattice.as_ref()?);
    let (mass, viscosity) = (embedding.body.masses().iter().sum(), body.material.viscosity);
    let (predictor, loads) = (start.predictor.clone(), start.loads.clone());
    let from = state.positions.clone();
    let mut lattice = Lattice { member, embedding, system, h, predictor, loads, mass, viscosity, start: from };
    lattice.begin_substep(&start.guess);
    Some(lattice)
}

/// Appends the springs of rigidly held vertices, whose tools are where they are when `share` of the
/// frame is over.
fn hold(slot: &BodySlot<LatticeSolver>, member: usize, frame: &Frame<'_>, share: f64, terms: &mut Vec<Term>) {
    let Some(embedding) = &slot.body.lattice else { return };
    let stiffness = HOLD_STIFFNESS * slot.body.material.young_modulus * embedding.settings.cell;
    for held in &slot.solver.held {
        let grasp = &frame.grasps[held.grasp];
        let place = frame
            .tools
            .get(grasp.tool)
            .map_or(held.place, |tool| grasp.prescribed_node(&tool.at(share), held.node).1 - slot.body.origin);
        let at = embedding.points[held.vertex as usize].map_or(Place::Fixed(held.place), Place::Embedded);
        terms.push(Term::spring(Share { member, share: 1.0, place: at }, place, stiffness));
    }
}

/// Measures the forces of rigidly held vertices on their tools, from the springs that `hold` made.
fn press_tools(slots: &mut [BodySlot<LatticeSolver>], springs: &[Term], x: &[&[DVec3]], frame: &Frame<'_>) {
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
