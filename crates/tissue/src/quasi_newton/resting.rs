//! A body that stays where it is: results there are reused.

use super::body_system::QuasiNewtonSolver;
use super::iterate::{Iterate, max_coordinate};
use super::sleep::RestCache;
use crate::lanes::{Row, same_rows};
use fearless_simd::dispatch;

/// A body that comes to rest takes at most this many steps to its equilibrium, as long as each
/// correction is at most this share of the one before: then only rounding is left, or slow motion
/// that hardly matters.
const MAX_SETTLING_STEPS: usize = 32;
const MAX_SETTLING_RATIO: f32 = 0.95;

impl QuasiNewtonSolver {
    /// Evaluates the elements where the body is and stays, and accepts their volumes. A body that
    /// has not moved since it was last evaluated in place is not evaluated again.
    pub fn evaluate_in_place(&mut self, h: f32) {
        let (Iterate { x, start, .. }, rest) = (&self.iterate, &self.rest);
        let same = |a: &[Row], b: &[Row]| same_rows(self.level, a, b);
        if self.elements.in_place && same(x, &rest.x) && same(start, &rest.start) {
            return;
        }
        let Self { level, elements, layout, iterate, rest, .. } = self;
        elements.evaluate(*level, layout, iterate, h);
        elements.accept();
        rest.x.copy_from_slice(&iterate.x);
        rest.start.copy_from_slice(&iterate.start);
        elements.in_place = true;
        (rest.warped, rest.has_gradient) = (false, false);
    }

    /// Writes the gradient of elements and inertia into the next gradient: a known one while the
    /// body stays where it is.
    pub fn take_own_gradient(&mut self, h: f32) {
        let Self { level, elements, iterate, rest, .. } = self;
        let stays = elements.in_place && same_rows(*level, &iterate.x, &rest.x);
        if stays && rest.has_gradient && same_rows(*level, &iterate.predictor, &rest.predictor) {
            iterate.next_gradient.copy_from_slice(&rest.gradient);
            return;
        }
        self.gradient_at(h);
        let Self { iterate, rest, .. } = self;
        if stays {
            rest.gradient.copy_from_slice(&iterate.next_gradient);
            rest.predictor.copy_from_slice(&iterate.predictor);
        }
        rest.has_gradient = stays;
    }

    /// Whether no node moves farther than `way` (m) freely in a substep of `h` (s), and no tool
    /// carries one.
    pub fn is_quiet(&self, h: f32, way: f32) -> bool {
        !self.progress.carried && self.farthest_free_motion(h) <= way
    }

    /// The largest coordinate of the free motion of a node in a substep of `h` (m).
    pub fn farthest_free_motion(&self, h: f32) -> f32 {
        h * dispatch!(self.level, _simd => max_coordinate(&self.iterate.v))
    }

    /// The largest motion of a node by the gradient (m), without the history. It overwrites the
    /// direction.
    pub fn correction(&mut self) -> f32 {
        self.iterate.direction.copy_from_slice(&self.iterate.gradient);
        self.precondition();
        dispatch!(self.level, _simd => max_coordinate(&self.iterate.direction))
    }

    /// The same, from the cache if positions and gradient are still the same; without contacts that
    /// are not in the factor.
    pub fn correction_at_rest(&mut self) -> f32 {
        let free = self.layout.free;
        let Self { level, rest: RestCache { correction_x, correction_gradient, correction, .. }, iterate, .. } = self;
        let same = correction.is_some()
            && same_rows(*level, &iterate.gradient, correction_gradient)
            && same_rows(*level, &iterate.x[..free], &correction_x[..free]);
        if let Some(correction) = correction.filter(|_| same) {
            return correction;
        }
        correction_x[..free].copy_from_slice(&iterate.x[..free]);
        correction_gradient.copy_from_slice(&iterate.gradient);
        let correction = self.correction();
        self.rest.correction = Some(correction);
        correction
    }

    /// Brings a body that comes to rest near its equilibrium, until corrections hardly shrink.
    /// Returns the number of steps. A body without velocity is at rest and stays where it is.
    pub fn settle(&mut self, h: f32) -> usize {
        if self.iterate.v.as_flattened().iter().all(|v| *v == 0.0) {
            return 0;
        }
        self.drop_velocity(h);
        self.update_stiffened();
        self.update_contacts();
        let mut last = self.correction_here(h);
        for step in 0..MAX_SETTLING_STEPS {
            if last == 0.0 {
                return step;
            }
            self.turn_downhill();
            let Iterate { base, x, .. } = &mut self.iterate;
            base.copy_from_slice(&x[..self.layout.rows]);
            if !self.apply_step(1.0, h) {
                return step;
            }
            self.begin_here(h);
            let next = self.correction_here(h);
            if next >= last {
                let (free, Iterate { base, x, .. }) = (self.layout.free, &mut self.iterate);
                x[..free].copy_from_slice(&base[..free]);
                self.begin_here(h);
            }
            if next > MAX_SETTLING_RATIO * last {
                return step + 1;
            }
            last = next;
        }
        MAX_SETTLING_STEPS
    }

    /// The largest motion of a node by the forces where the body is (m).
    fn correction_here(&mut self, h: f32) -> f32 {
        self.take_gradient(h);
        self.accept_gradient();
        self.correction()
    }

    /// Begins the substep where the body is.
    fn begin_here(&mut self, h: f32) {
        let Iterate { predictor, start, x, .. } = &mut self.iterate;
        for ((y, start), x) in predictor.iter_mut().zip(start).zip(&x[..self.layout.free]) {
            (0..3).for_each(|c| y[c] += x[c] - start[c]);
            *start = *x;
        }
        self.elements.dashpots.begin_elsewhere();
        self.evaluate_in_place(h);
    }

    /// Drops the velocities and their part of the predictor.
    fn drop_velocity(&mut self, h: f32) {
        let Iterate { predictor, v, .. } = &mut self.iterate;
        for (y, v) in predictor.iter_mut().zip(v.iter()) {
            (0..3).for_each(|c| y[c] -= h * v[c]);
        }
        v.fill([0.0; 4]);
    }

    /// Lets the body stay where the substep began.
    pub fn leave_at_rest(&mut self, h: f32) {
        self.restore();
        self.drop_velocity(h);
        self.sleep.active = false;
    }

    /// Sets the targets of the substep to where the nodes are.
    pub fn clear_targets(&mut self) {
        let (free, Iterate { targets, x, .. }) = (self.layout.free, &mut self.iterate);
        targets[..free].copy_from_slice(&x[..free]);
    }

    /// Measures the direction, as it would be without the `scale`, and the body's motion, which is
    /// zero before the `first` step.
    pub fn measure_direction(&mut self, first: bool, scale: f32) {
        self.progress.longest = dispatch!(self.level, _simd => max_coordinate(&self.iterate.direction)) / scale;
        self.progress.gone = if first { 0.0 } else { self.gone() };
    }

    /// Largest distance of a coordinate from its free motion (m): the deformation in the substep,
    /// without rigid motion.
    fn gone(&self) -> f32 {
        let Self { level, layout, held, iterate: Iterate { x, targets, .. }, .. } = self;
        dispatch!(*level, _simd => {
            let mut most = [0.0f32; 4];
            for ((x, to), held) in x[..layout.free].iter().zip(targets).zip(held) {
                let counts = if *held { 0.0 } else { 1.0 };
                for c in 0..4 {
                    most[c] = most[c].max(counts * (x[c] - to[c]).abs());
                }
            }
            most[0].max(most[1]).max(most[2])
        })
    }
}
