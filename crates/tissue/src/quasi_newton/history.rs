//! L-BFGS: what the last steps taught about the Hessian.

use crate::lanes::{Row, add_rows, dot_rows};
use fearless_simd::Simd;

/// The last steps and the changes of the gradient along them.
pub(super) struct History {
    pairs: Vec<Pair>,
    /// Pairs in use; the newest is `pairs[newest]`.
    count: usize,
    newest: usize,
    shares: Vec<f32>,
}

struct Pair {
    step: Vec<Row>,
    change: Vec<Row>,
    /// 1 / (step . change)
    inverse: f32,
}

/// A pair whose curvature is below this share of its lengths says nothing.
const LEAST_CURVATURE: f32 = 1e-6;

impl History {
    /// Room for `pairs` of vectors of `rows`.
    pub fn new(pairs: usize, rows: usize) -> Self {
        let pair = || Pair { step: vec![[0.0; 4]; rows], change: vec![[0.0; 4]; rows], inverse: 0.0 };
        Self { pairs: (0..pairs).map(|_| pair()).collect(), count: 0, newest: 0, shares: vec![0.0; pairs] }
    }

    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Forgets everything; whether there was anything.
    pub fn forget(&mut self) -> bool {
        std::mem::take(&mut self.count) > 0
    }

    /// Learns from a step of `share` times `direction`, which changed the gradient from `before` to `after`.
    #[inline(always)]
    pub fn learn<S: Simd>(&mut self, simd: S, share: f32, direction: &[Row], before: &[Row], after: &[Row]) {
        if self.pairs.is_empty() {
            return;
        }
        let next = (self.newest + 1) % self.pairs.len();
        let pair = &mut self.pairs[next];
        for (to, from) in pair.step.as_flattened_mut().iter_mut().zip(direction.as_flattened()) {
            *to = share * from;
        }
        let values = after.as_flattened().iter().zip(before.as_flattened());
        for (to, (after, before)) in pair.change.as_flattened_mut().iter_mut().zip(values) {
            *to = after - before;
        }
        let curvature = dot_rows(simd, &pair.step, &pair.change);
        let lengths = dot_rows(simd, &pair.step, &pair.step) * dot_rows(simd, &pair.change, &pair.change);
        if curvature > LEAST_CURVATURE * lengths.sqrt() && curvature > f32::MIN_POSITIVE {
            pair.inverse = 1.0 / curvature;
            self.newest = next;
            self.count = (self.count + 1).min(self.pairs.len());
        }
    }

    /// First half of the two loops: takes out of `q` what the pairs explain, newest first.
    #[inline(always)]
    pub fn before<S: Simd>(&mut self, simd: S, q: &mut [Row]) {
        for k in 0..self.count {
            let at = (self.newest + self.pairs.len() - k) % self.pairs.len();
            let pair = &self.pairs[at];
            let share = pair.inverse * dot_rows(simd, &pair.step, q);
            self.shares[at] = share;
            add_rows(simd, q, -share, &pair.change);
        }
    }

    /// Second half: puts it back into the direction `r`, oldest first.
    #[inline(always)]
    pub fn after<S: Simd>(&self, simd: S, r: &mut [Row]) {
        for k in (0..self.count).rev() {
            let at = (self.newest + self.pairs.len() - k) % self.pairs.len();
            let pair = &self.pairs[at];
            let share = self.shares[at] - pair.inverse * dot_rows(simd, &pair.change, r);
            add_rows(simd, r, share, &pair.step);
        }
    }
}
