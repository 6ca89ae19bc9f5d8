//! The clearance between two instruments. They do not push each other; a contact is reported.

use glam::DVec3;

/// A convex part that is all points within `radius` (m) of a segment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rod {
    pub ends: [DVec3; 2],
    pub radius: f64,
}

/// The smallest gap between two instruments' rods (m): negative if they overlap; infinite if one
/// has none.
pub(super) fn clearance(one: &[Rod], other: &[Rod]) -> f64 {
    let gap = |a: &Rod, b: &Rod| distance(&a.ends, &b.ends) - a.radius - b.radius;
    one.iter().flat_map(|a| other.iter().map(move |b| gap(a, b))).fold(f64::INFINITY, f64::min)
}

/// Distance of two segments (Ericson 2005, Real-Time Collision Detection, 5.1.9).
fn distance([p, p_end]: &[DVec3; 2], [q, q_end]: &[DVec3; 2]) -> f64 {
    let (u, v, r) = (*p_end - *p, *q_end - *q, *p - *q);
    let (a, e) = (u.length_squared(), v.length_squared());
    let (b, c, f) = (u.dot(v), u.dot(r), v.dot(r));
    let least = f64::MIN_POSITIVE;
    let span = a * e - b * b;
    // Parallel segments: any share of the first is right; the clamps find the other.
    let mut s = if span > 1e-12 * a * e { ((b * f - c * e) / span).clamp(0.0, 1.0) } else { 0.0 };
    let t = (b * s + f) / e.max(least);
    // If the second segment is a point, it has no share.
    if !(0.0..=1.0).contains(&t) || e < least {
        s = ((b * t.clamp(0.0, 1.0) - c) / a.max(least)).clamp(0.0, 1.0);
    }
    (r + s * u - t.clamp(0.0, 1.0) * v).length()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_those_of_the_nearest_points() {
        let rod = |from: [f64; 3], to: [f64; 3], radius| Rod { ends: [from.into(), to.into()], radius };
        let along = rod([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 0.1);
        let gap = |other: Rod| clearance(&[along], &[other]);
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(near(gap(rod([0.5, -1.0, 0.5], [0.5, 1.0, 0.5], 0.1)), 0.3), "crossing");
        assert!(near(gap(rod([0.2, 0.4, 0.0], [3.0, 0.4, 0.0], 0.0)), 0.3), "parallel");
        assert!(near(gap(rod([-5.0, 0.4, 0.0], [-1.0, 0.4, 0.0], 0.0)), 1.0f64.hypot(0.4) - 0.1), "end to end");
        assert!(gap(rod([0.5, 0.0, 0.05], [0.5, 0.0, 1.0], 0.0)) < 0.0, "one in the other");
        assert!(near(gap(rod([2.0, 0.0, 0.0], [2.0, 0.0, 0.0], 0.0)), 0.9), "a point");
        assert_eq!(clearance(&[along], &[]), f64::INFINITY);
        // Against many points of both.
        let other = rod([0.3, 0.9, -0.4], [1.7, 0.2, 0.6], 0.0);
        let at = |r: &Rod, k: u32| r.ends[0].lerp(r.ends[1], f64::from(k) / 400.0);
        let pairs = (0..=400).flat_map(|i| (0..=400).map(move |k| (i, k)));
        let sampled = pairs.map(|(i, k)| at(&along, i).distance(at(&other, k))).fold(f64::INFINITY, f64::min);
        assert!((gap(other) + 0.1 - sampled).abs() < 1e-3);
    }
}
