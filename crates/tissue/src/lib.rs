//! Deformable tissue: materials, model builder, state, implicit integration, contact, grasp,
//! cutting.
//!
//! A [`Model`] is built once by [`ModelBuilder`] and never changes. A [`State`] is plain data that
//! can be cloned, saved and restored exactly. A [`Stepper`] owns the scratch memory and advances a
//! state. This crate knows no robot, no camera and no files.
//!
//! Every step minimises the incremental potential of implicit Euler, 1/(2h^2) |x - y|_M^2 + E(x),
//! by a warped, prefactored quasi-Newton method or by Vertex Block Descent (Chen et al. 2024), as
//! [`SolverSettings`] say. [`Integrator`] lets another crate step a body: `trocar-tissue-reference`
//! has the oracle that every solver is judged by, and the methods that the paper compares with.
//!
//! ```
//! use glam::DVec3;
//! use trocar_geometry::TetMesh;
//! use trocar_tissue::{BodyDescription, ConstitutiveModel, Material};
//! use trocar_tissue::{ModelBuilder, SolverSettings, State, Stepper};
//!
//! // One element of 10 mm that hangs from three of its nodes.
//! let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
//! let mesh = TetMesh { vertices: corners.map(|p| 0.01 * p).to_vec(), tets: vec![[0, 1, 2, 3]] };
//! let material = Material {
//!     model: ConstitutiveModel::StableNeoHookean,
//!     young_modulus: 5e3,
//!     poisson_ratio: 0.45,
//!     density: 1050.0,
//!     viscosity: 5.0,
//! };
//! let (name, pinned) = ("organ".to_owned(), vec![0, 1, 2]);
//! let organ = BodyDescription { name, mesh: &mesh, material, pinned, supports: vec![] };
//! let mut builder = ModelBuilder::new().gravity(DVec3::Z * 9.81);
//! builder.body(organ)?;
//! let model = builder.build()?;
//!
//! let mut state = State::new(&model);
//! let mut stepper = Stepper::new(&model, SolverSettings::FAST, 1.0 / 60.0, 1)?;
//! for _ in 0..60 {
//!     let report = stepper.step(&model, &mut state, &[]);
//!     assert!(report.divergence.is_none());
//! }
//! assert!(state.position(&model, 0, 3).z > 0.01);
//! # Ok::<(), trocar_tissue::Error>(())
//! ```

#![cfg_attr(not(test), warn(clippy::disallowed_methods, reason = "the same bits on every processor"))]
#![forbid(unsafe_code)]

pub mod assembly;
mod backend;
mod batch;
mod body;
mod body_slot;
mod builder;
mod contact;
mod contact_model;
mod cutting;
mod descent;
mod error;
mod external;
mod frame;
mod grasp;
mod hole;
mod inversion_guard;
mod isa;
mod island;
mod lanes;
mod lattice;
mod load;
mod material;
mod model;
pub mod pins;
mod quasi_newton;
mod registers;
mod report;
mod settings;
mod shape;
mod solver_set;
mod state;
mod stepper;
mod support;
mod threads;
mod untangle;

pub use backend::{Backend, LatticeSettings, Law};
#[cfg(feature = "gpu")]
pub use batch::GpuBatch;
pub use batch::{Batch, BatchSettings, Instance, InstanceReport};
pub use body::{Body, CollisionSurface};
pub use builder::{BodyDescription, MassFloor, ModelBuilder};
pub use contact::{Event, ToolForce};
pub use contact_model::{BodyContact, Collider, Hull, Nearest, Shape, ToolContact};
pub use cutting::{Cut, Piece, Severed, sever, sever_part, sides};
pub use error::{Error, Result};
pub use external::{BodyFrame, Integrator, Outcome};
pub use grasp::{Compliance, Grasp, ToolMotion};
pub use hole::Hole;
pub use isa::Isa;
pub use load::Load;
pub use material::{ConstitutiveModel, Corotated, Hyperelastic, Material, StVenantKirchhoff, StableNeoHookean};
pub use model::Model;
pub use report::{Divergence, SPEED_LIMIT, StepReport};
pub use settings::{Descent, QuasiNewton, SolverSettings, Start};
pub use state::{BodyMotion, State};
pub use stepper::Stepper;
pub use support::{Support, SupportContact, SupportField, SupportPlane, Tether};
