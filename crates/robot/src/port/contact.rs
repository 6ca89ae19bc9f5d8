//! Forces between shaft and rim: a spring and a damper across the shaft, Coulomb friction along it.
//!
//! Friction is a spring to a mark on the shaft, up to Coulomb's limit; beyond it the mark slides. A
//! load below the limit causes no creep. The marks are in the caller's [`RimState`], plain data,
//! which allows a step to be repeated.

use super::port_model::Port;
use super::rim::{Edge, RimPoint};
use super::shaft::{Shaft, Twist};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// A contact that has moved less than this along the rim (rad) keeps its mark bit for bit.
const MARK_TOLERANCE: f64 = 0.02;

/// A mark on the shaft.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Mark {
    /// Whether it is at the inner edge.
    inner: bool,
    /// Angle of its contact about the normal (rad).
    angle: f64,
    /// Distance of the mark from the shaft's base (m).
    along: f64,
}

/// The state of friction between steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RimState {
    marks: [Option<Mark>; 4],
}

impl RimState {
    /// Every number of it.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = f64> {
        let Self { marks } = self;
        marks.iter().flat_map(|mark| match mark {
            Some(Mark { inner, angle, along }) => [1.0, f64::from(u8::from(*inner)), *angle, *along],
            None => [0.0; 4],
        })
    }
}

/// A scalar force on the shaft, with its linearisation: a motion dx of the point along `direction`
/// at speed v changes the force by -(stiffness dx + damping v).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactRow {
    /// Its point (m), in the cell.
    pub point: DVec3,
    /// Its unit direction, in the cell.
    pub direction: DVec3,
    /// Force along `direction` (N).
    pub force: f64,
    /// Decrease with motion (N/m), or 0.
    pub stiffness: f64,
    /// Decrease with speed (N s/m), or 0.
    pub damping: f64,
}

/// A contact of the shaft with the rim, or a near point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RimContact {
    /// The point of the rim, with the gap.
    pub at: RimPoint,
    /// Normal force, across the shaft.
    pub normal: ContactRow,
    /// Friction force, along the shaft.
    pub friction: ContactRow,
    /// Displacement of the shaft along its direction from the mark (m); 0 without contact.
    pub stretch: f64,
    /// Whether friction is at its limit.
    pub sliding: bool,
}

/// All contacts and near points of a shaft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contacts {
    all: [Option<RimContact>; 4],
}

impl Contacts {
    /// All of them, in contact or not.
    pub fn iter(&self) -> impl Iterator<Item = &RimContact> {
        self.all.iter().flatten()
    }

    /// Those in contact.
    pub fn touching(&self) -> impl Iterator<Item = &RimContact> {
        self.iter().filter(|c| c.at.gap < 0.0)
    }

    /// The minimum gap (m); `None` if the shaft is not in the port.
    pub fn gap(&self) -> Option<f64> {
        self.iter().map(|c| c.at.gap).reduce(f64::min)
    }

    /// Force (N) and torque about `point` (N m) of the rim on the shaft, in the cell.
    pub fn on_shaft(&self, point: DVec3) -> (DVec3, DVec3) {
        let rows = self.touching().flat_map(|c| [&c.normal, &c.friction]);
        rows.fold((DVec3::ZERO, DVec3::ZERO), |(force, torque), row| {
            let f = row.force * row.direction;
            (force + f, torque + (row.point - point).cross(f))
        })
    }
}

impl Port {
    /// The contacts of a shaft with the twist `motion` at its base, and their forces on it. The
    /// marks do not change; [`Port::advance`] updates them after a step.
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
            // A rim only pushes: damping must not hold a shaft that leaves it.
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

    /// Displacement of the shaft along its direction since the mark was set (m).
    fn stretch(&self, shaft: &Shaft, mark: &Mark) -> f64 {
        let edge = if mark.inner { Edge::Inner } else { Edge::Outer };
        mark.along - (self.rim(edge, mark.angle) - shaft.base).dot(shaft.direction)
    }

    /// Updates the marks after a step: those of sliding contacts follow, those of contacts that
    /// moved along the rim move with them, and those of lost contacts are removed.
    pub fn advance(&self, shaft: &Shaft, state: &mut RimState) {
        let before = *state;
        state.marks = self.nearest(shaft).map(|near| {
            let at = near.filter(|at| at.gap < 0.0)?;
            let most = -self.friction * self.stiffness * at.gap / self.friction_stiffness;
            let mark = before.mark_for(&at);
            let stretch = mark.map_or(0.0, |m| self.stretch(shaft, m));
            if let Some(mark) = mark
                && stretch.abs() <= most
                && turned(at.angle, mark.angle) < MARK_TOLERANCE
            {
                return Some(*mark);
            }
            let along = (at.point - shaft.base).dot(shaft.direction) + stretch.max(-most).min(most);
            Some(Mark { inner: at.edge == Edge::Inner, angle: at.angle, along })
        });
    }
}

impl RimState {
    /// The mark of the nearest contact on the same edge, unless it is on the other side of the
    /// hole.
    fn mark_for(&self, at: &RimPoint) -> Option<&Mark> {
        let same = self.marks.iter().flatten().filter(|m| m.inner == (at.edge == Edge::Inner));
        same.min_by(|a, b| turned(at.angle, a.angle).total_cmp(&turned(at.angle, b.angle)))
            .filter(|m| turned(at.angle, m.angle) < FRAC_PI_2)
    }
}

/// The difference of two angles, in [0, pi] (rad).
fn turned(a: f64, b: f64) -> f64 {
    ((a - b + PI).rem_euclid(TAU) - PI).abs()
}
