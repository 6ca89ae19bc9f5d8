//! The oracle's step as an integrator of the stepper, for studies: slow, and it allocates.

use super::newton::Solver;
use super::potential::{Elastic, Motion, Potential};
use super::rounds;
use super::solution::Precision;
use super::state::Nodes;
use glam::DVec3;
use trocar_tissue::{Body, BodyFrame, BodyMotion, Integrator, Outcome};

/// Implicit Euler by Newton's method with a sparse direct solve, to [`Precision::default`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Newton {
    /// Substeps a frame.
    pub substeps: usize,
}

/// Newton's method for one body.
pub struct NewtonIntegrator {
    substeps: usize,
    elastic: Elastic,
    solver: Solver,
}

impl NewtonIntegrator {
    /// For `body`.
    pub fn new(settings: Newton, body: &Body) -> Self {
        let elastic = Elastic::new(body);
        let solver = Solver::of(&elastic, Precision::default());
        Self { substeps: settings.substeps, elastic, solver }
    }
}

impl Integrator for NewtonIntegrator {
    /// A substep without a minimum ends the frame; the body is then where the substep began.
    fn advance(&mut self, frame: &BodyFrame<'_>, motion: &mut BodyMotion) -> Outcome {
        let (body, h) = (frame.body(), frame.dt() / self.substeps as f64);
        let mut nodes = Nodes::new(body, motion);
        let mut fixed = body.pinned().to_vec();
        frame.held_nodes().for_each(|node| fixed[node as usize] = true);
        let mut outcome = Outcome::default();
        for substep in 1..=self.substeps {
            let mut targets = nodes.x.clone();
            let share = substep as f64 / self.substeps as f64;
            frame.targets(share).for_each(|(node, x)| targets[node as usize] = x);
            let elastic = &self.elastic;
            let mut step = Motion::new(elastic, &nodes, frame.gravity(), h);
            frame.loads().for_each(|(node, force)| step.push(elastic, node, force));
            let mut potential = Potential {
                elastic,
                motion: Some(step),
                gravity: frame.gravity(),
                limits: Vec::new(),
                contacts: None,
                tethers: &[],
            };
            let mut x = nodes.x.clone();
            match rounds::minimise(&mut self.solver, &mut potential, &fixed, &targets, &nodes.v, &mut x) {
                Ok(solution) => outcome.iterations += solution.iterations,
                Err(_) => {
                    outcome.unsolved = true;
                    break;
                }
            }
            for (i, v) in nodes.v.iter_mut().enumerate() {
                *v = if fixed[i] { DVec3::ZERO } else { (x[i] - nodes.x[i]) / h };
            }
            nodes.anchors = potential.anchors(&x);
            nodes.x = x;
        }
        nodes.write(body, motion);
        outcome
    }
}
