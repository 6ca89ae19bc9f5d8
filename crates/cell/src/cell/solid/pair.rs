//! Where two instruments meet: the deepest place of each pair of their rigid parts.

use super::meeting::{Meeting, REACH};
use super::rod::{PARTS, Rod};
use trocar_geometry::nearest_of_segments;

/// Axes that are nearer (m) have no direction between them.
const LEAST_DISTANCE: f64 = 1e-9;

/// The meetings of `one` with `other`, as `one` is pushed.
pub(super) fn meetings(one: &[Rod], other: &[Rod]) -> impl Iterator<Item = Meeting> + use<> {
    let mut deepest: [Option<Meeting>; PARTS * PARTS] = [None; PARTS * PARTS];
    for a in one {
        for b in other {
            let now = &mut deepest[PARTS * a.part + b.part];
            if let Some(meeting) = meeting(a, b)
                && meeting.gap < now.map_or(REACH, |m| m.gap)
            {
                *now = Some(meeting);
            }
        }
    }
    deepest.into_iter().flatten()
}

fn meeting(a: &Rod, b: &Rod) -> Option<Meeting> {
    let [s, t] = nearest_of_segments(a.ends, b.ends);
    let (p, q) = (a.ends[0].lerp(a.ends[1], s), b.ends[0].lerp(b.ends[1], t));
    let (way, room) = (p - q, a.radius + b.radius);
    let distance = way.length();
    if distance < LEAST_DISTANCE {
        return None;
    }
    let normal = way / distance;
    let gap = distance - room;
    Some(Meeting { point: q + (b.radius + 0.5 * gap) * normal, normal, gap, room, organ: None })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn each_pair_of_parts_meets_at_its_deepest_place() {
        let rod =
            |x: f64, z: f64, part| Rod { ends: [DVec3::new(x, -1.0, z), DVec3::new(x, 1.0, z)], radius: 2e-3, part };
        let across = |z: f64| Rod { ends: [DVec3::new(-1.0, 0.0, z), DVec3::new(1.0, 0.0, z)], radius: 3e-3, part: 0 };
        let one = [rod(0.0, 4.5e-3, 1), rod(1e-3, 4e-3, 1), rod(0.1, 5.4e-3, 2)];
        let found: Vec<Meeting> = meetings(&one, &[across(0.0)]).collect();
        let [deep, near] = found[..] else { panic!("{found:?}") };
        assert!(
            (deep.gap + 1e-3).abs() < 1e-12 && deep.normal.distance(DVec3::Z) < 1e-9 && deep.room == 5e-3,
            "{deep:?}"
        );
        assert!(deep.point.distance(DVec3::new(1e-3, 0.0, 2.5e-3)) < 1e-12, "{deep:?}");
        assert!((near.gap - 4e-4).abs() < 1e-12, "{near:?}");
        assert_eq!(meetings(&one, &[across(-0.1)]).count(), 0);
        assert_eq!(meetings(&[across(0.0)], &[rod(0.0, 0.0, 0)]).count(), 0, "axes that cross have no normal");
    }
}
