//! The organ coordinate s: the position of each node along an organ.

mod harmonic;

use crate::quality::median;
use crate::{Error, Result, TetMesh};
use glam::DVec3;
use harmonic::Stiffness;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// The centreline of an organ and the organ coordinate of each of its nodes.
///
/// s is the arc length along the centreline divided by its total length: 0 at the base, 1 at the
/// tip. The centreline runs through the centroids of the level sets of a harmonic field between the
/// two ends, so it follows a curved tube.
#[derive(Clone, Debug)]
pub struct OrganAxis {
    /// Points along the centreline, base first (m).
    pub centreline: Vec<DVec3>,
    /// Length of the centreline (m).
    pub length: f64,
    /// Organ coordinate of each node, in [0, 1].
    pub s: Vec<f64>,
}

/// The field has a fixed value over the cap of each end. A cap contains the nodes whose distance
/// from the other end is within this fraction of the largest, or within [`CAP_EDGES`] median edges
/// of it.
const CAP_FRACTION: f64 = 0.03;
const CAP_EDGES: f64 = 1.0;
/// Rounds that locate the ends. Each round looks at an end from a point this many mean radii of the
/// body inside it. The flag says whether the direction there follows the bend of the axis, which
/// needs an axis that is nearly right, or is straight.
const CAP_ROUNDS: [(f64, bool); 3] = [(3.0, false), (2.0, false), (1.5, true)];
/// Limits of the number of centreline points, which is about one per median edge length.
const MIN_CENTRELINE_POINTS: usize = 8;
const MAX_CENTRELINE_POINTS: usize = 64;
/// Number of times the centreline is computed, evenly spaced along the previous one. The first one
/// follows the field, which changes fast in narrow places.
const CENTRELINE_ROUNDS: usize = 3;

impl OrganAxis {
    /// Finds the axis of `mesh`. The ends are the two nodes farthest apart through the mesh. The
    /// end nearer to `base_hint` (m) is the base.
    ///
    /// # Errors
    /// A mesh without elements, in several parts, or with an element without positive volume; a
    /// `base_hint` that is not finite.
    pub fn of(mesh: &TetMesh, base_hint: DVec3) -> Result<Self> {
        if !base_hint.is_finite() {
            return Err(Error::Mesh(format!("the base hint is {base_hint} m; it must be finite")));
        }
        let field = Stiffness::of(mesh)?;
        let (base, tip) = ends(mesh, &field, base_hint)?;
        let from_base = distances(mesh, &field, base);
        let from_tip = distances(mesh, &field, tip);
        let apart = from_tip[base];
        let edge = median(field.edge_lengths(mesh));
        let cap = (CAP_FRACTION * apart).max(CAP_EDGES * edge);
        let count = ((apart / edge).round() as usize).clamp(MIN_CENTRELINE_POINTS, MAX_CENTRELINE_POINTS);

        // Paths along edges prefer the directions of the lattice, so the farthest nodes may lie at
        // the rim of a blunt end. The axis they give is correct away from the ends and locates the
        // true ends.
        let rough_caps = (0..mesh.vertices.len()).map(|i| (from_tip[i] >= apart - cap, from_base[i] >= apart - cap));
        let guess = from_base.iter().zip(&from_tip).map(|(b, t)| b / (b + t)).collect();
        let mut u = field.solve(&fix(rough_caps, base, tip), guess);
        let line = (mesh.vertices[base], mesh.vertices[tip]);
        let mut axis = Self::through_level_sets(mesh, &u, count, line);
        for round in CAP_ROUNDS {
            u = field.solve(&fix(axis.caps(mesh, cap, round).into_iter(), base, tip), u);
            axis = Self::through_level_sets(mesh, &u, count, line);
        }
        Ok(axis)
    }

    /// The point of the centreline at organ coordinate `s` (m).
    pub fn point_at(&self, s: f64) -> DVec3 {
        let mut left = s.clamp(0.0, 1.0) * self.length;
        for pair in self.centreline.windows(2) {
            let step = pair[0].distance(pair[1]);
            if left <= step && step > 0.0 {
                return pair[0].lerp(pair[1], left / step);
            }
            left -= step;
        }
        self.centreline.last().copied().unwrap_or(DVec3::ZERO)
    }

    /// The axis through the level sets of `u`, with `count` points. It is the straight `line` from
    /// base to tip when the body is too small to have level sets.
    fn through_level_sets(mesh: &TetMesh, u: &[f64], count: usize, line: (DVec3, DVec3)) -> Self {
        let mut axis = Self { centreline: Vec::new(), length: 0.0, s: u.to_vec() };
        for _ in 0..CENTRELINE_ROUNDS {
            if !axis.recompute(mesh, u, count) {
                let along = line.1 - line.0;
                let s = mesh.vertices.iter().map(|&p| (p - line.0).dot(along) / along.length_squared());
                return Self {
                    centreline: vec![line.0, line.1],
                    length: along.length(),
                    s: s.map(|s| s.clamp(0.0, 1.0)).collect(),
                };
            }
        }
        axis
    }

    /// Whether each node lies within `cap` (m) of the extremity of the base, and of the tip. One
    /// round of [`CAP_ROUNDS`].
    fn caps(&self, mesh: &TetMesh, cap: f64, (radii, bend): (f64, bool)) -> Vec<(bool, bool)> {
        let radius = (mesh.volume() / (std::f64::consts::PI * self.length)).sqrt();
        let k = (radii * radius / self.length).clamp(0.05, 0.25);
        let at_end = |near: f64, far: f64, in_end: &dyn Fn(f64) -> bool| -> Vec<bool> {
            let [farther, far, near] = [2.0 * far - near, far, near].map(|s| self.point_at(s));
            let outward = onward([if bend { farther } else { 2.0 * far - near }, far, near]);
            let reach: Vec<f64> = mesh
                .vertices
                .iter()
                .zip(&self.s)
                .map(|(p, &s)| if in_end(s) { p.dot(outward) } else { f64::NEG_INFINITY })
                .collect();
            let most = reach.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            reach.iter().map(|&reach| reach.is_finite() && reach >= most - cap).collect()
        };
        let base = at_end(k, 2.0 * k, &|s| s < k);
        let tip = at_end(1.0 - k, 1.0 - 2.0 * k, &|s| s > 1.0 - k);
        base.into_iter().zip(tip).collect()
    }

    /// Computes the centreline through the centroids of `count` slices along the present
    /// coordinate, then the coordinate along the new centreline. Slices overlap like the hat
    /// functions of linear interpolation, so the centroids do not jitter with the elements. Changes
    /// nothing and returns false for fewer than two slices.
    fn recompute(&mut self, mesh: &TetMesh, u: &[f64], count: usize) -> bool {
        let mut weight = vec![0.0; count];
        let mut centroid = vec![DVec3::ZERO; count];
        let mut level = vec![0.0; count];
        for (t, tet) in mesh.tets.iter().enumerate() {
            let mean = |of: &[f64]| tet.iter().map(|&i| of[i as usize]).sum::<f64>() / 4.0;
            let volume = mesh.tet_volume(t);
            let at = (mean(&self.s) * count as f64 - 0.5).clamp(0.0, (count - 1) as f64);
            let (low, share) = (at as usize, at.fract());
            let centre = mesh.corners(t).iter().sum::<DVec3>() / 4.0;
            for (slice, part) in [(low, 1.0 - share), ((low + 1).min(count - 1), share)] {
                weight[slice] += volume * part;
                centroid[slice] += volume * part * centre;
                level[slice] += volume * part * mean(u);
            }
        }
        let mut points = Vec::new();
        let mut levels: Vec<f64> = Vec::new();
        for slice in (0..count).filter(|&slice| weight[slice] > 0.0) {
            let next = level[slice] / weight[slice];
            if levels.last().is_none_or(|&last| next > last) {
                points.push(centroid[slice] / weight[slice]);
                levels.push(next);
            }
        }
        if points.len() < 2 {
            return false;
        }
        smooth(&mut points);
        let (start, end) = tangents(&points);
        let (first, last) = (points[0], points[points.len() - 1]);
        let (low, high) = (levels[0], levels[levels.len() - 1]);

        // Beyond the outermost centroids the line continues straight to the end of the body.
        let beyond = |end: DVec3, along: DVec3, p: DVec3| (p - end).dot(along).max(0.0);
        let mut reach = [0.0f64; 2];
        for (&p, &u) in mesh.vertices.iter().zip(u) {
            if u <= low {
                reach[0] = reach[0].max(beyond(first, start, p));
            }
            if u >= high {
                reach[1] = reach[1].max(beyond(last, end, p));
            }
        }
        let mut arc = vec![reach[0]];
        for pair in points.windows(2) {
            arc.push(arc[arc.len() - 1] + pair[0].distance(pair[1]));
        }
        let inner_end = arc[arc.len() - 1];
        let length = inner_end + reach[1];
        self.s = mesh
            .vertices
            .iter()
            .zip(u)
            .map(|(&p, &u)| {
                // In the caps the field is nearly constant. The straight continuation replaces it
                // there.
                let along = if u < low {
                    let share = u / low;
                    reach[0] - (1.0 - share) * beyond(first, start, p)
                } else if u > high {
                    let share = (1.0 - u) / (1.0 - high);
                    inner_end + (1.0 - share) * beyond(last, end, p)
                } else {
                    interpolate(&levels, &arc, u)
                };
                (along / length).clamp(0.0, 1.0)
            })
            .collect();
        self.length = length;
        self.centreline = points;
        self.centreline.insert(0, first + start * reach[0]);
        self.centreline.push(last + end * reach[1]);
        true
    }
}

/// The fixed value of each node: 0 in the cap of the base, 1 in the cap of the tip. If the caps
/// overlap, as in a very small body, only the two end nodes are fixed.
fn fix(caps: impl Iterator<Item = (bool, bool)>, base: usize, tip: usize) -> Vec<Option<f64>> {
    let caps: Vec<(bool, bool)> = caps.collect();
    let overlap = caps.iter().any(|&(at_base, at_tip)| at_base && at_tip);
    let missing = !caps.iter().any(|cap| cap.0) || !caps.iter().any(|cap| cap.1);
    let held = |i: usize| if overlap || missing { (i == base, i == tip) } else { caps[i] };
    (0..caps.len())
        .map(|i| match held(i) {
            (true, _) => Some(0.0),
            (_, true) => Some(1.0),
            _ => None,
        })
        .collect()
}

/// The direction at the last of three evenly spaced points of a curve, by extrapolation.
fn onward(points: [DVec3; 3]) -> DVec3 {
    let [before, last] = [points[1] - points[0], points[2] - points[1]].map(|chord| chord.normalize_or_zero());
    (1.5 * last - 0.5 * before).normalize_or(DVec3::X)
}

/// Outward directions of the line at its first and last point, over several points for robustness.
fn tangents(points: &[DVec3]) -> (DVec3, DVec3) {
    let last = points.len() - 1;
    let span = (points.len() / 16).max(1).min(last);
    let far = (2 * span).min(last);
    (onward([points[far], points[span], points[0]]), onward([points[last - far], points[last - span], points[last]]))
}

/// Two passes of a (1, 2, 1) / 4 average. The ends are fixed.
fn smooth(points: &mut [DVec3]) {
    for _ in 0..2 {
        let old = points.to_vec();
        for i in 1..points.len().saturating_sub(1) {
            points[i] = 0.25 * (old[i - 1] + 2.0 * old[i] + old[i + 1]);
        }
    }
}

/// Piecewise linear interpolation of (x, y) with ascending x. `at` lies between the first and the
/// last x.
fn interpolate(x: &[f64], y: &[f64], at: f64) -> f64 {
    let high = x.partition_point(|&x| x < at).clamp(1, x.len().max(2) - 1);
    match (x.get(high), y.get(high)) {
        (Some(&x1), Some(&y1)) => {
            let (x0, y0) = (x[high - 1], y[high - 1]);
            y0 + (y1 - y0) * (at - x0) / (x1 - x0)
        }
        _ => y[0],
    }
}

/// The base and the tip: two nodes that are nearly the farthest apart along edges, by two sweeps
/// from an arbitrary node.
fn ends(mesh: &TetMesh, field: &Stiffness, base_hint: DVec3) -> Result<(usize, usize)> {
    let farthest = |from: &[f64]| {
        let mut best = 0;
        for (i, &distance) in from.iter().enumerate() {
            if distance > from[best] {
                best = i;
            }
        }
        best
    };
    let first = distances(mesh, field, 0);
    if let Some(node) = first.iter().position(|d| d.is_infinite()) {
        return Err(Error::Mesh(format!(
            "node {node} is not connected to node 0; an organ axis needs a mesh in one part without unused nodes"
        )));
    }
    let a = farthest(&first);
    let b = farthest(&distances(mesh, field, a));
    let away = |node: usize| mesh.vertices[node].distance(base_hint);
    Ok(if away(a) <= away(b) { (a, b) } else { (b, a) })
}

/// Length of the shortest path from node `start` to each node (m), infinite where there is none. A
/// path may go straight to neighbours and to their neighbours. Paths along the 14 directions of a
/// lattice's edges alone would be up to a quarter too long, depending on the direction.
fn distances(mesh: &TetMesh, field: &Stiffness, start: usize) -> Vec<f64> {
    let mut best = vec![f64::INFINITY; field.nodes()];
    let mut open = BinaryHeap::new();
    best[start] = 0.0;
    // Lengths are not negative, so their bit patterns have the same order as the numbers.
    open.push(Reverse((0.0f64.to_bits(), start)));
    while let Some(Reverse((bits, node))) = open.pop() {
        let so_far = f64::from_bits(bits);
        if so_far > best[node] {
            continue;
        }
        let mut relax = |other: usize| {
            let through = so_far + mesh.vertices[node].distance(mesh.vertices[other]);
            if through < best[other] {
                best[other] = through;
                open.push(Reverse((through.to_bits(), other)));
            }
        };
        for near in field.row(node).map(|(_, near)| near) {
            relax(near);
            field.row(near).for_each(|(_, far)| relax(far));
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LatticeMesher, SignedDistance};
    use std::f64::consts::PI;

    struct Shape<F: Fn(DVec3) -> f64 + Sync>(F);
    impl<F: Fn(DVec3) -> f64 + Sync> SignedDistance for Shape<F> {
        fn distance(&self, p: DVec3) -> f64 {
            (self.0)(p)
        }
    }

    fn mesh(cell: f64, half: DVec3, f: impl Fn(DVec3) -> f64 + Sync) -> TetMesh {
        LatticeMesher::uniform(cell).mesh_shape(&Shape(f), (-half, half)).unwrap()
    }

    /// A cylinder along x, 80 mm long and 12 mm thick, with flat ends.
    fn cylinder(cell: f64) -> TetMesh {
        mesh(cell, DVec3::new(0.04, 0.006, 0.006), |p| (p.x.abs() - 0.04).max(p.y.hypot(p.z) - 0.006))
    }

    #[test]
    fn s_of_a_cylinder_is_the_axial_coordinate() {
        let body = cylinder(0.0021);
        let axis = OrganAxis::of(&body, DVec3::new(-0.05, 0.0, 0.0)).unwrap();
        let worst = body.vertices.iter().zip(&axis.s).map(|(p, s)| (s - (p.x + 0.04) / 0.08).abs()).fold(0.0, f64::max);
        assert!(worst < 0.02, "{worst}");
        assert!((axis.length - 0.08).abs() < 0.001, "{}", axis.length);
        assert!(axis.point_at(0.0).distance(DVec3::X * -0.04) < 0.001);
        assert!(axis.point_at(0.25).distance(DVec3::X * -0.02) < 0.001);
        assert!(axis.point_at(1.0).distance(DVec3::X * 0.04) < 0.001);
    }

    #[test]
    fn the_base_hint_decides_the_direction() {
        let body = cylinder(0.003);
        let one = OrganAxis::of(&body, DVec3::new(-0.03, 0.02, 0.0)).unwrap();
        let other = OrganAxis::of(&body, DVec3::new(0.1, 0.0, 0.0)).unwrap();
        let worst = one.s.iter().zip(&other.s).map(|(a, b)| (a + b - 1.0).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-3, "{worst}");
        assert!(one.centreline[0].x < 0.0 && other.centreline[0].x > 0.0);
    }

    #[test]
    fn s_of_a_half_ring_is_arc_length() {
        // Bend radius 35 mm, tube radius 5 mm, flat ends in the plane y = 0.
        let body =
            mesh(0.0021, DVec3::new(0.041, 0.041, 0.006), |p| ((p.x.hypot(p.y) - 0.035).hypot(p.z) - 0.005).max(-p.y));
        let axis = OrganAxis::of(&body, DVec3::new(0.035, 0.0, 0.0)).unwrap();
        let worst = body
            .vertices
            .iter()
            .zip(&axis.s)
            .map(|(p, s)| (s - p.y.max(0.0).atan2(p.x) / PI).abs())
            .fold(0.0, f64::max);
        assert!(worst < 0.02, "{worst}");
        assert!((axis.length / (PI * 0.035) - 1.0).abs() < 0.02, "{}", axis.length);
        for k in 0..=8 {
            let angle = PI * f64::from(k) / 8.0;
            let truth = 0.035 * DVec3::new(angle.cos(), angle.sin(), 0.0);
            let off = axis.point_at(f64::from(k) / 8.0).distance(truth);
            assert!(off < 0.002, "{k}: {off}");
        }
    }

    #[test]
    fn the_length_includes_round_ends() {
        let ends = [DVec3::X * -0.03, DVec3::X * 0.03];
        let body = mesh(0.0021, DVec3::new(0.038, 0.008, 0.008), |p| {
            p.distance(DVec3::new(p.x.clamp(ends[0].x, ends[1].x), 0.0, 0.0)) - 0.008
        });
        let axis = OrganAxis::of(&body, ends[0]).unwrap();
        assert!((axis.length - 0.076).abs() < 0.0015, "{}", axis.length);
        let errors = body.vertices.iter().zip(&axis.s).map(|(p, s)| (s - (p.x + 0.038) / 0.076).abs());
        let worst = errors.fold(0.0, f64::max);
        assert!(worst < 0.05, "{worst}");
    }

    #[test]
    fn s_of_an_ellipsoid_is_monotone_along_its_longest_extent() {
        let half = DVec3::new(0.05, 0.035, 0.025);
        let body = mesh(0.004, half, |p| ((p / half).length() - 1.0) * half.z);
        let axis = OrganAxis::of(&body, DVec3::new(-1.0, 0.0, 0.0)).unwrap();
        assert!(axis.s.iter().all(|s| (0.0..=1.0).contains(s)));
        assert!(axis.centreline[0].x < -0.03 && axis.centreline[axis.centreline.len() - 1].x > 0.03);
        assert!(axis.centreline.windows(2).all(|w| w[1].x > w[0].x));
        assert!((0.075..0.125).contains(&axis.length), "{}", axis.length);
    }

    #[test]
    fn s_of_a_cone_measures_length_not_width() {
        // A cone frustum of 80 mm, radius 12 mm at the base and 4 mm at the tip: the field is far
        // from linear.
        let body = mesh(0.002, DVec3::new(0.041, 0.013, 0.013), |p| {
            (0.95 * (p.y.hypot(p.z) - (0.008 - 0.1 * p.x))).max(p.x.abs() - 0.04)
        });
        let axis = OrganAxis::of(&body, DVec3::new(-0.04, 0.0, 0.0)).unwrap();
        let near = |p: &DVec3| p.y.hypot(p.z) < 0.003;
        let worst = body
            .vertices
            .iter()
            .zip(&axis.s)
            .filter(|(p, _)| near(p))
            .map(|(p, s)| (s - (p.x + 0.04) / 0.08).abs())
            .fold(0.0, f64::max);
        assert!(worst < 0.03, "{worst}");
    }

    #[test]
    fn one_element_suffices_and_unusable_meshes_are_rejected() {
        let one = TetMesh { vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z], tets: vec![[0, 1, 2, 3]] };
        let axis = OrganAxis::of(&one, DVec3::ZERO).unwrap();
        assert!(axis.s.iter().all(|s| s.is_finite()) && axis.length.is_finite());
        let rejection = |mesh: &TetMesh| OrganAxis::of(mesh, DVec3::ZERO).unwrap_err().to_string();
        assert!(rejection(&TetMesh::default()).contains("no elements"));
        let mut flat = one.clone();
        flat.vertices[3] = DVec3::X + DVec3::Y;
        assert!(rejection(&flat).contains("element 0"));
        let mut loose = one;
        loose.vertices.push(DVec3::splat(5.0));
        assert!(rejection(&loose).contains("node 4"));
    }
}
