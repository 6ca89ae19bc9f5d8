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
    /// Adds one of `part`, if it is near and deeper than those before with the same organ.
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

    /// The meetings. Parts and organs are in the order in which they met first.
    pub fn into_iter(self) -> impl Iterator<Item = Meeting> {
        self.0.into_iter().map(|(_, meeting)| meeting)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_meets_each_organ_at_its_deepest_place() {
        let meeting = |organ, gap| Meeting { point: DVec3::ZERO, normal: DVec3::X, gap, room: 1e-3, organ };
        let mut found = Deepest::default();
        for (part, organ, gap) in [
            (1, Some(0), -1e-4),
            (1, Some(3), -2e-4),
            (1, Some(0), -3e-4),
            (1, Some(3), 1e-4),
            (2, Some(0), 4e-4),
            (2, None, 1e-4),
            (0, Some(3), 1.0),
        ] {
            found.add(part, meeting(organ, gap));
        }
        let all: Vec<Meeting> = found.into_iter().collect();
        assert_eq!(
            all,
            [(Some(0), -3e-4), (Some(3), -2e-4), (Some(0), 4e-4), (None, 1e-4)].map(|(o, g)| meeting(o, g))
        );
    }
}
