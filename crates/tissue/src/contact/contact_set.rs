//! All contacts of one body with supports and tools.
//!
//! They are found for every substep, from where vertices and tools are at its beginning. Only the
//! anchors are kept, and so belong to the state: the places where friction holds a vertex, in the
//! frame of the touched surface.

use super::compliant_grasp::{self, CompliantNode};
use super::contact::{Contact, Friction};
use super::feature_contacts::FeatureContacts;
use super::force::ToolForce;
use super::hole_vertices::HoleVertices;
use super::local_support::LocalSupport;
use super::site::{Site, add_share};
use super::taut::LocalTether;
use super::tool_placement::{self, Placed};
use crate::frame::Frame;
use crate::state::{Anchor, BodyState, Source};
use crate::{Body, ToolContact};
use glam::Vec3A;
use trocar_core::Wrench;

/// A vertex within this distance of a surface (m), beyond what it may travel in two frames, may
/// touch it in a frame.
const REACH_MARGIN: f32 = 1e-3;

/// The matrix stays the same if at most so many vertices more or fewer touch, and an eighth of
/// them.
const MAX_CHANGED_CONTACTS: usize = 8;

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

    /// Begins a frame: finds what may be touched in it.
    ///
    /// If many other vertices touch than the quasi-Newton solver's matrix contains, the warm start
    /// in `state` is set to those that touch now.
    pub fn begin_frame(&mut self, frame: &Frame<'_>, body: &Body, state: &mut BodyState) {
        self.anchors.clone_from(&state.anchors);
        self.forces.clear();
        self.forces.resize(frame.tools.len(), ToolForce::default());
        self.mark_fixed(frame, body);
        self.holes.begin_frame(frame, body, state);
        compliant_grasp::find(frame, body, &self.fixed, &mut self.compliant);
        tool_placement::place(frame, body, 0.0, 1.0, &mut self.placed);
        // Room for all contacts that a substep may have, so that only the first one allocates.
        self.contacts.clear();
        self.places.clear();
        let most = (self.supports.len() + frame.colliders.len()) * self.surface.len() + body.len() + self.tethers.len();
        self.contacts.reserve(most);
        self.places.reserve(most);
        let anchors = 2 * self.surface.len();
        state.anchors.reserve(anchors.saturating_sub(state.anchors.len()));
        self.find_near(frame, body, state);
        if frame.tool_contact == ToolContact::Surface {
            self.features.begin_frame(frame, body, state, &self.placed, &self.holes, self.reach);
        }
    }

    fn mark_fixed(&mut self, frame: &Frame<'_>, body: &Body) {
        for (fixed, vertex) in self.fixed.iter_mut().zip(&body.vertices) {
            *fixed = vertex.pinned;
        }
        for grasp in frame.rigid_grasps() {
            grasp.nodes.iter().for_each(|i| self.fixed[body.internal[*i as usize] as usize] = true);
        }
        for (k, bound) in body.bound.iter().enumerate() {
            self.fixed[self.nodes + k] = bound.shares().all(|(node, _)| self.fixed[node as usize]);
        }
    }

    fn find_near(&mut self, frame: &Frame<'_>, body: &Body, state: &mut BodyState) {
        self.near.clear();
        self.touching.fill(false);
        let dt = frame.dt as f32;
        let fastest = self.surface.iter().map(|i| state.v[*i as usize].length_squared()).fold(0.0, f32::max).sqrt();
        let fall = dt * dt * frame.gravity.length() as f32;
        let carried = frame.carried(body, false);
        self.reach = REACH_MARGIN + carried as f32 + 2.5 * (dt * fastest + fall);
        // A loose body falls in this frame; a held one may not.
        let loose = !self.fixed.contains(&true) && self.compliant.is_empty();
        let drop = if loose { dt * dt * frame.gravity.as_vec3a() } else { Vec3A::ZERO };
        let (mut touching, mut changed) = (0, 0);
        let mut hanging = self.compliant.iter().map(|h| h.vertex).peekable();
        let mut tethered = self.tethers.iter().map(|t| t.vertex).peekable();
        for k in 0..self.surface.len() {
            let vertex = self.surface[k];
            let i = vertex as usize;
            while let Some(before) = hanging.next_if(|h| *h < vertex) {
                self.near.push(before);
            }
            let hangs = hanging.next_if_eq(&vertex).is_some();
            let mut near = hangs;
            while tethered.next_if(|t| *t <= vertex).is_some_and(|t| t == vertex) {
                near = true;
            }
            let mut touches = false;
            if !self.fixed[i] {
                let (x, ahead) = (state.x[i], state.x[i] + dt * state.v[i] + drop);
                self.for_sources(frame, body, i, x, |_, height, normal, point, _, _| {
                    near = true;
                    touches |= height < 0.0 || (ahead - point).dot(normal) < 0.0;
                });
            }
            if near {
                self.near.push(vertex);
            }
            self.touching[i] = touches;
        }
        self.near.extend(hanging);
        // Edges and triangles that pressed at the end of the last frame.
        for anchor in &state.feature_anchors {
            for i in anchor.feature.0 {
                self.touching[i as usize] |= !self.fixed[i as usize];
            }
        }
        if self.is_bound {
            self.spread_touching(body);
        }
        let mut count = |i: usize| {
            touching += usize::from(self.touching[i]);
            changed += usize::from(self.touching[i] != state.warm.supported[i]);
        };
        if self.is_bound {
            (0..self.nodes).for_each(count);
        } else {
            self.surface.iter().for_each(|i| count(*i as usize));
        }
        if changed > MAX_CHANGED_CONTACTS.min(touching / 2) + touching / 8 {
            state.warm.supported.copy_from_slice(&self.touching[..self.nodes]);
        }
    }

    /// Marks the nodes of the vertices of a collision surface that touch.
    fn spread_touching(&mut self, body: &Body) {
        let (nodes, bound) = self.touching.split_at_mut(self.nodes);
        for (bound, _) in body.bound.iter().zip(bound).filter(|(_, touches)| **touches) {
            bound.shares().for_each(|(node, _)| nodes[node as usize] |= !self.fixed[node as usize]);
        }
    }

    /// Calls `found` for everything within reach of a `vertex` at `x`: what it is; the height above
    /// it now; normal and point of the plane at the substep's end; the vertex in the frame of what
    /// it touches; and a factor of its contact stiffness, because a field's penalty is along its
    /// `up`.
    #[inline(always)]
    fn for_sources(
        &self,
        frame: &Frame<'_>,
        body: &Body,
        vertex: usize,
        x: Vec3A,
        mut found: impl FnMut(Source, f32, Vec3A, Vec3A, Vec3A, f32),
    ) {
        let is_node = vertex < self.nodes;
        let supports = if is_node { &self.supports[..] } else { &[] };
        for (s, support) in supports.iter().enumerate() {
            let (height, gradient) = support.contact(x);
            if height <= self.reach {
                let steepness = gradient.length();
                let (normal, height) = (gradient / steepness, height / steepness);
                let factor = steepness * steepness;
                found(Source::Support(s as u32), height, normal, x - height * normal, x, factor);
            }
        }
        if self.is_bound && is_node {
            return;
        }
        for (c, (collider, placed)) in frame.colliders.iter().zip(&self.placed).enumerate() {
            let Some(placed) = placed else { continue };
            let far = self.reach + placed.reach;
            if (x - placed.centre).length_squared() > (placed.radius + far) * (placed.radius + far)
                || self.holes.lets_through(collider.tool, vertex)
            {
                continue;
            }
            let p = placed.from.transform(body.origin + x.as_dvec3());
            let nearest = collider.shape.nearest(p);
            if nearest.distance <= f64::from(far) {
                let height = nearest.distance - collider.rest_offset;
                let point = placed.to.transform(p - height * nearest.normal) - body.origin;
                let normal = placed.to.rotation * nearest.normal;
                let source = Source::Collider(c as u32);
                found(source, height as f32, normal.as_vec3a(), point.as_vec3a(), p.as_vec3a(), 1.0);
            }
        }
    }

    /// Finds the contacts of the substep between two shares of the frame, of a body whose vertices
    /// begin it at `x` and go by `way` if their velocities stay (m).
    pub fn find(
        &mut self,
        frame: &Frame<'_>,
        body: &Body,
        [from, to]: [f64; 2],
        x: impl Fn(usize) -> Vec3A,
        way: impl Fn(usize) -> Vec3A,
    ) {
        tool_placement::place(frame, body, from, to, &mut self.placed);
        let (mut contacts, mut places) = (std::mem::take(&mut self.contacts), std::mem::take(&mut self.places));
        contacts.clear();
        places.clear();
        self.first.fill(0);
        let mut anchor = 0;
        let mut hanging = self.compliant.iter().peekable();
        let mut tethered = self.tethers.iter().peekable();
        self.of_nodes = 0;
        for vertex in &self.near {
            let i = *vertex as usize;
            let begin = contacts.len();
            let held = hanging.next_if(|h| h.vertex == *vertex);
            if self.outer[i] && !self.fixed[i] {
                let stiffness = body.contact_stiffness_of(*vertex);
                self.for_sources(frame, body, i, x(i), |source, _, normal, point, now, factor| {
                    while self.anchors.get(anchor).is_some_and(|a| (a.vertex, a.source) < (*vertex, source)) {
                        anchor += 1;
                    }
                    let known = self.anchors.get(anchor).filter(|a| (a.vertex, a.source) == (*vertex, source));
                    let place = known.map_or(now, |a| a.place);
                    // What pressed slides with the velocity that it has; what comes may not.
                    let ahead = match (source, known) {
                        (Source::Collider(c), Some(_)) => self.placed[c as usize].as_ref().and_then(|placed| {
                            let there = placed.beside(body, x(i), way(i))?;
                            Some(placed.plane(&frame.colliders[c as usize], body, now.as_dvec3(), there))
                        }),
                        _ => None,
                    };
                    let (normal, point) = ahead.unwrap_or((normal, point));
                    let friction = match source {
                        Source::Support(s) => self.supports[s as usize].friction(),
                        Source::Collider(c) => match &self.placed[c as usize] {
                            // The grasp holds what friction would.
                            Some(placed) if placed.grips => 0.0,
                            _ => frame.colliders[c as usize].friction as f32,
                        },
                        Source::Body(_) | Source::Grasp(..) | Source::Tether(_) => 0.0,
                    };
                    contacts.push(Contact {
                        site: Site::vertex(*vertex),
                        source,
                        normal,
                        point,
                        place: self.carried(source, body, place),
                        stiffness: factor * stiffness,
                        hard_from: match source {
                            Source::Collider(c) => frame.colliders[c as usize].hard_from(),
                            _ => f32::INFINITY,
                        },
                        friction: Friction::Coulomb(friction),
                    });
                    places.push(place);
                });
            }
            if let Some(held) = held
                && let Some(contact) = held.contact(frame, body, to)
            {
                contacts.push(contact);
                places.push(held.slid);
            }
            while let Some(tether) = tethered.next_if(|t| t.vertex <= *vertex) {
                let taut = (tether.vertex == *vertex && !self.fixed[i]).then(|| tether.contact(x(i), self.reach));
                if let Some(contact) = taut.flatten() {
                    contacts.push(contact);
                    places.push(contact.place);
                }
            }
            self.first[i] = begin as u32 | MARK;
            if i < self.nodes {
                self.of_nodes = contacts.len();
            }
        }
        // Vertices without contacts have an empty range.
        let mut next = contacts.len() as u32;
        for first in self.first.iter_mut().rev() {
            if *first & MARK != 0 {
                next = *first & !MARK;
            }
            *first = next;
        }
        self.of_vertices = contacts.len();
        self.features.find(frame, body, &self.placed, &self.fixed, x, way, &mut contacts);
        (self.contacts, self.places) = (contacts, places);
    }

    /// A place in the frame of the touched surface, converted to the body's frame at the substep's
    /// end.
    fn carried(&self, source: Source, body: &Body, place: Vec3A) -> Vec3A {
        match source {
            Source::Collider(c) => match &self.placed[c as usize] {
                Some(placed) => (placed.to.transform(place.as_dvec3()) - body.origin).as_vec3a(),
                None => place,
            },
            Source::Support(_) | Source::Body(_) | Source::Grasp(..) | Source::Tether(_) => place,
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
            tool_contact: ToolContact::Vertices,
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

    /// Sets the contacts with other bodies, by node, and adds those of edges, triangles and
    /// vertices of a collision surface as contacts of each of their nodes while the others stay
    /// where they are, vertices at `x`.
    pub fn press(&mut self, body: &Body, pressed: &[Contact], x: impl Fn(u32) -> Vec3A) {
        self.pressed.clear();
        self.first_pressed.fill(0);
        let free = |contact: &&Contact| !self.fixed[contact.site.first() as usize];
        self.pressed.extend(pressed.iter().filter(free));
        let others = self.pressed.len();
        for contact in &self.contacts[self.of_nodes..] {
            self.shares.clear();
            for (vertex, share) in contact.site.shares() {
                body.for_nodes(vertex, share, |node, share| add_share(&mut self.shares, node, share));
            }
            for (node, share) in self.shares.iter().filter(|(_, share)| share.abs() > MIN_SHARE) {
                if !self.fixed[*node as usize] {
                    self.pressed.push(contact.of_vertex(*node, *share, x(*node), contact.site.at(&x)));
                }
            }
        }
        if self.pressed.len() > others {
            self.pressed.sort_unstable_by_key(|contact| contact.site.first());
        }
        for contact in &self.pressed {
            self.first_pressed[contact.site.first() as usize + 1] += 1;
        }
        for i in 1..self.first_pressed.len() {
            self.first_pressed[i] += self.first_pressed[i - 1];
        }
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

    /// Ends a substep with the vertices at `x`: anchors follow what slips, and tools feel the
    /// forces.
    pub fn end_substep(&mut self, frame: &Frame<'_>, body: &Body, share: f64, x: impl Fn(usize) -> Vec3A) {
        self.next_anchors.clear();
        self.forces.fill(ToolForce::default());
        let (mut hanging, mut counted) = (0, None);
        for (contact, place) in self.contacts[..self.of_vertices].iter().zip(&self.places) {
            let here = contact.site.at(|vertex| x(vertex as usize));
            let push = contact.push(here);
            if let Source::Grasp(..) = contact.source {
                while self.compliant[hanging].vertex < contact.site.first() {
                    hanging += 1;
                }
                let held = &mut self.compliant[hanging];
                held.pull = push.map_or(Vec3A::ZERO, |push| push.gradient);
                let slide = contact.slide(here);
                held.slides = slide.is_some();
                if let (Some(slide), Some(tool)) = (slide, frame.tools.get(frame.grasps[held.grasp as usize].tool)) {
                    let back = tool.at(share).rotation.inverse();
                    held.slid += (back * slide.as_dvec3()).as_vec3a();
                }
                continue;
            }
            let Some(push) = push else { continue };
            if let Source::Tether(_) = contact.source {
                continue;
            }
            // A vertex that sticks keeps its anchor to the bit.
            let place = match (contact.slide(here), contact.source) {
                (None, _) => *place,
                (Some(by), Source::Collider(c)) => match &self.placed[c as usize] {
                    Some(placed) => {
                        let moved = (contact.place + by).as_dvec3() + body.origin;
                        placed.to.inverse().transform(moved).as_vec3a()
                    }
                    None => *place,
                },
                (Some(by), _) => *place + by,
            };
            self.next_anchors.push(Anchor { vertex: contact.site.first(), source: contact.source, place });
            if let Source::Collider(c) = contact.source {
                let tool = frame.colliders[c as usize].tool;
                if let (Some(force), Some(Some(placed))) = (self.forces.get_mut(tool), self.placed.get(c as usize)) {
                    let arm = body.origin + here.as_dvec3() - placed.to.translation;
                    force.contact += Wrench::at(push.gradient.as_dvec3(), arm);
                    force.pressing += f64::from(contact.pressure(-contact.height(here)));
                    force.touching += usize::from(counted != Some((contact.site.first(), tool)));
                    counted = Some((contact.site.first(), tool));
                }
            }
        }
        std::mem::swap(&mut self.anchors, &mut self.next_anchors);
        let contacts = &self.contacts[self.of_vertices..];
        self.features.end_substep(frame, body, &self.placed, contacts, &x, &mut self.forces);
        for held in &self.compliant {
            let grasp = &frame.grasps[held.grasp as usize];
            if let (Some(force), Some(tool)) = (self.forces.get_mut(grasp.tool), frame.tools.get(grasp.tool)) {
                let arm = body.origin + x(held.vertex as usize).as_dvec3() - tool.at(share).translation;
                force.constraint += Wrench::at(held.pull.as_dvec3(), arm);
            }
        }
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

/// Vertices with a smaller share of a contact do not bear it in sweeps, which divide by it.
const MIN_SHARE: f32 = 1e-6;

/// Marks a vertex's first contact while they are being found.
const MARK: u32 = 1 << 31;

fn outer(surface: &[u32], vertices: usize) -> Vec<bool> {
    let mut outer = vec![false; vertices];
    surface.iter().for_each(|i| outer[*i as usize] = true);
    outer
}
