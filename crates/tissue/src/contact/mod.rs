//! What touches tissue from outside: convex parts of tools.

mod collider;
mod force;
mod shape;

pub use collider::Collider;
pub use force::{Event, ToolForce, Wrench};
pub use shape::{Nearest, Shape};
