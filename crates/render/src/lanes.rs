//! Vectors in registers: eight at once, by axis.

use fearless_simd::{Simd, SimdBase, SimdCombine, f32x4, f32x8};

/// Numbers of a register.
pub(crate) const LANES: usize = 8;

/// Eight vectors, by axis.
pub(crate) type Vec8<S> = [f32x8<S>; 3];

#[inline(always)]
pub(crate) fn splat<S: Simd>(simd: S, value: f32) -> f32x8<S> {
    f32x8::splat(simd, value)
}

/// Eight vectors by axis. Their fourth numbers are dropped. They are moved in registers: a register
/// that is loaded from what smaller ones have just stored would wait.
#[inline(always)]
pub(crate) fn gathered<S: Simd>(simd: S, from: [&[f32; 4]; LANES]) -> Vec8<S> {
    let [x, y, z] = transposed(simd, [from[0], from[1], from[2], from[3]]);
    let [a, b, c] = transposed(simd, [from[4], from[5], from[6], from[7]]);
    [x.combine(a), y.combine(b), z.combine(c)]
}

#[inline(always)]
fn transposed<S: Simd>(simd: S, from: [&[f32; 4]; 4]) -> [f32x4<S>; 3] {
    let a = f32x4::from_slice(simd, from[0]);
    let b = f32x4::from_slice(simd, from[1]);
    let c = f32x4::from_slice(simd, from[2]);
    let d = f32x4::from_slice(simd, from[3]);
    let (first, second) = (a.zip_low(c), b.zip_low(d));
    let (third, fourth) = (a.zip_high(c), b.zip_high(d));
    [first.zip_low(second), first.zip_high(second), third.zip_low(fourth)]
}

#[inline(always)]
pub(crate) fn minus<S: Simd>(a: Vec8<S>, b: Vec8<S>) -> Vec8<S> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(crate) fn dot<S: Simd>(a: Vec8<S>, b: Vec8<S>) -> f32x8<S> {
    (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2]
}

/// The cross product. Exchanging the arguments changes its sign and no other bit, so that an edge
/// is the same for both of its triangles.
#[inline(always)]
pub(crate) fn cross<S: Simd>(a: Vec8<S>, b: Vec8<S>) -> Vec8<S> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
