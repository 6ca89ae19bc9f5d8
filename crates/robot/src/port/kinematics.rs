//! Coordinates to poses and back, for a shaft whose axis goes through the port's centre; and the measuring of one whose axis does not.

use super::{Port, Shaft, Twist};
use crate::instrument::{Coordinates, Excess, Instrument, Limits, compose, coordinates, shaft_to_tip};
use crate::{Error, Result};
use glam::{DQuat, DVec2, DVec3};
use std::f64::consts::TAU;
use trocar_core::Pose;

/// Least cosine of the tilt at which a shaft is taken to go through the port and not to lie in its plane.
pub(super) const LEAST_COS: f64 = 0.05;

/// Where an instrument is, whether its axis goes through the centre or not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Its coordinates: the insertion is counted from where the axis crosses the port's plane, the jaw is the caller's.
    pub coordinates: Coordinates,
    /// Angle between shaft and normal [rad].
    pub tilt: f64,
    /// From the port's centre to where the axis crosses the port's plane [m], along the port's x and y; its length is the RCM deviation (SPEC).
    pub offset: DVec2,
    /// The jaw's pivot in the cell.
    pub tip: Pose,
}

impl Measured {
    /// RCM deviation [m]: distance from the port's centre to the shaft's axis, in the port's plane.
    pub fn deviation(&self) -> f64 {
        self.offset.length()
    }
}

/// The nearest that an instrument can come to a wanted pose of its tip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// Its coordinates there, within the limits.
    pub coordinates: Coordinates,
    /// The tip there, in the cell.
    pub tip: Pose,
    /// The flange there, in the cell.
    pub flange: Pose,
    /// What is left of the wanted orientation: the axis times the angle [rad] of the turn, in the cell, that would take the reached orientation to the wanted one.
    pub rejected_rotation: DVec3,
    /// What is left of the wanted position [m], in the cell; zero unless a limit binds.
    pub rejected_translation: DVec3,
    /// By how much the wanted pose lies outside which limit.
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

    /// How the tip moves, in the cell, for one unit a second of each of the two pivots, the insertion and the roll.
    pub fn tip_jacobian(&self, coordinates: &Coordinates) -> [Twist; 4] {
        let along = self.pose.rotation * Coordinates::direction(coordinates.pivots);
        let arm = coordinates.insertion * along;
        let about = |axis: DVec3| Twist { linear: axis.cross(arm), angular: axis };
        let carried = DQuat::from_rotation_x(coordinates.pivots[0]) * DVec3::Y;
        [
            about(self.pose.rotation * DVec3::X),
            about(self.pose.rotation * carried),
            Twist { linear: along, angular: DVec3::ZERO },
            Twist { linear: DVec3::ZERO, angular: along },
        ]
    }

    /// Measures an instrument whose flange is at `flange` in the cell. The roll is within +-pi; `jaw` is taken over.
    ///
    /// # Errors
    /// A pose that is not finite, a shaft that points out of the body or lies in the port's plane (a tilt over 87 degrees).
    pub fn measure(&self, instrument: &Instrument, flange: &Pose, jaw: f64) -> Result<Measured> {
        let shaft = Shaft::of(instrument, flange);
        let inverse = self.pose.inverse();
        let (base, along) = (inverse.transform(shaft.base), inverse.rotation * shaft.direction);
        if !base.is_finite() || !along.is_finite() {
            return Err(Error::invalid("flange", "its pose must be finite"));
        }
        let across = DVec2::new(along.x, along.y);
        let tilt = across.length().atan2(along.z);
        if along.z < LEAST_COS {
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

    /// How fast the two pivots [rad/s], the insertion [m/s] and the roll [rad/s] that [`Port::measure`] gives change, for a flange at `flange` that moves by `motion` (at
    /// its origin, in the cell).
    ///
    /// # Errors
    /// As [`Port::measure`]; a motion that is not finite.
    pub fn rates(&self, instrument: &Instrument, flange: &Pose, motion: &Twist) -> Result<[f64; 4]> {
        self.measure(instrument, flange, 0.0)?;
        let shaft = Shaft::of(instrument, flange);
        let inverse = self.pose.inverse();
        let (base, u) = (inverse.transform(shaft.base), inverse.rotation * shaft.direction);
        let angular = inverse.rotation * motion.angular;
        let linear = inverse.rotation * motion.at(flange.translation, shaft.base);
        if !angular.is_finite() || !linear.is_finite() {
            return Err(Error::invalid("flange", "its motion must be finite"));
        }
        let swing = angular.cross(u);
        let square = u.y * u.y + u.z * u.z;
        let first = (u.y * swing.z - u.z * swing.y) / square;
        let second = swing.x / square.sqrt();
        let insertion = (linear.z * u.z - base.z * swing.z) / (u.z * u.z);
        // The second pivot's axis is across the shaft, the first's is the port's x.
        Ok([first, second, insertion, angular.dot(u) - first * u.x])
    }

    /// The nearest that an instrument within `limits` comes to `wanted`, a pose of its tip in the cell. Position goes first: two pivots and the insertion
    /// meet it, the roll comes as near to the orientation as it can, and what is left is told. The roll is the one nearest to `near.roll`, so the long way
    /// round is never taken; `near.pivots` say where to tilt where the position leaves it open, and `near.jaw` is taken over.
    ///
    /// Where a limit binds, the nearest reachable point is taken. It moves continuously with the wanted one, except on the axis outside the body, from which all
    /// tilts are as near, and where the wanted roll is half a turn from `near`.
    ///
    /// # Errors
    /// A pose that is not finite, limits that cannot be used.
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
            return Err(Error::invalid("wanted tip", "its pose must be finite, its rotation a quaternion of length 1"));
        }
        let mut excess = Excess::default();
        let point = self.pose.inverse().transform(wanted.translation);
        let across = DVec2::new(point.x, point.y);
        let tilt = across.length().atan2(point.z);
        let away = across.try_normalize().unwrap_or_else(|| {
            let u = Coordinates::direction(near.pivots);
            DVec2::new(u.x, u.y).try_normalize().unwrap_or(DVec2::X)
        });
        let (kept, beyond) = coordinates::cut(tilt, [0.0, limits.tilt]);
        excess.tilt = beyond;
        let (sin, cos) = kept.sin_cos();
        // Within the cone the wanted point lies on the ray; outside, its foot on the cone's side is the nearest.
        let length = across.length() * sin + point.z * cos;
        let (insertion, beyond) = coordinates::cut(length, limits.insertion);
        excess.insertion = beyond;
        let pivots = if excess.tilt == 0.0 && point.length() > 1e-12 {
            coordinates::pivots(across, point.z)
        } else {
            coordinates::pivots(away * sin, cos)
        };
        let roll = self.nearest_roll(pivots, wanted.rotation);
        let unwound = roll + TAU * ((near.roll - roll) / TAU).round();
        let (roll, beyond) = coordinates::cut(unwound, limits.roll);
        excess.roll = beyond;
        let (jaw, beyond) = coordinates::cut(near.jaw, [0.0, 1.0]);
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

    /// The roll that brings the tip nearest to an orientation at these pivots: the twist about the shaft of what is left. Where a swing of half a turn is left too,
    /// every roll is as near, and 0 is given.
    fn nearest_roll(&self, pivots: [f64; 2], orientation: DQuat) -> f64 {
        let shaft = (self.pose.rotation * turn(pivots)).inverse() * orientation * shaft_to_tip().inverse();
        if shaft.w.hypot(shaft.z) < 1e-12 {
            return 0.0;
        }
        // The quaternion and its negative are one turn; this one is within half a turn.
        let sign = if shaft.w < 0.0 { -1.0 } else { 1.0 };
        2.0 * (sign * shaft.z).atan2(sign * shaft.w)
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
    if sin < 1e-150 { DVec3::ZERO } else { v * (2.0 * sin.atan2(sign * q.w) / sin) }
}
