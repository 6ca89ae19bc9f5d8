//! Columns of a factor's forward half, L^-1 u, for the three u that are 1 at a coordinate of a
//! node.
//!
//! The forward half of a solve carries a number of a node to the nodes that are eliminated after it
//! along the tree of supernodes: from its own supernode up to the root. This chain is a small part
//! of a body, so the columns are short. A node's three lie on the same chain.

use super::factor::Factor;
use super::tiles::ChainRoom;
use crate::lanes::{LANES, add_up, splat};
use fearless_simd::{Simd, SimdBase, f32x16};
use std::ops::Range;

/// Columns of a node's three coordinates.
#[derive(Clone, Default)]
pub(super) struct HalfColumns {
    /// The numbers of the chain's supernodes, ascending.
    ranges: Vec<Range<usize>>,
    /// Each column's numbers, range by range.
    columns: [Vec<f32>; 3],
}

impl HalfColumns {
    /// Solves for the columns of a node.
    #[inline(always)]
    pub fn solve<S: Simd>(&mut self, simd: S, factor: &Factor, room: &mut ChainRoom, node: usize) {
        for (c, column) in self.columns.iter_mut().enumerate() {
            factor.forward_chain(simd, 3 * node + c, room, column, &mut self.ranges);
        }
    }

    /// The numbers of the chain.
    pub fn ranges(&self) -> &[Range<usize>] {
        &self.ranges
    }

    /// Products with a vector that is solved by half.
    #[inline(always)]
    pub fn product<S: Simd>(&self, simd: S, y: &[f32]) -> [f64; 3] {
        let mut at = 0;
        let mut sums = [Sum::new(simd), Sum::new(simd), Sum::new(simd)];
        for range in &self.ranges {
            for (sum, column) in sums.iter_mut().zip(&self.columns) {
                sum.add(simd, &column[at..at + range.len()], &y[range.clone()]);
            }
            at += range.len();
        }
        sums.map(Sum::total)
    }

    /// Products with other columns: of this node's column r and the other's c at `[r][c]`. Two
    /// chains have their upper ends in common, or nothing.
    #[inline(always)]
    pub fn product_with<S: Simd>(&self, simd: S, other: &Self) -> [[f64; 3]; 3] {
        let both = self.ranges.iter().rev().zip(other.ranges.iter().rev());
        let common: usize = both.take_while(|(a, b)| a == b).map(|(a, _)| a.len()).sum();
        let mut products = [[0.0; 3]; 3];
        for (products, a) in products.iter_mut().zip(&self.columns) {
            for (product, b) in products.iter_mut().zip(&other.columns) {
                let mut sum = Sum::new(simd);
                sum.add(simd, &a[a.len() - common..], &b[b.len() - common..]);
                *product = sum.total();
            }
        }
        products
    }

    /// y -= the columns times their `shares`, for a vector that is solved by half, of which `y` has
    /// the numbers from `first` on.
    #[inline(always)]
    pub fn subtract(&self, shares: [f64; 3], first: usize, y: &mut [f32]) {
        let (mut at, shares) = (0, shares.map(|share| share as f32));
        let end = first + y.len();
        let [one, two, three] = &self.columns;
        for range in &self.ranges {
            let (from, to) = (range.start.max(first), range.end.min(end));
            if from < to {
                let numbers = at + from - range.start..at + to - range.start;
                let columns = one[numbers.clone()].iter().zip(&two[numbers.clone()]).zip(&three[numbers]);
                for (y, ((a, b), c)) in y[from - first..to - first].iter_mut().zip(columns) {
                    *y -= shares[0] * a + shares[1] * b + shares[2] * c;
                }
            }
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
