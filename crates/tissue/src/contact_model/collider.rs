//! A rigid convex part of a tool that tissue cannot enter.

use super::shape::Shape;

/// A rigid convex part of a tool.
#[derive(Clone, Debug, PartialEq)]
pub struct Collider {
    /// Name, for messages.
    pub name: String,
    /// The tool that carries it: its index in the motions of a step. A collider whose tool has no
    /// motion is absent.
    pub tool: usize,
    /// In the tool's frame.
    pub shape: Shape,
    /// Distance from the shape at which tissue comes to rest (m); 1.5 mm for instrument tips in the
    /// paper.
    pub rest_offset: f64,
    /// Coulomb friction coefficient against tissue.
    pub friction: f64,
}

impl Collider {
    /// Depth from which its contacts are harder (m): half of that at which tissue would reach the
    /// axis of a round shape, so that nothing passes it.
    pub(crate) fn hard_from(&self) -> f32 {
        match &self.shape {
            Shape::Sphere { radius, .. } | Shape::Capsule { radius, .. } => (0.5 * (radius + self.rest_offset)) as f32,
            Shape::HalfSpace { .. } | Shape::Box { .. } | Shape::Hull(_) => f32::INFINITY,
        }
    }

    /// Checks the collider.
    pub(crate) fn check(&self) -> Result<(), String> {
        self.shape.check()?;
        if !(self.friction >= 0.0 && self.friction.is_finite()) {
            return Err(format!("a friction coefficient of {}; must be finite and at least 0", self.friction));
        }
        if !(0.0..=0.01).contains(&self.rest_offset) {
            return Err(format!("a rest offset of {} m; must be in [0, 0.01]", self.rest_offset));
        }
        Ok(())
    }
}
