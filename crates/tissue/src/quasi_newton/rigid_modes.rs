//! The rigid motions of a body that nothing holds: their inertia, contacts and solve.

use super::iterate::position;
use super::layout::Layout;
use crate::contact::Push;
use crate::lanes::Row;
use glam::{DMat3, DVec3, Vec3A};

type Matrix = [[f64; 6]; 6];

/// Rigid motions of a body about its centre of mass: displacement, then rotation.
#[derive(Clone, Copy, Default)]
pub(super) struct RigidModes {
    centre: Vec3A,
    /// Inertia and contacts over them; its Cholesky factor once complete.
    matrix: Matrix,
    /// Cholesky factor of the inertia alone (kg, kg m2).
    inertia: Matrix,
    /// Right-hand side.
    pub force: [f64; 6],
}

impl RigidModes {
    /// Of a free body with its nodes at `x`: inertia over squared substeps.
    pub fn new(layout: &Layout, x: &[Row], h: f32) -> Self {
        let nodes = || x[..layout.free].iter().map(position).zip(&layout.masses);
        let (mass, moment) = nodes().fold((0.0f32, Vec3A::ZERO), |(m, sum), (x, mass)| (m + mass, sum + *mass * x));
        let centre = moment / mass;
        let mut rigid = Self { centre, ..Self::default() };
        let inertia = nodes().fold(DMat3::ZERO, |sum, (x, mass)| {
            let (r, m) = ((x - centre).as_dvec3(), f64::from(*mass));
            sum + m * (DMat3::from_diagonal(DVec3::splat(r.length_squared())) - outer(r))
        });
        for k in 0..3 {
            rigid.inertia[k][k] = f64::from(mass);
            for c in 0..3 {
                rigid.inertia[3 + k][3 + c] = inertia.col(c)[k];
            }
        }
        let rate = 1.0 / (f64::from(h) * f64::from(h));
        rigid.matrix = rigid.inertia.map(|row| row.map(|entry| rate * entry));
        rigid
    }

    /// Adds a contact of stiffness `push` with `normal`. `arms` are the body's vertices in it:
    /// where each is, and which share of its motion the offset of the contact changes by.
    pub fn add(&mut self, push: &Push, normal: Vec3A, arms: impl Iterator<Item = (Vec3A, f32)>) {
        let (mut whole, mut arm) = (0.0, DVec3::ZERO);
        for (x, share) in arms {
            whole += f64::from(share);
            arm += f64::from(share) * (x - self.centre).as_dvec3();
        }
        let n = normal.as_dvec3();
        let (along, across) = (f64::from(push.along), f64::from(push.across));
        for (direction, stiffness) in [(n, along - across), (DVec3::X, across), (DVec3::Y, across), (DVec3::Z, across)]
        {
            let turn = arm.cross(direction);
            let row = [whole * direction, turn].map(|v| v.to_array());
            let row: [f64; 6] = std::array::from_fn(|k| row[k / 3][k % 3]);
            for (line, a) in self.matrix.iter_mut().zip(row) {
                line.iter_mut().zip(row).for_each(|(entry, b)| *entry += stiffness * a * b);
            }
        }
    }

    /// Factorises both matrices; false if one is not positive definite.
    pub fn factorise(&mut self) -> bool {
        factorise(&mut self.matrix) && factorise(&mut self.inertia)
    }

    /// The rigid acceleration by the right-hand side, with the inertia alone.
    pub fn acceleration(&self) -> impl Fn(Vec3A) -> Vec3A {
        self.motion(solve(&self.inertia, self.force))
    }

    /// The rigid motion that the right-hand side makes with inertia and contacts, less the rigid
    /// part `sum` of a motion weighted by mass.
    pub fn correction(&self, sum: [f64; 6]) -> impl Fn(Vec3A) -> Vec3A {
        let fine = solve(&self.inertia, sum);
        let coarse = solve(&self.matrix, self.force);
        self.motion(std::array::from_fn(|k| coarse[k] - fine[k]))
    }

    /// Sum and moment of a force at each node.
    pub fn sum(&self, nodes: impl Iterator<Item = (Vec3A, Vec3A)>) -> [f64; 6] {
        let (mut sum, mut moment) = (DVec3::ZERO, DVec3::ZERO);
        for (x, force) in nodes {
            sum += force.as_dvec3();
            moment += (x - self.centre).as_dvec3().cross(force.as_dvec3());
        }
        [sum.x, sum.y, sum.z, moment.x, moment.y, moment.z]
    }

    /// A rigid motion as a function of the place.
    fn motion(&self, by: [f64; 6]) -> impl Fn(Vec3A) -> Vec3A {
        let way = DVec3::new(by[0], by[1], by[2]).as_vec3a();
        let turn = DVec3::new(by[3], by[4], by[5]).as_vec3a();
        let centre = self.centre;
        move |x| way + turn.cross(x - centre)
    }
}

/// Cholesky's factor in place of the lower triangle; false if the matrix is not positive definite.
fn factorise(m: &mut Matrix) -> bool {
    for j in 0..6 {
        for i in j..6 {
            let known: f64 = (0..j).map(|k| m[i][k] * m[j][k]).sum();
            let rest = m[i][j] - known;
            if i == j && (rest.is_nan() || rest <= 0.0) {
                return false;
            }
            m[i][j] = if i == j { rest.sqrt() } else { rest / m[j][j] };
        }
    }
    true
}

fn solve(m: &Matrix, mut x: [f64; 6]) -> [f64; 6] {
    for i in 0..6 {
        let known: f64 = (0..i).map(|k| m[i][k] * x[k]).sum();
        x[i] = (x[i] - known) / m[i][i];
    }
    for i in (0..6).rev() {
        let known: f64 = (i + 1..6).map(|k| m[k][i] * x[k]).sum();
        x[i] = (x[i] - known) / m[i][i];
    }
    x
}

fn outer(v: DVec3) -> DMat3 {
    DMat3::from_cols(v * v.x, v * v.y, v * v.z)
}
