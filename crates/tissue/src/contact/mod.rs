//! Contacts of tissue in a frame: with convex parts of tools, supports, the jaws that hold it, and
//! other tissue.

mod compliant_grasp;
#[expect(clippy::module_inception, reason = "a contact is the idea of the file")]
mod contact;
mod contact_set;
mod coupling;
mod feature_contacts;
mod force;
mod grasp_update;
mod hole_vertices;
mod local_support;
mod members;
mod pairs;
pub(crate) mod proximity;
#[cfg(test)]
mod proximity_tests;
mod reaction;
mod site;
mod taut;
mod tool_features;
#[cfg(test)]
mod tool_features_tests;
mod tool_group;
mod tool_placement;

pub(crate) use compliant_grasp::CompliantNode;
pub(crate) use contact::{Contact, Friction, Push};
pub(crate) use contact_set::ContactSet;
pub(crate) use coupling::Coupling;
pub use force::{Event, ToolForce};
pub(crate) use members::Members;
pub(crate) use pairs::Pairs;
pub(crate) use reaction::Reaction;
pub(crate) use tool_group::ToolGroup;
