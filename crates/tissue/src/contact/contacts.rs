//! Everything a body touches in a frame, and what of it is remembered.
//!
//! Found anew for every substep from where its vertices and the tools are at its beginning ([`Touch`]). What is remembered, and so belongs to the state, is where friction holds a vertex: in the frame
//! of what it touches, so that a tool carries it along.

use super::force::ToolForce;
use super::hanging::Hanging;
use super::placed::Placed;
use super::touch::{Friction, Source, Touch};
use crate::Body;
use crate::integrator::Frame;
use crate::state::BodyState;
use crate::support::LocalSupport;
use glam::Vec3A;
use trocar_core::Wrench;

/// A vertex this much away from a surface [m], and what it may travel in two frames, may touch it in a frame.
const NEAR: f32 = 1e-3;

/// As many more or fewer vertices that touch, beside an eighth of them, do not make the matrix another one.
const FEW: usize = 3;

/// Where friction holds a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Anchor {
    pub vertex: u32,
    pub source: Source,
    /// In the frame of what is touched: the tool's, or for a support the body's [m].
    pub place: Vec3A,
}

/// What one body touches.
pub(crate) struct Contacts {
    supports: Vec<LocalSupport>,
    /// Free vertices of the body's surface, ascending.
    surface: Vec<u32>,
    /// Those that may touch something in this frame, and those that hang on a tool, ascending.
    near: Vec<u32>,
    pub(super) hanging: Vec<Hanging>,
    touches: Vec<Touch>,
    /// Each vertex's first touch; the next one's is their end.
    first: Vec<u32>,
    /// What other bodies do to the vertices, as of now, and each vertex's first; for the sweeps.
    pressed: Vec<Touch>,
    first_pressed: Vec<u32>,
    /// Where each touch's place is in the frame of what is touched, by `touches`.
    places: Vec<Vec3A>,
    /// Sorted by vertex and source.
    anchors: Vec<Anchor>,
    next_anchors: Vec<Anchor>,
    /// Where the colliders are in the substep; None: nowhere.
    pub(super) placed: Vec<Option<Placed>>,
    /// Whether a vertex is one of `surface`.
    outer: Vec<bool>,
    /// Vertices that touch at the frame's beginning or are about to.
    touching: Vec<bool>,
    /// Vertices that no contact moves: pinned or held rigidly.
    pub(super) fixed: Vec<bool>,
    /// How far a vertex may be from a surface to touch it in this frame [m].
    reach: f32,
    /// By tool, of the last substep.
    forces: Vec<ToolForce>,
}

impl Contacts {
    pub fn new(body: &Body) -> Self {
        let surface = body.surface_vertices();
        Self {
            supports: LocalSupport::of(body),
            near: Vec::with_capacity(body.len()),
            hanging: Vec::with_capacity(body.len()),
            touches: Vec::with_capacity(2 * surface.len()),
            places: Vec::with_capacity(2 * surface.len()),
            anchors: Vec::with_capacity(2 * surface.len()),
            next_anchors: Vec::with_capacity(2 * surface.len()),
            first: vec![0; body.len() + 1],
            pressed: Vec::new(),
            first_pressed: vec![0; body.len() + 1],
            placed: Vec::new(),
            outer: outer(&surface, body.len()),
            touching: vec![false; body.len()],
            fixed: vec![false; body.len()],
            reach: 0.0,
            forces: Vec::new(),
            surface,
        }
    }

    /// Begins a frame: finds what may be touched in it. Where too many others touch than the quasi-Newton solver's matrix knows of, it is to know those that touch now: `state` says which, so that
    /// nothing depends on what came before it.
    pub fn begin(&mut self, frame: &Frame<'_>, body: &Body, state: &mut BodyState) {
        self.anchors.clone_from(&state.anchors);
        self.forces.clear();
        self.forces.resize(frame.tools.len(), ToolForce::default());
        self.mark_fixed(frame, body);
        self.hang(frame, body);
        self.place_tools(frame, body, 0.0, 1.0);
        // All that a substep may ever touch, so that no step allocates but the first.
        self.touches.clear();
        self.places.clear();
        let most = (self.supports.len() + frame.colliders.len()) * self.surface.len() + body.len();
        self.touches.reserve(most);
        self.places.reserve(most);
        let anchors = 2 * self.surface.len();
        state.anchors.reserve(anchors.saturating_sub(state.anchors.len()));
        self.find_near(frame, body, state);
    }

    fn mark_fixed(&mut self, frame: &Frame<'_>, body: &Body) {
        for (fixed, vertex) in self.fixed.iter_mut().zip(&body.vertices) {
            *fixed = vertex.pinned;
        }
        for grasp in frame.rigid_grasps() {
            grasp.nodes.iter().for_each(|i| self.fixed[body.internal[*i as usize] as usize] = true);
        }
    }

    fn find_near(&mut self, frame: &Frame<'_>, body: &Body, state: &mut BodyState) {
        self.near.clear();
        self.touching.fill(false);
        let dt = frame.dt as f32;
        let fastest = self.surface.iter().map(|i| state.v[*i as usize].length_squared()).fold(0.0, f32::max).sqrt();
        let fall = dt * dt * frame.gravity.length() as f32;
        let held = |grasp: &crate::Grasp| frame.tools.get(grasp.tool).map(|motion| motion.travel(body));
        let carried = frame.grasps().filter_map(held).fold(0.0, f64::max);
        self.reach = NEAR + carried as f32 + 2.5 * (dt * fastest + fall);
        // What nothing holds falls in this frame; of what is held it cannot be said.
        let loose = !self.fixed.contains(&true) && self.hanging.is_empty();
        let drop = if loose { dt * dt * frame.gravity.as_vec3a() } else { Vec3A::ZERO };
        let (mut touching, mut changed) = (0, 0);
        let mut hanging = self.hanging.iter().map(|h| h.vertex).peekable();
        for k in 0..self.surface.len() {
            let vertex = self.surface[k];
            let i = vertex as usize;
            while let Some(before) = hanging.next_if(|h| *h < vertex) {
                self.near.push(before);
            }
            let hangs = hanging.next_if_eq(&vertex).is_some();
            let (mut near, mut touches) = (hangs, false);
            if !self.fixed[i] {
                let (x, ahead) = (state.x[i], state.x[i] + dt * state.v[i] + drop);
                self.for_sources(frame, body, x, |_, height, normal, point, _, _| {
                    near = true;
                    touches |= height < 0.0 || (ahead - point).dot(normal) < 0.0;
                });
            }
            if near {
                self.near.push(vertex);
            }
            touching += usize::from(touches);
            changed += usize::from(touches != state.supported[i]);
            self.touching[i] = touches;
        }
        self.near.extend(hanging);
        if changed > FEW.min(touching / 2) + touching / 8 {
            state.supported.copy_from_slice(&self.touching);
        }
    }

    /// Calls `found` for everything within reach of a vertex at `x`: what it is, the height over it now, the plane's normal and point at the substep's end, where the vertex is in its frame, and
    /// how many times as stiff as the vertex's contacts it is: a field's penalty is along its `up`.
    #[inline(always)]
    fn for_sources(
        &self,
        frame: &Frame<'_>,
        body: &Body,
        x: Vec3A,
        mut found: impl FnMut(Source, f32, Vec3A, Vec3A, Vec3A, f32),
    ) {
        for (s, support) in self.supports.iter().enumerate() {
            let (height, gradient) = support.touch(x);
            if height <= self.reach {
                let steepness = gradient.length();
                let (normal, height) = (gradient / steepness, height / steepness);
                let factor = steepness * steepness;
                found(Source::Support(s as u32), height, normal, x - height * normal, x, factor);
            }
        }
        for (c, (collider, placed)) in frame.colliders.iter().zip(&self.placed).enumerate() {
            let Some(placed) = placed else { continue };
            let far = self.reach + placed.reach;
            if (x - placed.centre).length_squared() > (placed.radius + far) * (placed.radius + far) {
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

    /// Finds the touches of the substep between two shares of the frame, of a body whose vertices begin it at `x`.
    pub fn find(&mut self, frame: &Frame<'_>, body: &Body, from: f64, to: f64, x: impl Fn(usize) -> Vec3A) {
        self.place_tools(frame, body, from, to);
        let (mut touches, mut places) = (std::mem::take(&mut self.touches), std::mem::take(&mut self.places));
        touches.clear();
        places.clear();
        self.first.fill(0);
        let mut anchor = 0;
        let mut hanging = self.hanging.iter().peekable();
        for vertex in &self.near {
            let i = *vertex as usize;
            let begin = touches.len();
            let held = hanging.next_if(|h| h.vertex == *vertex);
            if self.outer[i] && !self.fixed[i] {
                let stiffness = body.vertices[i].contact_stiffness;
                self.for_sources(frame, body, x(i), |source, _, normal, point, now, factor| {
                    while self.anchors.get(anchor).is_some_and(|a| (a.vertex, a.source) < (*vertex, source)) {
                        anchor += 1;
                    }
                    let known = self.anchors.get(anchor).filter(|a| (a.vertex, a.source) == (*vertex, source));
                    let place = known.map_or(now, |a| a.place);
                    let friction = match source {
                        Source::Support(s) => self.supports[s as usize].friction(),
                        Source::Collider(c) => match &self.placed[c as usize] {
                            // The grasp bears what friction would.
                            Some(placed) if placed.grips => 0.0,
                            _ => frame.colliders[c as usize].friction as f32,
                        },
                        Source::Body(_) | Source::Grasp(..) => 0.0,
                    };
                    touches.push(Touch {
                        vertex: *vertex,
                        source,
                        normal,
                        point,
                        place: self.carried(source, body, place),
                        stiffness: factor * stiffness,
                        friction: Friction::Coulomb(friction),
                    });
                    places.push(place);
                });
            }
            if let Some(held) = held
                && let Some(touch) = held.touch(frame, body, to)
            {
                touches.push(touch);
                places.push(held.slid);
            }
            self.first[i] = begin as u32 | MARK;
        }
        // Vertices without touches: an empty range.
        let mut next = touches.len() as u32;
        for first in self.first.iter_mut().rev() {
            if *first & MARK != 0 {
                next = *first & !MARK;
            }
            *first = next;
        }
        (self.touches, self.places) = (touches, places);
    }

    /// A place in the frame of what is touched, in the body's at the substep's end.
    fn carried(&self, source: Source, body: &Body, place: Vec3A) -> Vec3A {
        match source {
            Source::Collider(c) => match &self.placed[c as usize] {
                Some(placed) => (placed.to.transform(place.as_dvec3()) - body.origin).as_vec3a(),
                None => place,
            },
            Source::Support(_) | Source::Body(_) | Source::Grasp(..) => place,
        }
    }

    /// What every vertex of a body that begins at `x` would touch, however far away.
    #[cfg(test)]
    pub fn of_everything(body: &Body, x: &[Vec3A]) -> Self {
        let mut contacts = Self::new(body);
        let frame = Frame {
            dt: 1.0,
            gravity: glam::DVec3::ZERO,
            index: 0,
            grasps: &[],
            tools: &[],
            loads: &[],
            colliders: &[],
            alone: true,
        };
        contacts.reach = f32::INFINITY;
        contacts.near.clone_from(&contacts.surface);
        contacts.find(&frame, body, 0.0, 1.0, |i| x[i]);
        contacts
    }

    /// All touches, by vertex.
    pub fn touches(&self) -> &[Touch] {
        &self.touches
    }

    /// A vertex's touches, those of other bodies last.
    #[inline(always)]
    pub fn of(&self, vertex: usize) -> impl Iterator<Item = &Touch> {
        let range = |first: &[u32]| first[vertex] as usize..first[vertex + 1] as usize;
        self.touches[range(&self.first)].iter().chain(&self.pressed[range(&self.first_pressed)])
    }

    /// Whether any vertex of a range has touches.
    #[inline(always)]
    pub fn any(&self, vertices: std::ops::Range<usize>) -> bool {
        let any = |first: &[u32]| first[vertices.start] != first[vertices.end];
        any(&self.first) || any(&self.first_pressed)
    }

    /// Takes over what other bodies do to the vertices, by vertex.
    pub fn press(&mut self, pressed: &[Touch]) {
        self.pressed.clear();
        self.first_pressed.fill(0);
        for touch in pressed.iter().filter(|touch| !self.fixed[touch.vertex as usize]) {
            self.pressed.push(*touch);
            self.first_pressed[touch.vertex as usize + 1] += 1;
        }
        for i in 1..self.first_pressed.len() {
            self.first_pressed[i] += self.first_pressed[i - 1];
        }
    }

    /// Whether nothing holds or touches the body.
    pub fn flies(&self, x: impl Fn(usize) -> Vec3A) -> bool {
        self.touches.iter().all(|touch| touch.push(x(touch.vertex as usize)).is_none())
    }

    /// Stiffness of the touches that the quasi-Newton solver has in its matrix at a vertex [N/m].
    pub fn stiffness(&self, frame: &Frame<'_>, body: &Body, state: &BodyState, vertex: usize) -> f32 {
        let pressed = if state.supported[vertex] { body.vertices[vertex].contact_stiffness } else { 0.0 };
        let held = self.hanging.binary_search_by_key(&(vertex as u32), |h| h.vertex);
        let hangs = held.ok().and_then(|h| frame.grasps[self.hanging[h].grasp as usize].compliance);
        pressed + hangs.map_or(0.0, |c| c.stiffness as f32)
    }

    /// Ends a substep with the vertices at `x`: friction's places follow what slips.
    pub fn settle(&mut self, frame: &Frame<'_>, body: &Body, share: f64, x: impl Fn(usize) -> Vec3A) {
        self.next_anchors.clear();
        self.forces.fill(ToolForce::default());
        let (mut hanging, mut counted) = (0, None);
        for (touch, place) in self.touches.iter().zip(&self.places) {
            let here = x(touch.vertex as usize);
            let push = touch.push(here);
            if let Source::Grasp(..) = touch.source {
                while self.hanging[hanging].vertex < touch.vertex {
                    hanging += 1;
                }
                let held = &mut self.hanging[hanging];
                held.pull = push.map_or(Vec3A::ZERO, |push| push.gradient);
                let slide = touch.slide(here);
                held.slides = slide.is_some();
                if let (Some(slide), Some(tool)) = (slide, frame.tools.get(frame.grasps[held.grasp as usize].tool)) {
                    let back = tool.at(share).rotation.inverse();
                    held.slid += (back * slide.as_dvec3()).as_vec3a();
                }
                continue;
            }
            let Some(push) = push else { continue };
            // What sticks keeps its place to the bit.
            let place = match (touch.slide(here), touch.source) {
                (None, _) => *place,
                (Some(by), Source::Collider(c)) => match &self.placed[c as usize] {
                    Some(placed) => {
                        let moved = (touch.place + by).as_dvec3() + body.origin;
                        placed.to.inverse().transform(moved).as_vec3a()
                    }
                    None => *place,
                },
                (Some(by), _) => *place + by,
            };
            self.next_anchors.push(Anchor { vertex: touch.vertex, source: touch.source, place });
            if let Source::Collider(c) = touch.source {
                let tool = frame.colliders[c as usize].tool;
                if let (Some(force), Some(Some(placed))) = (self.forces.get_mut(tool), self.placed.get(c as usize)) {
                    let arm = body.origin + here.as_dvec3() - placed.to.translation;
                    force.contact += Wrench::at(push.gradient.as_dvec3(), arm);
                    force.pressing += f64::from(touch.stiffness * -touch.height(here));
                    force.touching += usize::from(counted != Some((touch.vertex, tool)));
                    counted = Some((touch.vertex, tool));
                }
            }
        }
        std::mem::swap(&mut self.anchors, &mut self.next_anchors);
        for held in &self.hanging {
            let grasp = &frame.grasps[held.grasp as usize];
            if let (Some(force), Some(tool)) = (self.forces.get_mut(grasp.tool), frame.tools.get(grasp.tool)) {
                let arm = body.origin + x(held.vertex as usize).as_dvec3() - tool.at(share).translation;
                force.constraint += Wrench::at(held.pull.as_dvec3(), arm);
            }
        }
    }

    /// Ends a frame.
    pub fn end(&self, state: &mut BodyState) {
        state.anchors.clone_from(&self.anchors);
    }

    /// What the body did to each tool in the last substep.
    pub fn forces(&self) -> &[ToolForce] {
        &self.forces
    }

    /// The nodes that hang on tools.
    pub fn hanging(&self) -> &[Hanging] {
        &self.hanging
    }
}

/// Marks a vertex's first touch while they are being found.
const MARK: u32 = 1 << 31;

fn outer(surface: &[u32], vertices: usize) -> Vec<bool> {
    let mut outer = vec![false; vertices];
    surface.iter().for_each(|i| outer[*i as usize] = true);
    outer
}
