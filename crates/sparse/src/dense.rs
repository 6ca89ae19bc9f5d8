//! Dense kernels over tiles.
//!
//! A band is a row of tiles: `LANES` rows of a matrix, stored column by column, so that a column of
//! a band is one vector. Bands follow each other. Every number of a result is a sum over the
//! columns in ascending order, multiplied and added apart: the bits do not depend on the CPU, on
//! the width of the kernel or on the number of threads.

use crate::Real;
use fearless_simd::{Level, Simd, SimdBase, dispatch};
use rayon::prelude::*;
use trocar_core::has_threads;

/// Columns that a kernel computes at once, and the multiple to which the columns of panels are
/// filled up with zeros. It divides the lanes of each type.
pub(crate) const COLUMNS: usize = 4;

/// Products of numbers above which one dense step is shared out over threads.
const SHARED: usize = 1 << 22;

/// Eliminates the first `width` columns of a front. `panel` has these columns: the bands of the
/// triangle, then those of the rows below. `update` has, by bands, the lower triangle of the rows
/// below; it loses the product of the eliminated columns with themselves. None if a pivot is not
/// positive.
pub(crate) fn eliminate<T: Real>(level: Level, width: usize, panel: &mut [T], update: &mut [T]) -> Option<()> {
    let band = T::LANES * width.next_multiple_of(COLUMNS);
    for (block, first) in (0..width).step_by(T::LANES).enumerate() {
        let columns = T::LANES.min(width - first);
        let (above, below) = panel[block * band..].split_at_mut(band);
        // The numbers at the left of the diagonal tile are read; the tile itself is written.
        let (left, right) = above.split_at_mut(T::LANES * first);
        let diagonal = &mut right[..T::LANES * columns.next_multiple_of(COLUMNS)];
        dispatch!(level, simd => subtract_product(simd, diagonal, left, left));
        factorise_tile(columns, diagonal)?;
        let work = below.len() * (first + columns);
        for_each(below.chunks_exact_mut(band), work, |rows| {
            let (done, rest) = rows.split_at_mut(T::LANES * first);
            let tile = &mut rest[..diagonal.len()];
            dispatch!(level, simd => {
                subtract_product(simd, tile, done, left);
                divide_by_tile(simd, columns, tile, diagonal);
            });
        });
    }
    let below = &panel[width.div_ceil(T::LANES) * band..];
    let work = update.len() * width;
    for_each(bands(update).into_iter().zip(below.chunks_exact(band)).enumerate(), work, |(i, (target, rows))| {
        for (columns, tile) in target.chunks_exact_mut(T::LANES * T::LANES).enumerate().take(i + 1) {
            let by = &below[columns * band..(columns + 1) * band];
            dispatch!(level, simd => subtract_product(simd, tile, rows, by));
        }
    });
    Some(())
}

/// Writes the inverse of a panel's triangle, transposed, one band of columns at a time: `take` gets
/// the number of the band, and its numbers in the layout of a band.
pub(crate) fn inverse_bands<T: Real>(level: Level, width: usize, panel: &[T], mut take: impl FnMut(usize, &[T])) {
    let band = T::LANES * width.next_multiple_of(COLUMNS);
    let mut rows = vec![T::default(); band];
    for number in 0..width.div_ceil(T::LANES) {
        // Rows of the identity, divided by the triangle from the right.
        let begin = T::LANES * number;
        rows.fill(T::default());
        (begin..width.min(begin + T::LANES)).for_each(|k| rows[T::LANES * k + k - begin] = T::ONE);
        for first in (begin..width).step_by(T::LANES) {
            let columns = T::LANES.min(width - first);
            let (left, right) = panel[first / T::LANES * band..][..band].split_at(T::LANES * first);
            let (done, rest) = rows.split_at_mut(T::LANES * first);
            let tile = &mut rest[..T::LANES * columns.next_multiple_of(COLUMNS)];
            dispatch!(level, simd => {
                subtract_product(simd, tile, &done[T::LANES * begin..], &left[T::LANES * begin..]);
                divide_by_tile(simd, columns, tile, right);
            });
        }
        take(number, &rows);
    }
}

/// First number of band `i` of a lower triangle that is stored by bands.
pub(crate) fn first_of_band<T: Real>(i: usize) -> usize {
    T::LANES * T::LANES * (i * (i + 1) / 2)
}

/// The bands of a lower triangle.
fn bands<T: Real>(mut update: &mut [T]) -> Vec<&mut [T]> {
    let mut list = Vec::new();
    while !update.is_empty() {
        let (band, rest) = update.split_at_mut(T::LANES * T::LANES * (list.len() + 1));
        list.push(band);
        update = rest;
    }
    list
}

/// Calls `f` with each item, on several threads if the `work` is worth it.
fn for_each<I: Send>(items: impl Iterator<Item = I>, work: usize, f: impl Fn(I) + Sync) {
    if work > SHARED && has_threads() {
        items.collect::<Vec<_>>().into_par_iter().for_each(&f);
    } else {
        items.for_each(f);
    }
}

/// c -= a b', where b' has the first rows of band b as its columns: as many as c has columns.
#[inline(always)]
fn subtract_product<T: Real, S: Simd>(simd: S, c: &mut [T], a: &[T], b: &[T]) {
    for (group, c) in c.chunks_exact_mut(T::LANES * COLUMNS).enumerate() {
        let mut sums = [T::Vector::<S>::from_slice(simd, &c[..T::LANES]); COLUMNS];
        for (sum, c) in sums.iter_mut().zip(c.chunks_exact(T::LANES)) {
            *sum = T::Vector::from_slice(simd, c);
        }
        for (a, b) in a.chunks_exact(T::LANES).zip(b.chunks_exact(T::LANES)) {
            let a = T::Vector::<S>::from_slice(simd, a);
            for (sum, b) in sums.iter_mut().zip(&b[COLUMNS * group..COLUMNS * (group + 1)]) {
                *sum -= a * *b;
            }
        }
        for (sum, c) in sums.iter().zip(c.chunks_exact_mut(T::LANES)) {
            sum.store_slice(c);
        }
    }
}

/// Factorises the tile on the diagonal in place. None if a pivot is not positive.
fn factorise_tile<T: Real>(columns: usize, tile: &mut [T]) -> Option<()> {
    for c in 0..columns {
        let pivot = tile[T::LANES * c + c];
        // What is not finite above or beside a pivot reaches a later one.
        if pivot <= T::default() || !pivot.is_finite() {
            return None;
        }
        let root = pivot.sqrt();
        tile[T::LANES * c + c] = root;
        // The tile's upper triangle is not read.
        (c + 1..columns).for_each(|r| tile[T::LANES * c + r] = tile[T::LANES * c + r] / root);
        for j in c + 1..columns {
            let by = tile[T::LANES * c + j];
            (j..columns).for_each(|r| tile[T::LANES * j + r] = tile[T::LANES * j + r] - tile[T::LANES * c + r] * by);
        }
    }
    Some(())
}

/// x = x L'^-1, L being the triangle in `tile`.
#[inline(always)]
fn divide_by_tile<T: Real, S: Simd>(simd: S, columns: usize, x: &mut [T], tile: &[T]) {
    for c in 0..columns {
        let (done, rest) = x.split_at_mut(T::LANES * c);
        let mut sum = T::Vector::<S>::from_slice(simd, &rest[..T::LANES]);
        for (x, l) in done.chunks_exact(T::LANES).zip(tile.chunks_exact(T::LANES)) {
            sum -= T::Vector::<S>::from_slice(simd, x) * l[c];
        }
        sum *= T::ONE / tile[T::LANES * c + c];
        sum.store_slice(&mut rest[..T::LANES]);
    }
}
