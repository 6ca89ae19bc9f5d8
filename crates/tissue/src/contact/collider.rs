//! A rigid convex part of a tool that tissue cannot enter.

use super::Shape;

/// A rigid convex part of a tool.
#[derive(Clone, Debug, PartialEq)]
pub struct Collider {
    /// Name, for messages.
    pub name: String,
    /// The tool that carries it: its place among the motions of a step. A collider whose tool has no motion is not there.
    pub tool: usize,
    /// In the tool's frame.
    pub shape: Shape,
    /// Distance from the shape at which tissue comes to rest [m] (SPEC C1: 1.5 mm for instrument tips).
    pub rest_offset: f64,
    /// Coulomb friction coefficient against tissue.
    pub friction: f64,
}

impl Collider {
    /// Says what is wrong, if anything.
    pub(crate) fn check(&self) -> Result<(), String> {
        self.shape.check()?;
        if !(self.friction >= 0.0 && self.friction.is_finite()) {
            return Err(format!("a friction coefficient of {}; 0 or more makes sense", self.friction));
        }
        if !(0.0..=0.01).contains(&self.rest_offset) {
            return Err(format!("a rest offset of {} m; 0 to 0.01 m make sense", self.rest_offset));
        }
        Ok(())
    }
}
