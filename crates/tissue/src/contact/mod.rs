//! What touches tissue: convex parts of tools, supports, the jaws that hold it, and other tissue.

pub(crate) mod broad_phase;
mod collider;
mod contacts;
mod force;
mod hull;
#[allow(dead_code, reason = "the solvers do not couple bodies yet")]
pub(crate) mod proximity;
#[cfg(test)]
mod proximity_tests;
mod reaction;
mod shape;
mod shape_surface;
#[allow(dead_code, reason = "the solvers do not couple bodies yet")]
pub(crate) mod surface;
mod touch;

pub use collider::Collider;
pub(crate) use contacts::{Anchor, Contacts, Hanging};
pub use force::{Event, ToolForce, Wrench};
pub use hull::Hull;
pub(crate) use reaction::Reaction;
pub use shape::{Nearest, Shape};
pub(crate) use touch::Source;
