//! An arm with an instrument in a port, under control: commands in, motion out.
//!
//! ```text
//! commands, 30 Hz
//!   -> reference (limiter, spline, joints)              setpoint_*
//!   -> controller (links 2% and instrument 5% too light)
//!   -> torques
//!   -> arm with payload, rim, obstacles, load on tip    measured_*
//! ```
//!
//! Only joint torques within the arm's limits move the arm. Names are those of CRTK (Su et al.
//! 2020): `servo` commands, `setpoint` is the input of the controller, `measured` the actual
//! motion; `_cp` is a pose, `_cv` a twist, `_cf` a force in the cell's axes, `_js` the joints,
//! `_jp` their positions.
//!
//! A step allocates nothing. [`ManipulatorState`] is plain data: a restored copy continues bit for
//! bit.

mod control;
mod controlled_arm;
mod measure;
mod obstacle;
mod reference;
mod restart;
mod settings;
mod touch;

pub use controlled_arm::{Commanded, Manipulator, ManipulatorReport, ManipulatorState};
pub use measure::JointReadings;
pub use obstacle::{MAX_OBSTACLES, Obstacle};
pub use settings::{ControllerSettings, Gains, Law, ModelError};
