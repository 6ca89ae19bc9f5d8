//! The pose of an instrument in its port when an episode starts.

use crate::Port;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Pose of an instrument in its port. The shaft's axis goes through the port's centre.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Start {
    /// Angle between shaft and port normal (degrees); 0, or 1 and more.
    pub tilt_deg: f64,
    /// Where the tip leans (degrees): the direction in the wall, from the port's x axis (the cell's
    /// x) counter-clockwise as seen from outside.
    pub azimuth_deg: f64,
    /// Distance along the shaft from the port's centre to the tip of the closed blades (mm).
    pub insertion_mm: f64,
    /// Turn about the shaft (degrees).
    pub roll_deg: f64,
    /// Jaw opening, 0 (closed) to 1.
    pub jaw: f64,
    /// Where the pivot of the jaw is in the cell frame (m), of an arm without a port. Tilt, azimuth
    /// and insertion mean nothing there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_m: Option<[f64; 3]>,
}

impl Default for Start {
    fn default() -> Self {
        Self { tilt_deg: 13.3, azimuth_deg: 0.0, insertion_mm: 100.0, roll_deg: 0.0, jaw: 0.5, position_m: None }
    }
}

impl Start {
    /// Unit vector along the shaft towards its tip, in the cell frame.
    pub fn direction(&self, port: &Port) -> DVec3 {
        let (sin, cos) = libm::sincos(self.tilt_deg.to_radians());
        let (across, along) = libm::sincos(self.azimuth_deg.to_radians());
        port.frame().rotation * DVec3::new(sin * along, sin * across, -cos)
    }

    /// Tip of the closed blades in the cell frame (m).
    pub fn tip(&self, port: &Port) -> DVec3 {
        DVec3::from(port.centre_m) + 1e-3 * self.insertion_mm * self.direction(port)
    }
}
