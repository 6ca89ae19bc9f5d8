//! The threads of a body in its own frame and in single precision, as contacts.

use super::contact::{Contact, Friction};
use super::site::Site;
use crate::Body;
use crate::state::Source;
use glam::Vec3A;

/// A thread of a body.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LocalTether {
    pub vertex: u32,
    /// Its number among the body's.
    number: u32,
    anchor: Vec3A,
    length: f32,
    pub stiffness: f32,
}

impl LocalTether {
    /// The threads of a body, by vertex.
    pub fn of(body: &Body) -> Vec<Self> {
        let local = |(number, tether): (usize, &crate::Tether)| Self {
            vertex: body.internal[tether.node as usize],
            number: number as u32,
            anchor: (tether.anchor - body.origin).as_vec3a(),
            length: tether.length as f32,
            stiffness: tether.stiffness as f32,
        };
        let mut all: Vec<Self> = body.tethers.iter().enumerate().map(local).collect();
        all.sort_unstable_by_key(|tether| (tether.vertex, tether.number));
        all
    }

    /// The thread as a plane behind which its node is pulled back, with the node at `x`. None where
    /// the thread is slack by more than `reach` (m).
    pub fn contact(&self, x: Vec3A, reach: f32) -> Option<Contact> {
        let way = x - self.anchor;
        let distance = way.length();
        if distance <= 0.0 || distance < self.length - reach {
            return None;
        }
        let out = way / distance;
        Some(Contact {
            site: Site::vertex(self.vertex),
            source: Source::Tether(self.number),
            normal: -out,
            point: self.anchor + self.length * out,
            place: x,
            stiffness: self.stiffness,
            hard_from: f32::INFINITY,
            friction: Friction::Coulomb(0.0),
        })
    }
}
