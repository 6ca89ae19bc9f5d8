//! Serial arms: description, kinematics and dynamics.
//!
//! A [`SerialArm`] is immutable: joints, links and a payload at the flange. [`Frames`] holds the
//! poses of its links in a posture, [`SerialArm::dynamics`] computes mass matrix and bias,
//! [`SerialArm::step`] integrates an [`ArmState`], and [`SerialArm::inverse`] finds the posture for
//! a pose of the flange. None of them allocates.
//!
//! All computations are in world axes, with the recursions of Featherstone, *Rigid Body Dynamics
//! Algorithms* (2008), and of Lynch and Park, *Modern Robotics* (2017), cited where they are used.

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
pub(crate) use inverse::{ROTATION_LEVER, TASK_ROWS, rotation_vector, solve_task};
pub use joints::{JointSet, Joints, MAX_JOINTS};
pub use mass::MassProperties;
pub use matrix::{JointFactor, JointMatrix};
pub use step::{ArmState, ArmStepReport, Coupling, CouplingLaw, Drive, MAX_COUPLINGS};
