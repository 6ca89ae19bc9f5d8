//! Vertex Block Descent: every vertex in turn takes a Newton step on its own 3x3 block, all vertices of one colour at once.

pub(crate) mod coloring;
pub(crate) mod elements;
pub(crate) mod groups;
pub(crate) mod kernel;
pub(crate) mod lane_sweep;
#[cfg(test)]
mod lane_tests;
pub(crate) mod strip;
pub(crate) mod sweep;

use crate::contact::{Contacts, Pairs};
use crate::descent::sweep::{Substep, is_squeezed};
use crate::integrator::{Frame, Solver, Worker};
use crate::settings::{Descent, Start};
use crate::state::BodyState;
use crate::{Body, Isa, StepReport};
use glam::Vec3A;

/// Held nodes go no farther from their neighbours than this many rest lengths of the edge between them.
pub(crate) const HELD_STRETCH: f32 = 7.0;

/// How much of the guessed motion of free vertices, and of the prescribed motion of held ones, is tried at the beginning of a
/// substep, until no element is squeezed too far by it.
const START_SHARES: [(f32, f32); 8] =
    [(1.0, 1.0), (0.5, 1.0), (0.25, 1.0), (0.0, 1.0), (0.0, 0.5), (0.0, 0.25), (0.0, 0.125), (0.0, 0.0)];

/// The solver of one body.
pub(crate) struct DescentIntegrator {
    schedule: Descent,
    start: Vec<Vec3A>,
    predictor: Vec<Vec3A>,
    guess: Vec<Vec3A>,
    fixed: Vec<bool>,
    held: Vec<bool>,
    /// Whether loads act on it in the frame.
    loaded: bool,
    /// Whether another body presses it when a substep begins.
    pressed: bool,
    isa: Isa,
    alone: bool,
}

/// The solver with what the body touches.
pub(crate) struct TouchingDescent {
    descent: DescentIntegrator,
    contacts: Contacts,
}

impl TouchingDescent {
    pub fn new(schedule: Descent, body: &Body, alone: bool) -> Self {
        Self { descent: DescentIntegrator::new(schedule, body, alone), contacts: Contacts::new(body) }
    }
}

impl Solver for TouchingDescent {
    const COUPLES: bool = true;

    fn advance(island: &mut [Worker<Self>], frame: &Frame<'_>) {
        let mut pairs = std::mem::take(&mut island[0].pairs);
        for Worker { index, body, solver, state, .. } in island.iter_mut() {
            solver.descent.begin(&frame.of(*index), body);
            solver.contacts.begin(&frame.of(*index), body, state);
        }
        let substeps = island[0].solver.descent.schedule.substeps;
        let share = |k: usize| k as f64 / substeps as f64;
        for substep in 1..=substeps {
            pairs.find(island, (frame.dt / substeps as f64) as f32, |_| false);
            for Worker { index, body, solver, state, .. } in island.iter_mut() {
                let (from, to) = (share(substep - 1), share(substep));
                solver.contacts.find(&frame.of(*index), body, from, to, |i| state.x[i]);
            }
            sweep_substep(island, &mut pairs, frame, share(substep));
            for Worker { index, body, solver, state, .. } in island.iter_mut() {
                solver.contacts.settle(&frame.of(*index), body, share(substep), |i| state.x[i]);
            }
            pairs.settle(island);
        }
        for Worker { solver, state, .. } in island.iter_mut() {
            solver.contacts.end(state);
        }
        pairs.end(island);
        island[0].pairs = pairs;
    }

    fn contacts(&self) -> Option<&Contacts> {
        Some(&self.contacts)
    }
}

impl Sweeps for TouchingDescent {
    fn sweeps(&mut self) -> (&mut DescentIntegrator, &mut Contacts) {
        (&mut self.descent, &mut self.contacts)
    }
}

/// A solver that can sweep.
pub(crate) trait Sweeps: Solver {
    fn sweeps(&mut self) -> (&mut DescentIntegrator, &mut Contacts);
}

/// One substep of implicit Euler of an island, which ends when `share` of the frame is over: predict, start, sweep body after body again and again, take the velocity.
pub(crate) fn sweep_substep<S: Sweeps>(island: &mut [Worker<S>], pairs: &mut Pairs, frame: &Frame<'_>, share: f64) {
    let mut iterations = 0;
    for member in 0..island.len() {
        let pressed = pairs.presses(island, member);
        island[member].solver.sweeps().0.pressed = pressed;
    }
    for member in 0..island.len() {
        let Worker { index, body, solver, state, report, .. } = &mut island[member];
        let (descent, contacts) = solver.sweeps();
        iterations = descent.schedule.iterations;
        contacts.press(&[]);
        descent.start(&frame.of(*index), share, body, contacts, state, report);
    }
    pairs.assign();
    for _ in 0..iterations {
        for member in 0..island.len() {
            if !pairs.is_empty() {
                let pressed = pairs.on(island, member);
                island[member].solver.sweeps().1.press(pressed);
            }
            let Worker { body, solver, state, .. } = &mut island[member];
            let (descent, contacts) = solver.sweeps();
            descent.sweep(frame, body, contacts, state);
        }
    }
    for Worker { index, body, solver, state, report, .. } in island.iter_mut() {
        let descent = solver.sweeps().0;
        report.iterations += iterations;
        descent.take_velocities(&frame.of(*index), body, state);
    }
}

impl DescentIntegrator {
    /// For `body`; `alone`: the calling thread sweeps, and not a pool's.
    pub fn new(schedule: Descent, body: &Body, alone: bool) -> Self {
        let zeros = vec![Vec3A::ZERO; body.len()];
        Self {
            schedule,
            start: zeros.clone(),
            predictor: zeros.clone(),
            guess: zeros,
            fixed: vec![false; body.len()],
            held: vec![false; body.len()],
            loaded: false,
            pressed: false,
            isa: Isa::detect(),
            alone,
        }
    }

    /// A substep's length [s].
    fn step(&self, frame: &Frame<'_>) -> f32 {
        (frame.dt / self.schedule.substeps as f64) as f32
    }

    /// Predicts where the body is when `share` of the frame is over, and moves it to where the sweeps start from.
    fn start(
        &mut self,
        frame: &Frame<'_>,
        share: f64,
        body: &Body,
        contacts: &Contacts,
        state: &mut BodyState,
        report: &mut StepReport,
    ) {
        let h = self.step(frame);
        let gravity = frame.gravity.as_vec3a();
        self.start.copy_from_slice(&state.x);
        let flies = self.schedule.start == Start::Adaptive && !self.pressed && self.flies_freely(contacts);
        // A body in free flight that no load pushes falls exactly: gravity's part of its motion is uniform and integrated as h^2/2 g. Elsewhere
        // implicit Euler's h^2 g.
        let reach = if flies && !self.loaded { 0.5 * h * h } else { h * h };
        for (y, (x, v)) in self.predictor.iter_mut().zip(state.x.iter().zip(&state.v)) {
            *y = x + h * v + reach * gravity;
        }
        frame.for_loads(body, |i, force| {
            self.predictor[i] += force.as_vec3a() * (h * h / body.vertices[i].mass);
        });
        self.guess(flies, h, gravity, state);
        self.place_fixed(frame, share, body);
        report.grasp_limited += usize::from(!self.start_sweeps(body, state));
    }

    /// Sweeps over all vertices once.
    fn sweep(&mut self, frame: &Frame<'_>, body: &Body, contacts: &Contacts, state: &mut BodyState) {
        let substep = Substep {
            body,
            h: self.step(frame),
            start: &self.start,
            predictor: &self.predictor,
            fixed: &self.fixed,
            contacts,
            isa: self.isa,
            alone: self.alone,
        };
        substep.sweep(&mut state.x, &mut self.guess);
    }

    /// Where the sweeps would like to start from.
    fn guess(&mut self, flies: bool, h: f32, gravity: Vec3A, state: &BodyState) {
        if flies || self.schedule.start == Start::Inertial {
            self.guess.copy_from_slice(&self.predictor);
            return;
        }
        for (i, guess) in self.guess.iter_mut().enumerate() {
            *guess = state.x[i] + h * state.v[i] + h * h * state.falling[i] * gravity;
        }
    }

    /// Sets the guess of held vertices to where the tool prescribes them, and of pinned ones to where they are.
    fn place_fixed(&mut self, frame: &Frame<'_>, share: f64, body: &Body) {
        for (i, _) in self.fixed.iter().enumerate().filter(|(_, fixed)| **fixed) {
            self.guess[i] = self.start[i];
        }
        frame.for_held(body, share, |vertex, x| self.guess[vertex] = x);
    }

    /// The velocity after the substep: v + h g + (x - y)/h. That is (x - x_start)/h for implicit Euler's predictor, and exact for the one of free
    /// flight; but the rounding of positions far from the body's origin does not enter it.
    fn take_velocities(&mut self, frame: &Frame<'_>, body: &Body, state: &mut BodyState) {
        let (h, gravity) = (self.step(frame), frame.gravity.as_vec3a());
        let strength = gravity.length_squared();
        let direction = if strength > 0.0 { gravity / strength } else { Vec3A::ZERO };
        // What a load does to a node by itself; falling counts what is left of gravity beside it.
        frame.for_loads(body, |i, force| self.predictor[i] -= force.as_vec3a() * (h * h / body.vertices[i].mass));
        for i in 0..state.x.len() {
            if self.fixed[i] {
                state.v[i] = Vec3A::ZERO;
                state.falling[i] = 0.0;
                continue;
            }
            let velocity = state.v[i] + h * gravity + (state.x[i] - self.predictor[i]) / h;
            state.falling[i] = ((velocity - state.v[i]) / h).dot(direction).clamp(0.0, 1.0);
            state.v[i] = velocity;
        }
    }

    /// Marks the vertices that are fixed during this frame.
    pub fn begin(&mut self, frame: &Frame<'_>, body: &Body) {
        self.loaded = frame.loads.iter().any(|load| load.body == frame.index);
        self.held.fill(false);
        for grasp in frame.rigid_grasps() {
            for node in &grasp.nodes {
                self.held[body.internal[*node as usize] as usize] = true;
            }
        }
        for (i, fixed) in self.fixed.iter_mut().enumerate() {
            *fixed = body.vertices[i].pinned || self.held[i];
        }
    }

    /// Whether nothing holds or touches the body.
    fn flies_freely(&self, contacts: &Contacts) -> bool {
        !self.fixed.contains(&true) && contacts.flies(|i| self.start[i])
    }

    /// Moves the body to as much of its guess as squeezes no element too far: first all of it, then less of the free vertices' guess, and only then less
    /// of the held vertices' prescribed motion; false if it was less of that.
    fn start_sweeps(&self, body: &Body, state: &mut BodyState) -> bool {
        let mut followed = false;
        for (free, held) in START_SHARES {
            for (i, x) in state.x.iter_mut().enumerate() {
                let share = if self.held[i] { held } else { free };
                *x = if share == 1.0 { self.guess[i] } else { self.start[i].lerp(self.guess[i], share) };
            }
            followed = held == 1.0;
            if !self.squeezes(body, &state.x) && !self.overstretches(body, &state.x) {
                break;
            }
        }
        followed
    }

    /// Whether an element has too little of the volume that it had at the substep's beginning.
    fn squeezes(&self, body: &Body, x: &[Vec3A]) -> bool {
        if let Some(elements) = &body.elements {
            return elements.any_squeezed(self.isa, &self.start, x);
        }
        body.tets.iter().zip(&body.volumes).any(|(tet, volume)| {
            let ratio = |x: &[Vec3A]| volume_ratio(tet, x, *volume as f32);
            is_squeezed(ratio(x), ratio(&self.start))
        })
    }

    /// Whether an edge at a held vertex is stretched too far, and further than at the substep's beginning.
    fn overstretches(&self, body: &Body, x: &[Vec3A]) -> bool {
        let too_long = |i: usize, to: u32, length: f32| {
            let (now, before) = (x[to as usize] - x[i], self.start[to as usize] - self.start[i]);
            let now = now.length_squared();
            now > (HELD_STRETCH * length).powi(2) && now > before.length_squared()
        };
        let mut held = (0..x.len()).filter(|i| self.held[*i]);
        held.any(|i| body.edges_of(i).iter().any(|e| too_long(i, e.to, e.length)))
    }
}

#[inline(always)]
pub(crate) fn volume_ratio(tet: &[u32; 4], x: &[Vec3A], rest: f32) -> f32 {
    let [a, b, c, d] = tet.map(|i| x[i as usize]);
    (b - a).cross(c - a).dot(d - a) / (6.0 * rest)
}
