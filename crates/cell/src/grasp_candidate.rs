//! The tissue that jaws grasp at the instant when they have closed.

use crate::jaw_region::attached;
use crate::{GraspDesign, JawRegion, TissueInJaws, World};
use trocar_core::Pose;
use trocar_tissue::Grasp;

/// Tissue that jaws have closed on.
pub(crate) struct GraspCandidate {
    /// Organ coordinate of the attached cluster.
    pub s: f64,
    /// The nodes that are measured, and held by designs that hold nodes.
    pub nodes: Vec<u32>,
}

impl GraspCandidate {
    /// The grasped part of the `tissue` of organ `organ` in the region `mouth`: the attached
    /// cluster, or for friction the tissue between the blades. `None` if no cluster is near.
    /// `reach` is the largest distance of held nodes from the middle of the pinched tissue (m).
    pub fn on(
        world: &World,
        organ: usize,
        region: &JawRegion,
        tissue: TissueInJaws,
        reach: f64,
        design: GraspDesign,
    ) -> Option<Self> {
        let cluster = attached(world, organ, tissue.centroid, reach)?;
        let mut nodes = cluster.nodes;
        if design == GraspDesign::Friction {
            let between = region.nodes_of(world, organ);
            nodes = if between.is_empty() { nodes } else { between };
        }
        Some(Self { s: cluster.s, nodes })
    }

    /// Mean distance of the nodes from their places at rest (m).
    pub fn displaced(&self, world: &World, organ: usize) -> f64 {
        let rest = world.model.bodies()[organ].rest_positions();
        let place = |i: u32| world.state.position(&world.model, organ, i as usize);
        let sum = self.nodes.iter().map(|i| place(*i).distance(rest[*i as usize])).sum::<f64>();
        sum / self.nodes.len().max(1) as f64
    }
}

/// The snap of a grasp: distances of its nodes from where it first prescribes them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Snap {
    /// The largest distance (m).
    pub most: f64,
    /// Their mean (m).
    pub mean: f64,
    /// Nodes held.
    pub nodes: usize,
}

impl Snap {
    /// The snap of a new `grasp` with its tool at `pose`.
    pub fn of(world: &World, grasp: &Grasp, pose: &Pose) -> Self {
        let place = |i: u32| world.state.position(&world.model, grasp.body, i as usize);
        let snaps: Vec<f64> = grasp.prescribed(pose).map(|(i, x)| x.distance(place(i))).collect();
        let most = snaps.iter().copied().fold(0.0, f64::max);
        Self { most, mean: snaps.iter().sum::<f64>() / snaps.len().max(1) as f64, nodes: snaps.len() }
    }
}
