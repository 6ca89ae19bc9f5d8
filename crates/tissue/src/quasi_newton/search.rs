//! Where a substep starts from and how far it goes along a direction: nowhere that squeezes an element too far, and downhill.

use super::layout::Layout;
use super::{QuasiNewtonIntegrator, position};
use crate::Body;
use crate::descent::HELD_STRETCH;
use crate::integrator::Frame;
use crate::lanes::{LANES, Row, dot_rows};
use fearless_simd::{Simd, SimdBase, f32x4};
use glam::Vec3A;

/// Held nodes this near to their targets have arrived [m]: rounding of positions.
const ARRIVED: f32 = 1e-7;

/// Guessed motions below this are left out [m]: a body at rest starts where it is.
const STILL: f32 = 1e-9;

/// A slope of this share of the first one, falling or rising, is small enough.
const SLOPE_SHARE: f32 = 0.5;

/// Most shares that a search tries after the first.
const MOST_SHARES: usize = 8;

/// More squeezed elements than these and a hundredth of all are not cured one by one.
const MANY: usize = 8;

/// Times the steps of squeezed elements' nodes are halved, and then dropped, before a search gives up.
const HALVINGS: usize = 3;
const DROPS: usize = 5;

/// Times all nodes' steps are cut, and to what share, where that does not help.
const RETREATS: usize = 5;
const RETREAT: f32 = 0.25;

/// Where a substep starts from.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Guess {
    /// Where it was: nothing moves.
    Still,
    /// Free nodes went on with their velocities, held ones with their tools.
    Ahead,
    /// Where it was, though things move: elements would not bear it that nodes go on by themselves.
    Behind,
}

/// How far held nodes came with their tools.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Pulled {
    /// All the way.
    There,
    /// Less, or an element would have been squeezed too far: they catch up later.
    PartOfTheWay,
    /// Nothing could move.
    Nowhere,
}

/// What a search came to.
pub(super) enum Found {
    /// A step was taken; gradient and history know.
    Step,
    /// None helps; positions are as they were.
    Nothing,
}

impl QuasiNewtonIntegrator {
    /// Moves to where the substep starts from; the forces there are those of the last pass then.
    #[inline(always)]
    pub(super) fn guess<S: Simd>(&mut self, simd: S, frame: &Frame<'_>, share: f64, h: f32, body: &Body) -> Guess {
        let free = self.layout.free;
        let mut moves = false;
        for i in 0..free {
            let mut to = self.start[i];
            for c in 0..3 {
                let by = h * self.v[i][c];
                if !self.held[i] && by.abs() > STILL {
                    to[c] += by;
                }
            }
            moves |= to != self.start[i];
            self.targets[i] = to;
        }
        let (targets, layout, start) = (&mut self.targets, &self.layout, &self.start);
        let mut yielded = false;
        frame.for_held(body, share, |vertex, x| {
            let i = layout.number[vertex] as usize;
            if i >= free {
                return;
            }
            if overstretches(body, layout, start, vertex, x) {
                yielded = true;
                return;
            }
            targets[i] = x.extend(0.0).to_array();
            moves |= targets[i] != start[i];
        });
        self.yielded = yielded;
        if !moves {
            self.elements.pass(simd, &self.layout, &self.x, &self.start, h);
            return Guess::Still;
        }
        self.x[..free].copy_from_slice(&self.targets[..free]);
        if !self.elements.pass(simd, &self.layout, &self.x, &self.start, h) {
            self.elements.accept();
            return Guess::Ahead;
        }
        self.x[..free].copy_from_slice(&self.start[..free]);
        self.elements.pass(simd, &self.layout, &self.x, &self.start, h);
        Guess::Behind
    }

    /// Goes from where the substep began, held nodes with their tools and the free ones as a linear body would follow; gradient and positions know.
    #[inline(always)]
    pub(super) fn pull<S: Simd>(&mut self, simd: S, h: f32) -> Pulled {
        self.direction.copy_from_slice(&self.gradient);
        for i in (0..self.layout.free).filter(|i| self.held[*i]) {
            for c in 0..3 {
                self.direction[i][c] = -self.factor.holding[i] * (self.targets[i][c] - self.x[i][c]);
            }
        }
        self.precondition(simd);
        for i in 0..self.layout.free {
            for c in 0..3 {
                let way = self.targets[i][c] - self.x[i][c];
                self.direction[i][c] = if self.held[i] { way } else { -self.direction[i][c] };
            }
        }
        self.base.copy_from_slice(&self.x[..self.layout.rows]);
        let went = self.go(simd, 1.0, h);
        if went {
            self.elements.accept();
        } else {
            self.x[..self.layout.free].copy_from_slice(&self.base[..self.layout.free]);
            self.elements.pass(simd, &self.layout, &self.x, &self.start, h);
        }
        self.take_gradient(simd, h);
        std::mem::swap(&mut self.gradient, &mut self.next_gradient);
        self.refresh_limits();
        let arrived = |i: usize| (0..3).all(|c| (self.x[i][c] - self.targets[i][c]).abs() <= ARRIVED);
        let all = (0..self.layout.free).all(|i| !self.held[i] || arrived(i));
        match (went, all) {
            (false, _) => Pulled::Nowhere,
            (true, false) => Pulled::PartOfTheWay,
            (true, true) => Pulled::There,
        }
    }

    /// Writes the potential's gradient into `next_gradient`, from the forces of the last pass; 0 at held nodes.
    #[inline(always)]
    pub(super) fn take_gradient<S: Simd>(&mut self, simd: S, h: f32) {
        let inertia = 1.0 / (h * h);
        for i in 0..self.layout.free {
            if self.held[i] {
                self.next_gradient[i] = [0.0; 4];
                continue;
            }
            let x = f32x4::from_slice(simd, &self.x[i]);
            let off = x - f32x4::from_slice(simd, &self.predictor[i]);
            let mut sum = off * (self.layout.masses[i] * inertia);
            let (first, end) = (self.layout.first_corner[i] as usize, self.layout.first_corner[i + 1] as usize);
            for k in &self.layout.corners[first..end] {
                sum += f32x4::from_slice(simd, &self.elements.corners[*k as usize]);
            }
            sum.store_slice(&mut self.next_gradient[i]);
        }
        for (touch, limit) in self.contacts.touches().iter().zip(&self.limits) {
            let i = self.layout.number[touch.vertex as usize] as usize;
            if let Some(push) = touch.push_within(position(&self.x[i]), *limit) {
                add(&mut self.next_gradient[i], push.gradient);
            }
        }
    }

    /// Takes friction's limits as they are here; the gradient knows. Within a search they are held, so that there is a function to minimise.
    pub(super) fn refresh_limits(&mut self) {
        for (touch, limit) in self.contacts.touches().iter().zip(&mut self.limits) {
            let i = self.layout.number[touch.vertex as usize] as usize;
            let x = position(&self.x[i]);
            let now = touch.limit(x);
            if now != *limit && !self.held[i] {
                let push = |limit| touch.push_within(x, limit).map_or(Vec3A::ZERO, |push| push.gradient);
                add(&mut self.gradient[i], push(now) - push(*limit));
            }
            *limit = now;
        }
    }

    /// Goes along the direction: all of it where the slope does not rise too much by it, else as far as it takes for the slope to become small.
    #[inline(always)]
    pub(super) fn search<S: Simd>(&mut self, simd: S, h: f32) -> Found {
        let rows = self.layout.rows;
        let mut slope = dot_rows(simd, &self.gradient, &self.direction);
        if slope.is_nan() || slope >= 0.0 {
            // The history misleads: the preconditioner alone always points downhill.
            self.history.clear();
            self.find_direction(simd);
            slope = dot_rows(simd, &self.gradient, &self.direction);
            if slope.is_nan() || slope >= 0.0 {
                return Found::Nothing;
            }
        }
        self.base.copy_from_slice(&self.x[..rows]);
        // The minimum lies between a share where the slope still falls and one where it rises.
        let (mut share, mut below, mut above) = (1.0f32, (0.0f32, slope), None);
        for attempt in 0..=MOST_SHARES {
            if !self.go(simd, share, h) {
                return self.turn_back();
            }
            // Steps of squeezed elements' nodes may have been cut.
            slope = dot_rows(simd, &self.gradient, &self.direction);
            self.take_gradient(simd, h);
            let there = dot_rows(simd, &self.next_gradient, &self.direction);
            if !(slope < 0.0 && there.is_finite()) {
                return self.turn_back();
            }
            let falls = there <= SLOPE_SHARE * slope.abs();
            if falls && (above.is_none() || there >= -SLOPE_SHARE * slope.abs() || attempt == MOST_SHARES) {
                break;
            }
            if attempt == MOST_SHARES {
                return self.turn_back();
            }
            if falls {
                below = (share, there);
            } else {
                above = Some((share, there));
            }
            share = between(below, above.unwrap_or((share, there)));
        }
        self.elements.accept();
        self.history.learn(simd, share, &self.direction, &self.gradient, &self.next_gradient);
        std::mem::swap(&mut self.gradient, &mut self.next_gradient);
        self.refresh_limits();
        Found::Step
    }

    /// Puts the positions before the search back.
    fn turn_back(&mut self) -> Found {
        self.x[..self.layout.free].copy_from_slice(&self.base[..self.layout.free]);
        Found::Nothing
    }

    /// Goes `share` of the direction. Where a few elements would be squeezed too far, their nodes go less far, and at last not at all; where many would be, or others again and again, all
    /// nodes go less far. False if that does not help either.
    #[inline(always)]
    fn go<S: Simd>(&mut self, simd: S, share: f32, h: f32) -> bool {
        for _ in 0..=RETREATS {
            for round in 0..=HALVINGS + DROPS {
                for i in 0..self.layout.free {
                    for c in 0..3 {
                        self.x[i][c] = self.base[i][c] + share * self.direction[i][c];
                    }
                }
                if !self.elements.pass(simd, &self.layout, &self.x, &self.start, h) {
                    return true;
                }
                let mut squeezed = 0;
                self.elements.for_squeezed(&self.layout, |_| squeezed += 1);
                if squeezed == 0 || squeezed > MANY + self.layout.batches.len() * LANES / 100 {
                    break;
                }
                let (by, direction) = (if round < HALVINGS { 0.5 } else { 0.0 }, &mut self.direction);
                let free = self.layout.free as u32;
                self.elements.for_squeezed(&self.layout, |nodes| {
                    for i in nodes.into_iter().filter(|i| *i < free) {
                        direction[i as usize] = direction[i as usize].map(|d: f32| by * d);
                    }
                });
            }
            for d in self.direction.as_flattened_mut() {
                *d *= RETREAT;
            }
        }
        false
    }
}

/// A share between two at which the slope falls and rises: where it would vanish if it were linear, but on a logarithmic scale while they are far apart.
fn between((low, falls): (f32, f32), (high, rises): (f32, f32)) -> f32 {
    let secant = low + (high - low) * (falls / (falls - rises)).clamp(0.1, 0.9);
    let least = 0.02 * high;
    if low > 0.0 && high > 4.0 * low { (low * high).sqrt() } else { secant.max(least) }
}

fn add(row: &mut Row, by: Vec3A) {
    row.iter_mut().zip(by.to_array()).for_each(|(sum, part)| *sum += part);
}

/// Whether an edge at a held vertex that goes to `x` would be too long, and longer than it is.
fn overstretches(body: &Body, layout: &Layout, start: &[Row], vertex: usize, x: Vec3A) -> bool {
    let here = position(&start[layout.number[vertex] as usize]);
    body.edges_of(vertex).iter().any(|edge| {
        let other = position(&start[layout.number[edge.to as usize] as usize]);
        let now = (x - other).length_squared();
        now > (HELD_STRETCH * edge.length).powi(2) && now > (here - other).length_squared()
    })
}
