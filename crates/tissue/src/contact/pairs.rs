//! Contacts between the bodies of an island, and of folded tissue with itself: vertices of one at
//! triangles of another.
//!
//! During a substep the plane and the nearest place on the triangle are fixed. A pair is a
//! [`Contact`] of the vertex's offset from that place, which moves with the corners of the
//! triangle. So the force has a potential of all four vertices, and acts on both bodies alike.
//! Friction is a spring across the plane. Its stretch belongs to the state and rotates with the
//! plane.

use super::contact::{Contact, Friction, Push};
use super::coupling::Coupling;
use super::members::Members;
use super::site::{Site, add_share};
use crate::Body;
use crate::frame::Frame;
use crate::state::{Source, Stretch};
use glam::Vec3A;

/// Pairs are left out of a substep if their gap exceeds the gap of contact by more than twice their
/// motion in the substep and this margin (m).
const SUBSTEP_MARGIN: f32 = 3e-4;

/// Nodes with a smaller share of a pair do not bear it in sweeps, which divide by it.
const MIN_SHARE: f32 = 1e-6;

/// A vertex at a triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pair {
    /// The body of the vertex and that of the triangle, by their numbers in the island.
    pub member: usize,
    pub other: usize,
    pub vertex: u32,
    /// Corners of the triangle, and their weights at the nearest place.
    pub corners: [u32; 3],
    pub weights: [f32; 3],
    /// The contact of the vertex's offset from that place.
    pub contact: Contact,
    /// Limit of friction (N), constant during a search.
    pub limit: f32,
    /// Force on the vertex when it was last recorded (N).
    pub recorded: Vec3A,
    /// Its number among the candidates of the frame.
    candidate: u32,
    /// The triangle's number.
    triangle: u32,
    /// Distance without force (m).
    free: f32,
    /// From the triangle's frame to the vertex's (m).
    shift: Vec3A,
    /// Stretch of friction's spring at the substep's beginning (m).
    stretch: Vec3A,
    /// The offset then (m).
    begin: Vec3A,
    /// Whether the vertex was outside when the pair was last examined.
    outside: bool,
    /// Whether it was near enough for the substep then.
    listed: bool,
}

/// A node that takes part in a pair.
#[derive(Clone, Copy, Debug)]
struct Role {
    /// Its body, the node, the pair, and which of the pair's nodes it is, the vertex's last.
    key: [u32; 4],
    /// Share of its motion by which the pair's offset changes.
    share: f32,
}

/// The pairs of an island during a frame.
#[derive(Default)]
pub(crate) struct Pairs {
    /// How far tools carry held nodes of each body in the frame (m).
    carried: Vec<f32>,
    /// The gap of contact (m).
    offset: f32,
    /// Pairs that may touch in the frame.
    candidates: Vec<Pair>,
    /// Pairs that may touch in the substep.
    list: Vec<Pair>,
    /// Sorted; for the sweeps.
    roles: Vec<Role>,
    /// Scratch: bodies, nodes and shares of a pair.
    nodes: Vec<((u32, u32), f32)>,
    pressed: Vec<Contact>,
}

impl Pair {
    /// Offset of the vertex from the place on the triangle (m); `x` is the position of a vertex of
    /// a body of the island.
    #[inline(always)]
    pub fn offset(&self, x: impl Fn(usize, u32) -> Vec3A) -> Vec3A {
        let place = |k: usize| self.weights[k] * x(self.other, self.corners[k]);
        x(self.member, self.vertex) + self.shift - (place(0) + place(1) + place(2))
    }

    /// From the frame of the triangle's body to that of the vertex's (m).
    pub fn shift(&self) -> Vec3A {
        self.shift
    }

    /// The four vertices with their bodies, and the share of the force on each.
    pub fn shares(&self) -> [(usize, u32, f32); 4] {
        let corner = |k: usize| (self.other, self.corners[k], -self.weights[k]);
        [(self.member, self.vertex, 1.0), corner(0), corner(1), corner(2)]
    }

    /// Force on the vertex (N); `x` is the position of a vertex of a body of the island.
    pub fn push_at(&self, x: impl Fn(usize, u32) -> Vec3A) -> Vec3A {
        self.push(self.offset(x)).map_or(Vec3A::ZERO, |push| push.gradient)
    }

    /// Force on the vertex at an `offset`, within the limit of friction.
    #[inline(always)]
    pub fn push(&self, offset: Vec3A) -> Option<Push> {
        self.contact.push_within(offset, self.limit)
    }
}

impl Pairs {
    /// Begins a frame of an island with the pairs that `coupling` found.
    pub fn begin_frame(&mut self, coupling: &Coupling, frame: &Frame<'_>, island: &(impl Members + ?Sized)) {
        self.candidates.clear();
        self.list.clear();
        self.carried.clear();
        for m in 0..island.count() {
            self.carried.push(frame.of(island.index(m)).carried(island.body(m), true) as f32);
        }
        if island.count() == 0 {
            return;
        }
        let own = coupling.island(island.index(0));
        let contact = coupling.contact();
        self.offset = contact.offset as f32;
        let member = |body: u32| (0..island.count()).find(|m| island.index(*m) == body as usize);
        let near = coupling.near().iter().filter(|near| coupling.island(near.body as usize) == own);
        for near in near {
            let (Some(a), Some(b)) = (member(near.body), member(near.other)) else { continue };
            let (one, two) = (island.body(a), island.body(b));
            let stretches = &island.state(a).stretches;
            let known = stretches.binary_search_by_key(&(near.vertex, near.other), |s| (s.vertex, s.other));
            let stiffness = |body: &Body, vertex: u32| body.tissue_stiffness_of(vertex as usize);
            let theirs: f32 = near.triangle.iter().zip(near.weights).map(|(c, w)| w * stiffness(two, *c)).sum();
            let ours = stiffness(one, near.vertex);
            self.candidates.push(Pair {
                member: a,
                other: b,
                vertex: near.vertex,
                corners: near.triangle,
                weights: near.weights,
                contact: Contact {
                    site: Site::vertex(near.vertex),
                    source: Source::Body(near.other),
                    normal: near.normal.into(),
                    point: Vec3A::ZERO,
                    place: Vec3A::ZERO,
                    // Two springs in a row, one in each body.
                    stiffness: 2.0 * contact.stiffness as f32 * ours * theirs / (ours + theirs),
                    hard_from: f32::INFINITY,
                    friction: Friction::Coulomb(contact.friction as f32),
                },
                limit: 0.0,
                recorded: Vec3A::ZERO,
                candidate: self.candidates.len() as u32,
                triangle: near.at,
                free: near.free,
                shift: (one.origin - two.origin).as_vec3a(),
                stretch: known.map_or(Vec3A::ZERO, |k| stretches[k].by),
                begin: Vec3A::ZERO,
                outside: near.distance > 0.0,
                listed: false,
            });
        }
    }

    /// Whether nothing can touch in the frame.
    pub fn is_empty(&self) -> bool {
        self.candidates.is_empty()
    }

    /// The pairs of the substep.
    pub fn list(&self) -> &[Pair] {
        &self.list
    }

    pub fn list_mut(&mut self) -> &mut [Pair] {
        &mut self.list
    }

    /// Finds places and planes of a substep of `h` (s) that begins with the present states.
    ///
    /// They are those where the vertex will be along the surface at the end: planes of where it is
    /// now would be steps in its way wherever it passes an edge. Pairs of bodies that were at rest
    /// (`rested`) since the last substep of this frame do not change.
    ///
    /// What rests falls by h^2 g in a substep. Where that is more than half of the gap of contact,
    /// as in long frames, pairs are listed from farther away: what fell through the gap unseen
    /// would be thrown back.
    pub fn find(
        &mut self,
        island: &(impl Members + ?Sized),
        frame: &Frame<'_>,
        h: f32,
        rested: impl Fn(usize) -> bool,
    ) {
        self.list.clear();
        let fall = h * h * frame.gravity.length() as f32;
        let margin = SUBSTEP_MARGIN.max(fall - 0.5 * self.offset);
        for pair in &mut self.candidates {
            if rested(pair.member) && rested(pair.other) {
                if pair.listed {
                    pair.limit = 0.0;
                    self.list.push(*pair);
                }
                continue;
            }
            pair.listed = false;
            let (one, two) = (island.state(pair.member), island.state(pair.other));
            let (surface, x, v) = (&island.body(pair.other).surface, &two.x[..], &two.v[..]);
            let p = one.x[pair.vertex as usize] + pair.shift;
            let (triangle, foot) = surface.at(x, p, pair.triangle);
            let theirs = |t: u32, weights: [f32; 3]| -> Vec3A {
                (0..3).map(|k| weights[k] * v[surface.triangles[t as usize][k] as usize]).sum()
            };
            let way = h * (one.v[pair.vertex as usize] - theirs(triangle, foot.weights));
            let carried = self.carried[pair.member] + self.carried[pair.other];
            let reach = (pair.free + margin + 2.0 * way.length() + carried).max(0.0);
            if pair.stretch == Vec3A::ZERO && foot.off.length_squared() > reach * reach && pair.outside {
                continue;
            }
            // Nearer triangles of a vertex's own body are its neighbourhood.
            let own = pair.member == pair.other;
            let nearest = |p: Vec3A, t: u32| if own { surface.at(x, p, t) } else { surface.nearest_from(x, p, t) };
            let (triangle, foot) = nearest(p, triangle);
            let Some((normal, distance)) = surface.signed(x, triangle, &foot) else { continue };
            let ahead = p + (way - way.dot(normal) * normal);
            let (triangle, foot) = if ahead == p { (triangle, foot) } else { nearest(ahead, triangle) };
            let (normal, distance) = if ahead == p {
                (normal, distance)
            } else {
                surface.signed(x, triangle, &foot).unwrap_or((normal, 0.0))
            };
            pair.triangle = triangle;
            pair.outside = distance > 0.0;
            pair.corners = surface.triangles[triangle as usize];
            pair.weights = foot.weights;
            let along = pair.stretch - pair.stretch.dot(normal) * normal;
            pair.stretch = along.normalize_or_zero() * pair.stretch.length();
            pair.contact.normal = normal;
            pair.contact.point = pair.free * normal;
            pair.begin = pair.offset(|m, i| island.x(m, i));
            pair.contact.place = pair.begin - pair.stretch;
            pair.limit = 0.0;
            pair.listed = true;
            self.list.push(*pair);
        }
    }

    /// Whether another body presses a body of the island.
    pub fn presses(&self, island: &(impl Members + ?Sized), member: usize) -> bool {
        let x = |m: usize, vertex: u32| island.x(m, vertex);
        let of = |pair: &&Pair| pair.member == member || pair.other == member;
        self.list.iter().filter(of).any(|pair| pair.contact.push(pair.offset(x)).is_some())
    }

    /// Ends a substep with the present states: stretches follow slipping contacts.
    ///
    /// They change by the motion. A stretch that is measured anew from positions in single
    /// precision would drift where nothing moves, because the rounding is the same each time.
    pub fn end_substep(&mut self, island: &(impl Members + ?Sized)) {
        let x = |m: usize, vertex: u32| island.x(m, vertex);
        for pair in &self.list {
            let offset = pair.offset(x);
            self.candidates[pair.candidate as usize].stretch = if pair.contact.push(offset).is_some() {
                let normal = pair.contact.normal;
                let by = offset - pair.begin - pair.contact.slide(offset).unwrap_or(Vec3A::ZERO);
                pair.stretch + (by - by.dot(normal) * normal)
            } else {
                Vec3A::ZERO
            };
        }
    }

    /// Ends a frame: the states keep the stretches.
    pub fn end_frame(&self, island: &mut (impl Members + ?Sized)) {
        (0..island.count()).for_each(|m| island.state_mut(m).stretches.clear());
        for pair in self.candidates.iter().filter(|pair| pair.stretch != Vec3A::ZERO) {
            let other = island.index(pair.other) as u32;
            let stretch = Stretch { vertex: pair.vertex, other, by: pair.stretch };
            island.state_mut(pair.member).stretches.push(stretch);
        }
    }

    /// Lists which nodes of which bodies take part, for the sweeps of a substep.
    pub fn list_roles(&mut self, island: &(impl Members + ?Sized)) {
        let Self { list, roles, nodes, .. } = self;
        roles.clear();
        for (k, pair) in list.iter().enumerate() {
            nodes.clear();
            let [own, corners @ ..] = pair.shares();
            // The vertex itself comes last.
            for (member, vertex, share) in corners.into_iter().chain([own]) {
                island.body(member).for_nodes(vertex, share, |node, share| {
                    add_share(nodes, (member as u32, node), share);
                });
            }
            for (number, ((member, node), share)) in nodes.iter().enumerate() {
                // A tiny share is no contact: sweeps divide by it.
                if share.abs() > MIN_SHARE {
                    roles.push(Role { key: [*member, *node, k as u32, number as u32], share: *share });
                }
            }
        }
        roles.sort_unstable_by_key(|role| role.key);
    }

    /// Contacts of a body with the others, by node: each for one node while the others of its pair
    /// are fixed.
    pub fn contacts_of(&mut self, island: &(impl Members + ?Sized), member: usize) -> &[Contact] {
        let x = |m: usize, vertex: u32| island.x(m, vertex);
        self.pressed.clear();
        let first = self.roles.partition_point(|role| (role.key[0] as usize) < member);
        for Role { key: [_, node, pair, _], share } in
            self.roles[first..].iter().take_while(|role| role.key[0] as usize == member)
        {
            let pair = &self.list[*pair as usize];
            self.pressed.push(pair.contact.of_vertex(*node, *share, x(member, *node), pair.offset(x)));
        }
        &self.pressed
    }
}
