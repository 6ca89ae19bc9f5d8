//! The bodies of an island, minimised together: one history and one line search over all of them,
//! while each keeps its own matrix.

use super::body_system::QuasiNewtonSolver;
use crate::body_slot::{BodySlot, IslandFrame, for_each};
use glam::Vec3A;

/// Friction that changes by this share of the largest limit has another minimum.
const LIMIT_SHARE: f32 = 0.02;

/// The correction of a body at rest is at most this share of its free fall in a substep.
const STILL_SHARE: f32 = 1e-4;

/// The tolerance in each substep is an acceleration of at most this (m/s2), a thousandth of Earth's
/// gravity. In substeps shorter than a millisecond a fixed distance is a large force, and tissue
/// would come to rest before it has sagged.
const TOLERATED_ACCELERATION: f32 = 0.01;

/// Bodies that may touch each other, in a frame.
pub(super) type IslandSystem<'a> = IslandFrame<'a, QuasiNewtonSolver>;

impl IslandSystem<'_> {
    /// The bodies that take part in the search.
    pub fn active(&mut self) -> impl Iterator<Item = &mut QuasiNewtonSolver> {
        self.slots.iter_mut().map(|slot| &mut slot.solver).filter(|body| body.sleep.active)
    }

    /// All bodies.
    pub fn all(&mut self) -> impl Iterator<Item = &mut QuasiNewtonSolver> {
        self.slots.iter_mut().map(|slot| &mut slot.solver)
    }

    /// Does the same with every body that takes part, in parallel if there are several.
    pub fn for_active(&mut self, work: impl Fn(&mut QuasiNewtonSolver) + Send + Sync) {
        if self.active().nth(1).is_none() {
            self.active().for_each(work);
        } else {
            for_each(self.slots, self.frame, |BodySlot { solver, .. }| {
                if solver.sleep.active {
                    work(solver);
                }
            });
        }
    }

    /// Writes the gradient of all bodies' potential into their next gradients, from the forces of
    /// the last evaluations.
    pub fn take_gradient(&mut self) {
        let h = self.h;
        self.for_active(|body| body.take_gradient(h));
        let Self { slots, pairs, .. } = self;
        for pair in pairs.list() {
            if !slots[pair.member].solver.sleep.active && !slots[pair.other].solver.sleep.active {
                continue;
            }
            let offset = pair.offset(|m, vertex| slots[m].solver.at(vertex));
            if let Some(push) = pair.push(offset) {
                for (m, vertex, share) in pair.shares() {
                    slots[m].solver.push_next(vertex, share * push.gradient);
                }
            }
        }
    }

    /// Accepts the next gradient.
    pub fn accept_gradient(&mut self) {
        self.active().for_each(|body| body.accept_gradient());
    }

    /// Sets the limits of friction between bodies to those here, and adds the change to the
    /// gradient. Returns whether one of them changed by more than a small share of the largest.
    ///
    /// The limits are held while a minimum is sought: friction whose limit follows the normal force
    /// at every step of a search has no potential, and steps that learn from each other go astray.
    pub fn refresh_limits(&mut self) -> bool {
        let Self { slots, pairs, .. } = self;
        let (mut largest, mut most) = (0.0f32, 0.0f32);
        for pair in pairs.list_mut() {
            let offset = pair.offset(|m, vertex| slots[m].solver.at(vertex));
            let now = pair.contact.limit(offset);
            if now != pair.limit {
                let push = |limit| pair.contact.push_within(offset, limit).map_or(Vec3A::ZERO, |push| push.gradient);
                let change = push(now) - push(pair.limit);
                for (m, vertex, share) in pair.shares() {
                    let body = &mut slots[m].solver;
                    body.push(vertex, share * change);
                    body.sleep.disturbed |= !body.sleep.active;
                }
                pair.limit = now;
                pair.recorded += change;
                most = most.max(change.length());
            }
            largest = largest.max(now);
        }
        most > LIMIT_SHARE * largest
    }

    /// The correction that ends a search (m); rounding of positions is none.
    pub fn tolerance(&mut self) -> f32 {
        let tolerance = self.slots[0].solver.settings.tolerance as f32;
        tolerance.max(self.rounding()).min(TOLERATED_ACCELERATION * self.h * self.h)
    }

    /// A body comes to rest if it goes no farther freely in a substep, and its correction is no
    /// larger (m). It is a small share of a free fall, but at least the tolerance.
    pub fn still(&mut self) -> f32 {
        let fall = self.h * self.h * self.frame.gravity.length() as f32;
        self.tolerance().max(STILL_SHARE * fall)
    }

    /// Rounding of positions (m).
    fn rounding(&mut self) -> f32 {
        2.0 * f32::EPSILON * self.all().map(|body| body.extent()).fold(0.0, f32::max)
    }
}
