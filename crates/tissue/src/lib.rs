//! Deformable tissue: materials, model builder, state, implicit integration, contact, grasp, cutting.
//!
//! A [`Model`] is built once by [`ModelBuilder`] and never changes; a [`State`] is plain data that can be cloned, saved
//! and restored exactly; a [`Stepper`] owns the scratch memory and advances a state. No robot, no camera, no files.
//!
//! Every step minimises implicit Euler's incremental potential 1/(2h^2) |x - y|_M^2 + E(x) by a warped, prefactored quasi-Newton method or by Vertex Block Descent
//! (Chen et al. 2024): [`SolverSettings`] says which. [`Integrator`] lets another crate step a body: `trocar-tissue-reference` has the oracle
//! that every solver is judged by, and the methods that the paper compares with.

#![forbid(unsafe_code)]

pub mod assembly;
mod body;
mod builder;
mod contact;
mod crew;
mod cutting;
mod descent;
mod error;
mod external;
mod grasp;
mod integrator;
mod isa;
mod lanes;
mod load;
mod material;
mod model;
pub mod pins;
mod quasi_newton;
mod registers;
mod report;
mod settings;
mod state;
mod stepper;
mod support;
mod untangle;

pub use body::Body;
pub use builder::{BodyDescription, MassFloor, ModelBuilder};
pub use contact::{BodyContact, Collider, Event, Hull, Nearest, Shape, ToolForce};
pub use cutting::{Cut, Piece, Severed, sever};
pub use error::{Error, Result};
pub use external::{BodyFrame, BodyMotion, Integrator, Outcome};
pub use grasp::{Compliance, Grasp, ToolMotion};
pub use isa::Isa;
pub use load::Load;
pub use material::{ConstitutiveModel, Corotated, Hyperelastic, Material, StVenantKirchhoff, StableNeoHookean};
pub use model::Model;
pub use report::{Divergence, SPEED_LIMIT, StepReport};
pub use settings::{Descent, QuasiNewton, SolverSettings, Start};
pub use state::State;
pub use stepper::Stepper;
pub use support::{Support, SupportContact, SupportField, SupportPlane};
