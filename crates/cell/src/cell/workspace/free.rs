//! An instrument without a port: the position of its jaw's pivot in a box, and its roll.

use super::super::setpoint::{NUMBERS, Setpoint, in_range};
use super::super::speeds::{ROLL_SPEED, TIP_SPEED};
use super::Reached;
use crate::{Error, Result};
use glam::{DMat3, DQuat, DVec3};
use std::f64::consts::{PI, TAU};
use trocar_core::Pose;

/// Range of a free instrument around its start, along each axis of the cell (m).
const REACH: f64 = 0.2;

/// The workspace of an instrument without a port. Its shaft always points in the same direction.
#[derive(Clone, Debug, PartialEq)]
pub struct FreeSpace {
    /// Direction of the shaft, towards the tip: a unit vector.
    pub direction: DVec3,
    /// Lower and upper corner of the box for the jaw's pivot, in the cell (m).
    pub corners: [DVec3; 2],
    /// The tip frame's rotation at roll 0.
    rotation: DQuat,
}

impl FreeSpace {
    /// The box around `start` (m) for a shaft in `direction`.
    pub fn around(start: DVec3, direction: DVec3) -> Self {
        let x = direction.normalize_or(-DVec3::Z);
        // The hinge at roll 0 is along the cell's x if the shaft is not, else along y.
        let across = |v: DVec3| v - v.dot(x) * x;
        let z = across(if x.x.abs() < 0.9 { DVec3::X } else { DVec3::Y }).normalize();
        let rotation = DQuat::from_mat3(&DMat3::from_cols(x, z.cross(x), z)).normalize();
        Self { direction: x, corners: [start - REACH, start + REACH], rotation }
    }

    pub(super) fn bounds(&self) -> [[f64; 2]; NUMBERS] {
        let [low, high] = self.corners;
        [[low.x, high.x], [low.y, high.y], [low.z, high.z], [-PI, PI], [0.0, 1.0]]
    }

    pub(super) fn check(&self, n: &[f64]) -> std::result::Result<(), (usize, String)> {
        let units = [" m", " m", " m", " rad"];
        units.iter().enumerate().try_for_each(|(k, unit)| in_range(k, n[k], self.bounds()[k], unit))
    }

    pub(super) fn clamp(&self, wanted: &Setpoint) -> Setpoint {
        let bounds = self.bounds();
        Setpoint(std::array::from_fn(|k| wanted.0[k].max(bounds[k][0]).min(bounds[k][1])))
    }

    pub(super) fn tip(&self, at: &Setpoint) -> Pose {
        let rotation = self.rotation * DQuat::from_rotation_x(at.roll());
        Pose { rotation, translation: place(at) }
    }

    pub(super) fn solve(&self, tip: &Pose, near: &Setpoint) -> Result<Reached> {
        if !tip.translation.is_finite() || !tip.rotation.is_normalized() {
            let reason = "the wanted tip: its pose must be finite, its rotation a quaternion of length 1";
            return Err(Error::Option(reason.to_owned()));
        }
        let hinge = self.rotation.inverse() * (tip.rotation * DVec3::Z);
        let roll = if libm::hypot(hinge.y, hinge.z) > 1e-9 { libm::atan2(-hinge.y, hinge.z) } else { near.roll() };
        // The nearest of the equivalent rolls, if it is within the limits.
        let nearest = roll + TAU * ((near.roll() - roll) / TAU).round();
        let roll = if nearest.abs() <= PI { nearest } else { roll };
        let t = tip.translation;
        let setpoint = self.clamp(&Setpoint([t.x, t.y, t.z, roll, near.jaw()]));
        let reached = self.tip(&setpoint);
        let turn = tip.rotation * reached.rotation.inverse();
        Ok(Reached {
            setpoint,
            tip: reached,
            rejected_rotation: if turn.w < 0.0 { -turn } else { turn }.to_scaled_axis(),
            rejected_translation: t - reached.translation,
            roll_excess: 0.0,
        })
    }

    pub(super) fn behind(&self, at: &Setpoint, by: f64) -> Setpoint {
        let back = place(at) - by * self.direction;
        self.clamp(&Setpoint([back.x, back.y, back.z, at.roll(), at.jaw()]))
    }
}

fn place(at: &Setpoint) -> DVec3 {
    DVec3::new(at.0[0], at.0[1], at.0[2])
}

/// See [`Workspace::paced`](super::Workspace::paced). The tip goes no faster than [`TIP_SPEED`] and
/// rolls no faster than [`ROLL_SPEED`].
pub(super) fn paced(from: &Setpoint, to: &Setpoint, period: f64) -> (Setpoint, bool) {
    let (way, turn) = (place(from).distance(place(to)), (to.roll() - from.roll()).abs());
    let share = [TIP_SPEED / way, ROLL_SPEED / turn].map(|s| s * period).into_iter().fold(1.0, f64::min);
    if share >= 1.0 { (*to, false) } else { (from.towards(to, share), true) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_come_back_as_the_numbers_that_gave_them() {
        for direction in [-DVec3::Z, DVec3::new(0.3, -0.4, -0.8), DVec3::X] {
            let space = FreeSpace::around(DVec3::new(0.1, 0.4, 0.2), direction);
            for roll in [-3.0, -0.4, 0.0, 2.5] {
                let at = Setpoint([0.05, 0.45, 0.1, roll, 0.7]);
                let tip = space.tip(&at);
                assert!((tip.rotation * DVec3::X - direction.normalize()).length() < 1e-12);
                let reached = space.solve(&tip, &at.with_roll(roll + 0.1)).unwrap();
                let off = (0..5).map(|k| (reached.setpoint.0[k] - at.0[k]).abs()).fold(0.0, f64::max);
                assert!(off < 1e-9, "{reached:?}");
                assert!(reached.rejected_rotation.length() < 1e-9 && reached.rejected_translation == DVec3::ZERO);
            }
        }
    }

    #[test]
    fn what_is_beyond_the_box_or_too_fast_is_held_back() {
        let space = FreeSpace::around(DVec3::ZERO, -DVec3::Z);
        assert!(space.check(&[0.0, 0.0, 0.25, 0.0]).is_err_and(|(k, said)| k == 2 && said.contains("0.2000")));
        assert!(space.check(&[0.1, -0.1, 0.2, 3.0]).is_ok());
        let leaning = Pose { rotation: DQuat::from_rotation_y(0.3) * space.rotation, translation: 0.5 * DVec3::X };
        let reached = space.solve(&leaning, &Setpoint::default()).unwrap();
        assert!((reached.rejected_rotation.length() - 0.3).abs() < 1e-9, "{reached:?}");
        assert!((reached.rejected_translation.x - 0.3).abs() < 1e-12);
        let (from, to) = (Setpoint::default(), Setpoint([0.1, 0.0, 0.0, 0.0, 1.0]));
        let (next, short) = paced(&from, &to, 0.1);
        assert!(short && (next.0[0] - 0.1 * TIP_SPEED).abs() < 1e-15 && next.jaw() == 1.0);
    }
}
