//! Integrators to compare with: semi-implicit Euler and XPBD, each in its best known form.
//!
//! They advance the same body as the implicit solvers do (masses, energies, dashpots and support planes as the model holds them), but in double precision
//! within a frame: their steps are so short that `f32` would round slow motion away. A body of which a node reaches the speed limit is left as it is
//! at that instant, for the stepper to report; nothing is clamped.

mod integrator;
mod mechanics;
mod semi_implicit;
mod stable_step;
mod xpbd;
mod xpbd_constraints;

pub(crate) use integrator::ComparatorIntegrator;
pub use semi_implicit::SemiImplicit;
pub use stable_step::stable_explicit_step;
pub use xpbd::{Xpbd, XpbdConstraints, XpbdSweep};
