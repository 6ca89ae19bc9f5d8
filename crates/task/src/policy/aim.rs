//! Where an instrument goes to have a place of an organ in its mouth.

use crate::{Error, Result};
use glam::{DMat3, DQuat, DVec3};
use trocar_cell::{Cell, Cluster, Reached, Setpoint, clusters, reach_into};
use trocar_core::Pose;
pub(super) use trocar_core::interpolate::smoothstep as eased;

/// Nodes within this organ coordinate to either side give the organ's place at a coordinate.
const SLICE: f64 = 0.04;

/// How far to either side the direction of the organ is taken from.
const CHORD: f64 = 0.08;

/// A cluster clear of pins is preferred to one that is not, even if it is this much farther along
/// the organ.
const CLEAR_WORTH: f64 = 0.1;

/// Fewest nodes that are worth a grasp.
const FEWEST: usize = 8;

/// A grasper takes tissue this far from the pivot (m): in the middle of its jaws.
const DEPTH: f64 = 0.0115;

/// Tissue wider than this (m) does not fit between the blades, which would press on it and on
/// neighbouring tissue. Their ends then pinch its top: this far below its highest point (m), opened
/// by this share.
const WIDE: f64 = 0.0115;
const DIP: f64 = 0.0035;
const PINCH: f64 = 0.7;

/// Tissue wider than this (m) is so flat between the blades that they have to gather a fold of it:
/// they go deeper by this share of the excess, and open in proportion to the width. They come along
/// the line from the port to the middle of the organ. There both blades meet the tissue at the same
/// slope; beside it one of them would lie flat on it, and the other pierce its flank.
const FLAT: f64 = 0.020;
const DEEPER: f64 = 0.5;

/// Length of the blades (m).
const BLADES: f64 = 0.021;

/// A tip's pose, and the coordinates nearest to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Aim {
    pub pose: Pose,
    pub setpoint: Setpoint,
    /// Distance of the tip from the wanted place (m).
    pub missed: f64,
    /// Organ coordinate.
    pub s: f64,
    /// Whether the blades gather a fold of tissue that is much wider than they open.
    pub folds: bool,
}

/// The nodes of the organ at organ coordinate `s`.
fn slice(cell: &Cell, body: usize, s: f64) -> Option<Vec<u32>> {
    let (axis, mut wide) = (&cell.world().axes[body], SLICE);
    // A coarse mesh may have no node in a thin slice.
    while wide < 0.6 {
        let near = |i: &u32| (axis.s[*i as usize] - s).abs() <= wide;
        let nodes: Vec<u32> = (0..axis.s.len() as u32).filter(near).collect();
        if nodes.len() >= FEWEST {
            return Some(nodes);
        }
        wide *= 2.0;
    }
    None
}

/// Middle of the organ at organ coordinate `s` as it is now (m): of its nodes there.
pub(super) fn middle(cell: &Cell, body: usize, s: f64) -> Option<DVec3> {
    let world = cell.world();
    Some(world.state.centroid(&world.model, body, &slice(cell, body, s)?))
}

/// For jaws that come along `x`: the width of the organ at `s` across its direction, and its height
/// above `point` (m).
fn width_and_height(cell: &Cell, body: usize, s: f64, x: DVec3, point: DVec3) -> (f64, f64) {
    let world = cell.world();
    let across = along(cell, body, s).cross(x).normalize_or_zero();
    let (mut low, mut high, mut top) = (f64::INFINITY, f64::NEG_INFINITY, 0.0_f64);
    for i in slice(cell, body, s).unwrap_or_default() {
        let from = world.state.position(&world.model, body, i as usize) - point;
        (low, high) = (low.min(from.dot(across)), high.max(from.dot(across)));
        top = top.max(-from.dot(x));
    }
    ((high - low).max(0.0), top)
}

/// Direction of the organ at `s` as it lies now.
fn along(cell: &Cell, body: usize, s: f64) -> DVec3 {
    let at = |s: f64| middle(cell, body, s.clamp(0.0, 1.0)).unwrap_or(DVec3::ZERO);
    at(s + CHORD) - at(s - CHORD)
}

/// The cluster of `body` nearest to `s` that may be grasped. Clusters that are clear of pins and
/// lie in `range` come first, if there are any.
fn cluster_in_range(cell: &Cell, body: usize, s: f64, range: [f64; 2]) -> Option<Cluster> {
    let world = cell.world();
    let reach = reach_into(world, body);
    let mut all: Vec<_> = clusters(world, body).iter().map(|c| c.within_reach(world, body, reach)).collect();
    let clear = |c: &Cluster| c.clear && c.nodes.len() >= FEWEST && (range[0]..=range[1]).contains(&c.s);
    if all.iter().any(clear) {
        all.retain(clear);
    }
    all.into_iter().min_by(|a, b| (a.s - s).abs().total_cmp(&(b.s - s).abs()))
}

/// The cluster of `body` nearest to `s` that jaws from above reach enough nodes of. One that is
/// clear of pins is preferred even if it is a little farther along the organ.
fn cluster_at(cell: &Cell, body: usize, s: f64) -> Option<Cluster> {
    let world = cell.world();
    let reach = reach_into(world, body);
    let mut all: Vec<_> = clusters(world, body).iter().map(|c| c.within_reach(world, body, reach)).collect();
    let rank = |c: &Cluster| (c.s - s).abs() + if c.clear { 0.0 } else { CLEAR_WORTH };
    all.sort_by(|a, b| rank(a).total_cmp(&rank(b)));
    let enough = all.iter().position(|c| c.nodes.len() >= FEWEST).unwrap_or(0);
    all.into_iter().nth(enough)
}

/// The side of the organ's middle on which it is free: 1 towards its tip, -1 towards its base.
fn free_side(cell: &Cell, body: usize) -> f64 {
    let (world, organ) = (cell.world(), &cell.world().model.bodies()[body]);
    let pinned = (0..organ.len()).filter(|i| organ.pinned()[*i]).map(|i| world.axes[body].s[i] - 0.5);
    if pinned.sum::<f64>() > 0.0 { -1.0 } else { 1.0 }
}

/// Where a grasp is to be.
#[derive(Clone, Copy, Debug)]
pub(super) enum Place {
    /// In a range of organ coordinates, so far from its middle, away from where the organ is held.
    InRange([f64; 2], f64),
    /// At an organ coordinate.
    At(f64),
}

/// How the blades come to the tissue.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Manner {
    /// Round it where it is narrow enough, else at its top.
    #[default]
    Fitting,
    /// At its top.
    Pinching,
}

/// The aim of `arm` at the cluster of `body` at `place`, `aside` (m) of the closing plane of its
/// blades, with the opening to come with.
pub(super) fn grasp(cell: &Cell, arm: &str, body: usize, (place, manner): (Place, Manner), aside: f64) -> Result<Aim> {
    let cluster = match place {
        Place::InRange(range, outward) => {
            let s = 0.5 * (range[0] + range[1]) + outward * free_side(cell, body);
            cluster_in_range(cell, body, s.clamp(range[0], range[1]), range)
        }
        Place::At(s) => cluster_at(cell, body, s),
    };
    let Some(cluster) = cluster else {
        let name = cell.world().model.bodies()[body].name();
        return Err(Error::Option(format!("organ '{name}' has no free node to grasp: all are pinned; pin fewer")));
    };
    let towards = |point: DVec3| -> Result<(DVec3, (f64, f64))> {
        let x = cell.workspace(arm)?.direction_to(point);
        Ok((point, width_and_height(cell, body, cluster.s, x, point)))
    };
    let (mut point, (mut width, mut height)) = towards(cluster.centroid(cell.world(), body))?;
    if let Some(middle) = middle(cell, body, cluster.s).filter(|_| width > FLAT) {
        (point, (width, height)) = towards(middle)?;
    }
    let fits = width <= WIDE && manner == Manner::Fitting;
    let folds = width > FLAT;
    let (depth, jaw) = match (fits, folds) {
        (true, _) => (DEPTH, 1.0),
        (false, false) => (height + BLADES - DIP, PINCH),
        (false, true) => (height + BLADES - DIP - DEEPER * (width - FLAT), (PINCH * width / FLAT).min(1.0)),
    };
    let mut aim = at(cell, arm, body, cluster.s, point, depth)?;
    (aim.setpoint, aim.folds) = (aim.setpoint.with_jaw(jaw), folds);
    if aside == 0.0 {
        return Ok(aim);
    }
    beside(cell, arm, &aim, aside * (aim.pose.rotation * DVec3::Y))
}

/// The same aim, moved by `by` (m, cell).
pub(super) fn beside(cell: &Cell, arm: &str, aim: &Aim, by: DVec3) -> Result<Aim> {
    let tip = Pose { translation: aim.pose.translation + by, ..aim.pose };
    let reached = cell.solve(arm, &tip, &aim.setpoint)?;
    Ok(Aim { pose: tip, setpoint: reached.setpoint, missed: reached.rejected_translation.length(), ..*aim })
}

/// The aim of `arm` at a point of `body` near `s`: shaft through the port, jaws across the organ,
/// the point `depth` (m) from the pivot.
pub(super) fn at(cell: &Cell, arm: &str, body: usize, s: f64, point: DVec3, depth: f64) -> Result<Aim> {
    let along = along(cell, body, s);
    let workspace = cell.workspace(arm)?;
    let x = workspace.direction_to(point);
    let hinge = (along - along.dot(x) * x).try_normalize().unwrap_or_else(|| x.any_orthonormal_vector());
    let pose = |z: DVec3| {
        let rotation = DQuat::from_mat3(&DMat3::from_cols(x, z.cross(x), z)).normalize();
        Pose { rotation, translation: point - depth * x }
    };
    // The blades are alike: of the two ways round, the one that the wrist reaches with less of a
    // turn.
    let near = cell.setpoint(arm)?.with_jaw(1.0);
    let turn = |s: &Reached| (s.setpoint.roll() - near.roll()).abs() + 10.0 * s.roll_excess.abs();
    let (a, b) = (workspace.solve(&pose(hinge), &near)?, workspace.solve(&pose(-hinge), &near)?);
    let best = if turn(&a) <= turn(&b) { a } else { b };
    let missed = best.rejected_translation.length();
    Ok(Aim { pose: best.tip, setpoint: best.setpoint, missed, s, folds: false })
}
