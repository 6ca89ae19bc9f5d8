//! Serial arms: their description, kinematics and dynamics.
//!
//! A [`SerialArm`] is immutable: joints, links and what is fixed to the flange. [`Frames`] says
//! where its links are at a posture, [`SerialArm::dynamics`] what it takes to move them,
//! [`SerialArm::step`] moves an [`ArmState`] on in time and [`SerialArm::inverse`] finds the
//! posture of a flange pose. Nothing of it allocates.
//!
//! Everything is computed in world axes by the recursions of Featherstone, *Rigid Body Dynamics
//! Algorithms* (2008) and of Lynch and Park, *Modern Robotics* (2017), which are cited where they
//! are used.

mod arm;
mod describe;
mod dynamics;
mod fr3;
mod frames;
mod inverse;
mod joints;
mod mass;
mod matrix;
mod resist;
mod step;

pub use arm::{Joint, JointKind, JointLimits, Segment, SerialArm};
pub use describe::{Visual, VisualShape, mjcf_visuals, urdf_visuals};
pub use dynamics::{Dynamics, LinkLoad};
pub use frames::{Frames, Jacobian};
pub use inverse::{InverseOptions, Reached};
pub(crate) use inverse::{LEVER, TASK, solve, turn};
pub use joints::{JointSet, Joints, MAX_JOINTS};
pub use mass::MassProperties;
pub use matrix::{JointFactor, JointMatrix};
pub use step::{ArmState, Coupling, CouplingLaw, Drive, MAX_COUPLINGS, StepReport};
