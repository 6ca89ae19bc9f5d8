//! The oracle: implicit Euler's step and the static equilibrium in double precision, converged.
//!
//! Every solver of this crate minimises the same function of the free nodes' positions x,
//!
//! 1/(2 dt^2) |x - y|_M^2 + sum V0 Psi(F) + dashpots + support planes, y = x0 + dt v0 + dt^2 g,
//!
//! and is judged by how near it comes to this one, which finds the minimum by Newton's method with a sparse direct solve. It is slow and meant for tests and
//! experiments. What is in it:
//!
//! - energies, stresses and their derivatives of [`crate::Hyperelastic`]; masses, dashpots and contact stiffness as the model holds them (rounded to `f32`);
//! - dashpots as the sweeps have them: quadratic in the change of an edge's squared length since the beginning of the step, so that no rigid motion meets them;
//! - the supports' one-sided quadratic penalty. Their friction is no potential, since its limit grows with the depth: it is minimised with the limits held
//!   and the limits are then taken anew, until the forces of the true law are in balance;
//! - pinned nodes stay; held nodes are prescribed. The stepper's rules for what cannot follow a tool (yielding grasps) are left out: a motion that
//!   cannot be followed is an error.
//!
//! The minimum is one for the steps of `Schedule::PAPER`'s kind. A body in free flight is stepped exactly by the default schedule,
//! by implicit Euler here.
//!
//! Everything runs on the calling thread in a fixed order: the same machine gives the same bits.

pub(crate) mod element;
mod factor;
mod friction;
mod guard;
mod integrator;
mod newton;
mod potential;
mod state;
#[cfg(test)]
mod tests;

pub use integrator::Newton;
pub(crate) use integrator::NewtonIntegrator;
pub use state::{Held, OracleState};

use crate::{Error, Model, Result};
use glam::DVec3;
use newton::Solver;
use potential::{Elastic, Motion, Potential};

/// How well the minimum is found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Precision {
    /// Greatest norm of the gradient, over the weight the body has on earth (its mass times 9.81 m/s2).
    pub gradient: f64,
    /// Newton steps after which it gives up.
    pub iterations: usize,
}

impl Default for Precision {
    /// 1e-9 of the weight within 200 steps.
    fn default() -> Self {
        Self { gradient: 1e-9, iterations: 200 }
    }
}

/// How one body's minimum was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// Newton steps taken (each is one factorisation or more).
    pub iterations: usize,
    /// Steps in which the Hessian was not positive definite and was made so.
    pub projected: usize,
    /// Parts in which held nodes were moved to their targets.
    pub load_steps: usize,
    /// Norm of the gradient over free nodes at the end [N].
    pub gradient: f64,
}

/// Finds converged steps and equilibria of one model. It keeps the symbolic factorisations from step to step, as long as the same nodes are held.
pub struct Oracle {
    bodies: Vec<(Elastic, Solver)>,
}

/// Elastic energy of a body with its nodes at `x` [J].
pub(crate) fn elastic_energy(body: &crate::Body, x: &[DVec3]) -> f64 {
    let elastic = Elastic::new(body);
    (0..elastic.tets.len()).map(|t| elastic.volumes[t] * elastic.psi.energy(elastic.deformation(t, x))).sum()
}

/// Acceleration that makes a mass a weight on earth [m/s2].
const EARTH: f64 = 9.81;

impl Oracle {
    /// Prepares for `model`, with [`Precision::default`].
    pub fn new(model: &Model) -> Self {
        Self::with_precision(model, Precision::default())
    }

    /// Prepares for `model`.
    pub fn with_precision(model: &Model, precision: Precision) -> Self {
        let prepare = |body| {
            let elastic = Elastic::new(body);
            let tolerance = precision.gradient * EARTH * elastic.masses.iter().sum::<f64>();
            (elastic, Solver::new(tolerance, precision.iterations))
        };
        Self { bodies: model.bodies.iter().map(prepare).collect() }
    }

    /// Advances `state` by one step of implicit Euler of length `dt` [s], the oracle's counterpart of one *substep* of the stepper. Held nodes end
    /// at their targets with no velocity. Returns how each body's minimum was found.
    ///
    /// # Errors
    /// A body whose minimum was not found, by name; `dt`, a state or a target that cannot be. The state is then as it was.
    pub fn step(&mut self, model: &Model, state: &mut OracleState, dt: f64, held: &[Held]) -> Result<Vec<Solution>> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(Error::Model(format!("a step of {dt} s; it must be above 0")));
        }
        let solutions = self.solve(model, state, held, Some(dt))?;
        state.time += dt;
        Ok(solutions)
    }

    /// Brings `state` to the static equilibrium near it: the step for an infinite `dt`, without inertia, dashpots and friction. Velocities become 0.
    ///
    /// # Errors
    /// As [`Self::step`]; also a body that gravity acts on and nothing holds.
    pub fn settle(&mut self, model: &Model, state: &mut OracleState, held: &[Held]) -> Result<Vec<Solution>> {
        self.solve(model, state, held, None)
    }

    /// The incremental potential of each body [J] of a step of `dt` [s] from `before` that ends with the positions of `after`: what [`Self::step`] minimises over free
    /// nodes, without friction. Not finite where an element has no volume. Zero is nothing in particular: only differences mean something.
    ///
    /// # Errors
    /// States of another model or that are not finite; a `dt` that is not above 0.
    pub fn energy(&self, model: &Model, before: &OracleState, after: &OracleState, dt: f64) -> Result<Vec<f64>> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(Error::Model(format!("a step of {dt} s; it must be above 0")));
        }
        before.check(model, &[])?;
        after.check(model, &[])?;
        self.check(model)?;
        let of_body = |(((elastic, _), before), after): ((&(Elastic, Solver), &state::Nodes), &state::Nodes)| {
            let motion = Some(Motion::new(elastic, before, model.gravity, dt));
            let potential = Potential { elastic, motion, gravity: model.gravity, limits: Vec::new() };
            potential.gradient(&after.x, &mut vec![DVec3::ZERO; after.x.len()])
        };
        Ok(self.bodies.iter().zip(&before.bodies).zip(&after.bodies).map(of_body).collect())
    }

    /// Refuses another model than it was prepared for.
    fn check(&self, model: &Model) -> Result<()> {
        let fits = self.bodies.len() == model.bodies.len()
            && self.bodies.iter().zip(&model.bodies).all(|((elastic, _), body)| elastic.masses.len() == body.len());
        if fits { Ok(()) } else { Err(Error::Model("the oracle was prepared for another model".to_owned())) }
    }

    fn solve(
        &mut self,
        model: &Model,
        state: &mut OracleState,
        held: &[Held],
        dt: Option<f64>,
    ) -> Result<Vec<Solution>> {
        state.check(model, held)?;
        self.check(model)?;
        let mut solved = Vec::with_capacity(self.bodies.len());
        for (index, (elastic, solver)) in self.bodies.iter_mut().enumerate() {
            let body = &model.bodies[index];
            let before = &state.bodies[index];
            let mut fixed = body.pinned().to_vec();
            let mut targets = before.x.clone();
            for h in held.iter().filter(|h| h.body == index && !body.pinned()[h.node as usize]) {
                fixed[h.node as usize] = true;
                targets[h.node as usize] = h.target;
            }
            let named = |failure| Error::Unsolved { body: body.name.clone(), failure };
            if dt.is_none() && model.gravity != DVec3::ZERO && body.supports.is_empty() && !fixed.contains(&true) {
                return Err(named(Failure::Unheld));
            }
            let motion = dt.map(|dt| Motion::new(elastic, before, model.gravity, dt));
            let mut potential = Potential { elastic, motion, gravity: model.gravity, limits: Vec::new() };
            let mut x = before.x.clone();
            let solution =
                friction::minimise(solver, &mut potential, &fixed, &targets, &before.v, &mut x).map_err(named)?;
            let anchors = potential.anchors(&x);
            solved.push((x, fixed, anchors, solution));
        }
        let mut solutions = Vec::with_capacity(solved.len());
        for (body, (x, fixed, anchors, solution)) in state.bodies.iter_mut().zip(solved) {
            for (i, v) in body.v.iter_mut().enumerate() {
                *v = match dt {
                    Some(dt) if !fixed[i] => (x[i] - body.x[i]) / dt,
                    _ => DVec3::ZERO,
                };
            }
            body.x = x;
            body.anchors = anchors;
            solutions.push(solution);
        }
        Ok(solutions)
    }
}

/// Why a minimum was not found.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Failure {
    /// The gradient is still too large after all iterations.
    #[error("after {iterations} Newton steps the gradient is {gradient:.3e} N; it should be {tolerance:.3e} N or less")]
    NotConverged {
        /// Steps taken.
        iterations: usize,
        /// Norm of the gradient [N].
        gradient: f64,
        /// What it should have been [N].
        tolerance: f64,
    },
    /// No step along the Newton direction decreases the energy, and the gradient is too large.
    #[error("no step decreases the energy at a gradient of {gradient:.3e} N; {tolerance:.3e} N or less was asked for")]
    Stuck {
        /// Norm of the gradient [N].
        gradient: f64,
        /// What it should have been [N].
        tolerance: f64,
    },
    /// An element has no volume where the solve begins.
    #[error("element {element} has a volume ratio of {ratio:.3e} at the beginning; it must be positive")]
    Inverted {
        /// The element.
        element: usize,
        /// Volume over rest volume.
        ratio: f64,
    },
    /// The Hessian could not be factorised, even made positive definite.
    #[error("the Hessian cannot be factorised; is the body held, and are its numbers finite?")]
    Singular,
    /// Held nodes cannot reach their targets without an element losing its volume.
    #[error("held nodes reached {share:.3} of their way; an element loses its volume beyond")]
    Unreachable {
        /// Share of the way.
        share: f64,
    },
    /// Friction's limits and the motion found no balance.
    #[error("friction is off balance by {gradient:.3e} N; {tolerance:.3e} N or less was asked for")]
    Friction {
        /// Norm of the gradient with friction's true limits [N].
        gradient: f64,
        /// What it should have been [N].
        tolerance: f64,
    },
    /// Gravity acts on a body that nothing holds: it has no equilibrium.
    #[error("nothing holds it against gravity; pin nodes, hold some or give it a support")]
    Unheld,
}
