//! Where two segments are nearest to each other.

use glam::DVec3;

/// Squared sine of the angle below which segments are parallel.
const PARALLEL: f64 = 1e-12;

/// Where the segments from `p` to `q` and from `a` to `b` are nearest to each other: the share of
/// each at that place, in 0..=1 (Ericson 2005, "Real-Time Collision Detection", 5.1.9). Of parallel
/// segments it is the middle of the parts that are beside each other. A segment may be a point.
pub fn nearest_of_segments([p, q]: [DVec3; 2], [a, b]: [DVec3; 2]) -> [f64; 2] {
    let (u, v, r) = (q - p, b - a, p - a);
    let (uu, vv, uv) = (u.length_squared(), v.length_squared(), u.dot(v));
    let (c, f) = (u.dot(r), v.dot(r));
    let least = f64::MIN_POSITIVE;
    let of_second = |t: f64| ((uv * t - c) / uu.max(least)).clamp(0.0, 1.0);
    let span = uu * vv - uv * uv;
    let s = if span > PARALLEL * uu * vv {
        ((uv * f - c * vv) / span).clamp(0.0, 1.0)
    } else {
        0.5 * (of_second(0.0) + of_second(1.0))
    };
    let t = (uv * s + f) / vv.max(least);
    // If the second segment is a point, it has no share.
    let outside = !(0.0..=1.0).contains(&t) || vv < least;
    let t = t.clamp(0.0, 1.0);
    [if outside { of_second(t) } else { s }, t]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_those_of_the_nearest_points() {
        let near = |one: [[f64; 3]; 2], other: [[f64; 3]; 2]| {
            nearest_of_segments(one.map(DVec3::from_array), other.map(DVec3::from_array))
        };
        let along = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]];
        assert_eq!(near(along, [[0.25, -1.0, 0.5], [0.25, 1.0, 0.5]]), [0.25, 0.5], "crossing");
        assert_eq!(near(along, [[0.5, 0.4, 0.0], [1.5, 0.4, 0.0]]), [0.75, 0.25], "parallel: the middle");
        assert_eq!(near(along, [[-5.0, 0.4, 0.0], [-1.0, 0.4, 0.0]]), [0.0, 1.0], "end to end");
        assert_eq!(near(along, [[0.5, 2.0, 0.0]; 2])[0], 0.5, "a point");
        assert_eq!(near([[0.5, 2.0, 0.0]; 2], along)[1], 0.5, "the other is a point");
        // Against many points of both.
        let (one, other) = (along.map(DVec3::from_array), [DVec3::new(0.3, 0.9, -0.4), DVec3::new(1.7, 0.2, 0.6)]);
        let at = |[p, q]: [DVec3; 2], share: f64| p.lerp(q, share);
        let [s, t] = nearest_of_segments(one, other);
        let pairs = (0..=400).flat_map(|i| (0..=400).map(move |k| (f64::from(i) / 400.0, f64::from(k) / 400.0)));
        let sampled = pairs.map(|(s, t)| at(one, s).distance(at(other, t))).fold(f64::INFINITY, f64::min);
        let found = at(one, s).distance(at(other, t));
        assert!(found <= sampled + 1e-12 && found > sampled - 1e-3);
    }
}
