//! Repairs a body with inverted elements.
//!
//! The solvers let no element invert, but a state can be set so. No energy of a material leads back
//! from everywhere: random positions are full of local minima, and barrier and guard keep inverted
//! elements inverted. So the body is first relaxed under another energy, sum L |(x_j - x_i) - R
//! (X_j - X_i)|^2 over its edges (rest length L, rest positions X, R the rotation that fits the
//! body best). This energy is convex. Where nothing holds the body, its only minimum is the rest
//! shape, turned by R.

use crate::Body;
use crate::frame::Frame;
use crate::inversion_guard::volume_ratio;
use crate::state::BodyState;
use glam::{DMat3, DVec3, Mat3A, Vec3A};

/// Volume ratio that every element must have before the material's energy takes over: near enough
/// to the rest shape to end in it.
const REPAIRED_VOLUME_RATIO: f32 = 0.6;

/// Sweeps between two checks of the elements, and greatest number of checks a frame.
const SWEEPS_PER_CHECK: usize = 5;
const MAX_CHECKS: usize = 100;

/// A body's rest shape and scratch memory.
pub(crate) struct Untangler {
    rest: Vec<Vec3A>,
    fixed: Vec<bool>,
}

impl Untangler {
    /// For a body that is at `rest`.
    pub fn new(rest: &BodyState) -> Self {
        Self { rest: rest.x.clone(), fixed: vec![false; rest.x.len()] }
    }

    /// Repairs a disturbed body if one of its elements is inverted, as far as one frame's effort
    /// goes. The body is at rest afterwards. Pinned and held nodes stay.
    pub fn untangle(&mut self, frame: &Frame<'_>, body: &Body, state: &mut BodyState) {
        if !std::mem::take(&mut state.disturbed) {
            return;
        }
        // The report finds numbers that are not finite.
        if !(least_ratio(body, &state.x) <= 0.0 && state.x.iter().all(|x| x.is_finite())) {
            return;
        }
        for (fixed, vertex) in self.fixed.iter_mut().zip(&body.vertices) {
            *fixed = vertex.pinned;
        }
        for grasp in frame.grasps() {
            grasp.nodes.iter().for_each(|i| self.fixed[body.internal[*i as usize] as usize] = true);
        }
        let turn = self.rotation(body, &state.x[..body.len()]);
        let nodes = body.len();
        for _ in 0..MAX_CHECKS {
            (0..SWEEPS_PER_CHECK).for_each(|_| self.sweep(body, turn, &mut state.x[..nodes]));
            if least_ratio(body, &state.x) > REPAIRED_VOLUME_RATIO {
                break;
            }
        }
        state.v.fill(Vec3A::ZERO);
        state.warm.falling.fill(0.0);
        // The next frame continues a repair that one frame did not finish.
        state.disturbed = least_ratio(body, &state.x) <= 0.0;
    }

    /// Moves each vertex in turn to its minimum: the mean of where its neighbours want it.
    fn sweep(&self, body: &Body, turn: Mat3A, x: &mut [Vec3A]) {
        for i in (0..x.len()).filter(|i| !self.fixed[*i]) {
            let (mut sum, mut weights) = (Vec3A::ZERO, 0.0);
            for edge in body.edges_of(i) {
                let j = edge.to as usize;
                sum += edge.length * (x[j] + turn * (self.rest[i] - self.rest[j]));
                weights += edge.length;
            }
            x[i] = sum / weights;
        }
    }

    /// The rotation that brings the rest shape nearest to x: of the fixed nodes if there are more
    /// than two, of all nodes otherwise.
    fn rotation(&self, body: &Body, x: &[Vec3A]) -> Mat3A {
        if self.fixed.iter().filter(|fixed| **fixed).count() > 2 {
            return fit(body, &self.rest, x, |i| self.fixed[i]);
        }
        fit(body, &self.rest, x, |_| true)
    }
}

/// Davenport's quaternion by power iteration on the shifted matrix (Horn 1987): always a rotation,
/// even if elements are inverted.
fn fit(body: &Body, rest: &[Vec3A], x: &[Vec3A], counts: impl Fn(usize) -> bool) -> Mat3A {
    let (mut mass, mut from, mut to) = (0.0, DVec3::ZERO, DVec3::ZERO);
    let chosen = || (0..x.len()).filter(|i| counts(*i));
    for i in chosen() {
        let m = f64::from(body.vertices[i].mass);
        (mass, from, to) = (mass + m, from + m * rest[i].as_dvec3(), to + m * x[i].as_dvec3());
    }
    let (from, to) = (from / mass, to / mass);
    let mut s = DMat3::ZERO;
    for i in chosen() {
        let (p, q) = (rest[i].as_dvec3() - from, x[i].as_dvec3() - to);
        let q = f64::from(body.vertices[i].mass) * q;
        // Entry (row of p, column of q).
        s += DMat3::from_cols(p * q.x, p * q.y, p * q.z);
    }
    let [a, b, c] = [s.x_axis, s.y_axis, s.z_axis];
    let n = [
        [a.x + b.y + c.z, c.y - b.z, a.z - c.x, b.x - a.y],
        [c.y - b.z, a.x - b.y - c.z, b.x + a.y, a.z + c.x],
        [a.z - c.x, b.x + a.y, b.y - a.x - c.z, c.y + b.z],
        [b.x - a.y, a.z + c.x, c.y + b.z, c.z - a.x - b.y],
    ];
    let shift = n.iter().flatten().map(|v| v.abs()).sum::<f64>();
    let mut quaternion = [1.0, 1e-3, 2e-3, 3e-3];
    for _ in 0..200 {
        let next = [0, 1, 2, 3].map(|r| (0..4).map(|c| n[r][c] * quaternion[c]).sum::<f64>() + shift * quaternion[r]);
        let length = next.iter().map(|v| v * v).sum::<f64>().sqrt();
        if !(length > 0.0 && length.is_finite()) {
            return Mat3A::IDENTITY;
        }
        quaternion = next.map(|v| v / length);
    }
    let [w, x, y, z] = quaternion;
    Mat3A::from_quat(glam::DQuat::from_xyzw(x, y, z, w).as_quat())
}

fn least_ratio(body: &Body, x: &[Vec3A]) -> f32 {
    let ratios = body.tets.iter().zip(&body.volumes).map(|(tet, volume)| volume_ratio(tet, x, *volume as f32));
    ratios.fold(f32::INFINITY, f32::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BodyDescription, ConstitutiveModel, Material, ModelBuilder, State};
    use trocar_geometry::TetMesh;

    fn tet() -> crate::Model {
        let p = |x: f64, y: f64, z: f64| 1e-2 * DVec3::new(x, y, z);
        let vertices = vec![p(0.0, 0.0, 0.0), p(1.0, 0.0, 0.3), p(0.0, 1.3, 0.4), p(0.3, 0.3, 1.7)];
        let mesh = TetMesh { vertices, tets: vec![[0, 1, 2, 3]] };
        let material = Material {
            model: ConstitutiveModel::StableNeoHookean,
            young_modulus: 12e3,
            poisson_ratio: 0.45,
            density: 1200.0,
            viscosity: 0.0,
        };
        let body = BodyDescription { name: "tet".into(), mesh: &mesh, material, pinned: vec![], supports: vec![] };
        let mut builder = ModelBuilder::new();
        builder.body(body).unwrap();
        builder.build().unwrap()
    }

    #[test]
    fn the_rotation_is_found() {
        let model = tet();
        let rest = State::new(&model).bodies[0].x.clone();
        for angles in [[0.3, -0.2, 0.9], [2.9, 0.4, -1.5], [0.0, 0.0, 3.1]] {
            let turn = glam::Quat::from_euler(glam::EulerRot::XYZ, angles[0], angles[1], angles[2]);
            let turned: Vec<Vec3A> = rest.iter().map(|p| turn * *p + Vec3A::new(0.1, 0.2, 0.3)).collect();
            let found = fit(&model.bodies[0], &rest, &turned, |_| true);
            assert!(found.abs_diff_eq(Mat3A::from_quat(turn), 1e-3), "{angles:?}: {found}");
        }
    }
}
