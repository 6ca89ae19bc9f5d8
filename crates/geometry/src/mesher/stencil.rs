//! What is left of a lattice tetrahedron inside the surface.
//!
//! Corners are inside (-), on the surface (0) or outside (+). An edge from - to + has a cut point. What remains is nothing, the whole element,
//! a smaller tetrahedron, a pyramid, or a prism with triangular ends; the last two have quadrilateral sides that lie on faces of the lattice, and
//! both elements at such a face must cut it along the same diagonal. Labelle and Shewchuk 2007, section 3.2.

/// Side of the surface a corner is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    /// Negative distance.
    Inside,
    /// On the surface.
    Surface,
    /// Positive distance.
    Outside,
}

/// What the stencils ask of the lattice.
pub(super) trait Lattice {
    /// Side of a lattice point.
    fn side(&self, point: usize) -> Side;
    /// Mesh node of a lattice point that is kept.
    fn node(&mut self, point: usize) -> u32;
    /// Mesh node of the cut point on the edge between an inside and an outside point.
    fn cut(&mut self, inside: usize, outside: usize) -> u32;
    /// On the face (p, q, outside): whether the quadrilateral p, q, cut(q), cut(p) is split from p to cut(q), not from q to cut(p).
    fn splits_from_first(&self, p: usize, q: usize, outside: usize) -> bool;
    /// Whether the diagonal (a, b) is shorter than (c, d).
    fn shorter(&self, ab: (u32, u32), cd: (u32, u32)) -> bool;
}

/// Even permutations that bring corner k to the front.
const FRONT: [[usize; 4]; 4] = [[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]];

/// Adds what remains of the positive element `tet` (lattice points) to `out`, positively oriented.
pub(super) fn fill(lattice: &mut impl Lattice, tet: [usize; 4], out: &mut Vec<[u32; 4]>) {
    let sides = tet.map(|p| lattice.side(p));
    let count = |side| sides.iter().filter(|s| **s == side).count();
    match (count(Side::Inside), count(Side::Outside)) {
        (0, _) => {}
        (_, 0) => out.push(tet.map(|p| lattice.node(p))),
        (1, _) => {
            let [a, others @ ..] = bring_front(tet, &sides, Side::Inside);
            let mut corner = |p| match lattice.side(p) {
                Side::Outside => lattice.cut(a, p),
                _ => lattice.node(p),
            };
            let [b, c, d] = others.map(&mut corner);
            out.push([lattice.node(a), b, c, d]);
        }
        (2, 1) => {
            // A pyramid: the surface corner z over the quadrilateral a, b, cut(b), cut(a).
            let [z, mut others @ ..] = bring_front(tet, &sides, Side::Surface);
            while lattice.side(others[2]) != Side::Outside {
                others.rotate_left(1);
            }
            let [a, b, d] = others;
            let first = lattice.splits_from_first(a, b, d);
            let (na, nb, nz) = (lattice.node(a), lattice.node(b), lattice.node(z));
            let (ca, cb) = (lattice.cut(a, d), lattice.cut(b, d));
            if first {
                out.extend([[nz, na, nb, cb], [nz, na, cb, ca]]);
            } else {
                out.extend([[nz, na, nb, ca], [nz, nb, cb, ca]]);
            }
        }
        (2, _) => {
            let mut t = bring_front(tet, &sides, Side::Inside);
            while lattice.side(t[1]) != Side::Inside {
                t = [t[0], t[2], t[3], t[1]];
            }
            let [a, b, c, d] = t;
            let on_abc = lattice.splits_from_first(a, b, c);
            let on_abd = !lattice.splits_from_first(a, b, d);
            let bottom = [lattice.node(a), lattice.cut(a, c), lattice.cut(a, d)];
            let top = [lattice.node(b), lattice.cut(b, c), lattice.cut(b, d)];
            // The third side lies on the surface: free, unless the other two leave only one choice.
            let on_surface =
                if on_abc == on_abd { !on_abc } else { lattice.shorter((bottom[1], top[2]), (bottom[2], top[1])) };
            prism(bottom, top, [on_abc, on_surface, on_abd], out);
        }
        _ => {
            let [d, a, c, b] = bring_front(tet, &sides, Side::Outside);
            let diagonals = [(a, b), (b, c), (c, a)].map(|(p, q)| lattice.splits_from_first(p, q, d));
            let bottom = [a, b, c].map(|p| lattice.node(p));
            let top = [a, b, c].map(|p| lattice.cut(p, d));
            prism(bottom, top, diagonals, out);
        }
    }
}

/// The element's corners, evenly permuted so that the first is on `side`.
fn bring_front(tet: [usize; 4], sides: &[Side; 4], side: Side) -> [usize; 4] {
    let k = sides.iter().position(|s| *s == side).unwrap_or(0);
    FRONT[k].map(|k| tet[k])
}

/// Splits the prism between triangle `v` and triangle `w` (which lies on the positive side of `v`) into three tetrahedra. Side k, between
/// corners k and k+1, is split along v(k)-w(k+1) if `diagonals[k]`, else along v(k+1)-w(k); not all three may be the same.
fn prism(mut v: [u32; 3], mut w: [u32; 3], mut diagonals: [bool; 3], out: &mut Vec<[u32; 4]>) {
    debug_assert!(diagonals.contains(&true) && diagonals.contains(&false), "a prism cannot be split around a circle");
    // Turn the prism until two diagonals meet at v[0].
    while !diagonals[0] || diagonals[2] {
        v.rotate_left(1);
        w.rotate_left(1);
        diagonals.rotate_left(1);
    }
    out.push([w[0], w[2], w[1], v[0]]);
    if diagonals[1] {
        out.extend([[v[0], v[1], v[2], w[2]], [v[0], v[1], w[2], w[1]]]);
    } else {
        out.extend([[v[0], v[1], v[2], w[1]], [v[0], w[1], v[2], w[2]]]);
    }
}
