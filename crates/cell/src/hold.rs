//! Motion of grasped tissue since the jaws closed: lift and slip (see the glossary).

use crate::World;
use glam::DVec3;
use trocar_core::Pose;
use trocar_tissue::Piece;

/// The tissue that was in the jaws when they closed, and its place then.
#[derive(Clone, Debug)]
pub(crate) struct Hold {
    organ: usize,
    nodes: Vec<u32>,
    centroid: DVec3,
    centroid_in_jaw: DVec3,
    jaw: DVec3,
}

/// Its motion since then (m).
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Moved {
    pub jaw_lift: f64,
    pub tissue_lift: f64,
    pub slip: f64,
}

impl Hold {
    /// A hold on `nodes` of organ `organ` by a gripper that is at `pose` now.
    pub fn new(world: &World, organ: usize, nodes: Vec<u32>, pose: &Pose) -> Self {
        let centroid = world.state.centroid(&world.model, organ, &nodes);
        let centroid_in_jaw = pose.inverse().transform(centroid);
        Self { organ, nodes, centroid, centroid_in_jaw, jaw: pose.translation }
    }

    /// Follows a cut of the organ into `pieces`, bodies of `world`: the hold continues on the piece
    /// with most of its nodes. `pose` is the gripper's now; `was` is the nodes' centroid before the
    /// cut (m).
    pub fn follow(&mut self, world: &World, pieces: &[Piece], pose: &Pose, was: DVec3) {
        let mut held = self.nodes.clone();
        held.sort_unstable();
        let of = |piece: &Piece| -> Vec<u32> {
            let is_held = |k: &u32| held.binary_search(&piece.nodes[*k as usize]).is_ok();
            (0..piece.nodes.len() as u32).filter(is_held).collect()
        };
        let mut most: Option<(usize, Vec<u32>)> = None;
        for piece in pieces {
            let nodes = of(piece);
            if most.as_ref().is_none_or(|(_, best)| nodes.len() > best.len()) {
                most = Some((piece.body, nodes));
            }
        }
        let Some((organ, nodes)) = most.filter(|(_, nodes)| !nodes.is_empty()) else { return };
        (self.organ, self.nodes) = (organ, nodes);
        // Nodes of other pieces do not count as motion.
        let shift = self.now(world) - was;
        self.centroid += shift;
        self.centroid_in_jaw += pose.rotation.inverse() * shift;
    }

    /// Whether no frame has passed since the jaws closed.
    pub fn is_new(&self, world: &World) -> bool {
        self.now(world) == self.centroid
    }

    pub fn numbers(&self) -> impl Iterator<Item = f64> {
        let Self { organ, nodes, centroid, centroid_in_jaw, jaw } = self;
        let vectors = [*centroid, *centroid_in_jaw, *jaw].map(|v| v.to_array());
        vectors.into_iter().flatten().chain([*organ as f64]).chain(nodes.iter().map(|n| f64::from(*n)))
    }

    /// Centroid of the tissue now (m).
    pub fn now(&self, world: &World) -> DVec3 {
        world.state.centroid(&world.model, self.organ, &self.nodes)
    }

    /// The tissue's body and nodes.
    pub fn tissue(&self) -> (usize, &[u32]) {
        (self.organ, &self.nodes)
    }

    /// The motion since the jaws closed, with the gripper at `pose` now.
    pub fn moved(&self, world: &World, pose: &Pose) -> Moved {
        let centroid = self.now(world);
        Moved {
            jaw_lift: (pose.translation - self.jaw).dot(world.up),
            tissue_lift: (centroid - self.centroid).dot(world.up),
            slip: pose.inverse().transform(centroid).distance(self.centroid_in_jaw),
        }
    }
}
