//! How far jaws reach into an organ.

use crate::World;

/// Jaws hold nodes within this distance of the middle of the pinched tissue (m): half a cluster and
/// the blades' reach.
const REACH: f64 = 0.009;

/// On a coarse mesh they hold nodes within this many median edges.
const REACH_EDGES: f64 = 1.5;

/// Reach of jaws from the middle of the pinched tissue of organ `organ` (m).
pub fn reach_into(world: &World, organ: usize) -> f64 {
    REACH.max(REACH_EDGES * world.model.bodies()[organ].median_edge())
}
