//! The end of a substep: anchors follow what slips, and tools feel the forces.

use super::ContactSet;
use crate::Body;
use crate::contact::ToolForce;
use crate::frame::Frame;
use crate::state::{Anchor, Source};
use glam::Vec3A;
use trocar_core::Wrench;

impl ContactSet {
    /// Ends a substep with the vertices at `x`: anchors follow what slips, and tools feel the
    /// forces.
    pub fn end_substep(&mut self, frame: &Frame<'_>, body: &Body, share: f64, x: impl Fn(usize) -> Vec3A) {
        self.next_anchors.clear();
        self.forces.fill(ToolForce::default());
        let (mut hanging, mut counted) = (0, None);
        for (contact, place) in self.contacts[..self.of_vertices].iter().zip(&self.places) {
            let here = contact.site.at(|vertex| x(vertex as usize));
            let push = contact.push(here);
            if let Source::Grasp(..) = contact.source {
                while self.compliant[hanging].vertex < contact.site.first() {
                    hanging += 1;
                }
                let held = &mut self.compliant[hanging];
                held.pull = push.map_or(Vec3A::ZERO, |push| push.gradient);
                let slide = contact.slide(here);
                held.slides = slide.is_some();
                if let (Some(slide), Some(tool)) = (slide, frame.tools.get(frame.grasps[held.grasp as usize].tool)) {
                    let back = tool.at(share).rotation.inverse();
                    held.slid += (back * slide.as_dvec3()).as_vec3a();
                }
                continue;
            }
            let Some(push) = push else { continue };
            if let Source::Tether(_) = contact.source {
                continue;
            }
            // A vertex that sticks keeps its anchor to the bit.
            let place = match (contact.slide(here), contact.source) {
                (None, _) => *place,
                (Some(by), Source::Collider(c)) => match &self.placed[c as usize] {
                    Some(placed) => {
                        let moved = (contact.place + by).as_dvec3() + body.origin;
                        placed.to.inverse().transform(moved).as_vec3a()
                    }
                    None => *place,
                },
                (Some(by), _) => *place + by,
            };
            self.next_anchors.push(Anchor { vertex: contact.site.first(), source: contact.source, place });
            if let Source::Collider(c) = contact.source {
                let tool = frame.colliders[c as usize].tool;
                if let (Some(force), Some(Some(placed))) = (self.forces.get_mut(tool), self.placed.get(c as usize)) {
                    let arm = body.origin + here.as_dvec3() - placed.to.translation;
                    force.contact += Wrench::at(push.gradient.as_dvec3(), arm);
                    force.pressing += f64::from(contact.pressure(-contact.height(here)));
                    force.touching += usize::from(counted != Some((contact.site.first(), tool)));
                    counted = Some((contact.site.first(), tool));
                }
            }
        }
        std::mem::swap(&mut self.anchors, &mut self.next_anchors);
        let contacts = &self.contacts[self.of_vertices..];
        self.features.end_substep(frame, body, &self.placed, contacts, &x, &mut self.forces);
        for held in &self.compliant {
            let grasp = &frame.grasps[held.grasp as usize];
            if let (Some(force), Some(tool)) = (self.forces.get_mut(grasp.tool), frame.tools.get(grasp.tool)) {
                let arm = body.origin + x(held.vertex as usize).as_dvec3() - tool.at(share).translation;
                force.constraint += Wrench::at(held.pull.as_dvec3(), arm);
            }
        }
    }
}
