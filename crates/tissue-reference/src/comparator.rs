//! The comparators as integrators of the stepper: a frame in double precision.

use crate::mechanics::{Mechanics, Particles, Span};
use crate::semi_implicit::{self, SemiImplicit};
use crate::xpbd;
use crate::xpbd_settings::Xpbd;
use glam::DVec3;
use trocar_tissue::{Body, BodyFrame, BodyMotion, Integrator, Outcome};

/// A comparator with its memory for one body.
pub struct Comparator {
    method: Method,
    mechanics: Mechanics,
    particles: Particles,
    /// Of gravity and loads (m/s2).
    accelerations: Vec<DVec3>,
    fixed: Vec<bool>,
    targets: Vec<DVec3>,
}

/// Which one, and its scratch memory.
enum Method {
    SemiImplicit { substeps: usize, force: Vec<DVec3> },
    Xpbd { settings: Xpbd, scratch: Box<xpbd::Scratch> },
}

impl Comparator {
    /// Semi-implicit Euler for `body`.
    pub fn semi_implicit(settings: SemiImplicit, body: &Body) -> Self {
        Self::new(body, |mechanics| Method::SemiImplicit {
            substeps: settings.substeps,
            force: vec![DVec3::ZERO; mechanics.masses.len()],
        })
    }

    /// XPBD for `body`.
    pub fn xpbd(settings: Xpbd, body: &Body) -> Self {
        Self::new(body, |mechanics| Method::Xpbd { settings, scratch: Box::new(xpbd::Scratch::new(mechanics)) })
    }

    fn new(body: &Body, method: impl FnOnce(&Mechanics) -> Method) -> Self {
        let mechanics = Mechanics::new(body);
        let zeros = vec![DVec3::ZERO; body.len()];
        Self {
            method: method(&mechanics),
            mechanics,
            particles: Particles { x: zeros.clone(), v: zeros.clone() },
            accelerations: zeros.clone(),
            fixed: vec![false; body.len()],
            targets: zeros,
        }
    }
}

impl Integrator for Comparator {
    fn advance(&mut self, frame: &BodyFrame<'_>, motion: &mut BodyMotion) -> Outcome {
        let Self { method, mechanics, particles, accelerations, fixed, targets } = self;
        let body = frame.body();
        let numbers = body.solver_numbers();
        for (node, number) in numbers.iter().enumerate() {
            let i = *number as usize;
            fixed[i] = body.pinned()[node];
            particles.x[i] = motion.positions[node];
            particles.v[i] = motion.velocities[node];
        }
        for node in frame.held_nodes() {
            fixed[numbers[node as usize] as usize] = true;
        }
        targets.copy_from_slice(&particles.x);
        for (node, x) in frame.targets(1.0) {
            // A state keeps positions in single precision.
            targets[numbers[node as usize] as usize] = (x - body.origin()).as_vec3a().as_dvec3();
        }
        accelerations.fill(frame.gravity());
        for (node, force) in frame.loads() {
            let i = numbers[node] as usize;
            accelerations[i] += force / mechanics.masses[i];
        }
        let span = Span { dt: frame.dt(), accelerations, fixed, targets };
        // A body that reaches the speed limit keeps its state: the stepper's report finds it.
        let iterations = match method {
            Method::SemiImplicit { substeps, force } => {
                semi_implicit::advance(mechanics, body.material(), particles, span, *substeps, force);
                *substeps
            }
            Method::Xpbd { settings, scratch } => {
                xpbd::advance(settings, mechanics, body.material(), particles, span, scratch);
                settings.substeps * settings.iterations
            }
        };
        for (node, number) in numbers.iter().enumerate() {
            motion.positions[node] = particles.x[*number as usize];
            motion.velocities[node] = particles.v[*number as usize];
        }
        Outcome { iterations, unsolved: false }
    }
}
