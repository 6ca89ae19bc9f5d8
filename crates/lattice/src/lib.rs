//! Deformable tissue on a regular lattice of hexahedra: a second physics beside the tetrahedra of
//! `trocar-tissue`, which has a backend that is made of this crate's elements.
//!
//! The two share no mesh, no element and no solver. Where they agree, a result does not depend on
//! either. A [`Lattice`] is cut from a body's tetrahedra: cubic cells, each with the exact volume,
//! mean and covariance of the material inside it. Parts of a body that lie in one cell without
//! being connected there get a hexahedron each. A [`Body`] adds a [`Material`] and pins, a
//! [`BodyState`] is what moves, and [`Newton`] finds static equilibria and steps of implicit Euler
//! to convergence, in double precision. Surface points, grasps, pins and measurements move with the
//! lattice as [`EmbeddedPoint`]s.
//!
//! ```
//! use glam::DVec3;
//! use trocar_geometry::{LatticeMesher, SignedDistance};
//! use trocar_lattice::{
//!     Body, BodyDescription, BodyState, Conditions, Lattice, LatticeOptions, Law, Material, Newton, Precision,
//! };
//!
//! /// A ball of radius 10 mm.
//! struct Ball;
//! impl SignedDistance for Ball {
//!     fn distance(&self, p: DVec3) -> f64 {
//!         p.length() - 0.01
//!     }
//! }
//!
//! let bounds = (DVec3::splat(-0.01), DVec3::splat(0.01));
//! let mesh = LatticeMesher::uniform(0.003).mesh_shape(&Ball, bounds)?;
//! let lattice = Lattice::of_mesh(&mesh, &LatticeOptions::new(0.004))?;
//! let points = lattice.embed_nodes()?;
//!
//! // Its upper part is pinned; it hangs by its weight.
//! let pinned = mesh.vertices.iter().zip(&points).filter(|(p, _)| p.z > 0.007);
//! let pins = pinned.map(|(_, point)| *point).collect();
//! let material = Material { law: Law::Corotated, young_modulus: 5e3, poisson_ratio: 0.45, density: 1050.0 };
//! let body = Body::new(BodyDescription { name: "ball".to_owned(), lattice, material, pins, fixed: vec![] })?;
//! let mut state = BodyState::new(&body);
//! let mut newton = Newton::new(&body, Precision::default())?;
//! newton.settle(&body, &Conditions::gravity(DVec3::Z * -9.81), &mut state)?;
//!
//! let sag = |i: usize| mesh.vertices[i].z - points[i].interpolate(&state.positions).z;
//! assert!((0..points.len()).map(sag).fold(0.0, f64::max) > 1e-4);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![cfg_attr(not(test), warn(clippy::disallowed_methods, reason = "the same bits on every processor"))]
#![forbid(unsafe_code)]

mod body;
mod clip;
mod elastic;
mod element;
mod embedding;
mod error;
mod flow;
mod grid;
mod held;
mod lattice;
mod material;
mod moments;
mod motion;
mod newton;
mod pcg;
mod pieces;
mod points;
mod potential;
mod ramify;

pub use body::{Body, BodyDescription, BodyState, Conditions, PointLoad, Spring};
pub use elastic::RestStiffness;
pub use embedding::EmbeddedPoint;
pub use error::{Error, Failure, Result};
pub use flow::Flow;
pub use grid::{BoundaryRule, LatticeOptions, MAX_CELLS};
pub use lattice::{Hexahedron, Lattice};
pub use material::{Law, Material};
pub use motion::Motion;
pub use newton::{Newton, Precision, Solution};
