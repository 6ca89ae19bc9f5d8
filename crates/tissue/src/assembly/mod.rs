//! Assembly of a body's stiffness matrix from its elements, in double precision.
//!
//! Solvers that factorise the stiffness use it: the quasi-Newton method here, Newton's method of
//! the reference crate.

mod element;
mod stiffness;

pub(crate) use element::SEEN_FROM;
pub use element::{Tangent, blocks, shape_gradients, tangent};
pub use stiffness::Stiffness;
