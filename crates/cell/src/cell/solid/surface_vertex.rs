//! A vertex of the surface with which an organ touches.

use crate::World;
use glam::DVec3;

/// A vertex of a surface.
#[derive(Clone, Copy)]
pub(super) struct SurfaceVertex {
    /// The node that it is, or that bears most of it: for holes.
    pub node: u32,
    /// (m)
    pub place: DVec3,
    /// Whether all nodes that bear it are pinned.
    pub is_pinned: bool,
}

impl SurfaceVertex {
    /// Vertex `i` of the collision surface of `organ`, or its node `i` without one.
    pub fn of(world: &World, organ: usize, i: u32) -> Self {
        let body = &world.model.bodies()[organ];
        let (place, pinned) = (Self::place(world, organ, i), |node: u32| body.pinned()[node as usize]);
        let Some(surface) = body.collision_surface() else { return Self { node: i, place, is_pinned: pinned(i) } };
        let (nodes, weights) = surface.nodes_of(i as usize);
        let bearing = || nodes.into_iter().zip(weights).filter(|(_, weight)| *weight != 0.0);
        let node = bearing().max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(node, _)| node);
        Self { node, place, is_pinned: bearing().all(|(node, _)| pinned(node)) }
    }

    /// Where it is now (m).
    pub fn place(world: &World, organ: usize, i: u32) -> DVec3 {
        match world.model.bodies()[organ].collision_surface() {
            Some(_) => world.state.collision_position(&world.model, organ, i as usize),
            None => world.state.position(&world.model, organ, i as usize),
        }
    }
}
