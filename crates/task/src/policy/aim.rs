//! Where an instrument goes to have a place of an organ in its mouth.

use crate::{Error, Result};
use glam::{DMat3, DQuat, DVec3};
use trocar_cell::{Cell, clusters};
use trocar_core::Pose;
use trocar_robot::instrument::Coordinates;
use trocar_robot::port::Solution;

/// Nodes within this organ coordinate to either side tell where the organ is there.
const SLICE: f64 = 0.04;

/// How far to either side the direction of the organ is taken from.
const CHORD: f64 = 0.08;

/// Jaws hold nodes within this distance of the middle of what they pinch [m].
const REACH: f64 = 0.009;

/// Fewest nodes that are worth a grasp.
const FEWEST: usize = 8;

/// A tip's pose, and the coordinates nearest to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Aim {
    pub pose: Pose,
    pub coordinates: Coordinates,
    /// How far the tip stays from where it should be [m].
    pub missed: f64,
    /// Organ coordinate.
    pub s: f64,
}

/// Middle of the organ at organ coordinate `s` as it is now [m]: of its nodes there.
pub(super) fn middle(cell: &Cell, body: usize, s: f64) -> Option<DVec3> {
    let (world, mut wide) = (cell.world(), SLICE);
    // A coarse mesh may have no node in a thin slice.
    while wide < 0.6 {
        let near = |i: &u32| (world.axes[body].s[*i as usize] - s).abs() <= wide;
        let nodes: Vec<u32> = (0..world.axes[body].s.len() as u32).filter(near).collect();
        if nodes.len() >= FEWEST {
            return Some(world.state.centroid(&world.model, body, &nodes));
        }
        wide *= 2.0;
    }
    None
}

/// Direction of the organ at `s` as it lies now.
fn along(cell: &Cell, body: usize, s: f64) -> DVec3 {
    let at = |s: f64| middle(cell, body, s.clamp(0.0, 1.0)).unwrap_or(DVec3::ZERO);
    at(s + CHORD) - at(s - CHORD)
}

/// The aim of `arm` at the cluster of `body` nearest to `s` that may be grasped, `depth` [m] from the pivot in its mouth.
pub(super) fn grasp(cell: &Cell, arm: &str, body: usize, s: f64, range: [f64; 2], depth: f64) -> Result<Aim> {
    let world = cell.world();
    let mut all: Vec<_> = clusters(world, body).iter().map(|c| c.within_reach(world, body, REACH)).collect();
    let clear = |c: &trocar_cell::Cluster| c.clear && c.nodes.len() >= FEWEST && (range[0]..=range[1]).contains(&c.s);
    if all.iter().any(clear) {
        all.retain(clear);
    }
    let nearest = all.into_iter().min_by(|a, b| (a.s - s).abs().total_cmp(&(b.s - s).abs()));
    let Some(cluster) = nearest else {
        let name = world.model.bodies()[body].name();
        return Err(Error::Option(format!("organ '{name}' has no free node to grasp: all are pinned; pin fewer")));
    };
    at(cell, arm, body, cluster.s, cluster.centroid(world, body), depth)
}

/// The aim of `arm` at a point of `body` near `s`: shaft through the port, jaws across the organ, the point `depth` [m] from the pivot.
pub(super) fn at(cell: &Cell, arm: &str, body: usize, s: f64, point: DVec3, depth: f64) -> Result<Aim> {
    let along = along(cell, body, s);
    let x = (point - cell.port(arm)?.centre()).normalize_or(-DVec3::Z);
    let hinge = (along - along.dot(x) * x).try_normalize().unwrap_or_else(|| x.any_orthonormal_vector());
    let pose = |z: DVec3| {
        let rotation = DQuat::from_mat3(&DMat3::from_cols(x, z.cross(x), z)).normalize();
        Pose { rotation, translation: point - depth * x }
    };
    // The blades are alike: of the two ways round, the one that the wrist reaches with less of a turn.
    let near = Coordinates { jaw: 1.0, ..cell.setpoint(arm)? };
    let turn = |s: &Solution| (s.coordinates.roll - near.roll).abs() + 10.0 * s.excess.roll.abs();
    let (a, b) = (cell.solve(arm, &pose(hinge), &near)?, cell.solve(arm, &pose(-hinge), &near)?);
    let best = if turn(&a) <= turn(&b) { a } else { b };
    Ok(Aim { pose: best.tip, coordinates: best.coordinates, missed: best.rejected_translation.length(), s })
}

/// A part of the way between two places; the jaw is that of the second.
pub(super) fn between(from: &Coordinates, to: &Coordinates, share: f64) -> Coordinates {
    let mix = |a: f64, b: f64| a + share * (b - a);
    Coordinates {
        pivots: [mix(from.pivots[0], to.pivots[0]), mix(from.pivots[1], to.pivots[1])],
        insertion: mix(from.insertion, to.insertion),
        roll: mix(from.roll, to.roll),
        jaw: to.jaw,
    }
}

/// 0 to 1 with both ends at rest.
pub(super) fn eased(share: f64) -> f64 {
    let t = share.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
