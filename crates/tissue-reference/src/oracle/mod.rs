//! The oracle: implicit Euler's step and the static equilibrium in double precision, converged.
//!
//! The solvers of `trocar-tissue` minimise the same function of the free nodes' positions x,
//!
//! 1/(2 dt^2) |x - y|_M^2 + sum V0 Psi(F) + dashpots + support planes, y = x0 + dt v0 + dt^2 g,
//!
//! and are judged by how near they come to the oracle, which finds the minimum by Newton's method
//! with a sparse direct solve. It is slow and meant for tests and studies. The function contains:
//!
//! - energies, stresses and their derivatives of [`trocar_tissue::Hyperelastic`]; masses, dashpots
//!   and contact stiffness as the model holds them (rounded to `f32`);
//! - dashpots as the sweeps have them: quadratic in the change of an edge's squared length since
//!   the beginning of the step, so that no rigid motion meets them;
//! - the supports' one-sided quadratic penalty. Their friction has no potential, because its limit
//!   grows with the depth: the function is minimised with the limits held, which are then updated,
//!   until the forces of the true law are in balance;
//! - pinned nodes stay; held nodes are prescribed. The stepper's rules for nodes that cannot follow
//!   a tool are left out: a motion that cannot be followed is an error.
//!
//! The minimum is that of the steps of `SolverSettings::PAPER`. The default solver steps a body in
//! free flight exactly, the oracle by implicit Euler.
//!
//! All work is done on the calling thread in a fixed order: the same machine gives the same bits.

mod element;
mod factor;
mod friction;
mod guard;
mod integrator;
mod newton;
mod potential;
mod solution;
mod state;
#[cfg(test)]
mod tests;

pub use integrator::{Newton, NewtonIntegrator};
pub use potential::elastic_energy;
pub use solution::{Failure, Precision, Solution};
pub use state::{Held, OracleState};

use crate::{Error, Result};
use glam::DVec3;
use newton::Solver;
use potential::{Elastic, Motion, Potential};
use trocar_tissue::Model;

/// Finds converged steps and equilibria of one model. It keeps the symbolic factorisations from
/// step to step while the same nodes are held.
pub struct Oracle {
    bodies: Vec<(Elastic, Solver)>,
}

impl Oracle {
    /// Prepares for `model`, with [`Precision::default`].
    pub fn new(model: &Model) -> Self {
        Self::with_precision(model, Precision::default())
    }

    /// Prepares for `model`.
    pub fn with_precision(model: &Model, precision: Precision) -> Self {
        let prepare = |body| {
            let elastic = Elastic::new(body);
            let solver = Solver::of(&elastic, precision);
            (elastic, solver)
        };
        Self { bodies: model.bodies().iter().map(prepare).collect() }
    }

    /// Advances `state` by one step of implicit Euler of length `dt` (s), the counterpart of one
    /// *substep* of the stepper. Held nodes end at their targets without velocity. Returns how each
    /// body's minimum was found.
    ///
    /// # Errors
    /// A body whose minimum was not found, by name; a `dt`, state or target that is not valid. The
    /// state is then as it was.
    pub fn step(&mut self, model: &Model, state: &mut OracleState, dt: f64, held: &[Held]) -> Result<Vec<Solution>> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(Error::Invalid(format!("a step of {dt} s; it must be above 0")));
        }
        let solutions = self.solve(model, state, held, Some(dt))?;
        state.time += dt;
        Ok(solutions)
    }

    /// Moves `state` to the static equilibrium near it: the step for an infinite `dt`, without
    /// inertia, dashpots and friction. Velocities become 0.
    ///
    /// # Errors
    /// As [`Self::step`]; also a body that gravity acts on and nothing holds.
    pub fn settle(&mut self, model: &Model, state: &mut OracleState, held: &[Held]) -> Result<Vec<Solution>> {
        self.solve(model, state, held, None)
    }

    /// The incremental potential of each body (J) of a step of `dt` (s) from `before` that ends
    /// with the positions of `after`: the function that [`Self::step`] minimises over free nodes,
    /// without friction. It is not finite where an element has no volume. Only differences have a
    /// meaning.
    ///
    /// # Errors
    /// States of another model or that are not finite; a `dt` that is not above 0.
    pub fn energy(&self, model: &Model, before: &OracleState, after: &OracleState, dt: f64) -> Result<Vec<f64>> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(Error::Invalid(format!("a step of {dt} s; it must be above 0")));
        }
        before.check(model, &[])?;
        after.check(model, &[])?;
        self.check(model)?;
        let of_body = |(((elastic, _), before), after): ((&(Elastic, Solver), &state::Nodes), &state::Nodes)| {
            let motion = Some(Motion::new(elastic, before, model.gravity(), dt));
            let potential = Potential { elastic, motion, gravity: model.gravity(), limits: Vec::new() };
            potential.gradient(&after.x, &mut vec![DVec3::ZERO; after.x.len()])
        };
        Ok(self.bodies.iter().zip(&before.bodies).zip(&after.bodies).map(of_body).collect())
    }

    /// Refuses another model than it was prepared for.
    fn check(&self, model: &Model) -> Result<()> {
        let fits = self.bodies.len() == model.bodies().len()
            && self.bodies.iter().zip(model.bodies()).all(|((elastic, _), body)| elastic.masses.len() == body.len());
        if fits { Ok(()) } else { Err(Error::Invalid("the oracle was prepared for another model".to_owned())) }
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
            let body = &model.bodies()[index];
            let before = &state.bodies[index];
            let mut fixed = body.pinned().to_vec();
            let mut targets = before.x.clone();
            for h in held.iter().filter(|h| h.body == index && !body.pinned()[h.node as usize]) {
                fixed[h.node as usize] = true;
                targets[h.node as usize] = h.target;
            }
            let named = |failure| Error::Unsolved { body: body.name().to_owned(), failure };
            if dt.is_none() && model.gravity() != DVec3::ZERO && body.supports().is_empty() && !fixed.contains(&true) {
                return Err(named(Failure::Unheld));
            }
            let motion = dt.map(|dt| Motion::new(elastic, before, model.gravity(), dt));
            let mut potential = Potential { elastic, motion, gravity: model.gravity(), limits: Vec::new() };
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
