//! The figures of the study.

use serde::Serialize;

/// A sphere pressed into the layer.
#[derive(Clone, Debug, Serialize)]
pub struct SphereRow {
    /// What touches: `vertices` or `surface`.
    pub tool_contact: String,
    /// Elements over the layer's thickness.
    pub cells: usize,
    /// Edge of the triangles (mm).
    pub edge_mm: f64,
    /// Nodes of the mesh.
    pub nodes: usize,
    /// Points of the surface that press.
    pub touching: usize,
    /// Force by the fast solver (N).
    pub fast_n: f64,
    /// Force by the oracle on the same mesh (N).
    pub oracle_n: f64,
    /// Difference of the two forces, over the oracle's.
    pub force_error: f64,
    /// Greatest distance between the two places of a node, over the greatest displacement.
    pub field_error: f64,
    /// Force by the oracle with contact 50 times as stiff (N).
    pub stiff_n: Option<f64>,
    /// How far the sphere reaches into the surface, by the fast solver (mm).
    pub overlap_mm: f64,
    /// Hertz's force for a half-space (N).
    pub hertz_n: f64,
    /// Hertz's force for a bonded layer of this thickness (N).
    pub layer_n: f64,
}

/// A sphere pressed into a layer of a scene's tissue.
#[derive(Clone, Debug, Serialize)]
pub struct SceneRow {
    /// Poisson's ratio of the organ.
    pub poisson_ratio: f64,
    /// `tetrahedra`, with the material that `mesh_correction` gives them, or `lattice`.
    pub backend: String,
    /// What touches: `vertices` or `surface`.
    pub tool_contact: String,
    /// Edge of the triangles (mm).
    pub edge_mm: f64,
    /// Nodes of the mesh.
    pub nodes: usize,
    /// Points of the surface that press.
    pub touching: usize,
    /// Force (N).
    pub force_n: f64,
    /// How far the sphere reaches into the surface (mm).
    pub overlap_mm: f64,
    /// Hertz's force for a bonded layer of this thickness (N).
    pub layer_n: f64,
    /// Force over that of the layer, less 1.
    pub layer_error: f64,
}

/// A capsule dragged along the layer.
#[derive(Clone, Debug, Serialize)]
pub struct DragRow {
    /// What touches: `vertices` or `surface`.
    pub tool_contact: String,
    /// Speed (mm/s).
    pub speed_mm_s: f64,
    /// Edge of the triangles (mm).
    pub edge_mm: f64,
    /// Greatest force along the surface by the fast solver: it begins to slide (N).
    pub fast_n: f64,
    /// The same by the oracle (N).
    pub oracle_n: f64,
    /// Difference, over the oracle's.
    pub error: f64,
}

/// A body pressed on the layer.
#[derive(Clone, Debug, Serialize)]
pub struct BodyRow {
    /// Edge of the triangles (mm).
    pub edge_mm: f64,
    /// Nodes of both meshes.
    pub nodes: usize,
    /// Force between the bodies by the fast solver (N).
    pub fast_n: f64,
    /// The same by the oracle (N).
    pub oracle_n: f64,
    /// Difference of the two forces, over the oracle's.
    pub force_error: f64,
    /// Greatest distance between the two places of a node, over the greatest displacement.
    pub field_error: f64,
}

/// The figures of the study.
#[derive(Clone, Debug, Serialize)]
pub struct ContactResult {
    /// Young's modulus (Pa).
    pub young_modulus_pa: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
    /// Thickness of the layer (mm).
    pub thickness_mm: f64,
    /// Radius of the sphere and its depth (mm).
    pub radius_mm: f64,
    /// See `radius_mm`.
    pub depth_mm: f64,
    /// Spheres.
    pub spheres: Vec<SphereRow>,
    /// Spheres in layers of a scene's tissue.
    pub scenes: Vec<SceneRow>,
    /// Capsules.
    pub drags: Vec<DragRow>,
    /// Bodies.
    pub bodies: Vec<BodyRow>,
}
