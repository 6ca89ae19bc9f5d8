//! The speed limits of actions.

/// Greatest speed at which a tip is commanded to move (m/s): twice that of the task.
pub const TIP_SPEED: f64 = 0.1;

/// Greatest speed at which a shaft is commanded to swing in its port (rad/s): what the arms'
/// reference follows without falling behind.
pub const SWING_SPEED: f64 = 0.9;

/// Greatest speed at which an instrument is commanded to roll (rad/s).
pub const ROLL_SPEED: f64 = 2.0;
