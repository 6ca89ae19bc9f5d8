//! One tile of a packed factor: 16 x 16 numbers in 8 bits each, their remainders, and products.
//!
//! Products are of whole numbers and therefore exact: vectors are rounded to whole numbers first.

use super::supernode::TILE_SIZE;
use fearless_simd::{
    Bytes, Simd, SimdBase, SimdCvtFloat, SimdCvtTruncate, SimdIntWiden, SimdSplit, SimdWiden, f32x16, i8x64, i16x32,
    i32x16,
};

/// Greatest number in 8 bits.
const MAX_INT8: f32 = 127.0;

/// Greatest number of a rounded vector.
const MAX_INT16: f32 = 32767.0;

/// Numbers that are all smaller than this count as 0.
const MIN_GREATEST: f32 = 1e-30;

/// 1.5 * 2^23. Added to a number of at most 2^22 in size, it rounds it to the nearest whole number,
/// to the even one of two. The low 16 bits of the sum are those of that number. SSE2 has no
/// instruction that rounds.
const WHOLE: f32 = 12_582_912.0;

/// Column k is paired with column k + 8.
const PAIRS: usize = TILE_SIZE / 2;

/// 16 x 16 numbers: pair after pair of columns, and in each row after row.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct Tile {
    numbers: [i8; TILE_SIZE * TILE_SIZE],
}

impl Tile {
    /// What numbers are multiplied by before they are rounded, and again what that leaves of them.
    pub const UNIT: f32 = MAX_INT8;
    pub const REMAINDER_UNIT: f32 = 2.0 * MAX_INT8;

    /// All zero.
    pub const ZERO: Self = Self { numbers: [0; TILE_SIZE * TILE_SIZE] };

    /// Rounds the numbers of `column(number)`, between -1 and 1. Also returns what the rounding
    /// leaves.
    #[inline(always)]
    pub fn pack<S: Simd>(simd: S, column: impl Fn(usize) -> f32x16<S>) -> [Self; 2] {
        let [mut tile, mut remainder] = [Self::ZERO; 2];
        for pair in 0..PAIRS {
            let [first, second] = [pair, pair + PAIRS].map(|number| column(number) * Self::UNIT);
            let [whole, other] = [first, second].map(nearest_whole);
            let [left, right] = [first - whole, second - other].map(|x| nearest_whole(x * Self::REMAINDER_UNIT));
            let place = 2 * TILE_SIZE * pair..2 * TILE_SIZE * (pair + 1);
            store_bytes(simd, [whole, other], &mut tile.numbers[place.clone()]);
            store_bytes(simd, [left, right], &mut remainder.numbers[place]);
        }
        [tile, remainder]
    }

    /// tile y.
    #[inline(always)]
    pub fn product<S: Simd>(&self, simd: S, y: &Pairs) -> i32x16<S> {
        let mut sums = [i32x16::splat(simd, 0); 2];
        for q in 0..4 {
            let (pair, next) = i8x64::from_slice(simd, &self.numbers[64 * q..64 * (q + 1)]).widen();
            sums[0] += pair.pairwise_dot_product(i32x16::splat(simd, y[2 * q]).bitcast::<i16x32<S>>());
            sums[1] += next.pairwise_dot_product(i32x16::splat(simd, y[2 * q + 1]).bitcast::<i16x32<S>>());
        }
        sums[0] + sums[1]
    }

    /// Adds the products of the tile's columns with `x`, as [`round`] left it, lane by lane; the
    /// caller needs their sums over lanes.
    #[inline(always)]
    pub fn add_transposed<S: Simd>(&self, simd: S, x: &[f32], sums: &mut [i32x16<S>; TILE_SIZE]) {
        let x: i32x16<S> = f32x16::from_slice(simd, x).bitcast();
        let first: i16x32<S> = (x & 0xffff).bitcast();
        let second: i16x32<S> = (x << 16).bitcast();
        for q in 0..4 {
            let (pair, next) = i8x64::from_slice(simd, &self.numbers[64 * q..64 * (q + 1)]).widen();
            sums[2 * q] += pair.pairwise_dot_product(first);
            sums[2 * q + PAIRS] += pair.pairwise_dot_product(second);
            sums[2 * q + 1] += next.pairwise_dot_product(first);
            sums[2 * q + 1 + PAIRS] += next.pairwise_dot_product(second);
        }
    }
}

/// The nearest whole numbers.
#[inline(always)]
fn nearest_whole<S: Simd>(x: f32x16<S>) -> f32x16<S> {
    (x + WHOLE) - WHOLE
}

/// Stores whole numbers of two columns, row by row.
#[inline(always)]
fn store_bytes<S: Simd>(_simd: S, columns: [f32x16<S>; 2], out: &mut [i8]) {
    let [first, second] = columns.map(i32x16::truncate_from);
    let words: [i32; TILE_SIZE] = (first & 0xff | second << 8).into();
    for (out, word) in out.as_chunks_mut::<2>().0.iter_mut().zip(words) {
        *out = (word as i16).to_le_bytes().map(|byte| byte as i8);
    }
}

/// 16 whole numbers, two in a word.
pub(super) type Pairs = [i32; PAIRS];

/// Rounds 16 numbers to whole ones. Also returns what these are multiplied by.
#[inline(always)]
pub(super) fn pairs<S: Simd>(x: f32x16<S>) -> (Pairs, f32) {
    let most = x.abs().reduce_max();
    let whole: i32x16<S> = (x * per_unit(most, MAX_INT16) + WHOLE).bitcast();
    let (first, second) = whole.split();
    let mut pairs = [0; PAIRS];
    (first & 0xffff | second << 16).store_slice(&mut pairs);
    (pairs, most / MAX_INT16)
}

/// Rounds the numbers of `x`, times `scales`, to whole ones plus [`WHOLE`] in place. Returns what
/// the whole ones are multiplied by. Sums of their products with a column of tiles fit in 32 bits.
#[inline(always)]
pub(super) fn round<S: Simd>(simd: S, x: &mut [f32], scales: &[f32]) -> f32 {
    let tiles = x.len() / TILE_SIZE;
    let limit = MAX_INT16.min((i32::MAX as f32 / (MAX_INT8 * tiles.max(1) as f32)).floor() - 1.0);
    let mut most = f32x16::splat(simd, 0.0);
    for (x, scales) in x.chunks_exact_mut(TILE_SIZE).zip(scales.chunks_exact(TILE_SIZE)) {
        let scaled = f32x16::from_slice(simd, x) * f32x16::from_slice(simd, scales);
        most = most.max(scaled.abs());
        scaled.store_slice(x);
    }
    let most = most.reduce_max();
    let per_unit = per_unit(most, limit);
    for x in x.chunks_exact_mut(TILE_SIZE) {
        (f32x16::from_slice(simd, x) * per_unit + WHOLE).store_slice(x);
    }
    most / limit
}

/// What numbers up to `most` are multiplied by to be at most `limit`: 0 where that is not finite.
#[inline(always)]
pub(super) fn per_unit(most: f32, limit: f32) -> f32 {
    if most > MIN_GREATEST { limit / most } else { 0.0 }
}

/// The sum over lanes of each of 16 vectors.
#[inline(always)]
pub(super) fn transpose_sum<S: Simd>(simd: S, sums: &[i32x16<S>; TILE_SIZE]) -> f32x16<S> {
    let mut v = [f32x16::splat(simd, 0.0); TILE_SIZE];
    for k in 0..TILE_SIZE {
        v[k] = f32x16::float_from(sums[k]);
    }
    // Each round adds neighbours and halves the number of vectors; unzipping keeps their order.
    for half in [8, 4, 2, 1] {
        for k in 0..half {
            let (a, b) = (v[2 * k], v[2 * k + 1]);
            v[k] = simd.unzip_low_f32x16(a, b) + simd.unzip_high_f32x16(a, b);
        }
    }
    v[0]
}

#[cfg(test)]
mod tests {
    use super::{TILE_SIZE, Tile, pairs, round, transpose_sum};
    use crate::Isa;
    use fearless_simd::{Level, SimdBase, SimdCvtFloat, dispatch, f32x16, i32x16};

    fn number(row: usize, column: usize) -> f32 {
        ((37 * column + 11 * row) % 41) as f32 / 20.0 - 1.0
    }

    fn packed(level: Level, at: impl Fn(usize, usize) -> f32) -> [Tile; 2] {
        dispatch!(level, simd => Tile::pack(simd, |c| {
            let column: [f32; TILE_SIZE] = std::array::from_fn(|r| at(r, c));
            f32x16::from_slice(simd, &column)
        }))
    }

    #[test]
    fn both_products_are_those_of_the_numbers_up_to_their_rounding() {
        let level = Isa::detect().level();
        let [tile, remainder] = packed(level, number);
        let x: [f32; TILE_SIZE] = std::array::from_fn(|k| (k as f32 * 0.7).sin());
        dispatch!(level, simd => {
            let vector = f32x16::from_slice(simd, &x);
            let (whole, unit) = pairs(vector);
            let product: f32x16<_> = f32x16::float_from(tile.product(simd, &whole));
            let rest: f32x16<_> = f32x16::float_from(remainder.product(simd, &whole));
            let precise = product + rest * (1.0 / Tile::REMAINDER_UNIT);
            let mut rounded = x;
            let unit_transposed = round(simd, &mut rounded, &[1.0; TILE_SIZE]);
            let mut sums = [i32x16::splat(simd, 0); TILE_SIZE];
            tile.add_transposed(simd, &rounded, &mut sums);
            let transposed = transpose_sum(simd, &sums);
            for k in 0..TILE_SIZE {
                let row: f32 = (0..TILE_SIZE).map(|c| number(k, c) * x[c]).sum();
                let column: f32 = (0..TILE_SIZE).map(|r| number(r, k) * x[r]).sum();
                // 16 roundings of at most half a unit of 1/127, times numbers of at most 1.
                let most = 16.0 * 0.5 / Tile::UNIT;
                assert!((product[k] * unit / Tile::UNIT - row).abs() < most);
                assert!((precise[k] * unit / Tile::UNIT - row).abs() < most / 100.0);
                assert!((transposed[k] * unit_transposed / Tile::UNIT - column).abs() < most);
            }
        });
    }

    /// Sums in 32 bits bear tall columns of the greatest numbers, and tiny vectors are 0.
    #[test]
    fn tall_columns_do_not_overflow_and_tiny_vectors_vanish() {
        let ones = packed(Isa::Portable.level(), |_, _| 1.0)[0];
        let sum = |isa: Isa, number: f32, tiles: usize| {
            dispatch!(isa.level(), simd => {
                let mut x = vec![number; TILE_SIZE * tiles];
                let unit = round(simd, &mut x, &vec![1.0; TILE_SIZE * tiles]);
                let mut sums = [i32x16::splat(simd, 0); TILE_SIZE];
                for x in x.chunks_exact(TILE_SIZE) {
                    ones.add_transposed(simd, x, &mut sums);
                }
                transpose_sum(simd, &sums)[0] * unit / Tile::UNIT
            })
        };
        for isa in Isa::ALL {
            for tiles in [1, 516, 517, 3000] {
                let expected = (TILE_SIZE * tiles) as f32;
                assert!((sum(isa, 1.0, tiles) / expected - 1.0).abs() < 1e-3, "{}, {tiles} tiles", isa.name());
            }
            assert_eq!(sum(isa, 1e-36, 2), 0.0, "{}", isa.name());
        }
    }
}
