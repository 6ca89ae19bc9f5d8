//! L-BFGS: what the last steps taught about the Hessian.

use super::Island;
use crate::lanes::{Row, add_rows, dot_rows};
use fearless_simd::{Level, dispatch};

/// A body's part of the last steps and of the changes of the gradient along them.
pub(super) struct Memory {
    pairs: Vec<Taught>,
}

struct Taught {
    step: Vec<Row>,
    change: Vec<Row>,
    /// Both are zero.
    empty: bool,
}

/// Which of them are known, and the numbers that all bodies of an island share.
#[derive(Default)]
pub(super) struct History {
    /// Pairs in use; the newest is that of this number.
    count: usize,
    newest: usize,
    /// 1 / (step . change) of each pair.
    inverses: Vec<f32>,
    shares: Vec<f32>,
}

/// A pair whose curvature is below this share of its lengths says nothing.
const LEAST_CURVATURE: f32 = 1e-6;

impl Memory {
    /// Room for `pairs` of vectors of `rows`.
    pub fn new(pairs: usize, rows: usize) -> Self {
        let pair = || Taught { step: vec![[0.0; 4]; rows], change: vec![[0.0; 4]; rows], empty: true };
        Self { pairs: (0..pairs).map(|_| pair()).collect() }
    }

    /// Writes down a step of `share` times `direction`, which changed the gradient from `before` to `after`; step . change, step . step and change . change.
    fn write(
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
    fn forget(&mut self, at: usize) {
        let pair = &mut self.pairs[at];
        if !std::mem::replace(&mut pair.empty, true) {
            pair.step.fill([0.0; 4]);
            pair.change.fill([0.0; 4]);
        }
    }

    /// step . change.
    fn curvature(&self, level: Level, at: usize) -> f32 {
        let pair = &self.pairs[at];
        dispatch!(level, simd => dot_rows(simd, &pair.step, &pair.change))
    }
}

impl History {
    /// Room for `pairs`.
    pub fn new(pairs: usize) -> Self {
        Self { count: 0, newest: 0, inverses: vec![0.0; pairs], shares: vec![0.0; pairs] }
    }

    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Forgets everything; whether there was anything.
    pub fn forget(&mut self) -> bool {
        std::mem::take(&mut self.count) > 0
    }

    /// The pair that is `age` steps older than the newest.
    fn at(&self, age: usize) -> usize {
        (self.newest + self.inverses.len() - age) % self.inverses.len()
    }
}

impl Island<'_> {
    /// Learns from a step of `share` times the direction, between the gradient and the next.
    pub(super) fn learn(&mut self, share: f32) {
        let pairs = self.history.inverses.len();
        if pairs == 0 {
            return;
        }
        let next = (self.history.newest + 1) % pairs;
        let mut sums = [0.0f32; 3];
        for part in self.parts() {
            let gradients = [&part.gradient[..], &part.next_gradient];
            let products = part.memory.write(part.level, next, share, &part.direction, gradients);
            sums.iter_mut().zip(products).for_each(|(sum, product)| *sum += product);
        }
        // What a body would have learnt that is left alone or at rest: what stands there is of another time.
        for part in self.all().filter(|part| !part.active) {
            part.memory.forget(next);
        }
        let [curvature, steps, changes] = sums;
        let lengths: f32 = steps * changes;
        if curvature > LEAST_CURVATURE * lengths.sqrt() && curvature > f32::MIN_POSITIVE {
            self.history.inverses[next] = 1.0 / curvature;
            self.history.newest = next;
            self.history.count = (self.history.count + 1).min(pairs);
        } else {
            // The oldest pair was written over.
            self.history.count = self.history.count.min(pairs - 1);
        }
    }

    /// Takes the curvatures anew after other bodies take part: each step's share of them is a step as well.
    pub(super) fn recount(&mut self) {
        for age in 0..self.history.count {
            let at = self.history.at(age);
            let curvature: f32 = self.parts().map(|part| part.memory.curvature(part.level, at)).sum();
            if curvature <= f32::MIN_POSITIVE || curvature.is_nan() {
                self.history.count = age;
                return;
            }
            self.history.inverses[at] = 1.0 / curvature;
        }
    }

    /// First half of the two loops: takes out of the direction what the pairs explain, newest first.
    pub(super) fn explain(&mut self) {
        for age in 0..self.history.count {
            let at = self.history.at(age);
            let mut product = 0.0;
            for part in self.parts() {
                let (pair, direction) = (&part.memory.pairs[at], &part.direction);
                product += dispatch!(part.level, simd => dot_rows(simd, &pair.step, direction));
            }
            let share = self.history.inverses[at] * product;
            self.history.shares[at] = share;
            for part in self.parts() {
                let (pair, direction) = (&part.memory.pairs[at], &mut part.direction);
                dispatch!(part.level, simd => add_rows(simd, direction, -share, &pair.change));
            }
        }
    }

    /// Second half: puts it back, oldest first.
    pub(super) fn put_back(&mut self) {
        for age in (0..self.history.count).rev() {
            let at = self.history.at(age);
            let mut product = 0.0;
            for part in self.parts() {
                let (pair, direction) = (&part.memory.pairs[at], &part.direction);
                product += dispatch!(part.level, simd => dot_rows(simd, &pair.change, direction));
            }
            let share = self.history.shares[at] - self.history.inverses[at] * product;
            for part in self.parts() {
                let (pair, direction) = (&part.memory.pairs[at], &mut part.direction);
                dispatch!(part.level, simd => add_rows(simd, direction, share, &pair.step));
            }
        }
    }
}
