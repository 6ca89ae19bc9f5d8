//! A graph with weights: of a matrix's blocks, of a part of it, or coarser.

use crate::BlockMatrix;

/// A graph: the edges of node i are `edges[first[i]..first[i + 1]]`.
pub(crate) struct Graph {
    /// Weight of each node: how many nodes of the matrix it stands for.
    pub weights: Vec<u32>,
    first: Vec<u32>,
    edges: Vec<Edge>,
}

/// An edge from a node.
#[derive(Clone, Copy)]
pub(crate) struct Edge {
    pub to: u32,
    /// How many edges of the matrix it stands for.
    pub weight: u32,
}

impl Graph {
    /// The graph of a matrix's blocks.
    pub fn new(matrix: &BlockMatrix) -> Self {
        let mut lists = vec![Vec::new(); matrix.len()];
        for (i, j, _) in matrix.blocks().filter(|(i, j, _)| i != j) {
            lists[i as usize].push(Edge { to: j, weight: 1 });
            lists[j as usize].push(Edge { to: i, weight: 1 });
        }
        let mut graph = Self::with_capacity(lists.len());
        lists.into_iter().for_each(|list| graph.push(1, list.into_iter()));
        graph
    }

    /// Without nodes, with room for so many.
    pub fn with_capacity(nodes: usize) -> Self {
        Self { weights: Vec::with_capacity(nodes), first: vec![0], edges: Vec::new() }
    }

    /// Adds a node.
    pub fn push(&mut self, weight: u32, edges: impl Iterator<Item = Edge>) {
        self.weights.push(weight);
        self.edges.extend(edges);
        self.first.push(self.edges.len() as u32);
    }

    /// The graph of these `nodes` and of the edges between them.
    pub fn part(&self, nodes: &[u32]) -> Self {
        let mut number = vec![NONE; self.len()];
        nodes.iter().enumerate().for_each(|(k, i)| number[*i as usize] = k as u32);
        let mut part = Self::with_capacity(nodes.len());
        for i in nodes {
            let edges = self.edges(*i).iter().map(|edge| Edge { to: number[edge.to as usize], ..*edge });
            part.push(self.weights[*i as usize], edges.filter(|edge| edge.to != NONE));
        }
        part
    }

    /// The edges of node `i`.
    pub fn edges(&self, i: u32) -> &[Edge] {
        &self.edges[self.first[i as usize] as usize..self.first[i as usize + 1] as usize]
    }

    /// The nodes that have an edge to node `i`.
    pub fn neighbours(&self, i: u32) -> impl Iterator<Item = u32> {
        self.edges(i).iter().map(|edge| edge.to)
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.weights.len()
    }

    /// Weight of all nodes.
    pub fn weight(&self) -> u32 {
        self.weights.iter().sum()
    }

    /// Weight of the nodes on a side, of which `sides` has one for each node.
    pub fn weight_of(&self, sides: &[u8], side: u8) -> u32 {
        self.weights.iter().zip(sides).filter(|(_, of)| **of == side).map(|(weight, _)| weight).sum()
    }

    /// Distances from a node in edges. From the farthest node it goes on to the first one that is
    /// not connected to it, as if they had an edge.
    pub fn distances(&self, from: u32) -> Vec<u32> {
        let mut distances = vec![NONE; self.len()];
        distances[from as usize] = 0;
        let (mut reached, mut next, mut known) = (vec![from], 0, 0);
        while next < self.len() {
            if next == reached.len() {
                known += distances[known..].iter().take_while(|distance| **distance != NONE).count();
                distances[known] = distances[reached[next - 1] as usize] + 1;
                reached.push(known as u32);
            }
            let i = reached[next];
            next += 1;
            for j in self.neighbours(i) {
                if distances[j as usize] == NONE {
                    distances[j as usize] = distances[i as usize] + 1;
                    reached.push(j);
                }
            }
        }
        distances
    }

    /// All nodes.
    pub fn nodes(&self) -> std::ops::Range<u32> {
        0..self.len() as u32
    }
}

/// No node, or no distance yet.
pub(crate) const NONE: u32 = u32::MAX;
