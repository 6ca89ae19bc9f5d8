//! How the force of a body on tools changes when the tools move over the next frame.
//!
//! Nodes hang on tools by springs: contacts and compliant grasps. Let B be the stiffness of the
//! springs, G the motion of their other ends with the tools, and H the matrix of the body in a
//! substep, which contains B. If the tools move by t, the nodes follow by u, and the force on the
//! tools changes by -K t = -G' B (G t - u). In one substep H u = B G t: static condensation (Guyan 1965, "Reduction of stiffness and mass matrices")
//! of a matrix with masses and dashpots. Over the substeps of a frame, implicit Euler adds what
//! masses M and dashpots D remember: H u = B G t + M (2 u' - u'') / h^2 + D u' / h, with u' and u''
//! after the two substeps before.

use super::QuasiNewtonSolver;
use super::iterate::{add, position};
use crate::Body;
use crate::contact::{Contact, Push, ToolGroup};
use crate::lanes::Row;
use glam::{Mat3A, Vec3A};

/// A node on a spring whose other end moves with the tools.
struct Spring {
    /// The free node.
    node: usize,
    /// (N/m)
    stiffness: Mat3A,
    /// The same in its stiffest direction (N/m).
    most: f32,
    /// The node from the point about which the tools turn (m).
    arm: Vec3A,
}

impl Spring {
    /// Motion of the end at the tools, when the tools move along a unit of `axis`: three
    /// translations, three rotations about the group's point.
    fn end_motion(&self, axis: usize) -> Vec3A {
        let unit = Vec3A::AXES[axis % 3];
        if axis < 3 { unit } else { unit.cross(self.arm) }
    }
}

impl QuasiNewtonSolver {
    /// Adds the stiffness of `body` against the tools of `group`: rows are force (N) and torque
    /// (N m), columns are translation (m) and rotation (rad).
    pub(super) fn add_stiffness(&mut self, body: &Body, group: &ToolGroup<'_>, sum: &mut [[f64; 6]; 6]) {
        let springs = self.springs(body, group);
        if springs.is_empty() {
            return;
        }
        let (mut now, mut before) = (vec![[0.0; 4]; self.layout.rows], vec![[0.0; 4]; self.layout.rows]);
        let substeps = self.settings.substeps;
        let h = (group.dt / substeps as f64) as f32;
        for column in 0..6 {
            now.fill([0.0; 4]);
            before.fill([0.0; 4]);
            for substep in 1..=substeps {
                self.remember(body, h, &now, &mut before);
                let share = substep as f32 / substeps as f32;
                for spring in &springs {
                    add(&mut before[spring.node], spring.stiffness * (share * spring.end_motion(column)));
                }
                self.system.apply(self.level, &mut before);
                std::mem::swap(&mut now, &mut before);
            }
            for spring in &springs {
                let force = spring.stiffness * (spring.end_motion(column) - position(&now[spring.node]));
                let torque = spring.arm.cross(force);
                for c in 0..3 {
                    sum[c][column] += f64::from(force[c]);
                    sum[3 + c][column] += f64::from(torque[c]);
                }
            }
        }
    }

    /// Replaces the motion `before` the last substep by the forces with which masses and dashpots
    /// continue the motion `now` in the next (N).
    fn remember(&self, body: &Body, h: f32, now: &[Row], before: &mut [Row]) {
        let (free, number) = (self.layout.free, &self.layout.number);
        for i in 0..free {
            let weight = self.layout.masses[i] / (h * h);
            (0..3).for_each(|c| before[i][c] = weight * (2.0 * now[i][c] - before[i][c]));
        }
        before[free..].fill([0.0; 4]);
        // Every edge appears at both its ends.
        for (vertex, i) in number.iter().enumerate().map(|(vertex, i)| (vertex, *i as usize)).filter(|(_, i)| *i < free)
        {
            for edge in body.edges_of(vertex).iter().filter(|edge| edge.damping > 0.0) {
                let other = number[edge.to as usize] as usize;
                let along = (self.at(edge.to) - self.at(vertex as u32)).normalize_or_zero();
                let to = if other < free { position(&now[other]) } else { Vec3A::ZERO };
                let rate = (position(&now[i]) - to).dot(along) / h;
                add(&mut before[i], edge.damping * rate * along);
            }
        }
    }

    /// The springs between free nodes of the body and the tools.
    fn springs(&self, body: &Body, group: &ToolGroup<'_>) -> Vec<Spring> {
        let about = (group.about - body.origin).as_vec3a();
        let mut springs: Vec<Spring> = Vec::new();
        for contact in self.touching.contacts.list().iter().filter(|contact| group.moves(contact.source)) {
            let Some(node) = self.free_node(contact.vertex) else { continue };
            let x = position(&self.iterate.x[node]);
            if let Some(push) = tangent(contact, x) {
                let stiffness = push.block(contact.normal);
                springs.push(Spring { node, stiffness, most: push.along.max(push.across), arm: x - about });
            }
        }
        // A contact that is not in the matrix, or several of one node, would make K indefinite.
        for range in springs.chunk_by_mut(|a, b| a.node == b.node) {
            let all: f32 = range.iter().map(|spring| spring.most).sum();
            let share = (self.system.spring(range[0].node) / all).clamp(0.0, 1.0);
            range.iter_mut().for_each(|spring| spring.stiffness *= share);
        }
        springs
    }
}

/// A contact's force at `x` with its derivative: what slips has none along the surface. None where
/// no force acts.
fn tangent(contact: &Contact, x: Vec3A) -> Option<Push> {
    let push = contact.push(x)?;
    let across = if contact.slide(x).is_some() { 0.0 } else { push.across };
    Some(Push { across, ..push })
}
