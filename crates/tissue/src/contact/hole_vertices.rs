//! Vertices of a body that let tools through, because they are in a hole.

use crate::Body;
use crate::frame::Frame;

/// The vertices of a body in holes, by the tools that pass through them.
#[derive(Default)]
pub(super) struct HoleVertices {
    /// By tool, then by vertex; empty without a hole.
    through: Vec<bool>,
    vertices: usize,
}

impl HoleVertices {
    /// Begins a frame.
    pub fn begin_frame(&mut self, frame: &Frame<'_>, body: &Body) {
        self.through.clear();
        self.vertices = body.len();
        for hole in frame.holes.iter().filter(|hole| hole.body == frame.index) {
            self.through.resize(frame.tools.len() * self.vertices, false);
            for tool in hole.tools.iter().filter(|tool| **tool < frame.tools.len()) {
                for node in &hole.nodes {
                    self.through[tool * self.vertices + body.internal[*node as usize] as usize] = true;
                }
            }
        }
    }

    /// Whether a `vertex` does not touch a `tool`.
    #[inline(always)]
    pub fn lets_through(&self, tool: usize, vertex: usize) -> bool {
        self.through.get(tool * self.vertices + vertex).is_some_and(|through| *through)
    }
}
