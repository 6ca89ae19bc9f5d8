//! How tissue in the jaws has moved since they closed on it: lift and slip (SPEC, Definitions).

use crate::World;
use glam::DVec3;
use trocar_geometry::Pose;

/// The tissue that was in the jaws when they closed, and where it was.
pub(crate) struct Hold {
    organ: usize,
    nodes: Vec<u32>,
    centroid: DVec3,
    centroid_in_jaw: DVec3,
    jaw: DVec3,
}

/// What has become of it [m].
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Moved {
    pub jaw_lift: f64,
    pub tissue_lift: f64,
    pub slip: f64,
}

impl Hold {
    /// `nodes` of organ `organ` are in the jaws of a gripper at `pose` now.
    pub fn new(world: &World, organ: usize, nodes: Vec<u32>, pose: &Pose) -> Self {
        let centroid = world.state.centroid(&world.model, organ, &nodes);
        let centroid_in_jaw = pose.inverse().transform(centroid);
        Self { organ, nodes, centroid, centroid_in_jaw, jaw: pose.translation }
    }

    /// How far all has moved by the time that the gripper is at `pose`.
    pub fn moved(&self, world: &World, pose: &Pose) -> Moved {
        let centroid = world.state.centroid(&world.model, self.organ, &self.nodes);
        Moved {
            jaw_lift: (pose.translation - self.jaw).dot(world.up),
            tissue_lift: (centroid - self.centroid).dot(world.up),
            slip: pose.inverse().transform(centroid).distance(self.centroid_in_jaw),
        }
    }
}
