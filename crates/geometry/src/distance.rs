//! Signed distance to a surface, negative inside.
//!
//! One tree of axis-aligned boxes gives both magnitude and sign. The nearest point is exact, by the
//! Voronoi regions of a triangle (C. Ericson, "Real-Time Collision Detection", 2005, section
//! 5.1.5). The sign comes from the generalized winding number (A. Jacobson et al., 2013), with a
//! distant part of the tree approximated by one dipole (G. Barill et al., "Fast winding numbers for
//! soups and clouds", ACM Transactions on Graphics, 2018).

use crate::{Error, Result, TriMesh};
use glam::DVec3;
use std::f64::consts::PI;

/// Maximum number of triangles in a leaf of the tree.
const LEAF_TRIANGLES: usize = 4;
/// A part of the surface becomes a dipole at this many times its radius (beta of Barill et al.).
const DIPOLE_RADII: f64 = 2.0;
/// Size of the traversal stack: enough for a balanced tree of 2^32 triangles.
const MAX_STACK: usize = 64;

/// A shape defined by its signed distance.
pub trait SignedDistance: Sync {
    /// Signed distance from `p` to the surface (m), negative inside. Near the surface it must be
    /// exact or a good estimate.
    fn distance(&self, p: DVec3) -> f64;
}

/// Signed distance to a triangle soup. The magnitude is exact. The sign comes from the generalized
/// winding number, so holes, cracks and stray triangles do not swap inside and outside.
///
/// ```
/// use glam::DVec3;
/// use trocar_geometry::{MeshDistance, SignedDistance, TriMesh};
///
/// let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
/// let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
/// let field = MeshDistance::new(&TriMesh { vertices, triangles, colors: Vec::new() })?;
/// assert!((field.distance(DVec3::new(0.1, 0.2, 0.2)) + 0.1).abs() < 1e-12);
/// assert!((field.distance(DVec3::new(0.2, 0.2, -2.0)) - 2.0).abs() < 1e-12);
/// # Ok::<(), trocar_geometry::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct MeshDistance {
    nodes: Vec<Node>,
    /// Corners in tree order.
    triangles: Vec<[DVec3; 3]>,
}

/// A box of the tree. The first child of an inner node follows it in memory.
#[derive(Clone, Debug)]
struct Node {
    low: DVec3,
    high: DVec3,
    /// Area-weighted centroid of the triangles below.
    centre: DVec3,
    /// Sum of their area vectors.
    dipole: DVec3,
    /// Square of the distance from `centre` beyond which the dipole is accurate enough.
    dipole2: f64,
    /// Inner node: index of the second child. Leaf: first triangle.
    next: u32,
    /// Triangles of a leaf; 0 for an inner node.
    count: u32,
}

impl MeshDistance {
    /// Builds the search tree.
    ///
    /// # Errors
    /// A mesh without triangles, with a vertex that is not finite, or with an index out of range.
    pub fn new(mesh: &TriMesh) -> Result<Self> {
        check(mesh)?;
        let corners: Vec<[DVec3; 3]> = (0..mesh.triangles.len()).map(|t| mesh.corners(t)).collect();
        let mut order: Vec<u32> = (0..corners.len() as u32).collect();
        let mut nodes = Vec::with_capacity(2 * corners.len() / LEAF_TRIANGLES + 1);
        build(&corners, &mut order, 0, &mut nodes);
        Ok(Self { nodes, triangles: order.iter().map(|&t| corners[t as usize]).collect() })
    }

    /// Generalized winding number at `p`: 1 inside and 0 outside a closed outward surface, in
    /// between near a hole. Distant parts of the surface are approximated; the error is about 0.05.
    pub fn winding(&self, p: DVec3) -> f64 {
        let mut solid_angle = 0.0;
        let mut stack = [0u32; MAX_STACK];
        let mut top = 1;
        while top > 0 {
            top -= 1;
            let at = stack[top] as usize;
            let node = &self.nodes[at];
            let away = node.centre - p;
            let d2 = away.length_squared();
            if d2 > node.dipole2 {
                solid_angle += node.dipole.dot(away) / (d2 * d2.sqrt());
            } else if node.count > 0 {
                solid_angle += self.leaf(node).iter().map(|t| triangle_solid_angle(t, p)).sum::<f64>();
            } else {
                stack[top] = node.next;
                stack[top + 1] = at as u32 + 1;
                top += 2;
            }
        }
        solid_angle / (4.0 * PI)
    }

    /// Distance from `p` to the nearest point of the surface (m), without a sign.
    pub fn unsigned(&self, p: DVec3) -> f64 {
        (p - self.closest_point(p)).length()
    }

    /// The point of the surface nearest to `p` (m).
    pub fn closest_point(&self, p: DVec3) -> DVec3 {
        let (mut best, mut best2) = (p, f64::INFINITY);
        // (node, square of the distance to its box); the nearer child is on top.
        let mut stack = [(0u32, 0.0); MAX_STACK];
        let mut top = 1;
        while top > 0 {
            top -= 1;
            let (at, box2) = stack[top];
            if box2 >= best2 {
                continue;
            }
            let node = &self.nodes[at as usize];
            if node.count > 0 {
                for triangle in self.leaf(node) {
                    let q = closest_on_triangle(triangle, p);
                    let d2 = (p - q).length_squared();
                    if d2 < best2 {
                        (best, best2) = (q, d2);
                    }
                }
                continue;
            }
            let (first, second) = (at + 1, node.next);
            let mut near = (first, self.box_distance2(first, p));
            let mut far = (second, self.box_distance2(second, p));
            if far.1 < near.1 {
                std::mem::swap(&mut near, &mut far);
            }
            for child in [far, near] {
                if child.1 < best2 {
                    stack[top] = child;
                    top += 1;
                }
            }
        }
        best
    }

    fn leaf(&self, node: &Node) -> &[[DVec3; 3]] {
        &self.triangles[node.next as usize..(node.next + node.count) as usize]
    }

    fn box_distance2(&self, node: u32, p: DVec3) -> f64 {
        let node = &self.nodes[node as usize];
        (p - p.clamp(node.low, node.high)).length_squared()
    }
}

impl SignedDistance for MeshDistance {
    fn distance(&self, p: DVec3) -> f64 {
        let d = self.unsigned(p);
        if self.winding(p) > 0.5 { -d } else { d }
    }
}

/// Checks that a surface has triangles, finite vertices and valid indices.
pub(crate) fn check(mesh: &TriMesh) -> Result<()> {
    if mesh.triangles.is_empty() {
        return Err(Error::Mesh("the surface has no triangles".into()));
    }
    if let Some(v) = mesh.vertices.iter().position(|v| !v.is_finite()) {
        return Err(Error::Mesh(format!("vertex {v} of the surface is {}; it must be finite", mesh.vertices[v])));
    }
    let count = mesh.vertices.len();
    if let Some(t) = mesh.triangles.iter().position(|t| t.iter().any(|&v| v as usize >= count)) {
        let indices = mesh.triangles[t];
        return Err(Error::Mesh(format!("triangle {t} uses vertices {indices:?}, but the surface has only {count}")));
    }
    Ok(())
}

/// Appends the subtree of the triangles `order`, the first of which is number `offset` in tree
/// order. Splits at the median centroid along the longest side.
fn build(corners: &[[DVec3; 3]], order: &mut [u32], offset: usize, nodes: &mut Vec<Node>) {
    let at = nodes.len();
    let mut node = bound(corners, order);
    if order.len() <= LEAF_TRIANGLES {
        (node.next, node.count) = (offset as u32, order.len() as u32);
        nodes.push(node);
        return;
    }
    let size = node.high - node.low;
    let axis = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    nodes.push(node);
    let key = |t: u32| corners[t as usize].iter().map(|v| v[axis]).sum::<f64>();
    let half = order.len() / 2;
    // Ties are broken by index, so the tree does not depend on the sorting algorithm.
    order.select_nth_unstable_by(half, |&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
    let (left, right) = order.split_at_mut(half);
    build(corners, left, offset, nodes);
    nodes[at].next = nodes.len() as u32;
    build(corners, right, offset + half, nodes);
}

/// Box, dipole and dipole distance of some triangles.
fn bound(corners: &[[DVec3; 3]], order: &[u32]) -> Node {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (mut dipole, mut moment, mut area) = (DVec3::ZERO, DVec3::ZERO, 0.0);
    for &t in order {
        let [a, b, c] = corners[t as usize];
        low = low.min(a).min(b).min(c);
        high = high.max(a).max(b).max(c);
        let n = 0.5 * (b - a).cross(c - a);
        dipole += n;
        moment += n.length() * (a + b + c) / 3.0;
        area += n.length();
    }
    let centre = if area > 0.0 { moment / area } else { 0.5 * (low + high) };
    let radius2 =
        order.iter().flat_map(|&t| corners[t as usize]).map(|v| (v - centre).length_squared()).fold(0.0, f64::max);
    Node { low, high, centre, dipole, dipole2: DIPOLE_RADII * DIPOLE_RADII * radius2, next: 0, count: 0 }
}

/// Signed solid angle of a triangle seen from `p` (A. van Oosterom, J. Strackee, "The solid angle
/// of a plane triangle", 1983).
fn triangle_solid_angle(triangle: &[DVec3; 3], p: DVec3) -> f64 {
    let [a, b, c] = triangle.map(|v| v - p);
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let numerator = a.dot(b.cross(c));
    let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    2.0 * libm::atan2(numerator, denominator)
}

/// The point of a triangle nearest to `p` (m), by the Voronoi region that contains `p` (Ericson
/// 2005, "Real-Time Collision Detection", 5.1.5).
pub fn closest_on_triangle(&[a, b, c]: &[DVec3; 3], p: DVec3) -> DVec3 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * ratio(d1, d1 - d3);
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * ratio(d2, d2 - d6);
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return b + (c - b) * ratio(d4 - d3, (d4 - d3) + (d5 - d6));
    }
    let sum = va + vb + vc;
    a + ab * ratio(vb, sum) + ac * ratio(vc, sum)
}

/// Quotient, or 0 for a degenerate triangle.
fn ratio(part: f64, whole: f64) -> f64 {
    if whole == 0.0 { 0.0 } else { part / whole }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::{cube, icosphere, scattered};

    #[test]
    fn the_distance_to_a_box_is_exact() {
        let field = MeshDistance::new(&cube(DVec3::ZERO, 1.0)).unwrap();
        for p in scattered(2000) {
            let q = p.abs() - 0.5;
            let truth = q.max(DVec3::ZERO).length() + q.max_element().min(0.0);
            assert!((field.distance(p) - truth).abs() < 1e-12, "{p}: {} not {truth}", field.distance(p));
        }
    }

    #[test]
    fn the_winding_number_of_a_sphere_is_0_or_1() {
        let mesh = icosphere(5, 0.6);
        let field = MeshDistance::new(&mesh).unwrap();
        for p in scattered(2000) {
            let truth = p.length() - 0.6;
            assert!((field.distance(p) - truth).abs() < 1e-3, "{p}");
            let inside = if field.distance(p) < 0.0 { 1.0 } else { 0.0 };
            assert!((field.winding(p) - inside).abs() < 0.06, "{p}: {}", field.winding(p));
            let nearest = field.closest_point(p);
            assert!(((nearest - p).length() - field.unsigned(p)).abs() < 1e-15);
        }
    }

    #[test]
    fn the_tree_agrees_with_a_loop_over_all_triangles() {
        let mesh = icosphere(3, 0.7);
        let field = MeshDistance::new(&mesh).unwrap();
        for p in scattered(300) {
            let each = (0..mesh.triangles.len()).map(|t| mesh.corners(t));
            let d = each.clone().map(|t| (closest_on_triangle(&t, p) - p).length()).fold(f64::MAX, f64::min);
            assert!((field.unsigned(p) - d).abs() < 1e-15);
            let w = each.map(|t| triangle_solid_angle(&t, p)).sum::<f64>() / (4.0 * PI);
            assert!((field.winding(p) - w).abs() < 0.06, "{p}: {} not {w}", field.winding(p));
        }
    }

    #[test]
    fn a_hole_and_a_stray_triangle_do_not_swap_inside_and_outside() {
        let mut mesh = icosphere(4, 0.6);
        let whole = MeshDistance::new(&mesh).unwrap();
        // A hole of 20 degrees half-angle at the pole, and a stray triangle outside.
        mesh.triangles = mesh.submesh(|t| mesh.corners(t)[0].z < 0.6 * 0.94).triangles;
        let cut = icosphere(4, 0.6);
        mesh.vertices = cut.submesh(|t| cut.corners(t)[0].z < 0.6 * 0.94).vertices;
        let n = mesh.vertices.len() as u32;
        mesh.vertices.extend([DVec3::new(0.8, 0.8, 0.0), DVec3::new(0.9, 0.8, 0.0), DVec3::new(0.8, 0.9, 0.0)]);
        mesh.triangles.push([n, n + 1, n + 2]);
        assert!(!mesh.is_watertight());
        let field = MeshDistance::new(&mesh).unwrap();
        // Near the hole, inside and outside are not defined.
        let hole = DVec3::new(0.0, 0.0, 0.6);
        for p in scattered(2000).into_iter().filter(|p| (*p - hole).length() > 0.25) {
            assert_eq!(field.winding(p) > 0.5, whole.winding(p) > 0.5, "{p}");
        }
    }

    #[test]
    fn a_degenerate_triangle_has_a_distance() {
        let mesh = TriMesh { vertices: vec![DVec3::X; 3], triangles: vec![[0, 1, 2]], colors: Vec::new() };
        let field = MeshDistance::new(&mesh).unwrap();
        assert_eq!(field.distance(DVec3::ZERO), 1.0);
        assert!(field.winding(DVec3::X).abs() < 0.5);
    }

    #[test]
    fn unusable_meshes_are_rejected() {
        let mut mesh = cube(DVec3::ZERO, 1.0);
        mesh.vertices[5].y = f64::NAN;
        assert!(MeshDistance::new(&mesh).unwrap_err().to_string().contains("vertex 5"));
        mesh.vertices.truncate(5);
        assert!(MeshDistance::new(&mesh).unwrap_err().to_string().contains("triangle 0"));
        assert!(MeshDistance::new(&TriMesh::default()).unwrap_err().to_string().contains("no triangles"));
    }
}
