//! The minimisation of a substep: start, search direction after direction, take the velocities.

use super::apply_step::ConstraintMotion;
use super::body_system::QuasiNewtonSolver;
use super::island_system::IslandSystem;
use super::iterate::InitialGuess;
use super::line_search::Found;
use crate::body_slot::{BodySlot, for_each};
use glam::Vec3A;

/// Maximum number of minimisations, each with the limits of friction found at the last one.
const MAX_FRICTION_ROUNDS: usize = 4;

/// If no step helps any more, the positions are accepted as the minimum if the correction is at
/// most this many times the one that ends a substep: rounding, not a failed search.
const MAX_ROUNDING_FACTOR: f32 = 100.0;

/// Positions are rounded to `f32::EPSILON` of the body's extent. Forces that would move nodes by
/// this share of it in the mean are rounding: in lifts of whole organs they stay at 0.1 to 0.13 of
/// it, however many steps follow.
const ROUNDING_SHARE: f32 = 0.25;

impl IslandSystem<'_> {
    /// Minimises the potential of a substep, which ends when `share` of the frame is over.
    ///
    /// Returns false if it failed. Then only scratch memory has changed, and bodies at rest have no
    /// velocity.
    pub fn minimise(&mut self, share: f64) -> bool {
        let alone = self.pairs.is_empty();
        let still = self.still();
        self.start(share, still);
        let moved = self.all().any(|body| body.progress.guess != InitialGuess::Still);
        let behind = self.all().any(|body| body.progress.guess == InitialGuess::Behind);
        self.choose_active(alone, still);
        self.for_active(|body| {
            if body.progress.guess != InitialGuess::Still {
                body.update_stiffened();
                body.update_contacts();
            }
        });
        let mut stepped = behind && self.move_constraints();
        let settings = self.slots[0].solver.settings;
        let (absolute, relative) = (self.tolerance(), settings.relative as f32);
        let (wide, wide_relative) = (MAX_ROUNDING_FACTOR * absolute, MAX_ROUNDING_FACTOR * relative);
        if alone {
            self.rest_alone(still);
        }
        let mut rounds = 0;
        self.history.scale = 1.0;
        for iteration in usize::from(behind)..settings.iterations {
            if self.active().next().is_none() {
                // Nothing moves, and nothing has moved.
                return true;
            }
            let is_rounding = iteration > usize::from(behind) && self.is_rounding(wide, wide_relative);
            if !is_rounding {
                self.find_direction();
                self.count_iteration();
                let scale = self.history.scale;
                self.for_active(|body| body.measure_direction(iteration == 0, scale));
            }
            if is_rounding || self.is_solved(absolute, relative) {
                if iteration > 0 || moved {
                    if !alone && self.wake(absolute, relative) {
                        continue;
                    }
                    rounds += 1;
                    if alone || rounds == MAX_FRICTION_ROUNDS || !self.refresh_limits() {
                        break;
                    }
                    continue;
                }
                if self.active().all(|body| body.progress.longest <= still) {
                    // At rest: the remaining velocity is noise.
                    self.active().for_each(|body| body.iterate.v.fill([0.0; 4]));
                    return true;
                }
            } else if !alone {
                self.fall_asleep(absolute, relative);
            }
            match self.search() {
                Found::Step => stepped = true,
                Found::Nothing if stepped && !alone && self.wake(absolute, relative) => {}
                Found::Nothing if stepped && self.is_solved(wide, wide_relative) => break,
                // Steps of an earlier substep may mislead if contacts have changed.
                Found::Nothing if self.history.forget() => {}
                // Sweeps lose the momentum of bodies that touch each other and that nothing holds.
                Found::Nothing if stepped && !alone && self.all().any(|body| body.is_free()) => break,
                Found::Nothing => {
                    self.all().for_each(|body| body.restore());
                    return false;
                }
            }
        }
        self.finish();
        true
    }

    /// Predicts, moves the bodies to the start of the search, and evaluates them there.
    fn start(&mut self, share: f64, still: f32) {
        let (h, gravity) = (self.h, self.gravity());
        for member in 0..self.slots.len() {
            self.slots[member].solver.touching.pressed = self.pairs.presses(self.slots, member);
        }
        let frame = self.frame;
        for_each(self.slots, frame, |BodySlot { index, body, solver, report, .. }| {
            solver.predict(h, gravity);
            solver.progress.guess = solver.start_substep(&frame.of(*index), share, h, still, body);
            solver.update_warp();
            report.grasp_limited += usize::from(solver.progress.yielded);
            solver.system.reset_update();
        });
    }

    fn gravity(&self) -> [f32; 4] {
        self.frame.gravity.as_vec3a().extend(0.0).to_array()
    }

    /// Computes the gradient at the start of the search, and decides which bodies take part: among
    /// several bodies, one that neither moves nor would be moved by the forces on it stays where it
    /// is.
    fn choose_active(&mut self, alone: bool, still: f32) {
        let h = self.h;
        for body in self.all() {
            body.sleep.was_resting = !std::mem::replace(&mut body.sleep.active, true);
            (body.sleep.asleep, body.sleep.disturbed) = (false, false);
        }
        self.take_gradient();
        self.accept_gradient();
        self.refresh_limits();
        self.measure_rounding();
        if alone {
            return;
        }
        self.record_pushes();
        for_each(self.slots, self.frame, |BodySlot { solver, .. }| {
            if solver.is_quiet(h, still) && solver.correction_at_rest() <= still {
                solver.leave_at_rest(h);
            }
        });
        if self.all().any(|body| body.sleep.was_resting == body.sleep.active) {
            self.history.clear();
        }
    }

    /// Measures which gradients are rounding.
    fn measure_rounding(&mut self) {
        for body in self.all() {
            body.progress.rounding = ROUNDING_SHARE * f32::EPSILON * body.extent();
        }
    }

    /// Whether the forces on all bodies that take part are rounding, after a step that was short.
    fn is_rounding(&mut self, absolute: f32, relative: f32) -> bool {
        self.is_solved(absolute, relative) && self.active().all(|body| body.is_rounding())
    }

    /// Lets a single body stay where it is, if it is at rest.
    fn rest_alone(&mut self, still: f32) {
        let h = self.h;
        if let [BodySlot { solver, report, .. }] = self.slots
            && solver.progress.guess == InitialGuess::Still
            && solver.is_quiet(h, still)
            && solver.correction_at_rest() <= still
        {
            report.iterations += solver.settle(h);
            solver.leave_at_rest(h);
        }
    }

    /// Moves held nodes with their tools in bodies that could not start ahead. Returns whether any
    /// node moved.
    fn move_constraints(&mut self) -> bool {
        let h = self.h;
        let mut stepped = false;
        let behind = |solver: &QuasiNewtonSolver| {
            solver.sleep.active
                && solver.progress.guess == InitialGuess::Behind
                && (solver.progress.carried || solver.is_free())
        };
        for BodySlot { solver, report, .. } in self.slots.iter_mut().filter(|slot| behind(&slot.solver)) {
            report.iterations += 1;
            let motion = solver.move_constraints(h);
            stepped |= motion != ConstraintMotion::Blocked;
            let late = motion != ConstraintMotion::Arrived && !solver.progress.yielded;
            report.grasp_limited += usize::from(late);
        }
        self.take_gradient();
        self.accept_gradient();
        stepped
    }

    fn count_iteration(&mut self) {
        let active = self.slots.iter_mut().filter(|slot| slot.solver.sleep.active);
        active.for_each(|slot| slot.report.iterations += 1);
    }

    /// Ends the search: wakes all that moved, and takes the velocities.
    fn finish(&mut self) {
        let (h, gravity) = (self.h, self.gravity());
        self.all().for_each(|body| body.sleep.active |= std::mem::take(&mut body.sleep.asleep));
        self.keep_momentum();
        self.active().for_each(|body| body.take_velocities(h, gravity));
    }

    /// Removes the remaining sum of all forces from an island that nothing holds, by a translation,
    /// which changes no internal force.
    fn keep_momentum(&mut self) {
        if self.pairs.is_empty() || !self.all().all(|body| body.sleep.active && body.flies()) {
            return;
        }
        let force = self.active().map(|body| body.force()).fold(Vec3A::ZERO, |sum, part| sum + part);
        let mass: f32 = self.active().map(|body| body.mass()).sum();
        let by = force * (-self.h * self.h / mass);
        self.active().for_each(|body| body.shift(by));
    }
}
