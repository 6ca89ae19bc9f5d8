//! Columns of a factor's forward half, L^-1 u, for a u that has numbers at a few nodes only.
//!
//! The forward half of a solve carries a number of a node to the nodes that are eliminated after it
//! along the tree of supernodes: from its own supernode up to the root. This chain is a small part
//! of a body, so the column is short. Nodes that share an element lie on one chain.

use super::factor::Factor;
use crate::lanes::{LANES, add_up, splat};
use fearless_simd::{Simd, SimdBase, f32x16};
use std::ops::Range;

/// L^-1 u on the chain of supernodes that u's numbers lie on.
#[derive(Clone, Default)]
pub(super) struct HalfColumn {
    /// The numbers of the chain's supernodes, ascending.
    ranges: Vec<Range<usize>>,
    /// Its numbers, range by range.
    numbers: Vec<f32>,
}

impl HalfColumn {
    /// Solves for the u that has these numbers at these places, which lie on one chain. `scratch`
    /// is as long as the vectors of a solve.
    #[inline(always)]
    pub fn solve<S: Simd>(
        &mut self,
        simd: S,
        factor: &mut Factor,
        scratch: &mut [f32],
        u: impl Iterator<Item = (usize, f32)>,
    ) {
        scratch.fill(0.0);
        let mut lowest = usize::MAX;
        for (place, number) in u {
            scratch[place] += number;
            lowest = lowest.min(place);
        }
        factor.forward_chain(simd, lowest, scratch, &mut self.ranges);
        self.numbers.clear();
        for range in &self.ranges {
            self.numbers.extend_from_slice(&scratch[range.clone()]);
        }
    }

    /// Product with a vector that is solved by half.
    #[inline(always)]
    pub fn product<S: Simd>(&self, simd: S, y: &[f32]) -> f64 {
        let (mut at, mut sum) = (0, Sum::new(simd));
        for range in &self.ranges {
            sum.add(simd, &self.numbers[at..at + range.len()], &y[range.clone()]);
            at += range.len();
        }
        sum.total()
    }

    /// Product with another column. Two chains have their upper ends in common, or nothing.
    #[inline(always)]
    pub fn product_with<S: Simd>(&self, simd: S, other: &Self) -> f64 {
        let both = self.ranges.iter().rev().zip(other.ranges.iter().rev());
        let common: usize = both.take_while(|(a, b)| a == b).map(|(a, _)| a.len()).sum();
        let mut sum = Sum::new(simd);
        let [a, b] = [&self.numbers, &other.numbers].map(|numbers| &numbers[numbers.len() - common..]);
        sum.add(simd, a, b);
        sum.total()
    }

    /// y -= share L^-1 u, for a vector that is solved by half.
    #[inline(always)]
    pub fn subtract(&self, share: f32, y: &mut [f32]) {
        let mut at = 0;
        for range in &self.ranges {
            let numbers = &self.numbers[at..at + range.len()];
            y[range.clone()].iter_mut().zip(numbers).for_each(|(y, x)| *y -= share * x);
            at += range.len();
        }
    }
}

/// A sum of products, by lanes.
struct Sum<S: Simd> {
    lanes: f32x16<S>,
    /// Of the numbers that fill no vector.
    others: f64,
}

impl<S: Simd> Sum<S> {
    #[inline(always)]
    fn new(simd: S) -> Self {
        Self { lanes: splat(simd, 0.0), others: 0.0 }
    }

    #[inline(always)]
    fn add(&mut self, simd: S, a: &[f32], b: &[f32]) {
        let (mut a, mut b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
        for (a, b) in (&mut a).zip(&mut b) {
            self.lanes += f32x16::from_slice(simd, a) * f32x16::from_slice(simd, b);
        }
        for (a, b) in a.remainder().iter().zip(b.remainder()) {
            self.others += f64::from(*a) * f64::from(*b);
        }
    }

    #[inline(always)]
    fn total(self) -> f64 {
        f64::from(add_up(self.lanes)) + self.others
    }
}
