//! Sixteen of something at once: vectors and matrices whose entries are SIMD lanes, and rows of
//! four floats gathered into them.
//!
//! Every operation is one IEEE operation a lane, none is fused, and sums have a fixed order: all
//! instruction sets give the same bits.

use fearless_simd::{Level, Simd, SimdBase, SimdCombine, dispatch, f32x4, f32x16};
use std::ops::{Add, Mul, Sub};

/// Lanes of a vector.
pub(crate) const LANES: usize = 16;

/// Position, velocity or force: three coordinates and a zero.
pub(crate) type Row = [f32; 4];

/// Three coordinates in lanes.
pub(crate) type Vec3L<S> = [f32x16<S>; 3];

/// A matrix in lanes, by columns.
pub(crate) type Mat3L<S> = [Vec3L<S>; 3];

#[inline(always)]
pub(crate) fn splat<S: Simd>(simd: S, x: f32) -> f32x16<S> {
    f32x16::splat(simd, x)
}

#[inline(always)]
pub(crate) fn load<S: Simd>(simd: S, from: &[f32; LANES]) -> f32x16<S> {
    f32x16::from_slice(simd, from)
}

/// The rows of `x` at 16 places, as coordinates.
#[inline(always)]
pub(crate) fn gather<S: Simd>(simd: S, x: &[Row], at: &[u32; LANES]) -> Vec3L<S> {
    let a = four(simd, x, [at[0], at[1], at[2], at[3]]);
    let b = four(simd, x, [at[4], at[5], at[6], at[7]]);
    let c = four(simd, x, [at[8], at[9], at[10], at[11]]);
    let d = four(simd, x, [at[12], at[13], at[14], at[15]]);
    transpose(simd, [a, b, c, d])
}

/// Sixteen consecutive rows, as coordinates.
#[inline(always)]
pub(crate) fn load_rows<S: Simd>(simd: S, rows: &[Row]) -> Vec3L<S> {
    let flat = rows.as_flattened();
    let a = f32x16::from_slice(simd, &flat[0..16]);
    let b = f32x16::from_slice(simd, &flat[16..32]);
    let c = f32x16::from_slice(simd, &flat[32..48]);
    let d = f32x16::from_slice(simd, &flat[48..64]);
    transpose(simd, [a, b, c, d])
}

#[inline(always)]
fn four<S: Simd>(simd: S, x: &[Row], at: [u32; 4]) -> f32x16<S> {
    let a = f32x4::from_slice(simd, &x[at[0] as usize]);
    let b = f32x4::from_slice(simd, &x[at[1] as usize]);
    let c = f32x4::from_slice(simd, &x[at[2] as usize]);
    let d = f32x4::from_slice(simd, &x[at[3] as usize]);
    a.combine(b).combine(c.combine(d))
}

#[inline(always)]
fn transpose<S: Simd>(simd: S, [a, b, c, d]: [f32x16<S>; 4]) -> Vec3L<S> {
    let (xz0, xz1) = (simd.unzip_low_f32x16(a, b), simd.unzip_low_f32x16(c, d));
    let (yw0, yw1) = (simd.unzip_high_f32x16(a, b), simd.unzip_high_f32x16(c, d));
    [simd.unzip_low_f32x16(xz0, xz1), simd.unzip_low_f32x16(yw0, yw1), simd.unzip_high_f32x16(xz0, xz1)]
}

/// Writes coordinates as 16 consecutive rows.
#[inline(always)]
pub(crate) fn store_rows<S: Simd>(simd: S, v: Vec3L<S>, rows: &mut [Row]) {
    let zero = splat(simd, 0.0);
    let (xz0, xz1) = (simd.zip_low_f32x16(v[0], v[2]), simd.zip_high_f32x16(v[0], v[2]));
    let (yw0, yw1) = (simd.zip_low_f32x16(v[1], zero), simd.zip_high_f32x16(v[1], zero));
    let flat = rows.as_flattened_mut();
    simd.zip_low_f32x16(xz0, yw0).store_slice(&mut flat[0..16]);
    simd.zip_high_f32x16(xz0, yw0).store_slice(&mut flat[16..32]);
    simd.zip_low_f32x16(xz1, yw1).store_slice(&mut flat[32..48]);
    simd.zip_high_f32x16(xz1, yw1).store_slice(&mut flat[48..64]);
}

#[inline(always)]
pub(crate) fn sub<F: Copy + Sub<Output = F>>(a: [F; 3], b: [F; 3]) -> [F; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(crate) fn add<F: Copy + Add<Output = F>>(a: [F; 3], b: [F; 3]) -> [F; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub(crate) fn scale<F: Copy + Mul<Output = F>>(a: [F; 3], by: F) -> [F; 3] {
    [a[0] * by, a[1] * by, a[2] * by]
}

#[inline(always)]
pub(crate) fn dot<F: Copy + Add<Output = F> + Mul<Output = F>>(a: [F; 3], b: [F; 3]) -> F {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(crate) fn cross<F: Copy + Sub<Output = F> + Mul<Output = F>>(a: [F; 3], b: [F; 3]) -> [F; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Matrix times vector.
#[inline(always)]
pub(crate) fn apply<S: Simd>(m: &Mat3L<S>, v: Vec3L<S>) -> Vec3L<S> {
    add(add(scale(m[0], v[0]), scale(m[1], v[1])), scale(m[2], v[2]))
}

/// Transposed matrix times vector.
#[inline(always)]
pub(crate) fn apply_transposed<S: Simd>(m: &Mat3L<S>, v: Vec3L<S>) -> Vec3L<S> {
    [dot(m[0], v), dot(m[1], v), dot(m[2], v)]
}

/// Cofactor matrix: by columns the cross products of the others.
#[inline(always)]
pub(crate) fn cofactor<S: Simd>(f: &Mat3L<S>) -> Mat3L<S> {
    [cross(f[1], f[2]), cross(f[2], f[0]), cross(f[0], f[1])]
}

/// The rotations in F = R S by Newton's iteration with scaling (Higham, "Computing the polar
/// decomposition", 1986); the identity where det F is below `least`.
#[inline(always)]
pub(crate) fn rotation<S: Simd>(simd: S, f: &Mat3L<S>, least: f32) -> Mat3L<S> {
    let (zero, one, half) = (splat(simd, 0.0), splat(simd, 1.0), splat(simd, 0.5));
    let flat = simd.simd_lt_f32x16(dot(f[0], cross(f[1], f[2])), splat(simd, least));
    let mut x = *f;
    for c in 0..3 {
        for r in 0..3 {
            x[c][r] = simd.select_f32x16(flat, if c == r { one } else { zero }, x[c][r]);
        }
    }
    for round in 0..POLAR_ROUNDS {
        let before = x;
        let cofactor = cofactor(&x);
        let inverse = one / dot(x[0], cofactor[0]);
        let (mut near, mut far) = (half, half * inverse);
        if round < SCALED_POLAR_ROUNDS {
            let size = dot(x[0], x[0]) + dot(x[1], x[1]) + dot(x[2], x[2]);
            let other = dot(cofactor[0], cofactor[0]) + dot(cofactor[1], cofactor[1]) + dot(cofactor[2], cofactor[2]);
            let ratio = simd.sqrt_f32x16(simd.sqrt_f32x16(other * inverse * inverse / size));
            near *= ratio;
            far /= ratio;
        }
        for c in 0..3 {
            x[c] = add(scale(x[c], near), scale(cofactor[c], far));
        }
        // The next round would square what is left.
        let mut change = zero;
        for c in 0..3 {
            let by = sub(x[c], before[c]);
            change = simd.max_f32x16(change, dot(by, by));
        }
        if !simd.any_true_mask32x16(simd.simd_ge_f32x16(change, splat(simd, POLAR_TOLERANCE))) {
            break;
        }
    }
    x
}

/// Squared change of a column by the last round of the polar decomposition: what is left is
/// rounding.
const POLAR_TOLERANCE: f32 = 1e-7;

/// Most rounds of the polar decomposition, and how many of them are scaled: enough for condition
/// numbers up to a thousand.
const POLAR_ROUNDS: usize = 8;
const SCALED_POLAR_ROUNDS: usize = 3;

/// Sum of the products of two vectors of rows; as many rows as a multiple of 4.
#[inline(always)]
pub(crate) fn dot_rows<S: Simd>(simd: S, a: &[Row], b: &[Row]) -> f32 {
    let mut sum = splat(simd, 0.0);
    let (a, b) = (a.as_flattened(), b.as_flattened());
    for (a, b) in a.chunks_exact(LANES).zip(b.chunks_exact(LANES)) {
        sum += f32x16::from_slice(simd, a) * f32x16::from_slice(simd, b);
    }
    add_up(sum)
}

/// Sums of the products of four vectors of rows with one.
#[inline(always)]
pub(crate) fn dot_rows_abreast<S: Simd>(simd: S, a: &[&[Row]; 4], b: &[Row]) -> [f32; 4] {
    let mut sums = [splat(simd, 0.0); 4];
    let a = a.map(|a| a.as_flattened().chunks_exact(LANES));
    let [first, second, third, fourth] = a;
    let rows = first.zip(second).zip(third.zip(fourth)).zip(b.as_flattened().chunks_exact(LANES));
    for (((first, second), (third, fourth)), b) in rows {
        let b = f32x16::from_slice(simd, b);
        for (sum, a) in sums.iter_mut().zip([first, second, third, fourth]) {
            *sum += f32x16::from_slice(simd, a) * b;
        }
    }
    sums.map(add_up)
}

/// a += k b over rows, for four k and b.
#[inline(always)]
pub(crate) fn add_rows_abreast<S: Simd>(simd: S, a: &mut [Row], k: [f32; 4], b: &[&[Row]; 4]) {
    let [first, second, third, fourth] = b.map(|b| b.as_flattened().chunks_exact(LANES));
    let rows = first.zip(second).zip(third.zip(fourth));
    for (a, ((first, second), (third, fourth))) in a.as_flattened_mut().chunks_exact_mut(LANES).zip(rows) {
        let mut sum = f32x16::from_slice(simd, a);
        for (k, b) in k.into_iter().zip([first, second, third, fourth]) {
            sum += f32x16::from_slice(simd, b) * k;
        }
        sum.store_slice(a);
    }
}

/// Whether two vectors of rows are the same, number by number.
pub(crate) fn same_rows(level: Level, a: &[Row], b: &[Row]) -> bool {
    // Chunks are compared whole, so that their numbers are compared at once.
    const CHUNK: usize = 16 * LANES;
    let differ = |a: &[f32], b: &[f32]| a.iter().zip(b).fold(false, |differ, (a, b)| differ | (a != b));
    let (a, b) = (a.as_flattened(), b.as_flattened());
    a.len() == b.len() && dispatch!(level, _simd => a.chunks(CHUNK).zip(b.chunks(CHUNK)).all(|(a, b)| !differ(a, b)))
}

/// Sum over the lanes, in a fixed order.
#[inline(always)]
pub(crate) fn add_up<S: Simd>(v: f32x16<S>) -> f32 {
    let mut parts = [0.0f32; LANES];
    v.store_slice(&mut parts);
    let mut sum = 0.0f64;
    for part in parts {
        sum += f64::from(part);
    }
    sum as f32
}
