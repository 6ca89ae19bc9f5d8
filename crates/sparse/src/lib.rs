//! Sparse Cholesky factors of symmetric positive definite matrices of 3x3 blocks, as the stiffness
//! of a mesh of tetrahedra is.
//!
//! [`BlockMatrix`] is the matrix, [`Cholesky`] its factor. An elimination order is found by nested
//! dissection once for a pattern, and numbers follow as often as needed. Independent subtrees and
//! large fronts share the threads of the rayon pool that calls. The bits of a factor depend neither
//! on the number of threads nor on the instruction set.

#![cfg_attr(not(test), warn(clippy::disallowed_methods, reason = "the same bits on every processor"))]

mod cholesky;
mod coarsening;
mod dense;
mod dissection;
mod graph;
mod matrix;
mod real;
mod separator;
mod solve;
mod supernodes;

pub use cholesky::{Cholesky, Panel};
pub use fearless_simd::Level;
pub use matrix::BlockMatrix;
pub use real::Real;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
