//! The port: a round hole in a sheet, its clearance and the limits that it gives an instrument.

use crate::error::within;
use crate::instrument::Limits;
use crate::{Error, Result};
use glam::{DMat3, DQuat, DVec3};
use serde::{Deserialize, Serialize};
use trocar_core::Pose;

/// A round hole in a sheet.
///
/// ```
/// use glam::DVec3;
/// use trocar_robot::port::Port;
///
/// // The paper's 6 mm hole: a 5 mm shaft tilted by 13.3 degrees has a clearance of 0.43 mm.
/// let port = Port::new(DVec3::ZERO, -DVec3::Z, DVec3::X)?;
/// let clearance = port.clearance(2.5e-3, 13.3_f64.to_radians());
/// assert!((clearance - 0.43e-3).abs() < 5e-6);
/// # Ok::<(), trocar_robot::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Port {
    /// Pose of the port frame in the cell: the hole's centre, z into the body.
    pub pose: Pose,
    /// Diameter D of the hole (m).
    pub hole_diameter: f64,
    /// Thickness t of the sheet (m). At 0 the rim is one edge and the clearance is the paper's.
    pub thickness: f64,
    /// Stiffness of the rim against the shaft (N/m).
    pub stiffness: f64,
    /// Damping of the rim across the shaft (N s/m).
    pub damping: f64,
    /// Coefficient of Coulomb friction between rim and shaft.
    pub friction: f64,
    /// Stiffness of the rim along the shaft while it sticks (N/m).
    pub friction_stiffness: f64,
    /// Damping along the shaft while it sticks (N s/m).
    pub friction_damping: f64,
}

impl Port {
    /// The paper's 6 mm hole at `centre` (m), with `normal` into the body and x the projection of
    /// `x` across the normal. The rim is a single edge of 20 N/mm with friction 0.2; these two are
    /// our choice, because the paper does not state them.
    ///
    /// # Errors
    /// A centre that is not finite, a zero normal, an `x` along the normal.
    pub fn new(centre: DVec3, normal: DVec3, x: DVec3) -> Result<Self> {
        if !centre.is_finite() {
            return Err(Error::invalid("port, centre", format!("{centre} must be finite")));
        }
        let Some(z) = normal.try_normalize() else {
            return Err(Error::invalid(
                "port, normal",
                format!("{normal} has no direction; it must point into the body"),
            ));
        };
        let Some(x) = (x - x.dot(z) * z).try_normalize().filter(|a| a.dot(x) > 1e-6 * x.length()) else {
            return Err(Error::invalid("port, x", format!("{x} has no direction across the normal {z}")));
        };
        let rotation = DQuat::from_mat3(&DMat3::from_cols(x, z.cross(x), z));
        Ok(Self {
            pose: Pose { rotation, translation: centre },
            hole_diameter: 6e-3,
            thickness: 0.0,
            stiffness: 2e4,
            damping: 20.0,
            friction: 0.2,
            friction_stiffness: 2e4,
            friction_damping: 20.0,
        })
    }

    /// Checks the port.
    ///
    /// # Errors
    /// A size, stiffness or friction out of range, a pose that is not finite or whose rotation is
    /// not a unit quaternion.
    pub fn check(&self) -> Result<()> {
        within("port, hole_diameter", self.hole_diameter, 1e-3, 0.1, "m")?;
        within("port, thickness", self.thickness, 0.0, 0.05, "m")?;
        within("port, stiffness", self.stiffness, 1.0, 1e8, "N/m")?;
        within("port, damping", self.damping, 0.0, 1e6, "N s/m")?;
        within("port, friction", self.friction, 0.0, 10.0, "")?;
        within("port, friction_stiffness", self.friction_stiffness, 1.0, 1e8, "N/m")?;
        within("port, friction_damping", self.friction_damping, 0.0, 1e6, "N s/m")?;
        if !self.pose.translation.is_finite() || !self.pose.rotation.is_normalized() {
            return Err(Error::invalid("port, pose", "must be finite, with a unit quaternion as its rotation"));
        }
        Ok(())
    }

    /// Centre of the hole (m), in the cell.
    pub fn centre(&self) -> DVec3 {
        self.pose.translation
    }

    /// Unit normal into the body, in the cell.
    pub fn normal(&self) -> DVec3 {
        self.pose.rotation * DVec3::Z
    }

    /// Maximum distance (m) of the axis of a shaft of `radius` (m) at `tilt` (rad) from the centre,
    /// in the direction of the tilt: (D - d/cos(tilt) - t tan(tilt))/2, the paper's clearance for a
    /// sheet without thickness. Negative if the shaft does not fit, minus infinity from 90 degrees
    /// on.
    pub fn clearance(&self, radius: f64, tilt: f64) -> f64 {
        let cos = libm::cos(tilt);
        if cos.is_nan() || cos <= 1e-9 {
            return f64::NEG_INFINITY;
        }
        0.5 * (self.hole_diameter - 2.0 * radius / cos - self.thickness * libm::tan(tilt.abs()))
    }

    /// Maximum distance (m) of the axis from the centre across the direction of the tilt, in a
    /// sheet without thickness.
    ///
    /// It is (D - d)/2 up to the tilt acos(sqrt(d/D)), 24.1 degrees for 5 mm in 6 mm. Beyond it the
    /// curvature of the shaft's elliptic section at the end of its short axis is smaller than that
    /// of the hole. The section touches at two points beside this end, and the distance is
    /// sin(tilt) sqrt((D/2)^2 - (d/2)^2/cos(tilt)^2).
    pub fn clearance_across(&self, radius: f64, tilt: f64) -> f64 {
        let (big, k) = (0.5 * self.hole_diameter, libm::cos(tilt) * libm::cos(tilt));
        if big * k >= radius {
            return big - radius;
        }
        let square = (1.0 - k) * (big * big - radius * radius / k.max(1e-18));
        if square >= 0.0 { square.sqrt() } else { f64::NEG_INFINITY }
    }

    /// The tilt (rad) at which a shaft of `radius` (m) has the clearance `clearance` (m); `None` if
    /// an upright shaft has less.
    pub fn tilt_with_clearance(&self, radius: f64, clearance: f64) -> Option<f64> {
        // D' cos(tilt) - t sin(tilt) = d as a single cosine.
        let wide = self.hole_diameter - 2.0 * clearance;
        let cos = 2.0 * radius / libm::hypot(wide, self.thickness);
        let tilt = libm::acos(cos.min(1.0)) - libm::atan2(self.thickness, wide);
        (wide >= 2.0 * radius && cos.is_finite()).then(|| tilt.max(0.0))
    }

    /// Limits for an instrument: the tilt with the clearance `clearance` (m), insertions with the
    /// jaw's pivot at least `margin` (m) inside and the shaft's base as far outside, and a roll
    /// within +-2.7 rad.
    ///
    /// # Errors
    /// An instrument that does not fit into the hole with this clearance, or is too short.
    pub fn limits(&self, instrument: &crate::instrument::Instrument, clearance: f64, margin: f64) -> Result<Limits> {
        self.check()?;
        instrument.check()?;
        let Some(tilt) = self.tilt_with_clearance(instrument.shaft_radius, clearance).filter(|t| *t > 1e-3) else {
            let shaft = 2e3 * instrument.shaft_radius;
            let hole = 1e3 * self.hole_diameter;
            let reason =
                format!("{hole} mm allow no tilt of a shaft of {shaft} mm at a clearance of {} mm", 1e3 * clearance);
            return Err(Error::invalid("port, hole_diameter", reason));
        };
        let limits = Limits { tilt, insertion: [margin, instrument.reach() - margin], roll: [-2.7, 2.7] };
        limits.check()?;
        Ok(limits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn port() -> Port {
        Port::new(DVec3::ZERO, DVec3::Z, DVec3::X).unwrap()
    }

    #[test]
    fn clearances_equal_the_papers() {
        let mm = |degrees: f64| 1e3 * port().clearance(2.5e-3, degrees.to_radians());
        assert!((mm(0.0) - 0.5).abs() < 1e-12);
        assert!((mm(13.3) - 0.43).abs() < 0.005, "{}", mm(13.3));
        assert!((mm(18.3) - 0.37).abs() < 0.005, "{}", mm(18.3));
        let none = (5.0_f64 / 6.0).acos().to_degrees();
        assert!((none - 33.557).abs() < 1e-3 && mm(none).abs() < 1e-12);
        assert_eq!(port().clearance(2.5e-3, 2.0), f64::NEG_INFINITY);
        assert_eq!(port().clearance(2.5e-3, f64::NAN), f64::NEG_INFINITY);
    }

    #[test]
    fn the_tilt_for_a_clearance_has_this_clearance() {
        for thickness in [0.0, 1e-3, 3e-3] {
            let port = Port { thickness, ..port() };
            for clearance in [0.0, 1e-4, 4e-4] {
                let tilt = port.tilt_with_clearance(2.5e-3, clearance).unwrap();
                assert!((port.clearance(2.5e-3, tilt) - clearance).abs() < 1e-12);
            }
            assert_eq!(port.tilt_with_clearance(2.5e-3, 6e-4), None);
        }
    }

    #[test]
    fn bad_ports_are_refused() {
        let said = |r: Result<Port>| r.unwrap_err().to_string();
        assert!(said(Port::new(DVec3::NAN, DVec3::Z, DVec3::X)).contains("centre"));
        assert!(said(Port::new(DVec3::ZERO, DVec3::ZERO, DVec3::X)).contains("normal"));
        assert!(said(Port::new(DVec3::ZERO, DVec3::Z, DVec3::Z)).contains("across the normal"));
        assert!(Port { stiffness: -1.0, ..port() }.check().unwrap_err().to_string().contains("stiffness"));
        let wide = crate::instrument::Instrument { shaft_radius: 3.1e-3, ..crate::instrument::Instrument::grasper() };
        assert!(port().limits(&wide, 0.0, 0.01).unwrap_err().to_string().contains("6.2 mm"));
    }
}
