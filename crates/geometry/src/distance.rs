//! Signed distance to a surface: inside is negative.

use crate::{Result, TriMesh};
use glam::DVec3;

/// A shape known by its signed distance.
pub trait SignedDistance: Sync {
    /// Signed distance from `p` to the surface [m], negative inside. Exact or a good estimate near the surface.
    fn distance(&self, p: DVec3) -> f64;
}

/// Signed distance to a triangle soup: exact unsigned distance, sign from the generalized winding number, so that holes,
/// cracks and stray triangles do not turn the inside out.
pub struct MeshDistance {}

impl MeshDistance {
    /// Prepares the search trees. Refuses meshes without triangles, with NaN, or with indices out of range.
    pub fn new(mesh: &TriMesh) -> Result<Self> {
        let _ = mesh;
        todo!()
    }

    /// Generalized winding number at `p`: 1 inside, 0 outside of a closed outward surface.
    pub fn winding(&self, p: DVec3) -> f64 {
        let _ = p;
        todo!()
    }
}

impl SignedDistance for MeshDistance {
    fn distance(&self, p: DVec3) -> f64 {
        let _ = p;
        todo!()
    }
}
