//! A body's part of the last steps and changes of the gradient, and its products with them.
//!
//! Products of several pairs with a vector are found in one pass over blocks of rows, of which the
//! vector's stays in the nearest cache. Blocks do not depend on the threads, and their sums are
//! added in order.

use crate::lanes::{Row, add_rows_abreast, dot_rows, dot_rows_abreast};
use crate::threads::in_parts;
use fearless_simd::{Level, dispatch};

/// Rows of a block.
const BLOCK: usize = 1024;

/// Fewest blocks, and fewest rows, that are worth a thread of their own.
const MIN_BLOCKS: usize = 2;
pub(super) const MIN_ROWS: usize = MIN_BLOCKS * BLOCK;

/// Most blocks of the products of a pair with itself; they are larger for a large body.
const MAX_BLOCKS: usize = 64;

/// Rows of a register.
const QUAD: usize = 4;

/// Pairs that are read side by side.
const ABREAST: usize = 4;

/// A step and the change of the gradient along it.
struct Pair {
    step: Vec<Row>,
    change: Vec<Row>,
    /// Both are zero.
    empty: bool,
}

/// A body's part of the pairs.
pub(super) struct Memory {
    pairs: Vec<Pair>,
    /// The product of each pair's step with each one's change, row by row. Those of a step and an
    /// older change are not kept up.
    products: Vec<f64>,
    /// The products of each pair that were measured last.
    pub measured: Vec<f64>,
    /// Scratch: the same of each block.
    sums: Vec<Box<[f32]>>,
}

/// Which vectors of the pairs.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Half {
    Steps,
    Changes,
}

impl Pair {
    fn half(&self, half: Half) -> &[Row] {
        if half == Half::Steps { &self.step } else { &self.change }
    }
}

impl Memory {
    /// Room for `pairs` of vectors of `rows`.
    pub fn new(pairs: usize, rows: usize) -> Self {
        let pair = || Pair { step: vec![[0.0; 4]; rows], change: vec![[0.0; 4]; rows], empty: true };
        Self {
            pairs: (0..pairs).map(|_| pair()).collect(),
            products: vec![0.0; pairs * pairs],
            measured: vec![0.0; pairs],
            sums: vec![vec![0.0; pairs].into(); rows.div_ceil(BLOCK)],
        }
    }

    /// Records a step of `share` times `direction`, which changed the gradient from `before` to
    /// `after`, over pair `at`; `used` are the pairs in use. Returns step . change, step . step and
    /// change . change.
    pub fn record(
        &mut self,
        level: Level,
        (at, used): (usize, &[usize]),
        share: f32,
        direction: &[Row],
        [before, after]: [&[Row]; 2],
    ) -> [f64; 3] {
        let pair = &mut self.pairs[at];
        pair.empty = false;
        in_parts(&mut pair.step, MIN_ROWS, |first, step| {
            let direction = &direction[first..first + step.len()];
            dispatch!(level, _simd => for (to, from) in step.as_flattened_mut().iter_mut().zip(direction.as_flattened()) {
                *to = share * from;
            });
        });
        in_parts(&mut pair.change, MIN_ROWS, |first, change| {
            let rows = first..first + change.len();
            let values = after[rows.clone()].as_flattened().iter().zip(before[rows].as_flattened());
            dispatch!(level, _simd => for (to, (after, before)) in change.as_flattened_mut().iter_mut().zip(values) {
                *to = after - before;
            });
        });
        let change = std::mem::take(&mut pair.change);
        self.measure(level, Half::Steps, used, &change);
        let count = self.pairs.len();
        used.iter().for_each(|older| self.products[older * count + at] = self.measured[*older]);
        let products = self.own_products(level, &self.pairs[at].step, &change);
        self.products[at * count + at] = products[0];
        self.pairs[at].change = change;
        products
    }

    /// step . change, step . step and change . change.
    fn own_products(&self, level: Level, step: &[Row], change: &[Row]) -> [f64; 3] {
        let mut sums = [[0.0f32; 3]; MAX_BLOCKS];
        let size = step.len().div_ceil(MAX_BLOCKS).next_multiple_of(QUAD).max(BLOCK);
        let sums = &mut sums[..step.len().div_ceil(size)];
        in_parts(sums, MIN_ROWS.div_ceil(size), |first, sums| {
            for (k, sums) in sums.iter_mut().enumerate() {
                let from = (first + k) * size;
                let rows = from..step.len().min(from + size);
                let (step, change) = (&step[rows.clone()], &change[rows]);
                dispatch!(level, simd => {
                    *sums = [dot_rows(simd, step, change), dot_rows(simd, step, step), dot_rows(simd, change, change)];
                });
            }
        });
        [0, 1, 2].map(|k| sums.iter().map(|sums| f64::from(sums[k])).sum())
    }

    /// Forgets a step.
    pub fn forget(&mut self, at: usize) {
        let (count, pair) = (self.pairs.len(), &mut self.pairs[at]);
        if !std::mem::replace(&mut pair.empty, true) {
            pair.step.fill([0.0; 4]);
            pair.change.fill([0.0; 4]);
        }
        for k in 0..count {
            self.products[k * count + at] = 0.0;
            self.products[at * count + k] = 0.0;
        }
    }

    /// step . change of a pair's step and the change of the same or a newer one.
    pub fn product(&self, step: usize, change: usize) -> f64 {
        self.products[step * self.pairs.len() + change]
    }

    /// Measures the products of a vector with a half of the pairs of the numbers `used`.
    pub fn measure(&mut self, level: Level, half: Half, used: &[usize], vector: &[Row]) {
        let Self { pairs, sums, measured, .. } = self;
        in_parts(sums, MIN_BLOCKS, |first, sums| {
            for (k, sums) in sums.iter_mut().enumerate() {
                let from = (first + k) * BLOCK;
                let rows = from..vector.len().min(from + BLOCK);
                for group in used.chunks(ABREAST) {
                    let others = abreast(group, |at| &pairs[at].half(half)[rows.clone()]);
                    let products = dispatch!(level, simd => dot_rows_abreast(simd, &others, &vector[rows.clone()]));
                    group.iter().zip(products).for_each(|(at, product)| sums[*at] = product);
                }
            }
        });
        used.iter().for_each(|at| measured[*at] = sums.iter().map(|sums| f64::from(sums[*at])).sum());
    }

    /// Adds a half of the pairs of the numbers `used`, each times its factor, to `to`.
    pub fn add(&self, level: Level, half: Half, used: &[usize], factors: &[f64], to: &mut [Row]) {
        // Parts end where registers do.
        in_parts(to.as_chunks_mut::<QUAD>().0, MIN_ROWS / QUAD, |first, to| {
            for (k, to) in to.as_flattened_mut().chunks_mut(BLOCK).enumerate() {
                let from = QUAD * first + k * BLOCK;
                let rows = from..from + to.len();
                for (group, factors) in used.chunks(ABREAST).zip(factors.chunks(ABREAST)) {
                    let others = abreast(group, |at| &self.pairs[at].half(half)[rows.clone()]);
                    let factors = std::array::from_fn(|k| factors.get(k).map_or(0.0, |factor| *factor as f32));
                    dispatch!(level, simd => add_rows_abreast(simd, to, factors, &others));
                }
            }
        });
    }
}

/// What `of` says of the numbers of a group, the last one again where it is not full.
fn abreast<'a, T: ?Sized>(group: &[usize], of: impl Fn(usize) -> &'a T) -> [&'a T; ABREAST] {
    std::array::from_fn(|k| of(group[k.min(group.len() - 1)]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Isa;
    use trocar_core::Random;

    /// More rows than a block has, not a whole number of blocks, and a group of pairs that is not
    /// full.
    const ROWS: usize = 4 * BLOCK + 4 * 37;
    const PAIRS: usize = 6;

    fn noise(stream: u64) -> Vec<Row> {
        let random = Random::from_keys(&[stream]);
        (0..ROWS).map(|i| std::array::from_fn(|c| random.normal((4 * i + c) as u64) as f32)).collect()
    }

    fn exact(a: &[Row], b: &[Row]) -> f64 {
        a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
    }

    /// Sums of random numbers of one are off by rounding only.
    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-5 * (4 * ROWS) as f64
    }

    /// Products of pairs are sums of products, newer pairs have them with all older ones, and pairs
    /// are added by their factors.
    #[test]
    fn products_are_sums_over_all_rows() {
        let level = Isa::detect().level();
        let mut memory = Memory::new(PAIRS, ROWS);
        let used: Vec<usize> = (0..PAIRS).rev().collect();
        let changes: Vec<Vec<Row>> = (0..PAIRS as u64).map(noise).collect();
        let steps: Vec<Vec<Row>> = (100..100 + PAIRS as u64).map(noise).collect();
        let zero = vec![[0.0; 4]; ROWS];
        for at in 0..PAIRS {
            let own = memory.record(level, (at, &used[PAIRS - at..]), 1.0, &steps[at], [&zero[..], &changes[at]]);
            let [step, change] = [&steps[at], &changes[at]];
            let expected = [exact(step, change), exact(step, step), exact(change, change)];
            assert!(own.iter().zip(expected).all(|(a, b)| close(*a, b)), "{own:?} {expected:?}");
        }
        for new in 0..PAIRS {
            for old in 0..=new {
                assert!(close(memory.product(old, new), exact(&steps[old], &changes[new])), "{old} {new}");
            }
        }
        let vector = noise(200);
        memory.measure(level, Half::Changes, &used, &vector);
        assert!((0..PAIRS).all(|at| close(memory.measured[at], exact(&changes[at], &vector))));

        let factors: Vec<f64> = (0..PAIRS).map(|k| 0.5 + k as f64).collect();
        let mut sum = vector.clone();
        memory.add(level, Half::Steps, &used, &factors, &mut sum);
        for i in [0, BLOCK, ROWS - 1] {
            let parts = used.iter().zip(&factors).map(|(at, factor)| *factor as f32 * steps[*at][i][2]);
            let expected = parts.fold(vector[i][2], |sum, part| sum + part);
            assert!((sum[i][2] - expected).abs() < 1e-5, "row {i}: {} {expected}", sum[i][2]);
        }

        memory.forget(1);
        memory.measure(level, Half::Steps, &used, &vector);
        assert_eq!([memory.product(1, 1), memory.product(0, 1), memory.measured[1]], [0.0; 3]);
    }
}
