//! Which bodies of an island take part in the search.
//!
//! Most neighbours of a moved body do not move, and most moving bodies have arrived after a few
//! iterations. Such bodies sleep, and are examined again when the others have arrived: a body whose
//! correction has become too large by the pushes of others wakes.

use super::island_system::IslandSystem;
use crate::body_slot::{BodySlot, for_each};
use glam::Vec3A;

/// How exact the place of a body has to be: as if it went at least this share of what another of
/// its island goes.
const MIN_WAY_SHARE: f32 = 0.1;

/// A body falls asleep when its correction is this share of what wakes it.
const ASLEEP_SHARE: f32 = 0.5;

impl IslandSystem<'_> {
    /// How far any body went (m).
    fn farthest(&mut self) -> f32 {
        let moved = self.all().filter(|body| body.sleep.active || body.sleep.asleep);
        moved.map(|body| body.progress.gone).fold(0.0, f32::max)
    }

    /// Whether no step is longer than `tolerance` (m) or a share `relative` of how far its body
    /// went. A body that hardly moves beside a moving one may have a tenth of the moving one's
    /// error.
    pub fn is_solved(&mut self, tolerance: f32, relative: f32) -> bool {
        let farthest = self.farthest();
        self.active().all(|body| {
            let gone = body.progress.gone.max(MIN_WAY_SHARE * farthest);
            body.progress.longest <= tolerance.max(relative * gone)
        })
    }

    /// Lets bodies sleep whose own correction is small enough while that of others is not.
    pub fn fall_asleep(&mut self, tolerance: f32, relative: f32) {
        // Beside a free body every push counts: momentum would be lost, and sliding held back.
        if self.all().any(|body| body.is_free()) {
            return;
        }
        let farthest = self.farthest();
        let mut any = false;
        for body in self.active() {
            let least = tolerance.max(relative * body.progress.gone.max(MIN_WAY_SHARE * farthest));
            body.sleep.asleep = body.progress.longest <= ASLEEP_SHARE * least;
            any |= body.sleep.asleep;
        }
        if any {
            self.record_pushes();
            self.active().for_each(|body| body.sleep.active = !body.sleep.asleep);
        }
    }

    /// Adds what pushes sleeping bodies now to their gradients, and records it.
    pub fn record_pushes(&mut self) {
        let Self { slots, pairs, .. } = self;
        for pair in pairs.list_mut() {
            let active = [pair.member, pair.other].map(|m| slots[m].solver.sleep.active);
            if active == [false; 2] {
                continue;
            }
            let now = pair.push_at(|m, vertex| slots[m].solver.at(vertex));
            let change = now - std::mem::replace(&mut pair.recorded, now);
            if active == [true; 2] || change == Vec3A::ZERO {
                continue;
            }
            for (m, vertex, share) in pair.shares() {
                let body = &mut slots[m].solver;
                if !body.sleep.active {
                    body.push(vertex, share * change);
                    body.sleep.disturbed = true;
                }
            }
        }
    }

    /// Wakes bodies that the others have begun to push. Returns whether there is one.
    pub fn wake(&mut self, tolerance: f32, relative: f32) -> bool {
        if self.all().all(|body| body.sleep.active) {
            return false;
        }
        let (still, farthest) = (self.still(), self.farthest());
        self.record_pushes();
        for_each(self.slots, self.frame, |BodySlot { solver, .. }| {
            solver.sleep.was_resting = !solver.sleep.active;
            if !solver.sleep.active && std::mem::take(&mut solver.sleep.disturbed) {
                let own = if solver.sleep.asleep { tolerance.max(relative * solver.progress.gone) } else { still };
                let beside = if !solver.is_free() { relative * MIN_WAY_SHARE * farthest } else { 0.0 };
                solver.sleep.active = solver.correction() > own.max(beside);
            }
        });
        let mut woken = false;
        for body in self.all() {
            woken |= body.sleep.was_resting && body.sleep.active;
            body.sleep.asleep &= !body.sleep.active;
        }
        woken
    }
}
