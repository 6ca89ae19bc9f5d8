//! The dense inverse of a factor.

use super::super::factor::{Factor, Field};
use crate::registers::{BLOCK, Block, parts};
use fearless_simd::{Level, Simd, dispatch};
use rayon::prelude::*;

/// The inverse of a matrix of `count` nodes by its factor, row by row, with `padded` numbers in a
/// row and as many rows. What fills it up is 0.
pub(super) fn of(factor: &Factor, level: Level, count: usize, padded: usize) -> Vec<f32> {
    let mut inverse = vec![0.0f32; padded * padded];
    inverse.par_chunks_mut(BLOCK * padded).enumerate().for_each(|(number, rows)| {
        // A lane solves for a column, which is a row too: the inverse is symmetric.
        let mut x: Field = vec![[Block([0.0; BLOCK]); 3]; count + 1];
        let own = |lane: usize| BLOCK * number + lane;
        for lane in (0..BLOCK).filter(|lane| own(*lane) < 3 * count) {
            x[own(lane) / 3][own(lane) % 3].0[lane] = 1.0;
        }
        dispatch!(level, simd => solve(simd, factor, &mut x));
        for (lane, row) in rows.chunks_exact_mut(padded).enumerate() {
            for (to, from) in row.iter_mut().zip(x[..count].as_flattened()) {
                *to = from.0[lane];
            }
        }
    });
    inverse
}

#[inline(always)]
fn solve<S: Simd>(simd: S, factor: &Factor, x: &mut Field) {
    for part in 0..parts::<S>() {
        factor.solve(simd, x, part);
    }
}
