//! The speed limits of actions.

/// Maximum commanded speed of a tip (m/s): twice that of the task.
pub const TIP_SPEED: f64 = 0.1;

/// Maximum commanded angular speed of a shaft in its port (rad/s), which the arms' reference
/// follows without delay.
pub const SWING_SPEED: f64 = 0.9;

/// Maximum commanded rolling speed of an instrument (rad/s).
pub const ROLL_SPEED: f64 = 2.0;
