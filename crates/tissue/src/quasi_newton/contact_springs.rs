//! The springs of contacts, grasps and threads that are not in the factor as they are.
//!
//! The factor has one stiffness in all directions at the nodes that pressed when it was made, and
//! at those in a grasp or on a thread, so that it stays valid however the tissue turns. A contact
//! has another one along its normal than along the surface, has none along its pull while it
//! slides, and acts on all corners of an edge or a triangle at once.

use super::iterate::position;
use super::layout::Layout;
use super::springs::{Springs, Term};
use super::warp::Warp;
use crate::contact::{Contact, ContactSet};
use crate::lanes::Row;
use glam::Vec3A;

/// A stiffness below this share of a contact's is left out.
const MIN_SHARE: f32 = 0.05;

/// A stiffness that differs from that in the factor by less than this share is taken as it is
/// there.
const MIN_DIFFERENCE: f32 = 0.3;

/// Greatest number of springs up to which those of sliding nodes take part.
const MAX_SLIDING: usize = 384;

/// Springs that there is room for without allocating.
const ROOM: usize = 512;

/// Displacements along the surface below this have no direction (m).
const MIN_OFF: f32 = 1e-9;

/// A body where its nodes are.
pub(super) struct Placed<'a> {
    pub layout: &'a Layout,
    pub warp: &'a Warp,
    /// Positions (m).
    pub x: &'a [Row],
    /// Nodes that a tool carries.
    pub held: &'a [bool],
    /// What the factor has at each free node (N/m).
    pub in_factor: &'a [f32],
}

/// Finds the springs of a body's contacts.
pub(super) struct ContactSprings {
    /// The list.
    pub springs: Springs,
    /// Of each free node, how many contacts act on it, and the place of one of them.
    of_node: Vec<(u32, u32)>,
}

impl ContactSprings {
    pub fn new(layout: &Layout) -> Self {
        Self { springs: Springs::with_capacity(ROOM), of_node: vec![(0, 0); layout.free] }
    }

    /// Adds the difference between the contacts, with these `limits` of friction (N), and the
    /// factor. Where a grasp of very many nodes slips, a matrix of their springs would cost more
    /// than it saves: they stay as in the factor.
    pub fn add(&mut self, at: &Placed<'_>, contacts: &ContactSet, limits: &[f32]) {
        let list = contacts.list();
        self.of_node.fill((0, 0));
        for (k, contact) in list.iter().enumerate().filter(|(k, contact)| at.acts(contact, limits[*k])) {
            at.for_nodes(contact, |node, _| {
                let (count, place) = &mut self.of_node[node];
                (*count, *place) = (*count + 1, k as u32);
            });
        }
        for (contact, limit) in list.iter().zip(limits).filter(|(contact, limit)| at.acts(contact, **limit)) {
            if at.node_of(contact).is_some_and(|node| self.of_node[node].0 == 1 && at.in_factor[node] > 0.0) {
                continue;
            }
            for (direction, stiffness) in at.stiffness(contact, *limit) {
                if stiffness > MIN_SHARE * contact.stiffness {
                    at.push(&mut self.springs, contact, direction, stiffness);
                }
            }
        }
        self.add_differences(at, (list, limits), false);
        let count = self.springs.len();
        self.add_differences(at, (list, limits), true);
        if self.springs.len() > MAX_SLIDING {
            self.springs.truncate(count);
        }
    }

    /// Adds the differences at nodes that the factor has contacts of. Where exactly one contact
    /// acts on the node itself, they are those that are `softer`, or all others. Elsewhere the
    /// factor's stiffness is taken away, together with those that are not softer.
    fn add_differences(&mut self, at: &Placed<'_>, (list, limits): (&[Contact], &[f32]), softer: bool) {
        let known = at.in_factor.iter().zip(&self.of_node).enumerate().filter(|(_, (known, _))| **known > 0.0);
        for (node, (known, (count, place))) in known.filter(|(node, _)| !at.held[*node]) {
            let contact = (*count == 1).then(|| (&list[*place as usize], limits[*place as usize]));
            match contact.filter(|(contact, _)| at.node_of(contact).is_some()) {
                None if softer => {}
                None => self.springs.push_alike(-known, node as u32),
                Some((contact, limit)) => {
                    for (direction, stiffness) in at.stiffness(contact, limit) {
                        let more = stiffness - known;
                        if (more < 0.0) == softer && more.abs() > MIN_DIFFERENCE * known {
                            at.push(&mut self.springs, contact, direction, more);
                        }
                    }
                }
            }
        }
    }

    /// Adds what differs from the factor where contacts press, as if each were as stiff in all
    /// directions at each of its nodes as along its normal: springs at nodes, three each.
    pub fn add_alike(&mut self, at: &Placed<'_>, contacts: &ContactSet) {
        let mut now: Vec<f32> = vec![0.0; at.layout.free];
        for contact in contacts.list() {
            let here = at.point(contact);
            let stiffness = match contact.source.is_in_factor() {
                true => contact.stiffness,
                false if contact.height(here) < 0.0 => contact.tangent(here),
                false => continue,
            };
            for (vertex, share) in contact.site.shares() {
                // By weights of both signs it is no less than their part of the matrix.
                let stiffness = at.layout.spread(vertex).unwrap_or(1.0) * stiffness;
                at.layout.for_nodes(vertex, share, |node, share| {
                    if node < at.layout.free {
                        now[node] += share.abs() * stiffness;
                    }
                });
            }
        }
        let differences = || {
            let nodes = now.iter().zip(at.in_factor).enumerate().filter(|(node, _)| !at.held[*node]);
            let different = nodes.filter(|(_, (now, known))| (**now - **known).abs() > MIN_DIFFERENCE * **known);
            different.map(|(node, (now, known))| (node as u32, now - known))
        };
        differences().filter(|(_, more)| *more > 0.0).for_each(|(node, more)| self.springs.push_alike(more, node));
        differences().filter(|(_, more)| *more < 0.0).for_each(|(node, less)| self.springs.push_alike(less, node));
    }
}

impl Placed<'_> {
    /// Calls `visit(node, share)` for the nodes that bear a contact and can move.
    fn for_nodes(&self, contact: &Contact, mut visit: impl FnMut(usize, f32)) {
        for (vertex, share) in contact.site.shares() {
            self.layout.for_nodes(vertex, share, |node, share| {
                if node < self.layout.free && !self.held[node] {
                    visit(node, share);
                }
            });
        }
    }

    /// The node of a contact of a node that can move. None for another one.
    fn node_of(&self, contact: &Contact) -> Option<usize> {
        let vertex = contact.site.first();
        let is_node = contact.site.is_vertex() && self.layout.spread(vertex).is_none();
        let node = self.layout.number.get(vertex as usize).filter(|_| is_node).map(|node| *node as usize);
        node.filter(|node| *node < self.layout.free && !self.held[*node])
    }

    fn point(&self, contact: &Contact) -> Vec3A {
        contact.site.at(|vertex| self.layout.value(vertex, |i| position(&self.x[i])))
    }

    /// Whether a contact has a force.
    fn acts(&self, contact: &Contact, limit: f32) -> bool {
        contact.push_within(self.point(contact), limit).is_some()
    }

    /// The stiffness of a contact along three directions at right angles: the second derivative of
    /// its energy, or more.
    fn stiffness(&self, contact: &Contact, limit: f32) -> [(Vec3A, f32); 3] {
        let here = self.point(contact);
        let off = contact.off(here);
        let pull = off.length();
        let along = if pull > MIN_OFF { off / pull } else { contact.normal.any_orthonormal_vector() };
        let [normal, first, second] = match contact.push_within(here, limit) {
            None => [0.0; 3],
            // At its limit, friction pulls with the same force however far the point is. A hard
            // contact keeps its secant, which is never too soft.
            Some(push) if push.across < contact.stiffness && contact.source.is_in_factor() => {
                [push.along, 0.0, push.across]
            }
            Some(push) => [push.along, push.across, push.across],
        };
        [(contact.normal, normal), (along, first), (contact.normal.cross(along), second)]
    }

    /// Adds a spring of a contact along a `direction`.
    fn push(&self, springs: &mut Springs, contact: &Contact, direction: Vec3A, stiffness: f32) {
        let direction = direction.to_array();
        let mut terms = [Term { node: 0, along: [0.0; 3] }; 12];
        let mut count = 0;
        self.for_nodes(contact, |node, share| {
            let along = self.warp.turn_back(node as u32, direction).map(|c| share * c);
            terms[count] = Term { node: node as u32, along };
            count += 1;
        });
        springs.push(stiffness, terms.into_iter().take(count));
    }
}
