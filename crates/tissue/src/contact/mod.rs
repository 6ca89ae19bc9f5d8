//! What touches tissue: convex parts of tools, supports, the jaws that hold it, and other tissue.

mod body_contact;
pub(crate) mod broad_phase;
mod collider;
mod contacts;
mod coupling;
mod force;
mod hanging;
mod hull;
mod pairs;
mod placed;
pub(crate) mod proximity;
#[cfg(test)]
mod proximity_tests;
mod reaction;
mod shape;
mod shape_surface;
pub(crate) mod surface;
mod touch;

pub use body_contact::BodyContact;
pub use collider::Collider;
pub(crate) use contacts::{Anchor, Contacts};
pub(crate) use coupling::Coupling;
pub use force::{Event, ToolForce};
pub(crate) use hanging::Hanging;
pub use hull::Hull;
pub(crate) use pairs::{Pairs, Stretch};
pub(crate) use reaction::Reaction;
pub use shape::{Nearest, Shape};
pub(crate) use touch::{Push, Source};
