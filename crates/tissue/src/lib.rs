//! Deformable tissue: materials, model builder, state, implicit integration, contact, grasp, cutting.
//!
//! A [`Model`] is built once by [`ModelBuilder`] and never changes; a [`State`] is plain data that can be cloned, saved
//! and restored exactly; a [`Stepper`] owns the scratch memory and advances a state. No robot, no camera, no files.
//!
//! Every step minimises implicit Euler's incremental potential 1/(2h^2) |x - y|_M^2 + E(x) by a warped, prefactored quasi-Newton method or by Vertex Block Descent
//! (Chen et al. 2024): [`Schedule`] says which. [`Oracle`] finds the same minimum to double precision, slowly,
//! for every solver to be judged by.

#![forbid(unsafe_code)]

mod body;
mod builder;
mod comparator;
mod contact;
mod crew;
mod cutting;
mod descent;
mod energy;
mod error;
mod grasp;
mod integrator;
mod isa;
mod lanes;
mod load;
mod material;
mod model;
pub mod oracle;
pub mod pins;
mod quasi_newton;
mod registers;
mod report;
mod schedule;
mod state;
mod stepper;
mod stiffness;
mod support;
mod untangle;

pub use body::Body;
pub use builder::{BodyDescription, MassFloor, ModelBuilder};
pub use comparator::{SemiImplicit, Xpbd, XpbdConstraints, XpbdSweep, stable_explicit_step};
pub use contact::{BodyContact, Collider, Event, Hull, Nearest, Shape, ToolForce};
pub use cutting::{Cut, Piece, Severed, sever};
pub use energy::Energy;
pub use error::{Error, Result};
pub use grasp::{Compliance, Grasp, ToolMotion};
pub use isa::Isa;
pub use load::Load;
pub use material::{ConstitutiveModel, Corotated, Hyperelastic, Material, StVenantKirchhoff, StableNeoHookean};
pub use model::Model;
pub use oracle::{Held, Newton, Oracle, OracleState};
pub use report::{Divergence, StepReport};
pub use schedule::{Descent, QuasiNewton, Schedule, Start};
pub use state::State;
pub use stepper::Stepper;
pub use support::{Support, SupportField, SupportPlane};
