//! Mass, centre of mass and inertia of a rigid body.

use crate::error::within;
use crate::{Error, Result};
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};
use trocar_geometry::Pose;

/// A rigid body's mass and how it lies.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MassProperties {
    /// Mass [kg].
    pub mass: f64,
    /// Centre of mass [m].
    pub centre: DVec3,
    /// Inertia about the centre of mass [kg m2], along the frame's axes.
    pub inertia: DMat3,
}

impl MassProperties {
    /// A tube of `mass` [kg] along z around `centre`; with `inner` 0 it is solid. Lengths in metres.
    pub fn tube(mass: f64, outer: f64, inner: f64, length: f64, centre: DVec3) -> Self {
        let square = outer * outer + inner * inner;
        let across = mass * (3.0 * square + length * length) / 12.0;
        Self { mass, centre, inertia: DMat3::from_diagonal(DVec3::new(across, across, 0.5 * mass * square)) }
    }

    /// Both bodies as one.
    pub fn with(&self, other: &Self) -> Self {
        let mass = self.mass + other.mass;
        let centre = (self.mass * self.centre + other.mass * other.centre) / mass;
        Self { mass, centre, inertia: self.inertia_about(centre) + other.inertia_about(centre) }
    }

    /// Inertia about a point other than the centre of mass (parallel axes) [kg m2].
    pub fn inertia_about(&self, point: DVec3) -> DMat3 {
        let r = self.centre - point;
        let outer = DMat3::from_cols(r * r.x, r * r.y, r * r.z);
        self.inertia + self.mass * (r.length_squared() * DMat3::IDENTITY - outer)
    }

    /// The same body in the frame in which its own has the pose `frame`.
    pub fn moved(&self, frame: &Pose) -> Self {
        let turn = DMat3::from_quat(frame.rotation);
        Self { mass: self.mass, centre: frame.transform(self.centre), inertia: turn * self.inertia * turn.transpose() }
    }

    /// Says whether a body can have these: finite, a positive mass, a symmetric inertia whose moments are positive and obey the triangle inequality.
    pub(crate) fn check(&self, what: &str) -> Result<()> {
        within(&format!("{what}.mass"), self.mass, 1e-4, 100.0, "kg")?;
        let field = format!("{what}.centre");
        if !self.centre.is_finite() || self.centre.length() > 2.0 {
            return Err(Error::invalid(field, "must be finite and within 2 m"));
        }
        let field = format!("{what}.inertia");
        let i = self.inertia;
        if !i.is_finite() || !(i - i.transpose()).abs_diff_eq(DMat3::ZERO, 1e-9 * i.z_axis.length().max(1e-9)) {
            return Err(Error::invalid(field, "must be finite and symmetric"));
        }
        // The moments are those of a body when half their sum less each is positive: the matrix of second moments.
        let second = 0.5 * (i.x_axis.x + i.y_axis.y + i.z_axis.z) * DMat3::IDENTITY - i;
        let (a, b) = (second.x_axis, second.y_axis);
        let minors = [a.x, b.y, second.z_axis.z, a.x * b.y - a.y * b.x, second.determinant()];
        let small = -1e-12;
        if minors.iter().any(|m| *m < small) || i.x_axis.x + i.y_axis.y + i.z_axis.z <= 0.0 {
            return Err(Error::invalid(
                field,
                "no body has these moments: each must be under the sum of the other two",
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_make_a_whole() {
        let half = |z: f64| MassProperties::tube(0.5, 0.01, 0.004, 0.1, DVec3::Z * z);
        let whole = MassProperties::tube(1.0, 0.01, 0.004, 0.2, DVec3::ZERO);
        let both = half(0.05).with(&half(-0.05));
        assert!(both.centre.length() < 1e-15);
        assert!(both.inertia.abs_diff_eq(whole.inertia, 1e-12), "{both:?} {whole:?}");
    }

    #[test]
    fn turning_keeps_the_moments() {
        let rod = MassProperties::tube(1.0, 0.01, 0.0, 0.3, DVec3::X * 0.1);
        let frame = Pose { rotation: glam::DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2), translation: DVec3::Y };
        let turned = rod.moved(&frame);
        assert!((turned.inertia.x_axis.x - rod.inertia.z_axis.z).abs() < 1e-15);
        assert!((turned.centre - DVec3::new(0.0, 1.0, -0.1)).length() < 1e-15);
    }
}
