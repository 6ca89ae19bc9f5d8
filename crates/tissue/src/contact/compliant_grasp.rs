//! Nodes that hang compliantly on tools.

use super::contact::{Contact, Friction};
use super::site::Site;
use crate::frame::Frame;
use crate::state::Source;
use crate::{Body, Grasp};
use glam::Vec3A;

/// A node that hangs compliantly on a tool.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CompliantNode {
    pub vertex: u32,
    /// Number of the grasp among all, and of the node in it.
    pub grasp: u32,
    pub node: u32,
    /// How far it has slipped, in the tool's frame (m).
    pub slid: Vec3A,
    /// Whether it slipped in the last substep.
    pub slides: bool,
    /// Pull at the tool after the last substep (N).
    pub pull: Vec3A,
}

impl CompliantNode {
    /// Contact of the node with its tool, where the tool is when `share` of the frame is over.
    pub(super) fn contact(&self, frame: &Frame<'_>, body: &Body, share: f64) -> Option<Contact> {
        let grasp = &frame.grasps[self.grasp as usize];
        let (compliance, tool) = (grasp.compliance?, frame.tools.get(grasp.tool)?);
        let pose = tool.at(share);
        let (_, captured) = grasp.prescribed_node(&pose, self.node as usize);
        let place = (captured - body.origin).as_vec3a() + (pose.rotation * self.slid.as_dvec3()).as_vec3a();
        Some(Contact {
            site: Site::vertex(self.vertex),
            source: Source::Grasp(self.grasp, self.node),
            normal: (pose.rotation * compliance.closing.normalize_or_zero()).as_vec3a(),
            point: place,
            place,
            stiffness: compliance.stiffness as f32,
            hard_from: f32::INFINITY,
            friction: Friction::Clamped(
                (2.0 * compliance.friction * compliance.jaw_force / grasp.nodes.len() as f64) as f32,
            ),
        })
    }
}

/// Finds the nodes of the body that hang on tools and are not `fixed`. A node in several grasps
/// follows the last.
pub(super) fn find(frame: &Frame<'_>, body: &Body, fixed: &[bool], nodes: &mut Vec<CompliantNode>) {
    nodes.clear();
    let counts = |grasp: &Grasp| grasp.body == frame.index && grasp.is_compliant() && grasp.tool < frame.tools.len();
    for (g, grasp) in frame.grasps.iter().enumerate().filter(|(_, grasp)| counts(grasp)) {
        for (k, (node, slid)) in grasp.nodes.iter().zip(&grasp.slid).enumerate() {
            let vertex = body.internal[*node as usize];
            if !fixed[vertex as usize] {
                let (grasp, node) = (g as u32, k as u32);
                nodes.push(CompliantNode { vertex, grasp, node, slid: *slid, slides: false, pull: Vec3A::ZERO });
            }
        }
    }
    nodes.sort_unstable_by_key(|h| (h.vertex, std::cmp::Reverse(h.grasp), h.node));
    nodes.dedup_by_key(|h| h.vertex);
}
