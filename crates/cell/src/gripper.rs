//! A free-moving two-jaw gripper.
//!
//! Frame: origin at the jaw pivot, x along the closed blades towards their tips, y across the
//! closing plane (the blades open towards +y and -y), z completes. The region between the jaws is a
//! wedge 2 to 21 mm beyond the pivot, 5 mm wide along z, with half-gap r sin(theta/2).

use glam::{DMat3, DQuat, DVec3};
use trocar_core::Pose;
use trocar_geometry::TriMesh;
use trocar_tissue::ToolMotion;

/// Widest angle between the blades (rad): 60 degrees (paper section IV-C).
pub const MAX_ANGLE: f64 = std::f64::consts::FRAC_PI_3;

/// Distance from the pivot at which tissue is grasped (m): the middle of the region between the
/// jaws.
pub(crate) const GRIP_DISTANCE: f64 = 0.0115;

/// Distance from the pivot to the beginning of that region (m).
pub(crate) const JAW_REGION_BEGIN: f64 = 0.002;
/// Distance from the pivot to its end, the blades' tips (m).
pub(crate) const BLADE_TIP: f64 = 0.021;
pub(crate) const BLADE_WIDTH: f64 = 0.005;
pub(crate) const BLADE_THICKNESS: f64 = 0.0032;
pub(crate) const SHAFT_RADIUS: f64 = 0.0025;
pub(crate) const SHAFT_LENGTH: f64 = 0.12;

/// A gripper at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gripper {
    /// Pose of the gripper frame in the world (the recording frame).
    pub pose: Pose,
    /// Angle between the blades (rad).
    pub jaw_angle: f64,
}

impl Gripper {
    /// A gripper above `point` whose blades close across `along` (the tube's direction), with
    /// `point` in the middle of the region between the jaws.
    pub fn over(point: DVec3, up: DVec3, along: DVec3, jaw_angle: f64) -> Self {
        let x = -up;
        let z = (along - along.dot(up) * up).try_normalize().unwrap_or_else(|| up.any_orthonormal_vector());
        let rotation = DQuat::from_mat3(&DMat3::from_cols(x, z.cross(x), z));
        Self { pose: Pose { rotation, translation: point + GRIP_DISTANCE * up }, jaw_angle }
    }

    /// Frame of the blade that opens towards +y (`side` 1) or -y (`side` -1): at the pivot, x along
    /// the blade. Its inner face is the plane y = 0.
    pub fn blade(&self, side: f64) -> Pose {
        let swing = DQuat::from_rotation_z(0.5 * side * self.jaw_angle);
        Pose { rotation: self.pose.rotation * swing, translation: self.pose.translation }
    }

    /// The motions in a frame at whose end the gripper is `next`: tool 0 is the gripper, 1 the
    /// blade towards +y, 2 the other.
    pub fn motions_to(&self, next: &Self) -> [ToolMotion; 3] {
        let blade = |side| ToolMotion { from: self.blade(side), to: next.blade(side) };
        [ToolMotion { from: self.pose, to: next.pose }, blade(1.0), blade(-1.0)]
    }

    /// Half the gap between the blades at distance `r` from the pivot (m).
    pub fn half_gap(&self, r: f64) -> f64 {
        r * libm::sin(0.5 * self.jaw_angle)
    }

    /// Surface of the shaft and the two blades in the world (m), for pictures.
    pub fn surface(&self) -> TriMesh {
        let mut mesh = TriMesh::default();
        for side in [1.0, -1.0] {
            let swing = DQuat::from_rotation_z(side * 0.5 * self.jaw_angle);
            // The blade's inner face lies on the line from the pivot to the gap's edge; it narrows
            // towards the tip.
            let section = |x: f64, thickness: f64, width: f64| {
                [(0.0, -1.0), (1.0, -1.0), (1.0, 1.0), (0.0, 1.0)]
                    .map(|(t, w)| swing * DVec3::new(x, side * t * thickness, 0.5 * w * width))
            };
            let rings = [
                section(-0.002, BLADE_THICKNESS, BLADE_WIDTH),
                section(0.6 * BLADE_TIP, BLADE_THICKNESS, BLADE_WIDTH),
                section(BLADE_TIP, 0.7 * BLADE_THICKNESS, 0.7 * BLADE_WIDTH),
            ];
            loft(&mut mesh, &rings, side < 0.0);
        }
        const SIDES: usize = 24;
        let circle = |x: f64, radius: f64| -> [DVec3; SIDES] {
            std::array::from_fn(|k| {
                let a = std::f64::consts::TAU * k as f64 / SIDES as f64;
                DVec3::new(x, radius * libm::cos(a), radius * libm::sin(a))
            })
        };
        let shaft =
            [circle(-SHAFT_LENGTH, SHAFT_RADIUS), circle(-0.002, SHAFT_RADIUS), circle(0.002, 0.6 * SHAFT_RADIUS)];
        loft(&mut mesh, &shaft, false);
        for v in &mut mesh.vertices {
            *v = self.pose.transform(*v);
        }
        mesh
    }
}

/// Adds the closed body spanned by rings of `N` points, given counter-clockwise seen from the last
/// ring (`mirrored`: clockwise).
fn loft<const N: usize>(mesh: &mut TriMesh, rings: &[[DVec3; N]], mirrored: bool) {
    let start = mesh.vertices.len() as u32;
    let n = N as u32;
    let mut triangle = |a: u32, b: u32, c: u32| {
        mesh.triangles.push(if mirrored {
            [start + a, start + c, start + b]
        } else {
            [start + a, start + b, start + c]
        });
    };
    for r in 0..rings.len() as u32 - 1 {
        for k in 0..n {
            let (a, b) = (r * n + k, r * n + (k + 1) % n);
            triangle(a, b, b + n);
            triangle(a, b + n, a + n);
        }
    }
    let last = (rings.len() as u32 - 1) * n;
    for k in 1..n - 1 {
        triangle(0, k + 1, k);
        triangle(last, last + k, last + k + 1);
    }
    mesh.vertices.extend(rings.iter().flatten());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gripper_holds_the_point_and_comes_from_above() {
        let (point, up) = (DVec3::new(0.01, 0.02, 0.2), -DVec3::Z);
        let gripper = Gripper::over(point, up, DVec3::X, 1.0);
        assert!((gripper.pose.transform(DVec3::X * GRIP_DISTANCE) - point).length() < 1e-12);
        assert!((gripper.pose.rotation * DVec3::X + up).length() < 1e-12);
        assert!((gripper.pose.rotation * DVec3::Z).dot(DVec3::X).abs() > 1.0 - 1e-12);
    }

    #[test]
    fn its_surface_is_closed_and_faces_outward() {
        for angle in [0.0, 0.4, MAX_ANGLE] {
            let gripper = Gripper::over(DVec3::ZERO, DVec3::Z, DVec3::Y, angle);
            let surface = gripper.surface();
            assert!(surface.is_watertight());
            let blade = 0.5 * (BLADE_THICKNESS * BLADE_WIDTH) * 0.0146;
            assert!(surface.volume() > std::f64::consts::PI * SHAFT_RADIUS.powi(2) * SHAFT_LENGTH * 0.95 + 2.0 * blade);
        }
    }

    #[test]
    fn the_half_gap_follows_the_papers_wedge() {
        let gripper = Gripper::over(DVec3::ZERO, DVec3::Z, DVec3::X, 2.0 * (0.004 / GRIP_DISTANCE).asin());
        assert!((gripper.half_gap(GRIP_DISTANCE) - 0.004).abs() < 1e-12);
    }
}
