//! The comparators as solvers of the stepper: state in, a frame in double precision, state out.

use super::mechanics::{Mechanics, Particles, Span};
use super::{SemiImplicit, Xpbd, semi_implicit, xpbd};
use crate::integrator::{Frame, Solver, Worker};
use crate::state::BodyState;
use crate::{Body, StepReport};
use glam::DVec3;

/// A comparator with its memory for one body.
pub(crate) struct ComparatorIntegrator {
    scheme: Scheme,
    mechanics: Mechanics,
    particles: Particles,
    /// Of gravity and loads [m/s2].
    accelerations: Vec<DVec3>,
    fixed: Vec<bool>,
    targets: Vec<DVec3>,
}

/// Which one, and what it works in.
enum Scheme {
    SemiImplicit { substeps: usize, force: Vec<DVec3> },
    Xpbd { settings: Xpbd, scratch: Box<xpbd::Scratch> },
}

impl ComparatorIntegrator {
    pub fn semi_implicit(settings: SemiImplicit, body: &Body) -> Self {
        Self::new(body, |mechanics| Scheme::SemiImplicit {
            substeps: settings.substeps,
            force: vec![DVec3::ZERO; mechanics.masses.len()],
        })
    }

    pub fn xpbd(settings: Xpbd, body: &Body) -> Self {
        Self::new(body, |mechanics| Scheme::Xpbd { settings, scratch: Box::new(xpbd::Scratch::new(mechanics)) })
    }

    fn new(body: &Body, scheme: impl FnOnce(&Mechanics) -> Scheme) -> Self {
        let mechanics = Mechanics::new(body);
        let zeros = vec![DVec3::ZERO; body.len()];
        Self {
            scheme: scheme(&mechanics),
            mechanics,
            particles: Particles { x: zeros.clone(), v: zeros.clone() },
            accelerations: zeros.clone(),
            fixed: vec![false; body.len()],
            targets: zeros,
        }
    }
}

impl Solver for ComparatorIntegrator {
    const COUPLES: bool = false;

    fn advance(island: &mut [Worker<Self>], frame: &Frame<'_>) {
        for Worker { index, body, solver, state, report, .. } in island {
            solver.step(&frame.of(*index), body, state, report);
        }
    }
}

impl ComparatorIntegrator {
    fn step(&mut self, frame: &Frame<'_>, body: &Body, state: &mut BodyState, report: &mut StepReport) {
        let Self { scheme, mechanics, particles, accelerations, fixed, targets } = self;
        for i in 0..state.x.len() {
            fixed[i] = body.vertices[i].pinned;
            particles.x[i] = state.x[i].as_dvec3();
            particles.v[i] = state.v[i].as_dvec3();
        }
        for node in frame.grasps().flat_map(|grasp| &grasp.nodes) {
            fixed[body.internal[*node as usize] as usize] = true;
        }
        targets.copy_from_slice(&particles.x);
        frame.for_all_held(body, 1.0, |vertex, x| targets[vertex] = x.as_dvec3());
        accelerations.fill(frame.gravity);
        frame.for_loads(body, |i, force| accelerations[i] += force / mechanics.masses[i]);
        let span = Span { dt: frame.dt, accelerations, fixed, targets };
        // A body at the speed limit is one in the report too, which looks at the state that is left here.
        match scheme {
            Scheme::SemiImplicit { substeps, force } => {
                semi_implicit::advance(mechanics, &body.material, particles, span, *substeps, force);
                report.iterations += *substeps;
            }
            Scheme::Xpbd { settings, scratch } => {
                xpbd::advance(settings, mechanics, &body.material, particles, span, scratch);
                report.iterations += settings.substeps * settings.iterations;
            }
        }
        for i in 0..state.x.len() {
            state.x[i] = particles.x[i].as_vec3a();
            state.v[i] = particles.v[i].as_vec3a();
            state.falling[i] = 0.0;
        }
    }
}
