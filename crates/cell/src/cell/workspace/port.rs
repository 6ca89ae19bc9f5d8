//! An instrument in the hole of a port: two pivots, insertion and roll.

use super::super::setpoint::{NUMBERS, Setpoint, in_range};
use super::super::speeds::{ROLL_SPEED, SWING_SPEED, TIP_SPEED};
use super::Reached;
use crate::Result;
use glam::DVec3;
use trocar_core::Pose;
use trocar_robot::instrument::{Coordinates, Instrument, Limits};
use trocar_robot::port::Port;

/// An instrument in the hole of a port.
#[derive(Clone, Debug)]
pub struct PortSpace {
    /// The port; its normal points into the body.
    pub port: Port,
    /// The instrument.
    pub instrument: Instrument,
    /// Its limits.
    pub limits: Limits,
    /// The tips of the closed blades stay above this height in the cell (m).
    pub floor: f64,
    /// Length of the blades beyond the jaw's pivot (m).
    pub blade_length: f64,
}

impl PortSpace {
    pub(super) fn bounds(&self) -> [[f64; 2]; NUMBERS] {
        let tilt = [-self.limits.tilt, self.limits.tilt];
        [tilt, tilt, self.limits.insertion, self.limits.roll, [0.0, 1.0]]
    }

    pub(super) fn check(&self, n: &[f64]) -> std::result::Result<(), (usize, String)> {
        let tilt = Coordinates { pivots: [n[0], n[1]], ..Coordinates::default() }.tilt();
        let right = n[0].abs() < std::f64::consts::FRAC_PI_2 && n[1].abs() < std::f64::consts::FRAC_PI_2;
        // An action at the limit must not be refused because of rounding.
        if !right || tilt > self.limits.tilt + 1e-9 {
            let k = usize::from(n[1].abs() > n[0].abs());
            let (is, most) = (tilt.to_degrees(), self.limits.tilt.to_degrees());
            let reason = format!("is {:.4} rad, which tilts the shaft by {is:.1} degrees; at most {most:.1}", n[k]);
            return Err((k, reason));
        }
        in_range(2, n[2], self.limits.insertion, " m")?;
        in_range(3, n[3], self.limits.roll, " rad")
    }

    pub(super) fn solve(&self, tip: &Pose, near: &Coordinates) -> Result<Reached> {
        let mut solution = self.port.solve(&self.instrument, &self.limits, tip, near)?;
        let room = self.deepest(&solution.coordinates);
        if solution.coordinates.insertion > room {
            solution.coordinates.insertion = room;
            solution.tip = self.port.tip(&solution.coordinates);
            solution.rejected_translation = tip.translation - solution.tip.translation;
        }
        Ok(Reached {
            setpoint: solution.coordinates.into(),
            tip: solution.tip,
            rejected_rotation: solution.rejected_rotation,
            rejected_translation: solution.rejected_translation,
            roll_excess: solution.excess.roll,
        })
    }

    pub(super) fn above_floor(&self, at: &Setpoint) -> (Setpoint, bool) {
        let mut next = at.in_port();
        let room = self.deepest(&next);
        let low = next.insertion > room;
        next.insertion = next.insertion.min(room);
        (next.into(), low)
    }

    pub(super) fn behind(&self, at: &Setpoint, by: f64) -> Setpoint {
        let at = at.in_port();
        Coordinates { insertion: (at.insertion - by).max(self.limits.insertion[0]), ..at }.into()
    }

    /// The deepest insertion (m) at these pivots with which the tips of the closed blades stay
    /// above the floor.
    fn deepest(&self, at: &Coordinates) -> f64 {
        let tip = self.port.tip(at);
        let along = tip.rotation * DVec3::X;
        let height = self.port.centre().z - self.floor;
        let room = if along.z < -0.1 { -height / along.z } else { f64::INFINITY };
        (room - self.blade_length).max(self.limits.insertion[0])
    }
}

/// See [`Workspace::paced`](super::Workspace::paced). The tip moves no faster than [`TIP_SPEED`],
/// the shaft swings no faster than [`SWING_SPEED`] and rolls no faster than [`ROLL_SPEED`]. The jaw
/// has its own drive.
pub(super) fn paced(from: &Setpoint, to: &Setpoint, period: f64) -> (Setpoint, bool) {
    let (from, to) = (from.in_port(), to.in_port());
    let swing = [0, 1].map(|k| to.pivots[k] - from.pivots[k]);
    let (push, turn) = (to.insertion - from.insertion, to.roll - from.roll);
    let arm = from.insertion.max(to.insertion);
    let angle = libm::hypot(swing[0], swing[1]);
    let way = libm::hypot(push, arm * angle);
    let share = [TIP_SPEED / way, SWING_SPEED / angle, ROLL_SPEED / turn.abs()].map(|s| s * period);
    let share = share.into_iter().fold(1.0, f64::min);
    if share >= 1.0 {
        return (to.into(), false);
    }
    let pivots = [0, 1].map(|k| from.pivots[k] + share * swing[k]);
    let (insertion, roll) = (from.insertion + share * push, from.roll + share * turn);
    (Coordinates { pivots, insertion, roll, jaw: to.jaw }.into(), true)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn far_targets_are_approached_at_the_greatest_speed() {
        let at = Coordinates { insertion: 0.1, ..Coordinates::default() }.into();
        let near = Coordinates { pivots: [0.01, 0.0], insertion: 0.101, roll: 0.02, jaw: 1.0 }.into();
        assert_eq!(paced(&at, &near, 1.0 / 30.0), (near, false));
        let far = Coordinates { pivots: [0.3, -0.2], insertion: 0.05, roll: 2.0, jaw: 1.0 }.into();
        let (next, short) = paced(&at, &far, 1.0 / 30.0);
        assert!(short && next.jaw() == 1.0 && next.roll() < ROLL_SPEED / 30.0 + 1e-12);
        assert!((at.0[2] - next.0[2]) < TIP_SPEED / 30.0);
        let mut now = at;
        for _ in 0..100 {
            now = paced(&now, &far, 1.0 / 30.0).0;
        }
        assert_eq!(now, far);
    }
}
