//! L-BFGS (Nocedal 1980): the last steps and the changes of the gradient along them.

use crate::lanes::{Row, dot_rows};
use fearless_simd::{Level, dispatch};

/// A body's part of the last steps and changes.
pub(super) struct Memory {
    pub pairs: Vec<Pair>,
}

/// A step and the change of the gradient along it.
pub(super) struct Pair {
    pub step: Vec<Row>,
    pub change: Vec<Row>,
    /// Both are zero.
    empty: bool,
}

/// Which pairs are in use, and the numbers that all bodies of an island share.
pub(crate) struct History {
    /// Pairs in use; the newest is that of this number.
    pub count: usize,
    pub newest: usize,
    /// The preconditioner's solutions are taken times this, as in Nocedal and Wright 2006,
    /// "Numerical Optimization", equation 7.20, but learned from the line search, which needs no
    /// other solve: the matrix at rest is too soft for squeezed and pressed tissue.
    pub scale: f32,
    /// 1 / (step . change) of each pair.
    pub inverses: Vec<f32>,
    /// Scratch of the two loops.
    pub shares: Vec<f32>,
}

/// A pair whose curvature is below this share of its lengths is not used.
pub(super) const MIN_CURVATURE_SHARE: f32 = 1e-6;

/// Smallest scale of the preconditioner's solutions.
const MIN_SCALE: f32 = 0.3;

impl Memory {
    /// Room for `pairs` of vectors of `rows`.
    pub fn new(pairs: usize, rows: usize) -> Self {
        let pair = || Pair { step: vec![[0.0; 4]; rows], change: vec![[0.0; 4]; rows], empty: true };
        Self { pairs: (0..pairs).map(|_| pair()).collect() }
    }

    /// Records a step of `share` times `direction`, which changed the gradient from `before` to
    /// `after`. Returns step . change, step . step and change . change.
    pub fn record(
        &mut self,
        level: Level,
        at: usize,
        share: f32,
        direction: &[Row],
        [before, after]: [&[Row]; 2],
    ) -> [f32; 3] {
        let pair = &mut self.pairs[at];
        pair.empty = false;
        dispatch!(level, simd => {
            for (to, from) in pair.step.as_flattened_mut().iter_mut().zip(direction.as_flattened()) {
                *to = share * from;
            }
            let values = after.as_flattened().iter().zip(before.as_flattened());
            for (to, (after, before)) in pair.change.as_flattened_mut().iter_mut().zip(values) {
                *to = after - before;
            }
            [
                dot_rows(simd, &pair.step, &pair.change),
                dot_rows(simd, &pair.step, &pair.step),
                dot_rows(simd, &pair.change, &pair.change),
            ]
        })
    }

    /// Forgets a step.
    pub fn forget(&mut self, at: usize) {
        let pair = &mut self.pairs[at];
        if !std::mem::replace(&mut pair.empty, true) {
            pair.step.fill([0.0; 4]);
            pair.change.fill([0.0; 4]);
        }
    }

    /// step . change.
    pub fn curvature(&self, level: Level, at: usize) -> f32 {
        let pair = &self.pairs[at];
        dispatch!(level, simd => dot_rows(simd, &pair.step, &pair.change))
    }
}

impl History {
    /// Room for `pairs`.
    pub fn new(pairs: usize) -> Self {
        Self { count: 0, newest: 0, scale: 1.0, inverses: vec![0.0; pairs], shares: vec![0.0; pairs] }
    }

    /// Forgets all pairs.
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Forgets all pairs. Returns whether there was any.
    pub fn forget(&mut self) -> bool {
        std::mem::take(&mut self.count) > 0
    }

    /// Learns which share of a direction would have been `best`. What the pairs know already has
    /// the right length, so it is the rest that was too long or too short.
    pub fn learn_scale(&mut self, best: f32) {
        self.scale = (self.scale * best).clamp(MIN_SCALE, 1.0);
    }

    /// Number of the pair that is `age` steps older than the newest.
    pub fn at(&self, age: usize) -> usize {
        (self.newest + self.inverses.len() - age) % self.inverses.len()
    }
}
