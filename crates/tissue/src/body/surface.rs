//! The boundary of a body: its triangles by internal vertex numbers, the triangles at each vertex,
//! and a tree over them.

use super::tree::Tree;
use glam::{DVec3, Vec3A};
use trocar_geometry::{TetMesh, TriMesh};

/// Below this distance (m) rounding blurs the direction to the foot, and the pseudonormal is used
/// instead.
const MIN_DIRECTION_LENGTH: f32 = 1e-6;

/// Greatest number of triangles on a walk to the nearest one.
const MAX_WALK: usize = 16;

/// The surface of a body that touches others: its boundary, or its collision surface. It never
/// changes; the state has the positions.
#[derive(Clone, Debug, Default)]
pub(crate) struct Surface {
    /// Corners by internal number, counterclockwise seen from outside; in the tree's order, so that
    /// adjacent triangles are near each other.
    pub triangles: Vec<[u32; 3]>,
    /// Boxes over `triangles`.
    pub tree: Tree,
    /// First triangle at each vertex of the body, in `fans`; and the end of the last.
    fan_start: Vec<u32>,
    fans: Vec<u32>,
}

/// Where on a triangle a point lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Foot {
    /// Weights of the three corners: 0 or more, together 1. On an edge one of them is exactly 0, in
    /// a corner two.
    pub weights: [f32; 3],
    /// From there to the queried point (m).
    pub off: Vec3A,
}

impl Surface {
    /// The boundary of `mesh`, whose node i has the internal number `internal[i]`; and a third of
    /// the area of the triangles at each node (m2), internal order.
    pub fn of(mesh: &TetMesh, internal: &[u32]) -> (Self, Vec<f64>) {
        let (boundary, nodes) = mesh.boundary();
        let named: Vec<u32> = nodes.iter().map(|node| internal[*node as usize]).collect();
        Self::over(&boundary, &named, internal.len())
    }

    /// A mesh whose vertex i has the internal number `named[i]`, below `vertices`; and a third of
    /// the area of the triangles at each vertex (m2).
    pub fn over(mesh: &TriMesh, named: &[u32], vertices: usize) -> (Self, Vec<f64>) {
        let middles: Vec<DVec3> =
            (0..mesh.triangles.len()).map(|t| mesh.corners(t).iter().sum::<DVec3>() / 3.0).collect();
        let named = |t: &[u32; 3]| t.map(|i| named[i as usize]);
        let (order, tree) = Tree::over(&middles, &mesh.triangles.iter().map(named).collect::<Vec<_>>());
        let triangles: Vec<[u32; 3]> = order.iter().map(|t| named(&mesh.triangles[*t as usize])).collect();

        let mut areas = vec![0.0; vertices];
        let mut fan_start = vec![0; vertices + 1];
        for (triangle, t) in triangles.iter().zip(&order) {
            for i in triangle {
                areas[*i as usize] += mesh.area_vector(*t as usize).length() / 3.0;
                fan_start[*i as usize + 1] += 1;
            }
        }
        for i in 0..vertices {
            fan_start[i + 1] += fan_start[i];
        }
        let mut next = fan_start.clone();
        let mut fans = vec![0; 3 * triangles.len()];
        for (t, triangle) in triangles.iter().enumerate() {
            for i in triangle {
                fans[next[*i as usize] as usize] = t as u32;
                next[*i as usize] += 1;
            }
        }
        (Self { triangles, tree, fan_start, fans }, areas)
    }

    /// Outward pseudonormal, of any length, at the place `weights` on triangle `t`, vertices at
    /// `x`: the normal of a face, the sum of the normals at an edge, the sum weighted by angle at a
    /// corner. A point whose nearest place is this one is outside if it is on the pseudonormal's
    /// side (Baerentzen and Aanaes 2005, "Signed distance computation using the angle weighted
    /// pseudonormal").
    pub fn pseudonormal(&self, x: &[Vec3A], t: u32, weights: [f32; 3]) -> Vec3A {
        let triangle = self.triangles[t as usize];
        let corner = |k: usize| triangle[k];
        match weights.map(|w| w > 0.0) {
            [true, true, true] => self.normal(x, t),
            [true, true, false] => self.normal_of_edge(x, [corner(0), corner(1)]),
            [false, true, true] => self.normal_of_edge(x, [corner(1), corner(2)]),
            [true, false, true] => self.normal_of_edge(x, [corner(2), corner(0)]),
            [true, false, false] => self.normal_of_vertex(x, corner(0)),
            [false, true, false] => self.normal_of_vertex(x, corner(1)),
            [false, false, _] => self.normal_of_vertex(x, corner(2)),
        }
    }

    /// The point of triangle `t` nearest to `p`, vertices at `x`.
    pub fn at(&self, x: &[Vec3A], p: Vec3A, t: u32) -> (u32, Foot) {
        (t, foot(p, self.triangles[t as usize].map(|i| x[i as usize])))
    }

    /// The triangle nearest to `p` that a walk finds which begins with `t` and goes from a triangle
    /// to a nearer neighbour.
    pub fn nearest_from(&self, x: &[Vec3A], p: Vec3A, t: u32) -> (u32, Foot) {
        let (mut at, mut best) = self.at(x, p, t);
        for _ in 0..MAX_WALK {
            let from = at;
            for corner in self.triangles[from as usize] {
                for next in self.fan(corner) {
                    let (_, foot) = self.at(x, p, *next);
                    if foot.off.length_squared() < best.off.length_squared() {
                        (at, best) = (*next, foot);
                    }
                }
            }
            if at == from {
                break;
            }
        }
        (at, best)
    }

    /// Outward unit normal and signed distance at the nearest point `foot` of triangle `t`. None
    /// where they are undefined.
    pub fn signed(&self, x: &[Vec3A], t: u32, foot: &Foot) -> Option<(Vec3A, f32)> {
        let out = self.pseudonormal(x, t, foot.weights);
        let distance = foot.off.length();
        let height = foot.off.dot(out);
        let on_face = foot.weights.iter().all(|w| *w > 0.0);
        let normal = if on_face || distance < MIN_DIRECTION_LENGTH {
            out.try_normalize()?
        } else {
            foot.off * (1.0f32.copysign(height) / distance)
        };
        Some((normal, distance.copysign(height)))
    }

    /// The triangles at a vertex.
    pub fn fan(&self, vertex: u32) -> &[u32] {
        &self.fans[self.fan_start[vertex as usize] as usize..self.fan_start[vertex as usize + 1] as usize]
    }

    /// Unit normal of a triangle; zero if it has no area.
    fn normal(&self, x: &[Vec3A], t: u32) -> Vec3A {
        let [a, b, c] = self.triangles[t as usize].map(|i| x[i as usize]);
        (b - a).cross(c - a).normalize_or_zero()
    }

    fn normal_of_edge(&self, x: &[Vec3A], [a, b]: [u32; 2]) -> Vec3A {
        let both = self.fan(a).iter().filter(|t| self.triangles[**t as usize].contains(&b));
        both.map(|t| self.normal(x, *t)).sum()
    }

    fn normal_of_vertex(&self, x: &[Vec3A], i: u32) -> Vec3A {
        let at = |t: &u32| {
            let triangle = self.triangles[*t as usize];
            let k = (0..3).find(|k| triangle[*k] == i).unwrap_or(0);
            let [b, c] = [1, 2].map(|n| x[triangle[(k + n) % 3] as usize] - x[i as usize]);
            let across = b.cross(c);
            libm::atan2f(across.length(), b.dot(c)) * across.normalize_or_zero()
        };
        self.fan(i).iter().map(at).sum()
    }
}

/// The point of triangle `abc` nearest to `p` (Ericson 2005, "Real-Time Collision Detection",
/// 5.1.5).
#[inline]
pub(crate) fn foot(p: Vec3A, [a, b, c]: [Vec3A; 3]) -> Foot {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return Foot { weights: [1.0, 0.0, 0.0], off: ap };
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return Foot { weights: [0.0, 1.0, 0.0], off: bp };
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return on_edge(d1 / (d1 - d3), ap, ab, |v| [1.0 - v, v, 0.0]);
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return Foot { weights: [0.0, 0.0, 1.0], off: cp };
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return on_edge(d2 / (d2 - d6), ap, ac, |w| [1.0 - w, 0.0, w]);
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return on_edge((d4 - d3) / ((d4 - d3) + (d5 - d6)), bp, c - b, |w| [0.0, 1.0 - w, w]);
    }
    let whole = 1.0 / (va + vb + vc);
    let (v, w) = (vb * whole, vc * whole);
    Foot { weights: [1.0 - v - w, v, w], off: ap - v * ab - w * ac }
}

fn on_edge(share: f32, from_start: Vec3A, edge: Vec3A, weights: impl Fn(f32) -> [f32; 3]) -> Foot {
    Foot { weights: weights(share), off: from_start - share * edge }
}
