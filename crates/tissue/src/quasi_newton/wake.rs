//! Which bodies of an island take part in the search.
//!
//! Most of what lies beside a body that is moved does not move, and of what moves most is where it is to be after a few iterations. Such bodies are left alone, and looked at again when the others are where
//! they are to be: one whose correction has become too large by what they push takes part again.

use super::Island;
use crate::integrator::{Worker, for_each};
use glam::Vec3A;

/// What a body goes at least, as a share of what another of its island goes, when it is asked how exact its place has to be.
const BESIDE: f32 = 0.1;

/// A body is left alone when its correction is this share of what wakes it again.
const DOZING: f32 = 0.5;

impl Island<'_> {
    /// How far any body went.
    fn farthest(&mut self) -> f32 {
        self.all().filter(|part| part.active || part.dozes).map(|part| part.gone).fold(0.0, f32::max)
    }

    /// Whether no step is longer than `tolerance` [m] or a share `relative` of how far its body went. One that hardly moves beside one that does is not held to nearly nothing.
    pub(super) fn is_solved(&mut self, tolerance: f32, relative: f32) -> bool {
        let farthest = self.farthest();
        self.parts().all(|part| part.longest <= tolerance.max(relative * part.gone.max(BESIDE * farthest)))
    }

    /// Leaves alone the bodies whose own correction is small enough while that of others is not.
    pub(super) fn doze(&mut self, tolerance: f32, relative: f32) {
        // Beside what nothing holds every push counts: momentum would be lost, and what slides be held back.
        if self.all().any(|part| part.is_free()) {
            return;
        }
        let farthest = self.farthest();
        let mut any = false;
        for part in self.parts() {
            let least = tolerance.max(relative * part.gone.max(BESIDE * farthest));
            part.dozes = part.longest <= DOZING * least;
            any |= part.dozes;
        }
        if any {
            self.note_pushes();
            self.parts().for_each(|part| part.active = !part.dozes);
            self.recount();
        }
    }

    /// Lets the gradients of bodies that are left alone know of what pushes them now, and writes it down.
    pub(super) fn note_pushes(&mut self) {
        let Self { workers, pairs, .. } = self;
        for pair in pairs.list_mut() {
            let active = [pair.member, pair.other].map(|m| workers[m].solver.active);
            if active == [false; 2] {
                continue;
            }
            let now = pair.push_at(|m, vertex| workers[m].solver.at(vertex));
            let change = now - std::mem::replace(&mut pair.noted, now);
            if active == [true; 2] || change == Vec3A::ZERO {
                continue;
            }
            for (m, vertex, share) in pair.shares() {
                let part = &mut workers[m].solver;
                if !part.active {
                    part.push(false, vertex, share * change);
                    part.stirred = true;
                }
            }
        }
    }

    /// Lets the bodies that were left alone take part again where the others have begun to push them; whether there is one.
    pub(super) fn wake(&mut self, tolerance: f32, relative: f32) -> bool {
        if self.all().all(|part| part.active) {
            return false;
        }
        let (still, farthest) = (self.still(), self.farthest());
        self.note_pushes();
        for_each(self.workers, self.frame, |Worker { solver, .. }| {
            solver.was_resting = !solver.active;
            if !solver.active && std::mem::take(&mut solver.stirred) {
                let own = if solver.dozes { tolerance.max(relative * solver.gone) } else { still };
                let beside = if !solver.is_free() { relative * BESIDE * farthest } else { 0.0 };
                solver.active = solver.correction() > own.max(beside);
            }
        });
        let mut woken = false;
        for part in self.all() {
            woken |= part.was_resting && part.active;
            part.dozes &= !part.active;
        }
        if woken {
            self.recount();
        }
        woken
    }
}
