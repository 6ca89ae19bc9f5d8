//! The convex parts of an instrument, and the clearance between two instruments.

use glam::DVec3;
use trocar_geometry::nearest_of_segments;

/// A convex part that is all points within `radius` (m) of a segment.
#[derive(Clone, Copy, Debug)]
pub(in crate::cell) struct Rod {
    pub ends: [DVec3; 2],
    pub radius: f64,
    /// The rigid part that it belongs to: 0 for the shaft, 1 and 2 for the blades.
    pub part: usize,
}

/// Number of rigid parts of an instrument.
pub(super) const PARTS: usize = 3;

/// The smallest gap between two instruments' rods (m): negative if they overlap; infinite if one
/// has none.
pub(in crate::cell) fn clearance(one: &[Rod], other: &[Rod]) -> f64 {
    let gap = |a: &Rod, b: &Rod| distance(&a.ends, &b.ends) - a.radius - b.radius;
    one.iter().flat_map(|a| other.iter().map(move |b| gap(a, b))).fold(f64::INFINITY, f64::min)
}

/// Distance of two segments (m).
fn distance(one: &[DVec3; 2], other: &[DVec3; 2]) -> f64 {
    let [s, t] = nearest_of_segments(*one, *other);
    (one[0] - other[0] + s * (one[1] - one[0]) - t * (other[1] - other[0])).length()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_those_of_the_nearest_points() {
        let rod = |from: [f64; 3], to: [f64; 3], radius| Rod { ends: [from.into(), to.into()], radius, part: 0 };
        let along = rod([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 0.1);
        let gap = |other: Rod| clearance(&[along], &[other]);
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(near(gap(rod([0.5, -1.0, 0.5], [0.5, 1.0, 0.5], 0.1)), 0.3), "crossing");
        assert!(near(gap(rod([0.2, 0.4, 0.0], [3.0, 0.4, 0.0], 0.0)), 0.3), "parallel");
        assert!(near(gap(rod([-5.0, 0.4, 0.0], [-1.0, 0.4, 0.0], 0.0)), 1.0f64.hypot(0.4) - 0.1), "end to end");
        assert!(gap(rod([0.5, 0.0, 0.05], [0.5, 0.0, 1.0], 0.0)) < 0.0, "one in the other");
        assert!(near(gap(rod([2.0, 0.0, 0.0], [2.0, 0.0, 0.0], 0.0)), 0.9), "a point");
        assert_eq!(clearance(&[along], &[]), f64::INFINITY);
    }
}
