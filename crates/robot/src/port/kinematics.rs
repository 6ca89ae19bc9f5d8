//! Kinematics of an instrument in a port: poses from coordinates for a shaft through the port's
//! centre, coordinates from poses for any shaft.

use super::port_model::Port;
use super::shaft::{Shaft, Twist};
use crate::instrument::{Coordinates, Excess, Instrument, Limits, compose, coordinates, shaft_to_tip};
use crate::{Error, Result};
use glam::{DQuat, DVec2, DVec3};
use std::f64::consts::TAU;
use trocar_core::Pose;

/// Minimum cosine of the tilt of a shaft that goes through the port.
pub(super) const MIN_TILT_COS: f64 = 0.05;

/// The measured position of an instrument, whether or not its axis goes through the centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Coordinates. The insertion starts where the axis crosses the port's plane; the jaw's opening
    /// is the caller's.
    pub coordinates: Coordinates,
    /// Angle between shaft and normal (rad).
    pub tilt: f64,
    /// Vector from the port's centre to the crossing of the axis with the port's plane (m), along
    /// the port's x and y. Its length is the RCM deviation.
    pub offset: DVec2,
    /// Pose of the tip in the cell.
    pub tip: Pose,
}

impl Measured {
    /// RCM deviation (m): distance from the port's centre to the shaft's axis, in the port's plane.
    pub fn deviation(&self) -> f64 {
        self.offset.length()
    }
}

/// The reachable pose of the tip nearest to a wanted one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// Coordinates, within the limits.
    pub coordinates: Coordinates,
    /// Pose of the tip, in the cell.
    pub tip: Pose,
    /// Pose of the flange, in the cell.
    pub flange: Pose,
    /// The rejected rotation: axis times angle (rad) from the reached orientation to the wanted
    /// one, in the cell.
    pub rejected_rotation: DVec3,
    /// The rejected translation (m), in the cell; zero unless a limit binds.
    pub rejected_translation: DVec3,
    /// By how much the wanted pose exceeds each limit.
    pub excess: Excess,
}

impl Port {
    /// Pose of the tip in the cell for `coordinates`.
    pub fn tip(&self, coordinates: &Coordinates) -> Pose {
        let rotation = turn(coordinates.pivots) * DQuat::from_rotation_z(coordinates.roll) * shaft_to_tip();
        let translation = coordinates.insertion * Coordinates::direction(coordinates.pivots);
        compose(&self.pose, &Pose { rotation, translation })
    }

    /// Pose of the flange in the cell for `coordinates`.
    pub fn flange(&self, instrument: &Instrument, coordinates: &Coordinates) -> Pose {
        instrument.flange(&self.tip(coordinates))
    }

    /// Measures an instrument whose flange is at `flange` in the cell. The roll is within +-pi;
    /// `jaw` is copied to the result.
    ///
    /// # Errors
    /// A pose that is not finite, a shaft that points out of the body or lies in the port's plane
    /// (a tilt over 87 degrees).
    pub fn measure(&self, instrument: &Instrument, flange: &Pose, jaw: f64) -> Result<Measured> {
        let shaft = Shaft::of(instrument, flange);
        let inverse = self.pose.inverse();
        let (base, along) = (inverse.transform(shaft.base), inverse.rotation * shaft.direction);
        if !base.is_finite() || !along.is_finite() {
            return Err(Error::invalid("flange", "its pose must be finite"));
        }
        let across = DVec2::new(along.x, along.y);
        let tilt = libm::atan2(across.length(), along.z);
        if along.z < MIN_TILT_COS {
            let reason =
                format!("the shaft is tilted by {:.1} degrees; it must point into the body", tilt.to_degrees());
            return Err(Error::invalid("flange", reason));
        }
        let outside = -base.z / along.z;
        let crossing = base + outside * along;
        let tip = instrument.tip(flange);
        let pivots = coordinates::pivots(across, along.z);
        let roll = self.nearest_roll(pivots, tip.rotation);
        let coordinates = Coordinates { pivots, insertion: instrument.reach() - outside, roll, jaw };
        Ok(Measured { coordinates, tilt, offset: DVec2::new(crossing.x, crossing.y), tip })
    }

    /// The rates of the coordinates of [`Port::measure`]: two pivots (rad/s), insertion (m/s), roll
    /// (rad/s), for a flange at `flange` with the twist `motion` at its origin, in the cell.
    ///
    /// # Errors
    /// As [`Port::measure`]; a twist that is not finite.
    pub fn rates(&self, instrument: &Instrument, flange: &Pose, motion: &Twist) -> Result<[f64; 4]> {
        self.measure(instrument, flange, 0.0)?;
        let shaft = Shaft::of(instrument, flange);
        let inverse = self.pose.inverse();
        let (base, u) = (inverse.transform(shaft.base), inverse.rotation * shaft.direction);
        let angular = inverse.rotation * motion.angular;
        let linear = inverse.rotation * motion.at(flange.translation, shaft.base);
        if !angular.is_finite() || !linear.is_finite() {
            return Err(Error::invalid("flange", "its twist must be finite"));
        }
        let swing = angular.cross(u);
        let square = u.y * u.y + u.z * u.z;
        let first = (u.y * swing.z - u.z * swing.y) / square;
        let second = swing.x / square.sqrt();
        let insertion = (linear.z * u.z - base.z * swing.z) / (u.z * u.z);
        // The second pivot's axis is across the shaft, the first's is the port's x.
        Ok([first, second, insertion, angular.dot(u) - first * u.x])
    }

    /// The reachable pose within `limits` nearest to `wanted`, a pose of the tip in the cell.
    /// Position has priority: two pivots and the insertion reach it, and the roll comes as near to
    /// the orientation as possible. The result has the rejected rest. The roll is the equivalent
    /// one nearest to `near.roll`; `near.pivots` choose the tilt if the position leaves it open,
    /// and `near.jaw` is copied to the result.
    ///
    /// If a limit binds, the result is the nearest reachable point. It depends continuously on the
    /// wanted one, except on the axis outside the body, where all tilts are equally near, and where
    /// the wanted roll is half a turn from `near`.
    ///
    /// # Errors
    /// A pose that is not finite, invalid limits.
    pub fn solve(
        &self,
        instrument: &Instrument,
        limits: &Limits,
        wanted: &Pose,
        near: &Coordinates,
    ) -> Result<Solution> {
        limits.check()?;
        let unit = wanted.rotation.is_normalized();
        if !wanted.translation.is_finite() || !unit || near.to_action().iter().any(|c| !c.is_finite()) {
            return Err(Error::invalid(
                "wanted tip",
                "its pose must be finite, with a unit quaternion as its rotation",
            ));
        }
        let mut excess = Excess::default();
        let point = self.pose.inverse().transform(wanted.translation);
        let across = DVec2::new(point.x, point.y);
        let tilt = libm::atan2(across.length(), point.z);
        let away = across.try_normalize().unwrap_or_else(|| {
            let u = Coordinates::direction(near.pivots);
            DVec2::new(u.x, u.y).try_normalize().unwrap_or(DVec2::X)
        });
        let (kept, beyond) = coordinates::clamp_with_excess(tilt, [0.0, limits.tilt]);
        excess.tilt = beyond;
        let (sin, cos) = libm::sincos(kept);
        // Inside the cone the wanted point lies on the ray; outside, the nearest point is its foot
        // on the cone's side.
        let length = across.length() * sin + point.z * cos;
        let (insertion, beyond) = coordinates::clamp_with_excess(length, limits.insertion);
        excess.insertion = beyond;
        let pivots = if excess.tilt == 0.0 && point.length() > 1e-12 {
            coordinates::pivots(across, point.z)
        } else {
            coordinates::pivots(away * sin, cos)
        };
        let roll = self.nearest_roll(pivots, wanted.rotation);
        let unwound = roll + TAU * ((near.roll - roll) / TAU).round();
        let (roll, beyond) = coordinates::clamp_with_excess(unwound, limits.roll);
        excess.roll = beyond;
        let (jaw, beyond) = coordinates::clamp_with_excess(near.jaw, [0.0, 1.0]);
        excess.jaw = beyond;
        let coordinates = Coordinates { pivots, insertion, roll, jaw };
        let tip = self.tip(&coordinates);
        Ok(Solution {
            coordinates,
            tip,
            flange: instrument.flange(&tip),
            rejected_rotation: axis_angle(wanted.rotation * tip.rotation.inverse()),
            rejected_translation: wanted.translation - tip.translation,
            excess,
        })
    }

    /// The roll that brings the tip nearest to an orientation at these pivots: the twist about the
    /// shaft of the remaining rotation. If the remaining rotation includes a swing of half a turn,
    /// every roll is equally near, and the result is 0.
    fn nearest_roll(&self, pivots: [f64; 2], orientation: DQuat) -> f64 {
        let shaft = (self.pose.rotation * turn(pivots)).inverse() * orientation * shaft_to_tip().inverse();
        if libm::hypot(shaft.w, shaft.z) < 1e-12 {
            return 0.0;
        }
        // The quaternion and its negative are one turn; this one is within half a turn.
        let sign = if shaft.w < 0.0 { -1.0 } else { 1.0 };
        2.0 * libm::atan2(sign * shaft.z, sign * shaft.w)
    }
}

/// The pivots' turn in the port's frame.
fn turn(pivots: [f64; 2]) -> DQuat {
    DQuat::from_rotation_x(pivots[0]) * DQuat::from_rotation_y(pivots[1])
}

/// Axis times angle of the shorter way, exact for small angles too.
fn axis_angle(q: DQuat) -> DVec3 {
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    let v = sign * DVec3::new(q.x, q.y, q.z);
    let sin = v.length();
    if sin < 1e-150 { DVec3::ZERO } else { v * (2.0 * libm::atan2(sin, sign * q.w) / sin) }
}
