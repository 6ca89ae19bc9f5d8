//! Holes: where a tool has gone through the surface of a body.

use crate::Model;
use xxhash_rust::xxh3::Xxh3;

/// A hole in a body through which tools pass: the nodes around it do not touch them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Hole {
    /// The body.
    pub body: usize,
    /// The tools, by their indices in the motions of a step.
    pub tools: Vec<usize>,
    /// Nodes of the body, ascending. Edges and triangles with one of them do not touch the tools
    /// either.
    pub nodes: Vec<u32>,
}

impl Hole {
    /// Whether `model` has its body and nodes.
    pub(crate) fn fits(&self, model: &Model) -> bool {
        let nodes = model.bodies.get(self.body).map_or(0, |body| body.len());
        self.nodes.iter().all(|i| (*i as usize) < nodes)
    }

    /// Hashes every number. Destructuring names every field: a new one that is not hashed does not
    /// compile.
    pub(crate) fn hash(&self, hash: &mut Xxh3) {
        let Self { body, tools, nodes } = self;
        for number in [*body, tools.len(), nodes.len()].iter().chain(tools) {
            hash.update(&(*number as u64).to_le_bytes());
        }
        nodes.iter().for_each(|node| hash.update(&node.to_le_bytes()));
    }
}
