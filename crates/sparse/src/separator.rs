//! Separators made smaller by moving nodes in and out of them.
//!
//! Fiduccia and Mattheyses, "A linear-time heuristic for improving network partitions", 1982, for
//! vertex separators as in Hendrickson and Rothberg, "Improving the run time and quality of nested
//! dissection ordering", 1998. A node leaves the separator for one half and pulls its neighbours in
//! the other half into the separator. Moves that make the separator larger are made too: a pass
//! ends where it was smallest.

use crate::graph::Graph;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// The side of nodes in the separator; the halves are 1 and 2.
pub(crate) const SEPARATOR: u8 = 0;

/// No node moves to a half that has more than this share of the weight then.
const MAX_HALF: f64 = 0.6;

/// A pass ends after so many moves in a row that did not improve the cut: the weight of the
/// separator, within these bounds.
const PATIENCE: [u32; 2] = [8, 50];

/// Passes at most.
const MAX_PASSES: usize = 4;

/// The separator of a graph cut into two halves.
pub(crate) struct Separator<'a> {
    graph: &'a Graph,
    /// The side of each node.
    sides: &'a mut [u8],
    /// Weight of the nodes on each side.
    weights: [u32; 3],
    max_half: u32,
    /// Whether each node has left the separator in this pass.
    moved: Vec<bool>,
    /// Growth of the separator if a node of it moves to each half: minus the move's gain.
    growth: [Vec<i32>; 2],
    /// Nodes that may move to each half, by this growth; also entries that are out of date.
    queues: [BinaryHeap<Reverse<(i32, u32)>>; 2],
}

impl<'a> Separator<'a> {
    /// Of a graph whose `sides` have no edge between the halves.
    pub fn new(graph: &'a Graph, sides: &'a mut [u8]) -> Self {
        let weights = [SEPARATOR, 1, 2].map(|side| graph.weight_of(sides, side));
        let max_half = (MAX_HALF * f64::from(graph.weight())) as u32;
        let growth = [vec![0; graph.len()], vec![0; graph.len()]];
        let queues = [BinaryHeap::new(), BinaryHeap::new()];
        Self { graph, sides, weights, max_half, moved: vec![false; graph.len()], growth, queues }
    }

    /// Moves nodes, in a few passes, until one does not improve the cut.
    pub fn refine(mut self) {
        for _ in 0..MAX_PASSES {
            if !self.pass() {
                break;
            }
        }
    }

    /// Weight of the separator, then how uneven the halves are. Less is better.
    fn quality(&self) -> (u32, u32) {
        (self.weights[0], self.weights[1].abs_diff(self.weights[2]))
    }

    /// One pass: each node leaves the separator at most once. Returns whether it is better.
    fn pass(&mut self) -> bool {
        self.fill_queues();
        let begin = self.quality();
        let (mut best, mut log, mut kept, mut in_vain) = (begin, Vec::new(), 0, 0);
        while let Some((node, to)) = self.next() {
            self.apply(node, to, &mut log);
            in_vain += 1;
            if self.quality() < best {
                (best, kept, in_vain) = (self.quality(), log.len(), 0);
            } else if in_vain >= best.0.clamp(PATIENCE[0], PATIENCE[1]) {
                break;
            }
        }
        for (node, side) in log.drain(kept..).rev() {
            self.set(node, side);
        }
        best < begin
    }

    /// Begins a pass: all nodes of the separator may move.
    fn fill_queues(&mut self) {
        self.moved.fill(false);
        self.queues.iter_mut().for_each(BinaryHeap::clear);
        for i in self.graph.nodes() {
            if self.sides[i as usize] == SEPARATOR {
                self.queue(i);
            }
        }
    }

    /// The next move: the one that lets the separator grow least, then the one to the lighter half.
    fn next(&mut self) -> Option<(u32, u8)> {
        let mut moves = [1, 2].map(|to| self.first_of(to).map(|(growth, node)| (growth, self.weights[to], to, node)));
        moves.sort_unstable();
        moves.into_iter().flatten().next().map(|(.., to, node)| (node, to as u8))
    }

    /// The move to a half that lets the separator grow least, if the half is not too heavy for it.
    fn first_of(&mut self, to: usize) -> Option<(i32, u32)> {
        let Self { graph, sides, weights, max_half, moved, growth, queues } = self;
        let queue = &mut queues[to - 1];
        while let Some(Reverse((known, node))) = queue.peek().copied() {
            let i = node as usize;
            if sides[i] == SEPARATOR && !moved[i] && growth[to - 1][i] == known {
                return (weights[to] + graph.weights[i] <= *max_half).then_some((known, node));
            }
            queue.pop();
        }
        None
    }

    /// Moves a node out of the separator, and its neighbours in the other half into it. Logs the
    /// sides of nodes before.
    fn apply(&mut self, node: u32, to: u8, log: &mut Vec<(u32, u8)>) {
        let graph = self.graph;
        let other = 3 - to;
        self.moved[node as usize] = true;
        log.push((node, SEPARATOR));
        self.set(node, to);
        self.change_near(node, other, 1);
        for pulled in graph.neighbours(node) {
            if self.sides[pulled as usize] == other {
                log.push((pulled, other));
                self.change_near(pulled, to, -1);
                self.set(pulled, SEPARATOR);
                self.queue(pulled);
            }
        }
    }

    fn set(&mut self, node: u32, side: u8) {
        let old = std::mem::replace(&mut self.sides[node as usize], side);
        self.weights[usize::from(old)] -= self.graph.weights[node as usize];
        self.weights[usize::from(side)] += self.graph.weights[node as usize];
    }

    /// Takes a node of the separator into the queues.
    fn queue(&mut self, node: u32) {
        let weight = |i: u32| self.graph.weights[i as usize] as i32;
        let mut growth = [-weight(node); 2];
        for near in self.graph.neighbours(node) {
            match self.sides[near as usize] {
                1 => growth[1] += weight(near),
                2 => growth[0] += weight(near),
                _ => {}
            }
        }
        for k in 0..2 {
            self.growth[k][node as usize] = growth[k];
            if !self.moved[node as usize] {
                self.queues[k].push(Reverse((growth[k], node)));
            }
        }
    }

    /// Counts a node `times` as pulled by moves of nodes of the separator near it to a half.
    fn change_near(&mut self, node: u32, to: u8, times: i32) {
        let (graph, k) = (self.graph, usize::from(to - 1));
        let by = times * graph.weights[node as usize] as i32;
        for near in graph.neighbours(node) {
            let i = near as usize;
            if self.sides[i] == SEPARATOR {
                self.growth[k][i] += by;
                if !self.moved[i] {
                    self.queues[k].push(Reverse((self.growth[k][i], near)));
                }
            }
        }
    }
}

/// Asserts that no edge joins the halves.
#[cfg(test)]
pub(crate) fn assert_apart(graph: &Graph, sides: &[u8]) {
    for i in graph.nodes() {
        for j in graph.neighbours(i) {
            let [a, b] = [i, j].map(|k| sides[k as usize]);
            assert!(a == b || a == SEPARATOR || b == SEPARATOR, "an edge from {i} to {j} joins the halves");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::Edge;

    /// A number below `most` for each counter.
    fn noise(k: u32, most: u32) -> u32 {
        (k.wrapping_mul(0x9E37_79B9) ^ k.rotate_left(13)).wrapping_mul(0x85EB_CA6B) % most
    }

    /// A graph of nodes of different weights around a ring, joined to others nearby.
    fn ring(nodes: u32) -> Graph {
        let near = |i: u32, j: u32| {
            let apart = i.abs_diff(j).min(nodes - i.abs_diff(j));
            apart == 1 || (2..9).contains(&apart) && noise(i.min(j) * nodes + i.max(j), 3) == 0
        };
        let mut graph = Graph::with_capacity(nodes as usize);
        for i in 0..nodes {
            let edges = (0..nodes).filter(|j| *j != i && near(i, *j)).map(|to| Edge { to, weight: 1 });
            graph.push(1 + noise(i, 4), edges);
        }
        graph
    }

    /// A cut of the ring with a wide separator on either side.
    fn wide(nodes: u32) -> Vec<u8> {
        (0..nodes).map(|i| [1, SEPARATOR, 2, SEPARATOR][(4 * i / nodes) as usize]).collect()
    }

    #[test]
    fn growth_and_weights_are_those_of_the_sides() {
        let graph = ring(200);
        let mut sides = wide(200);
        let mut separator = Separator::new(&graph, &mut sides);
        separator.fill_queues();
        let mut moves = 0;
        let mut log = Vec::new();
        while let Some((node, to)) = separator.next() {
            let growth = separator.growth[usize::from(to - 1)][node as usize];
            let before = separator.weights[0] as i32;
            separator.apply(node, to, &mut log);
            assert_eq!(separator.weights[0] as i32 - before, growth);
            assert_eq!(separator.weights, [0, 1, 2].map(|side| graph.weight_of(separator.sides, side)));
            for i in graph.nodes().filter(|i| separator.sides[*i as usize] == SEPARATOR) {
                let pulled = |to: u8| {
                    let other = graph.neighbours(i).filter(|j| separator.sides[*j as usize] == 3 - to);
                    other.map(|j| graph.weights[j as usize] as i32).sum::<i32>() - graph.weights[i as usize] as i32
                };
                assert_eq!([0, 1].map(|k| separator.growth[k][i as usize]), [1, 2].map(pulled), "node {i}");
            }
            moves += 1;
        }
        assert!(moves > 50, "{moves} moves");
    }

    #[test]
    fn a_pass_leaves_a_better_cut() {
        let graph = ring(200);
        let mut sides = wide(200);
        let before = graph.weight_of(&sides, SEPARATOR);
        Separator::new(&graph, &mut sides).refine();
        let after = graph.weight_of(&sides, SEPARATOR);
        assert!(4 * after < before, "{before} before, {after} after");
        assert_apart(&graph, &sides);
    }
}
