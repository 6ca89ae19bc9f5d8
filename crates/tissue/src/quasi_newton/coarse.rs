//! The coarse half of the preconditioner: bodies that nothing holds, moved as a whole.
//!
//! The matrix of a body does not contain its contacts with other bodies. Where tissue deforms, such
//! contacts are no stiffer than the tissue, which is harmless. But a free body as a whole would
//! move as if nothing touched it, too far by orders of magnitude. So its six rigid motions are
//! removed from the factor's problem and get their own matrix, with the body's inertia and all
//! present contacts: a two-level preconditioner (Toselli and Widlund 2005, "Domain decomposition
//! methods", chapter 3).

use super::body_system::QuasiNewtonSolver;
use super::island_system::IslandSystem;
use super::iterate::{Iterate, add, position};
use super::rigid_modes::RigidModes;
use crate::body_slot::BodySlot;

impl QuasiNewtonSolver {
    /// Takes the rigid part out of the direction, which is still a force.
    pub fn remove_rigid_modes(&mut self) {
        let Self { rigid: Some(rigid), iterate: Iterate { x, direction, .. }, layout, .. } = self else { return };
        let nodes = x.iter().map(position).zip(direction[..layout.free].iter().map(position));
        rigid.force = rigid.sum(nodes);
        let accelerated = rigid.acceleration();
        for ((x, d), mass) in x.iter().zip(direction).zip(&layout.masses) {
            add(d, -*mass * accelerated(position(x)));
        }
    }

    /// Takes the rigid part out of the direction, now a motion, and adds the one that the coarse
    /// half makes of the force.
    pub fn add_rigid_modes(&mut self) {
        let Self { rigid: Some(rigid), iterate: Iterate { x, direction, .. }, layout, .. } = self else { return };
        let ways = direction[..layout.free].iter().map(position).zip(&layout.masses).map(|(d, mass)| *mass * d);
        let by = rigid.correction(rigid.sum(x.iter().map(position).zip(ways)));
        for (x, d) in x[..layout.free].iter().zip(direction) {
            add(d, by(position(x)));
        }
    }
}

impl IslandSystem<'_> {
    /// Assembles the coarse half for the present bodies and contacts. Single bodies do not need it:
    /// the history is enough for them.
    pub fn assemble_rigid_modes(&mut self) {
        let h = self.h;
        let coupled = !self.pairs.is_empty();
        for body in self.all() {
            let free = coupled && body.sleep.active && body.is_free();
            body.rigid = free.then(|| RigidModes::new(&body.layout, &body.iterate.x, h));
        }
        let Self { slots, pairs, .. } = self;
        for BodySlot { solver, .. } in slots.iter_mut() {
            let Some(mut rigid) = solver.rigid else { continue };
            for (contact, limit) in solver.touching.contacts.list().iter().zip(&solver.touching.limits) {
                if let Some(push) = contact.push_within(contact.site.at(|vertex| solver.at(vertex)), *limit) {
                    let arms = contact.site.shares().map(|(vertex, share)| (solver.at(vertex), share));
                    rigid.add(&push, contact.normal, arms);
                }
            }
            solver.rigid = Some(rigid);
        }
        for pair in pairs.list() {
            let offset = pair.offset(|m, vertex| slots[m].solver.at(vertex));
            let Some(push) = pair.push(offset) else { continue };
            let both = [pair.member, pair.other];
            for m in &both[..if pair.member == pair.other { 1 } else { 2 }] {
                let Some(mut rigid) = slots[*m].solver.rigid else { continue };
                let own = pair.shares().into_iter().filter(|(of, ..)| of == m);
                let arms = own.map(|(_, vertex, share)| (slots[*m].solver.at(vertex), share));
                rigid.add(&push, pair.contact.normal, arms);
                slots[*m].solver.rigid = Some(rigid);
            }
        }
        for body in self.active() {
            body.rigid = body.rigid.take().and_then(|mut rigid| rigid.factorise().then_some(rigid));
        }
    }
}
