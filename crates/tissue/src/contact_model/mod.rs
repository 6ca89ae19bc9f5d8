//! What a model says of contact: the convex parts of tools, what of a body touches them, and how
//! bodies touch each other.

mod body_contact;
mod collider;
mod hull;
mod nearest;
mod shape;
mod shape_surface;
mod tool_contact;

pub use body_contact::BodyContact;
pub use collider::Collider;
pub use hull::Hull;
pub use nearest::Nearest;
pub use shape::Shape;
pub use tool_contact::ToolContact;
