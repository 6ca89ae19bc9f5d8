//! What is asked of a body that stays where it is, and remembered, so that it need not be found again; and how far one that moves is from where it is to be.

use super::part::{QuasiNewtonSolver, longest};
use fearless_simd::dispatch;

impl QuasiNewtonSolver {
    /// The pass where a body is and stays, and those are the accepted positions. What has not moved since it was last looked at in place is not looked at again.
    pub fn pass_in_place(&mut self, h: f32) {
        if self.in_place && self.x == self.place_x && self.start == self.place_start {
            return;
        }
        self.pass(h);
        self.elements.accept();
        self.place_x.copy_from_slice(&self.x);
        self.place_start.copy_from_slice(&self.start);
        (self.in_place, self.warped_in_place) = (true, false);
    }

    /// Whether no node goes farther than `way` [m] by itself in a substep of `h` [s], and no tool carries any.
    pub fn is_quiet(&self, h: f32, way: f32) -> bool {
        !self.carried && h * dispatch!(self.level, _simd => longest(&self.v)) <= way
    }

    /// How far the gradient would move any node [m], without what was learnt. The direction is lost.
    pub fn correction(&mut self) -> f32 {
        self.direction.copy_from_slice(&self.gradient);
        self.precondition();
        dispatch!(self.level, _simd => longest(&self.direction))
    }

    /// The same where it may have been asked for before; without what the factor does not know of.
    pub fn correction_at_rest(&mut self) -> f32 {
        let free = self.layout.free;
        let same = self.gradient == self.rest_gradient && self.x[..free] == self.rest_x[..free];
        if let Some(correction) = self.rest_correction.filter(|_| same) {
            return correction;
        }
        self.rest_x[..free].copy_from_slice(&self.x[..free]);
        self.rest_gradient.copy_from_slice(&self.gradient);
        let correction = self.correction();
        self.rest_correction = Some(correction);
        correction
    }

    /// Leaves the body where the substep began.
    pub fn rest(&mut self, h: f32) {
        self.restore();
        for (y, v) in self.predictor.iter_mut().zip(&self.v) {
            (0..3).for_each(|c| y[c] -= h * v[c]);
        }
        self.v.fill([0.0; 4]);
        self.active = false;
    }

    /// Forgets where nodes would have gone by themselves.
    pub fn aim_nowhere(&mut self) {
        let free = self.layout.free;
        self.targets[..free].copy_from_slice(&self.x[..free]);
    }

    /// How far any coordinate is from where the node would have gone by itself [m]: what the substep was found to be about, without any rigid motion.
    pub(super) fn way(&self) -> f32 {
        let Self { level, layout, held, x, targets, .. } = self;
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

    /// Looks how long the direction is, and how far the body went; nowhere before the `first` step.
    pub fn look(&mut self, first: bool) {
        self.longest = dispatch!(self.level, _simd => longest(&self.direction));
        self.gone = if first { 0.0 } else { self.way() };
    }
}
