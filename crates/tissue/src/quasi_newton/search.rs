//! Where an island goes in an iteration: downhill, as far as it takes for the slope to become small.

use super::Island;
use super::part::QuasiNewtonSolver;
use crate::integrator::{Worker, for_each};
use glam::Vec3A;

/// A slope of this share of the first one, falling or rising, is small enough.
const SLOPE_SHARE: f32 = 0.5;

/// Friction that changes by this share of the largest limit has another minimum.
const LIMIT_SHARE: f32 = 0.02;

/// Most shares that a search tries after the first.
const MOST_SHARES: usize = 8;

/// What a search came to.
pub(super) enum Found {
    /// A step was taken; gradient and history know.
    Step,
    /// None helps; positions are as they were.
    Nothing,
}

impl Island<'_> {
    /// Writes the gradient of all bodies' potential into their next gradients, from the forces of the last passes.
    pub(super) fn take_gradient(&mut self) {
        let h = self.h;
        self.for_active(|part| part.take_gradient(h));
        let Self { workers, pairs, .. } = self;
        for pair in pairs.list() {
            if !workers[pair.member].solver.active && !workers[pair.other].solver.active {
                continue;
            }
            let offset = pair.offset(|m, vertex| workers[m].solver.at(vertex));
            if let Some(push) = pair.push(offset) {
                for (m, vertex, share) in pair.shares() {
                    workers[m].solver.push(true, vertex, share * push.gradient);
                }
            }
        }
    }

    /// Does the same with every body that takes part, in parallel if there are several.
    pub(super) fn for_active(&mut self, work: impl Fn(&mut QuasiNewtonSolver) + Send + Sync) {
        if self.parts().nth(1).is_none() {
            self.parts().for_each(work);
        } else {
            for_each(self.workers, self.frame, |Worker { solver, .. }| {
                if solver.active {
                    work(solver);
                }
            });
        }
    }

    /// Takes over the next gradient.
    pub(super) fn accept_gradient(&mut self) {
        self.parts().for_each(|part| part.accept_gradient());
    }

    /// Takes the limits of friction between bodies as they are here; the gradient knows. Whether one of them changed by more than a small share of the largest.
    ///
    /// They are held while a minimum is looked for: friction whose limit follows the normal force at every step of a search has no potential, and steps that learn from each other go astray.
    pub(super) fn refresh_limits(&mut self) -> bool {
        let Self { workers, pairs, .. } = self;
        let (mut largest, mut most) = (0.0f32, 0.0f32);
        for pair in pairs.list_mut() {
            let offset = pair.offset(|m, vertex| workers[m].solver.at(vertex));
            let now = pair.touch.limit(offset);
            if now != pair.limit {
                let push = |limit| pair.touch.push_within(offset, limit).map_or(Vec3A::ZERO, |push| push.gradient);
                let change = push(now) - push(pair.limit);
                for (m, vertex, share) in pair.shares() {
                    let part = &mut workers[m].solver;
                    part.push(false, vertex, share * change);
                    part.stirred |= !part.active;
                }
                pair.limit = now;
                pair.noted += change;
                most = most.max(change.length());
            }
            largest = largest.max(now);
        }
        most > LIMIT_SHARE * largest
    }

    /// direction = -H gradient.
    pub(super) fn find_direction(&mut self) {
        self.assemble_rigid();
        self.parts().for_each(|part| part.direction.copy_from_slice(&part.gradient));
        self.explain();
        self.for_active(|part| {
            part.take_rigid();
            part.precondition();
            part.add_rigid();
        });
        self.put_back();
        self.parts().for_each(|part| part.turn_downhill());
    }

    fn slope(&mut self) -> f32 {
        self.parts().map(|part| part.slope()).fold(0.0, |sum, part| sum + part)
    }

    fn next_slope(&mut self) -> f32 {
        self.parts().map(|part| part.next_slope()).fold(0.0, |sum, part| sum + part)
    }

    /// Goes along the direction: all of it where the slope does not rise too much by it, else as far as it takes for the slope to become small.
    pub(super) fn search(&mut self) -> Found {
        let mut slope = self.slope();
        if slope.is_nan() || slope >= 0.0 {
            // The history misleads: the preconditioner alone always points downhill.
            self.history.clear();
            self.find_direction();
            slope = self.slope();
            if slope.is_nan() || slope >= 0.0 {
                return Found::Nothing;
            }
        }
        self.parts().for_each(|part| part.base.copy_from_slice(&part.x[..part.layout.rows]));
        // The minimum lies between a share where the slope still falls and one where it rises.
        let held = self.is_held();
        let (mut share, mut below, mut above) = (1.0f32, (0.0f32, slope), None);
        for attempt in 0..=MOST_SHARES {
            let h = self.h;
            self.for_active(|part| part.went = part.go(share, h));
            if !self.parts().all(|part| part.went) {
                return self.turn_back();
            }
            // Steps of squeezed elements' nodes may have been cut.
            slope = self.slope();
            if held && below.0 == 0.0 {
                below.1 = slope;
            }
            self.take_gradient();
            let there = self.next_slope();
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
        self.parts().for_each(|part| part.elements.accept());
        self.learn(share);
        self.accept_gradient();
        self.parts().for_each(|part| part.patch());
        Found::Step
    }

    /// Puts the positions before the search back.
    fn turn_back(&mut self) -> Found {
        self.parts().for_each(|part| {
            let free = part.layout.free;
            part.x[..free].copy_from_slice(&part.base[..free]);
        });
        Found::Nothing
    }
}

/// A share between two at which the slope falls and rises: where it would vanish if it were linear, but on a logarithmic scale while they are far apart.
fn between((low, falls): (f32, f32), (high, rises): (f32, f32)) -> f32 {
    let secant = low + (high - low) * (falls / (falls - rises)).clamp(0.1, 0.9);
    let least = 0.02 * high;
    if low > 0.0 && high > 4.0 * low { (low * high).sqrt() } else { secant.max(least) }
}
