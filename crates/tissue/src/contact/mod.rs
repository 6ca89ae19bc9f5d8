//! What tissue touches: convex parts of tools, supports, the jaws that hold it, and other tissue.

mod body_contact;
mod collider;
mod compliant_grasp;
#[expect(clippy::module_inception, reason = "a contact is the idea of the file")]
mod contact;
mod contact_set;
mod coupling;
mod feature_contacts;
mod force;
mod hole_vertices;
mod hull;
mod members;
mod memory;
mod nearest;
mod pairs;
pub(crate) mod proximity;
#[cfg(test)]
mod proximity_tests;
mod reaction;
mod shape;
mod shape_surface;
mod site;
mod tool_contact;
mod tool_features;
#[cfg(test)]
mod tool_features_tests;
mod tool_group;
mod tool_placement;

pub use body_contact::BodyContact;
pub use collider::Collider;
pub(crate) use compliant_grasp::CompliantNode;
pub(crate) use contact::{Contact, Friction, Push};
pub(crate) use contact_set::ContactSet;
pub(crate) use coupling::Coupling;
pub use force::{Event, ToolForce};
pub use hull::Hull;
pub(crate) use members::Members;
pub(crate) use memory::{Anchor, FeatureAnchor, Source, Stretch};
pub use nearest::Nearest;
pub(crate) use pairs::Pairs;
pub(crate) use reaction::Reaction;
pub use shape::Shape;
pub use tool_contact::ToolContact;
pub(crate) use tool_group::ToolGroup;
