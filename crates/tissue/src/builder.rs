//! Builds models; everything that can be wrong is found here.

use crate::{Material, Model, Result};
use glam::DVec3;
use trocar_geometry::TetMesh;

/// One body to add.
#[derive(Clone, Debug)]
pub struct BodyDescription<'a> {
    /// Name, for messages.
    pub name: String,
    /// Rest shape [m].
    pub mesh: &'a TetMesh,
    /// Material.
    pub material: Material,
    /// Nodes that never move.
    pub pinned: Vec<u32>,
}

/// A one-sided plane that bodies rest on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SupportPlane {
    /// A point of the plane [m].
    pub point: DVec3,
    /// Unit normal, into the free side.
    pub normal: DVec3,
    /// Coulomb friction coefficient.
    pub friction: f64,
}

/// Collects bodies and boundary conditions.
#[derive(Clone, Debug, Default)]
pub struct ModelBuilder {}

impl ModelBuilder {
    /// No bodies, no gravity, no support.
    pub fn new() -> Self {
        Self::default()
    }
    /// Sets the gravitational acceleration [m/s2].
    pub fn gravity(mut self, gravity: DVec3) -> Self {
        let _ = (&mut self, gravity);
        todo!()
    }
    /// Adds a support plane.
    pub fn support(mut self, plane: SupportPlane) -> Self {
        let _ = (&mut self, plane);
        todo!()
    }
    /// Adds a body; returns its index. Refuses zero or negative volumes, isolated nodes, NaN, moduli outside 10 Pa..1 GPa,
    /// Poisson ratios outside 0..0.4999, densities outside 1..30,000 kg/m3, pins out of range.
    pub fn body(&mut self, body: BodyDescription<'_>) -> Result<usize> {
        let _ = body;
        todo!()
    }
    /// Finishes the model.
    pub fn build(self) -> Result<Model> {
        todo!()
    }
}
