//! Tetrahedra and triangles cut by planes of the grid. Coordinates are in cells.

use glam::DVec3;

/// Four corners, in any order.
pub(crate) type Tet = [DVec3; 4];

/// Tetrahedra of less volume (cells) are dropped: it is not above the rounding of a flat one.
const MIN_VOLUME: f64 = 1e-15;

/// Volume of a tetrahedron (cells), positive.
pub(crate) fn volume([a, b, c, d]: &Tet) -> f64 {
    (*b - *a).cross(*c - *a).dot(*d - *a).abs() / 6.0
}

/// The point from `a` towards `b` by a share of the way. A coordinate that both have is kept to the
/// bit, so that points in a plane of the grid stay there.
fn between(a: DVec3, b: DVec3, share: f64) -> DVec3 {
    a + (b - a) * share
}

/// Cuts `tet` by the plane at `at` across `axis`. Appends the tetrahedra of both sides.
pub(crate) fn split(tet: &Tet, axis: usize, at: f64, below: &mut Vec<Tet>, above: &mut Vec<Tet>) {
    let height = tet.map(|p| p[axis] - at);
    let low: Vec<usize> = (0..4).filter(|i| height[*i] < 0.0).collect();
    let high: Vec<usize> = (0..4).filter(|i| height[*i] > 0.0).collect();
    if high.is_empty() {
        return below.push(*tet);
    }
    if low.is_empty() {
        return above.push(*tet);
    }
    let cut = |a: usize, b: usize| {
        let mut p = between(tet[a], tet[b], height[a] / (height[a] - height[b]));
        p[axis] = at;
        p
    };
    let cut_or_corner = |apex: usize, other: usize| if height[other] == 0.0 { tet[other] } else { cut(apex, other) };
    if let [a, b] = low[..]
        && let [c, d] = high[..]
    {
        let (ac, ad, bc, bd) = (cut(a, c), cut(a, d), cut(b, c), cut(b, d));
        prism([tet[a], ac, ad], [tet[b], bc, bd], below);
        return prism([tet[c], ac, bc], [tet[d], ad, bd], above);
    }
    // One corner lies alone on its side.
    let (apex, near, far) = if low.len() == 1 { (low[0], below, above) } else { (high[0], above, below) };
    let mut others = [0; 3];
    (0..4).filter(|i| *i != apex).zip(&mut others).for_each(|(i, other)| *other = i);
    let section = others.map(|other| cut_or_corner(apex, other));
    push([tet[apex], section[0], section[1], section[2]], near);
    prism(section, others.map(|other| tet[other]), far);
}

/// The three tetrahedra of a prism between two triangles with corresponding corners.
fn prism(p: [DVec3; 3], q: [DVec3; 3], out: &mut Vec<Tet>) {
    push([p[0], p[1], p[2], q[2]], out);
    push([p[0], p[1], q[1], q[2]], out);
    push([p[0], q[0], q[1], q[2]], out);
}

fn push(tet: Tet, out: &mut Vec<Tet>) {
    if volume(&tet) > MIN_VOLUME {
        out.push(tet);
    }
}

/// The section of a tetrahedron by a plane: a triangle, a quadrilateral, or nothing.
pub(crate) fn section(tet: &Tet, axis: usize, at: f64) -> Vec<DVec3> {
    let height = tet.map(|p| p[axis] - at);
    let mut points = Vec::with_capacity(4);
    let side = |low: bool| (0..4).filter(move |i| if low { height[*i] < 0.0 } else { height[*i] > 0.0 });
    points.extend((0..4).filter(|i| height[*i] == 0.0).map(|i| tet[i]));
    // In this order two low and two high corners give a quadrilateral without crossing sides.
    for (n, a) in side(true).enumerate() {
        let cut = |b: usize| {
            // Exactly in the plane: the section may lie in the side of a cell.
            let mut p = between(tet[a], tet[b], height[a] / (height[a] - height[b]));
            p[axis] = at;
            p
        };
        let mut cuts: Vec<DVec3> = side(false).map(cut).collect();
        if n % 2 == 1 {
            cuts.reverse();
        }
        points.extend(cuts);
    }
    points
}

/// Area of the part of a convex polygon inside the closed cell with lowest corner `cell`.
pub(crate) fn area_in_cell(polygon: &[DVec3], cell: DVec3) -> f64 {
    let mut points = polygon.to_vec();
    for axis in 0..3 {
        for (at, sign) in [(cell[axis], 1.0), (cell[axis] + 1.0, -1.0)] {
            let inside = |p: &DVec3| sign * (p[axis] - at);
            let mut kept = Vec::with_capacity(points.len() + 1);
            for (k, a) in points.iter().enumerate() {
                let b = &points[(k + 1) % points.len()];
                let (da, db) = (inside(a), inside(b));
                if da >= 0.0 {
                    kept.push(*a);
                }
                if (da < 0.0) != (db < 0.0) {
                    kept.push(between(*a, *b, da / (da - db)));
                }
            }
            points = kept;
        }
    }
    let Some(first) = points.first() else { return 0.0 };
    let sum: DVec3 = points.windows(2).map(|pair| (pair[0] - *first).cross(pair[1] - *first)).sum();
    0.5 * sum.length()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TET: Tet =
        [DVec3::new(0.1, 0.2, 0.0), DVec3::new(1.9, 0.3, 0.4), DVec3::new(0.5, 1.7, 0.2), DVec3::new(0.8, 0.6, 1.8)];

    #[test]
    fn both_sides_have_the_whole_volume() {
        for axis in 0..3 {
            for at in [0.0, 0.1, 0.2, 0.31, 0.5, 0.7, 1.0, 1.75, 1.8] {
                let (mut below, mut above) = (Vec::new(), Vec::new());
                split(&TET, axis, at, &mut below, &mut above);
                let sum: f64 = below.iter().chain(&above).map(volume).sum();
                assert!((sum - volume(&TET)).abs() < 1e-14, "axis {axis} at {at}");
                assert!(below.iter().flatten().all(|p| p[axis] <= at));
                assert!(above.iter().flatten().all(|p| p[axis] >= at));
            }
        }
    }

    /// The area of sections is the derivative of the volume below them.
    #[test]
    fn sections_are_the_derivative_of_the_volume() {
        let below = |axis: usize, at: f64| {
            let (mut below, mut above) = (Vec::new(), Vec::new());
            split(&TET, axis, at, &mut below, &mut above);
            below.iter().map(volume).sum::<f64>()
        };
        for axis in 0..3 {
            for at in [0.25, 0.45, 0.65, 1.1, 1.5] {
                // Clipped by nothing: four cells hold the whole section.
                let polygon = section(&TET, axis, at);
                let cells = (0..8).map(|c| DVec3::new((c & 1) as f64, (c >> 1 & 1) as f64, (c >> 2) as f64));
                let area: f64 = cells.filter(|c| c[axis] == at.floor()).map(|c| area_in_cell(&polygon, c)).sum();
                let slope = (below(axis, at + 1e-5) - below(axis, at - 1e-5)) / 2e-5;
                assert!((area - slope).abs() < 1e-6, "axis {axis} at {at}: {area}, {slope}");
            }
        }
    }
}
