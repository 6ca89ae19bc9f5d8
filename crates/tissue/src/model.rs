//! What never changes while stepping.

use crate::Body;
use glam::DVec3;

/// Everything that is constant over a simulation.
#[derive(Clone, Debug)]
pub struct Model {
    /// The bodies, in the order they were added.
    pub bodies: Vec<Body>,
    /// Gravitational acceleration [m/s2].
    pub gravity: DVec3,
}

/// A one-sided plane that a body rests on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SupportPlane {
    /// A point of the plane [m].
    pub point: DVec3,
    /// Unit normal, into the free side.
    pub normal: DVec3,
    /// Coulomb friction coefficient.
    pub friction: f64,
}
