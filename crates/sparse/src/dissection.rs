//! Nested dissection: an order of elimination that keeps the Cholesky factor sparse.
//!
//! George, "Nested dissection of a regular finite element mesh", 1973. A part is cut into two
//! halves along the coordinate axis, or along the distance over the mesh from one of its ends, that
//! gives the smallest separator. The separator is a minimum vertex cover of the cut edges (Koenig's
//! theorem), and is eliminated after the halves.

use crate::BlockMatrix;
use glam::DVec3;
use std::collections::VecDeque;

/// Parts of at most this many nodes are not cut further.
const MAX_LEAF_NODES: usize = 14;

/// A mesh graph: the neighbours of node i are `to[first[i]..first[i + 1]]`.
pub(crate) struct Graph {
    first: Vec<u32>,
    to: Vec<u32>,
}

impl Graph {
    /// The graph of a matrix's blocks.
    pub fn new(matrix: &BlockMatrix) -> Self {
        let mut lists = vec![Vec::new(); matrix.len()];
        for (i, j, _) in matrix.blocks().filter(|(i, j, _)| i != j) {
            lists[i as usize].push(j);
            lists[j as usize].push(i);
        }
        let mut first = vec![0];
        first.extend(lists.iter().scan(0, |sum, list| {
            *sum += list.len() as u32;
            Some(*sum)
        }));
        Self { first, to: lists.concat() }
    }

    pub fn neighbours(&self, i: u32) -> &[u32] {
        &self.to[self.first[i as usize] as usize..self.first[i as usize + 1] as usize]
    }

    pub fn len(&self) -> usize {
        self.first.len() - 1
    }
}

/// The nodes of `graph`, which lie at `positions`, in the order of elimination: first eliminated
/// first.
pub(crate) fn dissect(graph: &Graph, positions: &[DVec3]) -> Vec<u32> {
    let n = graph.len();
    let mut work = Work {
        graph,
        positions,
        part: vec![0; n],
        parts: 0,
        side: vec![0; n],
        mate: vec![NONE; n],
        seen: vec![0; n],
        visits: 0,
    };
    let mut order = Vec::with_capacity(n);
    work.cut((0..n as u32).collect(), &mut order);
    order
}

const NONE: u32 = u32::MAX;

struct Work<'a> {
    graph: &'a Graph,
    positions: &'a [DVec3],
    /// The part that each node is in at the moment.
    part: Vec<u32>,
    parts: u32,
    /// Half of the cut: 1 or 2.
    side: Vec<u8>,
    /// Partner in the matching of the edges cut.
    mate: Vec<u32>,
    seen: Vec<u32>,
    visits: u32,
}

impl Work<'_> {
    /// Appends the nodes of a part to `order`.
    fn cut(&mut self, nodes: Vec<u32>, order: &mut Vec<u32>) {
        if nodes.len() <= MAX_LEAF_NODES {
            order.extend(nodes);
            return;
        }
        self.parts += 1;
        for i in &nodes {
            self.part[*i as usize] = self.parts;
        }
        let mut best: Option<(Vec<u32>, Vec<u32>, Vec<u32>)> = None;
        for keys in self.coordinates(&nodes) {
            let (a, b, separator) = self.halves(&nodes, &keys);
            if best.as_ref().is_none_or(|(_, _, s)| separator.len() < s.len()) {
                best = Some((a, b, separator));
            }
        }
        let Some((a, b, separator)) = best else { return };
        if a.is_empty() || b.is_empty() {
            order.extend(a.into_iter().chain(b).chain(separator));
            return;
        }
        self.cut(a, order);
        self.cut(b, order);
        order.extend(separator);
    }

    /// Coordinates along which the part may be cut.
    fn coordinates(&mut self, nodes: &[u32]) -> Vec<Vec<f64>> {
        let mut all: Vec<Vec<f64>> =
            (0..3).map(|axis| nodes.iter().map(|i| self.positions[*i as usize][axis]).collect()).collect();
        let start = self.farthest(nodes, nodes[0]).0;
        let (_, distance) = self.farthest(nodes, start);
        all.push(distance);
        all
    }

    /// The node of the part farthest from `from` in edges, and all distances; unreachable nodes are
    /// farther than all others.
    fn farthest(&mut self, nodes: &[u32], from: u32) -> (u32, Vec<f64>) {
        self.visits += 1;
        let mut level = std::collections::BTreeMap::new();
        let mut queue = VecDeque::from([(from, 0.0)]);
        self.seen[from as usize] = self.visits;
        let mut last = from;
        while let Some((i, d)) = queue.pop_front() {
            level.insert(i, d);
            last = i;
            for j in self.graph.neighbours(i) {
                let inside = self.part[*j as usize] == self.part[from as usize];
                if inside && self.seen[*j as usize] != self.visits {
                    self.seen[*j as usize] = self.visits;
                    queue.push_back((*j, d + 1.0));
                }
            }
        }
        let beyond = nodes.len() as f64;
        (last, nodes.iter().map(|i| level.get(i).copied().unwrap_or(beyond)).collect())
    }

    /// Halves of the part by `keys`, and their separator.
    fn halves(&mut self, nodes: &[u32], keys: &[f64]) -> (Vec<u32>, Vec<u32>, Vec<u32>) {
        let mut by_key: Vec<usize> = (0..nodes.len()).collect();
        by_key.sort_by(|a, b| keys[*a].total_cmp(&keys[*b]).then(nodes[*a].cmp(&nodes[*b])));
        let part = self.part[nodes[0] as usize];
        for (rank, k) in by_key.iter().enumerate() {
            self.side[nodes[*k] as usize] = if 2 * rank < nodes.len() { 1 } else { 2 };
            self.mate[nodes[*k] as usize] = NONE;
        }
        let across = |work: &Self, i: u32, j: u32| {
            work.part[j as usize] == part && work.side[j as usize] != work.side[i as usize]
        };
        let left: Vec<u32> = nodes
            .iter()
            .copied()
            .filter(|i| self.side[*i as usize] == 1 && self.graph.neighbours(*i).iter().any(|j| across(self, *i, *j)))
            .collect();
        for i in &left {
            self.visits += 1;
            self.augment(*i, part);
        }
        // Koenig: nodes that alternating paths from unmatched left nodes reach. The cover is the
        // left nodes not reached and the right ones reached.
        self.visits += 1;
        let mut stack: Vec<u32> = left.iter().copied().filter(|i| self.mate[*i as usize] == NONE).collect();
        stack.iter().for_each(|i| self.seen[*i as usize] = self.visits);
        while let Some(i) = stack.pop() {
            for j in self.graph.neighbours(i) {
                if across(self, i, *j) && self.seen[*j as usize] != self.visits {
                    self.seen[*j as usize] = self.visits;
                    let next = self.mate[*j as usize];
                    if next != NONE && self.seen[next as usize] != self.visits {
                        self.seen[next as usize] = self.visits;
                        stack.push(next);
                    }
                }
            }
        }
        let mut halves = (Vec::new(), Vec::new(), Vec::new());
        for i in nodes {
            let k = *i as usize;
            let reached = self.seen[k] == self.visits;
            // Only matched nodes can be in the cover.
            let covers = self.mate[k] != NONE && (reached == (self.side[k] == 2));
            if covers {
                halves.2.push(*i);
            } else if self.side[k] == 1 {
                halves.0.push(*i);
            } else {
                halves.1.push(*i);
            }
        }
        halves
    }

    /// Finds a partner for left node `i` along an augmenting path.
    fn augment(&mut self, i: u32, part: u32) -> bool {
        let graph = self.graph;
        for j in graph.neighbours(i) {
            let k = *j as usize;
            if self.part[k] != part || self.side[k] != 2 || self.seen[k] == self.visits {
                continue;
            }
            self.seen[k] = self.visits;
            if self.mate[k] == NONE || self.augment(self.mate[k], part) {
                self.mate[k] = i;
                self.mate[i as usize] = *j;
                return true;
            }
        }
        false
    }
}
