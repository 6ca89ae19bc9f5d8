//! Where an instrument may be, and what the numbers of its arm mean there.

mod free;
mod port;

pub use free::FreeSpace;
pub use port::PortSpace;

use super::setpoint::{NUMBERS, Setpoint};
use crate::Result;
use glam::DVec3;
use trocar_core::Pose;

/// Where an instrument may be.
#[derive(Clone, Debug)]
pub enum Workspace {
    /// In the hole of a port: the shaft turns about its centre.
    Port(Box<PortSpace>),
    /// Anywhere in a box, the shaft always in the same direction.
    Free(FreeSpace),
}

/// The nearest that an instrument comes to a wanted pose of its tip frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reached {
    /// Its numbers there.
    pub setpoint: Setpoint,
    /// The tip frame there, in the cell.
    pub tip: Pose,
    /// Axis times angle (rad), in the cell, of the turn that is left to the wanted orientation.
    pub rejected_rotation: DVec3,
    /// What is left to the wanted place (m), in the cell.
    pub rejected_translation: DVec3,
    /// How far the wanted roll lies outside its limits (rad), by sign.
    pub roll_excess: f64,
}

impl Workspace {
    /// Names of the numbers.
    pub fn names(&self) -> [&'static str; NUMBERS] {
        match self {
            Self::Port(_) => ["first pivot", "second pivot", "insertion", "roll", "jaw"],
            Self::Free(_) => ["x", "y", "z", "roll", "jaw"],
        }
    }

    /// Least and greatest value of each number. Two pivots share a cone, so that the corners of
    /// their box are not reached; [`clamp`](Self::clamp) brings them back.
    pub fn bounds(&self) -> [[f64; 2]; NUMBERS] {
        match self {
            Self::Port(space) => space.bounds(),
            Self::Free(space) => space.bounds(),
        }
    }

    /// Says which number of absolute targets is out of range: its place, and what would be right.
    pub(super) fn check(&self, numbers: &[f64]) -> std::result::Result<(), (usize, String)> {
        match self {
            Self::Port(space) => space.check(numbers),
            Self::Free(space) => space.check(numbers),
        }
    }

    /// The nearest numbers within the limits.
    pub fn clamp(&self, wanted: &Setpoint) -> Setpoint {
        match self {
            Self::Port(space) => space.limits.clamp(&wanted.in_port()).0.into(),
            Self::Free(space) => space.clamp(wanted),
        }
    }

    /// The tip frame (origin at the jaw's pivot, x along the shaft) in the cell.
    pub fn tip(&self, at: &Setpoint) -> Pose {
        match self {
            Self::Port(space) => space.port.tip(&at.in_port()),
            Self::Free(space) => space.tip(at),
        }
    }

    /// The nearest that the instrument comes to a wanted pose of its tip frame. Of two rolls the
    /// one nearer to that of `near` is taken, and the jaw is that of `near`.
    ///
    /// # Errors
    /// A pose that is not finite or whose rotation has not length 1.
    pub fn solve(&self, tip: &Pose, near: &Setpoint) -> Result<Reached> {
        match self {
            Self::Port(space) => space.solve(tip, &near.in_port()),
            Self::Free(space) => space.solve(tip, near),
        }
    }

    /// The numbers on the way from `from` to `to` that can be commanded for the next `period` (s),
    /// and whether that is not all of the way.
    pub(super) fn paced(&self, from: &Setpoint, to: &Setpoint, period: f64) -> (Setpoint, bool) {
        match self {
            Self::Port(_) => port::paced(from, to, period),
            Self::Free(_) => free::paced(from, to, period),
        }
    }

    /// The same place, drawn back along the shaft until the tips of the closed blades are above the
    /// floor of the cell, and whether that was needed.
    pub(super) fn above_floor(&self, at: &Setpoint) -> (Setpoint, bool) {
        match self {
            Self::Port(space) => space.above_floor(at),
            Self::Free(_) => (*at, false),
        }
    }

    /// Direction of the shaft (unit vector towards the tip) with `point` ahead of it.
    pub fn direction_to(&self, point: DVec3) -> DVec3 {
        match self {
            Self::Port(space) => (point - space.port.centre()).normalize_or(-DVec3::Z),
            Self::Free(space) => space.direction,
        }
    }

    /// The same place, `by` (m) farther back along the shaft, as far as the limits let it.
    pub fn behind(&self, at: &Setpoint, by: f64) -> Setpoint {
        match self {
            Self::Port(space) => space.behind(at, by),
            Self::Free(space) => space.behind(at, by),
        }
    }

    /// The port, if there is one.
    pub fn as_port(&self) -> Option<&PortSpace> {
        match self {
            Self::Port(space) => Some(space),
            Self::Free(_) => None,
        }
    }
}
