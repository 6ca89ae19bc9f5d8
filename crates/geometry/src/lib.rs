//! Triangle and tetrahedral meshes, and the conversions between them.
//!
//! A closed surface ([`TriMesh`]) defines a signed distance ([`SignedDistance`]). From a signed
//! distance, [`isosurface`] extracts a clean surface, and [`LatticeMesher`] builds a tetrahedral
//! body ([`TetMesh`]). All lengths are in metres, all coordinates `f64`.
//!
//! ```
//! use glam::DVec3;
//! use trocar_geometry::{LatticeMesher, OrganAxis, SignedDistance, TetQuality};
//!
//! /// A rod of radius 5 mm along x.
//! struct Rod;
//! impl SignedDistance for Rod {
//!     fn distance(&self, p: DVec3) -> f64 {
//!         p.distance(DVec3::X * p.x.clamp(0.0, 0.05)) - 0.005
//!     }
//! }
//!
//! let bounds = (DVec3::new(-0.005, -0.005, -0.005), DVec3::new(0.055, 0.005, 0.005));
//! let body = LatticeMesher::uniform(0.003).mesh_shape(&Rod, bounds)?;
//! assert!(TetQuality::of(&body).min_dihedral_deg > 10.7);
//!
//! let axis = OrganAxis::of(&body, DVec3::ZERO)?;
//! assert!(axis.point_at(1.0).distance(DVec3::X * 0.055) < 0.003);
//! # Ok::<(), trocar_geometry::Error>(())
//! ```

#![cfg_attr(not(test), warn(clippy::disallowed_methods, reason = "the same bits on every processor"))]

mod axis;
mod distance;
mod error;
mod grid;
mod isosurface;
pub mod mesher;
mod quality;
mod remesh;
mod repair;
mod segments;
#[cfg(test)]
mod shapes;
mod skin;
mod smooth;
pub mod symmetric;
mod tet_mesh;
mod tri_mesh;

pub mod io;

pub use axis::OrganAxis;
pub use distance::{MeshDistance, SignedDistance, closest_on_triangle};
pub use error::{Error, Result};
pub use grid::{Grid, sample_distance, sample_everywhere};
pub use isosurface::isosurface;
pub use mesher::{LatticeMesher, Mesher, TetgenMesher};
pub use quality::TetQuality;
pub use remesh::remeshed;
pub use repair::{RepairReport, repair};
pub use segments::nearest_of_segments;
pub use skin::Skin;
pub use smooth::taubin;
pub use tet_mesh::{CutAway, TetMesh};
pub use tri_mesh::TriMesh;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
