//! Meshes and the way from one to the other.
//!
//! A closed surface ([`TriMesh`]) is seen as a signed distance ([`SignedDistance`]); a signed distance becomes a clean
//! surface ([`isosurface`]) or a tetrahedral body ([`mesher::LatticeMesher`]). All lengths are metres, all geometry `f64`.

mod axis;
mod distance;
mod error;
mod grid;
mod isosurface;
pub mod mesher;
mod quality;
mod repair;
#[cfg(test)]
mod shapes;
mod skin;
mod smooth;
mod tet_mesh;
mod tri_mesh;

pub mod io;

pub use axis::OrganAxis;
pub use distance::{MeshDistance, SignedDistance};
pub use error::{Error, Result};
pub use grid::{Grid, sample_distance, sample_everywhere};
pub use isosurface::isosurface;
pub use mesher::{LatticeMesher, Mesher, TetgenMesher};
pub use quality::TetQuality;
pub use repair::{RepairReport, repair};
pub use skin::Skin;
pub use smooth::taubin;
pub use tet_mesh::{CutAway, TetMesh};
pub use tri_mesh::TriMesh;
pub use trocar_core::Pose;
