//! Vertex Block Descent of one body: predict, start, sweep, take the velocity.

use super::stretched::StretchedElements;
use super::sweep;
use super::vertex_step::Substep;
use crate::contact::ContactSet;
use crate::frame::Frame;
use crate::inversion_guard::{HELD_STRETCH, is_squeezed, volume_ratio};
use crate::settings::{Descent, Start};
use crate::state::BodyState;
use crate::{Body, Isa, StepReport};
use glam::Vec3A;

/// Shares of the guessed motion of free vertices, and of the prescribed motion of held ones, that
/// are tried at the beginning of a substep until no element is squeezed too far.
const START_SHARES: [(f32, f32); 8] =
    [(1.0, 1.0), (0.5, 1.0), (0.25, 1.0), (0.0, 1.0), (0.0, 0.5), (0.0, 0.25), (0.0, 0.125), (0.0, 0.0)];

/// The sweeps of one body, with their scratch memory.
pub(crate) struct BodyDescent {
    pub settings: Descent,
    start: Vec<Vec3A>,
    predictor: Vec<Vec3A>,
    guess: Vec<Vec3A>,
    fixed: Vec<bool>,
    held: Vec<bool>,
    /// Whether loads act on it in the frame.
    loaded: bool,
    /// Whether another body presses it when a substep begins.
    pub pressed: bool,
    /// Elements that may be stretched beyond the limit in the frame.
    stretched: StretchedElements,
    isa: Isa,
    single_thread: bool,
}

impl BodyDescent {
    /// For `body`; `single_thread`: the calling thread does all the work.
    pub fn new(settings: Descent, body: &Body, single_thread: bool) -> Self {
        let zeros = vec![Vec3A::ZERO; body.len()];
        Self {
            settings,
            start: zeros.clone(),
            predictor: zeros.clone(),
            guess: zeros,
            fixed: vec![false; body.len()],
            held: vec![false; body.len()],
            loaded: false,
            pressed: false,
            stretched: StretchedElements::default(),
            isa: Isa::detect(),
            single_thread,
        }
    }

    /// A substep's length (s).
    fn substep_length(&self, frame: &Frame<'_>) -> f32 {
        (frame.dt / self.settings.substeps as f64) as f32
    }

    /// Predicts the body for the time when `share` of the frame is over, and moves it to where the
    /// sweeps start from.
    pub fn start(
        &mut self,
        frame: &Frame<'_>,
        share: f64,
        body: &Body,
        contacts: &ContactSet,
        state: &mut BodyState,
        report: &mut StepReport,
    ) {
        let h = self.substep_length(frame);
        let gravity = frame.gravity.as_vec3a();
        self.start.copy_from_slice(&state.x[..body.len()]);
        let flies = self.settings.start == Start::Adaptive && !self.pressed && self.flies_freely(body, contacts);
        // A body in free flight that no load pushes falls exactly: gravity's part of its motion is
        // uniform and integrated as h^2/2 g. Elsewhere implicit Euler's h^2 g.
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
    pub fn sweep(&mut self, frame: &Frame<'_>, body: &Body, contacts: &ContactSet, state: &mut BodyState) {
        let substep = Substep {
            body,
            h: self.substep_length(frame),
            start: &self.start,
            predictor: &self.predictor,
            fixed: &self.fixed,
            contacts,
            stretched: &self.stretched,
            isa: self.isa,
            single_thread: self.single_thread,
        };
        sweep::sweep(&substep, &mut state.x[..body.len()], &mut self.guess);
    }

    /// Guesses where the sweeps start from.
    fn guess(&mut self, flies: bool, h: f32, gravity: Vec3A, state: &BodyState) {
        if flies || self.settings.start == Start::Inertial {
            self.guess.copy_from_slice(&self.predictor);
            return;
        }
        for (i, guess) in self.guess.iter_mut().enumerate() {
            *guess = state.x[i] + h * state.v[i] + h * h * state.warm.falling[i] * gravity;
        }
    }

    /// Sets the guess of held vertices to their targets, and of pinned ones to where they are.
    fn place_fixed(&mut self, frame: &Frame<'_>, share: f64, body: &Body) {
        for (i, _) in self.fixed.iter().enumerate().filter(|(_, fixed)| **fixed) {
            self.guess[i] = self.start[i];
        }
        frame.for_held(body, share, |vertex, x| self.guess[vertex] = x);
    }

    /// The velocity after the substep: v + h g + (x - y)/h. It equals (x - x_start)/h for implicit
    /// Euler's predictor, and is exact for free flight; but the rounding of positions far from the
    /// body's origin does not enter it.
    pub fn take_velocities(&mut self, frame: &Frame<'_>, body: &Body, state: &mut BodyState) {
        let (h, gravity) = (self.substep_length(frame), frame.gravity.as_vec3a());
        let strength = gravity.length_squared();
        let direction = if strength > 0.0 { gravity / strength } else { Vec3A::ZERO };
        // The share of gravity that acts is counted without the loads' own accelerations.
        frame.for_loads(body, |i, force| self.predictor[i] -= force.as_vec3a() * (h * h / body.vertices[i].mass));
        for i in 0..body.len() {
            if self.fixed[i] {
                state.v[i] = Vec3A::ZERO;
                state.warm.falling[i] = 0.0;
                continue;
            }
            let velocity = state.v[i] + h * gravity + (state.x[i] - self.predictor[i]) / h;
            state.warm.falling[i] = ((velocity - state.v[i]) / h).dot(direction).clamp(0.0, 1.0);
            state.v[i] = velocity;
        }
    }

    /// Marks the vertices that are fixed during this frame, and finds the elements that are
    /// stretched far.
    pub fn begin_frame(&mut self, frame: &Frame<'_>, body: &Body, state: &BodyState) {
        self.stretched.find(body, &state.x);
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
    fn flies_freely(&self, body: &Body, contacts: &ContactSet) -> bool {
        !self.fixed.contains(&true) && contacts.is_idle(|i| body.place(&self.start, i as u32))
    }

    /// Moves the body to as much of its guess as squeezes no element too far: first all of it, then
    /// less of the free vertices' guess, and only then less of the held vertices' prescribed
    /// motion. Returns false in the last case.
    fn start_sweeps(&self, body: &Body, state: &mut BodyState) -> bool {
        let mut followed = false;
        for (free, held) in START_SHARES {
            for (i, x) in state.x[..body.len()].iter_mut().enumerate() {
                let share = if self.held[i] { held } else { free };
                *x = if share == 1.0 { self.guess[i] } else { self.start[i].lerp(self.guess[i], share) };
            }
            followed = held == 1.0;
            let x = &state.x[..body.len()];
            if !self.squeezes(body, x) && !self.overstretches(body, x) {
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

    /// Whether an edge at a held vertex is stretched too far, and farther than at the substep's
    /// beginning.
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
