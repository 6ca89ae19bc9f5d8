//! Where a grasp may form: disjoint clusters of about 1 cm along an organ's axis (paper section
//! IV-C).
//!
//! A cluster's index is its position along the organ.

use crate::World;
use glam::DVec3;
use trocar_tissue::Body;

/// Length of a cluster along the axis (m).
const CLUSTER_LENGTH: f64 = 0.010;

/// A cluster is at least this many median edges long. So every cluster of a coarsely meshed large
/// organ has nodes.
const CLUSTER_EDGES: f64 = 1.5;

/// Nodes nearer to pinned tissue than this (m), or than this many median edges, are in no cluster
/// if others are: a rigid cluster nearer to pinned tissue would overstretch the tissue between.
const CLEARANCE: f64 = 0.005;
const CLEARANCE_EDGES: f64 = 1.5;

const CLEARANCE_HALVINGS: u32 = 3;
/// Minimum number of nodes of a grasp, if the organ has as many.
pub(crate) const MIN_HELD_NODES: usize = 8;

/// So many nodes far from pins are enough for a cluster.
const MIN_CLEAR_NODES: usize = 12;

/// Nodes that are grasped together.
#[derive(Clone, Debug, PartialEq)]
pub struct Cluster {
    /// Organ coordinate of its middle.
    pub s: f64,
    /// Its nodes, ascending; none of them pinned or in one element with a pinned node.
    pub nodes: Vec<u32>,
    /// Whether pinned tissue is far enough away for the cluster to be lifted freely.
    pub clear: bool,
}

/// The clusters of the free part of organ `organ`, from base to tip; parts without free nodes have
/// none.
///
/// Nodes that share an element with a pinned one belong to no cluster: an element with all nodes
/// prescribed cannot deform, and a rigid cluster next to pinned tissue would invert it.
pub fn clusters(world: &World, organ: usize) -> Vec<Cluster> {
    let (axis, body) = (&world.axes[organ], &world.model.bodies()[organ]);
    let length = CLUSTER_LENGTH.max(CLUSTER_EDGES * body.median_edge());
    let count = ((axis.length / length).round() as usize).max(1);
    let mut clusters: Vec<Cluster> =
        (0..count).map(|k| Cluster { s: (k as f64 + 0.5) / count as f64, nodes: Vec::new(), clear: false }).collect();
    for i in not_beside_pins(body) {
        let k = ((axis.s[i as usize] * count as f64) as usize).min(count - 1);
        clusters[k].nodes.push(i);
    }
    let clearance = CLEARANCE.max(CLEARANCE_EDGES * body.median_edge());
    let rest = body.rest_positions();
    let mut pinned: Vec<DVec3> = (0..rest.len()).filter(|i| body.pinned()[*i]).map(|i| rest[i]).collect();
    pinned.sort_by(|a, b| a.x.total_cmp(&b.x));
    for cluster in &mut clusters {
        keep_clear(cluster, rest, &pinned, clearance);
    }
    clusters.retain(|c| !c.nodes.is_empty());
    clusters
}

/// Nodes that share no element with a pinned one, ascending.
fn not_beside_pins(body: &Body) -> impl Iterator<Item = u32> + use<> {
    let mut free: Vec<bool> = body.pinned().iter().map(|p| !p).collect();
    for tet in body.tets() {
        if tet.iter().any(|i| body.pinned()[*i as usize]) {
            tet.iter().for_each(|i| free[*i as usize] = false);
        }
    }
    (0..free.len() as u32).filter(move |i| free[*i as usize])
}

/// Removes the cluster's nodes within `clearance` (m) of pinned tissue at rest. If too few are
/// left, the clearance is halved, and so on. Nodes are at `rest` (m), `pinned` ones ascend along x.
fn keep_clear(cluster: &mut Cluster, rest: &[DVec3], pinned: &[DVec3], clearance: f64) {
    // Beyond the clearance it does not matter how far.
    let gap = |i: u32| {
        let p = rest[i as usize];
        let first = pinned.partition_point(|q| q.x < p.x - clearance);
        let near = pinned[first..].iter().take_while(|q| q.x <= p.x + clearance);
        near.map(|q| q.distance_squared(p)).fold(f64::INFINITY, f64::min).sqrt()
    };
    let gaps: Vec<(u32, f64)> = cluster.nodes.iter().map(|i| (*i, gap(*i))).collect();
    for halvings in 0..=CLEARANCE_HALVINGS {
        let least = clearance / f64::from(1u32 << halvings);
        let clear: Vec<u32> = gaps.iter().filter(|(_, gap)| *gap >= least).map(|(i, _)| *i).collect();
        if clear.len() >= MIN_CLEAR_NODES {
            cluster.nodes = clear;
            cluster.clear = halvings == 0;
            return;
        }
    }
}

impl Cluster {
    /// The part of the cluster that jaws from above can grasp: its nodes within `reach` (m) of its
    /// highest region. Jaws hold the whole cross-section of a slender organ and the top of a liver.
    pub fn within_reach(&self, world: &World, organ: usize, reach: f64) -> Self {
        let position = |i: u32| world.state.position(&world.model, organ, i as usize);
        let centroid = self.centroid(world, organ);
        // Highest node, one straight above the centroid preferred over one at the side.
        let score = |i: u32| {
            let d = position(i) - centroid;
            let height = d.dot(world.up);
            height - 0.5 * (d - height * world.up).length()
        };
        let Some(top) = self.nodes.iter().copied().max_by(|a, b| score(*a).total_cmp(&score(*b))) else {
            return self.clone();
        };
        let centre = position(top) - 0.5 * reach * world.up;
        let nodes = self.nodes.iter().copied().filter(|i| (position(*i) - centre).length() <= reach).collect();
        Self { s: self.s, nodes, clear: self.clear }
    }

    /// Centroid of the cluster's nodes now (m).
    pub fn centroid(&self, world: &World, organ: usize) -> DVec3 {
        world.state.centroid(&world.model, organ, &self.nodes)
    }
}
