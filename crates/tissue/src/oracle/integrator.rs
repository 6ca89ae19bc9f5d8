//! The oracle's step as a solver of the stepper, for experiments: slow, and it allocates.

use super::newton::Solver;
use super::potential::{Elastic, Motion, Potential};
use super::state::Nodes;
use super::{EARTH, Precision, friction};
use crate::integrator::{Frame, Worker};
use crate::report::Divergence;
use crate::state::BodyState;
use crate::{Body, StepReport};
use glam::DVec3;

/// Implicit Euler by Newton's method with a sparse direct solve, to [`Precision::default`], in so many substeps a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Newton {
    /// Substeps a frame.
    pub substeps: usize,
}

/// The solver of one body.
pub(crate) struct NewtonIntegrator {
    substeps: usize,
    elastic: Elastic,
    solver: Solver,
}

impl NewtonIntegrator {
    pub fn new(settings: Newton, body: &Body) -> Self {
        let elastic = Elastic::new(body);
        let precision = Precision::default();
        let tolerance = precision.gradient * EARTH * elastic.masses.iter().sum::<f64>();
        Self { substeps: settings.substeps, elastic, solver: Solver::new(tolerance, precision.iterations) }
    }
}

impl crate::integrator::Solver for NewtonIntegrator {
    const COUPLES: bool = false;

    fn advance(island: &mut [Worker<Self>], frame: &Frame<'_>) {
        for Worker { index, body, solver, state, report, .. } in island {
            solver.step(&frame.of(*index), body, state, report);
        }
    }
}

impl NewtonIntegrator {
    fn step(&mut self, frame: &Frame<'_>, body: &Body, state: &mut BodyState, report: &mut StepReport) {
        let h = frame.dt / self.substeps as f64;
        let place = |x: glam::Vec3A| body.origin + x.as_dvec3();
        let internal = |node: usize| body.internal[node] as usize;
        let mut nodes = Nodes {
            x: (0..body.len()).map(|i| place(state.x[internal(i)])).collect(),
            v: (0..body.len()).map(|i| state.v[internal(i)].as_dvec3()).collect(),
            anchors: super::state::anchors(body, state),
        };
        let mut fixed = body.pinned().to_vec();
        frame.grasps().flat_map(|grasp| &grasp.nodes).for_each(|node| fixed[*node as usize] = true);
        for substep in 1..=self.substeps {
            let mut targets = nodes.x.clone();
            let share = substep as f64 / self.substeps as f64;
            for grasp in frame.grasps() {
                if let Some(tool) = frame.tools.get(grasp.tool) {
                    grasp.prescribed(&tool.at(share)).for_each(|(node, x)| targets[node as usize] = x);
                }
            }
            let elastic = &self.elastic;
            let mut motion = Motion::new(elastic, &nodes, frame.gravity, h);
            for load in frame.loads.iter().filter(|load| load.body == frame.index) {
                motion.push(elastic, load.node, load.force);
            }
            let mut potential = Potential { elastic, motion: Some(motion), gravity: frame.gravity, limits: Vec::new() };
            let mut x = nodes.x.clone();
            match friction::minimise(&mut self.solver, &mut potential, &fixed, &targets, &nodes.v, &mut x) {
                Ok(solution) => report.iterations += solution.iterations,
                Err(_) => {
                    report.divergence = Some(Divergence::Unsolved { body: frame.index });
                    break;
                }
            }
            for (i, v) in nodes.v.iter_mut().enumerate() {
                *v = if fixed[i] { DVec3::ZERO } else { (x[i] - nodes.x[i]) / h };
            }
            nodes.anchors = potential.anchors(&x);
            nodes.x = x;
        }
        super::state::set_anchors(body, &nodes.anchors, state);
        for node in 0..body.len() {
            let i = internal(node);
            state.x[i] = (nodes.x[node] - body.origin).as_vec3a();
            state.v[i] = nodes.v[node].as_vec3a();
            state.falling[i] = 0.0;
        }
    }
}
