//! Orientations for the identification of an instrument's load.

use crate::error::within;
use crate::{Error, Result};
use glam::{DQuat, DVec3};
use std::f64::consts::PI;

/// Number of static poses in the paper's identification.
pub const STATIC_POSES: usize = 54;

/// Maximum tilt of the instrument from hanging down (rad): 60 degrees, which an arm above a phantom
/// reaches to all sides.
pub const STATIC_TILT: f64 = PI / 3.0;

/// `count` orientations of the flange (from its frame to the cell's, z up), in which the shaft
/// hangs down or is tilted by up to `tilt` (rad) to all sides, evenly by area (a Fibonacci spiral).
/// They have no rotation about the vertical, which does not change the readings.
///
/// # Errors
/// Fewer than 3 or more than 100,000 poses, a tilt outside [1, 180] degrees.
pub fn static_orientations(count: usize, tilt: f64) -> Result<Vec<DQuat>> {
    if !(3..=100_000).contains(&count) {
        return Err(Error::invalid("static poses", format!("{count} must be in [3, 100000]")));
    }
    within("static poses, tilt", tilt, PI / 180.0, PI, "rad")?;
    let turn = PI * (3.0 - 5.0_f64.sqrt());
    let orientation = |k: usize| {
        let z = 1.0 - (1.0 - libm::cos(tilt)) * (k as f64 + 0.5) / count as f64;
        let (sin, cos) = libm::sincos(turn * k as f64);
        let across = (1.0 - z * z).max(0.0).sqrt();
        // Rotates the direction of gravity in the flange's frame to the cell's down.
        DQuat::from_rotation_arc(DVec3::new(across * cos, across * sin, z).normalize(), -DVec3::Z)
    };
    Ok((0..count).map(orientation).collect())
}
