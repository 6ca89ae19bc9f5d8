//! Where an instrument touches a solid, or may within a physics step.

use glam::DVec3;

/// Gap below which a touch is possible within a step (m): two tips at 0.1 m/s come nearer by 0.42
/// mm in one.
pub(super) const REACH: f64 = 5e-4;

/// A place where an instrument touches a solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::cell) struct Meeting {
    /// The place (m): midway between the two surfaces.
    pub point: DVec3,
    /// Unit vector in which the solid pushes the instrument.
    pub normal: DVec3,
    /// Distance of the surfaces (m), negative where they press.
    pub gap: f64,
    /// Depth at which the axis of the instrument's part would reach the solid's, or its surface
    /// (m).
    pub room: f64,
    /// The organ whose pinned tissue it is.
    pub organ: Option<usize>,
}

/// The deepest meeting of each rigid part of an instrument with each organ, and with the bed. A
/// part between two organs is pushed by both.
#[derive(Clone, Debug, Default)]
pub(super) struct Deepest(Vec<(usize, Meeting)>);

impl Deepest {
    /// Adds one of `part`, if it is near and deeper than those before.
    pub fn add(&mut self, part: usize, meeting: Meeting) {
        if meeting.gap >= REACH {
            return;
        }
        match self.0.iter_mut().find(|(other, known)| (*other, known.organ) == (part, meeting.organ)) {
            Some((_, known)) if known.gap <= meeting.gap => {}
            Some((_, known)) => *known = meeting,
            None => self.0.push((part, meeting)),
        }
    }

    /// They, in the order in which they were found first.
    pub fn into_iter(self) -> impl Iterator<Item = Meeting> {
        self.0.into_iter().map(|(_, meeting)| meeting)
    }
}
