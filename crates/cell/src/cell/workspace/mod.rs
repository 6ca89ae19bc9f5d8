//! The workspace of an instrument, and the meaning of its arm's numbers.

mod free;
mod port;

pub use free::FreeSpace;
pub use port::PortSpace;

use super::setpoint::{NUMBERS, Setpoint};
use crate::Result;
use glam::DVec3;
use trocar_core::Pose;

/// The workspace of an instrument.
#[derive(Clone, Debug)]
pub enum Workspace {
    /// Through a port: the shaft turns about its centre.
    Port(Box<PortSpace>),
    /// In a box, with the shaft always in the same direction.
    Free(FreeSpace),
}

/// The reachable pose nearest to a wanted pose of the tip frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reached {
    /// The arm's numbers there.
    pub setpoint: Setpoint,
    /// The tip frame there, in the cell.
    pub tip: Pose,
    /// The rejected part of the wanted orientation: axis times angle (rad), in the cell.
    pub rejected_rotation: DVec3,
    /// The rejected part of the wanted position (m), in the cell.
    pub rejected_translation: DVec3,
    /// Signed distance of the wanted roll from its limits (rad); 0 within them.
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

    /// Least and greatest value of each number. The two pivots are limited by a cone, so the
    /// corners of their box are out of reach; [`clamp`](Self::clamp) moves them inside.
    pub fn bounds(&self) -> [[f64; 2]; NUMBERS] {
        match self {
            Self::Port(space) => space.bounds(),
            Self::Free(space) => space.bounds(),
        }
    }

    /// Finds a number of absolute targets that is out of range: its index, and what would be right.
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

    /// The reachable pose nearest to a wanted pose of the tip frame. There are two possible rolls,
    /// and the one nearer to that of `near` is chosen. The jaw is that of `near`.
    ///
    /// # Errors
    /// A pose that is not finite, or whose rotation is not normalized.
    pub fn solve(&self, tip: &Pose, near: &Setpoint) -> Result<Reached> {
        match self {
            Self::Port(space) => space.solve(tip, &near.in_port()),
            Self::Free(space) => space.solve(tip, near),
        }
    }

    /// The numbers on the way from `from` to `to` that are possible in the next `period` (s), and
    /// whether the way is longer.
    pub(super) fn paced(&self, from: &Setpoint, to: &Setpoint, period: f64) -> (Setpoint, bool) {
        match self {
            Self::Port(_) => port::paced(from, to, period),
            Self::Free(_) => free::paced(from, to, period),
        }
    }

    /// The position retracted along the shaft until the tips of the closed blades are above the
    /// cell's floor, and whether that was needed.
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

    /// The position retracted by `by` (m) along the shaft, within the limits.
    pub fn behind(&self, at: &Setpoint, by: f64) -> Setpoint {
        match self {
            Self::Port(space) => space.behind(at, by),
            Self::Free(space) => space.behind(at, by),
        }
    }

    /// The port, if any.
    pub fn as_port(&self) -> Option<&PortSpace> {
        match self {
            Self::Port(space) => Some(space),
            Self::Free(_) => None,
        }
    }
}
