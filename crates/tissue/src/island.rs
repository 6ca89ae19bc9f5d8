//! Islands: bodies that may touch each other and no others. Each is solved on its own, in parallel.

use crate::body_slot::{BodySlot, Solver};
use crate::contact::{ContactSet, Coupling, Members, Pairs};
use crate::frame::Frame;
use crate::state::Source;
use glam::DVec3;
use std::cmp::Reverse;

/// An island: its number of slots, and the data that its bodies share.
pub(crate) struct Island<S: Solver> {
    /// Bodies of the island; they are adjacent in the list of slots.
    bodies: usize,
    /// Where the bodies may touch each other.
    pub pairs: Pairs,
    /// The shared memory of their solvers.
    pub history: S::History,
}

/// The islands of a frame, the largest first. Islands of earlier frames stay as spare memory.
pub(crate) struct Islands<S: Solver> {
    list: Vec<Island<S>>,
    /// Islands in use.
    count: usize,
    /// By body: elements of the island that begins with it.
    sizes: Vec<usize>,
}

impl<S: Solver> Islands<S> {
    /// None, with room for one for each of `slots`.
    pub fn new(slots: &[BodySlot<S>]) -> Self {
        let island = |slot: &BodySlot<S>| {
            let history = slot.solver.new_history();
            Island { bodies: 0, pairs: Pairs::default(), history }
        };
        Self { list: slots.iter().map(island).collect(), count: 0, sizes: vec![0; slots.len()] }
    }

    /// Sorts the bodies into islands by what may touch in the frame: island by island, the largest
    /// first.
    pub fn build(&mut self, slots: &mut [BodySlot<S>], coupling: Option<&Coupling>) {
        let Self { list, count, sizes } = self;
        sizes.fill(0);
        for slot in slots.iter_mut() {
            slot.island = coupling.map_or(slot.index, |coupling| coupling.island(slot.index));
            sizes[slot.island] += slot.body.tets.len();
        }
        slots.sort_unstable_by_key(|slot| (Reverse(sizes[slot.island]), slot.island, slot.index));
        *count = 0;
        for (island, bodies) in list.iter_mut().zip(slots.chunk_by(|a, b| a.island == b.island)) {
            island.bodies = bodies.len();
            *count += 1;
        }
    }

    /// Calls `solve` with every island and its slots, on the threads of a pool if there is one: a
    /// free thread takes the next island.
    pub fn for_each(
        &mut self,
        slots: &mut [BodySlot<S>],
        pool: Option<&rayon::ThreadPool>,
        solve: impl Fn(&mut Island<S>, &mut [BodySlot<S>]) + Sync,
    ) {
        let islands = &mut self.list[..self.count];
        match pool {
            Some(pool) => pool.install(|| in_parallel(islands, slots, &solve)),
            None => in_order(islands, slots, &solve),
        }
    }

    /// Calls `visit(body, vertex, force)` for every contact force (N) on a vertex at the end of the
    /// last frame; `x` is where a body's vertex is.
    pub fn for_contact_forces(
        &self,
        slots: &[BodySlot<S>],
        x: impl Fn(usize, u32) -> glam::Vec3A,
        visit: &mut dyn FnMut(usize, u32, DVec3),
    ) {
        let mut rest = slots;
        for island in &self.list[..self.count] {
            let (slots, next) = rest.split_at(island.bodies);
            island.for_contact_forces(slots, &x, visit);
            rest = next;
        }
    }
}

impl<S: Solver> Island<S> {
    fn for_contact_forces(
        &self,
        slots: &[BodySlot<S>],
        x: &impl Fn(usize, u32) -> glam::Vec3A,
        visit: &mut dyn FnMut(usize, u32, DVec3),
    ) {
        let x = |m: usize, vertex: u32| x(slots[m].index, vertex);
        for (m, slot) in slots.iter().enumerate() {
            let contacts = slot.solver.contacts().map_or(&[][..], ContactSet::list);
            for contact in contacts.iter().filter(|contact| matches!(contact.source, Source::Collider(_))) {
                if let Some(push) = contact.push(contact.site.at(|vertex| x(m, vertex))) {
                    for (vertex, share) in contact.site.shares() {
                        slot.body.for_nodes(vertex, share, |node, share| {
                            visit(slot.index, node, (-share * push.gradient).as_dvec3());
                        });
                    }
                }
            }
        }
        for pair in self.pairs.list() {
            if let Some(push) = pair.contact.push(pair.offset(x)) {
                for (m, vertex, share) in pair.shares() {
                    slots[m].body.for_nodes(vertex, share, |node, share| {
                        visit(slots[m].index, node, (-share * push.gradient).as_dvec3());
                    });
                }
            }
        }
    }
}

/// Adds the forces of other bodies on rigidly held nodes to the tools that hold them.
pub(crate) fn press_tools<S: Solver>(slots: &mut [BodySlot<S>], pairs: &Pairs, frame: &Frame<'_>) {
    for pair in pairs.list() {
        if let Some(push) = pair.contact.push(pair.offset(|m, vertex| slots.x(m, vertex))) {
            for (m, vertex, share) in pair.shares() {
                let BodySlot { body, state, reaction, .. } = &mut slots[m];
                body.for_nodes(vertex, share, |node, share| {
                    let force = (-share * push.gradient).as_dvec3();
                    reaction.press(frame, body, state, node as usize, force);
                });
            }
        }
    }
}

fn in_order<S: Solver>(
    islands: &mut [Island<S>],
    mut slots: &mut [BodySlot<S>],
    solve: &impl Fn(&mut Island<S>, &mut [BodySlot<S>]),
) {
    for island in islands {
        let (own, rest) = std::mem::take(&mut slots).split_at_mut(island.bodies);
        solve(island, own);
        slots = rest;
    }
}

fn in_parallel<S: Solver>(
    islands: &mut [Island<S>],
    slots: &mut [BodySlot<S>],
    solve: &(impl Fn(&mut Island<S>, &mut [BodySlot<S>]) + Sync),
) {
    let Some((island, others)) = islands.split_first_mut() else { return };
    let (own, rest) = slots.split_at_mut(island.bodies);
    if others.is_empty() {
        solve(island, own);
    } else {
        rayon::join(|| solve(island, own), || in_parallel(others, rest, solve));
    }
}
