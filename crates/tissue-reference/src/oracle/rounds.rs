//! Friction limits, and the features of a surface that touch, have no potential. They stay fixed
//! while a round minimises. Then they are searched again, until the forces of the true law are in
//! balance.

use super::newton::{Solver, norm};
use super::potential::Potential;
use super::solution::{Failure, Solution};
use glam::DVec3;

/// Most rounds of a step.
const MAX_ROUNDS: usize = 100;

/// Share of the true law's imbalance to which a round minimises.
const INNER_SHARE: f64 = 0.1;

/// Moves `x` to the minimum of `potential` with fixed nodes at their targets.
pub(super) fn minimise(
    solver: &mut Solver,
    potential: &mut Potential<'_>,
    fixed: &[bool],
    targets: &[DVec3],
    velocities: &[DVec3],
    x: &mut [DVec3],
) -> Result<Solution, Failure> {
    let rubs = potential.rubs();
    if let Some(contacts) = &mut potential.contacts {
        contacts.hold(x, false);
    }
    // Limits at the start may be far from those at the end: the first round has none.
    let guess = potential.motion.as_ref().map(|motion| motion.dt());
    let load_steps = solver.move_fixed(potential, fixed, targets, guess.map(|dt| (dt, velocities)), x)?;
    let tolerance = solver.tolerance();
    let mut solution = solver.minimise(potential, fixed, tolerance, x)?;
    solution.load_steps = load_steps;
    if !rubs && potential.contacts.is_none() {
        return Ok(solution);
    }
    let mut gradient = vec![DVec3::ZERO; x.len()];
    for _ in 0..MAX_ROUNDS {
        if rubs {
            potential.limits = potential.friction_limits(x);
        }
        if let Some(contacts) = &mut potential.contacts {
            contacts.hold(x, true);
        }
        potential.gradient(x, &mut gradient);
        solution.gradient = norm(&gradient, fixed);
        if solution.gradient <= tolerance && potential.contacts.as_ref().is_none_or(|c| c.is_sharp()) {
            return Ok(solution);
        }
        // The held limits are not exact yet, so a more precise minimum gains nothing.
        let next = solver.minimise(potential, fixed, tolerance.max(INNER_SHARE * solution.gradient), x)?;
        solution.iterations += next.iterations;
        solution.projected += next.projected;
    }
    Err(Failure::Friction { gradient: solution.gradient, tolerance })
}
