//! One frame of simulation.

use crate::state::BodyState;
use crate::sweep::{LocalPlane, Substep, is_squeezed};
use crate::{Body, Grasp, Model, Schedule, Start, State, SupportPlane, ToolMotion};
use glam::{DVec3, Vec3A};
use rayon::prelude::*;

/// A node at this speed [m/s] has diverged (the paper's particle velocity limit).
const SPEED_LIMIT: f64 = 20.0;

/// An edge of more than this many rest lengths has diverged.
const STRETCH_LIMIT: f32 = 10.0;

/// Held nodes go no farther from their neighbours than this many rest lengths of the edge between them.
const HELD_STRETCH: f32 = 7.0;

/// How much of the guessed motion of free vertices, and of the prescribed motion of held ones, is tried at the beginning of a
/// substep, until no element is squeezed too far by it.
const START_SHARES: [(f32, f32); 8] =
    [(1.0, 1.0), (0.5, 1.0), (0.25, 1.0), (0.0, 1.0), (0.0, 0.5), (0.0, 0.25), (0.0, 0.125), (0.0, 0.0)];

/// Why a run is over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Divergence {
    /// A position or velocity is not finite; the state is the last finite frame's.
    NonFinite {
        /// The body.
        body: usize,
    },
    /// A node reached the speed limit of 20 m/s.
    OverSpeed {
        /// The body.
        body: usize,
    },
    /// An edge is longer than 10 times its rest length.
    OverStretch {
        /// The body.
        body: usize,
    },
}

impl std::fmt::Display for Divergence {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NonFinite { body } => write!(f, "body {body} has a position that is not finite"),
            Self::OverSpeed { body } => write!(f, "a node of body {body} is at the speed limit of {SPEED_LIMIT} m/s"),
            Self::OverStretch { body } => {
                write!(f, "an edge of body {body} is over {STRETCH_LIMIT} times its rest length")
            }
        }
    }
}

/// What happened in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepReport {
    /// Largest node speed at the end of the frame [m/s].
    pub max_speed: f64,
    /// Elements with signed volume at or below 0 at the end of the frame.
    pub inverted: usize,
    /// Smallest ratio of an element's volume to its rest volume.
    pub min_volume_ratio: f64,
    /// Substeps in which held nodes could not follow the tool without inverting or overstretching an element; they catch up later.
    pub grasp_limited: usize,
    /// The event that ended the run, if any.
    pub divergence: Option<Divergence>,
}

impl Default for StepReport {
    fn default() -> Self {
        Self { max_speed: 0.0, inverted: 0, min_volume_ratio: f64::INFINITY, grasp_limited: 0, divergence: None }
    }
}

/// Advances states of one model; owns all scratch memory, so stepping allocates nothing.
pub struct Stepper {
    schedule: Schedule,
    pool: Option<rayon::ThreadPool>,
    scratch: Vec<Scratch>,
}

/// A body's scratch memory.
struct Scratch {
    start: Vec<Vec3A>,
    predictor: Vec<Vec3A>,
    guess: Vec<Vec3A>,
    fixed: Vec<bool>,
    held: Vec<bool>,
    planes: Vec<LocalPlane>,
    before: BodyState,
    report: StepReport,
}

impl Stepper {
    /// Prepares scratch memory and `threads` worker threads (0: as many as the machine has). The result does not depend on
    /// the number of threads.
    pub fn new(model: &Model, schedule: Schedule, threads: usize) -> Self {
        // Where no thread can be started, the calling thread does the work.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().ok();
        let scratch = State::new(model).bodies.into_iter().zip(&model.bodies);
        let scratch = scratch.map(|(before, body)| Scratch::new(before, body)).collect();
        Self { schedule, pool, scratch }
    }

    /// Advances `state` by one frame of `dt` [s]. `tool` is the motion of the tool that holds the state's grasp; without one, held nodes stay
    /// where they are.
    pub fn step(&mut self, model: &Model, state: &mut State, dt: f64, tool: Option<&ToolMotion>) -> StepReport {
        let State { time, grasp, bodies } = state;
        let frame = Frame {
            schedule: self.schedule,
            h: dt / self.schedule.substeps as f64,
            gravity: model.gravity,
            grasp: grasp.as_ref(),
            tool,
        };
        let scratch = &mut self.scratch;
        let mut advance = || {
            let parts = bodies.par_iter_mut().zip(scratch.par_iter_mut()).zip(&model.bodies).enumerate();
            parts.for_each(|(index, ((state, scratch), body))| frame.advance(index, body, state, scratch));
        };
        match &self.pool {
            Some(pool) => pool.install(advance),
            None => advance(),
        }
        *time += dt;
        self.scratch.iter().fold(StepReport::default(), |all, scratch| all.with(&scratch.report))
    }
}

impl StepReport {
    fn with(self, other: &Self) -> Self {
        Self {
            max_speed: self.max_speed.max(other.max_speed),
            inverted: self.inverted + other.inverted,
            min_volume_ratio: self.min_volume_ratio.min(other.min_volume_ratio),
            grasp_limited: self.grasp_limited + other.grasp_limited,
            divergence: self.divergence.or(other.divergence),
        }
    }
}

impl Scratch {
    fn new(before: BodyState, body: &Body) -> Self {
        let zeros = vec![Vec3A::ZERO; body.len()];
        let local = |plane: &SupportPlane| LocalPlane {
            point: (plane.point - body.origin).as_vec3a(),
            normal: plane.normal.as_vec3a(),
            friction: plane.friction as f32,
        };
        Self {
            start: zeros.clone(),
            predictor: zeros.clone(),
            guess: zeros,
            fixed: vec![false; body.len()],
            held: vec![false; body.len()],
            planes: body.supports.iter().map(local).collect(),
            before,
            report: StepReport::default(),
        }
    }
}

/// What the bodies of one frame share.
struct Frame<'a> {
    schedule: Schedule,
    /// Substep [s].
    h: f64,
    gravity: DVec3,
    grasp: Option<&'a Grasp>,
    tool: Option<&'a ToolMotion>,
}

impl Frame<'_> {
    /// Advances one body by the frame.
    fn advance(&self, index: usize, body: &Body, state: &mut BodyState, scratch: &mut Scratch) {
        scratch.report = StepReport::default();
        scratch.before.copy_from(state);
        let grasp = self.grasp.filter(|g| g.body == index);
        mark_fixed(body, grasp, scratch);
        for substep in 1..=self.schedule.substeps {
            self.substep(substep as f64 / self.schedule.substeps as f64, body, grasp, state, scratch);
        }
        measure(index, body, state, &mut scratch.report);
        if matches!(scratch.report.divergence, Some(Divergence::NonFinite { .. })) {
            state.copy_from(&scratch.before);
        }
    }

    /// One substep of implicit Euler: predict, start, sweep, take the velocity.
    fn substep(&self, share: f64, body: &Body, grasp: Option<&Grasp>, state: &mut BodyState, scratch: &mut Scratch) {
        let h = self.h as f32;
        let gravity = self.gravity.as_vec3a();
        scratch.start.copy_from_slice(&state.x);
        let flies = self.schedule.start == Start::Adaptive && flies_freely(scratch);
        // A body in free flight falls exactly: gravity's part of its motion is uniform and integrated as h^2/2 g. Elsewhere
        // implicit Euler's h^2 g.
        let reach = if flies { 0.5 * h * h } else { h * h };
        for (y, (x, v)) in scratch.predictor.iter_mut().zip(state.x.iter().zip(&state.v)) {
            *y = x + h * v + reach * gravity;
        }
        self.guess(flies, state, scratch);
        self.move_held(share, body, grasp, scratch);
        start_sweeps(body, state, scratch);
        let substep = Substep {
            body,
            h,
            start: &scratch.start,
            predictor: &scratch.predictor,
            fixed: &scratch.fixed,
            planes: &scratch.planes,
        };
        for _ in 0..self.schedule.iterations {
            substep.sweep(&mut state.x, &mut scratch.guess);
        }
        self.take_velocities(state, scratch);
    }

    /// Where the sweeps would like to start from.
    fn guess(&self, flies: bool, state: &BodyState, scratch: &mut Scratch) {
        let h = self.h as f32;
        if flies || self.schedule.start == Start::Inertial {
            scratch.guess.copy_from_slice(&scratch.predictor);
            return;
        }
        let gravity = self.gravity.as_vec3a();
        for (i, guess) in scratch.guess.iter_mut().enumerate() {
            *guess = state.x[i] + h * state.v[i] + h * h * state.falling[i] * gravity;
        }
    }

    /// Sets the guess of held vertices to where the tool prescribes them, and of pinned ones to where they are.
    fn move_held(&self, share: f64, body: &Body, grasp: Option<&Grasp>, scratch: &mut Scratch) {
        for (i, _) in scratch.fixed.iter().enumerate().filter(|(_, fixed)| **fixed) {
            scratch.guess[i] = scratch.start[i];
        }
        if let (Some(grasp), Some(tool)) = (grasp, self.tool) {
            for (node, x) in grasp.prescribed(&tool.at(share)) {
                scratch.guess[body.internal[node as usize] as usize] = (x - body.origin).as_vec3a();
            }
        }
    }

    /// The velocity after the substep: v + h g + (x - y)/h. That is (x - x_start)/h for implicit Euler's predictor, and exact for the one of free
    /// flight; but the rounding of positions far from the body's origin does not enter it.
    fn take_velocities(&self, state: &mut BodyState, scratch: &Scratch) {
        let h = self.h as f32;
        let gravity = self.gravity.as_vec3a();
        let strength = self.gravity.length_squared() as f32;
        let direction = if strength > 0.0 { gravity / strength } else { Vec3A::ZERO };
        for i in 0..state.x.len() {
            if scratch.fixed[i] {
                state.v[i] = Vec3A::ZERO;
                state.falling[i] = 0.0;
                continue;
            }
            let velocity = state.v[i] + h * gravity + (state.x[i] - scratch.predictor[i]) / h;
            state.falling[i] = ((velocity - state.v[i]) / h).dot(direction).clamp(0.0, 1.0);
            state.v[i] = velocity;
        }
    }
}

fn mark_fixed(body: &Body, grasp: Option<&Grasp>, scratch: &mut Scratch) {
    scratch.held.fill(false);
    if let Some(grasp) = grasp {
        for node in &grasp.nodes {
            scratch.held[body.internal[*node as usize] as usize] = true;
        }
    }
    for (i, fixed) in scratch.fixed.iter_mut().enumerate() {
        *fixed = body.vertices[i].pinned || scratch.held[i];
    }
}

/// Whether nothing holds or touches the body.
fn flies_freely(scratch: &Scratch) -> bool {
    !scratch.fixed.contains(&true)
        && scratch.planes.iter().all(|plane| scratch.start.iter().all(|x| plane.height(*x) >= 0.0))
}

/// Moves the body to as much of its guess as squeezes no element too far: first all of it, then less of the free vertices' guess, and only then less
/// of the held vertices' prescribed motion.
fn start_sweeps(body: &Body, state: &mut BodyState, scratch: &mut Scratch) {
    for (free, held) in START_SHARES {
        for (i, x) in state.x.iter_mut().enumerate() {
            let share = if scratch.held[i] { held } else { free };
            *x = if share == 1.0 { scratch.guess[i] } else { scratch.start[i].lerp(scratch.guess[i], share) };
        }
        let squeezed = |(tet, volume): (&[u32; 4], &f64)| {
            let ratio = |x: &[Vec3A]| volume_ratio(tet, x, *volume as f32);
            is_squeezed(ratio(&state.x), ratio(&scratch.start))
        };
        if !body.tets.iter().zip(&body.volumes).any(squeezed) && !overstretches(body, &state.x, scratch) {
            scratch.report.grasp_limited += usize::from(held < 1.0);
            return;
        }
    }
}

/// Whether an edge at a held vertex is stretched too far, and further than at the substep's beginning.
fn overstretches(body: &Body, x: &[Vec3A], scratch: &Scratch) -> bool {
    let too_long = |i: usize, to: u32, length: f32| {
        let (now, before) = (x[to as usize] - x[i], scratch.start[to as usize] - scratch.start[i]);
        let now = now.length_squared();
        now > (HELD_STRETCH * length).powi(2) && now > before.length_squared()
    };
    let held = (0..x.len()).filter(|i| scratch.held[*i]);
    held.into_iter().any(|i| body.edges_of(i).iter().any(|e| too_long(i, e.to, e.length)))
}

#[inline(always)]
fn volume_ratio(tet: &[u32; 4], x: &[Vec3A], rest: f32) -> f32 {
    let [a, b, c, d] = tet.map(|i| x[i as usize]);
    (b - a).cross(c - a).dot(d - a) / (6.0 * rest)
}

/// Fills in the frame's report.
fn measure(index: usize, body: &Body, state: &BodyState, report: &mut StepReport) {
    let finite = state.x.iter().chain(&state.v).all(|p| p.is_finite());
    if !finite {
        report.divergence = Some(Divergence::NonFinite { body: index });
        return;
    }
    report.max_speed = f64::from(state.v.iter().map(|v| v.length_squared()).fold(0.0, f32::max)).sqrt();
    for (tet, rest) in body.tets.iter().zip(&body.volumes) {
        let [a, b, c, d] = tet.map(|i| state.x[i as usize].as_dvec3());
        let volume = (b - a).cross(c - a).dot(d - a) / 6.0;
        report.inverted += usize::from(volume <= 0.0);
        report.min_volume_ratio = report.min_volume_ratio.min(volume / rest);
    }
    let stretched = (0..state.x.len()).any(|i| {
        let too_long = |length: f32, j: u32| (state.x[j as usize] - state.x[i]).length() > STRETCH_LIMIT * length;
        body.edges_of(i).iter().any(|e| too_long(e.length, e.to))
    });
    if report.max_speed >= SPEED_LIMIT {
        report.divergence = Some(Divergence::OverSpeed { body: index });
    } else if stretched {
        report.divergence = Some(Divergence::OverStretch { body: index });
    }
}
