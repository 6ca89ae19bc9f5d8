//! What touches tissue: convex parts of tools, and other tissue.

pub(crate) mod broad_phase;
mod collider;
mod force;
mod hull;
#[allow(dead_code, reason = "the solvers do not ask for it yet")]
pub(crate) mod proximity;
#[cfg(test)]
mod proximity_tests;
mod shape;
mod shape_surface;
#[allow(dead_code, reason = "the solvers do not ask for areas yet")]
pub(crate) mod surface;

pub use collider::Collider;
pub use force::{Event, ToolForce, Wrench};
pub use hull::Hull;
pub use shape::{Nearest, Shape};
