//! The bed: a horizontal plane below the organs.
//!
//! It is at the height of the lowest tissue. A part whose axis is below it already is not pushed:
//! the bed has no inside.

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
            found.add(rod.part, Meeting { point, normal: DVec3::Z, gap, room: rod.radius });
        }
    }
}
