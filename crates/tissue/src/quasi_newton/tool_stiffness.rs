//! How the force of a body on tools changes when the tools move over the next frame.
//!
//! Nodes hang on tools by springs: contacts and compliant grasps. Let B be the stiffness of the
//! springs, G the motion of their other ends with the tools, and A the matrix of the body in a
//! substep, with the springs. If the tools move by t, the nodes follow by u, and the force on the
//! tools changes by -K t = -G' B (G t - u). In one substep A u = B G t: static condensation (Guyan
//! 1965, "Reduction of stiffness and mass matrices") of a matrix with masses and dashpots. Over the
//! substeps of a frame, implicit Euler adds what masses M and dashpots D remember:
//! A u = B G t + M (2 u' - u'') / h^2 + D u' / h, with u' and u'' after the two substeps before.
//!
//! The body's factor solves for the lag of the nodes behind the tools, u - G t: it is what
//! stretches the springs, and small. The factor has springs alike in all directions. A sliding
//! contact has none along the surface. Conjugate gradients account for the difference. The factor
//! is that of the stiffness at rest, here turned as a whole: turned node by node, as the search has
//! it, it would resist translations of tissue that is bent.

use super::QuasiNewtonSolver;
use super::iterate::{add, position};
use crate::Body;
use crate::contact::{Contact, Push, ToolGroup};
use crate::lanes::Row;
use crate::state::Source;
use glam::{Mat3A, Vec3, Vec3A};

/// Conjugate gradients end when their error has fallen by this factor, or after so many steps.
const TOLERANCE: f64 = 1e-3;
const MAX_STEPS: usize = 20;

/// A node on a spring whose other end moves with the tools.
struct Spring {
    /// The free node.
    node: usize,
    /// (N/m)
    stiffness: Mat3A,
    /// Stiffness towards what stands still (N/m).
    still: Mat3A,
    /// What the preconditioner has beyond both (N/m).
    excess: Mat3A,
    /// The node from the point about which the tools turn (m).
    arm: Vec3A,
}

impl Spring {
    /// Whether it is at a tool.
    fn moves(&self) -> bool {
        self.stiffness != Mat3A::ZERO
    }

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
        // Elements are as stiff as at rest.
        self.system.forget_stiffened();
        // A body at rest has not needed the contacts that are not in the factor.
        let Self { level, system, layout, touching, held, iterate, .. } = self;
        system.update_contacts_alike(*level, layout, &touching.contacts, held, &iterate.x);
        let springs = self.springs(body, group);
        if !springs.iter().any(Spring::moves) {
            return;
        }
        let still = || vec![[0.0; 4]; self.layout.rows];
        let (mut now, mut before, mut carried, mut lag) = (still(), still(), still(), still());
        let substeps = self.settings.substeps;
        let h = (group.dt / substeps as f64) as f32;
        let turn = self.system.mean_rotation(self.level, &self.layout, &mut lag);
        for column in 0..6 {
            now.fill([0.0; 4]);
            before.fill([0.0; 4]);
            for substep in 1..=substeps {
                let share = substep as f32 / substeps as f32;
                carried.fill([0.0; 4]);
                self.continued(body, &turn, h, [&now, &before], &mut lag);
                for spring in springs.iter().filter(|spring| spring.moves()) {
                    carried[spring.node] = row(share * spring.end_motion(column));
                    add(&mut lag[spring.node], -(share * (spring.still * spring.end_motion(column))));
                }
                self.system.subtract_product(&turn, &carried, &mut lag);
                self.solve(&turn, &springs, &mut lag);
                std::mem::swap(&mut before, &mut now);
                for (now, (carried, lag)) in now.iter_mut().zip(carried.iter().zip(&lag)) {
                    (0..3).for_each(|c| now[c] = carried[c] + lag[c]);
                }
            }
            for spring in &springs {
                let force = -(spring.stiffness * position(&lag[spring.node]));
                let torque = spring.arm.cross(force);
                for c in 0..3 {
                    sum[c][column] += f64::from(force[c]);
                    sum[3 + c][column] += f64::from(torque[c]);
                }
            }
        }
    }

    /// The forces with which masses and dashpots continue a motion in the next substep (N): the
    /// motion now, and before the last substep (m).
    fn continued(&self, body: &Body, turn: &Mat3A, h: f32, [now, before]: [&[Row]; 2], forces: &mut [Row]) {
        let (free, number) = (self.layout.free, &self.layout.number);
        forces.fill([0.0; 4]);
        for i in 0..free {
            let weight = self.layout.masses[i] / (h * h);
            (0..3).for_each(|c| forces[i][c] = weight * (2.0 * now[i][c] - before[i][c]));
        }
        let nodes = body.nodes_of_vertices();
        // Every edge appears at both its ends.
        for (vertex, i) in number.iter().enumerate().map(|(vertex, i)| (vertex, *i as usize)).filter(|(_, i)| *i < free)
        {
            for edge in body.edges_of(vertex).iter().filter(|edge| edge.damping > 0.0) {
                let other = number[edge.to as usize] as usize;
                let [from, to] = [vertex, edge.to as usize].map(|v| body.rest.vertices[nodes[v]]);
                let along = *turn * (to - from).normalize_or_zero().as_vec3a();
                let to = if other < free { position(&now[other]) } else { Vec3A::ZERO };
                let rate = (position(&now[i]) - to).dot(along) / h;
                add(&mut forces[i], edge.damping * rate * along);
            }
        }
    }

    /// The springs at free nodes of the body, one a node: between them and the tools, and those of
    /// the preconditioner between them and what stands still.
    fn springs(&self, body: &Body, group: &ToolGroup<'_>) -> Vec<Spring> {
        let about = (group.about - body.origin).as_vec3a();
        let contacts = self.touching.contacts.list();
        // Tissue in jaws does not slip along the blades: the grasp holds it.
        let held = contacts.iter().any(|c| matches!(c.source, Source::Grasp(..)) && group.moves(c.source));
        let mut springs: Vec<Spring> = Vec::new();
        let mut touched: Vec<(u32, f32, &Contact)> = Vec::with_capacity(contacts.len());
        for contact in contacts {
            for (vertex, share) in contact.site.shares() {
                // A spring at a node pulls with none of the weights below 0.
                let spread = self.layout.spread(vertex).unwrap_or(1.0);
                body.for_nodes(vertex, share, |node, share| touched.push((node, share.abs() / spread, contact)));
            }
        }
        // Those between nodes come last in the list.
        touched.sort_by_key(|(vertex, ..)| *vertex);
        let mut of_node = touched.chunk_by(|a, b| a.0 == b.0).peekable();
        for vertex in 0..body.len() {
            let touched = of_node.next_if(|contacts| contacts[0].0 as usize == vertex).unwrap_or_default();
            let Some(node) = self.free_node(vertex as u32) else { continue };
            let most = self.system.spring(node);
            if most <= 0.0 {
                continue;
            }
            let x = position(&self.iterate.x[node]);
            let (mut moving, mut still, mut largest) = (Mat3A::ZERO, Mat3A::ZERO, 0.0);
            for (_, share, contact) in touched {
                let Some(push) = tangent(contact, contact.site.at(|vertex| self.at(vertex))) else { continue };
                let sum = if group.moves(contact.source) { &mut moving } else { &mut still };
                *sum += push.block(contact.normal) * *share;
                largest += share * push.along.max(push.across);
            }
            let all = Mat3A::from_diagonal(Vec3::splat(most));
            // What is not in the matrix cannot count.
            let share = if largest > most { most / largest } else { 1.0 };
            let (stiffness, still) = match held && moving != Mat3A::ZERO {
                true => (all, Mat3A::ZERO),
                false => (share * moving, share * still),
            };
            springs.push(Spring { node, stiffness, still, excess: all - stiffness - still, arm: x - about });
        }
        springs
    }

    /// Solves for the motion (m) under the forces `x` (N) in place.
    fn solve(&mut self, turn: &Mat3A, springs: &[Spring], x: &mut [Row]) {
        let mut residual = x.to_vec();
        let mut direction = residual.clone();
        self.system.apply_turned(self.level, turn, &mut direction);
        // The preconditioner's matrix times the direction.
        let mut product = residual.clone();
        let mut error = dot(&residual, &direction);
        let (first, mut z) = (error, direction.clone());
        x.fill([0.0; 4]);
        for _ in 0..MAX_STEPS {
            let mut image = product.clone();
            for Spring { node, excess, .. } in springs {
                add(&mut image[*node], -(*excess * position(&direction[*node])));
            }
            let slope = dot(&direction, &image);
            if !(slope > 0.0 && error > TOLERANCE * TOLERANCE * first) {
                break;
            }
            let step = (error / slope) as f32;
            add_scaled(x, step, &direction);
            add_scaled(&mut residual, -step, &image);
            z.copy_from_slice(&residual);
            self.system.apply_turned(self.level, turn, &mut z);
            let next = dot(&residual, &z);
            let turn = (next / error) as f32;
            for (old, new) in [(&mut direction, &z), (&mut product, &residual)] {
                old.as_flattened_mut().iter_mut().zip(new.as_flattened()).for_each(|(o, n)| *o = n + turn * *o);
            }
            error = next;
        }
    }
}

/// The force of a contact at `x`, and its stiffness when what it touches moves. A contact that
/// slips has no stiffness along the surface. None where no force acts.
fn tangent(contact: &Contact, x: Vec3A) -> Option<Push> {
    let push = contact.push(x)?;
    Some(Push { across: if contact.slide(x).is_some() { 0.0 } else { push.across }, ..push })
}

fn row(v: Vec3A) -> Row {
    [v.x, v.y, v.z, 0.0]
}

fn dot(a: &[Row], b: &[Row]) -> f64 {
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
}

fn add_scaled(sum: &mut [Row], by: f32, rows: &[Row]) {
    sum.as_flattened_mut().iter_mut().zip(rows.as_flattened()).for_each(|(sum, x)| *sum += by * x);
}
