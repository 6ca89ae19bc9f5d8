//! Orientations in which to weigh an instrument.

use crate::error::within;
use crate::{Error, Result};
use glam::{DQuat, DVec3};
use std::f64::consts::PI;

/// Static poses of the paper's identification (SPEC C8).
pub const STATIC_POSES: usize = 54;

/// How far the instrument is tilted from hanging down (rad): 60 degrees, which an arm above a
/// phantom reaches to all sides.
pub const STATIC_TILT: f64 = PI / 3.0;

/// `count` orientations of the flange (its frame to the cell's, z up) in which the shaft hangs down
/// or is tilted by up to `tilt` (rad), evenly by area, to all sides (a Fibonacci spiral). A turn
/// about the vertical changes nothing that the sensor reads, so there is none.
///
/// # Errors
/// Under 3 or over 100,000 poses, a tilt that is not between 1 and 180 degrees.
pub fn static_orientations(count: usize, tilt: f64) -> Result<Vec<DQuat>> {
    if !(3..=100_000).contains(&count) {
        return Err(Error::invalid("static poses", format!("{count} is not between 3 and 100,000")));
    }
    within("static poses, tilt", tilt, PI / 180.0, PI, "rad")?;
    let turn = PI * (3.0 - 5.0_f64.sqrt());
    let orientation = |k: usize| {
        let z = 1.0 - (1.0 - tilt.cos()) * (k as f64 + 0.5) / count as f64;
        let (sin, cos) = (turn * k as f64).sin_cos();
        let across = (1.0 - z * z).max(0.0).sqrt();
        // The direction in which gravity shall lie in the flange's frame, brought to the cell's
        // down.
        DQuat::from_rotation_arc(DVec3::new(across * cos, across * sin, z).normalize(), -DVec3::Z)
    };
    Ok((0..count).map(orientation).collect())
}
