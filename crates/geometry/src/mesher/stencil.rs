//! Stencils: filling a lattice tet that crosses the surface.
//!
//! The inside part of the tet is a tet, a pyramid or a triangular prism. Its corners are the tet's
//! inside corners, the tet's corners on the surface and the cut points of its edges. Neighbours
//! share the quadrilateral faces of pyramids and prisms and must split them along the same
//! diagonal. So the choice depends only on the face.

use super::points::Point;

/// Location of a corner of the tet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Side {
    Inside,
    Surface,
    Outside,
}

/// A corner of a resulting tet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Corner {
    /// Corner 0, 1, 2 or 3 of the lattice tet.
    Point(usize),
    /// The cut point on the edge from an inside to an outside corner.
    Cut(usize, usize),
}

/// Fills the inside of a positive lattice tet, whose long edges are (0, 1) and (2, 3), with
/// positive tets.
pub(super) fn fill(points: &[Point; 4], sides: &[Side; 4], mut emit: impl FnMut([Corner; 4])) {
    use Corner::{Cut, Point};
    let mut corners = [[0; 4]; 3];
    let mut counts = [0; 3];
    for (i, &side) in sides.iter().enumerate() {
        let kind = side as usize;
        corners[kind][counts[kind]] = i;
        counts[kind] += 1;
    }
    let [inside, surface, outside] = corners;
    let mut emit = |tet: [Corner; 4]| emit(positive(points, tet));
    match counts {
        [0, ..] => {}
        [_, _, 0] => emit([0, 1, 2, 3].map(Point)),
        [1, zeros, _] => {
            // The inside corner, the surface corners, and a cut point for each outside corner.
            let a = inside[0];
            let rest = [0, 1, 2].map(|i| if i < zeros { Point(surface[i]) } else { Cut(a, outside[i - zeros]) });
            emit([Point(a), rest[0], rest[1], rest[2]]);
        }
        [2, 1, _] => {
            let ([a, b], c) = ([inside[0], inside[1]], outside[0]);
            let apex = Point(surface[0]);
            // Quadrilateral a, b, bc, ac with the diagonal at a or at b.
            let (at, other) = if diagonal_at_first(points, a, b, c) { (a, b) } else { (b, a) };
            emit([apex, Point(at), Point(other), Cut(other, c)]);
            emit([apex, Point(at), Cut(other, c), Cut(at, c)]);
        }
        [2, ..] => {
            let ([a, b], [c, d]) = ([inside[0], inside[1]], [outside[0], outside[1]]);
            let (first, second) = (diagonal_at_first(points, a, b, c), diagonal_at_first(points, a, b, d));
            // The third quadrilateral is the surface itself. The rules above always give one
            // diagonal at `a` and one at `b`. Only this choice of the third avoids a cycle of the
            // three, which cannot be filled.
            prism([Point(a), Cut(a, c), Cut(a, d)], [Point(b), Cut(b, c), Cut(b, d)], [first, second, second], emit);
        }
        [_, ..] => {
            let ([a, b, c], d) = ([inside[0], inside[1], inside[2]], outside[0]);
            let diagonals = [(a, b), (a, c), (b, c)].map(|(i, j)| diagonal_at_first(points, i, j, d));
            prism([a, b, c].map(Point), [a, b, c].map(|i| Cut(i, d)), diagonals, emit);
        }
    }
}

/// Whether the diagonal from a (otherwise the one from b) splits the quadrilateral a, b, cut(b, c),
/// cut(a, c) of inside corners a and b and outside corner c.
///
/// Every lattice triangle has one long and two short edges. If a cut edge is the long one, the
/// diagonal ends at its cut point. If both are short, the parity rule of Labelle and Shewchuk
/// (2007), section 3.2, decides: for the neighbours a and b along an axis, the number of
/// coordinates that exceed those of c is even for one and odd for the other.
fn diagonal_at_first(points: &[Point; 4], a: usize, b: usize, c: usize) -> bool {
    let long = |i: usize, j: usize| i / 2 == j / 2;
    if long(a, b) { (0..3).filter(|&axis| points[a][axis] > points[c][axis]).count() % 2 == 0 } else { long(b, c) }
}

/// Splits a prism between the triangles `a` and `b` into three tets. `diagonals` states for the
/// quadrilaterals over (0, 1), (0, 2) and (1, 2) whether the diagonal starts at the first of the
/// two in `a` and ends at the second in `b`.
fn prism(a: [Corner; 3], b: [Corner; 3], diagonals: [bool; 3], mut emit: impl FnMut([Corner; 4])) {
    // Number of diagonals that start at each corner of `a`. Without a cycle these are 2, 1 and 0.
    let starts = [
        usize::from(diagonals[0]) + usize::from(diagonals[1]),
        usize::from(!diagonals[0]) + usize::from(diagonals[2]),
        usize::from(!diagonals[1]) + usize::from(!diagonals[2]),
    ];
    let mut order = [0, 1, 2];
    order.sort_unstable_by_key(|&i| std::cmp::Reverse(starts[i]));
    let [u, v, w] = order;
    emit([a[u], b[u], b[v], b[w]]);
    emit([a[u], a[v], b[v], b[w]]);
    emit([a[u], a[v], a[w], b[w]]);
}

/// Orders the corners for a positive tet. The sign is that of the undeformed lattice with cut
/// points in the middle of edges, in integers. Moves and cuts within their limits never invert a
/// tet.
fn positive(points: &[Point; 4], mut tet: [Corner; 4]) -> [Corner; 4] {
    let twice = |corner: Corner| match corner {
        Corner::Point(i) => points[i].map(|c| 2 * c),
        Corner::Cut(i, j) => [0, 1, 2].map(|axis| points[i][axis] + points[j][axis]),
    };
    let origin = twice(tet[0]);
    let [b, c, d] = [1, 2, 3].map(|k| {
        let p = twice(tet[k]);
        [0, 1, 2].map(|axis| p[axis] - origin[axis])
    });
    let determinant =
        b[0] * (c[1] * d[2] - c[2] * d[1]) + b[1] * (c[2] * d[0] - c[0] * d[2]) + b[2] * (c[0] * d[1] - c[1] * d[0]);
    if determinant < 0 {
        tet.swap(2, 3);
    }
    tet
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With every cut in the middle of its edge, each of the 81 patterns must fill exactly the
    /// inside volume.
    #[test]
    fn every_pattern_fills_its_volume() {
        let points: [Point; 4] = [[1, 1, 1], [3, 1, 1], [2, 0, 0], [2, 2, 0]];
        let sides = [Side::Inside, Side::Surface, Side::Outside];
        let at = |corner: Corner| match corner {
            Corner::Point(i) => glam::IVec3::from(points[i]).as_dvec3(),
            Corner::Cut(i, j) => (glam::IVec3::from(points[i]) + glam::IVec3::from(points[j])).as_dvec3() / 2.0,
        };
        for pattern in 0..81usize {
            let sides = [1, 3, 9, 27].map(|d| sides[pattern / d % 3]);
            let mut share = 0.0;
            fill(&points, &sides, |tet| {
                let [a, b, c, d] = tet.map(at);
                let volume = (b - a).cross(c - a).dot(d - a);
                assert!(volume > 1e-9, "{sides:?}: {tet:?}");
                share += volume / 4.0;
            });
            let count = |side| sides.iter().filter(|&&s| s == side).count();
            // The tet scaled by 1/2 at a corner has 1/8 of the volume. Each corner on the surface
            // doubles it.
            let expected = match (count(Side::Inside), count(Side::Surface), count(Side::Outside)) {
                (0, ..) => 0.0,
                (_, _, 0) => 1.0,
                (1, zeros, _) => 0.125 * f64::from(1 << zeros),
                (2, 1, _) => 0.75,
                (2, ..) => 0.5,
                _ => 0.875,
            };
            assert!((share - expected).abs() < 1e-12, "{sides:?}: {share} instead of {expected}");
        }
    }
}
