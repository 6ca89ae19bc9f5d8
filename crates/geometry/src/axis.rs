//! Where along an organ a node lies: the organ coordinate s.

use crate::tet_mesh::adjacency::FACES;
use crate::{Error, Result, TetMesh};
use glam::DVec3;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// The centreline of an organ and the organ coordinate of each of its nodes.
///
/// s is arc length along the centreline over its whole length, 0 at the base and 1 at the tip. The centreline runs through
/// the centroids of the level sets of a harmonic field between the two ends, so it follows a curved tube.
#[derive(Clone, Debug)]
pub struct OrganAxis {
    /// Points along the centreline, base first [m].
    pub centreline: Vec<DVec3>,
    /// Length of the centreline [m].
    pub length: f64,
    /// Organ coordinate of each node, 0..=1.
    pub s: Vec<f64>,
    /// Arc length from the base to each point of the centreline [m].
    arc: Vec<f64>,
}

/// Nodes within this share of the organ's length of an end are its cap, where the field is held.
const CAP: f64 = 0.04;

/// Level sets, at most; fewer on a coarse mesh, so that each holds this many nodes.
const LEVELS: usize = 48;
const NODES_A_LEVEL: usize = 24;

impl OrganAxis {
    /// Finds the axis of `mesh`. The ends are two nodes far apart through the mesh; the base is the end nearer to `base_hint` [m].
    ///
    /// # Errors
    /// When the mesh has no element or its ends are not connected.
    pub fn of(mesh: &TetMesh, base_hint: DVec3) -> Result<Self> {
        let graph = Graph::new(mesh);
        if mesh.tets.is_empty() {
            return Err(Error::Mesh("a mesh without elements has no axis".to_owned()));
        }
        let first = farthest(&graph.distances(mesh.tets[0][0]));
        let from_first = graph.distances(first);
        let second = farthest(&from_first);
        let nearer = |i: u32| (mesh.vertices[i as usize] - base_hint).length();
        let (base, tip) = if nearer(first) <= nearer(second) { (first, second) } else { (second, first) };
        let (from_base, from_tip) = (graph.distances(base), graph.distances(tip));
        let extent = from_base[tip as usize];
        if !(extent.is_finite() && extent > 0.0) {
            return Err(Error::Mesh("the mesh is not connected; an organ is one body".to_owned()));
        }
        let fixed: Vec<Option<f64>> = (0..mesh.vertices.len())
            .map(|i| match () {
                () if from_base[i] <= CAP * extent => Some(0.0),
                () if from_tip[i] <= CAP * extent => Some(1.0),
                () => None,
            })
            .collect();
        // The distance through the mesh is a good first guess.
        let guess = from_base.iter().zip(&from_tip).map(|(b, t)| b / (b + t)).collect();
        let field = harmonic(mesh, &fixed, guess);
        let (levels, mut centreline) = level_centroids(mesh, &field);
        smooth(&mut centreline);
        extend(mesh, &field, &levels, &mut centreline);
        Ok(Self::along(centreline, &levels, mesh, &field))
    }

    /// Point at organ coordinate `s` on the centreline [m].
    pub fn point_at(&self, s: f64) -> DVec3 {
        let at = s.clamp(0.0, 1.0) * self.length;
        let k = self.arc.partition_point(|a| *a <= at).clamp(1, self.arc.len() - 1);
        let step = self.arc[k] - self.arc[k - 1];
        let t = if step > 0.0 { (at - self.arc[k - 1]) / step } else { 0.0 };
        self.centreline[k - 1].lerp(self.centreline[k], t)
    }

    /// Projects each node onto the part of the centreline that its field value points to.
    fn along(centreline: Vec<DVec3>, levels: &[f64], mesh: &TetMesh, field: &[f64]) -> Self {
        let mut arc = vec![0.0];
        for pair in centreline.windows(2) {
            arc.push(arc[arc.len() - 1] + (pair[1] - pair[0]).length());
        }
        let length = arc[arc.len() - 1];
        let segments = centreline.len() - 1;
        let s = mesh
            .vertices
            .iter()
            .zip(field)
            .map(|(p, u)| {
                // Level k is point k + 1 of the extended centreline.
                let near = levels.partition_point(|l| l <= u);
                let window = near.saturating_sub(2)..(near + 3).min(segments);
                let on = window.map(|k| {
                    let (a, b) = (centreline[k], centreline[k + 1]);
                    let step = (b - a).length_squared();
                    let t = if step > 0.0 { ((p - a).dot(b - a) / step).clamp(0.0, 1.0) } else { 0.0 };
                    ((p - a.lerp(b, t)).length_squared(), arc[k] + t * (arc[k + 1] - arc[k]))
                });
                let nearest = on.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(0.0, |n| n.1);
                if length > 0.0 { nearest / length } else { 0.0 }
            })
            .collect();
        Self { centreline, length, s, arc }
    }
}

/// Edges of the mesh as a graph with lengths.
struct Graph {
    start: Vec<u32>,
    to: Vec<(u32, f64)>,
}

impl Graph {
    fn new(mesh: &TetMesh) -> Self {
        let mut directed: Vec<[u32; 2]> = mesh.edges().into_iter().flat_map(|[a, b]| [[a, b], [b, a]]).collect();
        directed.sort_unstable();
        let mut start = vec![0; mesh.vertices.len() + 1];
        for [a, _] in &directed {
            start[*a as usize + 1] += 1;
        }
        for i in 1..start.len() {
            start[i] += start[i - 1];
        }
        let length = |a: u32, b: u32| (mesh.vertices[a as usize] - mesh.vertices[b as usize]).length();
        Self { start, to: directed.into_iter().map(|[a, b]| (b, length(a, b))).collect() }
    }

    fn of(&self, i: usize) -> &[(u32, f64)] {
        &self.to[self.start[i] as usize..self.start[i + 1] as usize]
    }

    /// Length of the shortest way along edges from `from` to each node (Dijkstra).
    fn distances(&self, from: u32) -> Vec<f64> {
        let mut distance = vec![f64::INFINITY; self.start.len() - 1];
        distance[from as usize] = 0.0;
        // Lengths are not negative, so their bits order as they do.
        let mut queue = BinaryHeap::from([(Reverse(0u64), from)]);
        while let Some((Reverse(bits), i)) = queue.pop() {
            let so_far = f64::from_bits(bits);
            if so_far > distance[i as usize] {
                continue;
            }
            for (j, step) in self.of(i as usize) {
                let through = so_far + step;
                if through < distance[*j as usize] {
                    distance[*j as usize] = through;
                    queue.push((Reverse(through.to_bits()), *j));
                }
            }
        }
        distance
    }
}

/// The node with the largest finite distance.
fn farthest(distance: &[f64]) -> u32 {
    let reached = (0..distance.len()).filter(|i| distance[*i].is_finite());
    reached.max_by(|a, b| distance[*a].total_cmp(&distance[*b])).unwrap_or(0) as u32
}

/// Solves Laplace's equation with linear elements, values held where `fixed`, natural elsewhere: conjugate gradients with the diagonal as
/// preconditioner.
fn harmonic(mesh: &TetMesh, fixed: &[Option<f64>], guess: Vec<f64>) -> Vec<f64> {
    const TOLERANCE: f64 = 1e-8;
    const ITERATIONS: usize = 2000;
    // Gradient of the shape function of corner k: minus the area vector of the face opposite to it over three volumes.
    let gradients: Vec<([DVec3; 4], f64)> = (0..mesh.tets.len())
        .map(|t| {
            let x = mesh.corners(t);
            let volume = mesh.tet_volume(t);
            (FACES.map(|[a, b, c]| (x[b] - x[a]).cross(x[c] - x[a]) / (-6.0 * volume)), volume)
        })
        .collect();
    let apply = |u: &[f64], out: &mut [f64]| {
        out.fill(0.0);
        for (tet, (gradient, volume)) in mesh.tets.iter().zip(&gradients) {
            let flux: DVec3 = (0..4).map(|k| gradient[k] * u[tet[k] as usize]).sum::<DVec3>() * *volume;
            for k in 0..4 {
                out[tet[k] as usize] += gradient[k].dot(flux);
            }
        }
        for i in (0..out.len()).filter(|i| fixed[*i].is_some()) {
            out[i] = 0.0;
        }
    };
    let mut diagonal = vec![0.0; mesh.vertices.len()];
    for (tet, (gradient, volume)) in mesh.tets.iter().zip(&gradients) {
        for k in 0..4 {
            diagonal[tet[k] as usize] += gradient[k].length_squared() * volume;
        }
    }
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut u = guess;
    for (u, value) in u.iter_mut().zip(fixed) {
        *u = value.unwrap_or(*u);
    }
    let mut product = vec![0.0; u.len()];
    apply(&u, &mut product);
    let mut residual: Vec<f64> = product.iter().map(|r| -r).collect();
    let precondition =
        |r: &[f64]| -> Vec<f64> { r.iter().zip(&diagonal).map(|(r, d)| if *d > 0.0 { r / d } else { 0.0 }).collect() };
    let mut z = precondition(&residual);
    let mut direction = z.clone();
    let mut rz = dot(&residual, &z);
    let enough = TOLERANCE * TOLERANCE * rz;
    for _ in 0..ITERATIONS {
        if rz <= enough {
            break;
        }
        apply(&direction, &mut product);
        let step = rz / dot(&direction, &product);
        for i in 0..u.len() {
            u[i] += step * direction[i];
            residual[i] -= step * product[i];
        }
        z = precondition(&residual);
        let next = dot(&residual, &z);
        let keep = next / rz;
        rz = next;
        for i in 0..u.len() {
            direction[i] = z[i] + keep * direction[i];
        }
    }
    u
}

/// Mean field value and centroid (by volume) of slices of the body that hold equally many elements, in ascending order of the field.
fn level_centroids(mesh: &TetMesh, field: &[f64]) -> (Vec<f64>, Vec<DVec3>) {
    let mean = |t: usize| mesh.tets[t].iter().map(|i| field[*i as usize]).sum::<f64>() / 4.0;
    let mut order: Vec<(f64, usize)> = (0..mesh.tets.len()).map(|t| (mean(t), t)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let count = (mesh.vertices.len() / NODES_A_LEVEL).clamp(2, LEVELS);
    let slice = order.len().div_ceil(count);
    order
        .chunks(slice)
        .map(|slice| {
            let (mut volume, mut value, mut middle) = (0.0, 0.0, DVec3::ZERO);
            for (u, t) in slice {
                let v = mesh.tet_volume(*t);
                volume += v;
                value += v * u;
                middle += v * mesh.corners(*t).iter().sum::<DVec3>() / 4.0;
            }
            (value / volume, middle / volume)
        })
        .unzip()
}

/// Takes the ripple out of a polyline, ends held.
fn smooth(line: &mut [DVec3]) {
    for _ in 0..2 {
        let old = line.to_vec();
        for k in 1..line.len().saturating_sub(1) {
            line[k] = 0.25 * old[k - 1] + 0.5 * old[k] + 0.25 * old[k + 1];
        }
    }
}

/// Lengthens the centreline at both ends, straight on, as far as the nodes of the end slices reach.
fn extend(mesh: &TetMesh, field: &[f64], levels: &[f64], line: &mut Vec<DVec3>) {
    let last = line.len() - 1;
    let reach = |from: DVec3, inward: DVec3, in_slice: &dyn Fn(f64) -> bool| {
        let outward = (from - inward).normalize_or_zero();
        let nodes = mesh.vertices.iter().zip(field).filter(|(_, u)| in_slice(**u));
        from + outward * nodes.map(|(p, _)| (p - from).dot(outward)).fold(0.0, f64::max)
    };
    let base = reach(line[0], line[1], &|u| u <= levels[0]);
    let tip = reach(line[last], line[last - 1], &|u| u >= levels[last]);
    line.insert(0, base);
    line.push(tip);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LatticeMesher, Mesher, SignedDistance};
    use std::f64::consts::PI;

    /// A tube of radius 5 mm around half a circle of radius 30 mm in the x-y plane, open towards -y; `bend` false: a straight one along x.
    struct Tube {
        bend: bool,
    }

    impl SignedDistance for Tube {
        fn distance(&self, p: DVec3) -> f64 {
            let on = if self.bend {
                let angle = p.y.atan2(p.x).clamp(0.0, PI);
                let angle = if p.y < 0.0 { if p.x > 0.0 { 0.0 } else { PI } } else { angle };
                0.03 * DVec3::new(angle.cos(), angle.sin(), 0.0)
            } else {
                DVec3::new(p.x.clamp(-0.04, 0.04), 0.0, 0.0)
            };
            (p - on).length() - 0.005
        }
    }

    fn mesh(bend: bool) -> TetMesh {
        let bounds = (DVec3::new(-0.05, -0.01, -0.01), DVec3::new(0.05, 0.04, 0.01));
        LatticeMesher { cell: 2.5e-3 }.mesh(&Tube { bend }, bounds).unwrap()
    }

    #[test]
    fn a_straight_tube_is_measured_along_its_length() {
        let mesh = mesh(false);
        let axis = OrganAxis::of(&mesh, DVec3::new(-1.0, 0.0, 0.0)).unwrap();
        assert!((axis.length - 0.09).abs() < 0.002, "{}", axis.length);
        for (p, s) in mesh.vertices.iter().zip(&axis.s) {
            assert!((s - (p.x + 0.045) / 0.09).abs() < 0.02, "{p} has s = {s}");
        }
        assert!((axis.point_at(0.5)).length() < 1e-3);
        let turned = OrganAxis::of(&mesh, DVec3::new(1.0, 0.0, 0.0)).unwrap();
        assert!(axis.s.iter().zip(&turned.s).all(|(s, t)| (s + t - 1.0).abs() < 0.02));
    }

    #[test]
    fn a_bent_tube_is_measured_around_its_bend() {
        let mesh = mesh(true);
        let axis = OrganAxis::of(&mesh, DVec3::new(0.03, 0.0, 0.0)).unwrap();
        let length = 0.03 * PI + 0.01;
        assert!((axis.length / length - 1.0).abs() < 0.04, "{} of {length}", axis.length);
        for (p, s) in mesh.vertices.iter().zip(&axis.s).filter(|(p, _)| p.y > 0.0) {
            let expected = (0.005 + 0.03 * p.y.atan2(p.x)) / length;
            assert!((s - expected).abs() < 0.04, "{p} has s = {s}, expected {expected}");
        }
    }
}
