//! Where the bodies of an island touch each other, and folded tissue itself: vertices of one at triangles of another.
//!
//! During a substep the plane, and the place on the triangle that is nearest, are held: a [`Touch`] of the vertex's offset from that place, which moves with the triangle's corners. So the
//! push has a potential of all four vertices, and what one body feels the other does. Friction is a spring across the plane; how far it is stretched belongs to the state and is turned
//! with the plane.

use super::coupling::Coupling;
use super::touch::{Friction, Push, Source, Touch};
use crate::integrator::{Frame, Solver, Worker};
use glam::Vec3A;

/// What is this much further away [m] than where it presses and twice what it goes in a substep is left out of it.
const LIKELY: f32 = 3e-4;

/// How far friction's spring between a vertex and another body is stretched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stretch {
    pub vertex: u32,
    pub other: u32,
    /// The vertex from where friction holds it without force [m].
    pub by: Vec3A,
}

/// A vertex at a triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pair {
    /// The vertex's body and the triangle's, among those of the island.
    pub member: usize,
    pub other: usize,
    pub vertex: u32,
    /// Corners of the triangle, and how much each counts at the place that is nearest.
    pub corners: [u32; 3],
    pub weights: [f32; 3],
    /// Of the vertex's offset from that place.
    pub touch: Touch,
    /// Limit of friction [N], held during a search.
    pub limit: f32,
    /// What it pushed its vertex with when that was last written down [N].
    pub noted: Vec3A,
    /// Which of those that may touch in the frame it is.
    candidate: u32,
    /// The triangle's number.
    triangle: u32,
    /// Distance at which nothing presses [m].
    free: f32,
    /// From the triangle's frame to the vertex's [m].
    shift: Vec3A,
    /// At the substep's beginning [m].
    stretch: Vec3A,
    /// Whether the vertex was outside when it was last looked at.
    outside: bool,
    /// Whether it was near enough then.
    listed: bool,
}

/// A vertex that takes part in a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Role {
    member: u32,
    vertex: u32,
    pair: u32,
    /// Which corner of the triangle it is; 3: it is the vertex.
    corner: u32,
}

/// What may touch in an island during a frame.
#[derive(Default)]
pub(crate) struct Pairs {
    /// How far tools carry held nodes of each body in the frame [m].
    carried: Vec<f32>,
    /// In the frame.
    candidates: Vec<Pair>,
    /// In the substep.
    list: Vec<Pair>,
    /// Sorted; for the sweeps.
    roles: Vec<Role>,
    pressed: Vec<Touch>,
}

impl Pair {
    /// Offset of the vertex from the place on the triangle [m]; `x` says where a vertex of a body of the island is.
    #[inline(always)]
    pub fn offset(&self, x: impl Fn(usize, u32) -> Vec3A) -> Vec3A {
        let place = |k: usize| self.weights[k] * x(self.other, self.corners[k]);
        x(self.member, self.vertex) + self.shift - (place(0) + place(1) + place(2))
    }

    /// The four vertices with their bodies, and how much of the push each gets.
    pub fn shares(&self) -> [(usize, u32, f32); 4] {
        let corner = |k: usize| (self.other, self.corners[k], -self.weights[k]);
        [(self.member, self.vertex, 1.0), corner(0), corner(1), corner(2)]
    }

    /// What the vertex is pushed with [N]; `x` says where a vertex of a body of the island is.
    pub fn push_at(&self, x: impl Fn(usize, u32) -> Vec3A) -> Vec3A {
        self.push(self.offset(x)).map_or(Vec3A::ZERO, |push| push.gradient)
    }

    /// Force on the vertex at an `offset`, within the limit of friction.
    #[inline(always)]
    pub fn push(&self, offset: Vec3A) -> Option<Push> {
        self.touch.push_within(offset, self.limit)
    }
}

impl Pairs {
    /// Begins a frame of an island: takes over what `coupling` found.
    pub fn begin<S: Solver>(&mut self, coupling: &Coupling, frame: &Frame<'_>, island: &[Worker<S>]) {
        self.candidates.clear();
        self.list.clear();
        self.carried.clear();
        for Worker { index, body, .. } in island {
            let here = frame.of(*index);
            let tools = here.rigid_grasps().filter_map(|grasp| frame.tools.get(grasp.tool));
            self.carried.push(tools.map(|tool| tool.travel(body)).fold(0.0, f64::max) as f32);
        }
        let Some(first) = island.first() else { return };
        let contact = coupling.contact();
        let member = |body: u32| island.iter().position(|worker| worker.index == body as usize);
        let near = coupling.near().iter().filter(|near| coupling.island(near.body as usize) == first.island);
        for near in near {
            let (Some(a), Some(b)) = (member(near.body), member(near.other)) else { continue };
            let (one, two) = (&island[a], &island[b]);
            let stretches = &one.state.stretches;
            let known = stretches.binary_search_by_key(&(near.vertex, near.other), |s| (s.vertex, s.other));
            let stiffness = |worker: &Worker<S>, vertex: u32| worker.body.tissue_stiffness(vertex as usize);
            let theirs: f32 = near.triangle.iter().zip(near.weights).map(|(c, w)| w * stiffness(two, *c)).sum();
            let ours = stiffness(one, near.vertex);
            self.candidates.push(Pair {
                member: a,
                other: b,
                vertex: near.vertex,
                corners: near.triangle,
                weights: near.weights,
                touch: Touch {
                    vertex: near.vertex,
                    source: Source::Body(near.other),
                    normal: near.normal.into(),
                    point: Vec3A::ZERO,
                    place: Vec3A::ZERO,
                    // Two springs in a row, one in each body.
                    stiffness: 2.0 * contact.stiffness as f32 * ours * theirs / (ours + theirs),
                    friction: Friction::Coulomb(contact.friction as f32),
                },
                limit: 0.0,
                noted: Vec3A::ZERO,
                candidate: self.candidates.len() as u32,
                triangle: near.at,
                free: near.free,
                shift: (one.body.origin - two.body.origin).as_vec3a(),
                stretch: known.map_or(Vec3A::ZERO, |k| stretches[k].by),
                outside: near.distance > 0.0,
                listed: false,
            });
        }
    }

    /// Whether nothing can touch in the frame.
    pub fn is_empty(&self) -> bool {
        self.candidates.is_empty()
    }

    /// What may touch in the substep.
    pub fn list(&self) -> &[Pair] {
        &self.list
    }

    pub fn list_mut(&mut self) -> &mut [Pair] {
        &mut self.list
    }

    /// Finds the places and planes of a substep of `h` [s] that begins with the states as they are. They are those that the vertex will have come to along the surface: planes of where it is would
    /// be steps in its way wherever it goes over an edge. Between bodies of which `rested` says that they were at rest since the last substep of this frame, nothing is new.
    pub fn find<S: Solver>(&mut self, island: &[Worker<S>], h: f32, rested: impl Fn(&Worker<S>) -> bool) {
        self.list.clear();
        for pair in &mut self.candidates {
            if rested(&island[pair.member]) && rested(&island[pair.other]) {
                if pair.listed {
                    pair.limit = 0.0;
                    self.list.push(*pair);
                }
                continue;
            }
            pair.listed = false;
            let (one, two) = (&island[pair.member], &island[pair.other]);
            let (surface, x, v) = (&two.body.surface, &two.state.x[..], &two.state.v[..]);
            let p = one.state.x[pair.vertex as usize] + pair.shift;
            let (triangle, foot) = surface.at(x, p, pair.triangle);
            let theirs = |t: u32, weights: [f32; 3]| -> Vec3A {
                (0..3).map(|k| weights[k] * v[surface.triangles[t as usize][k] as usize]).sum()
            };
            let way = h * (one.state.v[pair.vertex as usize] - theirs(triangle, foot.weights));
            let carried = self.carried[pair.member] + self.carried[pair.other];
            let reach = (pair.free + LIKELY + 2.0 * way.length() + carried).max(0.0);
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
            pair.touch.normal = normal;
            pair.touch.point = pair.free * normal;
            pair.touch.place = foot.off - (ahead - p) - pair.stretch;
            pair.limit = 0.0;
            pair.listed = true;
            self.list.push(*pair);
        }
    }

    /// Whether a body of the island is pressed by another.
    pub fn presses<S: Solver>(&self, island: &[Worker<S>], member: usize) -> bool {
        let x = |m: usize, vertex: u32| island[m].state.x[vertex as usize];
        let of = |pair: &&Pair| pair.member == member || pair.other == member;
        self.list.iter().filter(of).any(|pair| pair.touch.push(pair.offset(x)).is_some())
    }

    /// Ends a substep with the states as they are: friction's places follow what slips.
    pub fn settle<S: Solver>(&mut self, island: &[Worker<S>]) {
        let x = |m: usize, vertex: u32| island[m].state.x[vertex as usize];
        for pair in &self.list {
            let offset = pair.offset(x);
            self.candidates[pair.candidate as usize].stretch = if pair.touch.push(offset).is_some() {
                let normal = pair.touch.normal;
                let off = offset - pair.touch.place - pair.touch.slide(offset).unwrap_or(Vec3A::ZERO);
                off - off.dot(normal) * normal
            } else {
                Vec3A::ZERO
            };
        }
    }

    /// Ends a frame: the states remember.
    pub fn end<S: Solver>(&self, island: &mut [Worker<S>]) {
        island.iter_mut().for_each(|worker| worker.state.stretches.clear());
        for pair in self.candidates.iter().filter(|pair| pair.stretch != Vec3A::ZERO) {
            let other = island[pair.other].index as u32;
            let stretch = Stretch { vertex: pair.vertex, other, by: pair.stretch };
            island[pair.member].state.stretches.push(stretch);
        }
    }

    /// Sorts out which vertices of which bodies take part, for the sweeps of a substep.
    pub fn assign(&mut self) {
        self.roles.clear();
        for (k, pair) in self.list.iter().enumerate() {
            for (corner, (member, vertex, share)) in pair.shares().into_iter().enumerate() {
                // What hardly counts is no touch: sweeps divide by it.
                if share.abs() > 1e-6 {
                    // The vertex itself comes first among the shares.
                    let corner = (corner as u32 + 3) % 4;
                    self.roles.push(Role { member: member as u32, vertex, pair: k as u32, corner });
                }
            }
        }
        self.roles.sort_unstable();
    }

    /// What the others do to a body, by vertex: every touch as it is for one vertex while the other three of its pair stay where they are.
    pub fn on<S: Solver>(&mut self, island: &[Worker<S>], member: usize) -> &[Touch] {
        let x = |m: usize, vertex: u32| island[m].state.x[vertex as usize];
        self.pressed.clear();
        let first = self.roles.partition_point(|role| (role.member as usize) < member);
        for role in self.roles[first..].iter().take_while(|role| role.member as usize == member) {
            let pair = &self.list[role.pair as usize];
            let (offset, here) = (pair.offset(x), x(member, role.vertex));
            let (height, off) = (pair.touch.height(offset), offset - pair.touch.place);
            // The offset changes by so much of what the vertex moves.
            let share = if role.corner == 3 { 1.0 } else { -pair.weights[role.corner as usize] };
            self.pressed.push(Touch {
                vertex: role.vertex,
                normal: share.signum() * pair.touch.normal,
                point: here - (height / share) * pair.touch.normal,
                place: here - off / share,
                stiffness: pair.touch.stiffness * share * share,
                ..pair.touch
            });
        }
        &self.pressed
    }
}
