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
//! pixel's triangles are tested in the same order in any band.

mod band;
mod clusters;
mod projection;
mod triangle;
mod visibility;

pub(crate) use clusters::Clusters;
pub(crate) use projection::Projection;
pub(crate) use triangle::{cross, dot, minus};
pub(crate) use visibility::{BAND, NOTHING, View, Visibility};

/// Numbers of a register.
pub(crate) const LANES: usize = 8;

/// Eight vectors, by axis.
pub(crate) type Vec8<S> = [fearless_simd::f32x8<S>; 3];

#[inline(always)]
pub(crate) fn splat<S: fearless_simd::Simd>(simd: S, value: f32) -> fearless_simd::f32x8<S> {
    fearless_simd::SimdBase::splat(simd, value)
}
