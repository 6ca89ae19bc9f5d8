//! Rigid endoscopes with oblique optics.

use crate::Camera;
use glam::DQuat;
use trocar_core::Pose;

/// A rigid endoscope. The frame of its shaft has z along the shaft towards the tip and its origin
/// at the lens.
///
/// ```
/// use glam::DVec3;
/// use trocar_camera::Endoscope;
/// use trocar_core::Pose;
///
/// let view = Endoscope::thirty_degrees().view(&Pose::IDENTITY);
/// let angle = (view.rotation * DVec3::Z).angle_between(DVec3::Z);
/// assert!((angle.to_degrees() - 30.0).abs() < 1e-9);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Endoscope {
    /// The camera behind the optics.
    pub camera: Camera,
    /// Angle between the shaft and the centre of the view (rad). 0 looks straight ahead.
    pub oblique: f64,
    /// Rotation of the optics about the shaft relative to the camera head (rad). It rotates the
    /// viewing direction, while the top of the picture stays fixed to the head. At 0 the view
    /// points towards +y of the shaft frame, the bottom of the picture.
    pub turn: f64,
}

impl Endoscope {
    /// A forward-oblique laparoscope of 30 degrees with 86.2 x 54.6 degrees at 1280 x 720: the
    /// paper's endoscope after undistortion.
    pub fn thirty_degrees() -> Self {
        let (width, height) = (1280, 720);
        let focal = |pixels: usize, deg: f64| 0.5 * pixels as f64 / libm::tan(0.5 * deg.to_radians());
        let centred = Camera::centred(width, height, 86.2_f64.to_radians());
        let camera = Camera { fy: focal(height, 54.6), ..centred };
        Self { camera, oblique: 30.0_f64.to_radians(), turn: 0.0 }
    }

    /// Pose of the camera (OpenCV axes) for a pose of the shaft in the same frame.
    pub fn view(&self, shaft: &Pose) -> Pose {
        Pose { rotation: shaft.rotation * self.bend(), translation: shaft.translation }
    }

    /// Pose of the shaft for a pose of the camera: the inverse of [`Self::view`].
    pub fn shaft(&self, view: &Pose) -> Pose {
        Pose { rotation: view.rotation * self.bend().inverse(), translation: view.translation }
    }

    /// Rotation from the camera to the shaft.
    fn bend(&self) -> DQuat {
        let turn = DQuat::from_rotation_z(self.turn);
        turn * DQuat::from_rotation_x(-self.oblique) * turn.inverse()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn view_is_thirty_degrees_off_the_shaft_and_shaft_inverts_it() {
        let mut scope = Endoscope::thirty_degrees();
        let shaft = Pose { rotation: DQuat::from_rotation_y(2.1), translation: DVec3::new(0.1, 0.2, 0.3) };
        for turn in [0.0, 0.7, -2.0] {
            scope.turn = turn;
            let view = scope.view(&shaft);
            let angle = (view.rotation * DVec3::Z).angle_between(shaft.rotation * DVec3::Z);
            assert!((angle.to_degrees() - 30.0).abs() < 1e-9);
            let back = scope.shaft(&view);
            assert!(back.rotation.angle_between(shaft.rotation) < 1e-7 && back.translation == shaft.translation);
        }
        scope.turn = 0.0;
        let shaft_seen = scope.view(&shaft).inverse().rotation * (shaft.rotation * DVec3::Z);
        assert!(shaft_seen.y < -0.49 && shaft_seen.x.abs() < 1e-9, "the shaft points to the picture's top");
    }

    #[test]
    fn the_field_of_view_matches_the_paper() {
        let camera = Endoscope::thirty_degrees().camera;
        let wide = 2.0 * (-camera.ray(-0.5, camera.cy).x).atan().to_degrees();
        let high = 2.0 * (-camera.ray(camera.cx, -0.5).y).atan().to_degrees();
        assert!((wide - 86.2).abs() < 1e-9 && (high - 54.6).abs() < 1e-9, "{wide} x {high}");
    }
}
