//! What the gripper takes hold of.

use crate::clusters::FEWEST_HELD;
use crate::{Cluster, Error, Gripper, Result, World, clusters, gripper};
use glam::DVec3;

/// Jaws hold nodes within this distance of the middle of what they pinch [m] (half a cluster and
/// the blades' reach) ...
const REACH: f64 = 0.009;
/// ... or within this many median edges on a coarse mesh.
const REACH_EDGES: f64 = 1.5;

/// A cluster clear of pins is preferred to one that is not, even if it is this much farther along
/// the organ.
const WORTH_GOING: f64 = 0.1;

/// A cluster and the gripper over it, decided once the organs have settled.
pub(crate) struct Target {
    /// The nodes to take hold of.
    pub cluster: Cluster,
    /// Gripper over the cluster, jaws open.
    pub open: Gripper,
    /// Angle at which the blades touch the tissue [rad]: where jaws that feel nothing stop.
    pub touching_angle: f64,
    /// How far jaws reach from the middle of what they pinch [m].
    pub reach: f64,
}

/// How far jaws reach from the middle of what they pinch of organ `organ` [m].
pub(crate) fn reach_into(world: &World, organ: usize) -> f64 {
    REACH.max(REACH_EDGES * world.model.bodies()[organ].median_edge())
}

impl Target {
    /// The gripper comes `offset` [m] beside it, towards its +y. Chooses the cluster of organ
    /// `organ` nearest to organ coordinate `at`, clear of pins if one is near, of which jaws from
    /// above reach enough nodes.
    ///
    /// # Errors
    /// When the organ has no free node.
    pub fn choose(world: &World, organ: usize, at: f64, offset: f64) -> Result<Self> {
        let body = &world.model.bodies()[organ];
        let reach = reach_into(world, organ);
        let mut within: Vec<Cluster> =
            clusters(world, organ).iter().map(|c| c.within_reach(world, organ, reach)).collect();
        let distance = |c: &Cluster| (c.s - at).abs();
        // A stable sort: of equally near ones the first. One clear of pins is worth going a little
        // farther for.
        let rank = |c: &Cluster| distance(c) + if c.clear { 0.0 } else { WORTH_GOING };
        within.sort_by(|a, b| rank(a).total_cmp(&rank(b)));
        let enough = within.iter().position(|c| c.nodes.len() >= FEWEST_HELD).unwrap_or(0);
        let Some(cluster) = within.into_iter().nth(enough) else {
            return Err(Error::Option(format!(
                "organ '{}' has no free node to grasp: all are pinned or next to a pinned one; pin fewer",
                body.name()
            )));
        };
        let axis = &world.axes[organ];
        let along = axis.point_at((cluster.s + 0.05).min(1.0)) - axis.point_at((cluster.s - 0.05).max(0.0));
        let mut open = Gripper::over(cluster.centroid(world, organ), world.up, along, gripper::MAX_ANGLE);
        let jaw = open.pose.inverse();
        let across = |i: &u32| jaw.transform(world.state.position(&world.model, organ, *i as usize)).y.abs();
        let half_width = cluster.nodes.iter().map(across).fold(0.0, f64::max);
        let touching_angle = Gripper::angle_for(half_width);
        open.pose.translation += open.pose.rotation * (offset * DVec3::Y);
        Ok(Self { cluster, open, touching_angle, reach })
    }
}
