//! The constant part of a simulation.

use crate::{Backend, Body, BodyContact, Collider, ToolContact};
use glam::DVec3;

/// Everything that is constant over a simulation. Only [`crate::ModelBuilder`] and [`crate::sever`]
/// make models: a model is always valid. A clone shares the bodies.
#[derive(Clone, Debug)]
pub struct Model {
    pub(crate) bodies: Vec<Body>,
    pub(crate) gravity: DVec3,
    /// Pairs that do not touch, the smaller index first, sorted.
    pub(crate) filtered: Vec<[usize; 2]>,
    pub(crate) colliders: Vec<Collider>,
    pub(crate) body_contact: Option<BodyContact>,
    pub(crate) tool_contact: ToolContact,
    pub(crate) backend: Backend,
}

impl Model {
    /// The bodies, in the order they were added.
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// Gravitational acceleration (m/s2).
    pub fn gravity(&self) -> DVec3 {
        self.gravity
    }

    /// Parts of tools that touch the bodies, in the order they were added.
    pub fn colliders(&self) -> &[Collider] {
        &self.colliders
    }

    /// Contact between bodies; None if they pass through each other.
    pub fn body_contact(&self) -> Option<BodyContact> {
        self.body_contact
    }

    /// What of the bodies' surfaces touches tools.
    pub fn tool_contact(&self) -> ToolContact {
        self.tool_contact
    }

    /// The solver backend of the tissue.
    pub fn backend(&self) -> Backend {
        self.backend
    }

    /// Whether bodies `a` and `b` touch each other: both exist, and the pair was not filtered
    /// ([`crate::ModelBuilder::filter_pair`]).
    pub fn collides(&self, a: usize, b: usize) -> bool {
        a.max(b) < self.bodies.len() && self.filtered.binary_search(&[a.min(b), a.max(b)]).is_err()
    }
}
