//! Rasterisation: which triangle each pixel shows, without a ray per pixel.
//!
//! A shape is divided into clusters of neighbouring triangles. The picture is divided into bands of
//! rows. A band takes the clusters that it may show, moves their corners into the camera frame and
//! projects them, eight at a time, and keeps the triangles whose image covers the centre of a
//! pixel. A pixel is tested with its own ray (Olano and Greer 1997, "Triangle Scan Conversion using
//! 2D Homogeneous Coordinates"): the planes through the eye and the edges of the triangle give
//! coverage, the plane of the triangle gives depth. So distorted lenses and fisheyes are exact, and
//! nothing is clipped.
//!
//! No operation is fused and lanes never interact, so every instruction set gives the same bits. A
//! pixel shows the nearest triangle in whatever order triangles are drawn.

mod clusters;
mod projection;
mod triangle;
mod view;

pub(crate) use clusters::{Cluster, Clusters};
pub(crate) use projection::Projection;
pub(crate) use triangle::{Eight, One, cross, dot, minus};
pub(crate) use view::{NOTHING, Seen, View, Visibility};

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
