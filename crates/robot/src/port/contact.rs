//! Forces between shaft and rim: a spring and a dashpot across the shaft, Coulomb friction along
//! it.
//!
//! Friction is a spring to a mark on the shaft: it pulls back to where the mark was at the rim
//! until Coulomb's limit, then the mark follows. A load below the limit does not creep. The marks
//! are the caller's [`RimState`], plain data, so that a step can be tried again.

use super::port_model::Port;
use super::rim::{Edge, RimPoint};
use super::shaft::{Shaft, Twist};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// A contact that has moved less than this along the rim (rad) since its mark was set keeps the
/// mark to the bit.
const STAYS: f64 = 0.02;

/// A mark on the shaft.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Mark {
    /// Whether it is at the inner edge.
    inner: bool,
    /// The rim's place that it belongs to: the angle about the normal (rad).
    angle: f64,
    /// Distance of the mark from the shaft's base (m).
    along: f64,
}

/// What friction remembers between steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RimState {
    marks: [Option<Mark>; 4],
}

/// One scalar force on the shaft, for a solver to linearise: a point of the shaft that moves by dx
/// along `direction` at speed v changes it by -(stiffness dx + damping v).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactRow {
    /// Where it acts (m), in the cell.
    pub point: DVec3,
    /// Unit vector along which it acts on the shaft, in the cell.
    pub direction: DVec3,
    /// Force along `direction` now (N).
    pub force: f64,
    /// How it falls with motion (N/m); 0 where it does not.
    pub stiffness: f64,
    /// How it falls with speed (N s/m); 0 where it does not.
    pub damping: f64,
}

/// The shaft near or at a place of the rim.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RimContact {
    /// Where, and how near.
    pub at: RimPoint,
    /// Force across the shaft, along the normal.
    pub normal: ContactRow,
    /// Friction, along the shaft's direction.
    pub friction: ContactRow,
    /// How far the shaft has moved along its direction from where friction holds it (m); 0 where it
    /// is not touched.
    pub stretch: f64,
    /// Whether friction is at its limit.
    pub sliding: bool,
}

/// All places at which a shaft is near the rim.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contacts {
    all: [Option<RimContact>; 4],
}

impl Contacts {
    /// Every place, pressing or not.
    pub fn iter(&self) -> impl Iterator<Item = &RimContact> {
        self.all.iter().flatten()
    }

    /// The places that the shaft presses.
    pub fn touching(&self) -> impl Iterator<Item = &RimContact> {
        self.iter().filter(|c| c.at.gap < 0.0)
    }

    /// The least gap (m); none where the shaft is not in the port.
    pub fn gap(&self) -> Option<f64> {
        self.iter().map(|c| c.at.gap).reduce(f64::min)
    }

    /// Force (N) and torque about `point` (N m) that the rim exerts on the shaft, in the cell.
    pub fn on_shaft(&self, point: DVec3) -> (DVec3, DVec3) {
        let rows = self.touching().flat_map(|c| [&c.normal, &c.friction]);
        rows.fold((DVec3::ZERO, DVec3::ZERO), |(force, torque), row| {
            let f = row.force * row.direction;
            (force + f, torque + (row.point - point).cross(f))
        })
    }
}

impl Port {
    /// The contacts of a shaft that moves by `motion` (at its base), and their forces on it.
    /// Changes nothing: [`Port::advance`] moves the marks once a step is done.
    pub fn contacts(&self, shaft: &Shaft, motion: &Twist, state: &RimState) -> Contacts {
        let all = self.nearest(shaft).map(|near| near.map(|at| self.contact(at, shaft, motion, state)));
        Contacts { all }
    }

    fn contact(&self, at: RimPoint, shaft: &Shaft, motion: &Twist, state: &RimState) -> RimContact {
        let row = |direction| ContactRow { point: at.point, direction, ..ContactRow::default() };
        let (mut normal, mut friction, mut sliding) = (row(at.normal), row(shaft.direction), false);
        let mut stretch = 0.0;
        if at.gap < 0.0 {
            let velocity = motion.at(shaft.base, at.point);
            let force = -self.stiffness * at.gap - self.damping * velocity.dot(at.normal);
            // A rim pushes; it does not hold a shaft that leaves it.
            if force > 0.0 {
                normal = ContactRow { force, stiffness: self.stiffness, damping: self.damping, ..normal };
            }
            stretch = state.mark_for(&at).map_or(0.0, |m| self.stretch(shaft, m));
            let wanted = -self.friction_stiffness * stretch - self.friction_damping * velocity.dot(shaft.direction);
            let limit = self.friction * normal.force;
            sliding = wanted.abs() > limit;
            friction.force = wanted.max(-limit).min(limit);
            if !sliding {
                (friction.stiffness, friction.damping) = (self.friction_stiffness, self.friction_damping);
            }
        }
        RimContact { at, normal, friction, stretch, sliding }
    }

    /// How far the shaft has moved along its direction since the mark was set (m).
    fn stretch(&self, shaft: &Shaft, mark: &Mark) -> f64 {
        let edge = if mark.inner { Edge::Inner } else { Edge::Outer };
        mark.along - (self.rim(edge, mark.angle) - shaft.base).dot(shaft.direction)
    }

    /// Ends a step with the shaft where it is now: marks where friction slides follow, contacts
    /// that moved along the rim take theirs along, those that the shaft has left are forgotten.
    pub fn advance(&self, shaft: &Shaft, state: &mut RimState) {
        let before = *state;
        state.marks = self.nearest(shaft).map(|near| {
            let at = near.filter(|at| at.gap < 0.0)?;
            let most = -self.friction * self.stiffness * at.gap / self.friction_stiffness;
            let mark = before.mark_for(&at);
            let stretch = mark.map_or(0.0, |m| self.stretch(shaft, m));
            if let Some(mark) = mark
                && stretch.abs() <= most
                && turned(at.angle, mark.angle) < STAYS
            {
                return Some(*mark);
            }
            let along = (at.point - shaft.base).dot(shaft.direction) + stretch.max(-most).min(most);
            Some(Mark { inner: at.edge == Edge::Inner, angle: at.angle, along })
        });
    }
}

impl RimState {
    /// The mark of the contact that was nearest to this one on the same edge, if it is not on the
    /// hole's other side.
    fn mark_for(&self, at: &RimPoint) -> Option<&Mark> {
        let same = self.marks.iter().flatten().filter(|m| m.inner == (at.edge == Edge::Inner));
        same.min_by(|a, b| turned(at.angle, a.angle).total_cmp(&turned(at.angle, b.angle)))
            .filter(|m| turned(at.angle, m.angle) < FRAC_PI_2)
    }
}

/// Angle between two angles (rad), 0 to pi.
fn turned(a: f64, b: f64) -> f64 {
    ((a - b + PI).rem_euclid(TAU) - PI).abs()
}
