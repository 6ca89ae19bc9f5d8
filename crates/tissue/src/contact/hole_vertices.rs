//! Vertices of a body that let tools through, because they are in a hole.

use crate::Body;
use crate::body::surface::foot;
use crate::frame::Frame;
use crate::state::BodyState;
use glam::Vec3A;

/// The vertices of a body in holes, by the tools that pass through them.
#[derive(Default)]
pub(super) struct HoleVertices {
    /// By tool, then by vertex; empty without a hole.
    through: Vec<bool>,
    vertices: usize,
}

impl HoleVertices {
    /// Begins a frame, in which the body is at `state`.
    ///
    /// A vertex of a collision surface is in a hole if a node that moves it is, or if it is a
    /// corner of the triangle nearest to a node of the hole: triangles may be wider than the hole.
    pub fn begin_frame(&mut self, frame: &Frame<'_>, body: &Body, state: &BodyState) {
        self.through.clear();
        self.vertices = body.vertex_count();
        for hole in frame.holes.iter().filter(|hole| hole.body == frame.index) {
            self.through.resize(frame.tools.len() * self.vertices, false);
            let mut open: Vec<u32> = hole.nodes.iter().map(|node| body.internal[*node as usize]).collect();
            if !body.bound.is_empty() {
                add_bound(body, &state.x, &mut open);
            }
            for tool in hole.tools.iter().filter(|tool| **tool < frame.tools.len()) {
                for vertex in &open {
                    self.through[tool * self.vertices + *vertex as usize] = true;
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

/// Adds the vertices of a collision surface to those of a hole, which are nodes.
fn add_bound(body: &Body, x: &[Vec3A], open: &mut Vec<u32>) {
    let nodes = open.clone();
    let in_hole = |vertex: &u32| {
        body.bound_vertex(*vertex).is_some_and(|bound| bound.shares().any(|(node, _)| nodes.contains(&node)))
    };
    open.extend((body.len() as u32..body.vertex_count() as u32).filter(in_hole));
    let outer = |node: &&u32| body.areas[**node as usize] > 0.0;
    for node in nodes.iter().filter(outer) {
        let off = |t: &&[u32; 3]| foot(x[*node as usize], t.map(|i| x[i as usize])).off.length_squared();
        let nearest = body.surface.triangles.iter().min_by(|a, b| off(a).total_cmp(&off(b)));
        open.extend(nearest.into_iter().flatten());
    }
}
