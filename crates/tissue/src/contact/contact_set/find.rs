//! The contacts of a substep: planes of the surfaces that near vertices touch.

use super::ContactSet;
use crate::Body;
use crate::contact::contact::{Contact, Friction};
use crate::contact::site::Site;
use crate::contact::tool_placement;
use crate::frame::Frame;
use crate::state::Source;
use glam::Vec3A;

/// Marks a vertex's first contact while they are being found.
const MARK: u32 = 1 << 31;

impl ContactSet {
    /// Calls `found` for each source within reach of a `vertex` at `x`. Its arguments are the
    /// source, the vertex's height above it now, the normal and a point of its plane at the
    /// substep's end, the vertex in the frame of the source, and a factor of the contact stiffness,
    /// which is not 1 for a field, because its penalty is along its `up`. The vertex is in the box
    /// of the last [`Self::list_reachable`].
    #[inline(always)]
    pub(super) fn for_sources(
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
        for c in &self.reachable {
            let (collider, Some(placed)) = (&frame.colliders[*c as usize], &self.placed[*c as usize]) else { continue };
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
                let source = Source::Collider(*c);
                found(source, height as f32, normal.as_vec3a(), point.as_vec3a(), p.as_vec3a(), 1.0);
            }
        }
    }

    /// Lists the colliders that a vertex in a box may touch, for [`Self::for_sources`]. Where
    /// positions are not finite the list has no meaning: then the frame's beginning is restored.
    pub(super) fn list_reachable(&mut self, (low, high): (Vec3A, Vec3A)) {
        let Self { placed, reachable, reach, .. } = self;
        reachable.clear();
        for (c, placed) in placed.iter().enumerate() {
            let Some(placed) = placed else { continue };
            let far = *reach + placed.reach;
            let off = (low - placed.centre).max(placed.centre - high).max(Vec3A::ZERO);
            // Rounding keeps the order: no vertex in the box is nearer.
            if off.length_squared() <= (placed.radius + far) * (placed.radius + far) {
                reachable.push(c as u32);
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
        self.list_reachable(bounds(self.near.iter().map(|i| x(*i as usize))));
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
}

/// The smallest and the largest coordinates of points.
pub(super) fn bounds(points: impl Iterator<Item = Vec3A>) -> (Vec3A, Vec3A) {
    let none = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    points.fold(none, |(low, high), x| (low.min(x), high.max(x)))
}
