//! The bodies of an island, as contact between them sees them.

use crate::Body;
use crate::state::BodyState;
use glam::Vec3A;

/// The bodies of an island by their number in it.
pub(crate) trait Members {
    /// Number of bodies.
    fn count(&self) -> usize;

    /// A body's index in the model.
    fn index(&self, member: usize) -> usize;

    /// A body.
    fn body(&self, member: usize) -> &Body;

    /// A body's state.
    fn state(&self, member: usize) -> &BodyState;

    /// A body's state, to be changed.
    fn state_mut(&mut self, member: usize) -> &mut BodyState;

    /// Position of a vertex in the frame of its body (m).
    #[inline(always)]
    fn x(&self, member: usize, vertex: u32) -> Vec3A {
        self.body(member).place(&self.state(member).x, vertex)
    }
}
