//! Contacts of a body's edges and triangles with round parts of tools.
//!
//! Vertices alone leave gaps: a blade that is thinner than a triangle is wide passes between them.
//! So the point of an edge or triangle that is nearest to the axis of a capsule touches it as well.
//! Its stiffness is that of its vertices, and falls to 0 where the point reaches one of them, which
//! has its own contact: the force does not jump where a blade slides from feature to feature.
//!
//! The point stays where it is on its edge or triangle for a substep, and then follows the tissue
//! halfway. Tissue that tilts moves the point to the side that rises, which pushes it back: a point
//! that follows a substep late, but all the way, swings from side to side farther each time.
//!
//! Friction is a spring whose stretch is kept in the tool's frame, by feature: the point may move
//! along the edge from substep to substep.

use super::contact::{Contact, Friction};
use super::force::ToolForce;
use super::hole_vertices::HoleVertices;
use super::site::Site;
use super::tool_features::{self, Feature};
use super::tool_placement::Placed;
use crate::frame::Frame;
use crate::state::{BodyState, FeatureAnchor, FeatureKey, Source};
use crate::{Body, Shape};
use glam::{DVec3, Vec3A};
use trocar_core::Wrench;

/// A point that is expected within this distance of a tool's surface at a substep's end may touch
/// it (m).
const MARGIN: f32 = 1e-3;

/// The contacts of a body's edges and triangles.
#[derive(Default)]
pub(super) struct FeatureContacts {
    /// Triangles that colliders may meet in the frame, by collider, and the end of each collider's.
    near: Vec<u32>,
    ends: Vec<usize>,
    /// Vertices of these triangles and of those around them.
    vertices: Vec<u32>,
    /// Their positions at the substep's beginning, by vertex (m).
    x: Vec<Vec3A>,
    /// Balls around [`CHUNK`] triangles each. A body that rests keeps them.
    balls: Vec<(Vec3A, f32)>,
    /// The positions that they are for (m).
    balls_at: Vec<Vec3A>,
    /// Scratch: whether a vertex is one of `vertices`.
    is_near: Vec<bool>,
    /// Scratch: features of one collider.
    found: Vec<Feature>,
    /// The feature of each contact of the substep.
    keys: Vec<FeatureKey>,
    /// Sorted by collider and feature.
    anchors: Vec<FeatureAnchor>,
    next_anchors: Vec<FeatureAnchor>,
}

impl FeatureContacts {
    /// Forgets what the last frame found.
    pub fn clear(&mut self) {
        self.near.clear();
        self.ends.clear();
        self.vertices.clear();
        self.anchors.clear();
    }

    /// Begins a frame: finds the triangles that the `placed` colliders may meet in it. A vertex at
    /// most `reach` from a surface may touch it (m). Triangles in `holes` let the tools through.
    pub fn begin_frame(
        &mut self,
        frame: &Frame<'_>,
        body: &Body,
        state: &BodyState,
        placed: &[Option<Placed>],
        holes: &HoleVertices,
        reach: f32,
    ) {
        self.clear();
        self.anchors.clone_from(&state.feature_anchors);
        self.x.resize(body.vertex_count(), Vec3A::ZERO);
        let triangles = &body.surface.triangles;
        let corners = |t: u32| triangles[t as usize].map(|i| state.x[i as usize]);
        let mut have_balls = self.balls_at == state.x;
        for (collider, placed) in frame.colliders.iter().zip(placed) {
            if let (Some((ends, radius)), Some(placed)) = (axis(&collider.shape), placed) {
                if !have_balls {
                    self.balls.clear();
                    self.balls.extend(triangles.chunks(CHUNK).map(|chunk| ball(chunk, &state.x)));
                    self.balls_at.clone_from(&state.x);
                    have_balls = true;
                }
                let [a, b] = placed.at_beginning(body, ends);
                let far = reach + placed.reach + radius;
                let may_meet = |(centre, size): (Vec3A, f32)| distance_squared(centre, a, b) <= (far + size).powi(2);
                for (chunk, ball) in self.balls.iter().enumerate() {
                    if !may_meet(*ball) {
                        continue;
                    }
                    let first = chunk * CHUNK;
                    let all = first as u32..(first + CHUNK).min(triangles.len()) as u32;
                    self.near.extend(all.filter(|t| {
                        if triangles[*t as usize].iter().any(|i| holes.lets_through(collider.tool, *i as usize)) {
                            return false;
                        }
                        let [p, q, r] = corners(*t);
                        may_meet((p, (q - p).length_squared().max((r - p).length_squared()).sqrt()))
                    }));
                }
            }
            self.ends.push(self.near.len());
        }
        if self.near.is_empty() {
            return;
        }
        self.is_near.clear();
        self.is_near.resize(body.vertex_count(), false);
        for t in &self.near {
            for corner in body.surface.triangles[*t as usize] {
                for around in body.surface.fan(corner) {
                    for i in body.surface.triangles[*around as usize] {
                        if !std::mem::replace(&mut self.is_near[i as usize], true) {
                            self.vertices.push(i);
                        }
                    }
                }
            }
        }
    }

    /// Appends the contacts of a substep that begins with the vertices at `x`, which go by `way` if
    /// their velocities stay (m). A contact whose vertices are all `fixed` is left out, because it
    /// moves nothing.
    #[expect(clippy::too_many_arguments, reason = "what a substep begins with")]
    pub fn find(
        &mut self,
        frame: &Frame<'_>,
        body: &Body,
        placed: &[Option<Placed>],
        fixed: &[bool],
        x: impl Fn(usize) -> Vec3A,
        way: impl Fn(usize) -> Vec3A,
        contacts: &mut Vec<Contact>,
    ) {
        self.keys.clear();
        if self.near.is_empty() {
            return;
        }
        let mut farthest = 0.0f32;
        for i in &self.vertices {
            self.x[*i as usize] = x(*i as usize);
            farthest = farthest.max(way(*i as usize).length_squared());
        }
        // What is expected no nearer in a substep waits for the next one.
        let reach = MARGIN + farthest.sqrt();
        let mut first = 0;
        for (c, end) in self.ends.iter().enumerate() {
            let triangles = &self.near[first..*end];
            first = *end;
            let (collider, Some(placed)) = (&frame.colliders[c], &placed[c]) else { continue };
            let Some((ends, radius)) = axis(&collider.shape).filter(|_| !triangles.is_empty()) else { continue };
            let far = reach + placed.reach + radius;
            let on_axis = placed.at_beginning(body, ends);
            tool_features::find(&body.surface, &self.x, triangles, on_axis, far, &mut self.found);
            for feature in &self.found {
                let by = |anchor: &FeatureAnchor| (anchor.collider, anchor.feature).cmp(&(c as u32, feature.key));
                let known = self.anchors.binary_search_by(by).map(|k| self.anchors[k]);
                let Feature { key, mut site } = *feature;
                if let Ok(FeatureAnchor { weights, .. }) = known {
                    site.weights = std::array::from_fn(|k| 0.5 * (site.weights[k] + weights[k]));
                }
                if site.shares().all(|(i, _)| fixed[i as usize]) {
                    continue;
                }
                let x = |i: u32| self.x[i as usize];
                // What pressed slides with the velocity that it has; what comes may not. Only its
                // plane is that ahead: a site ahead would swing with every velocity.
                let ahead = |i: u32| placed.beside(body, x(i), way(i as usize)).unwrap_or(x(i));
                let there = known.ok().and_then(|_| feature.moved(ahead, on_axis)).map(|site| site.at(ahead));
                let now = site.at(x);
                let p = placed.from.transform(body.origin + now.as_dvec3());
                let (normal, point) = placed.plane(collider, body, p, there.unwrap_or(now));
                let local = |place: DVec3| (placed.to.transform(place) - body.origin).as_vec3a();
                self.keys.push(key);
                contacts.push(Contact {
                    site,
                    source: Source::Collider(c as u32),
                    normal,
                    point,
                    place: local(p - known.map_or(Vec3A::ZERO, |anchor| anchor.stretch).as_dvec3()),
                    stiffness: stiffness(body, &site),
                    hard_from: collider.hard_from(),
                    friction: Friction::Coulomb(if placed.grips { 0.0 } else { collider.friction as f32 }),
                });
            }
        }
    }

    /// Ends a substep: friction's springs follow what slips, and tools feel the forces.
    pub fn end_substep(
        &mut self,
        frame: &Frame<'_>,
        body: &Body,
        placed: &[Option<Placed>],
        contacts: &[Contact],
        x: impl Fn(usize) -> Vec3A,
        forces: &mut [ToolForce],
    ) {
        self.next_anchors.clear();
        for (contact, key) in contacts.iter().zip(&self.keys) {
            let Source::Collider(c) = contact.source else { continue };
            let Some(placed) = &placed[c as usize] else { continue };
            let here = contact.site.at(|vertex| x(vertex as usize));
            let Some(push) = contact.push(here) else { continue };
            let stretch = here - contact.place - contact.slide(here).unwrap_or(Vec3A::ZERO);
            let along = stretch - stretch.dot(contact.normal) * contact.normal;
            self.next_anchors.push(FeatureAnchor {
                collider: c,
                feature: *key,
                weights: contact.site.weights,
                stretch: (placed.to.rotation.inverse() * along.as_dvec3()).as_vec3a(),
            });
            if let Some(force) = forces.get_mut(frame.colliders[c as usize].tool) {
                let arm = body.origin + here.as_dvec3() - placed.to.translation;
                force.contact += Wrench::at(push.gradient.as_dvec3(), arm);
                force.pressing += f64::from(contact.pressure(-contact.height(here)));
                force.touching += 1;
            }
        }
        std::mem::swap(&mut self.anchors, &mut self.next_anchors);
    }

    /// Ends a frame: the state keeps the stretches.
    pub fn end_frame(&self, state: &mut BodyState) {
        state.feature_anchors.clone_from(&self.anchors);
    }
}

/// The axis of a round shape and its radius (m).
fn axis(shape: &Shape) -> Option<([DVec3; 2], f32)> {
    match shape {
        Shape::Sphere { centre, radius } => Some(([*centre; 2], *radius as f32)),
        Shape::Capsule { ends, radius } => Some((*ends, *radius as f32)),
        Shape::HalfSpace { .. } | Shape::Box { .. } | Shape::Hull(_) => None,
    }
}

/// Stiffness of a point between vertices over that of a vertex. Only a few of them bear a tool that
/// is thinner than a triangle is wide.
const STIFFNESS: f32 = 4.0;

/// Stiffness of a point between vertices (N/m): 0 at a vertex, all of it in the middle of an edge.
/// Inside a triangle it continues that of the edges.
fn stiffness(body: &Body, site: &Site) -> f32 {
    let [u, v, w] = site.weights;
    let share = STIFFNESS * (4.0 * (u * v + v * w + w * u)).min(1.0);
    share * site.shares().map(|(i, weight)| weight * body.contact_stiffness_of(i)).sum::<f32>()
}

/// Number of triangles that are tested together first. The surface keeps near ones together.
const CHUNK: usize = 32;

/// A ball around triangles with their vertices at `x`: centre and radius (m).
fn ball(triangles: &[[u32; 3]], x: &[Vec3A]) -> (Vec3A, f32) {
    let (mut low, mut high) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    for i in triangles.iter().flatten() {
        (low, high) = (low.min(x[*i as usize]), high.max(x[*i as usize]));
    }
    (0.5 * (low + high), 0.5 * low.distance(high))
}

/// Squared distance of a point from a segment (m2).
fn distance_squared(p: Vec3A, a: Vec3A, b: Vec3A) -> f32 {
    let along = b - a;
    let share = ((p - a).dot(along) / along.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
    (p - a - share * along).length_squared()
}
