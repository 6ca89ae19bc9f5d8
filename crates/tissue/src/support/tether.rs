//! Threads from nodes to fixed points: adhesions and sheets that hold an organ.

use glam::DVec3;

/// Stiffest thread (N/m).
const MAX_STIFFNESS: f64 = 1e6;

/// Longest way from a node to what holds it (m).
const MAX_LENGTH: f64 = 1.0;

/// A thread from a node of a body's surface to a fixed point. It is slack up to its length and
/// elastic beyond it: its energy is k/2 max(0, |x - anchor| - length)^2. It only pulls.
///
/// In a substep, the sphere within which it is slack is the plane that touches it where the node
/// is. So it does not turn within a substep, and at rest it is exact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tether {
    /// The node.
    pub node: u32,
    /// The fixed point, in the world (m).
    pub anchor: DVec3,
    /// Length up to which it is slack (m).
    pub length: f64,
    /// Stiffness k beyond that length (N/m).
    pub stiffness: f64,
}

impl Tether {
    /// Checks the numbers of the thread.
    pub(crate) fn check(&self) -> Result<(), String> {
        let Self { node, anchor, length, stiffness } = self;
        if !anchor.is_finite() {
            return Err(format!("the thread of node {node} leads to {anchor}; coordinates are finite numbers"));
        }
        if !(0.0..=MAX_LENGTH).contains(length) {
            return Err(format!("the thread of node {node} is {length} m long; must be in [0, {MAX_LENGTH}] m"));
        }
        if !(0.0..=MAX_STIFFNESS).contains(stiffness) {
            return Err(format!(
                "the thread of node {node} has a stiffness of {stiffness} N/m; must be in [0, {MAX_STIFFNESS}] N/m"
            ));
        }
        Ok(())
    }
}
