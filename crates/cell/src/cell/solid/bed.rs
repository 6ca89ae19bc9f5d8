//! The bed: a horizontal plane below the organs.
//!
//! It is at the height of the lowest tissue, and only instruments in ports meet it: the commands of
//! these stay above it, too. Free instruments are for tissue alone, and reach around an organ that
//! would lie on the bed. A part whose axis is below the bed already is not pushed.

use super::meeting::{Deepest, Meeting};
use super::rod::Rod;
use glam::DVec3;

/// Adds the meetings of `rods` with the bed at `height` (m).
pub(super) fn meet(height: f64, rods: &[Rod], found: &mut Deepest) {
    for rod in rods {
        let [one, other] = rod.ends;
        let low = if one.z < other.z { one } else { other };
        let above = low.z - height;
        if above > 0.0 {
            let gap = above - rod.radius;
            let point = DVec3 { z: height + 0.5 * gap, ..low };
            found.add(rod.part, Meeting { point, normal: DVec3::Z, gap, room: rod.radius, organ: None });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lower_end_stands_on_the_bed_unless_it_is_below() {
        let rod =
            |low: f64| Rod { ends: [DVec3::new(0.1, 0.2, 0.5), DVec3::new(0.0, 0.0, low)], radius: 2e-3, part: 1 };
        let met = |low: f64| {
            let mut found = Deepest::default();
            meet(0.01, &[rod(low)], &mut found);
            found.into_iter().next()
        };
        let pressed = met(0.0115).unwrap();
        assert!((pressed.gap + 5e-4).abs() < 1e-12 && pressed.normal == DVec3::Z && pressed.room == 2e-3);
        assert!((pressed.point.z - 0.00975).abs() < 1e-12, "{pressed:?}");
        assert!(met(0.0099).is_none(), "its axis is below");
        assert!(met(0.02).is_none(), "it is too far");
    }
}
