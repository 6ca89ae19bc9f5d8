//! One vertex's step of Vertex Block Descent.
//!
//! Chen, Liu, Yang and Yuksel, "Vertex block descent", SIGGRAPH 2024. Each vertex takes a Newton
//! step on its own 3x3 block of 1/(2h^2) |x - y|_M^2 + E(x) with all others held. Along the step of
//! one vertex, the volume of each of its elements is linear. The step is cut before a volume falls
//! below a floor, and no element is ever inverted.

use super::kernel::{Local, Seen, VertexElasticity, volume_gradient};
use super::stretched::StretchedElements;
use crate::Isa;
use crate::body::Body;
use crate::contact::ContactSet;
use crate::inversion_guard::{MIN_SQUARED_LENGTH, allowed_share};
use glam::{Mat3A, Vec3A};

/// Greatest number of corners whose volume gradients are kept between the force and the guard.
const MAX_REMEMBERED_CORNERS: usize = 32;

/// The constants of a body's sweeps in a substep.
pub(crate) struct Substep<'a> {
    pub body: &'a Body,
    /// Step (s).
    pub h: f32,
    /// Positions at the substep's beginning (m).
    pub start: &'a [Vec3A],
    /// Inertial predictor y (m).
    pub predictor: &'a [Vec3A],
    /// Pinned or held vertices.
    pub fixed: &'a [bool],
    /// Contacts of its vertices.
    pub contacts: &'a ContactSet,
    /// Elements that may be stretched beyond the limit.
    pub stretched: &'a StretchedElements,
    /// Instructions to use; all give the same bits.
    pub isa: Isa,
    /// Whether the calling thread does all the work.
    pub single_thread: bool,
}

impl Substep<'_> {
    /// New position of vertex `i`: its Newton step, cut by the inversion guard.
    #[inline(always)]
    pub fn relax<E: VertexElasticity>(&self, elasticity: &E, i: usize, x: &[Vec3A]) -> Vec3A {
        let here = x[i];
        if self.fixed[i] {
            return here;
        }
        let mut remembered = [(Vec3A::ZERO, 0.0f32); MAX_REMEMBERED_CORNERS];
        let local = self.local(elasticity, i, x, &mut remembered);
        let step = solve(&local.block, local.force);
        let corners = self.body.corners_of(i);
        let first = corners.start;
        let mut share = 1.0f32;
        for k in corners {
            let (gradient, ratio) = remembered.get(k - first).copied().unwrap_or_else(|| {
                let seen = self.corner(k, here, x);
                (seen.gradient, seen.ratio)
            });
            share = share.min(allowed_share(ratio, gradient.dot(step)));
        }
        here + share * step
    }

    /// Force and block of vertex `i`; `remembered` takes the volume gradients and ratios of its
    /// first elements.
    #[inline(always)]
    fn local<E: VertexElasticity>(
        &self,
        elasticity: &E,
        i: usize,
        x: &[Vec3A],
        remembered: &mut [(Vec3A, f32)],
    ) -> Local {
        let here = x[i];
        let mut local = self.inertia(i, here);
        self.add_edges(i, here, x, &mut local);
        self.add_contacts(i, here, &mut local);
        self.stretched.add(i, x, &mut local);
        let corners = self.body.corners_of(i);
        let first = corners.start;
        for k in corners {
            let seen = self.corner(k, here, x);
            if let Some(slot) = remembered.get_mut(k - first) {
                *slot = (seen.gradient, seen.ratio);
            }
            elasticity.add(self.body, k, &seen, &mut local);
        }
        local
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

    /// Adds the constant Laplacian of the stable neo-Hookean energy, and the dashpots: energy c/(2
    /// h l^2) e^2 with the change e = (|d|^2 - l^2)/2 of an edge of length l at the substep's
    /// beginning. Rigid motions do not meet them, however large. The block leaves out their
    /// geometric stiffness.
    #[inline(always)]
    fn add_edges(&self, i: usize, here: Vec3A, x: &[Vec3A], local: &mut Local) {
        for edge in self.body.edges_of(i) {
            let j = edge.to as usize;
            local.force -= edge.laplacian * (x[j] - here);
            if edge.damping > 0.0 {
                let (now, before) =
                    (x[j] - here, (self.start[j] - self.start[i]).length_squared().max(MIN_SQUARED_LENGTH));
                let k = edge.damping / (self.h * before);
                local.force += 0.5 * k * (now.length_squared() - before) * now;
                local.add_outer(k, now);
            }
        }
    }

    /// Adds the contacts of the vertex ([`crate::contact::ContactSet`]).
    #[inline(always)]
    pub fn add_contacts(&self, i: usize, here: Vec3A, local: &mut Local) {
        for contact in self.contacts.of(i) {
            if let Some(push) = contact.push(here) {
                local.force -= push.gradient;
                local.block += push.block(contact.normal);
            }
        }
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::descent::kernel::Kernel;
    use crate::{BodyDescription, ConstitutiveModel, Material, ModelBuilder, SupportPlane};
    use glam::{DMat3, DVec3, Vec3};
    use trocar_geometry::TetMesh;

    /// Five elements around one inner node, in no special position.
    fn mesh() -> TetMesh {
        let p = |x: f64, y: f64, z: f64| 1e-3 * DVec3::new(x, y, z);
        let mut mesh = TetMesh {
            vertices: vec![
                p(0.1, 0.2, 0.1),
                p(2.0, 0.0, -1.0),
                p(-1.5, 1.8, -1.1),
                p(-1.2, -1.9, -0.9),
                p(0.2, 0.1, 2.1),
                p(0.1, 0.0, -2.2),
            ],
            tets: vec![[0, 1, 2, 4], [0, 2, 3, 4], [0, 3, 1, 4], [0, 2, 1, 5], [0, 3, 2, 5], [0, 1, 3, 5]],
        };
        for t in 0..mesh.tets.len() {
            if mesh.tet_volume(t) < 0.0 {
                mesh.tets[t].swap(2, 3);
            }
        }
        mesh
    }

    /// A deterministic number in -1..1.
    fn noise(k: usize) -> f64 {
        ((k as f64 * 12.9898).sin() * 43758.5453).fract()
    }

    /// Energy of the substep's incremental potential in double precision, from the textbook forms.
    fn energy(substep: &Substep<'_>, x: &[DVec3]) -> f64 {
        let body = substep.body;
        let psi = body.material.hyperelastic();
        let gradient = |v: [DVec3; 4]| DMat3::from_cols(v[1] - v[0], v[2] - v[0], v[3] - v[0]);
        let mut sum = 0.0;
        for (t, tet) in body.tets.iter().enumerate() {
            let f = gradient(tet.map(|i| x[i as usize])) * gradient(body.rest.corners(t)).inverse();
            sum += body.volumes[t] * psi.energy(f);
        }
        let h = f64::from(substep.h);
        for (i, vertex) in body.vertices.iter().enumerate() {
            sum += 0.5 * f64::from(vertex.mass) / (h * h) * (x[i] - substep.predictor[i].as_dvec3()).length_squared();
            for edge in body.edges_of(i) {
                // Each edge is met twice.
                let j = edge.to as usize;
                let start = |k: usize| substep.start[k].as_dvec3();
                let before = (start(j) - start(i)).length_squared();
                let change = 0.5 * ((x[j] - x[i]).length_squared() - before);
                sum += 0.5 * 0.5 * f64::from(edge.damping) / (h * before) * change * change;
            }
            for support in &body.supports {
                let height = support.contact(x[i] + body.origin).height.min(0.0);
                sum += 0.5 * f64::from(vertex.contact_stiffness) * height * height;
            }
        }
        sum
    }

    /// The kernels' forces are the negative gradient of the energy, and their blocks its second
    /// derivative (for St. Venant-Kirchhoff and corotated tissue in a stretched state, where
    /// nothing of it is dropped).
    #[test]
    fn forces_and_blocks_are_the_energys_derivatives() {
        let mesh = mesh();
        for (model, stretch) in [
            (ConstitutiveModel::StableNeoHookean, 1.0),
            (ConstitutiveModel::StableNeoHookean, 0.45),
            (ConstitutiveModel::StableNeoHookean, 4.5),
            (ConstitutiveModel::StVenantKirchhoff, 1.4),
            (ConstitutiveModel::Corotated, 1.4),
            (ConstitutiveModel::Corotated, 4.5),
        ] {
            let material =
                Material { model, young_modulus: 12e3, poisson_ratio: 0.45, density: 1200.0, viscosity: 4.0 };
            let centre = mesh.vertices.iter().sum::<DVec3>() / 6.0;
            let plane = SupportPlane { point: centre, normal: DVec3::Z, friction: 0.0 };
            let supports = vec![plane.into()];
            let body = BodyDescription { name: "star".into(), mesh: &mesh, material, pinned: vec![], supports };
            let mut builder = ModelBuilder::new();
            builder.body(body).unwrap();
            let built = builder.build().unwrap();
            let body = &built.bodies[0];
            let rest: Vec<DVec3> = (0..6)
                .map(|i| mesh.vertices[body.internal.iter().position(|k| *k == i).unwrap()] - body.origin)
                .collect();
            let moved = |k: usize, by: f64| by * DVec3::new(noise(k), noise(k + 50), noise(k + 100));
            let x: Vec<DVec3> = rest.iter().enumerate().map(|(i, p)| stretch * p + moved(i, 1e-4)).collect();
            let to_f32 = |x: &[DVec3]| -> Vec<Vec3A> { x.iter().map(|p| p.as_vec3a()).collect() };
            let predictor: Vec<DVec3> = x.iter().enumerate().map(|(i, p)| p + moved(i + 7, 1e-4)).collect();
            let mut stretched = StretchedElements::default();
            stretched.find(body, &to_f32(&x));
            let substep = Substep {
                body,
                h: 1.0 / 480.0,
                start: &to_f32(&rest),
                predictor: &to_f32(&predictor),
                fixed: &[false; 6],
                contacts: &ContactSet::of_everything(body, &to_f32(&rest)),
                stretched: &stretched,
                isa: Isa::detect(),
                single_thread: false,
            };
            let at: Vec<DVec3> = to_f32(&x).iter().map(|p| p.as_dvec3()).collect();
            for i in 0..6 {
                let mut memory = [(Vec3A::ZERO, 0.0); MAX_REMEMBERED_CORNERS];
                let local = match Kernel::of(body) {
                    Kernel::StableNeoHookean(term) => substep.local(&term, i, &to_f32(&x), &mut memory),
                    Kernel::StVenantKirchhoff(term) => substep.local(&term, i, &to_f32(&x), &mut memory),
                    Kernel::Corotated(term) => substep.local(&term, i, &to_f32(&x), &mut memory),
                };
                let d = 1e-7;
                let shifted = |steps: DVec3| {
                    let mut x = at.clone();
                    x[i] += d * steps;
                    energy(&substep, &x)
                };
                // The blocks leave the dashpots' geometric stiffness out.
                let geometric = |edge: &crate::body::Edge| {
                    let j = edge.to as usize;
                    let before = (rest[j] - rest[i]).length_squared();
                    let change = 0.5 * ((at[j] - at[i]).length_squared() - before);
                    f64::from(edge.damping) / (f64::from(substep.h) * before) * change
                };
                let geometric: f64 = body.edges_of(i).iter().map(geometric).sum();
                let scale = f64::from(local.force.length()).max(1e-3);
                let stiffness = f64::from(local.block.x_axis.length());
                for (row, a) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
                    let force = -(shifted(a) - shifted(-a)) / (2.0 * d);
                    let (said, model) = (f64::from(local.force.to_array()[row]), body.material.model);
                    assert!(
                        (said - force).abs() < 2e-3 * scale,
                        "{model:?} node {i}: {said} N, {force} N by differences"
                    );
                    for (column, b) in [Vec3::X, Vec3::Y, Vec3::Z].into_iter().enumerate() {
                        let b = b.as_dvec3();
                        let second =
                            (shifted(a + b) - shifted(a - b) - shifted(b - a) + shifted(-a - b)) / (4.0 * d * d);
                        let second = if row == column { second - geometric } else { second };
                        let said = f64::from(local.block.col(column).to_array()[row]);
                        assert!(
                            (said - second).abs() < 0.01 * stiffness,
                            "{model:?} node {i}: {said} N/m, {second} by differences"
                        );
                    }
                }
            }
        }
    }
}
