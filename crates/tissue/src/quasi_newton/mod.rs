//! The fast solver: a warped, prefactored quasi-Newton method.
//!
//! Every substep minimises implicit Euler's incremental potential of a body by L-BFGS (Nocedal 1980) whose first guess of the inverse Hessian is the body's stiffness at rest, factorised
//! once (Liu, Bouaziz and Kavan, "Quasi-Newton methods for real-time simulation of hyperelastic materials", 2017), and turned with the tissue around each node (stiffness warping,
//! Mueller and others 2002). It is global: a force at one end of an organ is felt at the other within one iteration. A line search by slope and a guard on the volumes make it safe;
//! a body that it cannot bring forward is left to the sweeps of Vertex Block Descent for that substep.
//!
//! Bodies that may touch each other are minimised together: one history and one line search over all of them, while each keeps its own factor.

mod at_rest;
mod dissection;
mod elements;
mod factor;
mod go;
mod history;
mod layout;
mod matrix;
mod part;
mod patch;
mod rigid;
mod search;
mod stress;
mod tiles;
mod wake;
mod warp;

use crate::contact::{Contacts, Pairs};
use crate::descent::{DescentIntegrator, Sweeps, sweep_substep};
use crate::integrator::{Frame, Solver, Worker, for_each};
use glam::Vec3A;
use go::{Guess, Pulled};
use history::History;
pub(crate) use part::QuasiNewtonSolver;
use search::Found;

impl Solver for QuasiNewtonSolver {
    const COUPLES: bool = true;

    fn advance(workers: &mut [Worker<Self>], frame: &Frame<'_>) {
        let mut pairs = std::mem::take(&mut workers[0].pairs);
        let mut history = std::mem::take(&mut workers[0].solver.history);
        let substeps = workers[0].solver.settings.substeps;
        let h = (frame.dt / substeps as f64) as f32;
        let mut island = Island { workers, pairs: &mut pairs, history: &mut history, frame, h };
        island.begin();
        for substep in 1..=substeps {
            let share = |k: usize| k as f64 / substeps as f64;
            island.advance(share(substep - 1), share(substep));
        }
        island.end();
        workers[0].pairs = pairs;
        workers[0].solver.history = history;
    }

    fn contacts(&self) -> Option<&Contacts> {
        Some(&self.contacts)
    }
}

impl Sweeps for QuasiNewtonSolver {
    fn sweeps(&mut self) -> (&mut DescentIntegrator, &mut Contacts) {
        (&mut self.fallback, &mut self.contacts)
    }
}

/// Times a minimum is looked for, each with friction's limits as they were at the last.
const ROUNDS: usize = 4;

/// Where no step helps any more, what was found is taken for the minimum if its correction is no longer than so many times the one that ends a substep: rounding, and not a search gone astray.
const FAR: f32 = 100.0;

/// Bodies that may touch each other, in a frame.
struct Island<'a> {
    workers: &'a mut [Worker<QuasiNewtonSolver>],
    pairs: &'a mut Pairs,
    history: &'a mut History,
    frame: &'a Frame<'a>,
    /// A substep's length [s].
    h: f32,
}

impl Island<'_> {
    /// The bodies that take part in the search.
    fn parts(&mut self) -> impl Iterator<Item = &mut QuasiNewtonSolver> {
        self.workers.iter_mut().map(|worker| &mut worker.solver).filter(|part| part.active)
    }

    /// All bodies.
    fn all(&mut self) -> impl Iterator<Item = &mut QuasiNewtonSolver> {
        self.workers.iter_mut().map(|worker| &mut worker.solver)
    }

    fn begin(&mut self) {
        let frame = self.frame;
        for_each(self.workers, frame, |Worker { index, body, solver, state, .. }| {
            solver.begin(&frame.of(*index), body, state);
        });
        self.begin_anew();
    }

    /// Forgets the way, and looks at the elements as they are.
    fn begin_anew(&mut self) {
        self.history.clear();
        let h = self.h;
        for_each(self.workers, self.frame, |Worker { solver, .. }| {
            solver.active = true;
            solver.pass_in_place(h);
        });
    }

    /// One substep, between two shares of the frame.
    fn advance(&mut self, from: f64, to: f64) {
        self.pairs.find(self.workers, self.h, |worker| from > 0.0 && !worker.solver.active);
        let frame = self.frame;
        for_each(self.workers, frame, |Worker { index, body, solver, .. }| {
            solver.find_touches(&frame.of(*index), body, from, to);
        });
        self.note_limited();
        // What the matrices do not know of may be too stiff for them.
        let usable = self.workers.iter().all(|worker| worker.solver.usable);
        if !usable {
            self.all().for_each(|part| part.aim_nowhere());
        }
        let went = usable && self.substep(to)
            || self.learn_touches() && {
                self.begin_anew();
                self.take_back_limited();
                self.substep(to)
            };
        if !went {
            self.take_back_limited();
            for worker in self.workers.iter_mut() {
                worker.report.fallbacks += 1;
                worker.solver.fallback.begin(&self.frame.of(worker.index), &worker.body);
                worker.solver.store(&mut worker.state);
            }
            sweep_substep(self.workers, self.pairs, self.frame, to);
            self.workers.iter_mut().for_each(|worker| worker.solver.load(&worker.state));
            self.begin_anew();
        }
        let coupled = !self.pairs.is_empty();
        for_each(self.workers, frame, |Worker { index, body, solver, state, .. }| {
            solver.settle(&frame.of(*index), body, to);
            if coupled {
                solver.store(state);
            }
        });
        self.pairs.settle(self.workers);
    }

    fn end(&mut self) {
        for worker in self.workers.iter_mut() {
            worker.solver.contacts.end(&mut worker.state);
            worker.solver.store(&mut worker.state);
        }
        self.pairs.end(self.workers);
    }

    /// Lets the matrices know of the tools and supports that press where the substep began or would have gone by itself; false if they did already.
    fn learn_touches(&mut self) -> bool {
        let mut new = false;
        for Worker { index, body, solver, state, .. } in self.workers.iter_mut() {
            new |= solver.learn_touches(&self.frame.of(*index), body, state);
        }
        new && self.workers.iter().all(|worker| worker.solver.usable)
    }

    fn note_limited(&mut self) {
        self.workers.iter_mut().for_each(|worker| worker.solver.limited = worker.report.grasp_limited);
    }

    fn take_back_limited(&mut self) {
        self.workers.iter_mut().for_each(|worker| worker.report.grasp_limited = worker.solver.limited);
    }

    /// One substep, which ends when `share` of the frame is over; false if it was given up, and nothing has changed then but scratch memory, and that bodies at rest have no velocity.
    fn substep(&mut self, share: f64) -> bool {
        let (h, gravity) = (self.h, self.frame.gravity.as_vec3a().extend(0.0).to_array());
        let alone = self.pairs.is_empty();
        for member in 0..self.workers.len() {
            self.workers[member].solver.pressed = self.pairs.presses(self.workers, member);
        }
        let frame = self.frame;
        for_each(self.workers, frame, |Worker { index, body, solver, report, .. }| {
            solver.predict(h, gravity);
            solver.guess = solver.guess(&frame.of(*index), share, h, body);
            solver.update_warp();
            report.grasp_limited += usize::from(solver.yielded);
            solver.patch.rest();
        });
        let moved = self.all().any(|part| part.guess != Guess::Still);
        let behind = self.all().any(|part| part.guess == Guess::Behind);
        self.choose_active(alone);
        self.for_active(|part| {
            if part.guess != Guess::Still {
                part.patch();
            }
        });
        let held = self.is_held();
        let (mut stepped, mut rounds) = (false, 0);
        if behind {
            stepped = self.pull();
        }
        let settings = self.workers[0].solver.settings;
        // Neither what positions cannot hold nor, at rest, what gravity does in a short substep is a correction.
        let rounding = self.rounding();
        let settled =
            if gravity == [0.0; 4] { f32::INFINITY } else { 1e-4 * h * h * self.frame.gravity.length() as f32 };
        let (tolerance, relative) = ((settings.tolerance as f32).max(rounding), settings.relative as f32);
        if alone {
            self.rest_alone(tolerance.min(settled));
        }
        for iteration in usize::from(behind)..settings.iterations {
            if self.parts().next().is_none() {
                // Nothing moves, and nothing did.
                return true;
            }
            self.find_direction();
            self.count();
            self.for_active(|part| part.look(iteration == 0));
            if self.is_solved(tolerance, relative) {
                if iteration > 0 || moved {
                    if !alone && self.wake(tolerance, relative) {
                        continue;
                    }
                    rounds += 1;
                    if alone || rounds == ROUNDS || !self.refresh_limits() {
                        break;
                    }
                    continue;
                }
                if self.parts().all(|part| part.longest <= settled) {
                    // At rest: what is left of the velocity is noise.
                    self.parts().for_each(|part| part.v.fill([0.0; 4]));
                    return true;
                }
            } else if !alone {
                self.doze(tolerance, relative);
            }
            match self.search() {
                Found::Step => stepped = true,
                Found::Nothing if stepped && !alone && self.wake(tolerance, relative) => {}
                Found::Nothing if stepped && (!held || self.is_solved(FAR * tolerance, FAR * relative)) => break,
                // What an earlier substep taught may mislead where contacts have changed.
                Found::Nothing if self.history.forget() => {}
                Found::Nothing => {
                    self.all().for_each(|part| part.restore());
                    return false;
                }
            }
        }
        self.all().for_each(|part| part.active |= std::mem::take(&mut part.dozes));
        self.keep_momentum();
        self.parts().for_each(|part| part.take_velocities(h, gravity));
        true
    }

    /// Finds the gradient where the substep starts from, and which bodies take part: among others, one that neither moves nor would by what pushes it is left where it is.
    fn choose_active(&mut self, alone: bool) {
        let h = self.h;
        for part in self.all() {
            part.was_resting = !std::mem::replace(&mut part.active, true);
            (part.dozes, part.stirred) = (false, false);
        }
        self.take_gradient();
        self.accept_gradient();
        self.refresh_limits();
        if alone {
            return;
        }
        self.note_pushes();
        let still = self.still();
        for_each(self.workers, self.frame, |Worker { solver, .. }| {
            if solver.is_quiet(h, still) && solver.correction_at_rest() <= still {
                solver.rest(h);
            }
        });
        if self.all().any(|part| part.was_resting == part.active) {
            self.history.clear();
        }
    }

    /// Leaves a body that no other is near where it is if it is at rest: what was found of it in the same place need not be found again.
    fn rest_alone(&mut self, limit: f32) {
        let h = self.h;
        if let [Worker { solver, .. }] = self.workers
            && solver.guess == Guess::Still
            && solver.is_quiet(h, limit)
            && solver.correction_at_rest() <= limit
        {
            solver.rest(h);
        }
    }

    /// What bodies at rest do not move in a substep [m]: what positions cannot hold, or a small share of what gravity would move them.
    fn still(&mut self) -> f32 {
        (1e-4 * self.h * self.h * self.frame.gravity.length() as f32).max(self.rounding())
    }

    /// What positions cannot hold [m].
    fn rounding(&mut self) -> f32 {
        2.0 * f32::EPSILON * self.parts().map(|part| part.extent()).fold(0.0, f32::max)
    }

    /// Takes out of an island that nothing holds what is left of the sum of all forces: moving all of it alike changes none of those between its parts.
    fn keep_momentum(&mut self) {
        if self.pairs.is_empty() || !self.all().all(|part| part.active && part.flies()) {
            return;
        }
        let force = self.parts().map(|part| part.force()).fold(Vec3A::ZERO, |sum, part| sum + part);
        let mass: f32 = self.parts().map(|part| part.mass()).sum();
        let by = force * (-self.h * self.h / mass);
        self.parts().for_each(|part| part.shift(by));
    }

    /// Counts an iteration.
    fn count(&mut self) {
        let active = self.workers.iter_mut().filter(|worker| worker.solver.active);
        active.for_each(|worker| worker.report.iterations += 1);
    }

    /// Whether something holds each of the bodies. What flies goes far in a substep without being deformed, and sweeps would carry that badly: it is left as it was found.
    fn is_held(&mut self) -> bool {
        !self.all().any(|part| part.is_free())
    }

    /// Goes on where bodies would not bear to be moved to where they go by themselves; whether anything moved.
    fn pull(&mut self) -> bool {
        let h = self.h;
        let mut stepped = false;
        let pulled = |solver: &QuasiNewtonSolver| solver.carried || solver.is_free();
        let behind = |solver: &QuasiNewtonSolver| solver.active && solver.guess == Guess::Behind && pulled(solver);
        for Worker { solver, report, .. } in self.workers.iter_mut().filter(|worker| behind(&worker.solver)) {
            report.iterations += 1;
            let pulled = solver.pull(h);
            stepped |= pulled != Pulled::Nowhere;
            report.grasp_limited += usize::from(pulled != Pulled::There && !solver.yielded);
        }
        self.take_gradient();
        self.accept_gradient();
        stepped
    }
}
