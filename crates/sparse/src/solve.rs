//! Solves with the factor: forward and back substitution, a band of rows in each vector.

use crate::cholesky::Panel;
use crate::dense::COLUMNS;
use crate::{Cholesky, Real};
use fearless_simd::{Level, Simd, SimdBase, dispatch};

/// Sums of four columns.
type Sums<T, S> = [<T as Real>::Vector<S>; COLUMNS];

impl<T: Real> Cholesky<T> {
    /// Solves A x = b in place, three numbers a node, nodes as the matrix numbers them, with
    /// vectors of `level`. The bits do not depend on it.
    pub fn solve(&self, level: Level, x: &mut [T]) {
        let mut y: Vec<T> = Vec::with_capacity(x.len());
        for i in self.order() {
            y.extend_from_slice(&x[3 * *i as usize..3 * *i as usize + 3]);
        }
        dispatch!(level, simd => self.substitute(simd, &mut y));
        for (from, to) in self.order().iter().enumerate() {
            x[3 * *to as usize..3 * *to as usize + 3].copy_from_slice(&y[3 * from..3 * from + 3]);
        }
    }

    #[inline(always)]
    fn substitute<S: Simd>(&self, simd: S, y: &mut [T]) {
        let (mut own, mut below) = (Vec::new(), Vec::new());
        for panel in self.panels() {
            panel.forward(simd, y, &mut own, &mut below);
        }
        for panel in self.panels().rev() {
            panel.backward(simd, y, &mut own, &mut below);
        }
    }
}

impl<T: Real> Panel<'_, T> {
    /// Divides the panel's part of `y` by its triangle, and takes the product with the rows below
    /// from theirs.
    #[inline(always)]
    fn forward<S: Simd>(&self, simd: S, y: &mut [T], own: &mut Vec<T>, below: &mut Vec<T>) {
        let (first, width) = (self.first(), self.width());
        self.read(y, own);
        for begin in (0..width).step_by(T::LANES) {
            let end = width.min(begin + T::LANES);
            for column in begin..end {
                own[column] = own[column] / self.at(column, column);
                for row in column + 1..end {
                    own[row] = own[row] - self.at(row, column) * own[column];
                }
            }
            for band in begin / T::LANES + 1..self.bands() {
                let product = product(simd, self.band(band), &own[..], begin, end);
                let rows = &mut own[T::LANES * band..T::LANES * (band + 1)];
                (T::Vector::<S>::from_slice(simd, rows) - product).store_slice(rows);
            }
        }
        below.clear();
        below.resize(T::LANES * self.bands_below(), T::default());
        for band in 0..self.bands_below() {
            let product = product(simd, self.band(self.bands() + band), &own[..], 0, width);
            product.store_slice(&mut below[T::LANES * band..T::LANES * (band + 1)]);
        }
        y[first..first + width].copy_from_slice(&own[..width]);
        for k in 0..self.rows().len() {
            let to = 3 * self.rows()[k] as usize;
            for c in 0..3 {
                y[to + c] = y[to + c] - below[3 * k + c];
            }
        }
    }

    /// Takes the product of the rows below with the transposed panel from its part of `y`, and
    /// divides that by the transposed triangle.
    #[inline(always)]
    fn backward<S: Simd>(&self, simd: S, y: &mut [T], own: &mut Vec<T>, below: &mut Vec<T>) {
        let (first, width) = (self.first(), self.width());
        self.read(y, own);
        below.clear();
        for row in self.rows() {
            below.extend_from_slice(&y[3 * *row as usize..3 * *row as usize + 3]);
        }
        below.resize(T::LANES * self.bands_below(), T::default());
        let zero = T::Vector::<S>::splat(simd, T::default());
        for begin in (0..self.bands()).rev().map(|band| T::LANES * band) {
            let end = width.min(begin + T::LANES);
            for group in (begin..end).step_by(COLUMNS) {
                let mut sums: Sums<T, S> = [zero; COLUMNS];
                for band in begin / T::LANES + 1..self.bands() {
                    let rows = &own[T::LANES * band..T::LANES * (band + 1)];
                    add_transposed(simd, self.band(band), rows, group, &mut sums);
                }
                for band in 0..self.bands_below() {
                    let rows = &below[T::LANES * band..T::LANES * (band + 1)];
                    add_transposed(simd, self.band(self.bands() + band), rows, group, &mut sums);
                }
                for k in 0..COLUMNS.min(end - group) {
                    own[group + k] = own[group + k] - total::<T, S>(sums[k]);
                }
            }
            for column in (begin..end).rev() {
                for row in column + 1..end {
                    own[column] = own[column] - self.at(row, column) * own[row];
                }
                own[column] = own[column] / self.at(column, column);
            }
        }
        y[first..first + width].copy_from_slice(&own[..width]);
    }

    /// Reads the panel's part of `y`, filled up to whole bands with zeros.
    #[inline(always)]
    fn read(&self, y: &[T], own: &mut Vec<T>) {
        own.clear();
        own.extend_from_slice(&y[self.first()..self.first() + self.width()]);
        own.resize(T::LANES * self.bands(), T::default());
    }
}

/// The product of the columns from `begin` to `end` of a band with `x`.
#[inline(always)]
fn product<T: Real, S: Simd>(simd: S, band: &[T], x: &[T], begin: usize, end: usize) -> T::Vector<S> {
    let mut sums: Sums<T, S> = [T::Vector::<S>::splat(simd, T::default()); COLUMNS];
    for group in (begin..end).step_by(COLUMNS) {
        for k in 0..COLUMNS {
            let column = T::Vector::<S>::from_slice(simd, &band[T::LANES * (group + k)..T::LANES * (group + k + 1)]);
            sums[k] += column * x[group + k];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}

/// Adds the products of `x` with four columns of a band, from `group` on, lane by lane.
#[inline(always)]
fn add_transposed<T: Real, S: Simd>(simd: S, band: &[T], x: &[T], group: usize, sums: &mut Sums<T, S>) {
    let x = T::Vector::<S>::from_slice(simd, x);
    for k in 0..COLUMNS {
        let column = T::Vector::<S>::from_slice(simd, &band[T::LANES * (group + k)..T::LANES * (group + k + 1)]);
        sums[k] += column * x;
    }
}

/// The sum of the lanes.
#[inline(always)]
fn total<T: Real, S: Simd>(lanes: T::Vector<S>) -> T {
    let mut sum = T::default();
    for lane in 0..T::LANES {
        sum = sum + lanes[lane];
    }
    sum
}
