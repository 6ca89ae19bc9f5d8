//! How much tissue lies across the closing plane of two blades, station by station along them.

use crate::gripper::JAW_REGION_BEGIN;
use crate::{Gripper, World};
use glam::{DVec2, DVec3};
use trocar_geometry::TetMesh;

/// Distance between stations along the blades (m).
pub(crate) const STATION: f64 = 5e-5;

/// Faces that a cut opened count up to this many median edges from the plane: the faces of elements
/// zigzag.
const NEAR_PLANE: f64 = 2.0;

/// Tissue at a station.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Chord {
    /// Length of tissue across the closing plane (m).
    pub length: f64,
    /// Whether some of it is between the edges.
    pub between: bool,
}

/// Distance of station `k` from the pivot (m).
pub(crate) fn place(k: usize) -> f64 {
    JAW_REGION_BEGIN + STATION * (k as f64 + 0.5)
}

/// Number of stations of blades of `length` (m).
pub(crate) fn count(length: f64) -> usize {
    ((length - JAW_REGION_BEGIN) / STATION).round().max(1.0) as usize
}

/// Tissue of organ `organ` at each station of blades of `length` (m), where they cut: in the plane
/// that the edges move in, up to `reach` (m) to either side of the closing plane.
pub(crate) fn chords(world: &World, organ: usize, gripper: &Gripper, length: f64, reach: f64) -> Vec<Chord> {
    let to_gripper = gripper.pose.inverse();
    let body = &world.model.bodies()[organ];
    let places = world.state.positions(&world.model, organ);
    let places: Vec<DVec3> = places.into_iter().map(|p| to_gripper.transform(p)).collect();
    let slope = libm::tan(0.5 * gripper.jaw_angle);
    let mut chords = vec![Chord::default(); count(length)];
    for tet in body.tets() {
        let corners = tet.map(|i| places[i as usize]);
        let above = corners.map(|p| p.z > 0.0);
        if above == [above[0]; 4] || corners.iter().all(|p| p.x > length || p.x < 0.0) {
            continue;
        }
        let mut section = Vec::with_capacity(4);
        for (i, j) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            if above[i] != above[j] {
                let (a, b) = (corners[i], corners[j]);
                section.push(a.lerp(b, a.z / (a.z - b.z)).truncate());
            }
        }
        across(&section, chords.len(), |k, [low, high]| {
            let (low, high) = (low.max(-reach), high.min(reach));
            let half = place(k) * slope;
            chords[k].length += (high - low).max(0.0);
            chords[k].between |= low < high && low < half && high > -half;
        });
    }
    chords
}

/// Length of the tissue at each station that an earlier cut has opened (m): what two faces cover
/// that were one at rest. `organ` and all pieces of the same organ are searched.
pub(crate) fn slit(world: &World, organ: usize, gripper: &Gripper, length: f64) -> Vec<f64> {
    let mut slit = vec![0.0; count(length)];
    if world.cuts == 0 {
        return slit;
    }
    let to_gripper = gripper.pose.inverse();
    let bodies = world.model.bodies();
    let whole = |k: usize| bodies[k].name().split('.').next().unwrap_or_default();
    // Faces of the surface: their corners at rest, in an order of their own, and where they are.
    let mut faces: Vec<([[u64; 3]; 3], [DVec3; 3])> = Vec::new();
    for (k, body) in bodies.iter().enumerate().filter(|(k, _)| whole(*k) == whole(organ)) {
        let mesh = TetMesh { vertices: body.rest_positions().to_vec(), tets: body.tets().to_vec() };
        let places = world.state.positions(&world.model, k);
        for (t, across) in mesh.neighbours().iter().enumerate() {
            for corner in (0..4).filter(|corner| across[*corner].is_none()) {
                let nodes = [1, 2, 3].map(|c| mesh.tets[t][(corner + c) % 4] as usize);
                let mut key = nodes.map(|i| mesh.vertices[i].to_array().map(f64::to_bits));
                key.sort_unstable();
                faces.push((key, nodes.map(|i| to_gripper.transform(places[i]))));
            }
        }
    }
    faces.sort_by_key(|face| face.0);
    let near = NEAR_PLANE * bodies[organ].median_edge();
    let mut covered: Vec<Vec<[f64; 2]>> = vec![Vec::new(); slit.len()];
    for pair in faces.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        let corners = pair[0].1;
        if corners.iter().all(|p| p.z.abs() < near) {
            let count = covered.len();
            across(&corners.map(DVec3::truncate), count, |k, interval| covered[k].push(interval));
        }
    }
    for (length, intervals) in slit.iter_mut().zip(&mut covered) {
        intervals.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let mut end = f64::NEG_INFINITY;
        for [low, high] in intervals {
            *length += (*high - low.max(end)).max(0.0);
            end = end.max(*high);
        }
    }
    slit
}

/// Calls `each` with the stations among `count` that a convex polygon covers, and its extent across
/// the closing plane there. Its `corners` are in any order.
fn across(corners: &[DVec2], count: usize, mut each: impl FnMut(usize, [f64; 2])) {
    let extent = |of: fn(f64, f64) -> f64, from: f64| corners.iter().map(|p| p.x).fold(from, of);
    let (from, to) = (extent(f64::min, f64::INFINITY), extent(f64::max, f64::NEG_INFINITY));
    let first = ((from - JAW_REGION_BEGIN) / STATION - 0.5).ceil().max(0.0) as usize;
    for k in (first..count).take_while(|k| place(*k) <= to) {
        let x = place(k);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        // Sides and diagonals: the extremes lie on sides.
        for (i, a) in corners.iter().enumerate() {
            for b in &corners[i + 1..] {
                if (a.x - x) * (b.x - x) <= 0.0 && a.x != b.x {
                    let y = a.y + (b.y - a.y) * (x - a.x) / (b.x - a.x);
                    (low, high) = (low.min(y), high.max(y));
                }
            }
        }
        if low < high {
            each(k, [low, high]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polygon_covers_its_stations_once() {
        // A square of 4 mm, turned by 45 degrees, in any order of its corners.
        let corners = [[10e-3, 2e-3], [10e-3, -2e-3], [12e-3, 0.0], [8e-3, 0.0]].map(DVec2::from);
        let mut area = 0.0;
        across(&corners, count(0.021), |_, [low, high]| area += STATION * (high - low));
        assert!((area / 8e-6 - 1.0).abs() < 1e-3, "{area}");
    }
}
