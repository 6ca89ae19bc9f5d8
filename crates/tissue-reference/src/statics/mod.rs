//! Static equilibria of a body by elements of any kind: what the mesh of linear tetrahedra is
//! judged by.
//!
//! An energy is a sum over sample points: volume times the energy density of a deformation gradient
//! that is linear in some nodes' positions, F = sum x_i m_i'. A linear tetrahedron is one sample of
//! four nodes, a quadratic one is four samples of ten nodes, a patch of tetrahedra that share one
//! gradient is one sample of all their nodes. So one Newton's method serves them all.

mod elements;
mod newton;
mod patches;

pub use elements::{Elements, Place};
pub use newton::{Equilibrium, Load, Loading};
