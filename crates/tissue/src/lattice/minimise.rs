//! One minimisation: L-BFGS over the lattices of an island, preconditioned by a factor of each
//! body.
//!
//! The factor is that of the stiffness, at rest or of the strained hexahedron, with inertia,
//! viscosity, pins, contacts and grasps as they are when it is made. It is made once in a frame,
//! and only for bodies whose forces are not in balance. Where the search needs many steps, it is
//! made again from the projected second derivative. Everything is in double precision and in a
//! fixed order: the bits depend on nothing but the states at the frame's beginning.

use super::system::{Elastic, Lattice};
use super::terms::Term;
use glam::DVec3;
use std::rc::Rc;

/// Pairs of steps and changes of the gradient that L-BFGS keeps.
const MEMORY: usize = 12;

/// Share of the linear decrease that a step must bring (Armijo).
const ARMIJO: f64 = 1e-4;

/// Greatest number of times that a step is shortened.
const MAX_CUTS: usize = 20;

/// Steps before the factors are made again.
const MAX_STEPS_OF_A_FACTOR: usize = 25;

/// Greatest number of steps.
const MAX_STEPS: usize = 100;

/// Norm of the gradient at the end, over the weight of the body on earth. A body at rest sags by
/// this share more or less.
const TOLERANCE: f64 = 2e-5;

/// Volume over rest volume that a cell keeps: no step goes below it, unless it was lower before.
const MIN_VOLUME_RATIO: f64 = 0.01;

/// Acceleration that makes a mass a weight on earth (m/s2).
const EARTH: f64 = 9.81;

/// Rounding of the energy, over the energy.
const ROUNDING: f64 = 1e-12;

/// A step and the change of the gradient along it. Bodies without any have an empty list.
struct Pair {
    step: Vec<Vec<DVec3>>,
    change: Vec<Vec<DVec3>>,
    inverse: f64,
}

/// How a minimisation ended.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Outcome {
    pub steps: usize,
    /// Whether the forces are in balance, to the tolerance.
    pub converged: bool,
}

/// An island in a substep: lattices of slots, and terms that point into bodies.
pub(super) struct Island<'s, 'b> {
    /// The bodies that can move.
    pub lattices: Vec<Lattice<'s>>,
    pub terms: Vec<Term<'b>>,
    /// Positions of the nodes of the lattice of each body (m); none of bodies that cannot move.
    pub x: Vec<Vec<DVec3>>,
    pub precision: Precision,
}

/// Energy and gradient at some positions.
struct Value {
    energy: f64,
    gradient: Vec<Vec<DVec3>>,
    /// Without the terms, by body; shared with the values where the body was at the same place.
    elastic: Vec<Rc<Elastic>>,
    /// Where the points of the terms are (m).
    points: Vec<DVec3>,
}

/// When a search ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Precision {
    /// A step this small ends it (m).
    pub tolerance: f64,
    /// A step this small over the way so far ends it, too.
    pub relative: f64,
}

impl Island<'_, '_> {
    /// Moves the lattices to the minimum of the potential.
    pub fn minimise(&mut self) -> Outcome {
        let first = self.first_elastic();
        let points = self.points(&self.x);
        self.update_limits(&points);
        let mut value = self.with_terms(points, first);
        let (mut start, mut pairs) = (None, Vec::new());
        let (mut outcome, mut of_factor, mut projected) = (Outcome::default(), 0, false);
        loop {
            if !value.energy.is_finite() || self.is_balanced(&value) {
                outcome.converged = value.energy.is_finite();
                return outcome;
            }
            if outcome.steps >= MAX_STEPS {
                return outcome;
            }
            if of_factor == MAX_STEPS_OF_A_FACTOR {
                (of_factor, projected) = (0, true);
                self.lattices.iter_mut().for_each(|lattice| lattice.system.forget_factor());
                pairs.clear();
            }
            let mut direction = self.direction(&value, &pairs, projected);
            let mut slope = dot(&direction, &value.gradient);
            if slope.is_nan() || slope >= 0.0 {
                pairs.clear();
                direction = self.direction(&value, &pairs, projected);
                slope = dot(&direction, &value.gradient);
            }
            let Some((x, next, share)) = self.search(&direction, slope, &value) else {
                // Nothing is gained along the direction: with a new factor, or not at all.
                if of_factor == 0 && pairs.is_empty() {
                    return outcome;
                }
                of_factor = MAX_STEPS_OF_A_FACTOR;
                outcome.steps += 1;
                continue;
            };
            let step = scaled(&direction, share);
            let change = difference(&next.gradient, &value.gradient);
            let reached = longest(&direction);
            let curvature = dot(&step, &change);
            if curvature > 1e-10 * (dot(&step, &step) * dot(&change, &change)).sqrt() {
                if pairs.len() == MEMORY {
                    pairs.remove(0);
                }
                pairs.push(Pair { step: moved(step), change: moved(change), inverse: 1.0 / curvature });
            }
            let before = std::mem::replace(&mut self.x, x);
            let start = start.get_or_insert(before);
            outcome.steps += 1;
            of_factor += 1;
            value = if self.update_limits(&next.points) { self.with_terms(next.points, next.elastic) } else { next };
            let way = longest(&difference(&self.x, start));
            if share == 1.0 && reached <= self.precision.tolerance.max(self.precision.relative * way) {
                outcome.converged = true;
                return outcome;
            }
        }
    }

    /// The elastic parts where the search starts. A body whose guess turns a cell inside out starts
    /// where it was.
    fn first_elastic(&mut self) -> Vec<Rc<Elastic>> {
        let Self { lattices, x, .. } = self;
        let first = lattices.iter_mut().map(|lattice| {
            let x = &mut x[lattice.member];
            let elastic = lattice.first_elastic(x);
            if elastic.least_ratio >= MIN_VOLUME_RATIO {
                return elastic;
            }
            let before = lattice.first_elastic(lattice.start);
            if before.least_ratio <= elastic.least_ratio {
                return elastic;
            }
            x.clone_from_slice(lattice.start);
            before
        });
        first.map(Rc::new).collect()
    }

    /// Where the points of the terms are with the nodes at `x` (m).
    fn points(&self, x: &[Vec<DVec3>]) -> Vec<DVec3> {
        let x: Vec<&[DVec3]> = x.iter().map(|x| &x[..]).collect();
        self.terms.iter().map(|term| term.at(&x)).collect()
    }

    /// Sets the limits of friction to those with the points of the terms at `points`. Returns
    /// whether any changed.
    fn update_limits(&mut self, points: &[DVec3]) -> bool {
        let mut changed = false;
        for (term, point) in self.terms.iter_mut().zip(points) {
            let before = term.limit;
            term.update_limit(*point);
            changed |= term.limit != before;
        }
        changed
    }

    /// Energy and gradient at `x`, which is `direction` away from where `before` was.
    fn evaluate(&self, x: &[Vec<DVec3>], direction: &[Vec<DVec3>], before: &Value) -> Value {
        let elastic = self.lattices.iter().zip(&before.elastic).map(|(lattice, before)| {
            let moves = direction[lattice.member].iter().any(|d| *d != DVec3::ZERO);
            if moves { Rc::new(lattice.elastic(&x[lattice.member])) } else { Rc::clone(before) }
        });
        self.with_terms(self.points(x), elastic.collect())
    }

    /// Adds the terms with their points at `points` to the elastic part.
    fn with_terms(&self, points: Vec<DVec3>, elastic: Vec<Rc<Elastic>>) -> Value {
        let mut gradient: Vec<Vec<DVec3>> = vec![Vec::new(); self.x.len()];
        let mut energy = 0.0;
        for (lattice, elastic) in self.lattices.iter().zip(&elastic) {
            gradient[lattice.member].clone_from(&elastic.gradient);
            energy += elastic.energy;
        }
        for (term, point) in self.terms.iter().zip(&points) {
            energy += term.add_gradient(*point, &mut gradient);
        }
        Value { energy, gradient, elastic, points }
    }

    /// Whether the forces of every body are in balance.
    fn is_balanced(&self, value: &Value) -> bool {
        self.lattices.iter().all(|lattice| balanced(lattice, &value.gradient[lattice.member]))
    }

    /// The direction of L-BFGS (Nocedal and Wright, "Numerical Optimization", 2006, algorithm 7.4).
    fn direction(&mut self, value: &Value, pairs: &[Pair], projected: bool) -> Vec<Vec<DVec3>> {
        let mut direction = scaled(&value.gradient, -1.0);
        let mut shares = vec![0.0; pairs.len()];
        for (pair, share) in pairs.iter().zip(&mut shares).rev() {
            *share = pair.inverse * dot(&pair.step, &direction);
            add(&mut direction, -*share, &pair.change);
        }
        let x: Vec<&[DVec3]> = self.x.iter().map(|x| &x[..]).collect();
        for lattice in &mut self.lattices {
            let direction = &mut direction[lattice.member];
            // A body in balance that no other moves needs no factor.
            if lattice.system.has_factor() || !balanced(lattice, &value.gradient[lattice.member]) {
                lattice.precondition(&self.terms, &x, projected, direction);
            } else {
                direction.fill(DVec3::ZERO);
            }
        }
        for (pair, share) in pairs.iter().zip(&shares) {
            let by = *share - pair.inverse * dot(&pair.change, &direction);
            add(&mut direction, by, &pair.step);
        }
        direction
    }

    /// A step that lowers the energy enough: the whole direction, or the part of it where a
    /// parabola through the energies so far is lowest, between a tenth and half of the last trial
    /// (Nocedal and Wright, section 3.5).
    fn search(&self, direction: &[Vec<DVec3>], slope: f64, value: &Value) -> Option<(Vec<Vec<DVec3>>, Value, f64)> {
        if slope.is_nan() || slope >= 0.0 {
            return None;
        }
        let mut share = 1.0;
        for _ in 0..MAX_CUTS {
            let mut x = self.x.clone();
            add(&mut x, share, direction);
            let next = self.evaluate(&x, direction, value);
            let lower = next.energy <= value.energy + ARMIJO * share * slope;
            // Near the minimum energies differ by less than their rounding; gradients still tell.
            let same = (next.energy - value.energy).abs() <= ROUNDING * value.energy.abs();
            let nearer = || dot(&next.gradient, &next.gradient) < dot(&value.gradient, &value.gradient);
            let whole = value
                .elastic
                .iter()
                .zip(&next.elastic)
                .all(|(before, now)| now.least_ratio >= MIN_VOLUME_RATIO.min(before.least_ratio));
            if whole && (lower || (same && nearer())) {
                return Some((x, next, share));
            }
            let above = next.energy - (value.energy + share * slope);
            let lowest = if whole && above > 0.0 { -0.5 * slope * share * share / above } else { 0.0 };
            // Energies that are not finite say nothing.
            share = if lowest > 0.0 { lowest.clamp(0.1 * share, 0.5 * share) } else { 0.5 * share };
        }
        None
    }
}

fn balanced(lattice: &Lattice<'_>, gradient: &[DVec3]) -> bool {
    let tolerance = TOLERANCE * EARTH * lattice.mass();
    gradient.iter().map(|g| g.length_squared()).sum::<f64>() <= tolerance * tolerance
}

/// The lists without those that are zero: most bodies of an island lie still.
fn moved(mut lists: Vec<Vec<DVec3>>) -> Vec<Vec<DVec3>> {
    for list in &mut lists {
        if list.iter().all(|v| *v == DVec3::ZERO) {
            list.clear();
        }
    }
    lists
}

/// Length of the longest vector.
fn longest(vectors: &[Vec<DVec3>]) -> f64 {
    vectors.iter().flatten().map(|v| v.length_squared()).fold(0.0, f64::max).sqrt()
}

fn dot(a: &[Vec<DVec3>], b: &[Vec<DVec3>]) -> f64 {
    let mut sum = DVec3::ZERO;
    for (a, b) in a.iter().zip(b) {
        a.iter().zip(b).for_each(|(a, b)| sum += *a * *b);
    }
    sum.element_sum()
}

fn add(to: &mut [Vec<DVec3>], by: f64, what: &[Vec<DVec3>]) {
    for (to, what) in to.iter_mut().zip(what) {
        to.iter_mut().zip(what).for_each(|(to, what)| *to += by * *what);
    }
}

fn scaled(vectors: &[Vec<DVec3>], by: f64) -> Vec<Vec<DVec3>> {
    vectors.iter().map(|list| list.iter().map(|v| by * *v).collect()).collect()
}

fn difference(a: &[Vec<DVec3>], b: &[Vec<DVec3>]) -> Vec<Vec<DVec3>> {
    a.iter().zip(b).map(|(a, b)| a.iter().zip(b).map(|(a, b)| *a - *b).collect()).collect()
}
