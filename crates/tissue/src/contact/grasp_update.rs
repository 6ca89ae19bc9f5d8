//! The stage after the solve: slip and tearing of grasps, from their nodes in the last substep.

use super::{CompliantNode, Event};
use crate::Grasp;
use glam::DVec3;

impl Grasp {
    /// Finds whether it slips or tears, from its nodes (`held`); appends the beginnings to
    /// `events`.
    pub(crate) fn update<'a>(&mut self, held: impl Iterator<Item = &'a CompliantNode>, events: &mut Vec<Event>) {
        let Some(compliance) = self.compliance.filter(|_| !self.torn) else { return };
        let (mut sliding, mut nodes, mut pull) = (0, 0, DVec3::ZERO);
        for node in held {
            sliding += usize::from(node.slides);
            nodes += 1;
            pull += node.pull.as_dvec3();
        }
        let (tool, body, force) = (self.tool, self.body, pull.length());
        let slips = 2 * sliding > nodes;
        if slips && !self.slips {
            events.push(Event::Slipped { tool, body });
        }
        self.slips = slips;
        if force > compliance.tear_force {
            (self.torn, self.slips) = (true, false);
            events.push(Event::Torn { tool, body, force });
        }
    }
}
