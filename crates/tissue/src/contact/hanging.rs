//! Nodes that hang compliantly on tools.

use super::contacts::Contacts;
use super::touch::{Friction, Source, Touch};
use crate::Body;
use crate::integrator::Frame;
use glam::Vec3A;

/// A node that hangs compliantly on a tool.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hanging {
    pub vertex: u32,
    /// The grasp among all, and the node's place in it.
    pub grasp: u32,
    pub node: u32,
    /// How far it has slipped, in the tool's frame [m].
    pub slid: Vec3A,
    /// Whether it slipped in the last substep.
    pub slides: bool,
    /// Pull at the tool after the last substep [N].
    pub pull: Vec3A,
}

impl Hanging {
    /// The touch of a node where its tool is when `share` of the frame is over.
    pub(super) fn touch(&self, frame: &Frame<'_>, body: &Body, share: f64) -> Option<Touch> {
        let grasp = &frame.grasps[self.grasp as usize];
        let (compliance, tool) = (grasp.compliance?, frame.tools.get(grasp.tool)?);
        let pose = tool.at(share);
        let (_, captured) = grasp.prescribed_node(&pose, self.node as usize);
        let place = (captured - body.origin).as_vec3a() + (pose.rotation * self.slid.as_dvec3()).as_vec3a();
        Some(Touch {
            vertex: self.vertex,
            source: Source::Grasp(self.grasp, self.node),
            normal: (pose.rotation * compliance.closing.normalize_or_zero()).as_vec3a(),
            point: place,
            place,
            stiffness: compliance.stiffness as f32,
            friction: Friction::Clamped(
                (2.0 * compliance.friction * compliance.jaw_force / grasp.nodes.len() as f64) as f32,
            ),
        })
    }
}

impl Contacts {
    /// Finds the nodes that hang on tools. A node in several grasps follows the last.
    pub(super) fn hang(&mut self, frame: &Frame<'_>, body: &Body) {
        self.hanging.clear();
        for (g, grasp) in frame
            .grasps
            .iter()
            .enumerate()
            .filter(|(_, g)| g.body == frame.index && g.hangs() && g.tool < frame.tools.len())
        {
            for (k, (node, slid)) in grasp.nodes.iter().zip(&grasp.slid).enumerate() {
                let vertex = body.internal[*node as usize];
                if !self.fixed[vertex as usize] {
                    let (grasp, node) = (g as u32, k as u32);
                    let hanging = Hanging { vertex, grasp, node, slid: *slid, slides: false, pull: Vec3A::ZERO };
                    self.hanging.push(hanging);
                }
            }
        }
        self.hanging.sort_unstable_by_key(|h| (h.vertex, std::cmp::Reverse(h.grasp), h.node));
        self.hanging.dedup_by_key(|h| h.vertex);
    }
}
