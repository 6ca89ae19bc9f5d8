//! Contacts that depend on several vertices, as contacts of each vertex alone: for the sweeps.

use super::ContactSet;
use crate::Body;
use crate::contact::contact::Contact;
use crate::contact::site::add_share;
use glam::Vec3A;

/// Vertices with a smaller share of a contact do not bear it in sweeps, which divide by it.
const MIN_SHARE: f32 = 1e-6;

impl ContactSet {
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
}
