//! All contacts of one body with supports and tools.
//!
//! They are found for every substep, from where vertices and tools are at its beginning. Only the
//! anchors are kept, and so belong to the state: the places where friction holds a vertex, in the
//! frame of the touched surface.

mod begin_frame;
mod end_substep;
mod find;
mod press;

use super::compliant_grasp::CompliantNode;
use super::contact::Contact;
use super::feature_contacts::FeatureContacts;
use super::force::ToolForce;
use super::hole_vertices::HoleVertices;
use super::local_support::LocalSupport;
use super::taut::LocalTether;
use super::tool_placement::Placed;
use crate::Body;
use crate::frame::Frame;
use crate::state::{Anchor, BodyState};
use glam::Vec3A;

/// The contacts of one body.
pub(crate) struct ContactSet {
    supports: Vec<LocalSupport>,
    /// By vertex.
    tethers: Vec<LocalTether>,
    /// Free vertices of the body's surface, ascending; those of a collision surface come after the
    /// nodes.
    surface: Vec<u32>,
    /// Number of nodes: vertices with a smaller number are nodes.
    nodes: usize,
    /// Whether the body has a collision surface of its own: then its nodes touch no tools.
    is_bound: bool,
    /// Vertices that may touch something in this frame or hang on a tool, ascending.
    near: Vec<u32>,
    compliant: Vec<CompliantNode>,
    /// By vertex, then those of edges and triangles.
    contacts: Vec<Contact>,
    /// Number of those of nodes, and of all vertices.
    of_nodes: usize,
    of_vertices: usize,
    features: FeatureContacts,
    /// First contact of each vertex; that of the next vertex is the end.
    first: Vec<u32>,
    /// Present contacts with other bodies, and the first of each vertex: for the sweeps.
    pressed: Vec<Contact>,
    first_pressed: Vec<u32>,
    /// Place of each contact in the frame of the touched surface.
    places: Vec<Vec3A>,
    /// Sorted by vertex and source.
    anchors: Vec<Anchor>,
    next_anchors: Vec<Anchor>,
    /// Where the colliders are in the substep; None: the tool has no motion.
    placed: Vec<Option<Placed>>,
    /// The colliders that vertices may touch in the frame or substep that was begun last.
    reachable: Vec<u32>,
    /// Scratch: nodes of a contact with their shares.
    shares: Vec<(u32, f32)>,
    /// Whether a vertex is one of `surface`.
    outer: Vec<bool>,
    /// Vertices that touch at the frame's beginning or are about to.
    touching: Vec<bool>,
    /// Vertices that no contact moves: pinned or held rigidly.
    fixed: Vec<bool>,
    holes: HoleVertices,
    /// Distance from which a vertex may touch a surface in this frame (m).
    reach: f32,
    /// Forces on each tool at the end of the last substep.
    forces: Vec<ToolForce>,
}

impl ContactSet {
    pub fn new(body: &Body) -> Self {
        let mut surface = body.surface_vertices();
        let (nodes, vertices) = (body.len(), body.vertex_count());
        let moves = |vertex: &u32| {
            let bound = body.bound_vertex(*vertex);
            bound.is_some_and(|bound| bound.shares().any(|(node, _)| !body.vertices[node as usize].pinned))
        };
        surface.extend((nodes as u32..vertices as u32).filter(moves));
        Self {
            supports: LocalSupport::of(body),
            tethers: LocalTether::of(body),
            nodes,
            is_bound: vertices > nodes,
            near: Vec::with_capacity(vertices),
            compliant: Vec::with_capacity(body.len()),
            contacts: Vec::with_capacity(2 * surface.len()),
            of_nodes: 0,
            of_vertices: 0,
            features: FeatureContacts::default(),
            places: Vec::with_capacity(2 * surface.len()),
            anchors: Vec::with_capacity(2 * surface.len()),
            next_anchors: Vec::with_capacity(2 * surface.len()),
            first: vec![0; vertices + 1],
            pressed: Vec::new(),
            first_pressed: vec![0; body.len() + 1],
            placed: Vec::new(),
            reachable: Vec::new(),
            shares: Vec::new(),
            outer: outer(&surface, vertices),
            touching: vec![false; vertices],
            fixed: vec![false; vertices],
            holes: HoleVertices::default(),
            reach: 0.0,
            forces: Vec::new(),
            surface,
        }
    }

    /// Contacts of every vertex of a body that begins at `x`, however far away.
    #[cfg(test)]
    pub fn of_everything(body: &Body, x: &[Vec3A]) -> Self {
        let mut contacts = Self::new(body);
        let frame = Frame {
            dt: 1.0,
            gravity: glam::DVec3::ZERO,
            index: 0,
            grasps: &[],
            holes: &[],
            tools: &[],
            loads: &[],
            colliders: &[],
            single_thread: true,
            tool_contact: crate::ToolContact::Vertices,
        };
        contacts.reach = f32::INFINITY;
        contacts.near.clone_from(&contacts.surface);
        contacts.find(&frame, body, [0.0, 1.0], |i| x[i], |_| Vec3A::ZERO);
        contacts
    }

    /// All contacts with supports, tools and grasps, by vertex.
    pub fn list(&self) -> &[Contact] {
        &self.contacts
    }

    /// Contacts of a vertex; those with other bodies come last.
    #[inline(always)]
    pub fn of(&self, vertex: usize) -> impl Iterator<Item = &Contact> {
        let range = |first: &[u32]| first[vertex] as usize..first[vertex + 1] as usize;
        self.contacts[range(&self.first)].iter().chain(&self.pressed[range(&self.first_pressed)])
    }

    /// Whether any vertex of a range has contacts.
    #[inline(always)]
    pub fn any(&self, vertices: std::ops::Range<usize>) -> bool {
        let any = |first: &[u32]| first[vertices.start] != first[vertices.end];
        any(&self.first) || any(&self.first_pressed)
    }

    /// Whether contacts that depend on other vertices were set, or are to be.
    pub fn is_pressed(&self) -> bool {
        !self.pressed.is_empty() || self.contacts.len() > self.of_nodes
    }

    /// Whether no contact has a force, with the vertices at `x`.
    pub fn is_idle(&self, x: impl Fn(usize) -> Vec3A) -> bool {
        self.contacts.iter().all(|contact| contact.push(contact.site.at(|vertex| x(vertex as usize))).is_none())
    }

    /// Stiffness of the contacts and the grasp of a vertex that the quasi-Newton solver's matrix
    /// contains (N/m).
    pub fn stiffness(&self, frame: &Frame<'_>, body: &Body, state: &BodyState, vertex: usize) -> f32 {
        let pressed = if state.warm.supported[vertex] { body.pressed_stiffness(vertex) } else { 0.0 };
        let held = self.compliant.binary_search_by_key(&(vertex as u32), |h| h.vertex);
        let hangs = held.ok().and_then(|h| frame.grasps[self.compliant[h].grasp as usize].compliance);
        let first = self.tethers.partition_point(|t| (t.vertex as usize) < vertex);
        let tethers = self.tethers[first..].iter().take_while(|t| t.vertex as usize == vertex);
        let pressed = pressed + hangs.map_or(0.0, |c| c.stiffness as f32);
        tethers.fold(pressed, |sum, t| sum + t.stiffness)
    }

    /// Ends a frame: the state keeps the anchors.
    pub fn end_frame(&self, state: &mut BodyState) {
        state.anchors.clone_from(&self.anchors);
        self.features.end_frame(state);
    }

    /// Forces of the body on each tool in the last substep.
    pub fn forces(&self) -> &[ToolForce] {
        &self.forces
    }

    /// Nodes that hang compliantly on tools.
    pub fn compliant(&self) -> &[CompliantNode] {
        &self.compliant
    }
}

fn outer(surface: &[u32], vertices: usize) -> Vec<bool> {
    let mut outer = vec![false; vertices];
    surface.iter().for_each(|i| outer[*i as usize] = true);
    outer
}
