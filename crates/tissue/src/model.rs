//! What never changes while stepping.

use crate::{Body, BodyContact, Collider};
use glam::DVec3;

/// Everything that is constant over a simulation. Made by [`crate::ModelBuilder`], and out of another model by [`crate::sever`], alone, so that what was checked stays true. A clone shares
/// the bodies.
#[derive(Clone, Debug)]
pub struct Model {
    pub(crate) bodies: Vec<Body>,
    pub(crate) gravity: DVec3,
    /// Pairs that do not collide, the smaller index first, sorted.
    pub(crate) filtered: Vec<[usize; 2]>,
    pub(crate) colliders: Vec<Collider>,
    pub(crate) body_contact: Option<BodyContact>,
}

impl Model {
    /// The bodies, in the order they were added.
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// Gravitational acceleration [m/s2].
    pub fn gravity(&self) -> DVec3 {
        self.gravity
    }

    /// What touches the bodies, in the order they were added.
    pub fn colliders(&self) -> &[Collider] {
        &self.colliders
    }

    /// How bodies touch each other; None if they pass through each other.
    pub fn body_contact(&self) -> Option<BodyContact> {
        self.body_contact
    }

    /// Whether bodies `a` and `b` are to collide: they exist, and their pair was not filtered ([`crate::ModelBuilder::filter_pair`]).
    pub fn collides(&self, a: usize, b: usize) -> bool {
        a.max(b) < self.bodies.len() && self.filtered.binary_search(&[a.min(b), a.max(b)]).is_err()
    }
}
