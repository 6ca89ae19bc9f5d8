//! What touches tissue from outside: convex parts of tools.

mod collider;
mod force;
mod hull;
mod shape;
mod shape_surface;

pub use collider::Collider;
pub use force::{Event, ToolForce, Wrench};
pub use hull::Hull;
pub use shape::{Nearest, Shape};
