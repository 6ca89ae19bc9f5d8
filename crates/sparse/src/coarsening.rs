//! Coarser graphs: pairs of nodes become one.
//!
//! Heavy edge matching: Karypis and Kumar, "A fast and high quality multilevel scheme for
//! partitioning irregular graphs", 1998.

use crate::graph::{Edge, Graph, NONE};
use std::cmp::Reverse;

/// A coarser graph, and the node of it that each node of the finer graph is in.
pub(crate) struct Coarser {
    pub graph: Graph,
    pub of: Vec<u32>,
}

impl Coarser {
    /// Makes one node of each node and a neighbour: of those that are free and with which it weighs
    /// at most `most`, the one with the heaviest edge. Another `turn` takes the nodes in another
    /// order.
    pub fn new(fine: &Graph, most: u32, turn: u32) -> Self {
        let (pairs, of) = pairs(fine, most, turn);
        // Where the edge to each coarse node is among those of the present one.
        let mut place = vec![0; pairs.len()];
        let (mut graph, mut edges) = (Graph::with_capacity(pairs.len()), Vec::<Edge>::new());
        for (k, [a, b]) in pairs.iter().enumerate() {
            let both = if a == b { &[*a][..] } else { &[*a, *b] };
            for edge in both.iter().flat_map(|i| fine.edges(*i)) {
                let to = of[edge.to as usize];
                if to == k as u32 {
                    continue;
                }
                match edges.get_mut(place[to as usize]).filter(|known| known.to == to) {
                    Some(known) => known.weight += edge.weight,
                    None => {
                        place[to as usize] = edges.len();
                        edges.push(Edge { to, ..*edge });
                    }
                }
            }
            graph.push(both.iter().map(|i| fine.weights[*i as usize]).sum(), edges.drain(..));
        }
        Self { graph, of }
    }
}

/// Pairs of nodes, twice the same for nodes without a partner, and the pair of each node.
fn pairs(graph: &Graph, most: u32, turn: u32) -> (Vec<[u32; 2]>, Vec<u32>) {
    let (mut pairs, mut of) = (Vec::with_capacity(graph.len()), vec![NONE; graph.len()]);
    // Nodes with few neighbours first: later they find no partner.
    let mut order: Vec<u32> = graph.nodes().collect();
    order.sort_by_key(|i| (graph.edges(*i).len(), mixed(*i, turn)));
    for i in order {
        if of[i as usize] != NONE {
            continue;
        }
        let weight = |i: u32| graph.weights[i as usize];
        let fits = |edge: &&Edge| of[edge.to as usize] == NONE && weight(i) + weight(edge.to) <= most;
        let heaviest = |edge: &&Edge| (edge.weight, Reverse(weight(edge.to)), Reverse(mixed(edge.to, turn)));
        let partner = graph.edges(i).iter().filter(fits).max_by_key(heaviest).map_or(i, |edge| edge.to);
        (of[i as usize], of[partner as usize]) = (pairs.len() as u32, pairs.len() as u32);
        pairs.push([i, partner]);
    }
    (pairs, of)
}

/// A number that orders nodes in another way for each `turn`.
fn mixed(i: u32, turn: u32) -> u32 {
    (i ^ turn).wrapping_mul(0x9E37_79B1).rotate_left(turn)
}
