//! Reference integrators for deformable tissue: what `trocar-tissue` is judged by and compared
//! with.
//!
//! [`Oracle`] finds the step of implicit Euler and the static equilibrium to double precision,
//! slowly, also in contact with tools and between bodies. [`SemiImplicit`] and [`Xpbd`] are the
//! methods that the paper compares with, each in its best known form. [`Scheme`] puts all of them
//! behind a [`trocar_tissue::Stepper`]. [`statics`] finds equilibria by other elements. Only
//! studies, tests and recorded phantom lifts link this crate.
//!
//! The comparators advance the same body as the implicit solvers do (masses, energies, dashpots and
//! support planes as the model holds them), but in double precision within a frame: their steps are
//! so short that `f32` would round slow motion away. A body with a node at the speed limit keeps
//! its state of that instant, and the stepper reports it. Nothing is clamped.

#![cfg_attr(not(test), warn(clippy::disallowed_methods, reason = "the same bits on every processor"))]
#![forbid(unsafe_code)]

mod comparator;
mod energy;
mod error;
mod mechanics;
pub mod oracle;
mod scheme;
mod semi_implicit;
mod stable_step;
pub mod statics;
mod xpbd;
mod xpbd_constraints;
mod xpbd_settings;

pub use comparator::Comparator;
pub use energy::Energy;
pub use error::{Error, Result};
pub use oracle::{Held, Newton, NewtonIntegrator, Oracle, OracleState};
pub use scheme::Scheme;
pub use semi_implicit::SemiImplicit;
pub use stable_step::stable_explicit_step;
pub use xpbd_settings::{Xpbd, XpbdConstraints, XpbdSweep};
