//! One substep of the lanes of a part: a minimisation in each lane.
//!
//! L-BFGS with the warped factor as its first matrix (Nocedal and Wright, "Numerical Optimization",
//! 2006, algorithm 7.4). All lanes go through the same rounds: a direction, a step along it, an
//! evaluation. A lane whose step is too long shortens it in the next round, while others go on. A
//! lane that is done keeps its numbers. What a lane does depends on its own numbers alone.
//!
//! In single precision energies near the minimum differ by less than their rounding. So a step is
//! judged by the slope at its end, not by the energy.

use super::elastic::add_elastic;
use super::factor::Field;
use super::group::Group;
use super::topology::{ModulusFactor, Topology};
use super::warp::{self, Rotations, Stiffening};
use crate::registers::{BLOCK, Block, Mask, Reg, bits, lanes, load, part_of, splat, store};
use fearless_simd::{Select, Simd, SimdBase, SimdMask};

/// Pairs of steps and changes of the gradient that are kept.
pub(super) const MEMORY: usize = 6;

/// A step is too long if the slope at its end is more than this share of the slope at its
/// beginning, upwards.
pub(super) const OVERSHOOT: f32 = 0.6;

/// Shortening of a step that is too long, at least and at most.
pub(super) const SHORTENED: [f32; 2] = [0.1, 0.7];

/// Rejected steps in a row after which a lane gives up.
pub(super) const MAX_REJECTED: f32 = 12.0;

/// Volume over rest volume that a cell keeps: no step goes below it, unless it was lower before.
pub(super) const MIN_RATIO: f32 = 0.01;

/// Least curvature along a step that is kept, over the slope at its beginning.
pub(super) const MIN_CURVATURE: f32 = 1e-4;

/// A step and the change of the gradient along it.
struct Pair {
    step: Field,
    change: Field,
    /// One over their product; 0 where there is none.
    inverse: Block<f32>,
}

/// Memory of one thread.
pub(super) struct Scratch {
    start: Field,
    predictor: Field,
    trial: Field,
    gradient: Field,
    trial_gradient: Field,
    direction: Field,
    solution: Field,
    rotations: Rotations,
    stiffening: Stiffening,
    pairs: Vec<Pair>,
}

/// When a search ends, in cells.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ends {
    /// A step this small (mean square by mass, squared cells) ends it.
    pub tolerance: f32,
    /// A step this small over the way so far ends it, squared.
    pub relative: f32,
    /// Greatest number of rounds.
    pub rounds: usize,
}

/// What a part did in a substep: bits of its lanes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Outcome {
    pub converged: u16,
    pub damaged: u16,
    /// Rounds of each lane.
    pub rounds: [u16; BLOCK],
}

impl Scratch {
    /// For a number of nodes.
    pub fn new(count: usize) -> Self {
        let field = || vec![[Block([0.0f32; BLOCK]); 3]; count + 1];
        let pair = || Pair { step: field(), change: field(), inverse: Block([0.0; BLOCK]) };
        Self {
            start: field(),
            predictor: field(),
            trial: field(),
            gradient: field(),
            trial_gradient: field(),
            direction: field(),
            solution: field(),
            rotations: vec![[Block([0.0; BLOCK]); 9]; count],
            stiffening: vec![Block([1.0; BLOCK]); count],
            pairs: (0..MEMORY).map(|_| pair()).collect(),
        }
    }

    /// Bytes.
    pub fn bytes(&self) -> usize {
        (7 + 2 * MEMORY) * size_of_val(&self.start[..])
            + size_of_val(&self.rotations[..])
            + size_of_val(&self.stiffening[..])
    }
}

/// Advances the lanes of a part by a substep of `h` (s).
#[inline(always)]
pub(super) fn substep<S: Simd>(
    simd: S,
    topology: &Topology,
    factor: &ModulusFactor,
    (group, scratch): (&mut Group, &mut Scratch),
    (h, ends): (f32, Ends),
    part: usize,
) -> Outcome {
    let (zero, one) = (splat(simd, 0.0), splat(simd, 1.0));
    let count = topology.len();
    let idle = part_of::<S>(group.idle(), part);
    let mut outcome = Outcome::default();
    begin(simd, group, scratch, h, part);
    let mut least = evaluate(simd, topology, group, &scratch.predictor, &group.u, &mut scratch.gradient, part);
    // A lane whose guess turns a cell inside out begins where it was.
    let flat = !least.simd_ge(splat(simd, MIN_RATIO));
    if flat.any_true() {
        for i in 0..count {
            for k in 0..3 {
                let u = &mut group.u[i][k];
                store::<S>(flat.select(load(simd, &scratch.start[i][k], part), load(simd, u, part)), u, part);
            }
        }
        least = evaluate(simd, topology, group, &scratch.predictor, &group.u, &mut scratch.gradient, part);
    }
    warp::update(simd, topology, &group.u, &mut scratch.rotations, &mut scratch.stiffening, part);
    let mut way = distance(simd, topology, &group.u, &scratch.start, part);
    let tolerance = splat(simd, ends.tolerance);
    let mut done: Mask<S> = lanes(simd, idle);
    let (mut fresh, mut share, mut slope, mut size) = (!lanes(simd, 0), one, zero, zero);
    let (mut rejected, mut used) = (zero, zero);
    // Every round leaves a pair.
    for pairs in 0..ends.rounds {
        let newest = direction(simd, topology, factor, group, scratch, pairs, part);
        let (new_slope, new_size) = (newest.0, newest.1);
        let chosen = fresh & !done;
        slope = chosen.select(zero - new_slope, slope);
        size = chosen.select(new_size, size);
        // No way down: rounding, or numbers that are none.
        done |= !slope.simd_lt(zero);
        // The last step is not looked at.
        let small = chosen & !done & size.simd_le(tolerance.max(way * ends.relative));
        outcome.converged |= bits::<S>(small);
        done |= small;
        let active = !done;
        for i in 0..count {
            for k in 0..3 {
                let d = &mut scratch.direction[i][k];
                let new = chosen.select(zero - load(simd, &scratch.solution[i][k], part), load(simd, d, part));
                store::<S>(new, d, part);
                let u = &mut group.u[i][k];
                let at = load(simd, u, part);
                let at = small.select(at + new, at);
                store::<S>(at, u, part);
                store::<S>(active.select(at + new * share, at), &mut scratch.trial[i][k], part);
            }
        }
        if !active.any_true() {
            break;
        }
        used = active.select(used + 1.0, used);
        let ratio =
            evaluate(simd, topology, group, &scratch.predictor, &scratch.trial, &mut scratch.trial_gradient, part);
        let (mut sums, mut changes) = ([zero; 3], [zero; 3]);
        for i in 0..count {
            for k in 0..3 {
                let g = load(simd, &scratch.trial_gradient[i][k], part);
                let y = g - load(simd, &scratch.gradient[i][k], part);
                sums[k] += g * load(simd, &scratch.direction[i][k], part);
                changes[k] += y * y;
            }
        }
        let (end, change) = (sums[0] + sums[1] + sums[2], changes[0] + changes[1] + changes[2]);
        let finite = change.simd_lt(splat(simd, f32::INFINITY));
        let whole = ratio.simd_ge(least.min(splat(simd, MIN_RATIO)));
        let accepted = active & finite & whole & end.simd_le((zero - slope) * OVERSHOOT);
        let curvature = share * (end - slope);
        let kept = accepted & curvature.simd_gt((zero - share * slope) * MIN_CURVATURE);
        let pair = &mut scratch.pairs[pairs % MEMORY];
        store::<S>(kept.select(one / curvature, zero), &mut pair.inverse, part);
        let mut ways = zero;
        for i in 0..count {
            let mut off = zero;
            for k in 0..3 {
                let g = load(simd, &scratch.trial_gradient[i][k], part);
                let before = load(simd, &scratch.gradient[i][k], part);
                let d = load(simd, &scratch.direction[i][k], part) * share;
                store::<S>(kept.select(d, zero), &mut pair.step[i][k], part);
                store::<S>(kept.select(g - before, zero), &mut pair.change[i][k], part);
                store::<S>(accepted.select(g, before), &mut scratch.gradient[i][k], part);
                let u = &mut group.u[i][k];
                let at = accepted.select(load(simd, &scratch.trial[i][k], part), load(simd, u, part));
                store::<S>(at, u, part);
                let by = at - load(simd, &scratch.start[i][k], part);
                off += by * by;
            }
            ways += off * topology.weights[i];
        }
        way = accepted.select(ways, way);
        least = accepted.select(ratio, least);
        // The secant's zero of the slope, within bounds.
        let [shortest, longest] = SHORTENED;
        let secant = (zero - slope) / (end - slope);
        let secant = (finite & whole & secant.simd_ge(splat(simd, shortest))).select(secant, splat(simd, shortest));
        share = accepted.select(one, share * secant.min(splat(simd, longest)));
        rejected = accepted.select(zero, rejected + 1.0);
        fresh = accepted;
        done |= rejected.simd_ge(splat(simd, MAX_REJECTED));
    }
    let damaged = finish(simd, topology, group, scratch, h, idle, part);
    outcome.damaged = damaged;
    outcome.converged &= !damaged;
    let mut rounds = Block([0.0f32; BLOCK]);
    store::<S>(used, &mut rounds, 0);
    for (to, from) in outcome.rounds.iter_mut().zip(rounds.0) {
        *to = from as u16;
    }
    outcome
}

/// Remembers where the lanes begin, and moves them to the guess.
#[inline(always)]
fn begin<S: Simd>(simd: S, group: &mut Group, scratch: &mut Scratch, h: f32, part: usize) {
    for (i, u) in group.u.iter_mut().enumerate() {
        for k in 0..3 {
            let start = load(simd, &u[k], part);
            let v = load(simd, &group.v[i][k], part);
            let flown = start + v * h;
            store::<S>(start, &mut scratch.start[i][k], part);
            store::<S>(flown, &mut u[k], part);
            store::<S>(flown + load(simd, &group.gravity[k], part) * (h * h), &mut scratch.predictor[i][k], part);
        }
    }
}

/// Writes velocities. A lane with numbers that are none stays where it began, at rest; idle lanes
/// keep all. Returns the damaged lanes.
#[inline(always)]
fn finish<S: Simd>(
    simd: S,
    topology: &Topology,
    group: &mut Group,
    scratch: &Scratch,
    h: f32,
    idle: u16,
    part: usize,
) -> u16 {
    let zero = splat(simd, 0.0);
    let way = distance(simd, topology, &group.u, &scratch.start, part);
    // NaN compares false.
    let sound = way.simd_lt(splat(simd, f32::INFINITY));
    let idle: Mask<S> = lanes(simd, idle);
    let moves = sound & !idle;
    for i in 0..topology.len() {
        for k in 0..3 {
            let start = load(simd, &scratch.start[i][k], part);
            let (u, v) = (&mut group.u[i][k], &mut group.v[i][k]);
            let at = moves.select(load(simd, u, part), start);
            store::<S>(at, u, part);
            let speed = moves.select((at - start) * (1.0 / h), zero);
            store::<S>(idle.select(load(simd, v, part), speed), v, part);
        }
    }
    bits::<S>(!sound)
}

/// Writes the gradient over Young's modulus at `u`; returns the least volume ratio.
#[inline(always)]
fn evaluate<S: Simd>(
    simd: S,
    topology: &Topology,
    group: &Group,
    predictor: &Field,
    u: &Field,
    gradient: &mut Field,
    part: usize,
) -> Reg<S> {
    let inertia = load(simd, &group.inertia, part);
    for (i, mass) in topology.masses.iter().enumerate() {
        let heavy = inertia * *mass;
        for k in 0..3 {
            let off = load(simd, &u[i][k], part) - load(simd, &predictor[i][k], part);
            store::<S>(off * heavy, &mut gradient[i][k], part);
        }
    }
    for pin in &topology.pins {
        for k in 0..3 {
            let to = &mut gradient[pin.to as usize][k];
            store::<S>(load(simd, to, part) + load(simd, &u[pin.from as usize][k], part) * pin.stiffness, to, part);
        }
    }
    group.grasps.add_gradient(simd, u, gradient, part);
    let least = add_elastic(simd, topology, u, gradient, part);
    for node in &topology.fixed {
        for k in 0..3 {
            store::<S>(splat(simd, 0.0), &mut gradient[*node as usize][k], part);
        }
    }
    least
}

/// Writes the inverse of the approximate second derivative times the gradient to the solution.
/// Returns its product with the gradient, and its mean square by mass.
#[inline(always)]
fn direction<S: Simd>(
    simd: S,
    topology: &Topology,
    factor: &ModulusFactor,
    group: &Group,
    scratch: &mut Scratch,
    pairs: usize,
    part: usize,
) -> (Reg<S>, Reg<S>) {
    let zero = splat(simd, 0.0);
    let count = group.u.len();
    let Scratch { gradient, solution, rotations, pairs: list, .. } = scratch;
    let first = pairs.saturating_sub(MEMORY);
    let none = &gradient[..0];
    let of = |number: usize| &list[number % MEMORY];
    let mut shares = [zero; MEMORY];
    // Each pass adds a pair and takes the product with the next one.
    let mut next: &[[Block<f32>; 3]] = if pairs > first { &of(pairs - 1).step } else { none };
    let mut product = copy_and_product(simd, solution, gradient, next, count, part);
    for number in (first..pairs).rev() {
        let by = product * load(simd, &of(number).inverse, part);
        shares[number % MEMORY] = by;
        next = if number > first { &of(number - 1).step } else { none };
        product = add_and_product(simd, solution, zero - by, &of(number).change, next, count, part);
    }
    warp::to_rest(simd, rotations, solution, part);
    factor.factor.solve(simd, solution, part);
    group.grasps.correct(simd, solution, part);
    next = if pairs > first { &of(first).change } else { none };
    product = warp::out_of_rest(simd, rotations, solution, next, part);
    for number in first..pairs {
        let by = shares[number % MEMORY] - product * load(simd, &of(number).inverse, part);
        next = if number + 1 < pairs { &of(number + 1).change } else { none };
        product = add_and_product(simd, solution, by, &of(number).step, next, count, part);
    }
    let (mut slopes, mut size) = ([zero; 3], zero);
    for ((x, g), weight) in solution.iter().zip(gradient.iter()).zip(&topology.weights) {
        let mut square = zero;
        for k in 0..3 {
            let x = load(simd, &x[k], part);
            slopes[k] += x * load(simd, &g[k], part);
            square += x * x;
        }
        size += square * *weight;
    }
    (slopes[0] + slopes[1] + slopes[2], size)
}

/// a = b; returns the sum of the products of a and c, if there is a c.
#[inline(always)]
fn copy_and_product<S: Simd>(
    simd: S,
    a: &mut Field,
    b: &Field,
    c: &[[Block<f32>; 3]],
    count: usize,
    part: usize,
) -> Reg<S> {
    for (a, b) in a[..count].iter_mut().zip(&b[..count]) {
        for k in 0..3 {
            store::<S>(load(simd, &b[k], part), &mut a[k], part);
        }
    }
    let mut sums = [splat(simd, 0.0); 3];
    for (a, c) in a[..count].iter().zip(c) {
        for k in 0..3 {
            sums[k] += load(simd, &a[k], part) * load(simd, &c[k], part);
        }
    }
    sums[0] + sums[1] + sums[2]
}

/// a += k b; returns the sum of the products of a and c, if there is a c.
#[inline(always)]
fn add_and_product<S: Simd>(
    simd: S,
    a: &mut Field,
    by: Reg<S>,
    b: &Field,
    c: &[[Block<f32>; 3]],
    count: usize,
    part: usize,
) -> Reg<S> {
    let mut sums = [splat(simd, 0.0); 3];
    if c.is_empty() {
        for (a, b) in a[..count].iter_mut().zip(&b[..count]) {
            for k in 0..3 {
                store::<S>(load(simd, &a[k], part) + load(simd, &b[k], part) * by, &mut a[k], part);
            }
        }
    } else {
        for ((a, b), c) in a[..count].iter_mut().zip(&b[..count]).zip(&c[..count]) {
            for k in 0..3 {
                let sum = load(simd, &a[k], part) + load(simd, &b[k], part) * by;
                store::<S>(sum, &mut a[k], part);
                sums[k] += sum * load(simd, &c[k], part);
            }
        }
    }
    sums[0] + sums[1] + sums[2]
}

/// Mean square of the distance between two fields, by mass.
#[inline(always)]
fn distance<S: Simd>(
    simd: S,
    topology: &Topology,
    a: &[[Block<f32>; 3]],
    b: &[[Block<f32>; 3]],
    part: usize,
) -> Reg<S> {
    let mut sum = splat(simd, 0.0);
    for ((a, b), weight) in a.iter().zip(b).zip(&topology.weights) {
        let mut off = splat(simd, 0.0);
        for k in 0..3 {
            let by = load(simd, &a[k], part) - load(simd, &b[k], part);
            off += by * by;
        }
        sum += off * *weight;
    }
    sum
}
