//! A free-moving two-jaw gripper.
//!
//! Frame: origin at the jaw pivot, x along the closed blades towards their tips, y across the closing plane (the blades
//! open towards +y and -y), z completes. SPEC C3: the mouth is a wedge 2 to 21 mm beyond the pivot, 5 mm wide (along z), with
//! half-gap r sin(theta/2).

use trocar_geometry::{Pose, TriMesh};

/// A gripper at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gripper {
    /// Pose of the gripper frame in the world (the recording frame).
    pub pose: Pose,
    /// Angle between the blades [rad].
    pub jaw_angle: f64,
}

impl Gripper {
    /// Surface of the shaft and the two blades in the world [m], for pictures.
    pub fn surface(&self) -> TriMesh {
        todo!()
    }
}
