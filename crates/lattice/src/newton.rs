//! The judge: Newton's method to convergence, in double precision.
//!
//! Each step solves the exact second derivative by conjugate gradients. Their preconditioner is the
//! Cholesky factor of an earlier one, kept while it serves. Where the exact one is indefinite, the
//! projected one is solved instead (Teran and others, "Robust quasistatic finite
//! elements and flesh simulation", 2005).

use crate::pcg::{Ended, Preconditioner, dot, solve};
use crate::potential::{Potential, Value};
use crate::{Body, BodyState, Conditions, Error, Failure, Result};
use glam::DVec3;
use trocar_sparse::BlockMatrix;

/// Share of the linear decrease that a step must bring (Armijo).
const ARMIJO: f64 = 1e-4;

/// Greatest number of halvings of a step.
const MAX_HALVINGS: usize = 40;

/// Rounding of the energy: over the energy, and over its geometric mean with Young's modulus times
/// the volume. A strain e is off by the rounding of F, and its energy by e times that.
const ENERGY_ROUNDING: f64 = 1e-13;
const STRAIN_ROUNDING: f64 = 1e-15;

/// Greatest number of iterations of conjugate gradients before the factor is made again, and after.
/// A factor costs as much as some six iterations.
const MAX_STALE_ITERATIONS: usize = 6;
const MAX_FRESH_ITERATIONS: usize = 50;

/// Residual of a linear solve over the gradient.
const LINEAR_TOLERANCE: f64 = 1e-4;

/// Greatest number of consecutive steps that lower neither the energy nor the gradient by a tenth.
const MAX_STALLED_STEPS: usize = 5;

/// Shifts of the diagonal that are tried, over its mean, if the projected matrix is singular.
const SHIFTS: [f64; 5] = [0.0, 1e-10, 1e-8, 1e-6, 1e-4];

/// Acceleration that makes a mass a weight on earth (m/s2).
const EARTH: f64 = 9.81;

/// Lengths of a time step (s).
const STEP_RANGE: [f64; 2] = [1e-6, 1.0];

/// When Newton's method ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Precision {
    /// Greatest norm of the gradient, over the body's weight on earth.
    pub gradient: f64,
    /// Greatest number of iterations.
    pub iterations: usize,
}

impl Default for Precision {
    /// A gradient of 1e-9 of the weight within 200 iterations.
    fn default() -> Self {
        Self { gradient: 1e-9, iterations: 200 }
    }
}

/// How a minimum was found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Solution {
    /// Newton steps.
    pub iterations: usize,
    /// Steps with the projected second derivative.
    pub projected: usize,
    /// Iterations of conjugate gradients.
    pub linear_iterations: usize,
    /// Factorisations.
    pub factorisations: usize,
    /// Norm of the gradient at the end (N).
    pub gradient: f64,
}

/// Finds minima for one body. Keeps the pattern and the factor; results do not depend on what it
/// solved before up to its precision, and not at all on threads.
pub struct Newton {
    precision: Precision,
    matrix: BlockMatrix,
    preconditioner: Preconditioner,
    factorised: bool,
}

impl Newton {
    /// For `body`.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a precision out of range.
    pub fn new(body: &Body, precision: Precision) -> Result<Self> {
        if !(1e-14..=1.0).contains(&precision.gradient) {
            let given = precision.gradient;
            return Err(Error::Invalid(format!("the precision is {given} of the weight; must be in [1e-14, 1]")));
        }
        let matrix = Potential::pattern(body);
        let preconditioner = Preconditioner::new(&matrix);
        Ok(Self { precision, matrix, preconditioner, factorised: false })
    }

    /// Moves `state` to a static equilibrium near its positions, with velocities of 0.
    ///
    /// # Errors
    /// [`Error::Body`] and [`Error::Invalid`] for conditions and states that do not fit,
    /// [`Error::Unsolved`] if no minimum is found; `state` then stays as it was.
    pub fn settle(&mut self, body: &Body, conditions: &Conditions<'_>, state: &mut BodyState) -> Result<Solution> {
        self.advance(body, conditions, None, state)
    }

    /// Advances `state` by a step of implicit Euler of `dt` (s).
    ///
    /// # Errors
    /// As [`Self::settle`], and [`Error::Invalid`] for a step out of 1 us to 1 s.
    pub fn step(
        &mut self,
        body: &Body,
        conditions: &Conditions<'_>,
        dt: f64,
        state: &mut BodyState,
    ) -> Result<Solution> {
        let [least, most] = STEP_RANGE;
        if !(least..=most).contains(&dt) {
            return Err(Error::Invalid(format!("the time step is {dt} s; must be in [{least}, {most}] s")));
        }
        self.advance(body, conditions, Some(dt), state)
    }

    fn advance(
        &mut self,
        body: &Body,
        conditions: &Conditions<'_>,
        dt: Option<f64>,
        state: &mut BodyState,
    ) -> Result<Solution> {
        state.check(body)?;
        body.check(conditions)?;
        if self.matrix.len() != body.masses().len() {
            return Err(Error::Invalid(format!("the solver was made for another body than '{}'", body.name())));
        }
        // A step starts without the factor of another, so that it gives the same bits wherever it
        // is repeated from.
        self.factorised = false;
        let potential = Potential::new(body, *conditions, state, dt);
        let mut x = state.positions.clone();
        let solution = self.minimise(body, &potential, &mut x);
        let solution = solution.map_err(|failure| Error::Unsolved { body: body.name().to_owned(), failure })?;
        for i in 0..x.len() {
            state.velocities[i] = dt.map_or(DVec3::ZERO, |dt| (x[i] - state.positions[i]) / dt);
        }
        state.positions = x;
        Ok(solution)
    }

    fn minimise(&mut self, body: &Body, potential: &Potential<'_>, x: &mut [DVec3]) -> Result<Solution, Failure> {
        let tolerance = self.precision.gradient * EARTH * body.masses().iter().sum::<f64>();
        let mut value = potential.evaluate(x);
        if let Some(y) = potential.free_flight() {
            // Free flight is the better start where it costs less.
            let pairs = y.iter().zip(&*x).zip(body.fixed());
            let guess: Vec<DVec3> = pairs.map(|((y, x), fixed)| if *fixed { *x } else { *y }).collect();
            let flown = potential.evaluate(&guess);
            if flown.energy < value.energy {
                x.copy_from_slice(&guess);
                value = flown;
            }
        }
        let mut solution = Solution { gradient: norm(&value), ..Solution::default() };
        let mut step = vec![DVec3::ZERO; x.len()];
        let mut project_next = false;
        let mut stalled = 0;
        while solution.gradient.is_nan() || solution.gradient > tolerance {
            if !(value.energy.is_finite() && solution.gradient.is_finite()) {
                return Err(Failure::NotFinite);
            }
            if solution.iterations == self.precision.iterations {
                let (iterations, gradient) = (solution.iterations, solution.gradient);
                return Err(Failure::NotConverged { iterations, gradient, tolerance });
            }
            let projected = self.direction(potential, x, &value, project_next, &mut step, &mut solution)?;
            solution.iterations += 1;
            solution.projected += usize::from(projected);
            match search(potential, x, &step, &value) {
                Some((next, share)) => {
                    // Steps that keep the energy and most of the gradient are rounding.
                    let same = next.energy >= value.energy && norm(&next) > 0.9 * solution.gradient;
                    stalled = if same { stalled + 1 } else { 0 };
                    if stalled == MAX_STALLED_STEPS {
                        return Err(Failure::Stuck { gradient: solution.gradient, tolerance });
                    }
                    // Where full steps fail, the exact curvature misleads.
                    project_next = !projected && share < 0.25;
                    value = next;
                    solution.gradient = norm(&value);
                }
                None if !projected => project_next = true,
                None => return Err(Failure::Stuck { gradient: solution.gradient, tolerance }),
            }
        }
        Ok(solution)
    }

    /// The Newton step at `x`; whether it is that of the projected second derivative.
    fn direction(
        &mut self,
        potential: &Potential<'_>,
        x: &[DVec3],
        value: &Value,
        project: bool,
        step: &mut [DVec3],
        solution: &mut Solution,
    ) -> Result<bool, Failure> {
        let down: Vec<DVec3> = value.gradient.iter().map(|g| -*g).collect();
        if !project {
            potential.hessian(x, false, &mut self.matrix);
            let mut ended = Ended::Slow;
            if self.factorised {
                ended = self.solve(&down, MAX_STALE_ITERATIONS, step, solution);
            }
            if ended == Ended::Slow {
                solution.factorisations += 1;
                self.factorised = self.preconditioner.factorise(&self.matrix);
                if self.factorised {
                    ended = self.solve(&down, MAX_FRESH_ITERATIONS, step, solution);
                }
            }
            if ended == Ended::Solved && dot(step, &value.gradient) < 0.0 {
                return Ok(false);
            }
        }
        self.factorise_projected(potential, x, solution)?;
        self.solve(&down, MAX_FRESH_ITERATIONS, step, solution);
        if dot(step, &value.gradient) < 0.0 { Ok(true) } else { Err(Failure::Singular) }
    }

    /// Solves the matrix for a step.
    fn solve(&mut self, down: &[DVec3], most: usize, step: &mut [DVec3], solution: &mut Solution) -> Ended {
        let (ended, iterations) = solve(&self.matrix, &mut self.preconditioner, down, LINEAR_TOLERANCE, most, step);
        solution.linear_iterations += iterations;
        ended
    }

    /// Writes the projected second derivative at `x` into the matrix and factorises it.
    fn factorise_projected(
        &mut self,
        potential: &Potential<'_>,
        x: &[DVec3],
        solution: &mut Solution,
    ) -> Result<(), Failure> {
        potential.hessian(x, true, &mut self.matrix);
        let count = self.matrix.len();
        let mean = (0..count).map(|i| trace(&self.matrix, i)).sum::<f64>() / (3 * count) as f64;
        let mut before = 0.0;
        for shift in SHIFTS {
            self.matrix.shift((shift - before) * mean);
            before = shift;
            solution.factorisations += 1;
            if self.preconditioner.factorise(&self.matrix) {
                self.factorised = true;
                return Ok(());
            }
        }
        Err(Failure::Singular)
    }
}

/// The longest of the halved steps that lowers the energy enough: moves `x`, returns the new value
/// and the share of the step.
fn search(potential: &Potential<'_>, x: &mut [DVec3], step: &[DVec3], value: &Value) -> Option<(Value, f64)> {
    let slope = dot(step, &value.gradient);
    let energy = value.energy.abs() + slope.abs();
    let rounding = ENERGY_ROUNDING * energy + STRAIN_ROUNDING * (energy * potential.stiff_energy()).sqrt();
    let mut share = 1.0;
    for _ in 0..MAX_HALVINGS {
        let next: Vec<DVec3> = x.iter().zip(step).map(|(x, d)| *x + share * *d).collect();
        let at = potential.evaluate(&next);
        let decreases = at.energy <= value.energy + ARMIJO * share * slope;
        // Near the minimum energies differ by less than their rounding; gradients still tell.
        let nearer = (at.energy - value.energy).abs() <= rounding && norm(&at) < norm(value);
        if norm(&at).is_finite() && (decreases || nearer) {
            x.copy_from_slice(&next);
            return Some((at, share));
        }
        share *= 0.5;
    }
    None
}

fn norm(value: &Value) -> f64 {
    dot(&value.gradient, &value.gradient).sqrt()
}

fn trace(matrix: &BlockMatrix, i: usize) -> f64 {
    let block = matrix.diagonal(i);
    block.x_axis.x + block.y_axis.y + block.z_axis.z
}
