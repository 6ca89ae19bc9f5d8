//! What touches tissue from outside: convex parts of tools, supports, and the jaws that hold it.

mod collider;
mod contacts;
mod force;
mod hull;
mod shape;
mod shape_surface;
mod touch;

pub use collider::Collider;
pub(crate) use contacts::{Anchor, Contacts, Hanging};
pub use force::{Event, ToolForce, Wrench};
pub use hull::Hull;
pub use shape::{Nearest, Shape};
pub(crate) use touch::Source;
