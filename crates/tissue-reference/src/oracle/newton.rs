//! Newton's method with a line search in which no element loses its volume.
//!
//! The exact Hessian is tried first, because it alone converges quadratically. Where it is not
//! positive definite, the elements' tangents are projected (Teran and others, "Robust quasistatic
//! finite elements and flesh simulation", 2005); where that is singular, the diagonal is shifted.

use super::factor::Factor;
use super::guard;
use super::potential::{Elastic, Potential};
use super::solution::{Failure, Precision, Solution};
use glam::DVec3;
use trocar_tissue::assembly::Stiffness;

/// Acceleration that makes a mass a weight on earth (m/s2).
const EARTH: f64 = 9.81;

/// Share of the linear decrease that a step must bring (Armijo).
const ARMIJO: f64 = 1e-4;

/// After a step of a smaller share the next one uses the secant of friction.
const SHORT_STEP_SHARE: f64 = 0.5;

/// Greatest number of halvings of a step.
const MAX_HALVINGS: usize = 50;

/// Rounding of the energy, over the body's elastic scale and the energy itself.
const ENERGY_ROUNDING: f64 = 1e-13;

/// Shifts of the diagonal that are tried, over its mean.
const DIAGONAL_SHIFTS: [f64; 6] = [1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-2];

/// Greatest number of parts in which held nodes are moved to their targets, and of Newton steps
/// after each.
const MAX_LOAD_STEPS: usize = 300;
const MAX_LOAD_STEP_ITERATIONS: usize = 4;

/// Solves one body; keeps the pattern and the symbolic factorisation.
pub(super) struct Solver {
    tolerance: f64,
    iterations: usize,
    system: Option<System>,
}

struct System {
    fixed: Vec<bool>,
    /// Pairs of nodes that contacts couple, sorted.
    coupled: Vec<[u32; 2]>,
    matrix: Stiffness,
    factor: Factor,
}

impl Solver {
    /// For one body, to `precision`.
    pub fn of(elastic: &Elastic, precision: Precision) -> Self {
        Self::new(precision.gradient * EARTH * elastic.masses.iter().sum::<f64>(), precision.iterations)
    }

    /// To a gradient of `tolerance` (N) within so many iterations.
    pub fn new(tolerance: f64, iterations: usize) -> Self {
        Self { tolerance, iterations, system: None }
    }

    /// Greatest norm of the gradient (N).
    pub fn tolerance(&self) -> f64 {
        self.tolerance
    }

    fn prepare(&mut self, potential: &Potential<'_>, fixed: &[bool]) -> Result<&mut System, Failure> {
        let coupled = coupled(potential);
        let fits = |system: &System| {
            system.fixed == fixed && coupled.iter().all(|pair| system.coupled.binary_search(pair).is_ok())
        };
        if !self.system.as_ref().is_some_and(fits) {
            let matrix = Stiffness::with_pairs(&potential.elastic.tets, &coupled, fixed);
            let factor = Factor::new(&matrix);
            self.system = Some(System { fixed: fixed.to_vec(), coupled, matrix, factor });
        }
        self.system.as_mut().ok_or(Failure::Singular)
    }

    /// Moves fixed nodes of `x` to their targets while the free nodes follow. It moves them in
    /// parts if an element would lose its volume. Free nodes continue with their velocities
    /// (`guess`: dt and velocities) if they can. Returns the number of parts.
    pub fn move_fixed(
        &mut self,
        potential: &Potential<'_>,
        fixed: &[bool],
        targets: &[DVec3],
        guess: Option<(f64, &[DVec3])>,
        x: &mut [DVec3],
    ) -> Result<usize, Failure> {
        guard::check(potential.elastic, x)?;
        let mut step: Vec<DVec3> =
            (0..x.len()).map(|i| if fixed[i] { targets[i] - x[i] } else { DVec3::ZERO }).collect();
        let way = step.iter().map(|d| d.length()).fold(0.0, f64::max);
        if let Some((dt, v)) = guess {
            let with_guess: Vec<DVec3> = (0..x.len()).map(|i| if fixed[i] { step[i] } else { dt * v[i] }).collect();
            if guard::allowed_share(potential.elastic, x, &with_guess) >= 1.0 {
                add(x, 1.0, &with_guess);
                exactly(x, fixed, targets);
                return Ok(1);
            }
        }
        let mut left = 1.0;
        for part in 1..=MAX_LOAD_STEPS {
            let share = guard::allowed_share(potential.elastic, x, &step);
            if share >= 1.0 {
                add(x, 1.0, &step);
                exactly(x, fixed, targets);
                return Ok(part);
            }
            // Half of the possible way leaves the elements room to relax.
            add(x, 0.5 * share, &step);
            left *= 1.0 - 0.5 * share;
            match self.relax(potential, fixed, self.tolerance, MAX_LOAD_STEP_ITERATIONS, x) {
                Ok(_) | Err(Failure::NotConverged { .. } | Failure::Stuck { .. }) => {}
                Err(failure) => return Err(failure),
            }
            for (i, d) in step.iter_mut().enumerate().filter(|(i, _)| fixed[*i]) {
                *d = targets[i] - x[i];
            }
        }
        Err(Failure::Unreachable { share: if way > 0.0 { 1.0 - left } else { 1.0 } })
    }

    /// Moves free nodes of `x` until the norm of the gradient is at most `tolerance` (N).
    pub fn minimise(
        &mut self,
        potential: &Potential<'_>,
        fixed: &[bool],
        tolerance: f64,
        x: &mut [DVec3],
    ) -> Result<Solution, Failure> {
        self.relax(potential, fixed, tolerance, self.iterations, x)
    }

    fn relax(
        &mut self,
        potential: &Potential<'_>,
        fixed: &[bool],
        tolerance: f64,
        most: usize,
        x: &mut [DVec3],
    ) -> Result<Solution, Failure> {
        let zeros = vec![DVec3::ZERO; x.len()];
        let (mut gradient, mut next_gradient, mut step, mut next) = (zeros.clone(), zeros.clone(), zeros, x.to_vec());
        let mut energy = potential.gradient(x, &mut gradient);
        let mut size = norm(&gradient, fixed);
        let mut solution = Solution { iterations: 0, projected: 0, load_steps: 0, gradient: size };
        let mut secant = false;
        // NaN is not small.
        while size.is_nan() || size > tolerance {
            if solution.iterations == most {
                return Err(Failure::NotConverged { iterations: most, gradient: size, tolerance });
            }
            let system = self.prepare(potential, fixed)?;
            solution.projected += usize::from(system.factorise(potential, secant, x)?);
            system.factor.newton_step(&system.matrix, &gradient, &mut step);
            solution.iterations += 1;

            let slope: f64 = gradient.iter().zip(&step).map(|(g, d)| g.dot(*d)).sum();
            if slope.is_nan() || slope >= 0.0 {
                return Err(Failure::Singular);
            }
            let rounding = ENERGY_ROUNDING * (potential.elastic.scale + energy.abs());
            let mut share = guard::allowed_share(potential.elastic, x, &step);
            let mut found = false;
            for _ in 0..MAX_HALVINGS {
                next.copy_from_slice(x);
                add(&mut next, share, &step);
                let next_energy = potential.gradient(&next, &mut next_gradient);
                let next_size = norm(&next_gradient, fixed);
                // Near the minimum, energies differ by less than their rounding. Gradients still
                // decide.
                let decreases = next_energy <= energy + ARMIJO * share * slope;
                let nearer = (next_energy - energy).abs() <= rounding && next_size < size;
                if next_size.is_finite() && next_energy.is_finite() && (decreases || nearer) {
                    (energy, size, found) = (next_energy, next_size, true);
                    break;
                }
                share *= 0.5;
            }
            // Friction turns within the sticking length, far less than a step: where its curvature
            // leads too far, its secant does not.
            secant = share < SHORT_STEP_SHARE;
            if !found {
                return Err(Failure::Stuck { gradient: size, tolerance });
            }
            x.copy_from_slice(&next);
            gradient.copy_from_slice(&next_gradient);
            solution.gradient = size;
        }
        Ok(solution)
    }
}

impl System {
    /// Factorises the Hessian at x. Returns true if it had to be made positive definite.
    fn factorise(&mut self, potential: &Potential<'_>, secant: bool, x: &[DVec3]) -> Result<bool, Failure> {
        let Self { matrix, factor, .. } = self;
        potential.hessian(x, false, secant, matrix);
        if factor.factorise(matrix) {
            return Ok(false);
        }
        if !potential.hessian(x, true, secant, matrix) {
            return Err(Failure::Singular);
        }
        let mean = matrix.mean_diagonal();
        for shift in [0.0].into_iter().chain(DIAGONAL_SHIFTS) {
            matrix.shift(shift * mean);
            if factor.factorise(matrix) {
                return Ok(true);
            }
        }
        Err(Failure::Singular)
    }
}

/// Pairs of nodes that contacts couple, sorted.
fn coupled(potential: &Potential<'_>) -> Vec<[u32; 2]> {
    let mut coupled = Vec::new();
    for set in potential.contacts.iter().flat_map(|contacts| contacts.couplings()) {
        let pairs = (0..set.len()).flat_map(|a| (0..a).map(move |b| (a, b)));
        coupled.extend(pairs.map(|(a, b)| [set[a].min(set[b]) as u32, set[a].max(set[b]) as u32]));
    }
    coupled.sort_unstable();
    coupled.dedup();
    coupled
}

/// Norm over free nodes.
pub(super) fn norm(v: &[DVec3], fixed: &[bool]) -> f64 {
    v.iter().zip(fixed).filter(|(_, fixed)| !**fixed).map(|(v, _)| v.length_squared()).sum::<f64>().sqrt()
}

fn add(x: &mut [DVec3], share: f64, step: &[DVec3]) {
    x.iter_mut().zip(step).for_each(|(x, d)| *x += share * *d);
}

/// Removes the rounding from the way to the targets.
fn exactly(x: &mut [DVec3], fixed: &[bool], targets: &[DVec3]) {
    for (i, x) in x.iter_mut().enumerate().filter(|(i, _)| fixed[*i]) {
        *x = targets[i];
    }
}
