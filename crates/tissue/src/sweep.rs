//! One sweep of Vertex Block Descent over a body.
//!
//! Chen, Liu, Yang and Yuksel, "Vertex block descent", SIGGRAPH 2024. Each vertex takes a Newton step on its own 3x3 block of
//! 1/(2h^2) |x - y|_M^2 + E(x) with all others held. Vertices of one colour share no element, so they do not see each other's steps: they may be taken in any order
//! and by any thread with the same bits. Along one vertex's step the volume of each of its elements is linear: the step is cut so that none
//! falls below a floor, and no element is ever inverted.

use crate::body::Body;
use crate::kernel::{Kernel, Local, Seen, VertexElasticity, volume_gradient};
use glam::{Mat3A, Vec3A};
use rayon::prelude::*;

/// Vertices a task; a colour of fewer than two tasks is swept by one thread.
const CHUNK: usize = 192;

/// A step leaves an element at least this share of the volume it has ...
const KEPT_SHARE: f32 = 0.1;
/// ... and at least this share of its rest volume, unless it has less already: then its volume does not fall.
const FLOOR: f32 = 1e-3;

/// Speed below which friction sticks [m/s].
const STICK_SPEED: f32 = 1e-3;

/// Corners whose volume gradients are remembered between the force and the guard.
const REMEMBERED: usize = 64;

/// A support plane in a body's frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LocalPlane {
    pub point: Vec3A,
    pub normal: Vec3A,
    pub friction: f32,
}

impl LocalPlane {
    /// Height of a point above the plane [m].
    pub fn height(&self, x: Vec3A) -> f32 {
        (x - self.point).dot(self.normal)
    }
}

/// What is constant while a body's substep is swept.
pub(crate) struct Substep<'a> {
    pub body: &'a Body,
    /// Step [s].
    pub h: f32,
    /// Positions at the substep's beginning [m].
    pub start: &'a [Vec3A],
    /// Inertial predictor y [m].
    pub predictor: &'a [Vec3A],
    /// Pinned or held vertices.
    pub fixed: &'a [bool],
    pub planes: &'a [LocalPlane],
}

impl Substep<'_> {
    /// Sweeps over all colours once; `moved` is scratch.
    pub fn sweep(&self, x: &mut [Vec3A], moved: &mut [Vec3A]) {
        match Kernel::of(self.body) {
            Kernel::StableNeoHookean(term) => self.sweep_with(&term, x, moved),
            Kernel::StVenantKirchhoff(term) => self.sweep_with(&term, x, moved),
        }
    }

    fn sweep_with<E: VertexElasticity>(&self, elasticity: &E, x: &mut [Vec3A], moved: &mut [Vec3A]) {
        for color in self.body.color_start.windows(2) {
            let (first, end) = (color[0] as usize, color[1] as usize);
            if end - first < 2 * CHUNK {
                for i in first..end {
                    x[i] = self.relax(elasticity, i, x);
                }
            } else {
                let all = &*x;
                moved[first..end].par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, moved)| {
                    for (k, to) in moved.iter_mut().enumerate() {
                        *to = self.relax(elasticity, first + chunk * CHUNK + k, all);
                    }
                });
                x[first..end].copy_from_slice(&moved[first..end]);
            }
        }
    }

    /// Where vertex `i` goes: its Newton step, cut by the inversion guard.
    #[inline(always)]
    fn relax<E: VertexElasticity>(&self, elasticity: &E, i: usize, x: &[Vec3A]) -> Vec3A {
        let here = x[i];
        if self.fixed[i] {
            return here;
        }
        let mut local = self.inertia(i, here);
        self.add_edges(i, here, x, &mut local);
        self.add_supports(i, here, &mut local);
        let mut remembered = [(Vec3A::ZERO, 0.0f32); REMEMBERED];
        let corners = self.body.corners_of(i);
        for k in corners.clone() {
            let seen = self.corner(k, here, x);
            if let Some(slot) = remembered.get_mut(k - corners.start) {
                *slot = (seen.gradient, seen.ratio);
            }
            elasticity.add(self.body, k, &seen, &mut local);
        }
        let step = solve(&local.block, local.force);
        let mut share = 1.0f32;
        for k in corners.clone() {
            let (gradient, ratio) = remembered.get(k - corners.start).copied().unwrap_or_else(|| {
                let seen = self.corner(k, here, x);
                (seen.gradient, seen.ratio)
            });
            share = share.min(allowed_share(ratio, gradient.dot(step)));
        }
        here + share * step
    }

    /// The vertex's element behind corner `k`.
    #[inline(always)]
    fn corner(&self, k: usize, here: Vec3A, x: &[Vec3A]) -> Seen {
        let corner = &self.body.corners[k];
        let others = corner.others.map(|j| x[j as usize]);
        let gradient = volume_gradient(corner, others);
        Seen { x: here, others, gradient, ratio: gradient.dot(here - others[0]) }
    }

    #[inline(always)]
    fn inertia(&self, i: usize, here: Vec3A) -> Local {
        let vertex = &self.body.vertices[i];
        let k = vertex.mass / (self.h * self.h);
        Local {
            force: (self.predictor[i] - here) * k,
            block: Mat3A::from_diagonal(glam::Vec3::splat(k + vertex.laplacian)),
        }
    }

    /// The constant Laplacian of the stable neo-Hookean energy, and the dashpots: force -(c/h) n n'(u_i - u_j) for displacements u since the
    /// substep's beginning and the edge's direction n then. They resist stretching of edges alone: rigid motion is free.
    #[inline(always)]
    fn add_edges(&self, i: usize, here: Vec3A, x: &[Vec3A], local: &mut Local) {
        let displacement = here - self.start[i];
        for edge in self.body.edges_of(i) {
            let j = edge.to as usize;
            local.force -= edge.laplacian * (x[j] - here);
            if edge.damping > 0.0 {
                let direction = self.start[j] - self.start[i];
                let k = edge.damping / (self.h * direction.length_squared());
                let stretching = direction.dot(displacement - (x[j] - self.start[j]));
                local.force -= k * stretching * direction;
                local.add_outer(k, direction);
            }
        }
    }

    /// One-sided quadratic penalty of the support planes, and Coulomb friction against the motion since the substep's beginning,
    /// regularised to stick below a small speed.
    #[inline(always)]
    fn add_supports(&self, i: usize, here: Vec3A, local: &mut Local) {
        for plane in self.planes {
            let height = plane.height(here);
            if height >= 0.0 {
                continue;
            }
            let stiffness = self.body.vertices[i].contact_stiffness;
            local.force -= stiffness * height * plane.normal;
            local.add_outer(stiffness, plane.normal);
            let motion = here - self.start[i];
            let slide = motion - motion.dot(plane.normal) * plane.normal;
            let (length, stick) = (slide.length(), STICK_SPEED * self.h);
            let most = -plane.friction * stiffness * height;
            let drag = if length < stick { most / stick * (2.0 - length / stick) } else { most / length };
            local.force -= drag * slide;
            local.add_isotropic(drag);
            local.add_outer(-drag, plane.normal);
        }
    }
}

/// The share of a step that leaves an element of volume ratio `ratio` enough volume, if the whole step changes the ratio by `change`.
#[inline(always)]
pub(crate) fn allowed_share(ratio: f32, change: f32) -> f32 {
    let floor = (KEPT_SHARE * ratio).max(FLOOR).min(ratio);
    if ratio + change >= floor { 1.0 } else { ((floor - ratio) / change).max(0.0) }
}

/// Whether an element of this volume ratio may not get any smaller.
pub(crate) fn is_squeezed(ratio: f32, before: f32) -> bool {
    ratio < (KEPT_SHARE * before).max(FLOOR).min(before)
}

/// Solves a symmetric positive definite 3x3 system.
#[inline(always)]
fn solve(block: &Mat3A, force: Vec3A) -> Vec3A {
    let [a, b, c] = [block.x_axis, block.y_axis, block.z_axis];
    let (bc, ca, ab) = (b.cross(c), c.cross(a), a.cross(b));
    // Symmetric: the columns of the cofactor matrix are its rows.
    let inverse_determinant = 1.0 / a.dot(bc);
    Vec3A::new(bc.dot(force), ca.dot(force), ab.dot(force)) * inverse_determinant
}
