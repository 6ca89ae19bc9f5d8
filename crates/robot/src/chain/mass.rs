//! Mass, centre of mass and inertia of a rigid body.

use crate::{Error, Result};
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};
use trocar_core::Pose;

/// Mass properties of a rigid body, in axes that are fixed to it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MassProperties {
    /// Mass (kg).
    pub mass: f64,
    /// Centre of mass (m).
    pub center: DVec3,
    /// Inertia about the centre of mass (kg m2).
    pub inertia: DMat3,
}

impl MassProperties {
    /// No mass.
    pub const NONE: Self = Self { mass: 0.0, center: DVec3::ZERO, inertia: DMat3::ZERO };

    /// A tube of `mass` (kg) along z around `center` (m), with radii `outer` and `inner` (m), 0 for
    /// a solid cylinder, and `length` (m).
    pub fn tube(mass: f64, outer: f64, inner: f64, length: f64, center: DVec3) -> Self {
        let square = outer * outer + inner * inner;
        let across = mass * (3.0 * square + length * length) / 12.0;
        Self { mass, center, inertia: DMat3::from_diagonal(DVec3::new(across, across, 0.5 * mass * square)) }
    }

    /// The same body in other axes, in which its own have `pose`.
    pub fn placed(&self, pose: &Pose) -> Self {
        let r = DMat3::from_quat(pose.rotation);
        Self { mass: self.mass, center: pose.transform(self.center), inertia: r * self.inertia * r.transpose() }
    }

    /// Both bodies as one (parallel axes: Featherstone 2008, eq. 2.63).
    pub fn joined(&self, other: &Self) -> Self {
        let mass = self.mass + other.mass;
        if mass <= 0.0 {
            return Self { inertia: self.inertia + other.inertia, ..Self::NONE };
        }
        let d = other.center - self.center;
        let center = self.center + d * (other.mass / mass);
        Self { mass, center, inertia: self.inertia + other.inertia + point_inertia(self.mass * other.mass / mass, d) }
    }

    /// A body of the same shape whose density is `factor` times as high.
    pub fn scaled(&self, factor: f64) -> Self {
        Self { mass: self.mass * factor, center: self.center, inertia: self.inertia * factor }
    }

    /// Checks that such a body can exist. Zero mass is allowed. `what` names the body in errors.
    ///
    /// # Errors
    /// A number that is not finite, a negative mass, an inertia that is not symmetric, a negative
    /// principal moment, or one that exceeds the sum of the other two.
    pub fn validate(&self, what: &str) -> Result<()> {
        let fail = |reason: String| Err(Error::invalid(what, reason));
        if !(self.mass.is_finite() && self.center.is_finite() && self.inertia.is_finite()) {
            return fail("mass, centre and inertia must be finite".into());
        }
        if self.mass < 0.0 {
            return fail(format!("its mass is {} kg; it must not be negative", self.mass));
        }
        let m = self.inertia;
        let size = m.x_axis.x.abs().max(m.y_axis.y.abs()).max(m.z_axis.z.abs());
        let skew = (m.y_axis.x - m.x_axis.y).abs().max((m.z_axis.x - m.x_axis.z).abs());
        if skew.max((m.z_axis.y - m.y_axis.z).abs()) > 1e-9 * size {
            return fail("the inertia must be symmetric".into());
        }
        // trace/2 - I is the second moment of mass. It is positive semidefinite if and only if the
        // moments obey the triangle inequality. The tolerance is for rounded published tables.
        let half = 0.5 * (m.x_axis.x + m.y_axis.y + m.z_axis.z);
        if !semidefinite(DMat3::from_diagonal(DVec3::splat(half)) - m, 1e-3 * size) {
            return fail(
                "no body has this inertia: a principal moment is negative or exceeds the sum of the others".into(),
            );
        }
        if self.mass == 0.0 && size > 0.0 {
            return fail("has inertia without mass".into());
        }
        Ok(())
    }
}

/// Inertia about the origin of a point mass `m` (kg) at `d` (m) (kg m2).
pub(crate) fn point_inertia(m: f64, d: DVec3) -> DMat3 {
    let s = m * d.length_squared();
    DMat3::from_diagonal(DVec3::splat(s)) - DMat3::from_cols(d * (m * d.x), d * (m * d.y), d * (m * d.z))
}

/// Whether no eigenvalue of the symmetric `m` is below `-slack`, by the principal minors of the
/// shifted matrix.
fn semidefinite(m: DMat3, slack: f64) -> bool {
    let a = m + DMat3::from_diagonal(DVec3::splat(slack));
    let (x, y, z) = (a.x_axis, a.y_axis, a.z_axis);
    let minors = [x.x * y.y - x.y * y.x, x.x * z.z - x.z * z.x, y.y * z.z - y.z * z.y];
    [x.x, y.y, z.z].iter().chain(&minors).all(|&v| v >= 0.0) && a.determinant() >= 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_halves_equal_the_whole() {
        let half = |z: f64| MassProperties::tube(0.5, 0.01, 0.004, 0.1, DVec3::Z * z);
        let whole = MassProperties::tube(1.0, 0.01, 0.004, 0.2, DVec3::ZERO);
        let both = half(0.05).joined(&half(-0.05));
        assert!(both.center.length() < 1e-15);
        assert!(both.inertia.abs_diff_eq(whole.inertia, 1e-12), "{both:?} {whole:?}");
    }

    #[test]
    fn a_rotation_keeps_the_principal_moments() {
        let rod = MassProperties::tube(1.0, 0.01, 0.0, 0.3, DVec3::X * 0.1);
        let frame = Pose { rotation: glam::DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2), translation: DVec3::Y };
        let turned = rod.placed(&frame);
        assert!((turned.inertia.x_axis.x - rod.inertia.z_axis.z).abs() < 1e-15);
        assert!((turned.center - DVec3::new(0.0, 1.0, -0.1)).length() < 1e-15);
    }
}
