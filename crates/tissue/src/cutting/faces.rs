//! Which faces a cut opens: those between elements on different sides of it, after the sides are
//! smoothed.

use super::Cut;
use glam::DVec3;
use trocar_geometry::TetMesh;

/// A piece of fewer elements is not separated.
const MIN_PIECE_ELEMENTS: usize = 4;

/// Greatest number of passes over the elements; a few are enough.
const MAX_PASSES: usize = 64;

/// The faces of a mesh and which of them are open.
pub(super) struct Opened {
    /// For each element and corner, the element across the opposite face.
    pub neighbours: Vec<[Option<u32>; 4]>,
    /// Whether that face opens; never for a face of the boundary.
    pub open: Vec<[bool; 4]>,
    /// Whether each element is on the side that the normal points to.
    pub above: Vec<bool>,
}

/// Whether each element of `mesh`, its nodes at `x` (m, world), is on the side of `cut` that its
/// normal points to, after the sides are smoothed.
pub(super) fn sides(mesh: &TetMesh, x: &[DVec3], cut: &Cut) -> Vec<bool> {
    let height: Vec<f64> = x.iter().map(|x| (x - cut.point).dot(cut.normal)).collect();
    let above = mesh.tets.iter().map(|tet| tet.map(|i| height[i as usize]).iter().sum::<f64>() > 0.0).collect();
    let mut sides = Sides { mesh, x, cut, neighbours: mesh.neighbours(), above };
    sides.smooth(&height);
    sides.keep_crumbs();
    sides.above
}

/// Finds the faces of `mesh`, its nodes at `x` (m, world), that `cut` opens in `part` of its
/// rectangle: from and to along its direction, from its middle (m). `above` has the elements'
/// sides.
pub(super) fn open(mesh: &TetMesh, x: &[DVec3], cut: &Cut, part: [f64; 2], above: &[bool]) -> Opened {
    let sides = Sides { mesh, x, cut, neighbours: mesh.neighbours(), above: above.to_vec() };
    let in_part = |t: usize, k: usize| {
        let [a, b, c] = sides.face(t, k);
        let along = ((a + b + c) / 3.0 - cut.point).dot(cut.along);
        (part[0]..=part[1]).contains(&along)
    };
    let open = |t: usize| [0, 1, 2, 3].map(|k| sides.is_open(t, k) && in_part(t, k));
    let open = (0..mesh.tets.len()).map(open).collect();
    Opened { neighbours: sides.neighbours, open, above: sides.above }
}

struct Sides<'a> {
    mesh: &'a TetMesh,
    x: &'a [DVec3],
    cut: &'a Cut,
    neighbours: Vec<[Option<u32>; 4]>,
    above: Vec<bool>,
}

impl Sides<'_> {
    /// Corners of the face of element `t` opposite its corner `k`, in an order that both its
    /// elements agree on: their sums are the same to the bit.
    fn face(&self, t: usize, k: usize) -> [DVec3; 3] {
        let tet = self.mesh.tets[t];
        let mut nodes = [tet[(k + 1) % 4], tet[(k + 2) % 4], tet[(k + 3) % 4]];
        nodes.sort_unstable();
        nodes.map(|i| self.x[i as usize])
    }

    fn area(&self, t: usize, k: usize) -> f64 {
        let [a, b, c] = self.face(t, k);
        0.5 * (b - a).cross(c - a).length()
    }

    fn is_open(&self, t: usize, k: usize) -> bool {
        let Some(other) = self.neighbours[t][k] else { return false };
        if self.above[t] == self.above[other as usize] {
            return false;
        }
        let [a, b, c] = self.face(t, k);
        self.cut.reaches((a + b + c) / 3.0)
    }

    fn has_open(&self, t: usize) -> bool {
        (0..4).any(|k| self.is_open(t, k))
    }

    /// Changes the sides of elements that the plane passes through where less of their surface is
    /// open then. Every change makes the cut smaller, and only those elements may change: a cut
    /// does not wander along a tapering organ.
    fn smooth(&mut self, height: &[f64]) {
        let crossed = |tet: &[u32; 4]| {
            let side = |i: u32| height[i as usize] > 0.0;
            tet.iter().any(|i| side(*i) != side(tet[0]))
        };
        let crossed: Vec<usize> = (0..self.mesh.tets.len()).filter(|t| crossed(&self.mesh.tets[*t])).collect();
        for _ in 0..MAX_PASSES {
            let mut changed = false;
            for &t in &crossed {
                let (mut open, mut joined) = (0.0, 0.0);
                for k in (0..4).filter(|k| self.neighbours[t][*k].is_some()) {
                    let sum = if self.is_open(t, k) { &mut open } else { &mut joined };
                    *sum += self.area(t, k);
                }
                // Not for rounding's sake.
                if open > joined * (1.0 + 1e-9) {
                    self.above[t] = !self.above[t];
                    changed = true;
                }
            }
            if !changed {
                break;
            }
        }
    }

    /// Gives pieces of too few elements to the side with which they share more area. Each joins a
    /// neighbour by it and opens no face, so this ends.
    fn keep_crumbs(&mut self) {
        for _ in 0..MAX_PASSES {
            let mut changed = false;
            for t in 0..self.mesh.tets.len() {
                if !self.has_open(t) {
                    continue;
                }
                let Some(crumb) = self.crumb(t) else { continue };
                let (mut to_above, mut to_below) = (0.0, 0.0);
                for &t in &crumb {
                    for k in (0..4).filter(|k| self.is_open(t, *k)) {
                        let sum = if self.above[t] { &mut to_below } else { &mut to_above };
                        *sum += self.area(t, k);
                    }
                }
                crumb.iter().for_each(|t| self.above[*t] = to_above > to_below);
                changed = true;
            }
            if !changed {
                break;
            }
        }
    }

    /// The elements connected with `t` by closed faces, if they are too few.
    fn crumb(&self, t: usize) -> Option<Vec<usize>> {
        let mut found = vec![t];
        let mut next = 0;
        while next < found.len() {
            let t = found[next];
            for k in (0..4).filter(|k| !self.is_open(t, *k)) {
                if let Some(other) = self.neighbours[t][k].map(|other| other as usize)
                    && !found.contains(&other)
                {
                    found.push(other);
                }
            }
            if found.len() >= MIN_PIECE_ELEMENTS {
                return None;
            }
            next += 1;
        }
        Some(found)
    }
}
