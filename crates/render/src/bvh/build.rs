//! Builds the nodes: obvhs builds a binary tree, which is collapsed to eight children per node;
//! then the boxes are fitted.

use super::node::{Bounds, LEAF_BIT, MAX_DEPTH, NO_CHILD, Node, WIDTH};
use glam::Vec3A;
use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, builder::build_bvh2};
use obvhs::{Boundable, BvhBuildParams};

impl Boundable for Bounds {
    fn aabb(&self) -> Aabb {
        Aabb { min: self.low, max: self.high }
    }
}

/// Builds nodes over the boxes that are not empty. Parents precede their children. `leaves`
/// receives the boxes of each leaf, at most `most` per leaf.
pub(super) fn build(bounds: &[Bounds], most: usize, leaves: &mut Vec<Vec<u32>>) -> Vec<Node> {
    let used: Vec<u32> =
        (0..bounds.len() as u32).filter(|i| bounds[*i as usize].low.x <= bounds[*i as usize].high.x).collect();
    let all = used.iter().fold(Bounds::EMPTY, |b, i| b.with(bounds[*i as usize].low).with(bounds[*i as usize].high));
    if used.is_empty() {
        return Vec::new();
    }
    // obvhs has absolute tolerances, so the boxes are scaled to the unit cube.
    let middle = 0.5 * (all.low + all.high);
    let scale = 2.0 / (all.high - all.low).max_element().max(1e-12);
    let scaled: Vec<Bounds> = used
        .iter()
        .map(|i| {
            let Bounds { low, high } = bounds[*i as usize];
            Bounds { low: (low - middle) * scale, high: (high - middle) * scale }
        })
        .collect();
    // Leaves are fuller than obvhs's default, because eight triangles cost as much as one. Trees
    // over bodies are built every frame and use the fast settings.
    let better = BvhBuildParams {
        reinsertion_batch_ratio: 0.15,
        post_collapse_reinsertion_batch_ratio_multiplier: 1.0,
        collapse_traversal_cost: 6.0,
        ..BvhBuildParams::medium_build()
    };
    let base = if most > 1 { better } else { BvhBuildParams::fast_build() };
    let parameters = BvhBuildParams { max_prims_per_leaf: most as u32, ..base };
    let two = build_bvh2(&scaled, parameters, &mut std::time::Duration::default());
    if let Some(nodes) = collapse(&two, &used, most, leaves) {
        return nodes;
    }
    leaves.clear();
    let ordered: Vec<u32> = two.primitive_indices.iter().map(|i| used[*i as usize]).collect();
    by_order(&ordered, most, leaves)
}

/// Collapses binary nodes to eight-wide nodes, opening the largest boxes first; `None` if the
/// result is too deep.
fn collapse(two: &Bvh2, used: &[u32], most: usize, leaves: &mut Vec<Vec<u32>>) -> Option<Vec<Node>> {
    let mut nodes = vec![EMPTY_NODE];
    // Binary node, its eight-wide node, depth.
    let mut open = vec![(0_usize, 0_usize, 1_usize)];
    while let Some((root, at, depth)) = open.pop() {
        if depth > MAX_DEPTH {
            return None;
        }
        let mut members = vec![root];
        while members.len() < WIDTH {
            let area = |i: usize| two.nodes[i].aabb().half_area();
            let widest = (0..members.len())
                .filter(|m| !two.nodes[members[*m]].is_leaf())
                .max_by(|a, b| area(members[*a]).total_cmp(&area(members[*b])));
            let Some(widest) = widest else { break };
            let first = two.nodes[members[widest]].first_index as usize;
            members[widest] = first;
            members.push(first + 1);
        }
        for (lane, member) in members.into_iter().enumerate() {
            let node = &two.nodes[member];
            nodes[at].child[lane] = if node.is_leaf() {
                let first = node.first_index as usize;
                let held = two.primitive_indices.get(first..first + node.prim_count as usize)?;
                if held.len() > most {
                    return None;
                }
                leaves.push(held.iter().map(|i| used[*i as usize]).collect());
                LEAF_BIT | (leaves.len() as u32 - 1)
            } else {
                nodes.push(EMPTY_NODE);
                open.push((member, nodes.len() - 1, depth + 1));
                nodes.len() as u32 - 1
            };
        }
    }
    Some(nodes)
}

/// Builds a balanced tree over boxes in their given order.
pub(super) fn by_order(order: &[u32], most: usize, leaves: &mut Vec<Vec<u32>>) -> Vec<Node> {
    leaves.extend(order.chunks(most).map(<[u32]>::to_vec));
    let mut nodes = vec![EMPTY_NODE];
    let mut open = vec![(0..leaves.len(), 0_usize)];
    while let Some((range, at)) = open.pop() {
        let part = range.len().div_ceil(WIDTH).max(1);
        for lane in 0..WIDTH {
            let start = range.start + lane * part;
            let held = start..range.end.min(start + part);
            nodes[at].child[lane] = match held.len() {
                0 => NO_CHILD,
                1 => LEAF_BIT | start as u32,
                _ => {
                    nodes.push(EMPTY_NODE);
                    open.push((held, nodes.len() - 1));
                    nodes.len() as u32 - 1
                }
            };
            if start + part >= range.end {
                break;
            }
        }
    }
    nodes
}

const EMPTY_NODE: Node = Node { bounds: [[f32::NAN; WIDTH]; 6], child: [NO_CHILD; WIDTH] };

/// Fits the boxes from the leaves up. Children follow their parents.
pub(super) fn fit(nodes: &mut [Node], mut leaf_bounds: impl FnMut(u32) -> Bounds) {
    for at in (0..nodes.len()).rev() {
        for lane in 0..WIDTH {
            let bounds = match nodes[at].child[lane] {
                NO_CHILD => Bounds::EMPTY,
                leaf if leaf & LEAF_BIT != 0 => leaf_bounds(leaf & !LEAF_BIT),
                inner => bounds_of_node(&nodes[inner as usize]),
            };
            for k in 0..3 {
                nodes[at].bounds[k][lane] = bounds.low[k];
                nodes[at].bounds[k + 3][lane] = bounds.high[k];
            }
        }
    }
}

/// The box around the children of a node.
pub(super) fn bounds_of_node(node: &Node) -> Bounds {
    let least = |k: usize| node.bounds[k].iter().copied().fold(f32::INFINITY, f32::min);
    let most = |k: usize| node.bounds[k].iter().copied().fold(f32::NEG_INFINITY, f32::max);
    Bounds { low: Vec3A::new(least(0), least(1), least(2)), high: Vec3A::new(most(3), most(4), most(5)) }
}
