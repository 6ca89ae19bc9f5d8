//! What touches tissue from outside: convex parts of tools, supports, and the jaws that hold it.

mod collider;
mod contacts;
mod force;
mod reach;
mod shape;
mod touch;

pub use collider::Collider;
pub use force::{Event, ToolForce, Wrench};
pub(crate) use contacts::{Anchor, Contacts, Hanging};
pub use shape::{Nearest, Shape};
pub(crate) use touch::Source;
